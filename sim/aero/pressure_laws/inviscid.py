"""Inviscid surface-pressure laws: one pure function per published method.

Every law gives the pressure coefficient Cp = (p - p1) / q1 of a surface element from its local inclination:
``sin_inclination`` = -n.V/|V| for the outward normal n, 1 when the element faces the stream, negative in the
shadow. ``k`` is the stagnation pressure coefficient Cp_max, ``gamma`` the ratio of specific heats.

S/HABP below is the Supersonic/Hypersonic Arbitrary Body Program, Mark III (Gentry et al., AFFDL-TR-73-159).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sim.aero.gas import pitot_pressure_ratio, prandtl_meyer_angle, prandtl_meyer_mach
from sim.core.compiled import compiled, inlined

__all__ = [
    "NO_CURVE",
    "NO_OVEREXPANSION",
    "ConeCurve",
    "Overexpansion",
    "base_correlation",
    "cone_curve",
    "cone_on_curve",
    "corrected_newtonian",
    "entropy_layer_cone",
    "free_stream_pressure",
    "habp_base_pressure",
    "kaufman_limit",
    "kaufman_match",
    "kaufman_pressure_ratio",
    "local_turn",
    "modified_newtonian",
    "newtonian_prandtl_meyer",
    "nose_trace",
    "osu_blunt_body",
    "overexpanded",
    "overexpansion",
    "prandtl_meyer_expansion",
    "recovery",
    "shadow_pressure",
    "smooth_step",
    "tangent_cone_edwards",
    "tangent_cone_habp3",
    "tangent_cone_hammitt_murthy",
    "turned",
    "vacuum_pressure",
]


@compiled
def smooth_step(value: float, start: float, end: float) -> float:
    """Rise from 0 to 1 with continuous slope; a jump just above ``start`` when both are equal."""
    if value <= start:
        return 0.0
    if value >= end:
        return 1.0
    x = (value - start) / (end - start)
    return x * x * (3.0 - 2.0 * x)


@compiled
def modified_newtonian(sin_inclination: float, k: float) -> float:
    """Modified Newtonian impact pressure Cp = k sin^2 d; zero in the shadow (Lees, 1955)."""
    s = max(sin_inclination, 0.0)
    return k * s * s


@compiled
def osu_blunt_body(sin_inclination: float, k: float, mach: float, gamma: float) -> float:
    """Ohio State University blunt-body correlation (method 1; S/HABP "OSU blunt body empirical").

    With theta the angle from the stagnation point, p/p02 = 0.32 + 0.455 cos(theta) + 0.195 cos(2 theta) +
    0.035 cos(3 theta) - 0.005 cos(4 theta): a fit to pressures measured on cylinders across the stream. Only
    meant for a blunt nose; a slender cone gets several times its real pressure.
    """
    c = max(sin_inclination, -0.5)  # beyond 120 deg from the stagnation point the fit turns up again
    c2 = c * c
    ratio = 0.32 + 0.455 * c + 0.195 * (2.0 * c2 - 1.0) + 0.035 * c * (4.0 * c2 - 3.0)
    ratio -= 0.005 * (8.0 * c2 * (c2 - 1.0) + 1.0)
    dynamic = 0.5 * gamma * mach * mach
    return (ratio * (k * dynamic + 1.0) - 1.0) / dynamic


@compiled
def kaufman_pressure_ratio(match_mach: float, gamma: float) -> float:
    """Free-stream static over pitot pressure, p1/p02, whose matching point has this Mach number.

    Equal pressure and equal slope of p/p02 = P + (1 - P) sin^2 d and of a Prandtl-Meyer expansion give
    P = Q [1 - gamma^2 M^4 Q / (4 (M^2 - 1)(1 - Q))], Q = p/p0 at the matching Mach number M (Kaufman, Journal
    of the Astronautical Sciences 10, 1963).
    """
    m2 = match_mach * match_mach
    q = (1.0 + 0.5 * (gamma - 1.0) * m2) ** (-gamma / (gamma - 1.0))
    return float(q * (1.0 - (gamma * m2) ** 2 * q / (4.0 * (m2 - 1.0) * (1.0 - q))))


@compiled
def kaufman_limit(gamma: float) -> tuple[float, float]:
    """Matching Mach number of the slowest free stream that has one, and that stream's p1/p02.

    The maximum of :func:`kaufman_pressure_ratio` over Mach number (1.7206 and 0.09126, hence free-stream Mach
    2.8535, for gamma 1.4), by golden-section search.
    """
    low, high = 1.2, 2.5
    ratio = 0.5 * (math.sqrt(5.0) - 1.0)
    for _ in range(80):
        a = high - ratio * (high - low)
        b = low + ratio * (high - low)
        if kaufman_pressure_ratio(a, gamma) > kaufman_pressure_ratio(b, gamma):
            high = b
        else:
            low = a
    mach = 0.5 * (low + high)
    return mach, kaufman_pressure_ratio(mach, gamma)


@compiled
def kaufman_match(
    mach: float, gamma: float, limit_mach: float, limit_pressure_ratio: float
) -> tuple[float, float, float, float]:
    """Matching point of the modified Newtonian plus Prandtl-Meyer method (method 3).

    Parameters
    ----------
    mach, gamma : float
        Free stream, ``mach`` > 1.
    limit_mach, limit_pressure_ratio : float
        What :func:`kaufman_limit` gives for this ``gamma``.

    Returns
    -------
    match_mach, pressure_ratio, inclination_rad : float
        Mach number, p/p02 and surface inclination at the matching point.
    share : float
        Part of the turn beyond the matching point that the expansion follows: 1 where pressure and slope both
        match. Below free-stream Mach 2.8535 (gamma 1.4) no point matches both; there the pressure is matched,
        at an inclination that goes smoothly from the limit's to zero as p1/p02 rises to 0.3 (Mach 1.5), and
        the expansion is slowed until the slope matches too. A kink would make the normal-force slope jump
        when the matching point passes the inclination of a whole cone.
    """
    p = 1.0 / pitot_pressure_ratio(mach, gamma)
    if p < limit_pressure_ratio:
        match_mach = _smaller_root(p, gamma, limit_mach)
        q = _expansion(match_mach, gamma)
        return match_mach, q, math.asin(math.sqrt((q - p) / (1.0 - p))), 1.0
    q = _expansion(limit_mach, gamma)
    limit_angle = math.asin(math.sqrt((q - limit_pressure_ratio) / (1.0 - limit_pressure_ratio)))
    angle = limit_angle * (1.0 - smooth_step(p, limit_pressure_ratio, 0.3))
    q = p + (1.0 - p) * math.sin(angle) ** 2
    match_mach2 = 2.0 / (gamma - 1.0) * (q ** (-(gamma - 1.0) / gamma) - 1.0)
    slope = q * gamma * match_mach2 / math.sqrt(match_mach2 - 1.0)
    return math.sqrt(match_mach2), q, angle, (1.0 - p) * math.sin(2.0 * angle) / slope


@compiled
def _expansion(mach: float, gamma: float) -> float:
    """Static over total pressure."""
    return float((1.0 + 0.5 * (gamma - 1.0) * mach * mach) ** (-gamma / (gamma - 1.0)))


@compiled
def _smaller_root(p: float, gamma: float, limit_mach: float) -> float:
    """Solve kaufman_pressure_ratio(m) = p for m below ``limit_mach``: regula falsi, Illinois weights."""
    low, high = 1.25, limit_mach
    f_low = kaufman_pressure_ratio(low, gamma) - p
    f_high = kaufman_pressure_ratio(high, gamma) - p
    m = high
    for _ in range(60):
        m = high - f_high * (high - low) / (f_high - f_low)
        f = kaufman_pressure_ratio(m, gamma) - p
        if f == 0.0 or abs(high - low) < 1e-15:
            break
        if f * f_high < 0.0:
            low, f_low = high, f_high
        else:
            f_low *= 0.5
        high, f_high = m, f
    return m


@compiled
def newtonian_prandtl_meyer(
    sin_inclination: float,
    k: float,
    mach: float,
    gamma: float,
    match_sin: float,
    grazing_nu_rad: float,
    share: float = 1.0,
) -> float:
    """Modified Newtonian plus Prandtl-Meyer pressure (method 3; Kaufman, 1963).

    Newtonian where the surface is steeper than the matching point; beyond it an isentropic expansion of the
    gas behind the normal shock. Never below 70 % of vacuum, -1/M^2 for gamma 1.4, as S/HABP does.

    Parameters
    ----------
    match_sin : float
        Sine of the matching inclination.
    grazing_nu_rad : float
        Prandtl-Meyer angle at zero inclination: that of the matching point plus ``share`` times the matching
        inclination.
    share : float
        Part of the turn that the expansion follows, see :func:`kaufman_match`.
    """
    if sin_inclination >= match_sin:
        return modified_newtonian(sin_inclination, k)
    nu = grazing_nu_rad - share * math.asin(max(sin_inclination, -1.0))
    ratio = _expansion(prandtl_meyer_mach(nu, gamma), gamma)
    dynamic = 0.5 * gamma * mach * mach
    return max(float((ratio * (k * dynamic + 1.0) - 1.0) / dynamic), shadow_pressure(mach, gamma))


@compiled
def _second_order_cone(sin_inclination: float, shock_mach: float, gamma: float) -> float:
    """Cp = 2 s^2 / (1 - ((g-1) m^2 + 2) / (4 (g+1) m^2)), m the Mach number normal to the shock."""
    m2 = shock_mach * shock_mach
    return 2.0 * sin_inclination**2 / (1.0 - 0.25 * ((gamma - 1.0) * m2 + 2.0) / ((gamma + 1.0) * m2))


@compiled
def tangent_cone_habp3(sin_inclination: float, mach: float, gamma: float) -> float:
    """Tangent cone of S/HABP Mark III ("tangent cone empirical", AFFDL-TR-73-159 II); zero in the shadow."""
    s = max(sin_inclination, 0.0)
    similarity = 2.0 * (gamma + 1.0) / (gamma + 3.0) * mach * s
    return _second_order_cone(s, similarity + math.exp(-0.5 * similarity), gamma)


@compiled
def tangent_cone_edwards(sin_inclination: float, mach: float, gamma: float) -> float:
    """Tangent cone with the shock Mach number of Edwards (NASA TP-1539, appendix); fitted for gamma 1.4."""
    s = max(sin_inclination, 0.0)
    return _second_order_cone(s, (0.87 * mach - 0.544) * s + 0.53, gamma)


class ConeCurve(NamedTuple):
    """What the tangent cones of one Mach number share: the parabola between slender body and conical flow.

    It starts at ``lower``, in M sin d, with the value and the slope of the slender body, and ends at
    ``upper`` with the value of the conical flow.
    """

    lower: float
    upper: float
    start: float
    slope: float
    end: float


NO_CURVE = ConeCurve(0.0, 0.0, 0.0, 0.0, 0.0)
"""Where no law asks for it."""


@compiled
def cone_curve(mach: float, gamma: float) -> ConeCurve:
    """Parabola of :func:`tangent_cone_hammitt_murthy` at a Mach number above 1."""
    # the method jumps from 0.2 to 0.3 at Mach 3
    lower = 0.2 + 0.1 * smooth_step(mach, 3.0, 3.2)
    upper = 1.4 - 1.075 * math.exp(-0.8 * max(mach - 1.5, 0.0))
    start, slope = _slender_cone(lower / mach, mach, gamma)
    return ConeCurve(lower, upper, start, slope / mach, _conical_flow(upper / mach, mach, gamma))


@compiled
def cone_on_curve(
    sin_inclination: float, mach: float, gamma: float, rounding: float, curve: ConeCurve
) -> float:
    """Do what :func:`tangent_cone_hammitt_murthy` does, with the :func:`cone_curve` of this Mach number."""
    s = max(sin_inclination, 0.0)
    if s == 0.0:
        return 0.0
    similarity = mach * s
    if similarity <= curve.lower:
        return _slender_cone(s, mach, gamma)[0]
    conical = smooth_step(similarity, curve.upper - rounding, curve.upper + rounding)
    if conical == 1.0:
        return _conical_flow(s, mach, gamma)
    width = curve.upper - curve.lower
    x = similarity - curve.lower
    bend = curve.end - curve.start - curve.slope * width
    parabola = curve.start + curve.slope * x + bend * (x / width) ** 2
    if conical == 0.0:
        return parabola
    return parabola + conical * (_conical_flow(s, mach, gamma) - parabola)


@compiled
def tangent_cone_hammitt_murthy(
    sin_inclination: float, mach: float, gamma: float, rounding: float = 0.0
) -> float:
    """Improved tangent cone of S/HABP: slender-body theory joined to Hammitt and Murthy's cone (Cruz, Sova).

    Second-order slender-body theory for small M sin d, Hammitt and Murthy's approximate conical flow for
    large ones, a parabola between; the Mark III law once the shock detaches. Zero in the shadow. Within 1 %
    of the Taylor-Maccoll solution for cones of 5 to 20 degrees at Mach 3 to 20.

    The parabola meets the conical flow with a kink of some 2 %, which the normal-force slope of a whole cone
    shows as a step at the Mach number where the kink passes it. ``rounding`` mixes the two over that distance
    in M sin d to either side; 0.1 changes Cp by less than 6e-4 of its value.
    """
    return cone_on_curve(sin_inclination, mach, gamma, rounding, cone_curve(mach, gamma))


@compiled
def _slender_cone(s: float, mach: float, gamma: float) -> tuple[float, float]:
    """Cp of second-order slender-body theory on a cone and its derivative with respect to s."""
    e = mach * mach
    b = math.sqrt(e - 1.0)
    cos2 = 1.0 - s * s
    t = s / math.sqrt(cos2)
    t2 = t * t
    phi = math.log(2.0 / (b * t))
    constant = 3.25 * e + 0.5 + (gamma + 1.0) * e * e / (b * b)
    bracket = 3.0 * (b * phi) ** 2 - (5.0 * e - 1.0) * phi + constant
    cp = t2 * (2.0 * phi - 1.0 + t2 * bracket)
    d_bracket = (-6.0 * b * b * phi + 5.0 * e - 1.0) / t
    d_cp = 2.0 * t * (2.0 * phi - 1.0 + t2 * bracket) + t2 * (-2.0 / t + 2.0 * t * bracket + t2 * d_bracket)
    return cp, d_cp / (cos2 * math.sqrt(cos2))


@compiled
def _conical_flow(s: float, mach: float, gamma: float) -> float:
    """Cp of Hammitt and Murthy's approximate conical flow."""
    e = mach * mach
    h2 = (gamma - 1.0) * s * s + 2.0 / e
    h1 = 2.0 - (gamma + 5.0) * s * s
    sin_2d = 2.0 * s * math.sqrt(1.0 - s * s)
    hx = h1 * h2 / (sin_2d * sin_2d) if sin_2d > 0.0 else -1.0
    if hx <= -1.0:  # the shock has left the nose
        return tangent_cone_habp3(s, mach, gamma)
    beta_minus_d = h2 / (sin_2d * (1.0 + math.sqrt(1.0 + hx)))
    beta = math.asin(s) + beta_minus_d
    n = e * math.sin(beta) ** 2
    hs = 1.0 + 2.0 * beta_minus_d**2
    cone_mach2 = (e - n) * hs / (1.0 + 0.5 * (gamma - 1.0) * (n * hs - (hs - 1.0) * e))
    el = (gamma - 1.0) / (gamma + 1.0)
    shock = 2.0 * gamma * n / (gamma + 1.0) - el
    heat = (shock + el) / ((1.0 + el * shock) * shock)
    ratio = (2.0 + (gamma - 1.0) * e) / (2.0 + (gamma - 1.0) * cone_mach2)
    surface = (ratio * heat) ** (gamma / (gamma - 1.0)) * shock
    return float((surface - 1.0) * 2.0 / (gamma * e))


@compiled
def prandtl_meyer_expansion(sin_inclination: float, mach: float, gamma: float) -> float:
    """Expansion of the free stream around a surface that turns away from it (zero when it does not)."""
    if sin_inclination >= 0.0:
        return 0.0
    nu = prandtl_meyer_angle(mach, gamma) - math.asin(max(sin_inclination, -1.0))
    local_mach = prandtl_meyer_mach(nu, gamma)
    ratio = (1.0 + 0.5 * (gamma - 1.0) * mach * mach) / (1.0 + 0.5 * (gamma - 1.0) * local_mach * local_mach)
    return float((ratio ** (gamma / (gamma - 1.0)) - 1.0) * 2.0 / (gamma * mach * mach))


@compiled
def free_stream_pressure() -> float:
    """Cp = 0: what lies in the shadow feels the free stream's pressure (Newtonian theory)."""
    return 0.0


@compiled
def vacuum_pressure(mach: float, gamma: float) -> float:
    """Cp of a perfect vacuum, -2/(gamma M^2): the base and shadow limit at high Mach number (method 5)."""
    return -2.0 / (gamma * mach * mach)


@compiled
def shadow_pressure(mach: float, gamma: float) -> float:
    """Cp of 70 % of a perfect vacuum, as measured in the wake in air: -1/M^2 for gamma 1.4 (method 5)."""
    return 0.7 * vacuum_pressure(mach, gamma)


@compiled
def habp_base_pressure(mach: float, gamma: float) -> float:
    """Base pressure coefficient of S/HABP, -1/M^2 + 0.57/M^4 (written for gamma 1.4)."""
    m2 = mach * mach
    return (0.57 / m2 - 1.0) / m2


@compiled
def base_correlation(mach: float) -> float:
    """Base pressure coefficient of slender bodies, coasting, from subsonic to low supersonic speed.

    -(0.12 + 0.13 M^2) below Mach 1, -0.25/M above (Fleeman, Tactical Missile Design, AIAA, 2001).
    """
    return -(0.12 + 0.13 * mach * mach) if mach < 1.0 else -0.25 / mach


@compiled
def corrected_newtonian(sin_inclination: float, k: float) -> float:
    """Newtonian pressure of a spherical nose with the axial force of Euler solutions, 4.3 % below k sin^2 d.

    k sin^2 d (1 - 0.13 cos^2 d): fitted (``docs/validation/aero-best.md``); exact at the stagnation point.
    """
    s = max(sin_inclination, 0.0)
    s2 = s * s
    return k * s2 * (1.0 - 0.13 * (1.0 - s2))


@compiled
def entropy_layer_cone(cone_cp: float, distance: float, sin_half_angle: float, mach: float) -> float:
    """Pressure on a blunted cone: the flow overexpands behind the nose, then recovers to the sharp cone's.

    Cp = Cp_cone (1 - a exp(-x sin^2 th / 0.52)) + b exp(-x / 2.8), x the distance behind the tangent point
    over the nose radius, a = 0.754 - 6.39/M^2, b = 0.1079 - 1.217/M^2, both held positive by a smooth bound;
    fitted to Euler solutions at Mach 5 and 10 (``docs/validation/aero-best.md``). The recovery scales with
    x sin^2 th as the hypersonic similarity of blunted slender cones asks (Cheng, Journal of Fluid Mechanics
    10, 1961).

    Parameters
    ----------
    cone_cp : float
        Pressure coefficient of the sharp (tangent) cone.
    distance : float
        Along the surface from the tangent point, over the nose radius.
    sin_half_angle : float
        Sine of the cone's half-angle.
    """
    return overexpanded(
        cone_cp, recovery(distance, sin_half_angle), nose_trace(distance), overexpansion(mach)
    )


class Overexpansion(NamedTuple):
    """How far the flow behind a blunt nose overexpands, and what the nose's own pressure adds."""

    loss: float
    excess: float


NO_OVEREXPANSION = Overexpansion(0.0, 0.0)
"""Where no law asks for it."""


@compiled
def overexpansion(mach: float) -> Overexpansion:
    """Evaluate a and b of :func:`entropy_layer_cone`."""
    a = 0.754 - 6.3884 / mach**2
    b = 0.1079 - 1.2169 / mach**2
    return Overexpansion(0.5 * (a + math.sqrt(a * a + 1e-3)), 0.5 * (b + math.sqrt(b * b + 1e-4)))


@compiled
def recovery(distance: float, sin_half_angle: float) -> float:
    """Share of the overexpansion that is left at a distance of nose radii."""
    return math.exp(-distance * sin_half_angle * sin_half_angle / 0.5203)


@compiled
def nose_trace(distance: float) -> float:
    """Share of the nose's own pressure that is left at a distance of nose radii."""
    return math.exp(-distance / 2.8026)


@inlined
def overexpanded(cone_cp: float, recovery: float, nose_trace: float, mach_part: Overexpansion) -> float:
    """Do what :func:`entropy_layer_cone` does, from its parts by place and by Mach number."""
    return cone_cp * (1.0 - mach_part.loss * recovery) + mach_part.excess * nose_trace


@compiled
def local_turn(cp: float, turn_rad: float, mach: float, gamma: float) -> float:
    """Cp after the flow along a surface of pressure coefficient ``cp`` turns towards the body (> 0) or away.

    The flow that turns is the gas of the normal shock, expanded to the surface pressure: slower, and of far
    less dynamic pressure than the free stream. Hypersonic small-disturbance theory in its unified supersonic
    form (Van Dyke, NACA Report 1194, 1954): tangent wedge when compressed (times 1.025, fitted with
    :func:`entropy_layer_cone`), simple wave when expanded.
    """
    return turned(cp, turn_rad, mach, gamma, pitot_pressure_ratio(mach, gamma))


@compiled
def turned(cp: float, turn_rad: float, mach: float, gamma: float, pitot: float) -> float:
    """Do what :func:`local_turn` does, with the pitot over the static pressure of this Mach number."""
    stream = 0.5 * gamma * mach * mach
    pressure = max(1.0 + stream * cp, 0.2)
    ratio = (pitot / pressure) ** ((gamma - 1.0) / gamma)
    local_mach2 = max(2.0 / (gamma - 1.0) * (ratio - 1.0), 1.1)
    if turn_rad > 0.0:
        half = 0.25 * (gamma + 1.0) * turn_rad
        rise = turn_rad * (half + math.sqrt(half * half + 1.0 / (local_mach2 - 1.0)))
        return float(cp + 2.0 * 1.0252 * pressure * local_mach2 / (mach * mach) * rise)
    similarity2 = (local_mach2 - 1.0) * turn_rad * turn_rad
    drop = max(1.0 - 0.5 * (gamma - 1.0) * math.sqrt(similarity2), 0.0) ** (2.0 * gamma / (gamma - 1.0))
    return float(cp + pressure * (drop - 1.0) / stream)
