"""The full likelihood of runs in random groups, which compares models of different terms.

Restricted likelihoods of different terms are likelihoods of different data, so that they rank nothing
(Pinheiro & Bates, *Mixed-Effects Models in S and S-PLUS*, 2000, section 2.4.1).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.linalg import cho_solve
from scipy.optimize import minimize

from rsmkit.language.space import Floats

__all__ = ["full_deviance"]

STARTS = (0.0, 0.3, 3.0)
"""Square roots of the ratios, times the root of the runs per group, from which a minimum is looked for."""


def full_deviance(matrix: Floats, y: Floats, columns: Sequence[Floats]) -> float:
    """Minus twice the largest log-likelihood over coefficients and variances.

    Parameters
    ----------
    matrix : array, shape (n, p)
    y : array, shape (n,)
    columns : sequence of array, shape (n, q_i)
        Z of each kind of groups. With weights all three are times their square root, and the deviance lacks
        minus the sum of the logarithms of the weights.
    """
    n = len(y)
    start = np.linalg.lstsq(matrix, y, rcond=None)[0]
    basis = np.linalg.qr(matrix)[0]
    both = np.column_stack([basis, y - matrix @ start])
    z = np.hstack(list(columns))
    owner = np.repeat(np.arange(len(columns)), [item.shape[1] for item in columns])
    within, across, whole = z.T @ z, z.T @ both, both.T @ both
    sizes = np.array([n / item.shape[1] for item in columns])

    def deviance(roots: Floats) -> float:
        scale = roots[owner] / np.sqrt(sizes[owner])
        inner = np.eye(len(scale)) + scale[:, None] * within * scale
        upper = np.linalg.cholesky(inner)
        moved = scale[:, None] * across
        left = whole - moved.T @ cho_solve((upper, True), moved)
        fixed = left[:-1, :-1]
        rest = float(left[-1, -1] - left[-1, :-1] @ np.linalg.solve(fixed, left[:-1, -1]))
        log_det = 2.0 * float(np.log(np.diag(upper)).sum())
        return n * (math.log(2.0 * math.pi * max(rest, 1e-300) / n) + 1.0) + log_det

    best = math.inf
    for first in STARTS:
        found = minimize(
            deviance,
            np.full(len(columns), first + 1e-3),
            method="L-BFGS-B",
            bounds=[(0.0, None)] * len(columns),
        )
        best = min(best, float(found.fun), deviance(np.zeros(len(columns))))
    return best
