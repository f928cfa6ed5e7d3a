"""Tables 1 to 6 of the paper, what goes into a flight, with our numbers beside them."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import fly
import numpy as np
import pandas as pd
import printed

from rsmkit import Study
from sim import PRESETS, Air, Vehicle, Wall, coefficients, reference_vehicle, us1962


def settings_table(study: Study) -> pd.DataFrame:
    """Table 1: parameters of the genetic algorithms."""
    options = study.searches[0]
    bounds = {name: f"{low:g} .. {high:g}" for name, (low, high) in printed.BOUNDS.items()}
    rows = [
        ("Generations", printed.GENERATIONS, options.size.generations),
        ("Population size", printed.POPULATION, options.size.population),
        *((f"Bounds of {f.title}", bounds[f.name], f"{f.low:g} .. {f.high:g}") for f in study.space),
        ("Mutation", "adapt feasible", f"{options.size.operators} feasible"),
        ("Fitness (A)", "0.2 F1 + 0.7 F2 + 0.1 F3", options.minimize),
        ("Fitness (B)", "F1, F2, F3", ", ".join(fly.RESPONSES)),
        ("Hybrid function", "fmincon, fgoalattain", "SLSQP from the best individuals"),
    ]
    return frame(rows, ("parameter", "printed", "ours"))


def initial_conditions(study: Study) -> pd.DataFrame:
    """Table 2: start of the flight."""
    assert study.file.simulator
    s: dict[str, Any] = dict(study.file.simulator.settings)
    ours = (
        f"speed {s['speed_m_s']:g} m/s",
        f"flight-path angle {s['theta_deg']:g} deg",
        f"heading {s['nu_deg']:g} deg",
        f"angle of attack {s['alpha_deg']:g} deg",
        f"altitude {s['altitude_m'] / 1000:g} km",
        "body rates 0",
    )
    rows = [(*row, mine) for row, mine in zip(printed.INITIAL_CONDITIONS.items(), ours, strict=True)]
    return frame(rows, ("symbol", "printed", "our reading"))


def methods_table() -> pd.DataFrame:
    """Table 3: engineering methods, and the functions that implement them."""
    ours = {
        "inviscid": (
            "inviscid.osu_blunt_body",
            "inviscid.modified_newtonian",
            "inviscid.newtonian_prandtl_meyer",
            "inviscid.tangent_cone_hammitt_murthy (two more to choose from)",
            "inviscid.shadow_pressure, vacuum_pressure",
        ),
        "viscous": ("viscous: reference enthalpy, laminar", "viscous: Spalding-Chi, turbulent"),
    }
    rows = [
        (flow, method, function)
        for flow in ours
        for method, function in zip(printed.METHODS[flow], ours[flow], strict=True)
    ]
    return frame(rows, ("flow", "printed", "sim."))


def paper_vehicle() -> Vehicle:
    """The vehicle of Tables 4-6: the paper's GA optimum with our lengths."""
    theta_c1, theta_c2, radius = printed.GA_OPTIMUM
    return reference_vehicle(math.degrees(theta_c1), math.degrees(theta_c2), radius)


def coefficient(
    name: str, condition: tuple[float, ...], preset: str, vehicle: Vehicle, **changes: Any
) -> float:
    """CA, CN or Cm (nose-down positive, as the paper has it) at a row's Mach number, incidence and height.

    Every preset in the paper's perfect gas, along a wall at 1000 K.
    """
    mach, alpha, height = (float(number) for number in condition[:3])
    state = us1962()(1000.0 * height)
    air = Air(float(state.pressure_Pa), float(state.density_kg_m3), float(state.temperature_K))
    flow: dict[str, Any] = {"air": air, "wall": Wall(), "stagnation_cp": "perfect_gas", **changes}
    c = coefficients(vehicle, mach, alpha, preset, **flow)
    return float({"CA": c.CA, "CN": c.CN, "Cm": -c.CM_nose}[name])


def aerodynamics(name: str, presets: tuple[str, ...] = tuple(PRESETS), **changes: Any) -> pd.DataFrame:
    """Tables 4 (CA), 5 (CN) and 6 (Cm): printed CFD and Subroutine, and ours by preset."""
    rows = []
    for mach, alpha, height, cfd, subroutine, difference in printed.AERODYNAMICS[name]:
        row: dict[str, float] = {"Mach": mach, "alpha": alpha, "height": height}
        row |= {"CFD": cfd, "Subroutine": subroutine, "printed Diff%": difference}
        for preset in presets:
            row[preset] = coefficient(name, (mach, alpha, height), preset, paper_vehicle(), **changes)
        row["ours-Subr. %"] = percent(row["paper"], subroutine)
        row["ours-CFD %"] = percent(row["paper"], cfd)
        rows.append(row)
    return pd.DataFrame(rows)


@cache
def aerodynamic_differences() -> pd.DataFrame:
    """Root-mean-square differences of the 16 non-zero entries of Tables 4-6, per cent."""
    every = pd.concat([aerodynamics(name) for name in printed.AERODYNAMICS])
    # the same laws with the sharp shadow line of a table program; a flight needs the smooth one
    sharp = [aerodynamics(name, ("paper",), shadow_ramp=0.0)["paper"] for name in printed.AERODYNAMICS]
    every["paper, sharp shadow line"] = pd.concat(sharp)
    every = every[every["Subroutine"] != 0]

    def rms(ours: str, theirs: str) -> float:
        return float(np.sqrt(((100 * (every[ours] / every[theirs] - 1)) ** 2).mean()))

    rows = [("the paper's Subroutine", math.nan, rms("Subroutine", "CFD"))]
    rows += [
        (f"ours, {preset}", rms(preset, "Subroutine"), rms(preset, "CFD"))
        for preset in ("paper, sharp shadow line", *PRESETS)
    ]
    return frame(rows, ("method", "rms from Subroutine %", "rms from CFD %"))


def percent(value: float, reference: float) -> float:
    """Difference from a reference in per cent of it; nan when the reference is zero."""
    return 100 * (value - reference) / abs(reference) if reference else math.nan


def frame(rows: list[Any], columns: tuple[str, ...]) -> pd.DataFrame:
    """A table from its rows."""
    return pd.DataFrame(rows, columns=list(columns))
