"""The verify stage: the true simulator at every optimum (``verification.json``)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from rsmkit.errors import RunsFailedError, StageError
from rsmkit.io.arguments import checked
from rsmkit.io.json_codec import to_json
from rsmkit.language.space import Floats
from rsmkit.optimum.optimum import Optimum
from rsmkit.optimum.robust import spread_points
from rsmkit.runs.how_to_run import HowToRun
from rsmkit.runs.record.run_progress import Watcher
from rsmkit.stages.evaluate import run_points
from rsmkit.stages.fit import surface_problem
from rsmkit.stages.refine import simulator_problem
from rsmkit.study.file import Study
from rsmkit.study.folder import VERIFICATION_FILE, Fitted, StudyFolder
from rsmkit.study.posing import noise_means, search_options
from rsmkit.verification.judge import judge_optimum
from rsmkit.verification.options import VerifyOptions
from rsmkit.verification.verification import SimulatorRuns, Verification

__all__ = ["VerifyResult", "verify_study"]


@dataclass(frozen=True)
class VerifyResult:
    """What the simulator said about the optima."""

    verification: Verification
    tolerance_pct: float
    path: Path
    fresh: bool

    @property
    def within_tolerance(self) -> bool:
        """Whether every objective is predicted within the tolerance."""
        return self.verification.within(self.tolerance_pct)

    def overview(self) -> dict[str, Any]:
        """What ``--json`` prints."""
        return {
            "stage": "verify",
            "skipped": self.fresh,
            "file": str(self.path),
            "tolerance_pct": self.tolerance_pct,
            "within_tolerance": self.within_tolerance,
            **to_json(self.verification),
        }


@checked
def verify_study(
    folder: StudyFolder,
    how: HowToRun | None = None,
    *,
    tolerance_pct: float | None = None,
    force: bool = False,
    on_event: Watcher | None = None,
) -> VerifyResult:
    """Run the simulator at the optima and compare, unless that is up to date.

    Raises
    ------
    StageError
        If there is no up-to-date fit, or the study names no search.
    RunsFailedError
        If the simulator fails at an optimum.
    """
    options = folder.study.file.verify
    if tolerance_pct is not None:
        options = replace(options, tolerance_pct=tolerance_pct)
    fitted = folder.fitted()
    if not force and folder.verify_problem(options) is None:
        verification = folder.verification(options)
        return VerifyResult(verification, options.tolerance_pct, folder.path / VERIFICATION_FILE, fresh=True)
    verification = _verify(folder, fitted, options, how or HowToRun(), on_event)
    path = folder.keep_verification(verification, options)
    return VerifyResult(verification, options.tolerance_pct, path, fresh=False)


def _verify(
    folder: StudyFolder, fitted: Fitted, options: VerifyOptions, how: HowToRun, on_event: Watcher | None
) -> Verification:
    """Run the simulator at the chosen optima and judge each."""
    study = folder.study
    chosen = _chosen(fitted, options)
    points = np.vstack([_points_to_run(study, optimum) for optimum in chosen])
    how = replace(how, retry_failed=True)
    evaluation = run_points(folder, points, how, on_event=on_event)
    if evaluation.failed:
        raise RunsFailedError(
            f"the simulator failed at {evaluation.failed} of {evaluation.distinct} points to verify "
            f"({evaluation.errors[0]}). Repair it, then run: rsmkit verify"
        )
    design = {name: fitted.runs.y(name) for name in study.responses}
    own = {**fitted.surfaces, **fitted.objective_surfaces}
    confirmations = []
    for optimum in chosen:
        problem = surface_problem(study, fitted.surfaces, optimum.name)
        known, surfaces = design, fitted.surfaces
        if noise_means(study, optimum.name):  # no single run tells how much a robust objective varies
            known = {**design, **dict.fromkeys(optimum.minimize, np.full(len(fitted.runs), np.nan))}
            surfaces = {}
        confirmations.append(
            judge_optimum(
                problem,
                optimum,
                _actual(folder, optimum, how),
                surfaces=surfaces,
                objective_surfaces={text: own[text] for text in optimum.minimize if text in own},
                design=problem.evaluation(fitted.runs.points, known),
                options=options,
            )
        )
    return Verification(tuple(confirmations), SimulatorRuns(len(fitted.runs), evaluation.distinct))


def _points_to_run(study: Study, optimum: Optimum) -> Floats:
    """The optimum's candidates; of a robust search at every node of its noise factors."""
    points = np.array([candidate.point for candidate in optimum.candidates])
    robust = search_options(study, optimum.name).robust
    return spread_points(study.space, robust, points) if robust else points


def _actual(folder: StudyFolder, optimum: Optimum, how: HowToRun) -> list[dict[str, float]]:
    """What the simulator says of each candidate, from the runs just made."""
    points = np.array([candidate.point for candidate in optimum.candidates])
    found = simulator_problem(folder, optimum.name, how).evaluator(points)
    return [{name: float(column[row]) for name, column in found.items()} for row in range(len(points))]


def _chosen(fitted: Fitted, options: VerifyOptions) -> list[Optimum]:
    chosen = [o for o in fitted.optima if not options.searches or o.name in options.searches]
    if not chosen:
        raise StageError("the study names no search, so there is nothing to verify. Add a [[search]] table")
    return chosen
