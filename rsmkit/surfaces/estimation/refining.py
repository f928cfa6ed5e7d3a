"""Iterative refinement: least-squares coefficients right to the last bit, whatever computed them first.

Residuals and gradient are computed with 32 digits, the step with 16; each step multiplies the error by about
the condition number of the columns times 1e-16 (Bjorck 1967, BIT 7, 257-278). Where it ends depends on the
runs alone, not on the processor or on the linear algebra that the first estimate came from.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from rsmkit.language.exponents import Exponents, monomials
from rsmkit.language.space import Floats
from rsmkit.language.terms import Terms
from rsmkit.surfaces.estimation.coordinates import Coordinates
from rsmkit.surfaces.estimation.double_double import DoubleDouble, double_double, joined
from rsmkit.surfaces.estimation.fit_data import FitData

__all__ = ["precise_columns", "precise_residuals", "refined"]

STEPS = 20
"""At most; two are usual."""
ENOUGH = 2.0**-90
"""The next step would be smaller than this part of the largest coefficient."""
CHUNK = 2**14
"""Elements of the design matrix at a time: their products then stay in the processor's cache."""


def precise_columns(terms: Terms, coordinates: Coordinates, data: FitData) -> DoubleDouble:
    """Columns of the design matrix with 32 digits: the constant, the blocks, the other terms; shape (p, n).

    Stretched coordinates have 16 digits, and count as exact.
    """
    if coordinates.stretches:
        z = double_double(coordinates.forward(data.points))
    else:
        z = (double_double(data.points) - coordinates.center) / coordinates.half_range
    variables = terms.variables(z.high)
    lows = [np.zeros(len(data)) if terms.levels[j] else z.low[:, j] for j in terms.variable_factors]
    one = (0,) * len(variables)
    known = {one: double_double(np.ones(len(data)))}

    def column(exponents: Exponents) -> DoubleDouble:
        if exponents not in known:
            last = max(v for v, power in enumerate(exponents) if power)
            parent = tuple(power - (v == last) for v, power in enumerate(exponents))
            known[exponents] = column(parent) * DoubleDouble(variables[last], lows[last])
        return known[exponents]

    def whole(exponents: Exponents, pair: tuple[int, int] | None) -> DoubleDouble:
        parts = [column(e) if weight > 0 else -column(e) for e, weight in monomials(exponents, pair)]
        return parts[0] if len(parts) == 1 else parts[0] + parts[1]

    columns = [whole(*each) for each in zip(terms.columns, terms.differences, strict=True)]
    columns[1:1] = [double_double(indicator) for indicator in data.block_columns().T]
    return DoubleDouble(np.array([c.high for c in columns]), np.array([c.low for c in columns]))


def precise_residuals(columns: DoubleDouble, y: Floats, coefficients: DoubleDouble | Floats) -> DoubleDouble:
    """Observed minus fitted with 32 digits, shape (n,)."""
    beta = double_double(coefficients)[:, None]
    return joined([double_double(y[part]) - (columns[:, part] * beta).total() for part in _parts(columns)])


def refined(columns: DoubleDouble, data: FitData, start: Floats, factor: Floats) -> DoubleDouble:
    """Coefficients of least squares, shape (p,).

    Parameters
    ----------
    columns : DoubleDouble, shape (p, n)
        From :func:`precise_columns`.
    data : FitData
    start : array, shape (p,)
        A first estimate.
    factor : array, shape (p, p)
        ``factor @ factor.T`` is about the inverse of ``X'WX``.
    """
    weights = np.ones(len(data)) if data.weights is None else data.weights
    found, before = double_double(start), np.inf
    for count in range(STEPS):
        gradient = double_double(np.zeros(len(start)))
        for part in _parts(columns):
            left = precise_residuals(columns[:, part], data.y[part], found) * weights[part]
            gradient = gradient + (columns[:, part] * left).T.total()
        step = factor @ (factor.T @ gradient.high)
        size = np.abs(step).max()
        if not size < 0.5 * before:  # nothing but rounding is left, or the numbers are beyond all range
            break
        found = found + step
        if count and size * (size / before) <= ENOUGH * np.abs(found.high).max():
            break
        before = size
    return found


def _parts(columns: DoubleDouble) -> Iterator[slice]:
    p, n = columns.high.shape
    rows = max(1, CHUNK // p)
    return (slice(first, first + rows) for first in range(0, n, rows))
