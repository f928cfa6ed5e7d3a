"""Further intervals of a polynomial surface: tolerance intervals and simultaneous bands."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtri, fdtri, ndtr, ndtri, stdtrit

from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.language.space import Floats
from rsmkit.surfaces.models.polynomial import PolynomialSurface

__all__ = ["simultaneous_band", "tolerance_interval"]


@checked
def tolerance_interval(
    surface: PolynomialSurface, points: ArrayLike, share: float = 0.95, confidence: float = 0.95
) -> tuple[Floats, Floats, Floats]:
    """Interval that holds a stated share of all future runs at each point, with stated confidence.

    Factor of Wallis (1951) with Howe's effective number of runs, ``1/leverage``:
    ``k = r sqrt(df / chi2(1 - confidence, df))`` where ``Phi(d + r) - Phi(d - r) = share``, ``d = sqrt(h)``.

    Parameters
    ----------
    surface : PolynomialSurface
    points : array, shape (n, k)
        Natural units.
    share, confidence : float
        Between 0 and 1.

    Returns
    -------
    mean, low, high : array, shape (n,)
    """
    _check(surface, share, confidence)
    mean = surface.predict(points)
    shift = np.sqrt(surface.leverage(points))
    low, high = np.full_like(shift, ndtri(0.5 + 0.5 * share)), shift + ndtri(0.5 + 0.5 * share) + 1.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        small = ndtr(shift + middle) - ndtr(shift - middle) < share
        low, high = np.where(small, middle, low), np.where(small, high, middle)
    df = surface.fit.df
    half = high * np.sqrt(df / chdtri(df, confidence)) * surface.fit.sigma
    return mean, mean - half, mean + half


@checked
def simultaneous_band(
    surface: PolynomialSurface,
    points: ArrayLike,
    confidence: float = 0.95,
    method: Literal["scheffe", "bonferroni"] = "scheffe",
) -> tuple[Floats, Floats, Floats]:
    """Band that holds the expected response at all points at once.

    Parameters
    ----------
    method : {"scheffe", "bonferroni"}
        Scheffe's band (1953) is valid for every point there is; Bonferroni's for the given ones only, and
        narrower when they are few.

    Returns
    -------
    mean, low, high : array, shape (n,)
    """
    _check(surface, 0.5, confidence)
    mean, df, p = surface.predict(points), surface.fit.df, surface.fit.p
    if method == "scheffe":
        width = float(np.sqrt(p * fdtri(p, df, confidence)))
    else:
        width = float(stdtrit(df, 1.0 - 0.5 * (1.0 - confidence) / max(len(mean), 1)))
    half = width * surface.fit.sigma * np.sqrt(surface.leverage(points))
    return mean, mean - half, mean + half


def _check(surface: PolynomialSurface, share: float, confidence: float) -> None:
    if not (0.0 < share < 1.0 and 0.0 < confidence < 1.0):
        raise RsmkitError(f"share and confidence lie between 0 and 1, got {share} and {confidence}")
    if surface.fit.df == 0:
        raise RsmkitError(f"{surface.response}: no degrees of freedom left, so no interval can be given")
