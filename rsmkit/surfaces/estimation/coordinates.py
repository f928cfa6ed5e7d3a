"""Working coordinates of a surface: the hull of its runs mapped onto [-1, 1] per factor, perhaps stretched.

Surfaces are estimated in these coordinates because powers of them are well conditioned whatever the units of
the factors; star points outside the bounds of the space are inside the hull, so nothing is ever clamped.
Reported coefficients are those of the space's coded units; :func:`conversion` converts exactly.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import comb

import numpy as np

from rsmkit.language.space import Floats, Space
from rsmkit.language.terms import Terms
from rsmkit.surfaces.estimation.double_double import DoubleDouble, double_double
from rsmkit.surfaces.estimation.stretch import Stretch

__all__ = ["Coordinates", "bounds", "conversion", "hull", "scaled"]


@dataclass(frozen=True)
class Coordinates:
    """``z = 2 s(u) - 1`` with ``u = (x - low) / (high - low)``; s is the identity without a stretch.

    Parameters
    ----------
    low, high : tuple of float
        Ends of the hull in natural units; -1 and 1 for categorical factors, whose column stays a level index.
    stretches : tuple of Stretch
        One per factor, or empty when none is stretched.
    """

    low: tuple[float, ...]
    high: tuple[float, ...]
    stretches: tuple[Stretch, ...] = ()

    @cached_property
    def center(self) -> Floats:
        """Natural value in the middle of the hull, shape (k,)."""
        center: Floats = 0.5 * (np.array(self.low) + np.array(self.high))
        return center

    @cached_property
    def half_range(self) -> Floats:
        """Half the natural length of the hull, shape (k,)."""
        half: Floats = 0.5 * (np.array(self.high) - np.array(self.low))
        return half

    @property
    def _stretched(self) -> list[tuple[int, Stretch]]:
        return [(j, stretch) for j, stretch in enumerate(self.stretches) if stretch.family != "identity"]

    def forward(self, natural: Floats) -> Floats:
        """Natural units to z, shape (n, k) in and out."""
        z: Floats = (natural - self.center) / self.half_range
        for j, stretch in self._stretched:
            z[..., j] = 2.0 * stretch.forward(0.5 * (z[..., j] + 1.0)) - 1.0
        return z

    def backward(self, z: Floats) -> Floats:
        """Take z back to natural units, shape (n, k) in and out."""
        flat = np.array(z, float)
        for j, stretch in self._stretched:
            flat[..., j] = 2.0 * stretch.inverse(0.5 * (flat[..., j] + 1.0)) - 1.0
        natural: Floats = self.center + self.half_range * flat
        return natural

    def slopes(self, natural: Floats) -> Floats:
        """Derivatives dz/dx, shape (n, k)."""
        slopes = np.tile(1.0 / self.half_range, (len(natural), 1))
        for j, stretch in self._stretched:
            u = 0.5 * ((natural[:, j] - self.center[j]) / self.half_range[j] + 1.0)
            slopes[:, j] *= stretch.slope(u)
        return slopes


def hull(space: Space, points: Floats) -> Coordinates:
    """Coordinates of the smallest box that holds all runs (width 2 around a factor that never varies)."""
    low, high = points.min(axis=0), points.max(axis=0)
    flat = low == high
    low = np.where(space.numeric, low - flat, -1.0)
    high = np.where(space.numeric, high + flat, 1.0)
    return Coordinates(tuple(low.tolist()), tuple(high.tolist()))


def bounds(space: Space) -> Coordinates:
    """Coded units of a space as coordinates."""
    low, high = np.where(space.numeric, [space.lows, space.highs], [[-1.0], [1.0]])
    return Coordinates(tuple(low.tolist()), tuple(high.tolist()))


def scaled(space: Space, points: Floats) -> Coordinates:
    """Coded units divided by their largest size: what terms without hierarchy allow."""
    coded = bounds(space)
    size = np.where(space.numeric, np.abs(coded.forward(points)).max(axis=0), 1.0)
    size[size == 0] = 1.0
    return Coordinates(tuple(coded.backward(-size).tolist()), tuple(coded.backward(size).tolist()))


def conversion(terms: Terms, into: Coordinates, out_of: Coordinates) -> DoubleDouble:
    """Matrix that turns coefficients in one set of coordinates into those in another, with 32 digits.

    Both are polynomials of the same points, ``z_j = a_j + b_j c_j``; each product of powers is expanded by
    the binomial theorem. Neither may be stretched; terms without hierarchy need the same centre in both.

    Returns
    -------
    DoubleDouble, shape (p, p)
    """
    factors = list(terms.variable_factors)
    half = out_of.half_range[factors]
    apart = double_double(into.center) - out_of.center
    shift = (apart * float(terms.hierarchical))[factors] / half
    scale = double_double(into.half_range)[factors] / half
    powers = range(terms.order + 1)
    ways = [[_binomial(shift[v], scale[v], power) for power in powers] for v in range(len(factors))]
    position = {column: i for i, column in enumerate(terms.columns)}
    matrix = double_double(np.zeros((terms.p, terms.p)))
    for index, column in enumerate(terms.columns):
        found = [(column, double_double(1.0))]
        for v, power in enumerate(column):
            if power:
                found = [((*e[:v], m, *e[v + 1 :]), w * by) for e, w in found for m, by in ways[v][power]]
        for lower, weight in found:
            matrix.high[position[lower], index] = weight.high
            matrix.low[position[lower], index] = weight.low
    return matrix


def _binomial(a: DoubleDouble, b: DoubleDouble, power: int) -> list[tuple[int, DoubleDouble]]:
    """Powers of c in ``(a + b c)^power`` with their weights, where these are not zero."""
    weights = [(m, a.power(power - m) * b.power(m) * comb(power, m)) for m in range(power + 1)]
    return [(m, weight) for m, weight in weights if weight.high]
