"""Bias-reduced estimates of counts, finite also where the runs are separated.

The likelihood times the root of the determinant of the information (Firth, Biometrika 80, 1993) has a maximum
where the likelihood itself rises for ever; it takes the first-order bias out of the estimates. Tests compare
its maxima (Heinze & Schemper, Statistics in Medicine 21, 2002).
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize

from rsmkit.errors import FitError
from rsmkit.language.space import Floats
from rsmkit.surfaces.estimation.counts.scoring import Distribution

__all__ = ["penalised_score"]

PASSES = 100
SETTLED = 1e-11
"""Change of the linear predictor, in standard errors, at which the iteration ends."""


def penalised_score(
    family: Distribution,
    matrix: Floats,
    y: Floats,
    size: Floats,
    free: Floats | None = None,
) -> tuple[Floats, float]:
    """Coefficients at the maximum of the penalised likelihood, and minus twice its logarithm.

    That is the deviance less ``log|X'WX|``, W the weights of the runs. Each step is one of scoring on counts
    to which half the leverage of each run is added, of binomial trials the whole leverage.

    Parameters
    ----------
    family : Distribution
        With its canonical link.
    matrix : array, shape (n, p)
        X, whose information is the penalty.
    y, size : array, shape (n,)
        Counts, and trials or exposures.
    free : array, shape (n, m), optional
        Columns whose coefficients are estimated, those of `matrix` when left out; a test has fewer.

    Raises
    ------
    FitError
        When the iteration does not settle.
    """
    columns = matrix if free is None else free
    added = 1.0 if family.link == "logit" else 0.0

    def judged(beta: Floats) -> tuple[float, Floats, Floats, Floats]:
        """Minus twice the penalised log-likelihood, means, weights and leverages."""
        mean = family.mean(columns @ beta)
        weight = np.maximum(size * family.spread(mean), 1e-300)
        q, r = np.linalg.qr(matrix * np.sqrt(weight)[:, None])
        value = float(family.deviance(y, size, mean).sum()) - 2.0 * float(np.log(np.abs(np.diag(r))).sum())
        return value, mean, weight, np.einsum("ij,ij->i", q, q)

    def criterion(beta: Floats) -> tuple[float, Floats]:
        value, mean, _, leverage = judged(beta)
        pull = y + 0.5 * leverage - (size + added * leverage) * mean
        return value, -2.0 * columns.T @ pull

    beta = np.zeros(columns.shape[1])
    value, mean, weight, leverage = judged(beta)
    for _ in range(PASSES):
        pull = y + 0.5 * leverage - (size + added * leverage) * mean
        root = np.sqrt(weight)
        step = np.linalg.lstsq(columns * root[:, None], pull / root, rcond=None)[0]
        if np.linalg.norm(root * (columns @ step)) <= SETTLED * (1.0 + np.linalg.norm(root)):
            return beta, value
        tried = judged(beta + step)
        if tried[0] > value + 1e-12 * (1.0 + abs(value)):
            break
        beta, (value, mean, weight, leverage) = beta + step, tried
    # Where hardly a run tells anything, the penalty bends more than the information says: scoring overshoots.
    found = minimize(criterion, beta, jac=True, method="BFGS", options={"gtol": 1e-9})
    if not np.abs(found.jac).max() <= 1e-5 * (1.0 + np.abs(columns).sum(axis=0).max()):
        raise FitError("the bias-reduced estimates do not settle; leave terms out, or add runs")
    return np.asarray(found.x), float(found.fun)
