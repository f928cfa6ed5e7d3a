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
from numpy.typing import NDArray

from rsmkit.language.space import Floats, Space
from rsmkit.language.terms import Exponents, Terms
from rsmkit.surfaces.estimation.stretch import Stretch

__all__ = ["Coordinates", "bounds", "conversion", "hull"]


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
    def rounded(self) -> Coordinates:
        """About the same box, scaled by powers of two: factor values of few digits keep them in z."""
        half = np.exp2(np.round(np.log2(self.half_range)))
        return Coordinates(tuple((self.center - half).tolist()), tuple((self.center + half).tolist()))

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


def conversion(terms: Terms, into: Coordinates, out_of: Coordinates) -> NDArray[np.longdouble]:
    """Matrix that turns coefficients in one set of coordinates into those in another, in extended precision.

    Both are polynomials of the same points, ``z_j = a_j + b_j c_j``; each product of powers is expanded by
    the binomial theorem. Neither may be stretched; terms without hierarchy need the same centre in both.

    Returns
    -------
    array, shape (p, p)
    """
    factors = list(terms.variable_factors)
    half = out_of.half_range.astype(np.longdouble)
    shift = ((into.center - out_of.center) * terms.hierarchical / half)[factors]
    scale = (into.half_range / half)[factors]
    position = {column: i for i, column in enumerate(terms.columns)}
    matrix = np.zeros((terms.p, terms.p), np.longdouble)
    for index, column in enumerate(terms.columns):
        for lower, weight in _expansion(column, shift, scale):
            matrix[position[lower], index] = weight
    return matrix


def _expansion(
    column: Exponents, a: NDArray[np.longdouble], b: NDArray[np.longdouble]
) -> list[tuple[Exponents, np.longdouble]]:
    """Monomials of ``prod_j (a_j + b_j c_j)^e_j`` with their weights."""
    found = [(column, np.longdouble(1))]
    for v, power in enumerate(column):
        if power:
            ways = [(m, comb(power, m) * a[v] ** (power - m) * b[v] ** m) for m in range(power + 1)]
            found = [((*e[:v], m, *e[v + 1 :]), w * factor) for e, w in found for m, factor in ways if factor]
    return found
