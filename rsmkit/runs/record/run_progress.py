"""How far an evaluation has come: events for whoever watches, and an estimate of the time that is left."""

from __future__ import annotations

import statistics
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from time import monotonic
from typing import Literal

from rsmkit.runs.record.run import Run

__all__ = ["EventKind", "Progress", "RunEvent", "Watcher", "remaining_seconds"]

_MEDIAN_WINDOW = 501

EventKind = Literal["planned", "started", "finished", "failed", "retried", "stopping"]


def remaining_seconds(
    durations: Sequence[float], queued: int, ages: Iterable[float], jobs: int
) -> float | None:
    """Estimate the time until all runs have ended.

    The median run time stands for every run still to come (a mean jumps with each slow run); a run already
    under way needs what it has not yet used of it.

    Parameters
    ----------
    durations : sequence of float
        Seconds that finished runs took.
    queued : int
        Runs not yet started.
    ages : iterable of float
        Seconds since each running run started.
    jobs : int
        Runs made at the same time.

    Returns
    -------
    float or None
        Seconds; None before the first run has ended.
    """
    if not durations:
        return None
    median = statistics.median(durations)
    return (queued * median + sum(max(median - age, 0.0) for age in ages)) / jobs


@dataclass
class Progress:
    """Counts of one evaluation, updated while it goes on.

    Parameters
    ----------
    planned : int
        Rows of the design.
    distinct : int
        Runs these need (repeated points of a deterministic simulator share one).
    recorded : int
        Those already in the journal when the evaluation began.
    todo : int
        Runs to make.
    jobs : int
        Runs made at the same time.
    began : float
        When the evaluation began, by the monotonic clock.
    """

    planned: int
    distinct: int
    recorded: int
    todo: int
    jobs: int
    done: int = 0
    failed: int = 0
    running: dict[str, float] = field(default_factory=dict)
    simulator_seconds: float = 0.0
    began: float = field(default_factory=monotonic)
    _worker_seconds: float = 0.0
    _counted_until: float = 0.0
    _durations: deque[float] = field(default_factory=lambda: deque(maxlen=_MEDIAN_WINDOW))

    def __post_init__(self) -> None:
        self._counted_until = self.began

    def start(self, key: str) -> None:
        """Note that a run has been handed to a worker."""
        self.running[key] = monotonic()

    def end(self, run: Run) -> None:
        """Note that a run has ended."""
        self._stop(run)
        if run.done:
            self.done += 1
            self._durations.append(run.seconds)
        else:
            self.failed += 1

    def retry(self, run: Run) -> None:
        """Note that a run has failed and is queued again."""
        self._stop(run)

    def _stop(self, run: Run) -> None:
        now = monotonic()
        self._worker_seconds += (now - self._counted_until) * min(self.jobs, self.todo - self.ended)
        self._counted_until = now
        self.running.pop(run.key, None)
        self.simulator_seconds += run.seconds

    @property
    def ended(self) -> int:
        """Runs made by this evaluation so far."""
        return self.done + self.failed

    @property
    def median_seconds(self) -> float | None:
        """Median duration of the latest successful runs."""
        return statistics.median(self._durations) if self._durations else None

    @property
    def elapsed_seconds(self) -> float:
        """Time since the evaluation began."""
        return monotonic() - self.began

    @property
    def own_fraction(self) -> float:
        """Share of the workers' time that did not go into the simulator, between 0 and 1.

        A worker for which no run is left does not count: the last runs may take as long as they like.
        """
        if self._worker_seconds <= 0.0:
            return 0.0
        return min(1.0, max(0.0, 1.0 - self.simulator_seconds / self._worker_seconds))

    def remaining_seconds(self) -> float | None:
        """Estimate the time left; see :func:`remaining_seconds`."""
        now = monotonic()
        ages = [now - since for since in self.running.values()]
        queued = self.todo - self.ended - len(ages)
        return remaining_seconds(list(self._durations), max(queued, 0), ages, self.jobs)


@dataclass(frozen=True)
class RunEvent:
    """Something happened to an evaluation.

    ``kind`` is ``planned`` (once, first), ``started``, ``finished`` or ``failed`` (with the run that ended),
    or ``stopping`` (asked to stop; running runs are finished first).
    """

    kind: EventKind
    progress: Progress
    key: str = ""
    run: Run | None = None


Watcher = Callable[[RunEvent], None]
