"""Further intervals of a polynomial surface: tolerance intervals and simultaneous bands."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import chdtrc, chdtri, fdtri, ndtr, ndtri, stdtrit

from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.language.space import Floats
from rsmkit.surfaces.models.polynomial import PolynomialSurface

__all__ = ["simultaneous_band", "tolerance_factor", "tolerance_interval"]

FARTHEST = 9.0
"""Standard errors that the mean may be off; the chance of more is 1e-19."""
NODES = 64
"""Of the quadrature, at least: more where s is known so well that the integrand falls steeply."""
PRECISION = 1e-9
"""Relative, of a tolerance factor."""


@checked
def tolerance_interval(
    surface: PolynomialSurface, points: ArrayLike, share: float = 0.95, confidence: float = 0.95
) -> tuple[Floats, Floats, Floats]:
    """Interval that holds a stated share of all future runs at each point, with stated confidence.

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

    Notes
    -----
    Exact for one point at a time: half the width is :func:`tolerance_factor` times sigma.
    """
    _check(surface, share, confidence)
    mean = surface.predict(points)
    judge = surface.judge
    half = tolerance_factor(judge.leverage(points), judge.fit.df, share, confidence) * judge.fit.sigma
    return mean, mean - half, mean + half


@checked
def tolerance_factor(leverage: ArrayLike, df: float, share: float = 0.95, confidence: float = 0.95) -> Floats:
    """Exact factor of a two-sided normal tolerance interval ``mean +- k s``.

    Parameters
    ----------
    leverage : array, shape (n,)
        Variance of the mean over that of a run; 1 / n for a sample of n.
    df : float
        Degrees of freedom of s, positive.
    share, confidence : float
        Between 0 and 1.

    Returns
    -------
    array, shape (n,)

    Notes
    -----
    With the mean off by ``d = z sqrt(leverage)`` the interval must reach r, where ``Phi(d + r) - Phi(d - r) =
    share``, and it does when ``k s >= r``. So k solves ``2 int_0^inf phi(z) P(chi2_df > df r^2 / k^2) dz =
    confidence`` (Odeh & Owen 1980, *Tables for Normal Tolerance Limits*; for regression Krishnamoorthy &
    Mathew 2009, *Statistical Tolerance Regions*, section 3.2).
    """
    spread = np.sqrt(np.atleast_1d(np.asarray(leverage, float)))
    if len(spread) <= NODES:
        return _factors(spread, df, share, confidence)
    low, high = float(spread.min()), float(spread.max())
    middle, half = 0.5 * (low + high), max(0.5 * (high - low), 1e-12 * high, 1e-300)

    def at(unit: Floats) -> Floats:
        return np.log(_factors(middle + half * unit, df, share, confidence))

    # smooth in the root of the leverage: with so many points a polynomial through a few is as good
    series = np.polynomial.chebyshev.chebinterpolate(at, NODES // 2)  # type: ignore[type-var]
    return np.asarray(np.exp(np.polynomial.chebyshev.chebval((spread - middle) / half, series)))


def _factors(spread: Floats, df: float, share: float, confidence: float) -> Floats:
    """Factors for roots of leverages, shape (n,)."""
    nodes, weights = np.polynomial.legendre.leggauss(int(NODES + min(2.0 * np.sqrt(df), 3.0 * NODES)))
    z = 0.5 * FARTHEST * (nodes + 1.0)
    mass = FARTHEST * weights * np.exp(-0.5 * z * z) / np.sqrt(2.0 * np.pi)
    squares = df * _reach(spread[:, None] * z, share) ** 2
    howe = _reach(spread, share) * np.sqrt(df / chdtri(df, confidence))
    return _solved(squares, mass, df, confidence, howe)


def _reach(away: Floats, share: float) -> Floats:
    """Half-width about a mean that is so far off, within which the share lies."""
    away = np.asarray(away, float)
    low = np.maximum(float(ndtri(0.5 + 0.5 * share)), away + float(ndtri(share)))
    high = away + float(ndtri(0.5 + 0.5 * share))
    for _ in range(50):
        middle = 0.5 * (low + high)
        small = ndtr(middle + away) - ndtr(away - middle) < share
        low, high = np.where(small, middle, low), np.where(small, high, middle)
    return np.asarray(high)


def _solved(squares: Floats, mass: Floats, df: float, confidence: float, start: Floats) -> Floats:
    """Find k with ``mass @ P(chi2_df > squares / k^2) = confidence``: bisection from about the guess."""

    def low(k: Floats) -> NDArray[np.bool_]:
        return np.asarray(chdtrc(df, squares / k[:, None] ** 2) @ mass < confidence)

    below, above = start.copy(), start.copy()
    while (wrong := ~low(below)).any():
        below[wrong] *= 0.9
    while (wrong := low(above)).any():
        above[wrong] *= 1.1
    while (above - below > PRECISION * above).any():
        middle = 0.5 * (below + above)
        small = low(middle)
        below, above = np.where(small, middle, below), np.where(small, above, middle)
    return 0.5 * (below + above)


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
    judge = surface.judge
    mean, df, p = surface.predict(points), judge.fit.df, judge.fit.p
    if method == "scheffe":
        width = float(np.sqrt(p * fdtri(p, df, confidence)))
    else:
        width = float(stdtrit(df, 1.0 - 0.5 * (1.0 - confidence) / max(len(mean), 1)))
    half = width * judge.fit.sigma * np.sqrt(judge.leverage(points))
    return mean, mean - half, mean + half


def _check(surface: PolynomialSurface, share: float, confidence: float) -> None:
    if not (0.0 < share < 1.0 and 0.0 < confidence < 1.0):
        raise RsmkitError(f"share and confidence lie between 0 and 1, got {share} and {confidence}")
    if surface.judge.fit.df == 0:
        raise RsmkitError(f"{surface.response}: no degrees of freedom left, so no interval can be given")
