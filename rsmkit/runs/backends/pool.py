"""What every backend makes: a pool of workers behind one small interface."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Future
from typing import Protocol

from rsmkit.runs.one_run.execute import Outcome, Task
from rsmkit.runs.one_run.simulator import Simulator

__all__ = ["Pool", "WorkerDiedError"]


class WorkerDiedError(Exception):
    """The worker that had this batch, and only this batch, died."""


class Pool(Protocol):
    """Workers that make runs."""

    jobs: int

    @property
    def patience_s(self) -> float:
        """Time after its limit at which a batch is given up from here."""
        ...

    def submit(
        self, simulator: Simulator, tasks: Sequence[Task], names: tuple[str, ...]
    ) -> Future[list[Outcome]]:
        """Hand a batch to the next free worker; raises ``BrokenExecutor`` when the pool is beyond use."""
        ...

    def output(self) -> str:
        """Give what a crashed run printed, as far as the pool can tell."""
        ...

    def check(self) -> None:
        """Raise RsmkitError when there is no use in waiting any longer."""
        ...

    def age_s(self, future: Future[list[Outcome]]) -> float:
        """Time since a worker began a batch, once its simulator was loaded and warm; at most 0 before."""
        ...

    def abandon(self, future: Future[list[Outcome]]) -> bool:
        """End one batch that takes too long and leave the others alone; False if that cannot be done."""
        ...

    def close(self, *, kill: bool) -> None:
        """Let the workers go, or end them whatever they are doing."""
        ...
