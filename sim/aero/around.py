"""Points around the body: where the meridians lie on which a ring is integrated.

``even`` takes Gauss-Legendre points in the meridian angle on either side of the shadow line, the same number
at every incidence. ``fitted`` takes as few as the incidence needs. Everything on a ring is a function of the
inclination a + b cos(phi), smooth on either side of the shadow line. Where the whole ring is lit, n midpoints
in phi (Gauss-Chebyshev points in the cosine) integrate polynomials of degree 2n - 1 in b/a cos(phi) exactly,
and b/a is small at small incidence. On a cylinder the shadow line lies at 90 deg, and Gauss points of the
weight 1/sqrt(1 - c^2) on (0, 1), mirrored, do the same for either side.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.core.compiled import inlined
from sim.core.quadrature import apply, gauss_legendre

__all__ = ["Around", "around", "chosen", "meridian", "room"]

Floats = NDArray[np.float64]

_SLIGHT, _SMALL = 0.08, 0.3  # ratios b/a up to which two smaller rules serve a lit ring
# Gauss's rules of two and of three points for the weight 1/sqrt(1 - c^2) on (0, 1), one behind the other
_HALF_COSINES = np.array(
    [0.8772416251351568, 0.24299274165006175, 0.9405227398999122, 0.5500785229008294, 0.1238764288792015]
)
_HALF_WEIGHTS = np.array(
    [0.9748663499110314, 0.5959299768838652, 0.6852022377479194, 0.5768331132780192, 0.308760975768958]
)
# Of the shadow's ramp: up to here what happens beside a cylinder's shadow line is a short series in b over
# the ramp; n points a side converge like 20^-2n and 10^-2n.
_HALF_RAMPS = (0.2, 0.4)


class Around(NamedTuple):
    """Points around the body for one purpose; Gauss-Legendre nodes and weights are those of (0, 1).

    ``lit_*`` hold the rules of 1, 2, ... points for a ring that is lit all around, one behind the other;
    ``slight``, ``small`` and ``large`` are the numbers of points for growing b/a, 0 where Gauss-Legendre
    points serve. ``half_*`` likewise hold rules of 2 and 3 points for one side of a cylinder, for b up to
    ``half_slight`` and ``half_end``.
    """

    windward_node: Floats
    windward_weight: Floats
    leeward_node: Floats
    leeward_weight: Floats
    full_circle: Floats
    lit_cosine: Floats
    slight: int
    small: int
    large: int
    half_cosine: Floats
    half_weight: Floats
    half_slight: float
    half_end: float


def around(windward: int, leeward: int, fitted: bool, shadow_ramp: float) -> Around:
    """Points for this many on the lit side and in the shadow, or as few as needed."""
    lit, lee = gauss_legendre(windward), gauss_legendre(leeward)
    slight, small, large = 0, 0, 0
    if fitted:
        slight, small, large = max(2, (windward + 1) // 3), max(3, windward // 2), max(3, windward)
    halves = fitted and windward <= 8
    cosines = [math.cos((j + 0.5) * math.pi / n) for n in range(1, large + 1) for j in range(n)]
    return Around(
        lit[0],
        lit[1],
        lee[0],
        lee[1],
        apply(math.cos, math.pi * lit[0]),
        np.array(cosines or [0.0]),
        slight,
        small,
        large,
        _HALF_COSINES,
        _HALF_WEIGHTS,
        _HALF_RAMPS[0] * shadow_ramp if halves and windward <= 4 else 0.0,
        _HALF_RAMPS[1] * shadow_ramp if halves else 0.0,
    )


def room(points: Around) -> int:
    """Largest number of points on a ring."""
    return max(points.windward_node.size + points.leeward_node.size, points.large, 2 * 3)


@inlined
def chosen(a: float, b: float, border: float, points: Around) -> tuple[int, int, int]:
    """Numbers of points on the lit side and in the shadow, and the rule: 0 Gauss-Legendre, 1 lit, 2 half."""
    if border == math.pi:
        if points.large == 0:
            return points.windward_node.size, 0, 0
        if b <= _SLIGHT * a:
            return points.slight, 0, 1
        return (points.small if b <= _SMALL * a else points.large), 0, 1
    if a == 0.0 and b <= points.half_end:
        side = 2 if b <= points.half_slight else 3
        return side, side, 2
    return points.windward_node.size, points.leeward_node.size, 0


@inlined
def meridian(j: int, lit: int, rule: int, border: float, points: Around) -> tuple[float, float]:
    """Cosine of the meridian angle of point j, and its share of half the circle in rad."""
    if rule == 1:
        return points.lit_cosine[lit * (lit - 1) // 2 + j], math.pi / lit
    if rule == 2:
        first = 2 if lit == 3 else 0
        if j < lit:
            return points.half_cosine[first + j], points.half_weight[first + j]
        return -points.half_cosine[first + j - lit], points.half_weight[first + j - lit]
    if j < lit:
        phi = border * points.windward_node[j]
        cosine = points.full_circle[j] if border == math.pi else math.cos(phi)
        return cosine, border * points.windward_weight[j]
    rest = math.pi - border
    phi = border + rest * points.leeward_node[j - lit]
    return math.cos(phi), rest * points.leeward_weight[j - lit]
