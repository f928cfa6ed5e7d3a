"""Models that a refinement lets compete around the best point known.

Coordinates are factors scaled to 0..1 between their bounds, so runs outside the bounds (star points) have
coordinates outside 0..1. Each model says how large its leave-one-out residuals are; that decides between
them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rsmkit.errors import FitError
from rsmkit.language.space import Floats
from rsmkit.language.terms import full_terms
from rsmkit.surfaces.estimation.kriging import Kernel
from rsmkit.surfaces.estimation.least_squares import least_squares
from rsmkit.surfaces.estimation.likelihood import fit_kriging

__all__ = ["LocalModel", "fit_polynomial", "fit_process"]

NAMES: dict[Kernel, str] = {"rbf": "Gaussian process", "matern52": "Matern process"}


@dataclass(frozen=True)
class LocalModel:
    """One competitor.

    Parameters
    ----------
    name : str
        What it is, for the explanation of a wave.
    residuals : array, shape (n,)
        Leave-one-out residual at each point it was fitted to.
    predict : callable
        Predicts at scaled points, shape (m, k); shape (m,).
    """

    name: str
    residuals: Floats
    predict: Callable[[Floats], Floats]


def fit_polynomial(
    points: Floats, y: Floats, center: Floats, weights: Floats, *, order: int = 2
) -> LocalModel | None:
    """Full polynomial by weighted least squares, with exact leave-one-out residuals.

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
    LocalModel or None
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
    name = "quadratic" if order == 2 else "cubic"
    return LocalModel(name, fit.loo_residuals, lambda unit: terms.matrix(unit - center) @ fit.coefficients)


def fit_process(points: Floats, y: Floats, kernel: Kernel, *, noisy: bool = False) -> LocalModel | None:
    """Gaussian process by maximum likelihood.

    Parameters
    ----------
    points, y : ndarray, shapes (n, k) and (n,)
        Distinct points and their values.
    kernel : {"matern52", "rbf"}
        Correlation.
    noisy : bool
        Whether a run made again would differ.

    Returns
    -------
    LocalModel or None
        None for fewer than four points or values without spread.
    """
    if len(points) < 4 or not np.ptp(y) > 0:
        return None
    fit = fit_kriging(kernel, points, y, nuggets=(1e-12, 1.0 if noisy else 1e-6))
    return LocalModel(NAMES[kernel], fit.loo_residuals, fit.predict)
