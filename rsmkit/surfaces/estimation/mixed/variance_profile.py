"""Intervals of variances from their profiled restricted likelihood."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from scipy.special import chdtri

from rsmkit.language.space import Floats
from rsmkit.surfaces.estimation.mixed.error_contrasts import ErrorContrasts

__all__ = ["variance_intervals"]

STEP = 1.5
"""Factor by which a standard deviation moves while a limit is looked for."""
FARTHEST = 1e6
"""Of the largest standard deviation: an upper limit beyond it is none."""


def variance_intervals(contrasts: ErrorContrasts, variances: Floats, confidence: float = 0.95) -> Floats:
    """Values of each variance whose deviance, all others chosen anew, is not too far above the least.

    Parameters
    ----------
    contrasts : ErrorContrasts
    variances : array, shape (r + 1,)
        Estimates: of the groups, then of a run.
    confidence : float

    Returns
    -------
    array, shape (r + 1, 2)
        Zero where the lower limit is the boundary, infinite where there is no upper one.
    """
    allowed = contrasts.deviance(variances)[0] + float(chdtri(1, 1.0 - confidence))
    sizes = np.sqrt(np.maximum(variances, 1e-4 * variances[-1]))
    limits = np.empty((len(variances), 2))
    for which, size in enumerate(sizes):
        profile = _profile(contrasts, variances, which)

        def above(deviation: float, profile: Callable[[float], float] = profile) -> float:
            return profile(deviation**2) - allowed

        best = math.sqrt(variances[which])
        limits[which] = (
            _crossing(above, best, 1.0 / STEP, size * 1e-4 if which == len(sizes) - 1 else 0.0),
            _crossing(above, best or size, STEP, FARTHEST * sizes.max()),
        )
    return np.asarray(limits**2)


def _profile(contrasts: ErrorContrasts, variances: Floats, which: int) -> Callable[[float], float]:
    """Deviance with one variance held, least over all others."""
    from scipy.optimize import minimize

    others = np.array([i for i in range(len(variances)) if i != which])
    own = variances[-1]
    place = variances[others] / own

    def profile(value: float) -> float:
        nonlocal place
        full = np.empty(len(variances))
        full[which] = value

        def criterion(z: Floats) -> tuple[float, Floats]:
            full[others] = np.expm1(z) * own
            deviance, slopes = contrasts.deviance(full)
            return deviance, slopes[others] * np.exp(z) * own

        lowest = [(1e-9 if i == len(variances) - 1 else 0.0, 40.0) for i in others]
        found = minimize(
            criterion, np.log1p(place), jac=True, method="L-BFGS-B", bounds=lowest, options={"gtol": 1e-6}
        )
        place = np.expm1(found.x)
        return float(found.fun)

    return profile


def _crossing(above: Callable[[float], float], start: float, factor: float, end: float) -> float:
    """Where the profile leaves what is allowed, going from `start` by `factor`; the end if it never does."""
    from scipy.optimize import brentq

    if factor < 1 and (start <= end or (end == 0 and above(0.0) <= 0)):
        return end
    inside, outside = start, start * factor
    while above(outside) <= 0:
        if (outside < 1e-12 * start) if factor < 1 else (outside > end):
            return 0.0 if factor < 1 else math.inf
        inside, outside = outside, outside * factor
    low, high = min(inside, outside), max(inside, outside)
    return float(brentq(above, low, high, rtol=1e-10))
