"""What the runs say of the objectives of a search with several: true values, and which of them are beaten."""

from __future__ import annotations

from typing import Any

import numpy as np

from rsmkit.language.space import Floats
from rsmkit.optimum.optimum import Optimum
from rsmkit.optimum.pareto_front import nondominated
from rsmkit.optimum.problem import build_problem
from rsmkit.report.findings import Findings

__all__ = ["trade_off"]


def trade_off(findings: Findings, optimum: Optimum, every: int) -> dict[str, Any] | None:
    """Collect it as JSON values, of every so manieth run; None where no run has a true value of an objective.

    ``objectives`` has one row for each run, ``state`` says of each whether it is "best" (no feasible run
    beats it in every objective), "dominated", "infeasible" or "unknown".
    """
    if len(optimum.minimize) < 2 or {"robust", "service"} & set(optimum.settings):
        return None
    runs = findings.runs
    problem = build_problem(
        findings.space,
        optimum.minimize,
        lambda x: {name: surface.predict(x) for name, surface in findings.surfaces.items()},
        responses=tuple(findings.surfaces),
        subject_to=optimum.subject_to,
        functions=findings.functions,
    )
    known = problem.evaluation(runs.points, {name: runs.y(name) for name in findings.surfaces})
    feasible = known.succeeded & (known.margins >= 0.0).all(axis=1)
    state = np.where(known.succeeded, "infeasible", "unknown").astype(object)
    state[feasible] = "dominated"
    kept = np.flatnonzero(feasible)
    if len(kept):
        state[kept[nondominated(known.objectives[kept])]] = "best"
    return {
        "objectives": [_numbers(row) for row in known.objectives[::every]],
        "state": state[::every].tolist(),
    }


def _numbers(row: Floats) -> list[float | None]:
    return [value if np.isfinite(value) else None for value in row.tolist()]
