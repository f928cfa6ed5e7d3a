"""Limits of a count that is still to be made, when its mean is known with an error."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.special import bdtr, pdtr

from rsmkit.language.space import Floats
from rsmkit.surfaces.estimation.counts.scoring import DISTRIBUTIONS, DistributionName

__all__ = ["count_limits"]

NODES = np.linspace(-8.0, 8.0, 401)
"""Of the trapezoidal rule over the error of the mean.

For a normal density it is exact to rounding unless the law of the counts is narrower than a step. Then it is
off by at most half a step times the density, at 95 % 0.02 * 0.058 = 0.0012.
"""
LARGEST = 2.0**53
"""Counts beyond are no whole numbers in floating point."""


def count_limits(
    distribution: DistributionName, eta: Floats, error: Floats, size: Floats, confidence: float
) -> tuple[Floats, Floats]:
    """Equal-tailed limits of new counts.

    The distribution of a new count is that of the family, averaged over a normal linear predictor: the least
    count that is reached with a probability above one half of ``1 - confidence``, and likewise the largest.
    Counts are whole, so the limits hold at least as often as they say.

    Parameters
    ----------
    distribution : {"binomial", "poisson"}
    eta, error : array, shape (n,)
        Linear predictor and its standard error.
    size : array, shape (n,)
        Trials, whole numbers, or exposure.
    confidence : float

    Returns
    -------
    low, high : array, shape (n,)
    """
    weights = np.exp(-0.5 * NODES**2)
    weights = weights / weights.sum()
    mean = DISTRIBUTIONS[distribution].mean(eta[:, None] + error[:, None] * NODES)
    if distribution == "binomial":
        top = size

        def each(count: Floats) -> Floats:
            return np.asarray(bdtr(count[:, None], size[:, None].astype(int), mean))

    else:
        mean = np.minimum(mean * size[:, None], LARGEST)
        top = np.minimum((mean + 12.0 * np.sqrt(mean) + 60.0).max(axis=1), LARGEST)

        def each(count: Floats) -> Floats:
            return np.asarray(pdtr(count[:, None], mean))

    def below(count: Floats) -> Floats:
        return np.asarray(each(count) @ weights)

    tail = 0.5 * (1.0 - confidence)
    return _quantile(below, tail, top), _quantile(below, 1.0 - tail, top)


def _quantile(below: Callable[[Floats], Floats], probability: float, top: Floats) -> Floats:
    """Least whole numbers, shape (n,), up to which at least this probability lies."""
    low, high = np.full(len(top), -1.0), np.ceil(top)
    while (high - low > 1.0).any():
        middle = np.floor(0.5 * (low + high))
        middle = np.where(high - low > 1.0, middle, high)
        enough = below(middle) >= probability
        low, high = np.where(enough, low, middle), np.where(enough, middle, high)
    return high
