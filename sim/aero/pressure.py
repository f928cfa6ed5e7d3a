"""Pressure on the body: the registered laws, blended in Mach number and into the shadow."""

from __future__ import annotations

import math
from typing import NamedTuple

from sim.aero.gas import (
    GAMMA,
    equilibrium_pressure_increment,
    pitot_pressure_ratio,
    prandtl_meyer_angle,
    stagnation_pressure_coefficient,
)
from sim.aero.methods import SLOW_END
from sim.aero.pressure_laws.faces import Face, blunt_base_pressure, face_increment
from sim.aero.pressure_laws.inviscid import (
    NO_CURVE,
    NO_OVEREXPANSION,
    base_correlation,
    cone_curve,
    kaufman_match,
    modified_newtonian,
    overexpansion,
    smooth_step,
)
from sim.aero.pressure_laws.laws import PRESSURE_LAWS, Flow, Place, impact_pressure, wake_pressure
from sim.core.compiled import compiled, inlined
from sim.core.machine_code import Reference, reference

__all__ = ["Options", "base_pressure", "flow", "pressure_in", "surface_pressure"]

_SLOW_START = 1.5
_FAST_M_S = (2500.0, 3500.0)  # where the real gas of a bow shock begins to tell, and is all there
_REAL_K = (1.83, 1.92)  # Cp_max from that of a perfect gas to that of equilibrium air
_PRANDTL_MEYER_EXPANSION = PRESSURE_LAWS["prandtl_meyer_expansion"].number


class Options(NamedTuple):
    """Options of the pressure laws, by number where they choose a law: see :class:`.methods.Methods`."""

    shadow_slow: int
    shadow_low: int
    shadow_high: int
    base_slow: int
    base_low: int
    base_high: int
    matching_end: float
    """Mach number up to which a law needs Kaufman's matching point; 0 when none does."""
    cones_end: float
    """Likewise for the curve of tangent cones."""
    upstream_end: float
    """Likewise for what lies upstream."""
    shadow_ramp: float
    blend_start: float
    blend_end: float
    stagnation_cp: float
    """Cp_max; 0 for that of a perfect gas."""
    equilibrium: int
    """Whether equilibrium air adds to it: 0 no, 1 yes, 2 to fast flight alone."""
    face: Face
    limit_mach: float
    limit_pressure_ratio: float


@compiled
def flow(mach: float, speed_m_s: float, density_kg_m3: float, options: Options) -> Flow:
    """Evaluate what is the same for every element; speed and density only matter to equilibrium air."""
    k = options.stagnation_cp if options.stagnation_cp > 0.0 else stagnation_pressure_coefficient(mach, GAMMA)
    if options.equilibrium:
        increment = equilibrium_pressure_increment(speed_m_s, density_kg_m3)
        k += increment if options.equilibrium == 1 else increment * smooth_step(speed_m_s, *_FAST_M_S)
    face = options.face
    real = smooth_step(k, *_REAL_K)
    supersonic = smooth_step(mach, 1.0, 2.0)
    flat = supersonic * (face.flat + real * (face.flat_air - face.flat))
    drop = supersonic * (face.drop + real * (face.drop_air - face.drop))
    match_sin = grazing_nu = 0.0
    share = 1.0
    if _SLOW_START < mach <= options.matching_end:
        match_mach, _, angle, share = kaufman_match(
            mach, GAMMA, options.limit_mach, options.limit_pressure_ratio
        )
        match_sin, grazing_nu = math.sin(angle), prandtl_meyer_angle(match_mach, GAMMA) + share * angle
    cones, blunt, pitot = NO_CURVE, NO_OVEREXPANSION, 0.0
    if _SLOW_START < mach <= options.cones_end:
        cones = cone_curve(mach, GAMMA)
    if _SLOW_START < mach <= options.upstream_end:
        blunt, pitot = overexpansion(mach), pitot_pressure_ratio(mach, GAMMA)
    if mach < SLOW_END:
        weight = smooth_step(mach, _SLOW_START, SLOW_END)
        wakes = (options.shadow_slow, options.shadow_low, options.base_slow, options.base_low)
        first = 0
    else:
        weight = smooth_step(mach, options.blend_start, options.blend_end)
        wakes = (options.shadow_low, options.shadow_high, options.base_low, options.base_high)
        first = 1
    faces = (flat, drop, real * face.relief_air, face.base)
    return Flow(
        mach, k, match_sin, grazing_nu, share, first, first + 1, weight, *wakes, *faces, cones, blunt, pitot
    )


@inlined
def _element(
    impact_law: int, shadow_law: int, ramp: float, sin_inclination: float, place: Place, stream: Flow
) -> float:
    s = sin_inclination
    impact = impact_pressure(impact_law, s, place, stream)
    if s >= 0.0:
        return impact
    weight = s * s / (s * s + ramp * ramp)
    fading_in = 1.0 if shadow_law == _PRANDTL_MEYER_EXPANSION else weight  # it starts from zero by itself
    return (1.0 - weight) * impact + fading_in * wake_pressure(shadow_law, s, stream)


@compiled
def surface_pressure(
    first: int, second: int, sin_inclination: float, place: Place, stream: Flow, ramp: float
) -> float:
    """Cp of a surface element with these impact laws in the two sets that are at work.

    In the shadow the impact law fades out and the shadow law fades in with s^2 / (s^2 + ramp^2), so that the
    pressure is continuous, with its slope, in the angle of attack.
    """
    return pressure_in(first, second, sin_inclination, place, reference(stream), ramp)


@compiled
def pressure_in(
    first: int, second: int, sin_inclination: float, place: Place, at: Reference[Flow], ramp: float
) -> float:
    """Do what :func:`surface_pressure` does, without a copy of the stream for every element."""
    stream = at[0]
    cp = 0.0
    for law, shadow_law, share in (  # a loop, for its body is compiled once
        (first, stream.shadow_first, 1.0 - stream.weight),
        (second, stream.shadow_second, stream.weight),
    ):
        if share > 0.0:
            cp += share * _element(law, shadow_law, ramp, sin_inclination, place, stream)
    if place.rim >= 0.0 and sin_inclination > 0.0:
        cp += face_increment(
            sin_inclination, place.rim, stream.k, stream.face_flat, stream.face_drop, stream.face_relief
        )
    return cp


@compiled
def base_pressure(sin_inclination: float, stream: Flow, ramp: float) -> float:
    """Cp of the base: its law in the wake, impact pressure when it faces the stream (above 90 deg)."""
    s = sin_inclination
    wake = (1.0 - stream.weight) * wake_pressure(stream.base_first, 0.0, stream)
    wake += stream.weight * wake_pressure(stream.base_second, 0.0, stream)
    if stream.face_base > 0.0:
        wake += stream.face_base * (blunt_base_pressure(stream.mach, base_correlation(stream.mach)) - wake)
    if s <= 0.0:
        return wake
    facing = s * s / (s * s + ramp * ramp)
    return (1.0 - facing) * wake + modified_newtonian(s, stream.k)
