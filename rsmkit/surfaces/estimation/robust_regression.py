"""Regression that a few wrong runs cannot turn: Huber's M estimate and the MM estimate.

The M estimate with Huber's norm and the median absolute deviation (Huber, *Robust Statistics*, 1981) is that
of statsmodels, ``RLM``: it withstands wild responses, not wild responses at far-out points. The MM estimate
(Yohai, *Annals of Statistics* 15 (1987), 642-656) withstands both: an S estimate with the bisquare norm gives
start and scale (Salibian-Barrera & Yohai, *J. Comput. Graph. Statist.* 15 (2006), 414-427), a bisquare M step
with 95 % efficiency the coefficients; their covariance is that of Croux, Dhaene & Hoorelbeke (2003), as in
R's ``lmrob``.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from itertools import combinations
from math import comb
from typing import Literal

import numpy as np

from rsmkit.errors import FitError
from rsmkit.io.shown import Shown
from rsmkit.language.space import Floats

__all__ = ["ROBUST", "RobustFit", "RobustMethod", "robust_fit"]

RobustMethod = Literal["huber", "mm"]

SCALE_CUT = 1.54764
"""Bisquare norm of the S estimate: half of the runs may be wrong."""
COEFFICIENT_CUT = 4.685061
"""Bisquare norm of the M step: 95 % efficiency for normal errors."""
HALF = 0.5
"""Average of the S estimate's norm, which makes the scale consistent for normal errors."""
SUBSETS = 500
"""Elementary subsets from which the S estimate starts; all there are if these are fewer."""
FINALISTS = 10
FIRST_STEPS = 2
STEPS = 1_000
SOME_STEPS = 30
TOLERANCE = 1e-12
SEED = 1987


@dataclass(frozen=True)
class RobustFit(Shown):
    """A robust regression.

    Parameters
    ----------
    method : {"huber", "mm"}
    coefficients : array, shape (p,)
    covariance : array, shape (p, p)
    scale : float
        Robust standard deviation of the residuals.
    weights : array, shape (n,)
        How much each run counts, from 0 to 1.
    """

    method: RobustMethod
    coefficients: Floats
    covariance: Floats
    scale: float
    weights: Floats


def robust_fit(matrix: Floats, y: Floats, method: RobustMethod) -> RobustFit:
    """Fit robustly; rows are scaled by the root of their weights beforehand.

    Raises
    ------
    FitError
        Without degrees of freedom, or if so many runs are fitted exactly that there is no scale.
    """
    n, p = matrix.shape
    if n < p + 2:
        raise FitError(f"a robust fit of {p} coefficients needs at least {p + 2} runs, there are {n}")
    return ROBUST[method](matrix, y)


def _huber(matrix: Floats, y: Floats) -> RobustFit:
    from statsmodels.robust.norms import HuberT
    from statsmodels.robust.robust_linear_model import RLM

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it warns where the scale is zero, which is refused below
        found = RLM(y, matrix, M=HuberT()).fit(conv="coefs", tol=TOLERANCE, maxiter=STEPS, cov="H1")
    if not found.scale > _rounding(y):
        raise FitError(NO_SCALE)
    return RobustFit(
        "huber",
        np.asarray(found.params, float),
        np.asarray(found.bcov_scaled, float),
        float(found.scale),
        np.asarray(found.weights, float),
    )


def _mm(matrix: Floats, y: Floats) -> RobustFit:
    start, scale = _s_estimate(matrix, y)
    beta = start
    for _ in range(STEPS):
        weights = _bisquare_weights((y - matrix @ beta) / scale, COEFFICIENT_CUT)
        before, beta = beta, _weighted(matrix, y, weights)
        if np.abs(matrix @ (beta - before)).max() <= TOLERANCE * scale:
            break
    residuals = y - matrix @ beta
    weights = _bisquare_weights(residuals / scale, COEFFICIENT_CUT)
    covariance = _mm_covariance(matrix, residuals / scale, (y - matrix @ start) / scale, scale)
    return RobustFit("mm", beta, covariance, scale, weights)


ROBUST = {"huber": _huber, "mm": _mm}
"""The methods by name."""
NO_SCALE = (
    "so many runs are fitted exactly that the others have no scale to be judged by; leave the robust fit out"
)


def _s_estimate(matrix: Floats, y: Floats) -> tuple[Floats, float]:
    """Coefficients whose residuals have the smallest M scale, and that scale."""
    count = len(y) - matrix.shape[1]
    betas = np.array([np.linalg.solve(matrix[rows], y[rows]) for rows in _subsets(matrix)])
    scales = _m_scales(y - betas @ matrix.T, count)
    for _ in range(FIRST_STEPS):
        weights = _bisquare_weights(
            (y - betas @ matrix.T) / np.maximum(scales, _rounding(y))[:, None], SCALE_CUT
        )
        moved = np.array([_weighted(matrix, y, row) for row in weights])
        betas = np.where(scales[:, None] > 0, moved, betas)
        scales = _m_scales(y - betas @ matrix.T, count)
    places = np.argsort(scales)[:FINALISTS]
    finalists = [_descend(matrix, y, betas[i], float(scales[i]), SOME_STEPS) for i in places]
    return _descend(matrix, y, *min(finalists, key=lambda pair: pair[1]), STEPS)


def _descend(matrix: Floats, y: Floats, beta: Floats, scale: float, steps: int) -> tuple[Floats, float]:
    """Lower the M scale of the residuals by reweighting until it stays, or for so many steps."""
    for _ in range(steps):
        if not scale > _rounding(y):
            raise FitError(NO_SCALE)
        before = beta
        beta = _weighted(matrix, y, _bisquare_weights((y - matrix @ beta) / scale, SCALE_CUT))
        scale = float(_m_scales((y - matrix @ beta)[None], len(y) - matrix.shape[1])[0])
        if np.abs(matrix @ (beta - before)).max() <= TOLERANCE * scale:
            break
    return beta, scale


def _subsets(matrix: Floats) -> list[list[int]]:
    """Rows that determine the coefficients: all such subsets, or random ones."""
    n, p = matrix.shape
    if comb(n, p) <= SUBSETS:
        return [list(rows) for rows in combinations(range(n), p) if _is_regular(matrix[list(rows)])]
    random = np.random.default_rng(SEED)
    return [_regular_rows(matrix, random.permutation(n).tolist()) for _ in range(SUBSETS)]


def _is_regular(square: Floats) -> bool:
    values = np.linalg.svd(square, compute_uv=False)
    return bool(values[-1] > 1e-9 * values[0])


def _regular_rows(matrix: Floats, order: list[int]) -> list[int]:
    """The first rows in a given order that do not depend on those before them."""
    basis = np.empty((0, matrix.shape[1]))
    rows: list[int] = []
    for i in order:
        rest = matrix[i] - (matrix[i] @ basis.T) @ basis
        rest -= (rest @ basis.T) @ basis
        length = np.linalg.norm(rest)
        if length > 1e-6 * np.linalg.norm(matrix[i]):
            basis, rows = np.vstack([basis, rest / length]), [*rows, i]
            if len(rows) == matrix.shape[1]:
                break
    return rows


def _m_scales(residuals: Floats, count: int) -> Floats:
    """Scale of each row at which the S estimate's norm adds to half of `count`, shape (rows,).

    0 where too few residuals differ from zero. Newton's method, its steps limited to a factor of two.
    """
    sizes: Floats = np.abs(residuals)
    real = (sizes > 1e-14 * sizes.max(axis=1, keepdims=True)).sum(axis=1) > HALF * count
    scales = np.asarray(np.where(real, np.median(sizes, axis=1), 0.0), float)
    scales = np.asarray(np.where(real & (scales <= 0), sizes.max(axis=1), scales), float)
    for _ in range(STEPS):
        with np.errstate(invalid="ignore", divide="ignore"):
            u = residuals / scales[:, None]
            excess = _bisquare_rho(u).sum(axis=1) - HALF * count
            factor = 1.0 + excess / (u * _rho_slope(u)).sum(axis=1)
        factor = np.where(np.isfinite(factor), np.clip(factor, 0.5, 2.0), np.where(excess > 0, 2.0, 0.5))
        scales = np.asarray(np.where(real, scales * factor, 0.0), float)
        if (np.abs(factor - 1.0)[real] <= 1e-13).all():
            break
    return scales


def _weighted(matrix: Floats, y: Floats, weights: Floats) -> Floats:
    root = np.sqrt(weights)
    return np.asarray(np.linalg.lstsq(matrix * root[:, None], y * root, rcond=None)[0], float)


def _bisquare_rho(u: Floats) -> Floats:
    """Bisquare norm of the S estimate, at most 1."""
    inside = np.minimum((u / SCALE_CUT) ** 2, 1.0)
    rho: Floats = inside * (3.0 + inside * (inside - 3.0))
    return rho


def _rho_slope(u: Floats) -> Floats:
    """Derivative of :func:`_bisquare_rho`."""
    slope: Floats = 6.0 / SCALE_CUT**2 * u * _bisquare_weights(u, SCALE_CUT)
    return slope


def _bisquare_weights(u: Floats, cut: float) -> Floats:
    weights: Floats = np.maximum(1.0 - (u / cut) ** 2, 0.0) ** 2
    return weights


def _mm_covariance(matrix: Floats, u: Floats, start: Floats, scale: float) -> Floats:
    """Covariance without assuming symmetric errors, from both estimating equations (Croux and others 2003).

    Parameters
    ----------
    u, start : array, shape (n,)
        Residuals of the MM and of the S estimate in units of the scale.
    """
    n = len(u)
    psi = u * _bisquare_weights(u, COEFFICIENT_CUT)
    inside = (u / COEFFICIENT_CUT) ** 2
    slope = np.where(inside < 1.0, (1.0 - inside) * (1.0 - 5.0 * inside), 0.0)
    rho = _bisquare_rho(start)
    inverse = scale * np.linalg.inv(matrix.T @ (matrix * slope[:, None]) / n)
    by_scale = inverse @ (matrix.T @ (slope * u) / n) / float(np.mean(_rho_slope(start) * start))
    scores = (matrix * psi[:, None]) @ inverse.T
    mixed = np.outer(rho @ scores, by_scale)
    by_both = (float(rho @ rho) - n * HALF**2) * np.outer(by_scale, by_scale)
    covariance: Floats = (scores.T @ scores - mixed - mixed.T + by_both) / n**2
    return covariance


def _rounding(y: Floats) -> float:
    return 1e-12 * float(np.abs(y).max())
