"""The verify stage: the true simulator at every optimum (``verification.json``)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from rsmkit.errors import EXIT_OK, EXIT_RUNS_FAILED, EXIT_VERIFICATION, StageError
from rsmkit.io.arguments import checked
from rsmkit.io.json_codec import to_json
from rsmkit.io.shown import Shown
from rsmkit.language.space import Floats
from rsmkit.optimum.optimum import Optimum
from rsmkit.runs.agenda import read_runs
from rsmkit.runs.how_to_run import HowToRun
from rsmkit.runs.record.design_runs import DesignRuns
from rsmkit.runs.record.run_progress import Watcher
from rsmkit.runs.record.run_table import Runs
from rsmkit.stages.confirmations import ConfirmationRun, confirmation_runs, overview
from rsmkit.stages.evaluate import recorded_runs, run_points
from rsmkit.stages.fit import surface_problem
from rsmkit.stages.refine import simulator_problem
from rsmkit.study.counts import as_rates, counted_predictors, single_trials
from rsmkit.study.file import Study
from rsmkit.study.folder import VERIFICATION_FILE, Fitted, StudyFolder
from rsmkit.study.posing import in_service_names, node_points, noise_means, search_options
from rsmkit.verification.flown import NOISY_REPLICATES, Flown, flown_at
from rsmkit.verification.judge import Predictor, RefinedVerdict, judge_optimum
from rsmkit.verification.next_steps import MORE_RUNS
from rsmkit.verification.options import VerifyOptions
from rsmkit.verification.verification import Confirmation, SimulatorRuns, SpentRuns, Verification

__all__ = ["VerifyResult", "lacks_runs", "replicates_of", "verify_study"]


@dataclass(frozen=True)
class VerifyResult(Shown):
    """What the simulator said about the optima."""

    verification: Verification
    tolerance_pct: float
    path: Path
    fresh: bool
    refined: dict[str, RefinedVerdict] = field(default_factory=dict)
    recorded: int = 0
    confirmations: tuple[ConfirmationRun, ...] = ()

    @property
    def spent(self) -> SpentRuns:
        """What the runs on record were made for."""
        runs = self.verification.simulator_runs
        return SpentRuns(runs.design, runs.verification, self.recorded)

    @property
    def within_tolerance(self) -> bool:
        """Whether every objective is predicted within the tolerance."""
        return self.verification.within(self.tolerance_pct)

    def to_refine(self, options: VerifyOptions) -> bool:
        """Whether `always_refine` asks for a refinement of these optima that is not made yet."""
        names = {search.name for search in self.verification.searches}
        return options.always_refine and not (self.fresh and names <= self.refined.keys())

    def exit_code(self, refined: Mapping[str, RefinedVerdict] | None = None) -> int:
        """0 when all predictions hold, 5 when one does not, 3 when only failed runs stand in the way.

        A prediction holds when the true run is within the tolerance of it and violates no constraint, also
        where a design run is better.

        Parameters
        ----------
        refined : mapping of str to RefinedVerdict, optional
            What refinements have settled, by search: they replace the verdicts of these. Those that an
            earlier refinement has left when it is not given.
        """
        refined = self.refined if refined is None else refined
        searches = [search for search in self.verification.searches if search.name not in refined]
        points = [point for search in searches for point in search.points]
        flown = [point for point in points if point.verdict != "FAILED"]
        wrong = any(not point.holds(self.tolerance_pct) for point in flown)
        wrong = wrong or any(item.verdict != "CONFIRMED" for item in self.confirmations)
        if wrong or any(item.verdict != "SETTLED" for item in refined.values()):
            return EXIT_VERIFICATION
        return EXIT_RUNS_FAILED if len(flown) < len(points) else EXIT_OK

    def overview(self) -> dict[str, Any]:
        """What ``--json`` prints."""
        return {
            "stage": "verify",
            "skipped": self.fresh,
            "file": str(self.path),
            "tolerance_pct": self.tolerance_pct,
            "within_tolerance": self.within_tolerance,
            **to_json(self.verification),
            "runs_on_record": self.spent.counts(),
            **overview(self.confirmations),
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

    A point at which the simulator fails gets the verdict ``FAILED``, and every other its own. It is run again
    only with ``how.retry_failed`` or `force`.

    Raises
    ------
    StageError
        If there is no up-to-date fit, or the study names no search.
    """
    options, how = folder.study.file.verify, how or HowToRun()
    if tolerance_pct is not None:
        options = replace(options, tolerance_pct=tolerance_pct)
    fitted = folder.fitted()
    if not force and folder.verify_problem(options) is None:
        verification = folder.verification(options)
        if not (how.retry_failed and "FAILED" in verification.verdicts):
            path = folder.path / VERIFICATION_FILE
            return VerifyResult(verification, options.tolerance_pct, path, True, *_besides(folder))
    how = replace(how, retry_failed=how.retry_failed or force)
    verification = _verify(folder, fitted, options, how, on_event)
    path = folder.keep_verification(verification, options)
    return VerifyResult(verification, options.tolerance_pct, path, False, *_besides(folder))


def _besides(
    folder: StudyFolder,
) -> tuple[dict[str, RefinedVerdict], int, tuple[ConfirmationRun, ...]]:
    """What refinements have settled, how many runs there are in all, and confirmation runs."""
    return _refined(folder), len(folder.journal.load()), confirmation_runs(folder, folder.fitted())


def _refined(folder: StudyFolder) -> dict[str, RefinedVerdict]:
    """What an earlier refinement of the present optima has settled."""
    kept = folder.refinements().items()
    return {name: RefinedVerdict(found.verdict, found.sentence) for name, found in kept if found.verdict}


def replicates_of(study: Study) -> int:
    """Runs of each optimum: as the study file says; else 4 of what may give other results, 1 of what may not.

    A deterministic simulator repeats itself, so its points are run once whatever is asked for.
    """
    if study.deterministic:
        return 1
    return study.file.verify.replicates or NOISY_REPLICATES


def _verify(
    folder: StudyFolder, fitted: Fitted, options: VerifyOptions, how: HowToRun, on_event: Watcher | None
) -> Verification:
    """Run the simulator at the chosen optima and judge each."""
    study = folder.study
    chosen = _chosen(fitted, options)
    made = _fly(folder, chosen, how, on_event)
    runs = as_rates(study, made)
    single = single_trials(study, folder.fit_runs().usable) if study.counts else ()
    design = {
        name: fitted.surfaces[name].predict(fitted.runs.points) if name in single else fitted.runs.y(name)
        for name in study.responses
    }
    counted = counted_predictors(study, fitted.surfaces, made)
    predictors: dict[str, Predictor] = {**fitted.surfaces, **counted}
    own: dict[str, Predictor] = {**predictors, **fitted.objective_surfaces}
    confirmations = []
    for optimum in chosen:
        problem = surface_problem(study, fitted.surfaces, optimum.name)
        known, surfaces = design, predictors
        varying = (
            optimum.minimize if noise_means(study, optimum.name) else in_service_names(study, optimum.name)
        )
        if varying:  # no single run tells how much an objective varies
            known = {**design, **dict.fromkeys(varying, np.full(len(fitted.runs), np.nan))}
            surfaces = {}
        confirmation = judge_optimum(
            problem,
            optimum,
            _flown(folder, optimum, runs, how),
            surfaces=surfaces,
            objective_surfaces={text: own[text] for text in optimum.minimize if text in own},
            design=problem.evaluation(fitted.runs.points, known),
            options=options,
        )
        confirmations.append(_with_next_step(study, optimum, confirmation))
    flown = DesignRuns(runs)
    spent = SimulatorRuns(len(fitted.runs), flown.distinct - flown.missing)
    return Verification(tuple(confirmations), spent)


def _fly(folder: StudyFolder, chosen: Sequence[Optimum], how: HowToRun, on_event: Watcher | None) -> Runs:
    """Make the runs that all verdicts need, each point as often as its noise asks for."""
    study = folder.study
    own = study.file.simulator.replicates if study.file.simulator and not study.deterministic else 1
    copies: dict[tuple[float, ...], int] = {}
    for optimum in chosen:
        asked = search_options(study, optimum.name)
        # a robust objective is a mean over the nodes of its noise factors, which average the noise as well
        wanted = (
            (study.file.verify.replicates or 1) if asked.robust or asked.service else replicates_of(study)
        )
        for point in _points_to_run(study, optimum):
            key = tuple((point + 0.0).tolist())
            copies[key] = max(copies.get(key, 1), -(-wanted // own))
    points = np.array(list(copies))
    repeated = np.repeat(points, list(copies.values()), axis=0)
    if study.file.simulator is not None:
        return run_points(folder, repeated, how, on_event=on_event).runs
    recorded_runs(folder, points, whole=True)  # refused while one has no run
    return read_runs(folder.simulator, repeated, study.space, folder.journal, responses=study.asked)


def lacks_runs(folder: StudyFolder) -> bool:
    """Whether runs at the optima that people make by hand are still to be recorded."""
    chosen = _chosen(folder.fitted(), folder.study.file.verify)
    points = np.vstack([_points_to_run(folder.study, optimum) for optimum in chosen])
    try:
        recorded_runs(folder, points, whole=True)
    except StageError:
        return True
    return False


def _points_to_run(study: Study, optimum: Optimum) -> Floats:
    """The optimum's candidates; of a robust search at every node of its noise factors."""
    points = np.array([candidate.point for candidate in optimum.candidates])
    nodes = node_points(study, optimum.name, points)
    return points if nodes is None else nodes


def _flown(folder: StudyFolder, optimum: Optimum, runs: Runs, how: HowToRun) -> list[Flown]:
    """What the simulator says of each candidate, from the runs just made."""
    if node_points(folder.study, optimum.name, np.array([optimum.best.point])) is None:
        return [flown_at(runs, candidate.point) for candidate in optimum.candidates]
    points = np.array([candidate.point for candidate in optimum.candidates])
    found = simulator_problem(folder, optimum.name, replace(how, retry_failed=False)).evaluator(points)
    nodes = np.split(_points_to_run(folder.study, optimum), len(points))
    flown = []
    for row, around in enumerate(nodes):
        values = {name: float(column[row]) for name, column in found.items()}
        if np.isfinite(list(values.values())).all():
            flown.append(Flown((values,)))
        else:
            errors = [error for point in around if (error := flown_at(runs, point).error)]
            flown.append(Flown((), errors[0] if errors else "a node of the noise factors gives no number"))
    return flown


def _with_next_step(study: Study, optimum: Optimum, confirmation: Confirmation) -> Confirmation:
    """Say of each point what to do now."""
    extremes = tuple(_with_next_step(study, optimum, extreme) for extreme in confirmation.extremes)
    return replace(confirmation, extremes=extremes, next_step=_next_step(study, optimum, confirmation))


def _next_step(study: Study, optimum: Optimum, confirmation: Confirmation) -> str:
    where = "" if study.folder == Path() else f" {study.folder}"
    refine = f"rsmkit verify{where} --refine"
    best = confirmation.best_known
    if study.file.simulator is None:
        if confirmation.verdict == "CONFIRMED":
            return ""
        return f"{MORE_RUNS}, then: rsmkit run{where}"
    if confirmation.verdict == "CONFIRMED":
        return f"{refine}, to see whether anything better lies elsewhere"
    if confirmation.verdict == "INFEASIBLE" and not (best and best.missed):
        return f"{refine}, or widen what is acceptable, then: rsmkit run{where}"
    return refine


def _chosen(fitted: Fitted, options: VerifyOptions) -> list[Optimum]:
    chosen = [o for o in fitted.optima if not options.searches or o.name in options.searches]
    if not chosen:
        raise StageError("the study names no search, so there is nothing to verify. Add a [[search]] table")
    return [optimum.with_spread(options.points) if options.points else optimum for optimum in chosen]
