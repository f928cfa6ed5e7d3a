"""The register of pressure laws, and the compiled code that calls a law by its number.

A new law is a function in :mod:`sim.aero.pressure_laws.inviscid`, a row of :data:`PRESSURE_LAWS` and a line
in :func:`impact_pressure` or :func:`wake_pressure`: a compiled loop cannot call a function by its name.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, NamedTuple

from sim.aero.gas import GAMMA
from sim.aero.pressure_laws.inviscid import (
    ConeCurve,
    Overexpansion,
    base_correlation,
    cone_on_curve,
    corrected_newtonian,
    entropy_layer_cone,
    free_stream_pressure,
    habp_base_pressure,
    modified_newtonian,
    newtonian_prandtl_meyer,
    osu_blunt_body,
    overexpanded,
    prandtl_meyer_expansion,
    shadow_pressure,
    smooth_step,
    tangent_cone_edwards,
    tangent_cone_habp3,
    tangent_cone_hammitt_murthy,
    turned,
    vacuum_pressure,
)
from sim.core.compiled import compiled
from sim.core.errors import InputError

__all__ = [
    "PRESSURE_LAWS",
    "UPSTREAM",
    "Flow",
    "Place",
    "PressureLaw",
    "Role",
    "check_law",
    "impact_pressure",
    "source_pressure",
    "wake_pressure",
]

Role = Literal["impact", "shadow", "base"]

# A tangent cone has no attached shock on steep surfaces: Newtonian pressure takes over between these two.
STEEP_DEG = 30.0
_SIN_STEEP = math.sin(math.radians(STEEP_DEG))
_SIN_BLUNT = math.sin(math.radians(42.0))

# What keeps the normal-force slope continuous in Mach number, see tangent_cone_hammitt_murthy.
ROUNDING = 0.1


class Flow(NamedTuple):
    """What the pressure laws need to know of the free stream.

    At any Mach number at most two sets of laws are at work: columns ``first`` and ``second`` of the law
    numbers (0 slow, 1 low, 2 high), the second with the share ``weight``. ``cones``, ``blunt`` and ``pitot``
    (over the static pressure) are there where a law needs them.
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
    face_flat: float
    face_drop: float
    face_relief: float
    face_base: float
    cones: ConeCurve
    blunt: Overexpansion
    pitot: float


class Place(NamedTuple):
    """Where on the body an element lies, for the law that depends on what lies upstream.

    ``source_sin`` is the sine of the inclination that the first segment has on this meridian, ``recovery``
    and ``nose_trace`` what the functions of these names give for the way behind the nose, ``turn_rad`` what
    the element's slope adds to the first segment's. ``rim`` says where on a blunt face the element lies
    (:func:`sim.aero.pressure_laws.faces.rim_shape`), -1 off it; ``source_cp`` is what
    :func:`source_pressure` gives for ``source_sin``, -1 where nobody has asked yet.
    """

    source_sin: float
    recovery: float
    nose_trace: float
    turn_rad: float
    rim: float = -1.0
    source_cp: float = -1.0


@dataclass(frozen=True)
class PressureLaw:
    """One row of the register.

    Parameters
    ----------
    number : int
        What compiled code calls it by. Its own; in no order.
    function : callable
        The compiled formula, whose parameters say what it depends on.
    roles : tuple of {"impact", "shadow", "base"}
        Where it may serve: on what faces the stream, on what lies in the shadow, on the flat base.
    cp : str
        The formula, for people.
    source : str
        Where it is published.
    mach : (float, float)
        Mach numbers that it is meant for.
    angle_deg : (float, float)
        Inclinations to the stream that it is meant for, negative in the shadow.
    lowest_mach : float
        Up to this Mach number the formula has no value at all.
    upstream : bool
        Whether it depends on what lies upstream, so that it varies along a segment of constant slope.
    matching_point : bool
        Whether it needs Kaufman's matching point.
    cone_curve : bool
        Whether it needs the :class:`.inviscid.ConeCurve`.
    """

    number: int
    function: Callable[..., float]
    roles: tuple[Role, ...]
    cp: str
    source: str
    mach: tuple[float, float]
    angle_deg: tuple[float, float]
    lowest_mach: float = 0.0
    upstream: bool = False
    matching_point: bool = False
    cone_curve: bool = False


(
    _MODIFIED_NEWTONIAN,
    _OSU_BLUNT_BODY,
    _NEWTONIAN_PRANDTL_MEYER,
    _TANGENT_CONE_HABP3,
    _TANGENT_CONE_EDWARDS,
    _TANGENT_CONE_HAMMITT_MURTHY,
    _CORRECTED_NEWTONIAN,
    _ENTROPY_LAYER,
    _ZERO,
    _SHADOW_PRESSURE,
    _VACUUM_PRESSURE,
    _PRANDTL_MEYER_EXPANSION,
    _HABP_BASE_PRESSURE,
    _BASE_CORRELATION,
) = range(14)

PRESSURE_LAWS: dict[str, PressureLaw] = {
    "modified_newtonian": PressureLaw(
        number=_MODIFIED_NEWTONIAN,
        function=modified_newtonian,
        roles=("impact",),
        cp="K sin^2 d",
        source="Lees 1955; K from Rayleigh's pitot formula",
        mach=(0.0, math.inf),
        angle_deg=(-90.0, 90.0),
    ),
    "osu_blunt_body": PressureLaw(
        number=_OSU_BLUNT_BODY,
        function=osu_blunt_body,
        roles=("impact",),
        cp="(X p02/p1 - 1)/(0.7 M^2), X a cosine series in the angle from stagnation",
        source="S/HABP; the paper's eq. 2, which is p/p02, not p/p1: its coefficients sum to 1",
        mach=(1.0, math.inf),
        angle_deg=(-30.0, 90.0),
    ),
    "newtonian_prandtl_meyer": PressureLaw(
        number=_NEWTONIAN_PRANDTL_MEYER,
        function=newtonian_prandtl_meyer,
        roles=("impact",),
        cp="Newtonian to the matching point, then a Prandtl-Meyer expansion of the shocked gas",
        source="Kaufman 1963; the paper's eq. 7 without its exponent",
        mach=(1.5, math.inf),
        angle_deg=(-90.0, 90.0),
        matching_point=True,
    ),
    "tangent_cone_habp3": PressureLaw(
        number=_TANGENT_CONE_HABP3,
        function=tangent_cone_habp3,
        roles=("impact",),
        cp="pressure of the cone with the element's inclination, empirical",
        source="S/HABP Mark III, AFFDL-TR-73-159",
        mach=(1.0, math.inf),
        angle_deg=(0.0, STEEP_DEG),
    ),
    "tangent_cone_edwards": PressureLaw(
        number=_TANGENT_CONE_EDWARDS,
        function=tangent_cone_edwards,
        roles=("impact",),
        cp="the same with another shock Mach number",
        source="Edwards, NASA TP-1539",
        mach=(1.0, math.inf),
        angle_deg=(0.0, STEEP_DEG),
    ),
    "tangent_cone_hammitt_murthy": PressureLaw(
        number=_TANGENT_CONE_HAMMITT_MURTHY,
        function=tangent_cone_hammitt_murthy,
        roles=("impact",),
        cp="slender-body theory joined to an approximate conical flow",
        source="S/HABP, Cruz and Sova; Hammitt and Murthy 1959",
        mach=(1.5, math.inf),
        angle_deg=(0.0, STEEP_DEG),
        lowest_mach=1.0,
        cone_curve=True,
    ),
    "corrected_newtonian": PressureLaw(
        number=_CORRECTED_NEWTONIAN,
        function=corrected_newtonian,
        roles=("impact",),
        cp="K sin^2 d (1 - 0.13 cos^2 d)",
        source="fitted to Euler solutions ([evidence](validation/aero-best.md))",
        mach=(5.0, 10.0),
        angle_deg=(-90.0, 90.0),
    ),
    "entropy_layer": PressureLaw(
        number=_ENTROPY_LAYER,
        function=entropy_layer_cone,
        roles=("impact",),
        cp="the tangent cone's, less the overexpansion behind a blunt nose (`entropy_layer_cone`); "
        "behind a change of slope `local_turn`",
        source="fitted to Euler solutions ([evidence](validation/aero-best.md)); Cheng 1961, Van Dyke 1954",
        mach=(5.0, 10.0),
        angle_deg=(0.0, STEEP_DEG),
        lowest_mach=1.0,
        upstream=True,
        cone_curve=True,
    ),
    "zero": PressureLaw(
        number=_ZERO,
        function=free_stream_pressure,
        roles=("shadow", "base"),
        cp="0",
        source="the shadow of Newtonian theory",
        mach=(0.0, math.inf),
        angle_deg=(-90.0, 0.0),
    ),
    "shadow_pressure": PressureLaw(
        number=_SHADOW_PRESSURE,
        function=shadow_pressure,
        roles=("shadow", "base"),
        cp="-1.4/(gamma M^2), 70 % of vacuum",
        source="the paper's eqs. 12, 13",
        mach=(1.0, math.inf),
        angle_deg=(-90.0, 0.0),
    ),
    "vacuum_pressure": PressureLaw(
        number=_VACUUM_PRESSURE,
        function=vacuum_pressure,
        roles=("shadow", "base"),
        cp="-2/(gamma M^2)",
        source="the paper's eqs. 12, 13",
        mach=(1.0, math.inf),
        angle_deg=(-90.0, 0.0),
    ),
    "prandtl_meyer_expansion": PressureLaw(
        number=_PRANDTL_MEYER_EXPANSION,
        function=prandtl_meyer_expansion,
        roles=("shadow",),
        cp="the free stream turned away from itself",
        source="NACA 1135",
        mach=(1.0, math.inf),
        angle_deg=(-90.0, 0.0),
    ),
    "habp_base_pressure": PressureLaw(
        number=_HABP_BASE_PRESSURE,
        function=habp_base_pressure,
        roles=("base",),
        cp="-1/M^2 + 0.57/M^4",
        source="S/HABP",
        mach=(1.0, math.inf),
        angle_deg=(-90.0, 0.0),
    ),
    "base_correlation": PressureLaw(
        number=_BASE_CORRELATION,
        function=base_correlation,
        roles=("shadow", "base"),
        cp="-(0.12 + 0.13 M^2), from Mach 1 on -0.25/M",
        source="Fleeman 2001",
        mach=(0.0, math.inf),
        angle_deg=(-90.0, 0.0),
    ),
}
"""Every pressure law by its word, which study files and :class:`sim.aero.methods.Laws` use."""


UPSTREAM = _ENTROPY_LAYER
"""Number of the law that depends on what lies upstream."""


def check_law(word: object, role: Role, part: str) -> None:
    """Refuse a law that does not exist, or does not serve in this role on this part of the body.

    Raises
    ------
    InputError
        Naming those that do.
    """
    if not isinstance(word, str) or word not in PRESSURE_LAWS or role not in PRESSURE_LAWS[word].roles:
        fit = ", ".join(known for known, law in PRESSURE_LAWS.items() if role in law.roles)
        raise InputError(f"{part} must be one of {fit}, not {word!r}")


@compiled
def source_pressure(source_sin: float, stream: Flow) -> float:
    """Cp, not negative, of the sharp cone that a meridian starts with: the same for all that follows it."""
    return cone_on_curve(min(source_sin, _SIN_BLUNT), stream.mach, GAMMA, ROUNDING, stream.cones)


@compiled
def impact_pressure(law: int, sin_inclination: float, place: Place, stream: Flow) -> float:
    """Cp by the impact law of this number."""
    if law == _MODIFIED_NEWTONIAN:
        return modified_newtonian(sin_inclination, stream.k)
    if law == _OSU_BLUNT_BODY:
        return osu_blunt_body(sin_inclination, stream.k, stream.mach, GAMMA)
    if law == _NEWTONIAN_PRANDTL_MEYER:
        return newtonian_prandtl_meyer(
            sin_inclination,
            stream.k,
            stream.mach,
            GAMMA,
            stream.match_sin,
            stream.grazing_nu_rad,
            stream.turn_share,
        )
    if law == _CORRECTED_NEWTONIAN:
        return corrected_newtonian(sin_inclination, stream.k)
    newtonian = modified_newtonian(sin_inclination, stream.k)
    if sin_inclination >= _SIN_BLUNT:
        return newtonian
    if law == _TANGENT_CONE_HABP3:
        cone = tangent_cone_habp3(sin_inclination, stream.mach, GAMMA)
    elif law == _TANGENT_CONE_EDWARDS:
        cone = tangent_cone_edwards(sin_inclination, stream.mach, GAMMA)
    elif law == _TANGENT_CONE_HAMMITT_MURTHY:
        cone = cone_on_curve(sin_inclination, stream.mach, GAMMA, ROUNDING, stream.cones)
    else:
        source = place.source_cp if place.source_cp >= 0.0 else source_pressure(place.source_sin, stream)
        cone = overexpanded(source, place.recovery, place.nose_trace, stream.blunt)
        if place.turn_rad != 0.0:
            cone = turned(cone, place.turn_rad, stream.mach, GAMMA, stream.pitot)
    return cone + (newtonian - cone) * smooth_step(sin_inclination, _SIN_STEEP, _SIN_BLUNT)


@compiled
def wake_pressure(law: int, sin_inclination: float, stream: Flow) -> float:
    """Cp by the law of this number for shadow or base."""
    if law == _SHADOW_PRESSURE:
        return shadow_pressure(stream.mach, GAMMA)
    if law == _VACUUM_PRESSURE:
        return vacuum_pressure(stream.mach, GAMMA)
    if law == _PRANDTL_MEYER_EXPANSION:
        return prandtl_meyer_expansion(sin_inclination, stream.mach, GAMMA)
    if law == _HABP_BASE_PRESSURE:
        return habp_base_pressure(stream.mach, GAMMA)
    if law == _BASE_CORRELATION:
        return base_correlation(stream.mach)
    return free_stream_pressure()
