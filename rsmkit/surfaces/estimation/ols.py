"""statsmodels, the estimation engine.

Imported only when a surface is estimated, because importing statsmodels takes about a second.
"""

from __future__ import annotations

import numpy as np
from statsmodels.regression.linear_model import OLS, WLS

from rsmkit.language.space import Floats

__all__ = ["estimate"]


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
