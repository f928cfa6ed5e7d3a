"""Coefficients on other scales than that of the factors: effects and standardised coefficients."""

from __future__ import annotations

import numpy as np

from rsmkit.language.space import Floats
from rsmkit.surfaces.models.polynomial import PolynomialSurface

__all__ = ["effects", "standardised_coefficients"]


def effects(surface: PolynomialSurface) -> Floats:
    """By how much the response changes from the lowest to the highest value of each column, shape (p,).

    Between coded -1 and +1: twice the coefficient of a numeric factor or of a product of such factors, and
    of a category of two levels with sum contrasts (Box, Hunter & Hunter, *Statistics for Experimenters*, 2nd
    ed., section 5.7); the coefficient itself of a square, and of an indicator of treatment contrasts. nan for
    the constant, for blocks, for sum contrasts of three or more levels, whose coefficients are differences
    from an average, for the parameters of a stretch, and for mixtures, whose components never move alone.
    """
    terms = surface.terms
    found = np.full(len(surface.names), np.nan)
    if terms.components:
        return found
    columns = [i for i, group in enumerate(surface.groups) if group not in ("block", "stretch")]
    for i, powers in zip(columns, terms.columns, strict=True):
        low, high = 1.0, 1.0
        for factor, power in zip(terms.variable_factors, powers, strict=True):
            if power:
                ends = _column_ends(terms.levels[factor], power, terms.contrasts)
                products = [low * end for end in ends] + [high * end for end in ends]
                low, high = min(products), max(products)
        if any(powers):
            found[i] = (high - low) * surface.coefficients[i]
    return found


def standardised_coefficients(surface: PolynomialSurface) -> Floats:
    """Coefficients for columns and response in units of their standard deviations, shape (p,).

    ``b s_x / s_y`` (Montgomery, Peck & Vining, *Linear Regression Analysis*, 5th ed., section 3.9), with
    weights in both standard deviations; nan for the constant, and for mixtures.
    """
    fit = surface.fit
    deviations = surface.coded_matrix - np.average(surface.coded_matrix, axis=0, weights=fit.weights)
    total = fit.weights @ (fit.y - np.average(fit.y, weights=fit.weights)) ** 2
    if not total > 0 or surface.terms.components:
        return np.full(len(surface.names), np.nan)
    values = surface.coefficients * np.sqrt(fit.weights @ deviations**2 / total)
    return np.where([group == "" for group in surface.groups], np.nan, values)


def _column_ends(levels: int, power: int, contrasts: str) -> tuple[float, float]:
    """Smallest and largest value of a power of a variable between coded -1 and +1."""
    if not levels:
        return (-1.0, 1.0) if power % 2 else (0.0, 1.0)
    if contrasts == "treatment":
        return 0.0, 1.0
    return (-1.0, 1.0) if levels == 2 else (np.nan, np.nan)
