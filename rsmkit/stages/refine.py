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
from rsmkit.io.digests import digest
from rsmkit.io.json_codec import from_json, read_json, to_json, write_json
from rsmkit.language.space import Floats
from rsmkit.optimum.problem import Problem
from rsmkit.runs.record.run_progress import Watcher
from rsmkit.stages.evaluate import HowToRun, run_points
from rsmkit.stages.fit import OPTIMUM_FILE, load_fit
from rsmkit.stages.posing import noise_means, pose
from rsmkit.study.file import Study
from rsmkit.verification.refinement.refinement import Refinement, RefinementRecord, Wave
from rsmkit.verification.refinement.waves import refine

__all__ = ["RefineResult", "current_refinements", "refine_study", "simulator_problem"]

REFINEMENT_FILE = "refinement.json"
REDO = "Run: rsmkit verify --refine"


@dataclass(frozen=True)
class RefineResult:
    """The refinement of every search with one objective."""

    refinements: dict[str, Refinement]
    path: Path

    def overview(self) -> dict[str, Any]:
        """What ``--json`` prints, and what ``refinement.json`` holds."""
        return {"searches": {name: to_json(found.record()) for name, found in self.refinements.items()}}


def refine_study(
    study: Study,
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
    fitted = load_fit(study)
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
        problem = simulator_problem(study, optimum.name, how, on_event=on_event)
        verified = problem.evaluator(optimum.point[None])
        start = problem.evaluation(
            np.vstack([fitted.runs.points, optimum.point]),
            {name: np.append(fitted.runs.y(name), verified[name]) for name in study.responses},
        )

        def tell(wave: Wave, name: str = optimum.name) -> None:
            if on_wave:
                on_wave(name, wave)

        refinements[optimum.name] = refine(problem, start, options.refine, on_wave=tell)
    result = RefineResult(refinements, study.folder / REFINEMENT_FILE)
    write_json(result.path, {"schema": 1, "made_from": _made_from(study), **result.overview()})
    return result


def current_refinements(study: Study) -> dict[str, RefinementRecord]:
    """Read the refinements of the present optima by search; empty when there are none, or older ones."""
    path = study.folder / REFINEMENT_FILE
    if not path.is_file():
        return {}
    record = read_json(path, REDO)
    if record.get("made_from") != _made_from(study):
        return {}
    return from_json(_Refinements, record, path, REDO).searches


@dataclass(frozen=True)
class _Refinements:
    """What the file holds."""

    searches: dict[str, RefinementRecord]


def _made_from(study: Study) -> dict[str, str]:
    return {"optimum": digest(read_json(study.folder / OPTIMUM_FILE, "Run: rsmkit fit --force"))}


def simulator_problem(
    study: Study, search: str, how: HowToRun | None = None, *, on_event: Watcher | None = None
) -> Problem:
    """Put one search of the study file on the true simulator; a failed run gives nan."""
    how = replace(how or HowToRun(), only=None, limit=None)

    def fly(points: Floats) -> dict[str, Floats]:
        runs = run_points(study, np.atleast_2d(points), how, on_event=on_event).runs
        if not runs.done.any():
            return dict.fromkeys(study.responses, np.full(len(runs), np.nan))
        return {name: runs.y(name) for name in study.responses}

    return pose(study, search, fly)
