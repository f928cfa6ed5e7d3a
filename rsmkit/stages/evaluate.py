"""The evaluate stage: a finished run for every point of the design (``runs.jsonl``)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from numpy.typing import ArrayLike

from rsmkit.errors import StageError
from rsmkit.runs.agenda import Agenda, make_agenda, read_runs
from rsmkit.runs.evaluation import Backend, evaluate_points
from rsmkit.runs.record.design_runs import DesignRuns
from rsmkit.runs.record.run_progress import Progress, RunEvent, Watcher
from rsmkit.runs.record.run_table import Runs
from rsmkit.stages.user_functions import check_functions
from rsmkit.study.folder import TABLE_FILE, StudyFolder

__all__ = ["EvaluateResult", "HowToRun", "evaluate_design", "evaluation_agenda", "run_points"]


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
    folder: StudyFolder, how: HowToRun | None = None, *, on_event: Watcher | None = None
) -> EvaluateResult:
    """Run the simulator at every design point that has no finished run yet.

    Raises
    ------
    StageError
        If there is no up-to-date design.
    """
    design = folder.plan().design
    if folder.study.file.simulator is not None:
        check_functions(folder.study)  # a broken one is found before the runs are paid for
    latest: list[Progress] = []

    def watch(event: RunEvent) -> None:
        latest[:] = [event.progress]
        if on_event:
            on_event(event)

    evaluation = run_points(folder, design.points, how, on_event=watch)
    evaluation.runs.to_csv(folder.path / TABLE_FILE, design.kinds)
    return EvaluateResult(evaluation, folder.journal.path, latest[0] if latest else None)


def evaluation_agenda(folder: StudyFolder, how: HowToRun | None = None) -> Agenda:
    """Say which runs :func:`evaluate_design` would make; nothing is run."""
    how = how or HowToRun()
    return make_agenda(
        folder.simulator,
        folder.plan().design.points,
        folder.study.space,
        folder.journal,
        responses=folder.study.responses,
        retry_failed=how.retry_failed,
        only=_rows(how),
        limit=how.limit,
    )


def run_points(
    folder: StudyFolder, points: ArrayLike, how: HowToRun | None = None, *, on_event: Watcher | None = None
) -> DesignRuns:
    """Make the missing runs at `points` (natural units, shape (n, k)) and record them in the journal.

    Raises
    ------
    StageError
        If runs are missing and the study has no simulator to make them.
    """
    how = how or HowToRun()
    if folder.study.file.simulator is None:
        return DesignRuns(_recorded(folder, points))
    return DesignRuns(
        evaluate_points(
            folder.simulator,
            points,
            folder.study.space,
            folder.journal,
            responses=folder.study.responses,
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


def _recorded(folder: StudyFolder, points: ArrayLike) -> Runs:
    """Look up runs made by hand, and say which are missing."""
    space = folder.study.space
    runs = read_runs(folder.simulator, points, space, folder.journal, responses=folder.study.responses)
    missing = runs.points[runs.missing]
    if len(missing):
        first = ", ".join(f"{name} = {value}" for name, value in space.values(missing[0]).items())
        raise StageError(
            f"{len(missing)} runs have not been made (the first at {first}) and this study has no simulator. "
            "Write a run sheet with: rsmkit sheet FILE.csv, fill it in, and record it with: "
            "rsmkit record FILE.csv"
        )
    return runs


def _rows(how: HowToRun) -> tuple[int, ...] | None:
    return None if how.only is None else tuple(row - 1 for row in how.only)
