"""statsmodels: the estimation engine, and the result object for whoever wants more of it.

Imported only when a surface is estimated, because importing statsmodels takes about a second.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from statsmodels.regression.linear_model import OLS, WLS

from rsmkit.language.space import Floats

if TYPE_CHECKING:
    from rsmkit.surfaces.models.polynomial import PolynomialSurface

__all__ = ["estimate", "results"]


def estimate(matrix: Floats, y: Floats, weights: Floats | None = None) -> Floats:
    """Least-squares coefficients by statsmodels.

    On columns of length one in working coordinates, where its pseudo-inverse loses nothing.

    Returns
    -------
    array, shape (p,)
    """
    lengths = np.linalg.norm(matrix, axis=0)
    model = OLS(y, matrix / lengths) if weights is None else WLS(y, matrix / lengths, weights=weights)
    return np.asarray(model.fit().params / lengths, float)


def results(surface: PolynomialSurface) -> Any:
    """Give the statsmodels ``RegressionResults`` of a surface in coded units, with named columns.

    Of its numbers, sequential ANOVA ignores weights (statsmodels 0.15) and the influence measures are slow;
    the surface's own are exact and fast.
    """
    matrix = pd.DataFrame(surface.coded_matrix, columns=list(surface.names))
    y = pd.Series(surface.data.y, name=surface.response)
    weights = surface.data.weights
    model = OLS(y, matrix) if weights is None else WLS(y, matrix, weights=weights)
    return model.fit(method="qr")
