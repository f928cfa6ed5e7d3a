"""Where the simulator fails: a Gaussian-process classifier of the runs that succeeded and those that did not.

Probit likelihood and Laplace's approximation: Rasmussen & Williams, *Gaussian Processes for Machine Learning*
(2006), algorithms 3.1 and 3.2. The covariance is that of a plane (failures beyond a linear limit) plus that
of a smooth function; their sizes are those of the greatest evidence on a small grid.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.linalg import LinAlgError
from numpy.typing import NDArray
from scipy.linalg import cho_solve, solve_triangular
from scipy.special import log_ndtr

from rsmkit.language.space import Floats

__all__ = ["Failures", "fit_failures", "fit_failures_near"]

PLANES = (0.0, 10.0, 100.0)
BUMPS = ((0.0, 1.0), (3.0, 0.2), (3.0, 0.4), (10.0, 0.2), (10.0, 0.4), (10.0, 0.8))
"""Variance and length of the smooth function."""
FEWEST, REACH = 20, 3.0
"""Runs that a boundary is learnt from nearby at least, and half-widths within which all of them count."""
STEPS = 40
SETTLED = 1e-8


@dataclass(frozen=True, eq=False)
class Failures:
    """What is known about failing.

    Parameters
    ----------
    unit : array, shape (n, k)
        All runs.
    categorical : array of bool, shape (k,)
        Columns of categories.
    plane, bump, length : float
        Of the covariance.
    weights : array, shape (n,)
        Gradient of the log likelihood at the mode.
    root : array, shape (n,)
        Square roots of its curvatures.
    cholesky : array, shape (n, n)
        Of ``I + root K root``.
    origin, extent : array, shape (k,)
        Of the part of the cube that the runs lie in, which is what lengths are measured in.
    """

    unit: Floats
    categorical: NDArray[np.bool_]
    plane: float
    bump: float
    length: float
    weights: Floats
    root: Floats
    cholesky: Floats
    origin: Floats
    extent: Floats

    def latent(self, unit: Floats) -> Floats:
        """Mean of the latent function, shape (q,): positive where a run should succeed."""
        return np.asarray(self._covariance(self._within(unit)) @ self.weights)

    def gradient(self, unit: Floats) -> Floats:
        """Its derivatives by the coordinates, shape (q, k)."""
        x, known = self._within(unit), self.unit
        numeric = ~self.categorical
        found = np.zeros_like(x)
        along = self.weights @ (2.0 * known[:, numeric] - 1.0)
        found[:, numeric] = 2.0 * self.plane * along
        if self.bump:
            pull = self.bump * _bump(x, known, self.categorical, self.length) * self.weights
            apart = pull.sum(axis=1)[:, None] * x - pull @ known
            found[:, numeric] -= apart[:, numeric] / self.length**2
        return np.asarray(found / self.extent)

    def log_chance(self, unit: Floats) -> Floats:
        """Logarithm of the probability that a run succeeds, shape (q,)."""
        x = self._within(unit)
        across = self._covariance(x)
        spread = solve_triangular(self.cholesky, self.root[:, None] * across.T, lower=True)
        own = _own(x, self.categorical, self.plane, self.bump)
        variance = np.maximum(own - np.einsum("ij,ij->j", spread, spread), 0.0)
        return np.asarray(log_ndtr(across @ self.weights / np.sqrt(1.0 + variance)))

    def samples(self, unit: Floats, count: int, rng: np.random.Generator) -> Floats:
        """Draw success, where positive, at all points jointly, shape (count, q).

        At each point it is as likely as :meth:`log_chance` says. The probit's own noise is the same at all
        points of a draw: what fails does so always, and the noise stands for where the boundary lies.
        """
        x = self._within(unit)
        across = self._covariance(x)
        spread = solve_triangular(self.cholesky, self.root[:, None] * across.T, lower=True)
        joint = _covariance(x, x, self.categorical, self.plane, self.bump, self.length) - spread.T @ spread
        values, vectors = np.linalg.eigh(0.5 * (joint + joint.T))
        factor = vectors * np.sqrt(np.maximum(values, 0.0))
        latent = across @ self.weights + rng.standard_normal((count, len(x))) @ factor.T
        return np.asarray(latent + rng.standard_normal((count, 1)))

    def _within(self, unit: Floats) -> Floats:
        return (unit - self.origin) / self.extent

    def _covariance(self, unit: Floats) -> Floats:
        return _covariance(unit, self.unit, self.categorical, self.plane, self.bump, self.length)


def fit_failures(unit: Floats, alive: NDArray[np.bool_], categorical: NDArray[np.bool_]) -> Failures | None:
    """Learn from runs, shape (n, k), which of them succeeded; None when none has failed."""
    k = unit.shape[1]
    return None if alive.all() else _fitted(unit, alive, categorical, np.zeros(k), np.ones(k))


def fit_failures_near(
    unit: Floats, alive: NDArray[np.bool_], categorical: NDArray[np.bool_], distance: Floats, width: float
) -> Failures | None:
    """Learn from the runs around a place, in the coordinates of the part of the cube that these lie in.

    The boundary of failing is found as finely as runs lie about it, whatever it is farther away.

    Parameters
    ----------
    unit, alive, categorical
        Runs, which succeeded, which columns are categories.
    distance : array, shape (n,)
        Of the runs from the place; inf where a category differs.
    width : float
        Half-width of the region.

    Returns
    -------
    Failures or None
        None when all of these runs succeeded, or all failed.
    """
    k = unit.shape[1]
    count = max(4 * k + 8, FEWEST, int((distance <= REACH * width).sum()))
    rows = np.argsort(distance, kind="stable")[:count]
    rows = rows[np.isfinite(distance[rows])]
    if alive[rows].all() or not alive[rows].any():
        return None
    origin, extent = unit[rows].min(axis=0), np.ptp(unit[rows], axis=0)
    fixed = categorical | (extent == 0)
    origin, extent = np.where(fixed, 0.0, origin), np.where(fixed, 1.0, extent)
    return _fitted(unit[rows], alive[rows], categorical, origin, extent)


def _fitted(
    unit: Floats, alive: NDArray[np.bool_], categorical: NDArray[np.bool_], origin: Floats, extent: Floats
) -> Failures | None:
    unit = (unit - origin) / extent
    sign = np.where(alive, 1.0, -1.0)
    best: tuple[float, Failures] | None = None
    for plane in PLANES:
        for bump, length in BUMPS:
            covariance = _covariance(unit, unit, categorical, plane, bump, length)
            try:
                evidence, parts = _laplace(covariance, sign)
            except LinAlgError:
                continue
            if best is None or evidence > best[0]:
                found = Failures(unit, categorical, plane, bump, length, *parts, origin, extent)
                best = evidence, found
    return best[1] if best else None


def _laplace(covariance: Floats, sign: Floats) -> tuple[float, tuple[Floats, Floats, Floats]]:
    """Mode of the latent values by Newton's method, and the approximate evidence there."""
    n = len(sign)
    latent = np.zeros(n)
    before = -np.inf
    for _ in range(STEPS):
        weights, curvature = _likelihood(latent, sign)
        root = np.sqrt(curvature)
        cholesky = np.linalg.cholesky(np.eye(n) + root[:, None] * covariance * root)
        b = curvature * latent + weights
        a = b - root * cho_solve((cholesky, True), root * (covariance @ b))
        latent = covariance @ a
        now = float(-0.5 * a @ latent + log_ndtr(sign * latent).sum())
        if abs(now - before) < SETTLED:
            break
        before = now
    weights, curvature = _likelihood(latent, sign)
    root = np.asarray(np.sqrt(curvature), float)
    cholesky = np.linalg.cholesky(np.eye(n) + root[:, None] * covariance * root)
    return now - float(np.log(np.diag(cholesky)).sum()), (weights, root, np.asarray(cholesky, float))


def _likelihood(latent: Floats, sign: Floats) -> tuple[Floats, Floats]:
    """First derivative and negative second derivative of the log likelihood by the latent values."""
    z = sign * latent
    ratio = np.exp(-0.5 * z * z - 0.5 * np.log(2.0 * np.pi) - log_ndtr(z))
    return sign * ratio, np.maximum(ratio * (ratio + z), 1e-12)


def _covariance(
    a: Floats, b: Floats, categorical: NDArray[np.bool_], plane: float, bump: float, length: float
) -> Floats:
    numeric = ~categorical
    found = 1.0 + plane * (1.0 + (2.0 * a[:, numeric] - 1.0) @ (2.0 * b[:, numeric] - 1.0).T)
    return np.asarray(found + bump * _bump(a, b, categorical, length) if bump else found)


def _own(unit: Floats, categorical: NDArray[np.bool_], plane: float, bump: float) -> Floats:
    centred = 2.0 * unit[:, ~categorical] - 1.0
    return np.asarray(1.0 + plane * (1.0 + (centred**2).sum(axis=1)) + bump)


def _bump(a: Floats, b: Floats, categorical: NDArray[np.bool_], length: float) -> Floats:
    squares = np.zeros((len(a), len(b)))
    for j, unordered in enumerate(categorical):
        apart = a[:, None, j] - b[None, :, j]
        squares += (apart != 0.0) if unordered else apart**2
    return np.asarray(np.exp(-0.5 * squares / length**2))
