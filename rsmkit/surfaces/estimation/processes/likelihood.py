"""Correlation lengths and nugget of a Gaussian process by maximum likelihood.

The gradient is analytic (:attr:`Kriging.deviance_slopes`); mean and, unless the noise is known, variance of
the process are profiled out.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
from numpy.linalg import LinAlgError
from scipy.optimize import Bounds, minimize

from rsmkit.language.space import Floats
from rsmkit.surfaces.estimation.processes.correlation import Kernel, Radial
from rsmkit.surfaces.estimation.processes.kriging import Kriging

__all__ = ["fit_kriging"]

LENGTHS = (0.02, 100.0)
"""Bounds of the correlation lengths, in extents of the runs."""
NUGGET = (1e-10, 10.0)
"""Bounds of the nugget, in units of the process variance.

Rounding moves the eigenvalues of the covariance of n runs by up to n^2 unit roundoffs: at the lower bound
that of 900 runs can still be factorised, at 1e-12 that of 90.
"""
STARTS = tuple(product((0.15, 0.5, 1.5, 5.0), (1e-9, 1e-4, 1e-2, 0.3)))
"""First guesses, the same length for every column, and the nugget."""
SEARCHES = 3
"""How many of them, the likeliest, are improved."""
LEAST_NOISE = 1e-8
"""Least noise variance that can be known, in units of the variance of the runs."""
FAILED = 1e25
"""Stands for the deviance where the covariance cannot be factorised."""


def fit_kriging(
    kernel: Kernel,
    points: Floats,
    y: Floats,
    noise: Floats | None = None,
    *,
    nuggets: tuple[float, float] = NUGGET,
    noise_variance: float | None = None,
    like: Kriging | None = None,
) -> Kriging:
    """Find lengths and nugget by maximum likelihood, from the likeliest of a grid of starts.

    Parameters
    ----------
    kernel, points, y, noise
        As of :class:`Kriging`; at least three different points.
    nuggets : pair of float
        Bounds of the nugget; up to 1e-6, say, for exact values.
    noise_variance : float, optional
        Noise variance of a run, if known, in the unit of `y`, squared; otherwise it is estimated. Taken to be
        at least 1e-8 of the variance of `y`.
    like : Kriging, optional
        What was found for nearly the same runs: searched from there, and from one start of the grid.

    Returns
    -------
    Kriging
        Its process variance is the likeliest; with known noise it is `noise_variance` over the nugget.
    """
    extents = np.ptp(points, axis=0)
    extents[extents == 0] = 1.0
    scale = float(y.std()) or 1.0
    known = None if noise_variance is None else max(noise_variance / scale**2, LEAST_NOISE)
    unit = Radial(kernel, np.ones(len(extents)))
    scaled = Kriging(unit, points / extents, (y - y.mean()) / scale, 1.0, noise)

    def deviance(theta: Floats) -> tuple[float, Kriging]:
        model = _with(scaled, kernel, theta, known)
        try:
            return (model.deviance if model.variance > 0 else FAILED), model
        except LinAlgError:
            return FAILED, model

    def with_slopes(theta: Floats) -> tuple[float, Floats]:
        value, model = deviance(theta)
        return value, np.zeros_like(theta) if value == FAILED else _slopes(model, known is not None)

    m = len(extents)
    grid = dict.fromkeys((length, min(nugget, nuggets[1])) for length, nugget in STARTS)
    starts = sorted(
        (np.log([*[length] * m, nugget]) for length, nugget in grid),
        key=lambda start: deviance(start)[0],
    )
    bounds = Bounds(*np.log([*[LENGTHS] * m, nuggets]).T)
    tried = starts[:SEARCHES]
    if like is not None:
        known_best = np.log([*np.asarray(like.correlation.lengths) / extents, like.nugget])
        tried = [np.clip(known_best, bounds.lb, bounds.ub), starts[0]]
    found = [
        minimize(with_slopes, start, jac=True, bounds=bounds, method="L-BFGS-B", options={"maxiter": 100})
        for start in tried
    ]
    best = _with(scaled, kernel, min(found, key=lambda result: float(result.fun)).x, known)
    return Kriging(
        Radial(kernel, extents * best.correlation.lengths),
        points,
        y,
        best.nugget,
        noise,
        known_variance=None if known is None else scale**2 * known / best.nugget,
    )


def _with(model: Kriging, kernel: Kernel, theta: Floats, known: float | None) -> Kriging:
    """Change the logarithms of lengths and nugget, keeping a known noise variance."""
    nugget = float(np.exp(theta[-1]))
    return replace(
        model,
        correlation=Radial(kernel, np.exp(theta[:-1])),
        nugget=nugget,
        known_variance=None if known is None else known / nugget,
    )


def _slopes(model: Kriging, noise_is_known: bool) -> Floats:
    """Derivatives of the deviance by the logarithms of lengths and nugget."""
    *found, by_variance = model.deviance_slopes
    if noise_is_known:  # the variance falls as the nugget grows
        found[-1] -= by_variance
    return np.array(found)
