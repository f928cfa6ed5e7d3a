"""Box-Cox transformation of the response, with its profile likelihood interval.

Box & Cox, J. Royal Statistical Society B 26 (1964): the power of y that makes the residuals of a given model
most nearly normal with constant variance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq, minimize_scalar
from scipy.special import chdtri

from rsmkit.errors import FitError
from rsmkit.space import Floats
from rsmkit.surfaces.polynomial import PolynomialSurface

__all__ = ["BoxCox", "box_cox", "power_transform"]

REACH = 5.0
"""Powers between -5 and 5 are tried."""


@dataclass(frozen=True)
class BoxCox:
    """The power and what the data say about it.

    Parameters
    ----------
    power : float
        Maximum-likelihood value; 1 leaves the response as it is, 0 is the logarithm.
    low, high : float
        Profile likelihood interval; nan where it reaches beyond -5 or 5.
    confidence : float
    """

    power: float
    low: float
    high: float
    confidence: float

    @property
    def needed(self) -> bool:
        """Whether the interval excludes 1 (no transformation)."""
        return self.low > 1.0 or self.high < 1.0


def power_transform(y: Floats, power: float) -> Floats:
    """``(y^power - 1) / power``, the logarithm at 0; y must be positive."""
    logs = np.log(y)
    return logs if power == 0 else np.expm1(power * logs) / power


def box_cox(surface: PolynomialSurface, confidence: float = 0.95) -> BoxCox:
    """Estimate the power for the terms of a fitted surface.

    Raises
    ------
    FitError
        When a response is not positive, or there are no degrees of freedom.
    """
    y, root = surface.data.y, np.sqrt(surface.fit.weights)
    if (y <= 0).any():
        raise FitError(
            f"response {surface.response}: Box-Cox needs positive responses, the least is {y.min():g}"
        )
    if surface.fit.df == 0:
        raise FitError(f"response {surface.response}: Box-Cox needs more runs than terms")
    basis, _ = np.linalg.qr(surface.matrix * root[:, None])
    geometric = np.exp(np.log(y).mean())

    def half_deviance(power: float) -> float:
        z = root * power_transform(y / geometric, power)
        rest = z - basis @ (basis.T @ z)
        return 0.5 * len(y) * float(np.log(rest @ rest))

    grid = np.linspace(-REACH, REACH, 101)
    start = grid[np.argmin([half_deviance(p) for p in grid])]
    bracket = (max(-REACH, start - 0.2), min(REACH, start + 0.2))
    best = minimize_scalar(half_deviance, bounds=bracket, method="bounded", options={"xatol": 1e-10})
    level = float(best.fun) + 0.5 * float(chdtri(1, 1 - confidence))

    def excess(power: float) -> float:
        return half_deviance(power) - level

    low = brentq(excess, -REACH, best.x, xtol=1e-12) if excess(-REACH) > 0 else np.nan
    high = brentq(excess, best.x, REACH, xtol=1e-12) if excess(REACH) > 0 else np.nan
    return BoxCox(float(best.x), float(low), float(high), confidence)
