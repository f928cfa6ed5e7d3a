"""How strongly the terms of a surface depend on each other at its runs."""

from __future__ import annotations

import numpy as np

from rsmkit.language.space import Floats
from rsmkit.surfaces.models.polynomial import PolynomialSurface

__all__ = ["variance_inflation"]


def variance_inflation(surface: PolynomialSurface) -> Floats:
    """Variance inflation factor of every coefficient in coded units, shape (p,); nan for the constant.

    By how much its variance exceeds that of a term at right angles to all others: ``sum w (x - mean)^2
    [(X'WX)^-1]_jj`` (Montgomery, Peck & Vining, *Linear Regression Analysis*, 5th ed., section 3.10).
    """
    weights = surface.fit.weights
    centred = surface.coded_matrix
    if surface.terms.has_constant:
        centred = centred - np.average(centred, axis=0, weights=weights)
    spread = weights @ centred**2
    vif = spread * np.einsum("ij,ij->i", surface.coded_factor, surface.coded_factor)
    constant = [group == "" for group in surface.groups]
    return np.where(constant, np.nan, vif)
