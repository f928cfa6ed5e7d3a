"""The evaluate stage: a finished run for every point of the design (``runs.jsonl``)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from numpy.typing import ArrayLike

from rsmkit.errors import RunsFailedError, StageError, readable
from rsmkit.runs.agenda import Agenda, make_agenda, read_runs
from rsmkit.runs.evaluation import Backend, evaluate_points
from rsmkit.runs.one_run.simulator import Simulator
from rsmkit.runs.record.journal import Journal
from rsmkit.runs.record.run import Run
from rsmkit.runs.record.run_progress import Progress, RunEvent, Watcher
from rsmkit.runs.record.run_table import Runs
from rsmkit.runs.run_sheet import laboratory
from rsmkit.stages.plan import PlanResult, load_plan
from rsmkit.study.file import Study

__all__ = [
    "DesignRuns",
    "EvaluateResult",
    "HowToRun",
    "evaluate_design",
    "evaluation_agenda",
    "load_runs",
    "read_design_runs",
    "run_points",
    "study_simulator",
]

JOURNAL_FILE = "runs.jsonl"
TABLE_FILE = "responses.csv"


@dataclass(frozen=True)
class HowToRun:
    """How runs are made; none of it changes a result.

    Parameters
    ----------
    jobs : int, optional
        Runs at the same time; all cores by default.
    backend, scheduler : str
        ``loky`` on this computer, or ``dask`` with the address of its scheduler.
    retry_failed : bool
        Make runs that failed before once more.
    only : tuple of int, optional
        Rows of the design to consider, from 1.
    limit, max_failures : int, optional
        Stop after so many runs, or so many failures.
    """

    jobs: int | None = None
    backend: Backend = "loky"
    scheduler: str = ""
    retry_failed: bool = False
    only: tuple[int, ...] | None = None
    limit: int | None = None
    max_failures: int | None = None


@dataclass(frozen=True)
class DesignRuns:
    """The runs of a set of points; a run shared by repeated points counts once."""

    runs: Runs

    @cached_property
    def _distinct(self) -> list[int]:
        first: dict[str, int] = {}
        for row, run in enumerate(self.runs.runs):
            first.setdefault(run.key if run else f"missing {self.runs.points[row].tolist()}", row)
        return list(first.values())

    @property
    def distinct(self) -> int:
        """Runs that the points need."""
        return len(self._distinct)

    @property
    def done(self) -> int:
        """Runs that ended well."""
        return int(self.runs.done[self._distinct].sum())

    @property
    def failed(self) -> int:
        """Runs that ended badly."""
        return int(self.runs.failed[self._distinct].sum())

    @property
    def missing(self) -> int:
        """Runs still to be made."""
        return int(self.runs.missing[self._distinct].sum())

    def usable(self) -> Runs:
        """Runs that ended well, each once: what a surface can be fitted to."""
        chosen = tuple(self.runs.runs[row] for row in self._distinct)
        points = self.runs.points[self._distinct]
        return Runs(self.runs.space, points, chosen, self.runs.responses).finished()

    @property
    def errors(self) -> tuple[str, ...]:
        """One line per failed run: where, and why."""
        return tuple(readable(f"{_place(run)}: {run.status}, {run.error}") for run in self.runs.failures())


@dataclass(frozen=True)
class EvaluateResult:
    """The state of the design's runs, and what this command added."""

    evaluation: DesignRuns
    path: Path
    progress: Progress | None

    @property
    def made(self) -> int:
        """Runs made by this command."""
        return self.progress.ended if self.progress else 0

    def overview(self) -> dict[str, Any]:
        """What ``--json`` prints."""
        runs = self.evaluation
        return {
            "stage": "evaluate",
            "skipped": self.made == 0,
            "file": str(self.path),
            "distinct": runs.distinct,
            "done": runs.done,
            "failed": runs.failed,
            "missing": runs.missing,
            "made": self.made,
            "seconds": self.progress.elapsed_seconds if self.progress else 0.0,
            "errors": list(runs.errors),
        }


def evaluate_design(
    study: Study, how: HowToRun | None = None, *, on_event: Watcher | None = None
) -> EvaluateResult:
    """Run the simulator at every design point that has no finished run yet.

    Raises
    ------
    StageError
        If there is no up-to-date design.
    """
    plan = load_plan(study)
    latest: list[Progress] = []

    def watch(event: RunEvent) -> None:
        latest[:] = [event.progress]
        if on_event:
            on_event(event)

    evaluation = run_points(study, plan.design.points, how, on_event=watch)
    evaluation.runs.to_csv(study.folder / TABLE_FILE, plan.design.kinds)
    return EvaluateResult(evaluation, study.folder / JOURNAL_FILE, latest[0] if latest else None)


def evaluation_agenda(study: Study, how: HowToRun | None = None) -> Agenda:
    """Say which runs :func:`evaluate_design` would make; nothing is run."""
    how = how or HowToRun()
    return make_agenda(
        study_simulator(study),
        load_plan(study).design.points,
        study.space,
        Journal(study.folder / JOURNAL_FILE),
        responses=study.responses,
        retry_failed=how.retry_failed,
        only=_rows(how),
        limit=how.limit,
    )


def run_points(
    study: Study, points: ArrayLike, how: HowToRun | None = None, *, on_event: Watcher | None = None
) -> DesignRuns:
    """Make the missing runs at `points` (natural units, shape (n, k)) and record them in the journal.

    Raises
    ------
    StageError
        If runs are missing and the study has no simulator to make them.
    """
    how = how or HowToRun()
    if study.file.simulator is None:
        return DesignRuns(_recorded(study, points))
    return DesignRuns(
        evaluate_points(
            study_simulator(study),
            points,
            study.space,
            Journal(study.folder / JOURNAL_FILE),
            responses=study.responses,
            jobs=how.jobs,
            backend=how.backend,
            scheduler=how.scheduler,
            retry_failed=how.retry_failed,
            only=_rows(how),
            limit=how.limit,
            max_failures=how.max_failures,
            on_event=on_event,
        )
    )


def read_design_runs(study: Study, planned: PlanResult | None = None) -> DesignRuns:
    """Look up the runs of the design's points (that of `planned`, if it has been read already)."""
    design = (planned or load_plan(study)).design
    journal = Journal(study.folder / JOURNAL_FILE)
    return DesignRuns(
        read_runs(study_simulator(study), design.points, study.space, journal, responses=study.responses)
    )


def load_runs(study: Study) -> DesignRuns:
    """Read the runs a fit may use: every design point must have been run, well or badly.

    Raises
    ------
    StageError
        If there is no up-to-date design, or points have not been run.
    RunsFailedError
        If no run succeeded.
    """
    evaluation = read_design_runs(study)
    if evaluation.missing:
        raise StageError(
            f"{evaluation.missing} of {evaluation.distinct} runs have not been made. Run: rsmkit evaluate"
        )
    if not evaluation.done:
        raise RunsFailedError(
            f"all {evaluation.failed} runs failed ({evaluation.errors[0]}). "
            "Repair the simulator, then run: rsmkit evaluate --retry-failed"
        )
    return evaluation


def study_simulator(study: Study) -> Simulator:
    """Give the study's simulator; without one, the stand-in by which laboratory runs are found."""
    if study.file.simulator is None:
        return laboratory(study.folder)
    return Simulator(study.file.simulator, study.folder)


def _recorded(study: Study, points: ArrayLike) -> Runs:
    """Look up runs made by hand, and say which are missing."""
    journal = Journal(study.folder / JOURNAL_FILE)
    runs = read_runs(study_simulator(study), points, study.space, journal, responses=study.responses)
    missing = runs.points[runs.missing]
    if len(missing):
        first = ", ".join(f"{name} = {value}" for name, value in study.space.values(missing[0]).items())
        raise StageError(
            f"{len(missing)} runs have not been made (the first at {first}) and this study has no simulator. "
            "Write a run sheet with: rsmkit sheet FILE.csv, fill it in, and record it with: "
            "rsmkit record FILE.csv"
        )
    return runs


def _rows(how: HowToRun) -> tuple[int, ...] | None:
    return None if how.only is None else tuple(row - 1 for row in how.only)


def _place(run: Run) -> str:
    return ", ".join(f"{name} {value}" for name, value in run.factors.items())
