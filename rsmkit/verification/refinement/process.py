"""A small Gaussian process, fast enough to be fitted in every wave of a refinement.

Correlation Gaussian or Matern-5/2 with one length scale per factor and a nugget; constant mean and variance
are profiled out of the likelihood (Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006,
ch. 2, 4 and 5; leave-one-out: eq. 5.12).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve
from scipy.optimize import minimize

from rsmkit.language.space import Floats

__all__ = ["Correlation", "GaussianProcess", "fit_process"]

Correlation = Literal["gaussian", "matern"]

STARTS = (0.3, 1.0, 3.0)
"""First guesses of the length scales, in extents of the points."""


@dataclass(frozen=True)
class GaussianProcess:
    """A fitted process.

    Parameters
    ----------
    correlation : str
        Family.
    points : ndarray, shape (n, k)
        Where it was fitted.
    lengths : ndarray, shape (k,)
        Length scales.
    mean : float
        Constant mean.
    weights : ndarray, shape (n,)
        Inverse correlation matrix times centred values.
    residuals : ndarray, shape (n,)
        Leave-one-out residuals at fixed length scales.
    """

    correlation: Correlation
    points: Floats
    lengths: Floats
    mean: float
    weights: Floats
    residuals: Floats

    @property
    def name(self) -> str:
        """What it is, in words."""
        return f"{'Gaussian' if self.correlation == 'gaussian' else 'Matern'} process"

    def predict(self, unit: Floats) -> Floats:
        """Posterior mean at points, shape (m, k); shape (m,)."""
        square = ((unit[:, None] - self.points[None]) / self.lengths) ** 2
        value, _ = _correlate(square.sum(axis=2), self.correlation)
        values: Floats = self.mean + value @ self.weights
        return values


def fit_process(
    points: Floats, y: Floats, correlation: Correlation, *, largest_nugget: float = 1e-6
) -> GaussianProcess | None:
    """Fit by maximum likelihood from three starts.

    Parameters
    ----------
    points, y : ndarray, shapes (n, k) and (n,)
        Distinct points and their values.
    correlation : {"gaussian", "matern"}
        Family.
    largest_nugget : float
        Relative to the process variance: 1 for noisy values, tiny for exact ones.

    Returns
    -------
    GaussianProcess or None
        None for fewer than four points or values without spread.
    """
    if len(points) < 4 or not np.ptp(y) > 0:
        return None
    extent = np.maximum(np.ptp(points, axis=0), 1e-9)
    scaled = (points - points.min(axis=0)) / extent
    squares = (scaled[:, None] - scaled[None]) ** 2
    values = (y - y.mean()) / y.std()
    k = points.shape[1]
    bounds = [(np.log(0.05), np.log(100.0))] * k + [(np.log(1e-12), np.log(largest_nugget))]
    results = [
        minimize(
            _likelihood,
            np.r_[np.full(k, np.log(length)), np.log(min(1e-9, largest_nugget))],
            args=(squares, values, correlation),
            jac=True,
            bounds=bounds,
            method="L-BFGS-B",
            options={"maxiter": 100},
        )
        for length in STARTS
    ]
    best = min(results, key=lambda result: float(result.fun))
    if not best.fun < FAILED:
        return None
    factor, mean, weights, _ = _solve(best.x, squares, values, correlation)
    inverse = cho_solve(factor, np.eye(len(values)))
    # Profiling the mean costs one degree of freedom: the projection removes the mean's share as well.
    ones = inverse.sum(axis=1)
    inverse = inverse - np.outer(ones, ones) / ones.sum()
    return GaussianProcess(
        correlation,
        points,
        extent * np.exp(best.x[:k]),
        float(y.mean() + y.std() * mean),
        y.std() * weights,
        y.std() * weights / np.diag(inverse),
    )


FAILED = 1e25
"""Stands for the likelihood where the correlation matrix cannot be factorised."""


def _correlate(square: Floats, correlation: Correlation) -> tuple[Floats, Floats]:
    """Correlation as a function of the scaled squared distance, and its derivative by that square."""
    if correlation == "gaussian":
        value = np.exp(-0.5 * square)
        return value, -0.5 * value
    distance = np.sqrt(5.0 * square)
    decay = np.exp(-distance)
    return (1.0 + distance + distance**2 / 3.0) * decay, -(5.0 / 6.0) * (1.0 + distance) * decay


def _solve(
    theta: Floats, squares: Floats, values: Floats, correlation: Correlation
) -> tuple[tuple[Floats, bool], float, Floats, Floats]:
    """Factor the correlation matrix; least-squares mean, weights, derivative of the correlation."""
    k = squares.shape[2]
    value, slope = _correlate(squares @ np.exp(-2.0 * theta[:k]), correlation)
    factor = cho_factor(value + np.exp(theta[k]) * np.eye(len(values)), lower=True)
    ones = cho_solve(factor, np.ones(len(values)))
    mean = float(ones @ values / ones.sum())
    return factor, mean, cho_solve(factor, values - mean), slope


def _likelihood(
    theta: Floats, squares: Floats, values: Floats, correlation: Correlation
) -> tuple[float, Floats]:
    """Negative concentrated log likelihood (times 2) and its gradient by the logarithms in `theta`."""
    n, k = len(values), squares.shape[2]
    try:
        factor, mean, weights, slope = _solve(theta, squares, values, correlation)
    except LinAlgError:
        return FAILED, np.zeros(k + 1)
    variance = float((values - mean) @ weights) / n
    if not variance > 0:
        return FAILED, np.zeros(k + 1)
    half = np.log(np.diag(factor[0])).sum()
    inverse = cho_solve(factor, np.eye(n))
    sensitivity = inverse - np.outer(weights, weights) / variance
    gradient = np.empty(k + 1)
    pull = sensitivity * slope
    gradient[:k] = np.einsum("ij,ijk->k", pull, squares) * (-2.0 * np.exp(-2.0 * theta[:k]))
    gradient[k] = np.exp(theta[k]) * np.trace(sensitivity)
    return float(n * np.log(variance) + 2.0 * half), gradient
