"""Whole functions drawn from a Gaussian process given runs.

A function of the process before any run is a sum of cosines (Rahimi & Recht, *Random features for large-scale
kernel machines*, 2007); what the runs add to it is exact (Matheron's rule; Wilson et al., *Efficiently
sampling functions from Gaussian process posteriors*, 2020). A drawn function can be asked anywhere, at a cost
linear in the number of points, where :meth:`Kriging.samples` needs the covariance of all of them.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.linalg import cho_solve
from scipy.special import gammaln, xlogy

from rsmkit.language.space import Floats
from rsmkit.surfaces.estimation.processes.correlation import Kernel
from rsmkit.surfaces.estimation.processes.kriging import Kriging

__all__ = ["drawn_paths"]

WAVES = 1024
"""Frequencies of the sum; each has a cosine and a sine."""
SMOOTHNESS = 2.5
"""Of the Matern kernel 5/2: its frequencies follow Student's t with twice as many degrees of freedom."""
CHUNK = 4096
HIGHEST = 1e4
"""Scale of the highest frequency that is drawn; what lies above is smaller than any nugget."""


def _matern52(rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Scales of the frequencies and the share of the variance of each.

    A t law is a normal one of random scale. Few large scales would be drawn from that law itself, though
    they decide what is left open between runs that lie closer than a correlation length; half of all scales
    are drawn from even steps of the logarithm instead, and their shares allow for it.
    """
    df, half = 2 * SMOOTHNESS, WAVES // 2
    top = np.log(HIGHEST)
    usual = np.sqrt(df / rng.chisquare(df, half))
    wide = np.exp(top * (np.arange(WAVES - half) + rng.random(WAVES - half)) / (WAVES - half))
    scales = np.concatenate([usual, wide])
    logs = np.log(scales)
    # density of the logarithm of the scale: that of a chi-square number, twice the derivative
    squares = df / scales**2
    natural = 2.0 * np.exp(xlogy(0.5 * df, 0.5 * squares) - 0.5 * squares - gammaln(0.5 * df))
    drawn = 0.5 * natural + 0.5 * ((logs >= 0.0) & (logs <= top)) / top
    return scales, natural / drawn / WAVES


def _rbf(rng: np.random.Generator) -> tuple[Floats, Floats]:
    return np.ones(WAVES), np.full(WAVES, 1.0 / WAVES)


SPECTRA: dict[Kernel, Callable[[np.random.Generator], tuple[Floats, Floats]]] = {
    "matern52": _matern52,
    "rbf": _rbf,
}
"""How the frequencies of a kernel are drawn, in units of a normal law."""


def drawn_paths(
    process: Kriging, kernel: Kernel, count: int, rng: np.random.Generator
) -> Callable[[Floats], Floats]:
    """Draw functions from a process given its runs.

    Parameters
    ----------
    process : Kriging
    kernel : {"matern52", "rbf"}
        Of its radial correlation.
    count : int
        Number of functions.
    rng : Generator

    Returns
    -------
    callable
        Points (q, m), in the columns of the process, to the values of every function, shape (count, q).
    """
    lengths, n = process.correlation.lengths, len(process.y)
    scales, shares = SPECTRA[kernel](rng)
    frequencies = rng.standard_normal((len(lengths), WAVES)) * scales / lengths[:, None]
    sizes = np.sqrt(process.variance * np.concatenate([shares, shares]))
    amplitudes = rng.standard_normal((2 * WAVES, count)) * sizes[:, None]
    origin = process.points[0]

    def waves(points: Floats) -> Floats:
        phase = (points - origin) @ frequencies
        return np.asarray(np.hstack([np.cos(phase), np.sin(phase)]) @ amplitudes)

    noise = np.ones(n) if process.noise is None else process.noise
    errors = rng.standard_normal((n, count)) * np.sqrt(process.noise_variance * noise)[:, None]
    away = process.y[:, None] - waves(process.points) - errors
    factor = (process.cholesky, True)
    ones = cho_solve(factor, np.ones(n))
    if process.known_mean is None:
        means = ones @ away / ones.sum()
    else:
        means = np.full(count, process.known_mean)
    weights = cho_solve(factor, away - means)

    def paths(points: Floats) -> Floats:
        values = np.empty((count, len(points)))
        for start in range(0, len(points), CHUNK):
            part = points[start : start + CHUNK]
            near = process.correlation.between(part, process.points) @ weights
            values[:, start : start + CHUNK] = (means + waves(part) + near).T
        return values

    return paths
