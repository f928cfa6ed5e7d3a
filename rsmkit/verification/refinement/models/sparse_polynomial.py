"""A polynomial of few terms, chosen from many: exact where the response is one.

Terms are Legendre polynomials of the factors and their products, chosen one at a time by orthogonal least
squares (Chen, Billings and Luo, International Journal of Control 50, 1989); their number by the leave-one-out
error with the correction of Chapelle, Vapnik and Bengio (2002), as in Blatman and Sudret (Journal of
Computational Physics 230, 2011).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations, product

import numpy as np
from numpy.polynomial.legendre import legder, legval
from numpy.typing import NDArray

from rsmkit.language.space import Floats

__all__ = ["SparsePolynomial", "fit_sparse_polynomial"]

MOST_TERMS = 60
PATIENCE = 12
"""Terms that are tried beyond the best number."""
EXACT = 1e-18
"""Corrected leave-one-out error, as a part of the variance, below which a response is such a polynomial."""
ENOUGH = 1e-22
THIN = 0.08
"""Runs nearer to each other mislead the choice of terms."""
FEW = 30

Term = tuple[int, ...]


@dataclass(frozen=True, eq=False)
class SparsePolynomial:
    """A fitted polynomial.

    Parameters
    ----------
    terms : tuple of tuple of int
        Degree of every factor; of a category the level whose indicator it is.
    coefficients : array, shape (number of terms,)
        In the same order.
    categorical : array of bool, shape (k,)
        Columns of categories.
    residuals : array, shape (n,)
        Leave-one-out errors.
    error : float
        Corrected mean square of them as a part of the variance.
    optimism : float
        By which the root mean square of `residuals` is too small, the terms having been chosen by them.
    """

    terms: tuple[Term, ...]
    coefficients: Floats
    categorical: NDArray[np.bool_]
    residuals: Floats
    error: float
    optimism: float
    name: str = "sparse polynomial"

    @property
    def exact(self) -> bool:
        """Whether the response seems to be this polynomial."""
        return self.error < EXACT

    def mean(self, unit: Floats) -> Floats:
        """Predict, shape (q,)."""
        return np.asarray(_columns(self.terms, unit, self.categorical) @ self.coefficients)

    def gradient(self, unit: Floats) -> Floats:
        """Derivatives by the coordinates, shape (q, k); zero for categories."""
        powers, slopes = _powers(self.terms, unit), _powers(self.terms, unit, derivative=True)
        found = np.zeros_like(unit)
        for term, coefficient in zip(self.terms, self.coefficients, strict=True):
            used = [j for j, degree in enumerate(term) if degree]
            for j in used:
                if self.categorical[j]:
                    continue
                value = np.full(len(unit), float(coefficient))
                for i in used:
                    if self.categorical[i]:
                        value = value * (unit[:, i] == term[i])
                    else:
                        value = value * (slopes if i == j else powers)[term[i]][:, i]
                found[:, j] += value
        return found


def fit_sparse_polynomial(
    unit: Floats, y: Floats, categorical: NDArray[np.bool_], levels: tuple[int, ...]
) -> SparsePolynomial | None:
    """Choose terms and fit them.

    Parameters
    ----------
    unit, y : arrays, shapes (n, k) and (n,)
        Runs.
    categorical : array of bool, shape (k,)
        Columns of categories.
    levels : tuple of int
        Number of categories of each factor, 0 for numbers.

    Returns
    -------
    SparsePolynomial or None
        None for fewer than six runs or values that do not vary.
    """
    if len(y) < 6 or not np.ptp(y) > 0:
        return None
    pool = _pool(categorical, levels, _distinct_values(unit))
    matrix = _columns(pool, unit, categorical)
    best = _pursue(pool, matrix, y, categorical)
    if len(y) > FEW and not best.exact:
        thin = _thinned(unit)
        if len(thin) >= 12 and len(thin) < len(y):
            other = _pursue(pool, matrix[thin], y[thin], categorical)
            if other.exact and len(other.terms) < len(y) - 2:
                chosen = [pool.index(term) for term in other.terms]
                best = _refit(other.terms, matrix[:, chosen], y, categorical)
    return best


def _pool(categorical: NDArray[np.bool_], levels: tuple[int, ...], distinct: list[int]) -> list[Term]:
    """Terms to choose from: fewer of high degree for many factors."""
    k = len(categorical)
    numeric = [j for j in range(k) if not categorical[j]]
    total = 6 if k <= 2 else 5 if k == 3 else 4 if k <= 8 else 3
    main = max(total, 4) if k <= 12 else 3
    blank = [0] * k
    found: list[Term] = [tuple(blank)]

    def add(degrees: dict[int, int]) -> None:
        # a number with few levels has no higher powers of its own
        if all(categorical[j] or degree < distinct[j] for j, degree in degrees.items()):
            found.append(tuple(degrees.get(j, 0) for j in range(k)))

    for j in numeric:
        for degree in range(1, main + 1):
            add({j: degree})
    for i, j in combinations(numeric, 2):
        for a, b in product(range(1, total), repeat=2):
            if a + b <= total:
                add({i: a, j: b})
    for triple in combinations(numeric, 3):
        if k <= 8:
            add(dict.fromkeys(triple, 1))
        if k <= 6:
            for twice in triple:
                add({**dict.fromkeys(triple, 1), twice: 2})
    for c in np.flatnonzero(categorical):
        for level in range(1, levels[c]):
            add({int(c): level})
            for j in numeric:
                for degree in (1, 2):
                    add({int(c): level, j: degree})
    return found


def _distinct_values(unit: Floats) -> list[int]:
    return [len(np.unique(column)) for column in unit.T]


def _powers(terms: tuple[Term, ...] | list[Term], unit: Floats, *, derivative: bool = False) -> list[Floats]:
    """Legendre polynomials (or their derivatives by `unit`) of every column, by degree."""
    x = 2.0 * unit - 1.0
    highest = max(max(term) for term in terms)
    found = []
    for degree in range(highest + 1):
        series = np.eye(highest + 1)[degree][: degree + 1]
        value = 2.0 * legval(x, legder(series)) if derivative else legval(x, series)
        found.append(np.asarray(value, float))
    return found


def _columns(terms: tuple[Term, ...] | list[Term], unit: Floats, categorical: NDArray[np.bool_]) -> Floats:
    powers = _powers(terms, unit)
    matrix = np.ones((len(unit), len(terms)))
    for c, term in enumerate(terms):
        for j, degree in enumerate(term):
            if degree:
                matrix[:, c] *= unit[:, j] == degree if categorical[j] else powers[degree][:, j]
    return matrix


def _pursue(pool: list[Term], matrix: Floats, y: Floats, categorical: NDArray[np.bool_]) -> SparsePolynomial:
    n = len(y)
    columns = matrix.copy()
    variance = float(y.var())
    first = np.sqrt((columns**2).sum(axis=0))
    left = y.astype(float).copy()
    leverage = np.zeros(n)
    chosen: list[int] = []
    best, error, residuals = 0, np.inf, left
    for count in range(1, min(2 * n // 3, MOST_TERMS, len(pool)) + 1):
        sizes = np.sqrt((columns**2).sum(axis=0))
        usable = sizes > 1e-7 * first
        usable[chosen] = False
        if not usable.any():
            break
        gain = np.where(usable, np.abs(left @ columns) / np.where(usable, sizes, 1.0), -1.0)
        pick = 0 if count == 1 else int(gain.argmax())
        direction = columns[:, pick] / sizes[pick]
        left = left - direction * (direction @ left)
        columns -= np.outer(direction, direction @ columns)
        leverage += direction**2
        chosen.append(pick)
        alone = left / np.maximum(1.0 - leverage, 1e-9)
        now = float(np.mean(alone**2)) / variance * _correction(n, count)
        if now < error:
            best, error, residuals = count, now, alone
        if error < ENOUGH or count >= best + PATIENCE:
            break
    terms = tuple(pool[index] for index in chosen[:best])
    coefficients, *_ = np.linalg.lstsq(matrix[:, chosen[:best]], y, rcond=None)
    optimism = _correction(n, best) ** 0.5
    return SparsePolynomial(
        terms, np.asarray(coefficients, np.float64), categorical, residuals, error, optimism
    )


def _refit(
    terms: tuple[Term, ...], matrix: Floats, y: Floats, categorical: NDArray[np.bool_]
) -> SparsePolynomial:
    q, r = np.linalg.qr(matrix)
    coefficients: Floats = np.asarray(np.linalg.solve(r, q.T @ y), np.float64)
    leverage = (q**2).sum(axis=1)
    alone = (y - matrix @ coefficients) / np.maximum(1.0 - leverage, 1e-9)
    n, p = matrix.shape
    error = float(np.mean(alone**2)) / float(y.var()) * _correction(n, p)
    return SparsePolynomial(terms, coefficients, categorical, alone, error, _correction(n, p) ** 0.5)


def _correction(runs: int, terms: int) -> float:
    """Of a mean square leave-one-out error, for the choice of the terms."""
    return runs / (runs - terms) * (1.0 + terms / runs)


def _thinned(unit: Floats) -> list[int]:
    kept: list[int] = []
    for i, point in enumerate(unit):
        if not kept or np.abs(unit[kept] - point).max(axis=1).min() > THIN:
            kept.append(i)
    return kept
