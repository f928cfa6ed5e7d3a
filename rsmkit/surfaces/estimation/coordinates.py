"""Working coordinates of a surface: the hull of its runs mapped onto [-1, 1] per factor, perhaps stretched.

Surfaces are estimated in these coordinates because powers of them are well conditioned whatever the units of
the factors; star points outside the bounds of the space are inside the hull, so nothing is ever clamped.
Reported coefficients are those of the space's coded units; :func:`conversion` converts exactly.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import comb

import numpy as np

from rsmkit.errors import RsmkitError
from rsmkit.language.exponents import Exponents, monomials
from rsmkit.language.scheffe import movable, on_simplex
from rsmkit.language.space import Floats, Space
from rsmkit.language.terms import Terms
from rsmkit.surfaces.estimation.double_double import DoubleDouble, double_double
from rsmkit.surfaces.estimation.stretch import Stretch

__all__ = ["Coordinates", "bounds", "conversion", "covering", "hull", "reported", "scaled", "working"]


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


def reported(space: Space, terms: Terms) -> Coordinates:
    """Units of reported coefficients: coded ones, and proportions of the components of a mixture.

    Raises
    ------
    RsmkitError
        If the components of the terms are no mixture of the space.
    """
    coded = bounds(space)
    if not terms.components:
        return coded
    names = [space.names[j] for j in terms.components]
    totals = [mixture.total for mixture in space.mixtures if set(mixture.components) == set(names)]
    if not totals:
        raise RsmkitError(f"{', '.join(names)} are no mixture of these factors; say what they add up to")
    low, high = np.array(coded.low), np.array(coded.high)
    low[[*terms.components]], high[[*terms.components]] = -totals[0], totals[0]
    return Coordinates(tuple(low.tolist()), tuple(high.tolist()))


def working(space: Space, points: Floats, terms: Terms) -> Coordinates:
    """Coordinates to estimate in: the hull of the runs where the model is the same about any origin.

    Other factors are divided by their largest size; components stay proportions.
    """
    if terms.hierarchical:
        return hull(space, points)
    apart, whole = scaled(space, points, terms), hull(space, points)
    free = np.array(movable(terms))
    free[[*terms.components]] = False
    low, high = np.where(free, [whole.low, whole.high], [apart.low, apart.high])
    return Coordinates(tuple(low.tolist()), tuple(high.tolist()))


def covering(space: Space, points: Floats, terms: Terms) -> Coordinates:
    """Coordinates to stretch in: the smallest box that holds all runs and the bounds of the factors.

    So nothing that may be asked for lies beyond the ends of a stretch, where it goes on straight. Where the
    model is not the same about any origin, those of :func:`working`.
    """
    if not terms.hierarchical:
        return working(space, points, terms)
    runs, box = hull(space, points), bounds(space)
    low, high = np.minimum(runs.low, box.low), np.maximum(runs.high, box.high)
    return Coordinates(tuple(low.tolist()), tuple(high.tolist()))


def scaled(space: Space, points: Floats, terms: Terms) -> Coordinates:
    """Reported units divided by their largest size: what terms without hierarchy allow."""
    coded = reported(space, terms)
    size = np.where(space.numeric, np.abs(coded.forward(points)).max(axis=0), 1.0)
    size[size == 0] = 1.0
    size[[*terms.components]] = 1.0
    return Coordinates(tuple(coded.backward(-size).tolist()), tuple(coded.backward(size).tolist()))


def conversion(terms: Terms, into: Coordinates, out_of: Coordinates) -> DoubleDouble:
    """Matrix that turns coefficients in one set of coordinates into those in another, with 32 digits.

    Both are polynomials of the same points, ``z_j = a_j + b_j c_j``; each product of powers is expanded by
    the binomial theorem, and what a mixture model does not hold is written in its terms, since the components
    of both coordinates add up to one. Neither may be stretched; a factor that is not
    :func:`rsmkit.language.scheffe.movable` needs the same centre in both.

    Returns
    -------
    DoubleDouble, shape (p, p)
    """
    factors = list(terms.variable_factors)
    half = out_of.half_range[factors]
    apart = double_double(into.center) - out_of.center
    shift = (apart * np.array(movable(terms), float))[factors] / half
    scale = double_double(into.half_range)[factors] / half
    powers = range(terms.order + 1)
    ways = [[_binomial(shift[v], scale[v], power) for power in powers] for v in range(len(factors))]
    position = {column: i for i, column in enumerate(terms.columns)}
    matrix = double_double(np.zeros((terms.p, terms.p)))
    for index, (column, pair) in enumerate(zip(terms.columns, terms.differences, strict=True)):
        found = [(e, double_double(weight)) for e, weight in monomials(column, pair)]
        for v in range(len(factors)):
            if column[v]:
                found = [((*e[:v], m, *e[v + 1 :]), w * by) for e, w in found for m, by in ways[v][e[v]]]
        for lower, weight in _in_terms(terms, found):
            matrix.high[position[lower], index] = weight.high
            matrix.low[position[lower], index] = weight.low
    return matrix


def _in_terms(
    terms: Terms, found: Sequence[tuple[Exponents, DoubleDouble]]
) -> Iterable[tuple[Exponents, DoubleDouble]]:
    """Products of powers with their weights as columns of the terms with theirs."""
    if not terms.components:
        return found
    basis = dict(zip(terms.columns, terms.differences, strict=True))
    components = [terms.variable_factors.index(j) for j in terms.components]
    total: dict[Exponents, DoubleDouble] = {}
    for lower, weight in found:
        shares = on_simplex(lower, basis, components)
        if shares is None:
            raise RsmkitError("model terms: these depend on the origin of a factor, which cannot be moved")
        for column, share in shares.items():
            total[column] = total.get(column, double_double(0.0)) + weight * share
    return total.items()


def _binomial(a: DoubleDouble, b: DoubleDouble, power: int) -> list[tuple[int, DoubleDouble]]:
    """Powers of c in ``(a + b c)^power`` with their weights, where these are not zero."""
    weights = [(m, a.power(power - m) * b.power(m) * comb(power, m)) for m in range(power + 1)]
    return [(m, weight) for m, weight in weights if weight.high]
