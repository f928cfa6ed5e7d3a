"""Evaluation of a design: make the runs that are missing, record each as it ends, give back the table."""

from __future__ import annotations

import shutil
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rsmkit.errors import RsmkitError
from rsmkit.files import write_text
from rsmkit.runs.dispatch import Dispatcher
from rsmkit.runs.interrupts import Interrupted, Interrupts
from rsmkit.runs.journal import Journal
from rsmkit.runs.pools import LokyPool
from rsmkit.runs.progress import Event, EventKind, Progress, Watcher
from rsmkit.runs.run import Run, Value, run_key
from rsmkit.runs.simulator import Simulator
from rsmkit.runs.table import Runs
from rsmkit.runs.worker import Outcome, Task
from rsmkit.space import Floats, Space

__all__ = ["Agenda", "check_once", "evaluate_points", "make_agenda", "read_runs"]


@dataclass(frozen=True)
class Agenda:
    """What an evaluation would do, before it does it.

    Parameters
    ----------
    rows : tuple of Task
        The run each point needs, in order; points that share a run have the same key.
    recorded : dict
        Runs of these that the journal already has.
    todo : tuple of Task
        Runs to make.
    """

    rows: tuple[Task, ...]
    recorded: dict[str, Run]
    todo: tuple[Task, ...]

    @property
    def distinct(self) -> int:
        """Number of different runs the points need."""
        return len({task.key for task in self.rows})


def make_agenda(
    simulator: Simulator,
    points: ArrayLike,
    space: Space,
    journal: Journal,
    *,
    responses: Sequence[str] = (),
    retry_failed: bool = False,
    only: Collection[int] | None = None,
    limit: int | None = None,
) -> Agenda:
    """Compare the points with the journal; nothing is run. Parameters as for :func:`evaluate_points`."""
    x = _as_points(points, space)
    recorded = journal.load()
    rows = _tasks(simulator, x, space)
    chosen = range(len(rows)) if only is None else sorted(set(only))
    if len(chosen) and not (chosen[0] >= 0 and chosen[-1] < len(rows)):
        raise RsmkitError(f"there are runs 1 to {len(rows)}; got {chosen[0] + 1} to {chosen[-1] + 1}")
    todo: dict[str, Task] = {}
    for index in chosen:
        task = rows[index]
        old = recorded.get(task.key)
        if old is None:
            todo[task.key] = task
        elif retry_failed and not old.answers(responses):
            todo[task.key] = task._replace(attempt=old.attempt + 1)
    keys = {task.key for task in rows}
    return Agenda(
        tuple(rows), {key: run for key, run in recorded.items() if key in keys}, tuple(todo.values())[:limit]
    )


def read_runs(
    simulator: Simulator, points: ArrayLike, space: Space, journal: Journal, *, responses: Sequence[str] = ()
) -> Runs:
    """Look up the runs of points in the journal; nothing is run and nothing is written."""
    x = _as_points(points, space)
    recorded = journal.load()
    runs = tuple(recorded.get(task.key) for task in _tasks(simulator, x, space))
    return Runs(space, x, runs, tuple(responses))


def evaluate_points(
    simulator: Simulator,
    points: ArrayLike,
    space: Space,
    journal: Journal,
    *,
    responses: Sequence[str] = (),
    jobs: int | None = None,
    retry_failed: bool = False,
    only: Collection[int] | None = None,
    limit: int | None = None,
    on_event: Watcher | None = None,
) -> Runs:
    """Make the runs that the journal does not have yet, in parallel, each recorded as soon as it ends.

    Calling again goes on where the last call stopped, however it stopped. A run that fails is recorded with
    its reason and the others are made all the same.

    Parameters
    ----------
    simulator : Simulator
        What to run.
    points : array, shape (n, k)
        Natural units.
    space : Space
        The factors.
    journal : Journal
        Where runs are recorded.
    responses : sequence of str
        Numbers every run must return; a run that does not is failed.
    jobs : int, optional
        Worker processes; by default one for each core this process may use.
    retry_failed : bool
        Make runs that failed before once more.
    only : collection of int, optional
        Indices of the points to consider, from 0.
    limit : int, optional
        Make at most so many runs.
    on_event : callable, optional
        Told what happens, see :class:`~rsmkit.runs.progress.Event`; the place for a progress bar.

    Returns
    -------
    Runs
        One row for each point, also for those that were not considered.

    Raises
    ------
    RsmkitError
        If the simulator cannot be loaded, the journal cannot be written or another process is writing it.
    Interrupted
        After Ctrl-C or SIGTERM: runs under way were finished (asked twice: given up), nothing recorded is
        lost.
    """
    x = _as_points(points, space)
    watch = on_event or (lambda event: None)
    jobs = jobs or usable_cores()
    with journal, Interrupts() as interrupts:
        agenda = make_agenda(
            simulator,
            x,
            space,
            journal,
            responses=responses,
            retry_failed=retry_failed,
            only=only,
            limit=limit,
        )
        recorded = agenda.recorded
        progress = Progress(len(x), agenda.distinct, len(recorded), len(agenda.todo), jobs)
        watch(Event("planned", progress))
        announced = False

        def urgency() -> int:
            nonlocal announced
            if interrupts.count and not announced:
                announced = True
                watch(Event("stopping", progress))
            return interrupts.count

        def start(task: Task) -> None:
            progress.start(task.key)
            watch(Event("started", progress, task.key))

        def end(outcomes: list[Outcome]) -> None:
            journal.append(outcome.run for outcome in outcomes)
            for outcome in outcomes:
                recorded[outcome.run.key] = outcome.run
                _keep_details(journal, outcome)
                progress.end(outcome.run)
                kind: EventKind = "finished" if outcome.run.done else "failed"
                watch(Event(kind, progress, outcome.run.key, outcome.run))

        if agenda.todo:
            dispatcher = Dispatcher(
                simulator, tuple(responses), LokyPool, jobs, urgency=urgency, on_start=start, on_end=end
            )
            dispatcher.add(agenda.todo)
            dispatcher.run()
        if progress.ended < progress.todo and interrupts.count:
            raise Interrupted(
                f"stopped with {progress.ended} of {progress.todo} runs made, all of them recorded. "
                "The same command goes on from there."
            )
    return Runs(space, x, tuple(recorded.get(task.key) for task in agenda.rows), tuple(responses))


def check_once(
    simulator: Simulator, factors: Mapping[str, Value], *, responses: Sequence[str] = ()
) -> Outcome:
    """Make one run in a worker process and record nothing: does the simulator keep its contract?

    Parameters
    ----------
    simulator : Simulator
        What to run.
    factors : mapping
        Its arguments, as ``space.values(point)`` gives them.
    responses : sequence of str
        Numbers the run must return.

    Returns
    -------
    Outcome
        The run; its traceback and what it printed if it failed.

    Raises
    ------
    SimulatorError
        If the simulator cannot be loaded.
    Interrupted
        After Ctrl-C or SIGTERM.
    """
    outcomes: list[Outcome] = []
    with Interrupts() as interrupts:
        dispatcher = Dispatcher(
            simulator,
            tuple(responses),
            LokyPool,
            1,
            urgency=lambda: 2 * interrupts.count,
            on_start=lambda task: None,
            on_end=outcomes.extend,
        )
        dispatcher.add([_task(simulator, dict(factors), 0)])
        dispatcher.run()
    if not outcomes:
        raise Interrupted("stopped before the run had ended")
    return outcomes[0]


def usable_cores() -> int:
    """Cores this process may use, containers and affinity considered."""
    from joblib import cpu_count

    return int(cpu_count())


def _as_points(points: ArrayLike, space: Space) -> Floats:
    x = np.array(points, float)
    if x.ndim != 2 or x.shape[1] != len(space) or not np.isfinite(x).all():
        raise RsmkitError(f"points must be finite numbers of shape (n, {len(space)}), got shape {x.shape}")
    return x


def _tasks(simulator: Simulator, x: Floats, space: Space) -> list[Task]:
    """Give the run each point needs: repeated points share one, or are replicates of a noisy simulator."""
    seen: Counter[tuple[float, ...]] = Counter()
    tasks = []
    for point in x:
        replicate = 0
        if not simulator.options.deterministic:
            place = tuple(point.tolist())
            replicate = seen[place]
            seen[place] += 1
        tasks.append(_task(simulator, space.values(point), replicate))
    return tasks


def _task(simulator: Simulator, factors: dict[str, Value], replicate: int) -> Task:
    key = run_key(simulator.identity, simulator.options.settings, factors, replicate)
    return Task(key, factors, replicate)


def _keep_details(journal: Journal, outcome: Outcome) -> None:
    """Keep the traceback and the output of a failed run beside the journal; forget those of a success."""
    folder = journal.folder / outcome.run.key
    if outcome.run.done:
        if outcome.run.attempt > 1:
            shutil.rmtree(folder, ignore_errors=True)
        return
    # Details are a convenience: a full disk must not turn them into a second failure.
    with suppress(OSError, RsmkitError):
        for name, text in (("traceback.txt", outcome.traceback), ("output.txt", outcome.output)):
            if text:
                folder.mkdir(parents=True, exist_ok=True)
                write_text(folder / name, text)
