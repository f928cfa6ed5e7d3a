"""The evaluate stage: a finished run for every point of the design (``runs.jsonl``)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from numpy.typing import ArrayLike

from rsmkit.errors import StageError
from rsmkit.io.arguments import checked
from rsmkit.io.shown import Shown
from rsmkit.runs.agenda import Agenda, make_agenda, read_runs, rest_of_agenda
from rsmkit.runs.evaluation import evaluate_agenda, evaluate_points
from rsmkit.runs.how_to_run import HowToRun
from rsmkit.runs.one_run.command import refuse_unused
from rsmkit.runs.record.design_runs import DesignRuns
from rsmkit.runs.record.run_progress import Progress, RunEvent, Watcher
from rsmkit.runs.record.run_table import Runs
from rsmkit.study.folder import DESIGN_FILE, JOURNAL_FILE, TABLE_FILE, StudyFolder
from rsmkit.study.run_counts import Standing
from rsmkit.study.user_functions import check_functions

__all__ = ["EvaluateResult", "evaluate_design", "evaluation_agenda", "recorded_runs", "run_points"]


@dataclass(frozen=True)
class EvaluateResult(Shown):
    """The state of the design's runs, and what this command added."""

    evaluation: DesignRuns | Standing
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


@checked
def evaluate_design(
    folder: StudyFolder, how: HowToRun | None = None, *, on_event: Watcher | None = None
) -> EvaluateResult:
    """Run the simulator at every design point that has no finished run yet.

    Raises
    ------
    StageError
        If there is no up-to-date design.
    """
    how = how or folder.study.file.evaluate.how()
    if _is_complete(folder, how):
        return EvaluateResult(folder.standing(), folder.journal.path, None)
    design = folder.plan().design
    if folder.study.file.simulator is not None:
        check_functions(folder.study)  # a broken one is found before the runs are paid for
    latest: list[Progress] = []

    def watch(event: RunEvent) -> None:
        latest[:] = [event.progress]
        if on_event:
            on_event(event)

    if folder.is_large and folder.row_states():
        _make_the_rest(folder, design.points, how, watch)
        evaluation = folder.design_runs()
    else:
        evaluation = run_points(folder, design.points, how, on_event=watch)
    folder.keep_standing()
    evaluation.runs.to_csv(folder.path / TABLE_FILE, design.kinds)
    return EvaluateResult(evaluation, folder.journal.path, latest[0] if latest else None)


def _make_the_rest(folder: StudyFolder, points: ArrayLike, how: HowToRun | None, watch: Watcher) -> None:
    """Make the missing runs of a large study; what is there is not read before the first of them begins."""
    study = folder.study
    refuse_unused(folder.simulator, study.space.names)

    def agenda() -> Agenda:
        states = folder.row_states()
        rest = states and rest_of_agenda(folder.simulator, points, study.space, states, how)
        return rest or evaluation_agenda(folder, how)

    evaluate_agenda(folder.simulator, agenda, folder.journal, how, responses=study.asked, on_event=watch)


def _is_complete(folder: StudyFolder, how: HowToRun) -> bool:
    """Whether a large study has all its runs, by its index, and a table of them."""
    if folder.plan_problem() is not None or not folder.is_large or how.only is not None:
        return False
    table, state = folder.path / TABLE_FILE, folder.standing()
    if state.missing or state.failed or not table.is_file():
        return False
    made = table.stat().st_mtime_ns
    return all((folder.path / name).stat().st_mtime_ns <= made for name in (DESIGN_FILE, JOURNAL_FILE))


def evaluation_agenda(folder: StudyFolder, how: HowToRun | None = None) -> Agenda:
    """Say which runs :func:`evaluate_design` would make; nothing is run."""
    study, points = folder.study, folder.plan().design.points
    return make_agenda(folder.simulator, points, study.space, folder.journal, how, responses=study.asked)


def run_points(
    folder: StudyFolder, points: ArrayLike, how: HowToRun | None = None, *, on_event: Watcher | None = None
) -> DesignRuns:
    """Make the missing runs at `points` (natural units, shape (n, k)) and record them in the journal.

    Raises
    ------
    StageError
        If runs are missing and the study has no simulator to make them.
    """
    if folder.study.file.simulator is None:
        return DesignRuns(recorded_runs(folder, points))
    refuse_unused(folder.simulator, folder.study.space.names)
    return DesignRuns(
        evaluate_points(
            folder.simulator,
            points,
            folder.study.space,
            folder.journal,
            how,
            responses=folder.study.asked,
            on_event=on_event,
        )
    )


def recorded_runs(folder: StudyFolder, points: ArrayLike, *, whole: bool = False) -> Runs:
    """Look up runs made by hand; with `whole`, those that lack a response count as missing.

    Raises
    ------
    StageError
        If some are missing.
    """
    space = folder.study.space
    runs = read_runs(folder.simulator, points, space, folder.journal, responses=folder.study.asked)
    missing = runs.points[runs.missing | runs.partial if whole else runs.missing]
    if len(missing):
        first = ", ".join(f"{name} = {value}" for name, value in space.values(missing[0]).items())
        lacking = "measured in full" if whole else "made"
        raise StageError(
            f"{len(missing)} runs have not been {lacking} (the first at {first}) and this study has no "
            "simulator. Write a run sheet with: rsmkit sheet FILE.csv, fill it in, and record it with: "
            "rsmkit record FILE.csv"
        )
    return runs
