"""What every backend makes: a pool of workers behind one small interface."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from concurrent.futures import Future

from rsmkit.runs.one_run.execute import Outcome, Task
from rsmkit.runs.one_run.simulator import Simulator
from rsmkit.runs.record.run import Run

__all__ = ["BatchCut", "Pool", "WorkerDiedError"]


class WorkerDiedError(Exception):
    """The worker that had this batch, and only this batch, died."""


class BatchCut(Exception):
    """Some runs of a batch have ended; the others are to be asked for again, and nobody is to blame."""

    def __init__(self, outcomes: list[Outcome], again: list[Task]) -> None:
        super().__init__(f"{len(outcomes)} ended, {len(again)} to be asked for again")
        self.outcomes = outcomes
        self.again = again


class Pool(ABC):
    """Workers that make runs.

    A worker makes a batch by :func:`rsmkit.runs.one_run.execute.run_tasks`, which turns whatever goes wrong
    in a run into its outcome. A backend need only hand over and let go; the rest has answers that are right
    for one whose workers cannot die or hang without the driver.
    """

    jobs: int
    """Runs made at the same time; may change while they are made."""
    shares = False
    """Whether each batch is a whole share of the runs, because what is handed over waits in a queue.

    Asked to stop once, an evaluation leaves it there for the next one.
    """
    grows = False
    """Whether ``jobs`` follows the size of a cluster."""
    ahead = 0
    """Batches handed over beyond these, which wait at the workers."""

    @abstractmethod
    def submit(
        self, simulator: Simulator, tasks: Sequence[Task], names: tuple[str, ...]
    ) -> Future[list[Outcome]]:
        """Hand a batch to the next free worker; raises ``BrokenExecutor`` when the pool is beyond use.

        The future ends with one outcome for each task, in order; with :class:`WorkerDiedError` when the
        worker of this batch alone died; with :class:`BatchCut` when only some of them have ended; with
        ``BrokenExecutor`` when a worker died and took the pool along;
        with ``RsmkitError`` when no run is to blame, which ends the evaluation.
        """

    @abstractmethod
    def close(self, *, kill: bool) -> None:
        """Let the workers go, or end them whatever they are doing; comes back in seconds either way."""

    @property
    def patience_s(self) -> float:
        """Time after its limit at which a batch is given up from here."""
        return 0.0

    def output(self) -> str:
        """Give what a crashed run printed, as far as the pool can tell."""
        return ""

    def check(self) -> None:
        """Do what is to be done now and then; called all the time while runs are awaited.

        Raises RsmkitError when there is no use in waiting any longer.
        """
        return

    def known(self, recorded: Mapping[str, Run]) -> None:
        """Hear before the first batch which runs are on the disk already, by their keys."""
        return

    def recorded(self) -> None:
        """Hear that everything which futures have given so far is on the disk."""
        return

    def age_s(self, future: Future[list[Outcome]]) -> float:
        """Time since a worker began a batch, once its simulator was loaded and warm; at most 0 before.

        Infinity when the pool cannot tell: the time since it was handed over then counts.
        """
        return math.inf

    def abandon(self, future: Future[list[Outcome]]) -> bool:
        """End one batch that takes too long and leave the others alone; False if that cannot be done."""
        return False

    def death_cause(self, error: BaseException) -> str:
        """Name what ended a worker: ``SIGSEGV``, ``exit code 3``, ``unknown cause``."""
        return "unknown cause"
