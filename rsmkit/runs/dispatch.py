"""Handing runs to workers and getting outcomes back, through the death of workers.

When a worker process dies, its pool is lost and with it everything in flight. Each of these runs is repeated
alone in a fresh process, which keeps what is printed, and only one that dies there too is recorded as
crashed. A process that was killed from outside (``SIGKILL``: a person, or the kernel out of memory) gets the
benefit of the doubt twice.
"""

from __future__ import annotations

import time
from collections import Counter, deque
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import BrokenExecutor, Future, wait
from dataclasses import dataclass
from math import ceil
from queue import Empty, SimpleQueue

from rsmkit.errors import RsmkitError
from rsmkit.runs.backends.pool import BatchCut, Pool, WorkerDiedError
from rsmkit.runs.one_run.command import end_command
from rsmkit.runs.one_run.execute import Outcome, Task, given_up, hard_limit_s
from rsmkit.runs.one_run.simulator import Simulator
from rsmkit.runs.record.run import Status

__all__ = ["Dispatcher"]

POLL_S = 0.1  # how late a wish to stop, or a time limit, may be noticed
ABSENT_S = 5.0  # a longer time between two looks means that this process was stopped, not busy
PARDONED_KILLS = 2  # of a run: SIGKILL may have been meant for another, or for its memory
STARTS_TRIED = 3
BATCH_SECONDS = 0.25  # of work in a batch: handing over costs little of it, and as much is lost in a crash
LARGEST_BATCH = 250


@dataclass(frozen=True)
class Batch:
    """A batch of runs that a worker has been given."""

    tasks: tuple[Task, ...]
    since: float

    @property
    def age_s(self) -> float:
        """Seconds since it was given, or since its worker was ready for it when that is known."""
        return time.monotonic() - self.since

    def aged(self, age_s: float) -> Batch:
        """The same batch at another age."""
        return Batch(self.tasks, time.monotonic() - max(age_s, 0.0))


class Dispatcher:
    """Runs tasks on a pool until none is left or someone asks to stop.

    Parameters
    ----------
    simulator : Simulator
        What to run.
    names : tuple of str
        Responses asked for.
    make_pool : callable
        Makes another pool of the given number of workers.
    pool : Pool
        The pool to begin with; its number of workers is the number of runs in flight.
    urgency : callable
        Asked often: 0 go on, 1 finish what is in flight and stop, 2 stop at once.
    on_start : callable
        Called with each task as it is given to a worker.
    on_end : callable
        Called with the outcomes that have arrived; must make them durable.
    """

    def __init__(
        self,
        simulator: Simulator,
        names: tuple[str, ...],
        make_pool: Callable[[int | None], Pool],
        pool: Pool,
        *,
        urgency: Callable[[], int],
        on_start: Callable[[Task], None],
        on_end: Callable[[list[Outcome]], None],
    ) -> None:
        self._simulator = simulator
        self._names = names
        self._make_pool = make_pool
        self._jobs, self._shares, self._ahead = pool.jobs, pool.shares, pool.ahead
        self._urgency = urgency
        self._on_start = on_start
        self._on_end = on_end
        # None between two pools. One of a single worker, while there are suspects: who dies there is guilty.
        self._pool: Pool | None = pool
        # A task is in exactly one place: waiting, suspect, in flight, or arrived and then recorded.
        self._waiting: deque[Task] = deque()
        self._suspects: deque[Task] = deque()  # were there when a worker died; each is repeated alone
        self._flights: dict[Future[list[Outcome]], Batch] = {}
        self._arrived: list[Outcome] = []  # not yet recorded
        # Futures that have ended, put here by the pool's threads. One that is not in flight was given up.
        self._landed: SimpleQueue[Future[list[Outcome]]] = SimpleQueue()
        self._kills: Counter[str] = Counter()  # how often each run's process was killed from outside
        self._durations: deque[float] = deque(maxlen=25)  # of the latest runs: how many make a batch
        self._looked = 0.0  # when the limits were looked at last

    def add(self, tasks: Iterable[Task]) -> None:
        """Put tasks at the end of the queue; also allowed from ``on_end``."""
        self._waiting.extend(tasks)

    def run(self) -> None:
        """Work until the queue is empty or the urgency says stop.

        Raises
        ------
        RsmkitError
            If the simulator cannot be loaded or no worker can be started.
        """
        self._looked = time.monotonic()
        left = False
        try:
            while (urgency := self._urgency()) < 2:
                left = urgency == 1 and self._shares
                if left:  # what waits in a queue is not waited for, but stays there for the next evaluation
                    return
                if not urgency:
                    self._fill()
                if not self._flights:
                    return
                self._receive()
                self._end_overdue()
                if self._pool is not None:
                    self._pool.check()
        finally:
            try:
                self._take_leave()
            finally:
                self._drop_pool(kill=bool(self._flights) and not left)

    def _fill(self) -> None:
        if self._suspects:
            if not self._flights:  # alone, so that its death can only be its own doing
                self._launch(1, [self._suspects.popleft()])
            return
        if self._flights and self._pool is not None and self._pool.jobs < self._jobs:
            return  # the last suspect is still being run alone
        if self._pool is not None and self._pool.grows:
            self._jobs = self._pool.jobs
        while self._waiting:
            size = self._batch_size()
            # A batch is short work: one more per worker waits in line, so that nobody idles in between.
            most = self._jobs if size == 1 or self._shares else 2 * self._jobs
            if len(self._flights) >= most + self._ahead:
                return
            self._launch(self._jobs, [self._waiting.popleft() for _ in range(size)])

    def _batch_size(self) -> int:
        """Runs to hand over at once: one, unless they are so short that handing over would dominate."""
        if self._simulator.options.batch:
            return min(self._simulator.options.batch, len(self._waiting))
        if self._shares:
            return ceil(len(self._waiting) / max(1, self._jobs - len(self._flights)))
        if not self._durations:
            return 1
        typical = sorted(self._durations)[len(self._durations) // 2]  # a median: one slow run changes nothing
        # Half a worker's share of what is left, so that batches shrink and all workers end together.
        fair = ceil(len(self._waiting) / (2 * self._jobs))
        return max(1, min(int(BATCH_SECONDS / max(typical, 1e-6)), fair, LARGEST_BATCH))

    def _launch(self, jobs: int, tasks: Sequence[Task]) -> None:
        for start in range(STARTS_TRIED):
            if self._pool is None or self._pool.jobs != jobs:
                self._drop_pool(kill=False)
                self._pool = self._make_pool(jobs)
            try:
                future = self._pool.submit(self._simulator, tasks, self._names)
                break
            except BrokenExecutor as error:  # a worker died while idle: nobody's fault, a new pool will do
                if start == STARTS_TRIED - 1:
                    raise RsmkitError(
                        f"worker processes keep dying as they start: {self._pool.death_cause(error)}"
                    ) from None
                self._drop_pool(kill=True)
        self._flights[future] = Batch(tuple(tasks), time.monotonic())
        future.add_done_callback(self._landed.put)
        for task in tasks:
            self._on_start(task)

    def _receive(self) -> None:
        """Take in and record everything that has landed; wait a moment if nothing has."""
        landed = []
        try:
            landed.append(self._landed.get(timeout=POLL_S))
            while True:
                landed.append(self._landed.get_nowait())
        except Empty:
            pass
        broken: BaseException | None = None
        for future in landed:
            flight = self._flights.get(future)
            if flight is None:
                continue
            error = future.exception()
            if isinstance(error, BrokenExecutor):  # so do all others in flight: sort them out together
                broken = error
            else:
                del self._flights[future]
                self._arrive(flight, future, error)
        if broken is not None:
            self._recover(broken)
        elif not self._urgency():
            self._fill()  # workers go on while the outcomes are being written to the disk
        self._record()

    def _arrive(self, flight: Batch, future: Future[list[Outcome]], error: BaseException | None) -> None:
        if isinstance(error, RsmkitError):  # no run is to blame: the next would end the same way
            raise error
        if isinstance(error, BatchCut):
            self._arrived += error.outcomes
            self._waiting.extendleft(reversed(error.again))
        elif isinstance(error, WorkerDiedError):
            if len(flight.tasks) == 1 and self._pool is not None and self._pool.jobs == 1:
                text = f"the simulator's process died, {error}"
                self._arrived.append(self._verdict(flight.tasks[0], "crashed", text, flight.age_s))
            else:
                self._suspects.extend(flight.tasks)
        elif error is not None and len(flight.tasks) > 1:  # one of them cannot be sent back: which?
            self._suspects.extend(flight.tasks)
        elif error is not None:
            text = f"the worker could not return the result: {type(error).__name__}: {error}"
            self._arrived.append(self._verdict(flight.tasks[0], "failed", text, flight.age_s))
        else:
            outcomes = future.result()
            self._durations.extend(outcome.run.seconds for outcome in outcomes)
            self._arrived += outcomes

    def _record(self) -> None:
        arrived, self._arrived = self._arrived, []
        if arrived:
            self._on_end(arrived)
        if self._pool is not None:
            self._pool.recorded()

    def _take_leave(self) -> None:
        """Record what had ended when the work stopped, whatever stopped it."""
        for future in self._flights:
            if future.done() and not future.cancelled():
                error = future.exception()
                self._arrived += error.outcomes if isinstance(error, BatchCut) else []
                self._arrived += [] if error else future.result()
        self._record()

    def _recover(self, cause: BaseException) -> None:
        """Sort out what a dead worker took along: what had arrived, the guilty, and what to repeat."""
        wait(self._flights, timeout=10.0)  # the pool fails them one after the other, some may have succeeded
        lost: list[Batch] = []
        flights, self._flights = self._flights, {}
        for future, flight in flights.items():
            error = future.exception() if future.done() else cause
            if isinstance(error, BrokenExecutor):
                lost.append(flight.aged(self._age_s(future, flight)))
            else:
                self._arrive(flight, future, error)
        alone = self._pool is not None and self._pool.jobs == 1
        printed = self._pool.output() if self._pool else ""
        reason = self._pool.death_cause(cause) if self._pool else "unknown cause"
        self._drop_pool(kill=True)
        for task in (task for flight in lost for task in flight.tasks):
            # A dead worker's external program may live on, and write into the folder of the repeated run.
            end_command(self._simulator.folder / "runs" / task.key)

        overdue = [flight for flight in lost if len(flight.tasks) == 1 and self._is_overdue(flight)]
        if len(overdue) == 1:  # its own watchdog ended the worker: nobody else need be repeated alone
            self._arrived.append(self._overtime(overdue[0], printed))
            self._requeue([flight for flight in lost if flight is not overdue[0]])
        elif alone and len(lost) == 1 and len(lost[0].tasks) == 1:
            self._blame(lost[0], reason, printed)
        else:
            self._suspects.extend(task for flight in lost for task in flight.tasks)

    def _blame(self, flight: Batch, cause: str, printed: str) -> None:
        (task,) = flight.tasks
        if cause == "SIGKILL":
            self._kills[task.key] += 1
            if self._kills[task.key] <= PARDONED_KILLS:
                self._suspects.append(task)
                return
            cause = "SIGKILL; was it out of memory?"
        text = f"the simulator's process died ({cause})"
        self._arrived.append(self._verdict(task, "crashed", text, flight.age_s, printed))

    def _is_overdue(self, flight: Batch) -> bool:
        limit = hard_limit_s(self._simulator, len(flight.tasks))
        return limit is not None and flight.age_s >= limit

    def _overtime(self, flight: Batch, printed: str) -> Outcome:
        text = f"its process was ended after timeout_s = {self._simulator.options.timeout_s:g} s"
        return self._verdict(flight.tasks[0], "timeout", text, flight.age_s, printed)

    def _end_overdue(self) -> None:
        """End a run that nobody has ended at its hard limit (a stopped process, a thread that cannot be)."""
        before, self._looked = self._looked, time.monotonic()
        if self._looked - before > ABSENT_S:  # this process was stopped: what has ended is still to come in
            self._begin_anew()
        for future, flight in self._flights.items():
            limit = hard_limit_s(self._simulator, len(flight.tasks))
            if limit is None or self._pool is None or future.done():
                continue
            # Cheap questions first: patience looks at processes, an age by the pool may ask a cluster.
            if flight.age_s > limit and flight.age_s > limit + self._pool.patience_s:
                age = self._age_s(future, flight)
                if future.done():  # while that was asked
                    return
                if age > limit + self._pool.patience_s:
                    self._abandon(self._pool, future, flight)
                else:  # it was waiting for a worker, or for its simulator to be loaded and warm
                    self._flights[future] = flight.aged(age)
                return  # what is in flight has changed; the next look is a moment away

    def _age_s(self, future: Future[list[Outcome]], flight: Batch) -> float:
        """Seconds that a batch has been under way, as far as the pool can tell."""
        return flight.age_s if self._pool is None else min(flight.age_s, self._pool.age_s(future))

    def _abandon(self, pool: Pool, future: Future[list[Outcome]], flight: Batch) -> None:
        del self._flights[future]
        certain = pool.jobs == 1  # with several at once, another run may have held this one up
        if pool.abandon(future):
            self._begin_anew()  # the others may have been held up (and this one, by another)
        else:  # the pool ends all or none; the age is by the worker's own account, so others did not cause it
            certain = True
            self._requeue(self._flights.values())
            self._flights.clear()
            self._drop_pool(kill=True)
        if certain and len(flight.tasks) == 1:
            self._arrived.append(self._overtime(flight, ""))
            self._record()
        else:
            self._suspects.extend(flight.tasks)

    def _begin_anew(self) -> None:
        """Give everything in flight its whole time again."""
        now = time.monotonic()
        self._flights = {future: Batch(flight.tasks, now) for future, flight in self._flights.items()}

    def _requeue(self, flights: Iterable[Batch]) -> None:
        self._waiting.extendleft(reversed([task for flight in flights for task in flight.tasks]))

    def _verdict(self, task: Task, status: Status, error: str, seconds: float, printed: str = "") -> Outcome:
        return given_up(self._simulator, task, status, error, seconds, printed)

    def _drop_pool(self, *, kill: bool) -> None:
        if self._pool is not None:
            self._pool.close(kill=kill)
            self._pool = None
