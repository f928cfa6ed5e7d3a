"""Distribution of the studentized range, for Tukey's simultaneous comparison of means.

Range of k independent normal variables over an independent estimate of their standard deviation:
``P(q) = int f(s) W(q s) ds`` with ``W(w) = k int phi(z) (Phi(z) - Phi(z - w))^(k-1) dz`` and ``f`` the
density of ``sqrt(chi2(df) / df)`` (Copenhaver & Holland, *J. Statist. Comput. Simul.* 30 (1988), 1-15). Both
integrals by Gauss and Legendre's rule.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.special import chdtri, gammaln, ndtr

__all__ = ["range_tail"]

NODES = 96
"""Per integral; the integrands are smooth and the error is about 1e-13."""
REACH = 8.5
"""Standard normal variables are within this of zero but for 2e-17."""
TAIL = 1e-16
"""Share of the distribution of the standard deviation left out on either side."""


def range_tail(q: float, count: int, df: float) -> float:
    """Chance that the studentized range of `count` means exceeds `q`.

    Parameters
    ----------
    q : float
        Range in standard errors of one mean: ``sqrt(2)`` times the t of a difference.
    count : int
        Number of means.
    df : float
        Degrees of freedom of the standard deviation.
    """
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    low, high = (math.sqrt(chdtri(df, share) / df) for share in (1.0 - TAIL, TAIL))
    s = 0.5 * (low + high) + 0.5 * (high - low) * nodes
    log_density = (
        math.log(2.0) + 0.5 * df * math.log(0.5 * df) - gammaln(0.5 * df)
        + (df - 1.0) * np.log(s) - 0.5 * df * s**2
    )  # fmt: skip
    z = REACH * nodes
    normal = np.exp(-0.5 * z**2) / math.sqrt(2.0 * math.pi) * REACH * weights
    within = (ndtr(z) - ndtr(z - q * s[:, None])) ** (count - 1) @ normal * count
    outside = np.clip(1.0 - within, 0.0, 1.0)
    return float(np.clip(0.5 * (high - low) * (weights * np.exp(log_density)) @ outside, 0.0, 1.0))
