"""Figures of a flight (matplotlib, imported only when a figure is drawn)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib.pyplot as plt

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from sim.flight.history import History

__all__ = ["plot_history"]

_PANELS = (
    ("altitude_m", 1e-3, "altitude (km)"),
    ("speed_m_s", 1.0, "speed (m/s)"),
    ("path_angle_deg", 1.0, "path angle (deg)"),
    ("mach", 1.0, "Mach number"),
    ("dynamic_pressure_Pa", 1e-3, "dynamic pressure (kPa)"),
    ("load_factor_g", 1.0, "load factor (g)"),
    ("alpha_deg", 1.0, "angle of attack (deg)"),
    ("pitch_rate_deg_s", 1.0, "pitch rate (deg/s)"),
    ("CA", 1.0, "axial force coefficient"),
    ("static_margin", 1.0, "static margin (calibres)"),
    ("stagnation_heat_flux_W_m2", 1e-6, "stagnation heat flux (MW/m2)"),
    ("downrange_m", 1e-3, "downrange (km)"),
)


def plot_history(history: History) -> Figure:
    """Draw the paper's Figure 3: twelve quantities of a flight over time, on one page."""
    figure, axes = plt.subplots(4, 3, figsize=(11.0, 11.0), sharex=True, layout="constrained")
    for axis, (name, factor, label) in zip(axes.flat, _PANELS, strict=True):
        axis.plot(history["time_s"], factor * history[name], linewidth=0.9)
        axis.set_ylabel(label)
        axis.grid(alpha=0.3)
    for axis in axes[-1]:
        axis.set_xlabel("time (s)")
    return figure
