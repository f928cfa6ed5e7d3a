"""Evaluation of a design: make the runs that are missing, record each as it ends, give back the table."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from time import monotonic

from numpy.typing import ArrayLike

from rsmkit.errors import RsmkitError, RunsFailedError
from rsmkit.io.files.atomic_files import write_text
from rsmkit.language.space import Space
from rsmkit.runs.agenda import Agenda, make_agenda, make_task
from rsmkit.runs.backends.pool import Pool
from rsmkit.runs.dispatch import Dispatcher
from rsmkit.runs.how_to_run import HowToRun
from rsmkit.runs.one_run.execute import Outcome, Task
from rsmkit.runs.one_run.interrupts import Interrupted, Interrupts
from rsmkit.runs.one_run.simulator import Simulator
from rsmkit.runs.record.journal import Journal
from rsmkit.runs.record.run import Run, Value
from rsmkit.runs.record.run_progress import EventKind, Progress, RunEvent, Watcher
from rsmkit.runs.record.run_table import Runs

__all__ = ["check_once", "evaluate_agenda", "evaluate_points"]


def evaluate_points(
    simulator: Simulator,
    points: ArrayLike,
    space: Space,
    journal: Journal,
    how: HowToRun | None = None,
    *,
    responses: Sequence[str] = (),
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
    how : HowToRun, optional
        Which of the runs, how many at the same time, and where.
    responses : sequence of str
        Numbers every run must return; a run that does not is failed.
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
        If ``how.max_failures`` runs have failed.
    Interrupted
        After Ctrl-C or SIGTERM: runs under way were finished (asked twice: given up), nothing recorded is
        lost.
    """
    made = evaluate_agenda(
        simulator,
        lambda: make_agenda(simulator, points, space, journal, how, responses=responses),
        journal,
        how,
        responses=responses,
        on_event=on_event,
    )
    return made.table(space, responses)


def evaluate_agenda(
    simulator: Simulator,
    make: Callable[[], Agenda],
    journal: Journal,
    how: HowToRun | None = None,
    *,
    responses: Sequence[str] = (),
    on_event: Watcher | None = None,
) -> Agenda:
    """Make the runs of an agenda; see :func:`evaluate_points`.

    Parameters
    ----------
    simulator, journal, how, responses, on_event
        As there.
    make : callable
        Makes the agenda, once nobody else can write the journal.
    """
    began = monotonic()
    how = how or HowToRun()
    with journal, Interrupts() as interrupts:
        agenda = make()
        todo = len(agenda.todo)
        make_pool = how.pool_maker(simulator, todo)
        pool = make_pool(how.jobs) if todo else None
        jobs = pool.jobs if pool else 1
        progress = Progress(agenda.planned, agenda.distinct, agenda.known, todo, jobs, began=began)
        books = Books(simulator, agenda, journal, progress, on_event or (lambda event: None))
        books.tell("planned")
        if pool is not None:
            pool.known(agenda.recorded)
            _make_runs(books, tuple(responses), make_pool, pool, interrupts, how.max_failures)
        else:
            how.tidy(simulator, agenda.recorded)
    return agenda


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
    make_pool = HowToRun().pool_maker(simulator, 1)
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


class Books:
    """What is known of an evaluation while it goes on, and who is told."""

    def __init__(
        self, simulator: Simulator, agenda: Agenda, journal: Journal, progress: Progress, watch: Watcher
    ) -> None:
        self.simulator = simulator
        self.agenda = agenda
        self.progress = progress
        self._journal = journal
        self._watch = watch
        self._tries: Counter[str] = (
            Counter()
        )  # by this evaluation; a run's own count goes on from earlier ones

    def tell(self, kind: EventKind, key: str = "", run: Run | None = None) -> None:
        """Tell whoever watches."""
        self._watch(RunEvent(kind, self.progress, key, run))

    def start(self, task: Task) -> None:
        """Note that a run has been handed to a worker."""
        self.progress.start(task.key)
        self.tell("started", task.key)

    def end(self, outcomes: list[Outcome]) -> list[Task]:
        """Record runs that have ended; give those to be tried again at once.

        They are durable before anybody is told of one.
        """
        self._journal.append(outcome.run for outcome in outcomes)
        again = []
        for outcome in outcomes:
            run = outcome.run
            self.agenda.recorded[run.key] = run
            _keep_details(self._journal, outcome)
            self._tries[run.key] += 1
            if not run.done and self._tries[run.key] <= self.simulator.options.retries:
                self.progress.retry(run)
                self.tell("retried", run.key, run)
                again.append(Task(run.key, dict(run.factors), run.replicate, run.attempt + 1))
            else:
                self.progress.end(run)
                self.tell("finished" if run.done else "failed", run.key, run)
        return again


def _make_runs(
    books: Books,
    names: tuple[str, ...],
    make_pool: Callable[[int | None], Pool],
    pool: Pool,
    interrupts: Interrupts,
    max_failures: int | None,
) -> None:
    """Dispatch what is to be done; say why it ended before the end."""
    progress = books.progress
    announced = False

    def urgency() -> int:
        nonlocal announced
        too_many = max_failures is not None and progress.failed >= max_failures
        wanted = max(interrupts.count, int(too_many))
        if wanted and not announced:
            announced = True
            books.tell("stopping")
        return wanted

    def end(outcomes: list[Outcome]) -> None:
        dispatcher.add(books.end(outcomes))

    dispatcher = Dispatcher(
        books.simulator, names, make_pool, pool, urgency=urgency, on_start=books.start, on_end=end
    )
    dispatcher.add(books.agenda.todo)
    dispatcher.run()
    if progress.ended < progress.todo:
        made = f"stopped with {progress.ended} of {progress.todo} runs made, all of them recorded"
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
    if journal.folder.is_symlink() or folder.is_symlink():
        return  # they would be kept elsewhere
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
