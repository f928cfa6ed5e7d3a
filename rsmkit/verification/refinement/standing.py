"""How runs compare: feasible ones inside the bounds by their objective, then the others by violation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rsmkit.language.space import Floats
from rsmkit.optimum.problem import Evaluation, Problem, least_margins

__all__ = ["allowed_runs", "merits", "missed_by"]


def allowed_runs(problem: Problem, known: Evaluation) -> NDArray[np.bool_]:
    """Which runs succeeded, lie inside the bounds and satisfy every constraint, shape (n,)."""
    with np.errstate(invalid="ignore"):
        held = (known.margins >= least_margins(known)).all(axis=1)
    return np.asarray(known.succeeded & problem.space.contains(known.points) & held, bool)


def missed_by(known: Evaluation) -> Floats:
    """Sum of violations, each in units of the usual size of its margin, shape (n,); inf for failed runs."""
    alive = known.succeeded
    size = np.median(np.abs(known.margins[alive]), axis=0) if alive.any() else 1.0
    missed = (np.maximum(0.0, -known.margins) / np.maximum(size, 1e-300)).sum(axis=1)
    return np.where(alive, missed, np.inf)


def merits(problem: Problem, known: Evaluation, values: Floats) -> Floats:
    """Put runs in order by `values`, shape (n,), of their objective: less is better.

    Infeasible runs stand behind all feasible ones; failed ones and those outside the bounds are infinite.
    """
    alive = known.succeeded
    if not alive.any():
        return np.full(len(known), np.inf)
    span = float(np.ptp(values[alive])) or 1.0
    behind = float(values[alive].max()) + span * (1.0 + missed_by(known))
    found = np.where(allowed_runs(problem, known), values, behind)
    return np.where(alive & problem.space.contains(known.points), found, np.inf)
