"""Evaluation of a design: make the runs that are missing, record each as it ends, give back the table."""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from time import monotonic
from typing import Literal

from numpy.typing import ArrayLike

from rsmkit.errors import RsmkitError, RunsFailedError
from rsmkit.io.atomic_files import write_text
from rsmkit.language.space import Space
from rsmkit.runs.agenda import Agenda, make_agenda, make_task
from rsmkit.runs.backends.loky_pool import LokyPool
from rsmkit.runs.backends.pool import Pool
from rsmkit.runs.dispatch import Dispatcher
from rsmkit.runs.one_run.execute import Outcome, Task
from rsmkit.runs.one_run.interrupts import Interrupted, Interrupts
from rsmkit.runs.one_run.simulator import Simulator
from rsmkit.runs.record.journal import Journal
from rsmkit.runs.record.run import Value
from rsmkit.runs.record.run_progress import EventKind, Progress, RunEvent, Watcher
from rsmkit.runs.record.run_table import Runs

__all__ = ["Backend", "check_once", "evaluate_points", "usable_cores"]

Backend = Literal["loky", "dask"]


def evaluate_points(
    simulator: Simulator,
    points: ArrayLike,
    space: Space,
    journal: Journal,
    *,
    responses: Sequence[str] = (),
    jobs: int | None = None,
    backend: Backend = "loky",
    scheduler: str = "",
    retry_failed: bool = False,
    only: Collection[int] | None = None,
    limit: int | None = None,
    max_failures: int | None = None,
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
        Runs made at the same time; by default one for each core this process may use, or for each thread of
        the cluster.
    backend : str
        ``loky`` for processes on this computer, ``dask`` for a cluster.
    scheduler : str
        Address of the dask scheduler, ``tcp://host:8786``.
    retry_failed : bool
        Make runs that failed before once more.
    only : collection of int, optional
        Indices of the points to consider, from 0.
    limit : int, optional
        Make at most so many runs.
    max_failures : int, optional
        When so many runs have failed, finish what is under way and stop.
    on_event : callable, optional
        Told what happens, see :class:`~rsmkit.runs.record.run_progress.RunEvent`; the place for a progress
        bar.

    Returns
    -------
    Runs
        One row for each point and replicate, also for those that were not considered.

    Raises
    ------
    RsmkitError
        If the simulator cannot be loaded, the journal cannot be written or another process is writing it.
    RunsFailedError
        If `max_failures` runs have failed.
    Interrupted
        After Ctrl-C or SIGTERM: runs under way were finished (asked twice: given up), nothing recorded is
        lost.
    """
    began = monotonic()
    with journal, Interrupts() as interrupts, warnings.catch_warnings():
        # loky replaces a worker whose memory keeps growing, which is as it should be
        warnings.filterwarnings("ignore", "A worker stopped while some jobs", UserWarning)
        agenda = make_agenda(
            simulator,
            points,
            space,
            journal,
            responses=responses,
            retry_failed=retry_failed,
            only=only,
            limit=limit,
        )
        make_pool = _pool_maker(simulator, backend, scheduler)
        _make_runs(
            simulator,
            agenda,
            journal,
            tuple(responses),
            make_pool,
            make_pool(_useful(jobs, backend, agenda)) if agenda.todo else None,
            interrupts,
            max_failures,
            on_event or (lambda event: None),
            began,
        )
    return agenda.table(space, responses)


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
    make_pool = _pool_maker(simulator, "loky", "")
    with Interrupts() as interrupts:
        dispatcher = Dispatcher(
            simulator,
            tuple(responses),
            make_pool,
            make_pool(1),
            urgency=lambda: 2 * interrupts.count,
            on_start=lambda task: None,
            on_end=outcomes.extend,
        )
        dispatcher.add([make_task(simulator, dict(factors))])
        dispatcher.run()
    if not outcomes:
        raise Interrupted("stopped before the run had ended")
    return outcomes[0]


def usable_cores() -> int:
    """Cores this process may use, containers and affinity considered."""
    from joblib import cpu_count

    return int(cpu_count())


def _useful(jobs: int | None, backend: Backend, agenda: Agenda) -> int | None:
    """Start no more processes than there are runs."""
    return jobs if backend == "dask" else min(jobs or usable_cores(), len(agenda.todo))


def _pool_maker(simulator: Simulator, backend: Backend, scheduler: str) -> Callable[[int | None], Pool]:
    if backend == "loky":
        return lambda jobs: LokyPool(jobs or usable_cores(), commands=bool(simulator.options.command))
    if not scheduler:
        raise RsmkitError("the dask backend needs the address of a scheduler, such as tcp://host:8786")
    from rsmkit.runs.backends.dask_pool import DaskPool

    return lambda jobs: DaskPool(scheduler, jobs)


def _make_runs(
    simulator: Simulator,
    agenda: Agenda,
    journal: Journal,
    names: tuple[str, ...],
    make_pool: Callable[[int | None], Pool],
    pool: Pool | None,
    interrupts: Interrupts,
    max_failures: int | None,
    watch: Watcher,
    began: float,
) -> None:
    """Dispatch what is to be done; record, count and tell; say why it ended before the end."""
    todo = len(agenda.todo)
    jobs = pool.jobs if pool else 1
    progress = Progress(len(agenda.rows), agenda.distinct, len(agenda.recorded), todo, jobs, began=began)
    watch(RunEvent("planned", progress))
    if pool is None:
        return
    tries: Counter[str] = Counter()
    announced = False

    def urgency() -> int:
        nonlocal announced
        too_many = max_failures is not None and progress.failed >= max_failures
        wanted = max(interrupts.count, int(too_many))
        if wanted and not announced:
            announced = True
            watch(RunEvent("stopping", progress))
        return wanted

    def start(task: Task) -> None:
        progress.start(task.key)
        watch(RunEvent("started", progress, task.key))

    def end(outcomes: list[Outcome]) -> None:
        journal.append(outcome.run for outcome in outcomes)
        for outcome in outcomes:
            run = outcome.run
            agenda.recorded[run.key] = run
            _keep_details(journal, outcome)
            tries[run.key] += 1
            if not run.done and tries[run.key] <= simulator.options.retries:
                progress.retry(run)
                watch(RunEvent("retried", progress, run.key, run))
                dispatcher.add([Task(run.key, dict(run.factors), run.replicate, run.attempt + 1)])
            else:
                progress.end(run)
                kind: EventKind = "finished" if run.done else "failed"
                watch(RunEvent(kind, progress, run.key, run))

    dispatcher = Dispatcher(simulator, names, make_pool, pool, urgency=urgency, on_start=start, on_end=end)
    dispatcher.add(agenda.todo)
    dispatcher.run()
    if progress.ended < todo:
        made = f"stopped with {progress.ended} of {todo} runs made, all of them recorded"
        if interrupts.count:
            raise Interrupted(f"{made}. The same command goes on from there.")
        raise RunsFailedError(
            f"{made}: {progress.failed} failed, as many as allowed. The same command goes on from there."
        )


def _keep_details(journal: Journal, outcome: Outcome) -> None:
    """Keep the traceback and the output of a failed run beside the journal; forget those of a success."""
    if outcome.run.done and outcome.run.attempt == 1:
        return
    folder = journal.folder / outcome.run.key
    # Details are a convenience: a full disk must not turn them into a second failure.
    with suppress(OSError, RsmkitError):
        for name, text in (("traceback.txt", outcome.traceback), ("output.txt", outcome.output)):
            if text:
                journal.folder.mkdir(exist_ok=True)  # not the study's folder: it may have been moved
                folder.mkdir(exist_ok=True)
                write_text(folder / name, text)
            else:
                (folder / name).unlink(missing_ok=True)
        if not any(folder.iterdir()):
            folder.rmdir()
