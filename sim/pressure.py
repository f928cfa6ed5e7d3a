"""Pressure on the body: the laws of :mod:`sim.inviscid`, chosen by number and blended in Mach number."""

from __future__ import annotations

import math
from typing import NamedTuple

from sim.compiled import compiled
from sim.gas import GAMMA, prandtl_meyer_angle, stagnation_pressure_coefficient
from sim.inviscid import (
    habp_base_pressure,
    kaufman_match,
    modified_newtonian,
    newtonian_prandtl_meyer,
    osu_blunt_body,
    prandtl_meyer_expansion,
    shadow_pressure,
    tangent_cone_edwards,
    tangent_cone_habp3,
    tangent_cone_hammitt_murthy,
    vacuum_pressure,
)

__all__ = [
    "BASE_LAWS",
    "IMPACT_LAWS",
    "MACH_FLOOR",
    "SHADOW_LAWS",
    "Flow",
    "Options",
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
)
SHADOW_LAWS = ("zero", "shadow_pressure", "vacuum_pressure", "prandtl_meyer_expansion")
BASE_LAWS = ("zero", "shadow_pressure", "vacuum_pressure", "habp_base_pressure")

MACH_FLOOR = 1.5
"""Pressure laws keep their values of this Mach number in slower flight, for which none of them is meant."""
_FLOOR_WIDTH = 0.2

# A tangent cone has no attached shock on steep surfaces: Newtonian pressure takes over between these two.
_SIN_STEEP = math.sin(math.radians(30.0))
_SIN_BLUNT = math.sin(math.radians(42.0))


class Flow(NamedTuple):
    """What the pressure laws need to know of the free stream."""

    mach: float
    k: float
    match_sin: float
    match_nu_rad: float
    high_weight: float
    """Share of the laws meant for high Mach numbers."""


class Options(NamedTuple):
    """Options of the pressure laws, by number where they choose a law (see :class:`sim.methods.Methods`)."""

    shadow_low: int
    shadow_high: int
    base_low: int
    base_high: int
    shadow_ramp: float
    blend_start: float
    blend_end: float
    stagnation_cp: float
    """Cp_max; 0 for that of a perfect gas."""
    limit_mach: float
    limit_pressure_ratio: float


@compiled
def supersonic(mach: float) -> float:
    """Mach number floored at ``MACH_FLOOR``, with a parabola around it that keeps the slope continuous."""
    x = mach - (MACH_FLOOR - _FLOOR_WIDTH)
    if x <= 0.0:
        return MACH_FLOOR
    if x >= 2.0 * _FLOOR_WIDTH:
        return mach
    return MACH_FLOOR + x * x / (4.0 * _FLOOR_WIDTH)


@compiled
def flow(mach: float, options: Options) -> Flow:
    """Evaluate what depends on the Mach number alone."""
    m = supersonic(mach)
    match_mach, _, angle, _ = kaufman_match(m, GAMMA, options.limit_mach, options.limit_pressure_ratio)
    k = options.stagnation_cp if options.stagnation_cp > 0.0 else stagnation_pressure_coefficient(m, GAMMA)
    if mach <= options.blend_start:
        weight = 0.0
    elif mach >= options.blend_end:
        weight = 1.0
    else:
        x = (mach - options.blend_start) / (options.blend_end - options.blend_start)
        weight = x * x * (3.0 - 2.0 * x)
    return Flow(m, k, math.sin(angle), prandtl_meyer_angle(match_mach, GAMMA) + angle, weight)


@compiled
def _impact(law: int, sin_inclination: float, stream: Flow) -> float:
    if law == 0:
        return modified_newtonian(sin_inclination, stream.k)
    if law == 1:
        return osu_blunt_body(sin_inclination, stream.k, stream.mach, GAMMA)
    if law == 2:
        return newtonian_prandtl_meyer(
            sin_inclination, stream.k, stream.mach, GAMMA, stream.match_sin, stream.match_nu_rad
        )
    newtonian = modified_newtonian(sin_inclination, stream.k)
    if sin_inclination >= _SIN_BLUNT:
        return newtonian
    if law == 3:
        cone = tangent_cone_habp3(sin_inclination, stream.mach, GAMMA)
    elif law == 4:
        cone = tangent_cone_edwards(sin_inclination, stream.mach, GAMMA)
    else:
        cone = tangent_cone_hammitt_murthy(sin_inclination, stream.mach, GAMMA)
    x = max((sin_inclination - _SIN_STEEP) / (_SIN_BLUNT - _SIN_STEEP), 0.0)
    return cone + (newtonian - cone) * x * x * (3.0 - 2.0 * x)


@compiled
def _shadow(law: int, sin_inclination: float, weight: float, stream: Flow) -> float:
    if law == 1:
        return weight * shadow_pressure(stream.mach, GAMMA)
    if law == 2:
        return weight * vacuum_pressure(stream.mach, GAMMA)
    if law == 3:  # starts from zero by itself
        return prandtl_meyer_expansion(sin_inclination, stream.mach, GAMMA)
    return 0.0


@compiled
def _element(impact_law: int, shadow_law: int, ramp: float, sin_inclination: float, stream: Flow) -> float:
    s = sin_inclination
    if s >= 0.0:
        return _impact(impact_law, s, stream)
    weight = s * s / (s * s + ramp * ramp)
    return (1.0 - weight) * _impact(impact_law, s, stream) + _shadow(shadow_law, s, weight, stream)


@compiled
def surface_pressure(low: int, high: int, sin_inclination: float, stream: Flow, options: Options) -> float:
    """Cp of a surface element whose impact laws below and above the switch Mach number have these numbers.

    In the shadow the impact law fades out and the shadow law fades in with s^2 / (s^2 + ramp^2), so that the
    pressure is continuous, with its slope, in the angle of attack.
    """
    weight = stream.high_weight
    cp = 0.0
    if weight < 1.0:
        cp = (1.0 - weight) * _element(low, options.shadow_low, options.shadow_ramp, sin_inclination, stream)
    if weight > 0.0:
        cp += weight * _element(high, options.shadow_high, options.shadow_ramp, sin_inclination, stream)
    return cp


@compiled
def _wake(law: int, mach: float) -> float:
    if law == 1:
        return shadow_pressure(mach, GAMMA)
    if law == 2:
        return vacuum_pressure(mach, GAMMA)
    if law == 3:
        return habp_base_pressure(mach, GAMMA)
    return 0.0


@compiled
def base_pressure(sin_inclination: float, stream: Flow, options: Options) -> float:
    """Cp of the base: its law in the wake, impact pressure when it faces the stream (above 90 deg)."""
    weight = stream.high_weight
    wake = (1.0 - weight) * _wake(options.base_low, stream.mach) + weight * _wake(
        options.base_high, stream.mach
    )
    s = sin_inclination
    if s <= 0.0:
        return wake
    facing = s * s / (s * s + options.shadow_ramp * options.shadow_ramp)
    return (1.0 - facing) * wake + modified_newtonian(s, stream.k)
