"""Single figures of a fit that other programs print beside R2."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from rsmkit.surfaces.models.polynomial import PolynomialSurface
from rsmkit.surfaces.reading import number

__all__ = ["about_zero", "adequate_precision", "durbin_watson", "total_about_mean"]


def total_about_mean(surface: PolynomialSurface) -> float:
    """Weighted sum of squares about the mean."""
    fit = surface.fit
    return float(fit.weights @ (fit.y - np.average(fit.y, weights=fit.weights)) ** 2)


def about_zero(surface: PolynomialSurface) -> dict[str, Any]:
    """Sums of squares that the mean is not taken out of: of the mean alone, of the model, in all.

    The analysis of variance of Box & Draper, *Response Surfaces, Mixtures, and Ridge Analyses*, 2nd ed.
    (2007), section 3.5; ``df`` and ``ss`` of each, and the mean square of the model.
    """
    fit = surface.fit
    mean, rank = float(np.average(fit.y, weights=fit.weights)), fit.n - fit.df
    model = float(fit.weights @ fit.fitted**2)
    return {
        "mean": {"df": 1, "ss": float(fit.weights.sum()) * mean**2},
        "model": {"df": rank, "ss": model, "ms": number(model / rank if rank else math.nan)},
        "total": {"df": fit.n, "ss": float(fit.weights @ fit.y**2)},
    }


def adequate_precision(surface: PolynomialSurface) -> float:
    """Range of the fitted values over their average standard error; above 4 the surface tells points apart.

    Box & Draper (2007), section 8.2; nan without a measure of noise.
    """
    fit = surface.fit
    rank = fit.n - fit.df
    if not fit.df or fit.exact or not rank:
        return math.nan
    return float(np.ptp(fit.fitted)) / (fit.sigma * math.sqrt(rank / fit.n))


def durbin_watson(surface: PolynomialSurface) -> float:
    """Squared differences of neighbouring residuals over their squares, in the order the runs were made in.

    Durbin & Watson (1950), Biometrika 37, 409-428: near 2 where errors are independent in that order. Where
    it is not known, that of the data.
    """
    fit = surface.fit
    residuals = (np.sqrt(fit.weights) * fit.residuals)[surface.data.in_time]
    if fit.exact or not fit.df:
        return math.nan
    return float((np.diff(residuals) ** 2).sum() / (residuals**2).sum())
