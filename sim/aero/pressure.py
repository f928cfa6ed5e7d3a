"""Pressure on the body: the laws of :mod:`sim.aero.inviscid`, chosen by number and blended in Mach number."""

from __future__ import annotations

import math
from typing import NamedTuple

from sim.aero.gas import (
    GAMMA,
    equilibrium_pressure_increment,
    prandtl_meyer_angle,
    stagnation_pressure_coefficient,
)
from sim.aero.inviscid import (
    base_correlation,
    corrected_newtonian,
    entropy_layer_cone,
    habp_base_pressure,
    kaufman_match,
    local_turn,
    modified_newtonian,
    newtonian_prandtl_meyer,
    osu_blunt_body,
    prandtl_meyer_expansion,
    shadow_pressure,
    smooth_step,
    tangent_cone_edwards,
    tangent_cone_habp3,
    tangent_cone_hammitt_murthy,
    vacuum_pressure,
)
from sim.aero.methods import SLOW_END
from sim.core.compiled import compiled, inlined

__all__ = [
    "IMPACT_LAWS",
    "WAKE_LAWS",
    "Flow",
    "Options",
    "Place",
    "base_pressure",
    "flow",
    "surface_pressure",
]

# Laws by number: a compiled loop cannot call a function by name.
IMPACT_LAWS = (
    "modified_newtonian",
    "osu_blunt_body",
    "newtonian_prandtl_meyer",
    "tangent_cone_habp3",
    "tangent_cone_edwards",
    "tangent_cone_hammitt_murthy",
    "corrected_newtonian",
    "entropy_layer",
)
WAKE_LAWS = (
    "zero",
    "shadow_pressure",
    "vacuum_pressure",
    "prandtl_meyer_expansion",
    "habp_base_pressure",
    "base_correlation",
)

_SLOW_START = 1.5

# A tangent cone has no attached shock on steep surfaces: Newtonian pressure takes over between these two.
_SIN_STEEP = math.sin(math.radians(30.0))
_SIN_BLUNT = math.sin(math.radians(42.0))

# What keeps the normal-force slope continuous in Mach number, see tangent_cone_hammitt_murthy.
_ROUNDING = 0.1


class Flow(NamedTuple):
    """What the pressure laws need to know of the free stream.

    At any Mach number at most two sets of laws are at work: columns ``first`` and ``second`` of the law
    numbers (0 slow, 1 low, 2 high), the second with the share ``weight``.
    """

    mach: float
    k: float
    match_sin: float
    grazing_nu_rad: float
    turn_share: float
    first: int
    second: int
    weight: float
    shadow_first: int
    shadow_second: int
    base_first: int
    base_second: int


class Place(NamedTuple):
    """Where on the body an element lies, for the law that depends on what lies upstream.

    ``source_sin`` is the sine of the inclination that the first segment has on this meridian, ``distance``
    the way behind the nose over its radius, ``cone_sin`` the sine of the first segment's slope and
    ``turn_rad`` what the element's slope adds to it.
    """

    source_sin: float
    distance: float
    cone_sin: float
    turn_rad: float


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
    shadow_ramp: float
    blend_start: float
    blend_end: float
    stagnation_cp: float
    """Cp_max; 0 for that of a perfect gas."""
    equilibrium: int
    """Whether equilibrium air adds to it."""
    limit_mach: float
    limit_pressure_ratio: float


@compiled
def flow(mach: float, speed_m_s: float, density_kg_m3: float, options: Options) -> Flow:
    """Evaluate what is the same for every element; speed and density only matter to equilibrium air."""
    k = options.stagnation_cp if options.stagnation_cp > 0.0 else stagnation_pressure_coefficient(mach, GAMMA)
    if options.equilibrium:
        k += equilibrium_pressure_increment(speed_m_s, density_kg_m3)
    match_sin = grazing_nu = 0.0
    share = 1.0
    if _SLOW_START < mach <= options.matching_end:
        match_mach, _, angle, share = kaufman_match(
            mach, GAMMA, options.limit_mach, options.limit_pressure_ratio
        )
        match_sin, grazing_nu = math.sin(angle), prandtl_meyer_angle(match_mach, GAMMA) + share * angle
    if mach < SLOW_END:
        weight = smooth_step(mach, _SLOW_START, SLOW_END)
        wakes = (options.shadow_slow, options.shadow_low, options.base_slow, options.base_low)
        first = 0
    else:
        weight = smooth_step(mach, options.blend_start, options.blend_end)
        wakes = (options.shadow_low, options.shadow_high, options.base_low, options.base_high)
        first = 1
    return Flow(mach, k, match_sin, grazing_nu, share, first, first + 1, weight, *wakes)


@compiled
def _impact(law: int, sin_inclination: float, place: Place, stream: Flow) -> float:
    if law == 0:
        return modified_newtonian(sin_inclination, stream.k)
    if law == 1:
        return osu_blunt_body(sin_inclination, stream.k, stream.mach, GAMMA)
    if law == 2:
        return newtonian_prandtl_meyer(
            sin_inclination,
            stream.k,
            stream.mach,
            GAMMA,
            stream.match_sin,
            stream.grazing_nu_rad,
            stream.turn_share,
        )
    if law == 6:
        return corrected_newtonian(sin_inclination, stream.k)
    newtonian = modified_newtonian(sin_inclination, stream.k)
    if sin_inclination >= _SIN_BLUNT:
        return newtonian
    if law == 3:
        cone = tangent_cone_habp3(sin_inclination, stream.mach, GAMMA)
    elif law == 4:
        cone = tangent_cone_edwards(sin_inclination, stream.mach, GAMMA)
    elif law == 5:
        cone = tangent_cone_hammitt_murthy(sin_inclination, stream.mach, GAMMA, _ROUNDING)
    else:
        source = min(place.source_sin, _SIN_BLUNT)
        source = tangent_cone_hammitt_murthy(source, stream.mach, GAMMA, _ROUNDING)
        source = entropy_layer_cone(source, place.distance, place.cone_sin, stream.mach)
        cone = source if place.turn_rad == 0.0 else local_turn(source, place.turn_rad, stream.mach, GAMMA)
    return cone + (newtonian - cone) * smooth_step(sin_inclination, _SIN_STEEP, _SIN_BLUNT)


@compiled
def _wake(law: int, sin_inclination: float, stream: Flow) -> float:
    if law == 1:
        return shadow_pressure(stream.mach, GAMMA)
    if law == 2:
        return vacuum_pressure(stream.mach, GAMMA)
    if law == 3:
        return prandtl_meyer_expansion(sin_inclination, stream.mach, GAMMA)
    if law == 4:
        return habp_base_pressure(stream.mach, GAMMA)
    if law == 5:
        return base_correlation(stream.mach)
    return 0.0


@inlined
def _element(
    impact_law: int, shadow_law: int, ramp: float, sin_inclination: float, place: Place, stream: Flow
) -> float:
    s = sin_inclination
    if s >= 0.0:
        return _impact(impact_law, s, place, stream)
    weight = s * s / (s * s + ramp * ramp)
    fading_in = 1.0 if shadow_law == 3 else weight  # Prandtl-Meyer starts from zero by itself
    return (1.0 - weight) * _impact(impact_law, s, place, stream) + fading_in * _wake(shadow_law, s, stream)


@compiled
def surface_pressure(
    first: int, second: int, sin_inclination: float, place: Place, stream: Flow, ramp: float
) -> float:
    """Cp of a surface element with these impact laws in the two sets that are at work.

    In the shadow the impact law fades out and the shadow law fades in with s^2 / (s^2 + ramp^2), so that the
    pressure is continuous, with its slope, in the angle of attack.
    """
    cp = 0.0
    if stream.weight < 1.0:
        cp = (1.0 - stream.weight) * _element(
            first, stream.shadow_first, ramp, sin_inclination, place, stream
        )
    if stream.weight > 0.0:
        cp += stream.weight * _element(second, stream.shadow_second, ramp, sin_inclination, place, stream)
    return cp


@compiled
def base_pressure(sin_inclination: float, stream: Flow, ramp: float) -> float:
    """Cp of the base: its law in the wake, impact pressure when it faces the stream (above 90 deg)."""
    s = sin_inclination
    wake = (1.0 - stream.weight) * _wake(stream.base_first, 0.0, stream)
    wake += stream.weight * _wake(stream.base_second, 0.0, stream)
    if s <= 0.0:
        return wake
    facing = s * s / (s * s + ramp * ramp)
    return (1.0 - facing) * wake + modified_newtonian(s, stream.k)
