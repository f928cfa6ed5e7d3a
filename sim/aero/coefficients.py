"""Aerodynamic coefficients and surface maps from Python: arrays in, arrays out.

The flight simulation does not pass here; it calls the compiled :func:`sim.aero.aerodynamics.loads`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim.aero import aerodynamics as aero
from sim.aero.aeromodel import prepare
from sim.aero.gas import GAMMA
from sim.aero.methods import Methods, Resolution, Wall, methods
from sim.body.geometry import BodyShape
from sim.body.vehicle import Vehicle, vehicle_from_shape
from sim.core.checks import check_fields, check_kinds, float_array
from sim.core.errors import InputError

__all__ = ["Air", "Coefficients", "SurfaceMap", "coefficients", "surface"]

Floats = NDArray[np.float64]

# Converged to about 1e-6; the flight's default resolution is coarser (docs/validation/aero-convergence.md).
FINE = Resolution(24, 24, 12, 10, 8, 12, 6)


@dataclass(frozen=True)
class Air:
    """State of the free stream: pressure (Pa), density (kg/m3) and temperature (K)."""

    pressure_Pa: float
    density_kg_m3: float
    temperature_K: float

    def __post_init__(self) -> None:
        check_fields(self)
        for name, value in self.__dict__.items():
            if not value > 0.0:
                raise InputError(f"free-stream {name} must be positive, got {value:g}")

    @property
    def sound_speed_m_s(self) -> float:
        """Speed of sound, sqrt(gamma p / rho)."""
        return math.sqrt(GAMMA * self.pressure_Pa / self.density_kg_m3)


@dataclass(frozen=True)
class Coefficients:
    """Loads over an array of flight conditions, per the vehicle's reference area and length.

    All arrays have the broadcast shape of the Mach numbers and angles asked for. Signs as in
    :mod:`sim.aero.aerodynamics`: ``CM_nose`` is nose-up positive about the nose tip. Friction and heating are
    zero when no air was given.
    """

    mach: Floats
    alpha_deg: Floats
    CA: Floats
    CN: Floats
    CM_nose: Floats
    xcp_m: Floats
    Cmq: Floats
    stagnation_heat_flux_W_m2: Floats
    surface_heat_rate_W: Floats
    surface_heat_inflow_W: Floats
    CA_friction: Floats
    CN_friction: Floats
    CA_base: Floats


def coefficients(
    vehicle: Vehicle | BodyShape,
    mach: ArrayLike,
    alpha_deg: ArrayLike = 0.0,
    preset: str | Methods = "paper",
    *,
    air: Air | None = None,
    wall: Wall | None = None,
    resolution: Resolution = FINE,
    **changes: Any,
) -> Coefficients:
    """Aerodynamic coefficients at given Mach numbers and angles of attack.

    Parameters
    ----------
    vehicle : Vehicle or BodyShape
        A bare shape gets its base area and diameter as references.
    mach, alpha_deg : array_like
        Broadcast against each other; 0 <= alpha <= 180.
    preset : str or Methods
        Aerodynamic methods; ``"newtonian"`` with ``stagnation_cp=2.0`` gives the classical closed forms.
    air : Air, optional
        Free stream for skin friction and heating; without it only pressure is evaluated.
    wall, resolution
        Wall temperature (none: that of the methods) and quadrature.
    **changes
        Fields of :class:`sim.aero.methods.Methods` to replace.

    Returns
    -------
    Coefficients

    Examples
    --------
    >>> from sim.body.geometry import sphere_cone
    >>> body = sphere_cone(half_angle_deg=9.0, nose_radius_m=0.3, base_radius_m=1.0)
    >>> c = coefficients(body, 10.0, [0.0, 10.0], "newtonian", stagnation_cp=2.0)
    >>> c.CA.round(6)
    array([0.134592, 0.158616])
    """
    if isinstance(vehicle, BodyShape):
        vehicle = vehicle_from_shape(vehicle)
    check_kinds(vehicle=(vehicle, Vehicle))
    mach_array, alpha_array = _conditions(mach, alpha_deg)
    chosen = methods(preset, **changes)
    if air is None and chosen.stagnation_cp == "equilibrium_air":
        raise InputError("equilibrium air depends on the density: pass the free stream as air=Air(...)")
    model = prepare(vehicle, chosen, wall, resolution)
    table = np.empty((mach_array.size, aero.N_LOADS))
    for row, m, alpha in zip(table, mach_array.ravel(), np.radians(alpha_array).ravel(), strict=True):
        if air is None:
            aero.inviscid_loads(model, float(m), float(alpha), row)
        else:
            speed = float(m) * air.sound_speed_m_s
            state = (air.pressure_Pa, air.density_kg_m3, air.temperature_K)
            aero.loads(model, speed, float(m), float(alpha), *state, row)

    def column(index: int) -> Floats:
        return table[:, index].reshape(mach_array.shape)

    return Coefficients(
        mach=mach_array,
        alpha_deg=alpha_array,
        CA=column(aero.CA),
        CN=column(aero.CN),
        CM_nose=column(aero.CM_NOSE),
        xcp_m=column(aero.XCP_M),
        Cmq=column(aero.CMQ),
        stagnation_heat_flux_W_m2=column(aero.STAGNATION_HEAT_FLUX),
        surface_heat_rate_W=column(aero.SURFACE_HEAT_RATE),
        surface_heat_inflow_W=column(aero.SURFACE_HEAT_INFLOW),
        CA_friction=column(aero.CA_FRICTION),
        CN_friction=column(aero.CN_FRICTION),
        CA_base=column(aero.CA_BASE),
    )


@dataclass(frozen=True)
class SurfaceMap:
    """What every surface element feels; arrays of shape (stations, meridians) unless said otherwise.

    Parameters
    ----------
    x_m, r_m, s_m : ndarray, shape (stations,)
        Axial position, radius and running length from the nose tip.
    phi_deg : ndarray, shape (meridians,)
        Meridian angle, 0 on the windward side, 180 on the leeward side.
    """

    x_m: Floats
    r_m: Floats
    s_m: Floats
    phi_deg: Floats
    cp: Floats
    shear_Pa: Floats
    heat_flux_W_m2: Floats
    wall_temperature_K: Floats


def surface(
    vehicle: Vehicle | BodyShape,
    mach: float,
    alpha_deg: float,
    air: Air,
    preset: str | Methods = "paper",
    *,
    wall: Wall | None = None,
    stations: int = 20,
    meridians: int = 37,
    **changes: Any,
) -> SurfaceMap:
    """Pressure, friction, heat flux and wall temperature over the surface at one flight condition.

    Parameters
    ----------
    stations : int
        Rings on the nose and stations on every segment (Gauss points, none on an edge).
    meridians : int
        Equally spaced from the windward to the leeward meridian.

    Returns
    -------
    SurfaceMap
    """
    if isinstance(vehicle, BodyShape):
        vehicle = vehicle_from_shape(vehicle)
    check_kinds(vehicle=(vehicle, Vehicle))
    _conditions(mach, alpha_deg)
    if not meridians >= 1:
        raise InputError(f"meridians must be at least 1, got {meridians}")
    resolution = Resolution(friction_rings=stations, friction_stations=stations)
    model = prepare(vehicle, methods(preset, **changes), wall, resolution)
    phi_deg = np.linspace(0.0, 180.0, meridians)
    out = np.empty((4, model.station_x.size, meridians))
    speed = mach * air.sound_speed_m_s
    state = (air.pressure_Pa, air.density_kg_m3, air.temperature_K)
    aero.surface_elements(
        model, speed, float(mach), math.radians(alpha_deg), *state, np.radians(phi_deg), out
    )
    order = np.argsort(model.station_run, kind="stable")
    return SurfaceMap(
        x_m=model.station_x[order],
        r_m=model.station_r[order],
        s_m=model.station_run[order],
        phi_deg=phi_deg,
        cp=out[0][order],
        shear_Pa=out[1][order],
        heat_flux_W_m2=out[2][order],
        wall_temperature_K=out[3][order],
    )


def _conditions(mach: ArrayLike, alpha_deg: ArrayLike) -> tuple[Floats, Floats]:
    """Mach numbers and angles of attack as arrays of one shape; refuses those that no flow has."""
    machs, alphas = float_array("mach", mach), float_array("alpha_deg", alpha_deg)
    if not (np.all(machs > 0.0) and np.all(np.isfinite(machs))):
        raise InputError("Mach numbers must be positive")
    if not (np.all(alphas >= 0.0) and np.all(alphas <= 180.0)):
        raise InputError("angles of attack must lie between 0 and 180 deg")
    try:
        both = np.broadcast_arrays(machs, alphas)
    except ValueError:
        raise InputError(
            f"Mach numbers of shape {machs.shape} and angles of shape {alphas.shape} do not go together"
        ) from None
    return both[0], both[1]
