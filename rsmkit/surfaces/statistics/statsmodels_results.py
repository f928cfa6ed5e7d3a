"""The result object of statsmodels, for whoever wants more of it than a report holds.

Imported only when asked for, because importing statsmodels takes about a second.
"""

from __future__ import annotations

from typing import Any

import pandas as pd
from statsmodels.regression.linear_model import OLS, WLS

from rsmkit.surfaces.models.polynomial import PolynomialSurface

__all__ = ["statsmodels_results"]


def statsmodels_results(surface: PolynomialSurface) -> Any:
    """Give the statsmodels ``RegressionResults`` of a surface in coded units, with named columns.

    Of its numbers, sequential ANOVA ignores weights (statsmodels 0.15) and the influence measures are slow;
    the surface's own are exact and fast.
    """
    matrix = pd.DataFrame(surface.coded_matrix, columns=list(surface.names))
    y = pd.Series(surface.data.y, name=surface.response)
    weights = surface.data.weights
    model = OLS(y, matrix) if weights is None else WLS(y, matrix, weights=weights)
    return model.fit(method="qr")
