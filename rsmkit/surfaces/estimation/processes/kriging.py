"""Kriging: a Gaussian process given runs.

Rasmussen & Williams, *Gaussian Processes for Machine Learning* (2006): equations 2.23-2.26 (prediction),
5.8-5.9 (likelihood and its gradient), 5.10-5.12 (leave-one-out, exact for given correlation and nugget). What
estimating the mean costs is in every variance: ordinary kriging (Cressie, *Statistics for Spatial Data*,
1993, section 3.2).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg.lapack import dtrtrs

from rsmkit.language.space import Floats
from rsmkit.surfaces.estimation.processes.correlation import Among, Correlation

__all__ = ["Kriging"]

CHUNK = 4096
"""Points that are predicted at once, for the memory that their correlations take."""


@dataclass(frozen=True, eq=False)
class Kriging:
    """A Gaussian process given runs, at a given correlation and nugget.

    All variances are in the unit of `y`, squared.

    Parameters
    ----------
    correlation : Correlation
        Of any two points.
    points : array, shape (n, m)
    y : array, shape (n,)
    nugget : float
        Noise variance of a run as a part of the process variance.
    noise : array, shape (n,), optional
        By which the noise variance of each run is multiplied.
    known_mean : float, optional
        Mean of the process (simple kriging); otherwise estimated by generalised least squares (ordinary
        kriging).
    known_variance : float, optional
        Variance of the process; otherwise the likeliest.

    Raises
    ------
    numpy.linalg.LinAlgError
        By all that needs the covariance of the runs, when that is singular.
    """

    correlation: Correlation
    points: Floats
    y: Floats
    nugget: float
    noise: Floats | None = None
    known_mean: float | None = None
    known_variance: float | None = None

    # ------------------------------------------------------------------ at points

    def predict(self, points: Floats) -> Floats:
        """Conditional mean, shape (q,) for q points."""
        return _in_parts(points, lambda part: self.mean + self._correlate(part) @ self.weights)

    def gradient(self, points: Floats) -> Floats:
        """Derivatives of the conditional mean by the columns, shape (q, m)."""
        return _in_parts(points, lambda part: self.correlation.gradient(part, self.points, self.weights))

    def variances(self, points: Floats) -> Floats:
        """Conditional variance, without the noise of a run, shape (q,)."""

        def variances(part: Floats) -> Floats:
            across = self._correlate(part)
            spread = _solve(self.cholesky, across.T)
            left = 1.0 - np.einsum("ij,ij->j", spread, spread) + self._mean_shares(across) ** 2
            return np.asarray(self.variance * np.maximum(left, 0.0))

        return _in_parts(points, variances)

    def variance_gradient(self, points: Floats) -> Floats:
        """Derivatives of the conditional variance by the columns, shape (q, m)."""

        def slopes(part: Floats) -> Floats:
            pull = -2.0 * self.variance * self._shares(self._correlate(part))
            return self.correlation.gradient(part, self.points, pull)

        return _in_parts(points, slopes)

    def covariance(self, points: Floats) -> Floats:
        """Conditional covariance of all points with each other, without the noise of runs, shape (q, q)."""
        across = self._correlate(points)
        spread = _solve(self.cholesky, across.T)
        among, shares = self.correlation.between(points, points), self._mean_shares(across)
        return np.asarray(self.variance * (among - spread.T @ spread + np.outer(shares, shares)))

    def samples(
        self, points: Floats, count: int, rng: np.random.Generator, covariance: Floats | None = None
    ) -> Floats:
        """Draw the process at all points jointly, without the noise of runs, shape (count, q).

        Another `covariance` than its own, shape (q, q), takes the place of that when given.
        """
        values, vectors = np.linalg.eigh(self.covariance(points) if covariance is None else covariance)
        # the symmetric root: unlike a Cholesky factor it exists for points that the runs determine, and
        # unlike the eigenvectors it has no signs that could differ between processors
        root = (vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T
        return np.asarray(self.predict(points) + rng.standard_normal((count, len(points))) @ root)

    def extended(self, points: Floats, y: Floats, noise: Floats | None = None) -> Kriging:
        """Condition on more runs; lengths, nugget and process variance are kept.

        Takes of the order of n^2 operations for each run, not n^3.

        Parameters
        ----------
        points, y : arrays, shapes (q, m) and (q,)
        noise : array, shape (q,), optional
            As of the process; one each if it is not given.
        """
        more = np.ones(len(y)) if noise is None else noise
        both = None if self.noise is None and noise is None else np.append(self._noise, more)
        longer = replace(
            self,
            points=np.vstack([self.points, points]),
            y=np.append(self.y, y),
            noise=both,
            known_variance=self.variance,
        )
        n = len(self.y)
        across = longer._correlate(points)
        below = _solve(self.cholesky, across[:, :n].T).T
        corner = across[:, n:] + self.nugget * np.diag(more) - below @ below.T
        # put where `longer` would keep what it had computed itself
        vars(longer)["cholesky"] = np.block(
            [[self.cholesky, np.zeros(below.T.shape)], [below, np.linalg.cholesky(corner)]]
        )
        return longer

    # ------------------------------------------------------------------ leaving runs out

    def predictions_without(self, points: Floats) -> Floats:
        """Predict without each of the runs, lengths and nugget kept, shape (q, n)."""
        shares = self._shares(self._correlate(points))
        return np.asarray(self.predict(points)[:, None] - shares * self.loo_residuals)

    @cached_property
    def loo_residuals(self) -> Floats:
        """Error of predicting each run from the others, lengths and nugget kept, shape (n,)."""
        return self.weights / self._precisions

    @cached_property
    def loo_variances(self) -> Floats:
        """Variance of each run given the others, its noise included, shape (n,)."""
        return self.variance / self._precisions

    # ------------------------------------------------------------------ estimates and likelihood

    @cached_property
    def mean(self) -> float:
        """Of the process."""
        if self.known_mean is not None:
            return self.known_mean
        return float(self._constant @ self.y / self._constant.sum())

    @cached_property
    def variance(self) -> float:
        """Of the process."""
        return self._misfit / len(self.y) if self.known_variance is None else self.known_variance

    @property
    def noise_variance(self) -> float:
        """Of a run whose `noise` is one."""
        return self.nugget * self.variance

    @property
    def deviance(self) -> float:
        """Minus twice the log likelihood."""
        log_determinant = 2.0 * float(np.log(np.diag(self.cholesky)).sum())
        logs = len(self.y) * float(np.log(2.0 * np.pi * self.variance))
        return self._misfit / self.variance + log_determinant + logs

    @property
    def deviance_slopes(self) -> Floats:
        """Derivatives of the deviance by the correlation's parameters, and log nugget and log variance."""
        sensitivity = self._inverse - np.outer(self.weights, self.weights) / self.variance
        by_correlation = self._among_runs.slopes(sensitivity)
        by_nugget = self.nugget * (np.diag(sensitivity) @ self._noise)
        return np.append(by_correlation, [by_nugget, len(self.y) - self._misfit / self.variance])

    # ------------------------------------------------------------------ matrices, in process variances

    @property
    def bordered_cholesky(self) -> list[Floats]:
        """Rows of the Cholesky factor of the covariance, and with an estimated mean those of its border.

        Solved for the correlations of a point with the runs, and one, the variance of the point is one minus
        the squares of the first n numbers plus that of the last.
        """
        rows = [row[: i + 1] for i, row in enumerate(self.cholesky)]
        if self.known_mean is None:
            length = self._constant.sum()
            rows.append(length * np.append(self._constant @ self.cholesky, 1.0))
        return rows

    @cached_property
    def weights(self) -> Floats:
        """Inverse covariance times what `y` differs from the mean, shape (n,)."""
        return _solve_both(self.cholesky, self.y - self.mean)

    @cached_property
    def cholesky(self) -> Floats:
        """Lower factor of the covariance of the runs, shape (n, n)."""
        covariance = self._among_runs.values.copy()
        covariance[np.diag_indices_from(covariance)] += self.nugget * self._noise
        return np.asarray(np.linalg.cholesky(covariance), float)

    @cached_property
    def _among_runs(self) -> Among:
        return self.correlation.among(self.points)

    @cached_property
    def _noise(self) -> Floats:
        return np.ones(len(self.y)) if self.noise is None else self.noise

    @cached_property
    def _misfit(self) -> float:
        return float((self.y - self.mean) @ self.weights)

    @cached_property
    def _inverse(self) -> Floats:
        inverse = _solve(self.cholesky, np.eye(len(self.y)))
        return np.asarray(inverse.T @ inverse)

    @cached_property
    def _precisions(self) -> Floats:
        """Of each run given the others."""
        return np.asarray(np.diag(self._inverse) - self._constant**2)

    @cached_property
    def _constant(self) -> Floats:
        """Inverse covariance times a constant column of variance one; zero for a mean that is known."""
        if self.known_mean is not None:
            return np.zeros(len(self.y))
        white = _solve(self.cholesky, np.ones(len(self.y)))
        unit = white / np.linalg.norm(white)
        return _solve(self.cholesky, unit, transposed=True)

    def _mean_shares(self, across: Floats) -> Floats:
        """Standard deviations that estimating the mean adds at points, signed, from their correlations."""
        if self.known_mean is not None:
            return np.zeros(len(across))
        return np.asarray(1.0 / self._constant.sum() - across @ self._constant)

    def _shares(self, across: Floats) -> Floats:
        """Weight of each run in the prediction at points, from their correlations, shape (q, n)."""
        shares = _solve_both(self.cholesky, across.T).T
        return np.asarray(shares + np.outer(self._mean_shares(across), self._constant))

    def _correlate(self, points: Floats) -> Floats:
        """Correlations of points with the runs, shape (q, n)."""
        return self.correlation.between(points, self.points)


def _in_parts(points: Floats, function: Callable[[Floats], Floats]) -> Floats:
    parts = range(0, max(len(points), 1), CHUNK)
    return np.concatenate([function(points[start : start + CHUNK]) for start in parts])


def _solve(lower: Floats, right: Floats, *, transposed: bool = False) -> Floats:
    # Straight to LAPACK: for few runs the checks of scipy's own function take five times as long as solving.
    # It counts by columns, so that the factor, kept by rows, is the upper one to it, and nothing is copied.
    found, flaw = dtrtrs(lower.T, right, lower=0, trans=0 if transposed else 1)
    if flaw:
        raise np.linalg.LinAlgError("the covariance of the runs is singular")
    return np.asarray(found)


def _solve_both(lower: Floats, right: Floats) -> Floats:
    return _solve(lower, _solve(lower, right), transposed=True)
