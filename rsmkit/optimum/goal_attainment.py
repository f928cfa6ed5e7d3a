"""Goal attainment: move several objectives towards goals in given proportions.

Minimise ``gamma`` over the factors and ``gamma`` itself, subject to ``F_j(x) - w_j gamma <= goal_j`` and the
problem's constraints (Gembicki and Haimes, IEEE Transactions on Automatic Control 20, 1975). A negative
``gamma`` means that every goal is more than reached.
"""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from scipy.optimize import minimize

from rsmkit.language.space import Floats
from rsmkit.optimum.local.local_search import Local, LocalSearch
from rsmkit.optimum.local.polish import pull_back
from rsmkit.optimum.problem import Archive, Evaluation

__all__ = ["attain_goals"]


def attain_goals(
    archive: Archive, start: Floats, goal: Floats, weights: Floats, settings: LocalSearch | None = None
) -> tuple[Evaluation, float]:
    """Attain goals as far as possible, by SLSQP from one point.

    Parameters
    ----------
    archive : Archive
        Problem and memory; at least one point must have been evaluated.
    start : ndarray, shape (k,)
        Natural units.
    goal, weights : ndarray, shape (m,)
        In the units of the objectives; weights positive (the range of the front makes objectives comparable).
    settings : LocalSearch, optional
        Differences.

    Returns
    -------
    tuple of Evaluation and float
        The point reached (one row) and its ``gamma``.
    """
    local = Local(archive, start, settings or LocalSearch())
    target = (goal - local.offset) / local.size
    share = weights / local.size

    def attained(objectives: Floats) -> float:
        return float(((objectives - target) / share).max())

    def margins(z: Floats) -> Floats:
        here = local.linearise(z[:-1])
        values: Floats = np.r_[target + share * z[-1] - here.objectives, here.margins]
        return values

    def slopes(z: Floats) -> Floats:
        here = local.linearise(z[:-1])
        of_gamma = np.r_[share, np.zeros(len(here.margins))]
        matrix: Floats = np.column_stack([np.vstack([-here.slopes, here.margin_slopes]), of_gamma])
        return matrix

    def gamma(z: Floats) -> float:
        return float(z[-1])

    def gamma_slope(z: Floats) -> Floats:
        direction = np.zeros(len(z))
        direction[-1] = 1.0
        return direction

    first: Floats = np.r_[local.begin, attained(local.linearise(local.begin).objectives)]
    constraints: Any = {"type": "ineq", "fun": margins, "jac": slopes}
    with warnings.catch_warnings():
        warnings.simplefilter(
            "ignore", RuntimeWarning
        )  # steps a rounding error outside the bounds are clipped
        found = minimize(
            gamma,
            first,
            jac=gamma_slope,
            bounds=[*[(0.0, 1.0)] * len(local.begin), (-np.inf, np.inf)],
            method="SLSQP",
            constraints=constraints,
            options={"maxiter": 200, "ftol": 1e-15},
        )
    reached = pull_back(local, np.clip(np.nan_to_num(found.x[:-1], nan=0.5), 0.0, 1.0))
    return reached, float(((reached.objectives[0] - goal) / weights).max())
