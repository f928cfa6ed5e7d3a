"""Axes of a table of loads: knots, and cubic interpolation between them with a continuous slope.

Between two knots a cubic has the values there and the slopes of the parabolas through each and its
neighbours (Catmull and Rom, 1974, on uneven knots): it reproduces parabolas, and its error falls with the
third power of the spacing. At the ends, and at knots where the laws themselves have a kink, the parabolas lie
to one side.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["AXES", "Axis", "Ruling", "ruling"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


class Axis(NamedTuple):
    """Knots along one variable, ascending, and those of them at which the loads have a kink."""

    knots: Floats
    kinks: tuple[float, ...] = ()


class Ruling(NamedTuple):
    """Axes as the compiled table reads them, padded to the longest.

    Attributes
    ----------
    knots : (axes, n)
    cells : (axes,)
        Number of intervals.
    first : (axes, n)
        First of the four knots that a cell depends on.
    weights : (axes, n, 4, 4)
        Of those four, as polynomials in the fraction of the cell, constant first.
    """

    knots: Floats
    cells: Integers
    first: Integers
    weights: Floats


def _steps(*legs: tuple[float, float, int]) -> Floats:
    """Knots over legs of (start, end, number of cells)."""
    rows = [np.linspace(start, end, cells + 1)[:-1] for start, end, cells in legs]
    return np.append(np.concatenate(rows), legs[-1][1])


_FASTEST = 6.5 * 1.05**53  # 86
_LN_10 = math.log(10.0)

AXES: tuple[Axis, ...] = (
    # Mach number: knots where the sets of laws start and end to mix, a kink of the base pressure at 1
    Axis(
        np.append(
            _steps(
                (0.1, 0.5, 8), (0.5, 1.5, 16), (1.5, 3.0, 15), (3.0, 4.5, 10), (4.5, 5.5, 10), (5.5, 6.5, 8)
            )[:-1],
            np.geomspace(6.5, _FASTEST, 54),
        ),
        kinks=(1.0,),
    ),
    # logarithm of the Knudsen number: knots at 0.01 and 10, between which the loads pass to free molecules;
    # from laminar to turbulent a place along the body passes within a factor of 2
    Axis(_steps((-8.0 * _LN_10, -2.0 * _LN_10, 70), (-2.0 * _LN_10, _LN_10, 35), (_LN_10, 3.0 * _LN_10, 10))),
    # temperature, K
    Axis(np.geomspace(110.0, 2000.0, 27)),
    # incidence: the shadow comes over 3 deg, on a cylinder as soon as there is any
    Axis(np.radians(_steps((0.0, 5.0, 10), (5.0, 40.0, 28), (40.0, 180.0, 70)))),
)
"""Mach number, ln of the Knudsen number, temperature (K), incidence (rad)."""


def ruling(axes: Sequence[Axis]) -> Ruling:
    """Precompute the interpolation along every axis."""
    longest = max((axis.knots.size for axis in axes), default=0)
    shape = len(axes), longest
    knots, first = np.full(shape, np.inf), np.zeros(shape, dtype=np.int64)
    weights = np.zeros((*shape, 4, 4))
    for a, axis in enumerate(axes):
        n = axis.knots.size
        knots[a, :n] = axis.knots
        ends = [0, *(int(np.argmin(np.abs(axis.knots - kink))) for kink in axis.kinks), n - 1]
        for start, end in pairwise(ends):
            for cell in range(start, end):
                first[a, cell] = min(max(cell - 1, start), end - 3)
                weights[a, cell] = _cell_weights(axis.knots, cell, int(first[a, cell]), start, end)
    return Ruling(knots, np.array([axis.knots.size - 1 for axis in axes], dtype=np.int64), first, weights)


def _cell_weights(knots: Floats, cell: int, first: int, start: int, end: int) -> Floats:
    """Weights (4 knots, 4 powers of the fraction) of one cell of a stretch of knots from start to end."""
    width = knots[cell + 1] - knots[cell]
    weights = np.zeros((4, 4))
    for j in range(4):
        value = np.zeros(knots.size)
        value[first + j] = 1.0
        low, high = (
            width * _slope(knots, value, i, min(max(i, start + 1), end - 1)) for i in (cell, cell + 1)
        )
        rise = value[cell + 1] - value[cell]
        weights[j] = value[cell], low, 3.0 * rise - 2.0 * low - high, low + high - 2.0 * rise
    return weights


def _slope(knots: Floats, value: Floats, at: int, middle: int) -> float:
    """Slope at knot `at` of the parabola through the knot `middle` and its two neighbours."""
    (x0, x1, x2), (y0, y1, y2) = knots[middle - 1 : middle + 2], value[middle - 1 : middle + 2]
    x = knots[at]
    return float(
        y0 * (2.0 * x - x1 - x2) / ((x0 - x1) * (x0 - x2))
        + y1 * (2.0 * x - x0 - x2) / ((x1 - x0) * (x1 - x2))
        + y2 * (2.0 * x - x0 - x1) / ((x2 - x0) * (x2 - x1))
    )
