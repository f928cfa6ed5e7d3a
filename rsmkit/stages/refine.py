"""``rsmkit verify --refine``: true runs around each optimum until no model promises a gain.

Writes ``refinement.json``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from rsmkit.errors import StageError
from rsmkit.io.arguments import checked
from rsmkit.io.json_codec import to_json
from rsmkit.language.space import Floats
from rsmkit.optimum.problem import Problem
from rsmkit.runs.how_to_run import HowToRun
from rsmkit.runs.record.run_progress import Watcher
from rsmkit.stages.evaluate import run_points
from rsmkit.study.folder import StudyFolder
from rsmkit.study.posing import noise_means, pose
from rsmkit.verification.refinement.refinement import Refinement, Wave
from rsmkit.verification.refinement.waves import refine_problem

__all__ = ["RefineResult", "refine_study", "simulator_problem"]


@dataclass(frozen=True)
class RefineResult:
    """The refinement of every search with one objective."""

    refinements: dict[str, Refinement]
    path: Path

    def overview(self) -> dict[str, Any]:
        """What ``--json`` prints."""
        return {"searches": {name: to_json(found.record()) for name, found in self.refinements.items()}}


@checked
def refine_study(
    folder: StudyFolder,
    how: HowToRun | None = None,
    *,
    on_event: Watcher | None = None,
    on_wave: Callable[[str, Wave], None] | None = None,
) -> RefineResult:
    """Refine the optimum of every verified search with one objective on the true simulator.

    Every run goes through the journal: started again after an interruption it repeats nothing.

    Raises
    ------
    StageError
        If there is no up-to-date fit, or no search with one objective.
    """
    study, fitted = folder.study, folder.fitted()
    options = study.file.verify
    chosen = [
        optimum
        for optimum in fitted.optima
        if len(optimum.minimize) == 1
        and not noise_means(study, optimum.name)
        and (not options.searches or optimum.name in options.searches)
    ]
    if not chosen:
        raise StageError(
            "the study has no search with one objective that is not robust, so there is nothing to refine"
        )
    refinements = {}
    for optimum in chosen:
        problem = simulator_problem(folder, optimum.name, how, on_event=on_event)
        verified = problem.evaluator(optimum.point[None])
        start = problem.evaluation(
            np.vstack([fitted.runs.points, optimum.point]),
            {name: np.append(fitted.runs.y(name), verified[name]) for name in study.responses},
        )

        def tell(wave: Wave, name: str = optimum.name) -> None:
            if on_wave:
                on_wave(name, wave)

        refinements[optimum.name] = refine_problem(problem, start, options.refine, on_wave=tell)
    path = folder.keep_refinements({name: found.record() for name, found in refinements.items()})
    return RefineResult(refinements, path)


def simulator_problem(
    folder: StudyFolder, search: str, how: HowToRun | None = None, *, on_event: Watcher | None = None
) -> Problem:
    """Put one search of the study file on the true simulator; a failed run gives nan."""
    responses = folder.study.responses
    how = replace(how or HowToRun(), only=None, limit=None)

    def fly(points: Floats) -> dict[str, Floats]:
        x = np.atleast_2d(points)
        runs = run_points(folder, x, how, on_event=on_event).runs
        if not runs.done.any():
            return dict.fromkeys(responses, np.full(len(x), np.nan))
        return {name: _means(runs.y(name).reshape(len(x), -1)) for name in responses}

    return pose(folder.study, search, fly)


def _means(replicates: Floats) -> Floats:
    """Mean of the replicates that succeeded, shape (n, replicates) to (n,); nan where none did."""
    done = np.isfinite(replicates)
    with np.errstate(invalid="ignore"):
        means: Floats = np.where(done, replicates, 0.0).sum(axis=1) / done.sum(axis=1)
    return means
