"""Models that a refinement lets compete around the best point known; here the polynomials.

Coordinates are factors scaled to 0..1 between their bounds, so runs outside the bounds (star points) have
coordinates outside 0..1. Each model says how large its leave-one-out residuals are; that decides between
them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from rsmkit.errors import FitError
from rsmkit.language.space import Floats
from rsmkit.language.terms import full_terms
from rsmkit.surfaces.estimation.least_squares import least_squares

__all__ = ["LocalModel", "LocalPolynomial", "fit_polynomial"]


class LocalModel(Protocol):
    """One competitor."""

    @property
    def name(self) -> str:
        """What it is, for the explanation of a wave."""
        ...

    @property
    def residuals(self) -> Floats:
        """Leave-one-out residual at each point it was fitted to, shape (n,)."""
        ...

    def predict(self, unit: Floats) -> Floats:
        """Predict at scaled points, shape (m, k); shape (m,)."""
        ...


@dataclass(frozen=True)
class LocalPolynomial:
    """Full polynomial of order 2 or 3 about a centre."""

    order: int
    center: Floats
    coefficients: Floats
    residuals: Floats

    @property
    def name(self) -> str:
        """What it is, in words."""
        return "quadratic" if self.order == 2 else "cubic"

    def predict(self, unit: Floats) -> Floats:
        """Predict at scaled points, shape (m, k); shape (m,)."""
        terms = full_terms(len(self.center), self.order)
        values: Floats = terms.matrix(unit - self.center) @ self.coefficients
        return values


def fit_polynomial(
    points: Floats, y: Floats, center: Floats, weights: Floats, *, order: int = 2
) -> LocalPolynomial | None:
    """Weighted least squares with exact leave-one-out residuals.

    Parameters
    ----------
    points, y : ndarray, shapes (n, k) and (n,)
        Scaled points and values.
    center : ndarray, shape (k,)
        About which the polynomial is written.
    weights : ndarray, shape (n,)
        Positive.
    order : int
        2 or 3.

    Returns
    -------
    LocalPolynomial or None
        None when the points do not determine every coefficient with at least one to spare.
    """
    terms = full_terms(points.shape[1], order)
    if len(y) <= terms.p:
        return None
    names = tuple(map(str, terms.columns))
    try:
        fit = least_squares(terms.matrix(points - center), y, weights, names=names)
    except FitError:
        return None
    return LocalPolynomial(order, center, fit.coefficients, fit.loo_residuals)
