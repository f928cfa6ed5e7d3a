"""Polynomials around one point, by weighted least squares."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from rsmkit.language.space import Floats

__all__ = ["LocalPolynomial", "fit_local_polynomial", "monomials"]


@dataclass(frozen=True, eq=False)
class LocalPolynomial:
    """A polynomial of the numeric factors, written about a point.

    Parameters
    ----------
    name : str
        In words.
    exponents : array of int, shape (p, k)
        Of every monomial.
    center : array, shape (k,)
        About which it is written.
    coefficients : array, shape (p,)
        In the same order.
    residuals : array, shape (n,)
        Leave-one-out errors.
    """

    name: str
    exponents: NDArray[np.int_]
    center: Floats
    coefficients: Floats
    residuals: Floats

    def mean(self, unit: Floats) -> Floats:
        """Predict, shape (q,)."""
        return np.asarray(_matrix(self.exponents, unit - self.center) @ self.coefficients)

    def gradient(self, unit: Floats) -> Floats:
        """Derivatives by the coordinates, shape (q, k)."""
        x = unit - self.center
        found = np.zeros_like(unit)
        for j in np.flatnonzero(self.exponents.any(axis=0)):
            lower = self.exponents.copy()
            factor = lower[:, j].astype(float)
            lower[:, j] = np.maximum(lower[:, j] - 1, 0)
            found[:, j] = _matrix(lower, x) @ (self.coefficients * factor)
        return found


def monomials(numeric: NDArray[np.bool_], order: int) -> NDArray[np.int_]:
    """Exponents of a full quadratic, for order 3 also of x_i^2 x_j and x_i^3; for order 1 of a plane.

    A plane with squares but without products is order 0.
    """
    k = len(numeric)
    eye = np.eye(k, dtype=int)
    rows = [np.zeros(k, dtype=int)]
    used = np.flatnonzero(numeric)
    rows += [eye[j] for j in used]
    if order != 1:
        rows += [2 * eye[j] for j in used]
    if order >= 2:
        rows += [eye[i] + eye[j] for i, j in combinations(used, 2)]
    if order >= 3:
        rows += [2 * eye[i] + eye[j] for i in used for j in used]
    return np.array(rows)


def fit_local_polynomial(
    name: str, exponents: NDArray[np.int_], unit: Floats, y: Floats, center: Floats, weights: Floats
) -> LocalPolynomial | None:
    """Fit by weighted least squares, with exact leave-one-out errors.

    Returns
    -------
    LocalPolynomial or None
        None when the runs do not determine every coefficient with one run to spare.
    """
    if len(y) <= len(exponents):
        return None
    matrix = _matrix(exponents, unit - center)
    root = np.sqrt(weights)
    q, r = np.linalg.qr(root[:, None] * matrix)
    diagonal = np.abs(np.diag(r))
    if not diagonal.min() > 1e-10 * diagonal.max():
        return None
    coefficients = solve_triangular(r, q.T @ (root * y))
    leverage = (q**2).sum(axis=1)
    residuals = (y - matrix @ coefficients) / np.maximum(1.0 - leverage, 1e-9)
    return LocalPolynomial(name, exponents, center, coefficients, residuals)


def _matrix(exponents: NDArray[np.int_], x: Floats) -> Floats:
    matrix = np.ones((len(x), len(exponents)))
    for j in np.flatnonzero(exponents.any(axis=0)):
        power = np.ones(len(x))
        for degree in range(1, int(exponents[:, j].max()) + 1):
            power = power * x[:, j]
            here = exponents[:, j] == degree
            matrix[:, here] *= power[:, None]
    return matrix
