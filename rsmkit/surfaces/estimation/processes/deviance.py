"""Deviance of a Gaussian process and its slopes, compiled: what a search for lengths asks thousands of times.

The numbers of :attr:`rsmkit.surfaces.estimation.processes.kriging.Kriging.deviance` and ``deviance_slopes``
for a :class:`rsmkit.surfaces.estimation.processes.correlation.Separable` correlation, an estimated mean and
the likeliest variance. With the tens of runs of a study NumPy takes longer to be called than to count. Here
nothing is allocated, and sums are taken in the order written, whatever the processor.

Rasmussen & Williams, *Gaussian Processes for Machine Learning* (2006), equations 5.8 and 5.9.

Matrices are kept by rows, and every inner loop goes along rows: a multiple of one is added to another, which
the compiler turns into wide instructions without changing the order of any sum.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from rsmkit.language.space import Floats
from rsmkit.machine_code import MachineCode
from rsmkit.surfaces.estimation.processes.correlation import Kernel

__all__ = ["Deviance"]

Function = TypeVar("Function", bound=Callable[..., Any])

MACHINE_CODE = MachineCode(Path(__file__).resolve().parent, "rsmkit-surfaces", "NUMBA_CACHE_DIR")


def _compiled(function: Function) -> Function:
    """Compile a function that makes no arrays, at its first call."""
    return MACHINE_CODE.compile(function, nogil=True, _nrt=False)


class Deviance:
    """Minus twice the log likelihood of runs, and its slopes.

    Parameters
    ----------
    kernel : {"matern52", "rbf"}
        The law of each column.
    differences : array, shape (m, n (n - 1) / 2)
        :func:`rsmkit.surfaces.estimation.processes.correlation.squared_differences` of the runs.
    y : array, shape (n,)
        Values of the runs.
    parts : int
        Whether the mean over columns (1) and that over pairs of columns (2) are mixed in.
    """

    def __init__(self, kernel: Kernel, differences: Floats, y: Floats, parts: int) -> None:
        columns, n = len(differences), len(y)
        self._rbf = kernel == "rbf"
        self._differences = np.ascontiguousarray(differences)
        self._y = np.ascontiguousarray(y, dtype=float)
        self._shares = np.zeros(3)
        self._shares[0] = 1.0
        self._parts = parts
        self._by_pair = np.empty((4 + 3 * columns, differences.shape[1]))
        self._matrices = np.empty((2, n, n))
        self._vectors = np.empty((2, n))

    def __call__(self, lengths: Floats, logits: Floats, nugget: float) -> tuple[float, Floats]:
        """Give both for lengths (m,), logits of the parts, and the nugget.

        Returns
        -------
        float
            The deviance; infinite where the covariance cannot be factorised or the values do not vary.
        array, shape (m + parts + 1,)
            Its derivatives by the logarithms of the lengths, by the logits, and by the logarithm of the
            nugget.
        """
        if self._parts:
            grown = np.exp(np.append(0.0, logits) - max(0.0, float(logits.max())))
            self._shares[: 1 + self._parts] = grown / grown.sum()
        slopes = np.empty(len(lengths) + self._parts + 1)
        value = _deviance(
            self._rbf,
            self._differences,
            self._y,
            lengths,
            self._shares,
            self._parts,
            nugget,
            self._by_pair,
            self._matrices,
            self._vectors,
            slopes,
        )
        return value, slopes


@_compiled
def _deviance(
    rbf: bool,
    differences: Floats,
    y: Floats,
    lengths: Floats,
    shares: Floats,
    parts: int,
    nugget: float,
    by_pair: Floats,
    matrices: Floats,
    vectors: Floats,
    slopes: Floats,
) -> float:
    m, n = len(lengths), len(y)
    pull, forms, rest = by_pair[0], by_pair[1:4], by_pair[4:]
    values, laws, others = rest[:m], rest[m : 2 * m], rest[2 * m :]
    factor, inverse = matrices[0], matrices[1]
    constant, weights = vectors[0], vectors[1]
    _correlate(rbf, differences, lengths, values, laws)
    _products_of_others(values, forms[0], others)
    if parts:
        _means(values, parts, forms)
    _covariance(forms[: 1 + parts], shares, nugget, factor)
    log_determinant = _factorise(factor)
    if not math.isfinite(log_determinant):
        return math.inf
    _invert(factor, inverse)
    misfit = _condition(inverse, y, constant, weights)
    if not misfit > 0.0:
        return math.inf
    variance = misfit / n
    trace = _pull(inverse, weights, variance, pull)
    slopes[m + parts] = nugget * trace
    for j in range(m):
        slopes[j] = 0.0
        total = forms[1] if parts else forms[0]  # read only where there are parts
        for p in range(len(pull)):
            by_column = shares[0] * others[j, p]
            if parts:
                by_column += shares[1] / m
            if parts > 1:
                by_column += shares[2] * 2.0 / (m * (m - 1)) * (m * total[p] - values[j, p])
            square = differences[j, p] / (lengths[j] * lengths[j])
            slopes[j] -= 2.0 * by_column * laws[j, p] * square * pull[p]
    if parts:
        _by_logit(forms[: 1 + parts], shares, pull, slopes[m : m + parts])
    return n + log_determinant + n * math.log(2.0 * math.pi * variance)


@_compiled
def _correlate(rbf: bool, differences: Floats, lengths: Floats, values: Floats, laws: Floats) -> None:
    """Correlation of each pair by column, and its derivative by the squared distance in lengths."""
    for j in range(len(lengths)):
        for p in range(differences.shape[1]):
            square = differences[j, p] / (lengths[j] * lengths[j])
            if rbf:
                values[j, p] = math.exp(-0.5 * square)
                laws[j, p] = -0.5 * values[j, p]
            else:
                r = math.sqrt(5.0 * square)
                decay = math.exp(-r)
                values[j, p] = (1.0 + r + r * r / 3.0) * decay
                laws[j, p] = -5.0 / 6.0 * (1.0 + r) * decay


@_compiled
def _products_of_others(values: Floats, products: Floats, others: Floats) -> None:
    """Product over all columns, and over all but each, without dividing by what may be zero."""
    m = len(values)
    products[:] = 1.0
    for j in range(m):
        for p in range(len(products)):
            others[j, p] = products[p]
            products[p] *= values[j, p]
    # products of the columns behind are gathered in the last row, whose own needs none of them
    for j in range(m - 2, -1, -1):
        for p in range(len(products)):
            behind = values[m - 1, p]
            for i in range(j + 1, m - 1):
                behind *= values[i, p]
            others[j, p] *= behind


@_compiled
def _means(values: Floats, parts: int, forms: Floats) -> None:
    """Mean over the columns, and over pairs of columns."""
    m = len(values)
    for p in range(forms.shape[1]):
        total, squares = 0.0, 0.0
        for j in range(m):
            total += values[j, p]
            squares += values[j, p] * values[j, p]
        forms[1, p] = total / m
        if parts > 1:
            forms[2, p] = (total * total - squares) / (m * (m - 1))


@_compiled
def _covariance(forms: Floats, shares: Floats, nugget: float, upper: Floats) -> None:
    """Covariance of the runs in process variances, on and above the diagonal."""
    p = 0
    for i in range(len(upper)):
        upper[i, i] = 1.0 + nugget
        for j in range(i + 1, len(upper)):
            upper[i, j] = 0.0
            for f in range(len(forms)):
                upper[i, j] += shares[f] * forms[f, p]
            p += 1


@_compiled
def _factorise(upper: Floats) -> float:
    """Upper Cholesky factor in place; the logarithm of the determinant, or infinity where there is none."""
    n = len(upper)
    log_determinant = 0.0
    for k in range(n):
        if not upper[k, k] > 0.0:
            return math.inf
        pivot = math.sqrt(upper[k, k])
        log_determinant += 2.0 * math.log(pivot)
        for j in range(k, n):
            upper[k, j] /= pivot
        for i in range(k + 1, n):
            share = upper[k, i]
            for j in range(i, n):
                upper[i, j] -= share * upper[k, j]
    return log_determinant


@_compiled
def _invert(upper: Floats, inverse: Floats) -> None:
    """Inverse of the matrix with the given factor, on and below the diagonal."""
    n = len(upper)
    for k in range(n):  # the inverse of the transposed factor: forwards
        for j in range(k):
            inverse[k, j] = 0.0
        inverse[k, k] = 1.0
        for i in range(k):
            share = upper[i, k]
            for j in range(i + 1):
                inverse[k, j] -= share * inverse[i, j]
        for j in range(k + 1):
            inverse[k, j] /= upper[k, k]
    for k in range(n - 1, -1, -1):  # divided by the factor: backwards, the rows below are done
        for i in range(k + 1, n):
            share = upper[k, i]
            for j in range(k + 1):
                inverse[k, j] -= share * inverse[i, j]
        for j in range(k + 1):
            inverse[k, j] /= upper[k, k]


@_compiled
def _condition(inverse: Floats, y: Floats, constant: Floats, weights: Floats) -> float:
    """Inverse covariance times a constant, and times what `y` differs from its mean; their sum of squares."""
    n = len(y)
    _times(inverse, y, weights)
    constant[:] = 0.0
    for i in range(n):
        for j in range(i):
            constant[i] += inverse[i, j]
            constant[j] += inverse[i, j]
        constant[i] += inverse[i, i]
    above, below = 0.0, 0.0
    for i in range(n):
        above += constant[i] * y[i]
        below += constant[i]
    mean = above / below
    for i in range(n):
        weights[i] -= mean * constant[i]
    misfit = 0.0
    for i in range(n):
        misfit += (y[i] - mean) * weights[i]
    return misfit


@_compiled
def _times(lower: Floats, vector: Floats, result: Floats) -> None:
    """Product with a symmetric matrix of which the part on and below the diagonal is given."""
    result[:] = 0.0
    for i in range(len(vector)):
        for j in range(i):
            result[i] += lower[i, j] * vector[j]
            result[j] += lower[i, j] * vector[i]
        result[i] += lower[i, i] * vector[i]


@_compiled
def _pull(inverse: Floats, weights: Floats, variance: float, pull: Floats) -> float:
    """What each pair's covariance does to the deviance, both its places counted; and the diagonal in all."""
    n = len(weights)
    trace, p = 0.0, 0
    for i in range(n):
        trace += inverse[i, i] - weights[i] * weights[i] / variance
        for j in range(i + 1, n):
            pull[p] = 2.0 * (inverse[j, i] - weights[i] * weights[j] / variance)
            p += 1
    return trace


@_compiled
def _by_logit(forms: Floats, shares: Floats, pull: Floats, slopes: Floats) -> None:
    mean = 0.0
    for f in range(len(forms)):
        total = 0.0
        for p in range(len(pull)):
            total += pull[p] * forms[f, p]
        mean += shares[f] * total
        if f:
            slopes[f - 1] = total
    for f in range(len(slopes)):
        slopes[f] = shares[f + 1] * (slopes[f] - mean)
