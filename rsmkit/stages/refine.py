"""``rsmkit verify --refine``: true runs until nothing promises a better optimum, or a larger front.

Writes ``refinement.json``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from rsmkit.errors import StageError
from rsmkit.io.arguments import checked
from rsmkit.io.json_codec import to_json
from rsmkit.io.shown import Shown
from rsmkit.language.space import Floats, Space
from rsmkit.optimum.optimum import Optimum
from rsmkit.optimum.problem import Evaluation, Problem
from rsmkit.optimum.service.robust import pinned
from rsmkit.runs.how_to_run import HowToRun
from rsmkit.runs.record.run_progress import Watcher
from rsmkit.stages.evaluate import run_points
from rsmkit.study.counts import as_rates
from rsmkit.study.file import Study
from rsmkit.study.folder import REFINEMENT_FILE, StudyFolder
from rsmkit.study.posing import noise_means, pose, runs_each, search_options
from rsmkit.verification.judge import RefinedVerdict, judge_refinement
from rsmkit.verification.options import VerifyOptions
from rsmkit.verification.refinement.refinement import Refinement, RefinementRecord, Wave
from rsmkit.verification.refinement.waves import refine_problem
from rsmkit.verification.verdicts import unacceptable

__all__ = ["RefineResult", "refine_study", "simulator_problem"]

FEW = 4
"""Runs that tell a spread at least."""


@dataclass(frozen=True)
class RefineResult(Shown):
    """The refinement of every search."""

    refinements: dict[str, Refinement]
    verdicts: dict[str, RefinedVerdict]
    path: Path

    def overview(self) -> dict[str, Any]:
        """What ``--json`` prints."""
        return {"searches": {name: to_json(record) for name, record in self.records().items()}}

    def records(self) -> dict[str, RefinementRecord]:
        """What ``refinement.json`` keeps of each."""
        return {
            name: replace(
                found.record(), verdict=self.verdicts[name].verdict, sentence=self.verdicts[name].sentence
            )
            for name, found in self.refinements.items()
        }


@checked
def refine_study(
    folder: StudyFolder,
    how: HowToRun | None = None,
    *,
    on_event: Watcher | None = None,
    on_wave: Callable[[str, Wave], None] | None = None,
) -> RefineResult:
    """Refine the optimum, or the front, of every search on the true simulator.

    Every run goes through the journal: started again after an interruption it repeats nothing. What one
    search has run is known to the next.

    Raises
    ------
    StageError
        If there is no up-to-date fit, or no search.
    """
    study, fitted, how = folder.study, folder.fitted(), how or HowToRun()
    options = study.file.verify
    wanted = options.searches
    chosen = [optimum for optimum in fitted.optima if not wanted or optimum.name in wanted]
    if not chosen:
        raise StageError("the study names no search, so there is nothing to refine. Add a [[search]] table")
    refinements: dict[str, Refinement] = {}
    verdicts: dict[str, RefinedVerdict] = {}
    made = [candidate.point for optimum in chosen for candidate in optimum.candidates]
    for optimum in chosen:
        problem = simulator_problem(folder, optimum.name, how, on_event=on_event)
        means = noise_means(study, optimum.name)
        budget = options.refine
        if how.jobs is not None and how.jobs > budget.batch:
            budget = replace(budget, batch=how.jobs)
        cost = runs_each(study, optimum.name)
        if means:
            start, problem = _robust_start(study, optimum, problem)
        elif search_options(study, optimum.name).service is not None:
            start = problem.evaluate(np.array([candidate.point for candidate in optimum.candidates]))
        else:
            start = _start(folder, problem, np.array(made))

        def tell(wave: Wave, name: str = optimum.name) -> None:
            if on_wave:
                on_wave(name, wave)

        found = refine_problem(
            problem,
            start,
            budget,
            cost=cost,
            tolerance_pct=options.tolerance_pct,
            deterministic=study.deterministic,
            on_wave=tell,
        )
        unwanted = unacceptable(problem, optimum, found.best)
        if means:
            found = _whole(found, study.space, means)
        elif cost == 1:
            made += [point for wave in found.waves for point in wave.points]
        refinements[optimum.name] = found
        verdicts[optimum.name] = _verdict(optimum, found, options, unwanted)
    result = RefineResult(refinements, verdicts, folder.path / REFINEMENT_FILE)
    folder.keep_refinements(result.records())
    return result


def _verdict(optimum: Optimum, found: Refinement, options: VerifyOptions, unwanted: str) -> RefinedVerdict:
    """What a refinement has settled."""
    result, point = found.result, found.space.values(found.best.points[0])
    if result.front is not None:
        return _front_verdict(found, len(result.front))
    objective = float(found.best.objectives[0, 0]) if result.smoothed is None else result.smoothed
    margins = found.best.margins[0]
    return judge_refinement(
        point,
        objective,
        remaining_gain=result.remaining_gain,
        feasible=result.feasible,
        runs=found.runs,
        spread=_first_spread(found),
        failed_runs=sum(int(np.isnan(wave.objectives).sum()) for wave in found.waves),
        missed={text: -float(m) for text, m in zip(found.subject_to, margins, strict=True) if m < 0},
        desirability=optimum.as_desirability(objective),
        unacceptable=unwanted,
        standard_error=result.error,
        noise_sd=result.noise_sd,
        gap=result.gap,
        options=options,
    )


def _front_verdict(found: Refinement, points: int) -> RefinedVerdict:
    """Of a front: whether it may still grow, and by how much more than counts."""
    told = f"{points} true points of the front after {found.runs} more runs; {found.reason}"
    if found.settled:
        return RefinedVerdict("SETTLED", told)
    last = found.waves[-1] if found.waves else None
    if last is not None and last.best > 0 and np.isfinite(last.predicted_gain):
        gained, promised = (100.0 * value / last.best for value in (last.gain, last.predicted_gain))
        told += (
            f"; of the volume that it dominates the last wave gained {gained:.2g} % where {promised:.2g} % "
            "were promised: a larger max_runs goes on from here"
        )
    return RefinedVerdict("NOT SETTLED", told)


def _first_spread(found: Refinement) -> float:
    """Median less least objective over the first runs: those of the waves crowd about the optimum."""
    known = found.result.known
    alive = known.objectives[known.succeeded, 0]
    waves = sum(len(wave.points) for wave in found.waves)
    first = alive[: max(int(known.succeeded[: len(known) - waves].sum()), FEW)]
    return float(np.median(first) - first.min()) if len(first) else 0.0


def _start(folder: StudyFolder, problem: Problem, points: Floats) -> Evaluation:
    """Runs of the design, failed ones included, and those at `points`."""
    design = folder.design_runs().runs
    done, failed = as_rates(folder.study, folder.fit_runs().usable), design.points[design.failed]
    flown = problem.evaluator(points)
    nothing = np.full(len(failed), np.nan)
    return problem.evaluation(
        np.vstack([done.points, failed, points]),
        {name: np.r_[done.y(name), nothing, flown[name]] for name in folder.study.responses},
    )


def _robust_start(study: Study, optimum: Optimum, problem: Problem) -> tuple[Evaluation, Problem]:
    """Put a robust search on the factors that are chosen."""
    means = noise_means(study, optimum.name)
    pinned_problem = pinned(problem, means)
    kept = [j for j, name in enumerate(study.space.names) if name not in means]
    points = np.array([candidate.point for candidate in optimum.candidates])[:, kept]
    return pinned_problem.evaluate(points), pinned_problem


def _whole(found: Refinement, space: Space, means: Mapping[str, float]) -> Refinement:
    """Put the noise factors back, at their means."""
    of = {name: j for j, name in enumerate(found.space.names)}

    def points(known: Floats) -> Floats:
        columns = [
            known[:, of[name]] if name in of else np.full(len(known), means[name]) for name in space.names
        ]
        return np.column_stack(columns)

    def rows(known: Evaluation) -> Evaluation:
        return replace(known, points=points(known.points))

    result = found.result
    return replace(
        found,
        space=space,
        result=replace(
            result,
            best=rows(result.best),
            known=rows(result.known),
            front=None if result.front is None else rows(result.front),
        ),
        waves=tuple(replace(wave, points=points(wave.points)) for wave in found.waves),
    )


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
        runs = as_rates(folder.study, runs)
        return {name: _means(runs.y(name).reshape(len(x), -1)) for name in responses}

    return pose(folder.study, search, fly)


def _means(replicates: Floats) -> Floats:
    """Mean of the replicates that succeeded, shape (n, replicates) to (n,); nan where none did."""
    done = np.isfinite(replicates)
    with np.errstate(invalid="ignore"):
        means: Floats = np.where(done, replicates, 0.0).sum(axis=1) / done.sum(axis=1)
    return means
