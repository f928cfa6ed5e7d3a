"""What a flight's numbers are good for: where it left the range of the models, in sentences.

Each limit is one function of :data:`LIMITS`; :attr:`sim.flight.history.History.notes` asks them all.

========================= ====================================================================================
thin air                  Knudsen number (mean free path over diameter) above 0.01: not a continuum any more
dissociation              air is calorically perfect; it dissociates behind a shock from about 4.4 km/s on
radiation                 the shock layer's radiation heats as well from about 9 km/s on, and is not computed
pointed nose              no heating law has a finite value there
blunt face                subsonic flow all over the face, which impact laws do not know
base first                the laws of the base, the damping and the heating are made for the wake
incidence                 beyond 40 deg to the stream the flow on the lee side has left the surface
Mach number               below 1.5 pressure and base drag are correlations for slender bodies
fitted laws               a law flown outside the Mach numbers it was fitted at
heat given back           a wall hotter than the air's recovery temperature cools into it
unstable                  the static margin turned negative
skip-out                  the flight left the atmosphere's table
========================= ====================================================================================
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from sim.aero.pressure_laws.faces import NO_FACE
from sim.aero.pressure_laws.laws import PRESSURE_LAWS
from sim.aero.thin_air.rarefied import CONTINUUM_END, knudsen_number
from sim.air.atmosphere import Floats
from sim.flight.dynamics import STAGNATION_HEAT, STAGNATION_INFLOW, SURFACE_HEAT, SURFACE_INFLOW, Flight
from sim.flight.integrator import LEFT_RANGE, Path

__all__ = ["LIMITS", "flight_notes"]

Flags = NDArray[np.bool_]


class Flown(Protocol):
    """What the limits ask of a :class:`sim.flight.history.History`."""

    @property
    def flight(self) -> Flight: ...
    @property
    def path(self) -> Path: ...
    def __getitem__(self, name: str) -> Floats: ...
    def final(self, name: str) -> float: ...
    def seconds(self, when: Flags) -> float: ...
    def integral(self, values: Floats) -> float: ...


DISSOCIATION_M_S = 4400.0
RADIATION_M_S = 9000.0
LARGEST_INCIDENCE_DEG = 40.0
SLOWEST_MACH = 1.5
POINTED_SHARE = 1e-3
BLUNT_SIN = math.sin(math.radians(45.0))
FELT = 0.01  # of the peak dynamic pressure: where less presses, the attitude of the body matters little


def flight_notes(flown: Flown) -> tuple[str, ...]:
    """Sentences on where this flight left the models' range, in the order of :data:`LIMITS`."""
    return tuple(note for limit in LIMITS if (note := limit(flown)) is not None)


def _thin_air(flown: Flown) -> str | None:
    if not flown.flight.surface_loads:
        return None
    density, pressure = flown["density_kg_m3"], flown["pressure_Pa"]
    temperature, altitude = flown["temperature_K"], flown["altitude_m"]
    length = flown.flight.surface.knudsen_length_m
    air = zip(pressure, density, temperature, strict=True)
    knudsen = np.array([knudsen_number(*state, length) for state in air])
    thin = knudsen > CONTINUUM_END
    if not thin.any():
        return None
    lowest = altitude[thin].min() / 1e3
    return (
        f"thin air: Knudsen number up to {knudsen.max():.2g}, above {CONTINUUM_END:g} for "
        f"{flown.seconds(thin):.0f} s down to {lowest:.0f} km, where the loads are bridged to those of free "
        "molecules (the slip between is an interpolation)"
    )


def _dissociation(flown: Flown) -> str | None:
    fast = flown["airspeed_m_s"] > DISSOCIATION_M_S
    return _while(
        flown,
        fast,
        f"faster than the air model: up to {flown['airspeed_m_s'].max():.0f} m/s, above "
        f"{DISSOCIATION_M_S:.0f} m/s {{time}}; air dissociates there and is taken as a perfect gas (its "
        "stagnation pressure apart, with stagnation_cp = equilibrium_air)",
    )


def _radiation(flown: Flown) -> str | None:
    fast = flown["airspeed_m_s"] > RADIATION_M_S
    return _while(
        flown,
        fast,
        f"heat by radiation left out: above {RADIATION_M_S:.0f} m/s {{time}} the shock layer radiates to the "
        "wall as well; the heat flux is convection alone",
    )


def _pointed(flown: Flown) -> str | None:
    if not flown.flight.surface_loads:
        return None
    surface = flown.flight.surface
    radius, base = surface.layers.nose_radius_m, surface.knudsen_length_m
    if radius > POINTED_SHARE * base:
        return None
    peak = flown["stagnation_heat_flux_W_m2"].max() / 1e6
    what = f"radius {1e3 * radius:.2g} mm" if radius > 0.0 else "no radius"
    return (
        f"pointed nose ({what}): its stagnation heat flux, up to {peak:.3g} MW/m2, is a limit that no wall "
        "meets, for the tip melts blunt; give the radius that is left"
    )


def _blunt_face(flown: Flown) -> str | None:
    if not flown.flight.surface_loads:
        return None
    surface = flown.flight.surface
    if surface.options.face != NO_FACE or surface.cone_sin < BLUNT_SIN:
        return None
    return (
        f"blunt face: a slope of {math.degrees(math.asin(surface.cone_sin)):.0f} deg leaves the flow "
        "subsonic up to the rim, which impact laws do not know (drag of cones some 5 to 9 % low, of shallow "
        "caps some 16 % high); the presets physics and best do"
    )


def _base_first(flown: Flown) -> str | None:
    alpha = flown["total_alpha_deg"]
    behind = alpha > 90.0
    if not behind.any():
        return None
    heat = np.where(behind, np.maximum(flown["stagnation_heat_flux_W_m2"], 0.0), 0.0)
    total = float(flown.path.states[-1, STAGNATION_INFLOW])
    share = 100.0 * flown.integral(heat) / total if total > 0.0 else 0.0
    return (
        f"base first: incidence above 90 deg for {flown.seconds(behind):.1f} s (up to {alpha.max():.0f} "
        f"deg), with {share:.0f} % of the stagnation heat; CA is negative there, damping and wake are "
        "nose-first laws, and the heat is that of a flat base"
    )


def _incidence(flown: Flown) -> str | None:
    pressure = flown["dynamic_pressure_Pa"]
    alpha = flown["total_alpha_deg"]
    beyond = (alpha > LARGEST_INCIDENCE_DEG) & (pressure > FELT * pressure.max())
    return _while(
        flown,
        beyond,
        f"incidence beyond the laws: up to {alpha[beyond].max(initial=0.0):.0f} deg while the air pressed, "
        f"above {LARGEST_INCIDENCE_DEG:.0f} deg {{time}}; what the lee side feels there is a guess",
    )


def _slow(flown: Flown) -> str | None:
    if not flown.flight.surface_loads:
        return None
    slow = flown["mach"] < SLOWEST_MACH
    return _while(
        flown,
        slow,
        f"Mach numbers below the laws: below {SLOWEST_MACH:g} {{time}} (down to {flown['mach'].min():.2f}), "
        "where pressure and base drag are correlations for slender bodies",
    )


def _fitted(flown: Flown) -> str | None:
    if not flown.flight.surface_loads:
        return None
    used = set(flown.flight.surface.ring_laws[:, 1:].ravel().tolist())
    mach = flown["mach"]
    for word, law in PRESSURE_LAWS.items():
        outside = (mach > law.mach[1]) | ((mach < law.mach[0]) & (mach > SLOWEST_MACH))
        if law.number in used and math.isfinite(law.mach[1]) and outside.any():
            return _while(
                flown,
                outside,
                f"fitted law out of its range: {word} was fitted from Mach {law.mach[0]:g} to "
                f"{law.mach[1]:g}, and flown outside {{time}} (up to Mach {mach.max():.1f})",
            )
    return None


def _given_back(flown: Flown) -> str | None:
    if not flown.flight.surface_loads:
        return None
    last = flown.path.states[-1]
    told = [
        f"{(last[inflow] - last[balance]) / 1e6:.3g} {unit} {where} (against {last[inflow] / 1e6:.3g} that "
        "flowed in)"
        for balance, inflow, unit, where in (
            (STAGNATION_HEAT, STAGNATION_INFLOW, "MJ/m2", "at the stagnation point"),
            (SURFACE_HEAT, SURFACE_INFLOW, "MJ", "over the surface"),
        )
        if last[inflow] - last[balance] > 0.005 * last[inflow]
    ]
    if not told:
        return None
    back = flown["stagnation_heat_flux_W_m2"] < 0.0
    fastest = flown["mach"][back].max(initial=0.0)
    return (
        f"heat given back: a wall held at {flown.flight.surface.layers.wall_K:.0f} K is hotter than the air "
        f"along it (at the stagnation point below Mach {fastest:.1f}) and gives back {' and '.join(told)}"
    )


def _unstable(flown: Flown) -> str | None:
    margin = flown["static_margin"]
    return _while(
        flown,
        margin < 0.0,
        f"unstable: static margin down to {margin.min():.3f}, negative {{time}}; F3's reciprocal of its "
        "absolute value takes that for stability",
    )


def _skip_out(flown: Flown) -> str | None:
    if flown.path.status != LEFT_RANGE:
        return None
    return (
        f"skip-out: left the atmosphere's table at {flown.final('altitude_m') / 1e3:.1f} km after "
        f"{flown.final('time_s'):.0f} s, at {flown.final('speed_m_s'):.0f} m/s and "
        f"{flown.final('path_angle_deg'):.1f} deg"
    )


LIMITS: tuple[Callable[[Flown], str | None], ...] = (
    _thin_air,
    _dissociation,
    _radiation,
    _pointed,
    _blunt_face,
    _base_first,
    _incidence,
    _slow,
    _fitted,
    _given_back,
    _unstable,
    _skip_out,
)
"""The limits, each a function of a history that gives a sentence, or none."""


def _while(flown: Flown, when: Flags, text: str) -> str | None:
    """Fill in how long it was so and where; none when it never was."""
    if not when.any():
        return None
    heights: Floats = flown["altitude_m"][when] / 1e3
    lowest = max(float(heights.min()), 0.0)
    time = f"for {flown.seconds(when):.1f} s between {heights.max():.1f} and {lowest:.1f} km"
    return text.format(time=time)
