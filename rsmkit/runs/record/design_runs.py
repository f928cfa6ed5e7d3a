"""The runs of a set of points, each counted once however many points share it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from rsmkit.runs.record.run_table import Runs

__all__ = ["DesignRuns", "run_words"]


def run_words(done: int, distinct: int, others: Mapping[str, int]) -> str:
    """How far runs have come: ``20 of 22 runs done, 1 failed``."""
    parts = [f"{count} {word}" for word, count in others.items() if count]
    return ", ".join([f"{done} of {distinct} runs done", *parts])


@dataclass(frozen=True)
class DesignRuns:
    """The runs of a set of points; a run shared by repeated points counts once.

    Parameters
    ----------
    runs : Runs
        Each point with its run.
    added : Runs, optional
        Runs made by hand that are not of these points and count all the same.
    keys : sequence of str, optional
        The run that each point needs: points that are repeated need several, unless one run is like another.
        Without it repeated points without a run count once.
    """

    runs: Runs
    added: Runs | None = None
    keys: Sequence[str] = ()

    @cached_property
    def _distinct(self) -> list[int]:
        first: dict[str, int] = {}
        for row, run in enumerate(self.runs.runs):
            needed = self.keys[row] if self.keys else f"missing {self.runs.points[row].tolist()}"
            first.setdefault(run.key if run else needed, row)
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
    def partial(self) -> int:
        """Runs made by hand of which some responses are known."""
        return int(self.runs.partial[self._distinct].sum())

    @property
    def excluded(self) -> int:
        """Runs that were excluded."""
        return int(self.runs.excluded[self._distinct].sum())

    @property
    def words(self) -> str:
        """How far the runs have come: ``20 of 22 runs done, 1 partly measured, 1 failed``."""
        told = {"partly measured": self.partial, "excluded": self.excluded, "failed": self.failed}
        return run_words(self.done, self.distinct, told)

    @property
    def missing(self) -> int:
        """Runs still to be made."""
        return int(self.runs.missing[self._distinct].sum())

    @cached_property
    def usable(self) -> Runs:
        """Runs with responses, each once, at the settings they were made at: what surfaces are fitted to."""
        chosen = tuple(self.runs.runs[row] for row in self._distinct)
        points = self.runs.points[self._distinct]
        own = Runs(self.runs.space, points, chosen, self.runs.responses).finished().as_made()
        if self.added is None:
            return own
        more = self.added.finished().as_made()
        return Runs(own.space, np.vstack([own.points, more.points]), own.runs + more.runs, own.responses)

    @cached_property
    def ended(self) -> Runs:
        """Runs of the points that ended, well or badly, each once."""
        rows = [row for row in self._distinct if self.runs.done[row] or self.runs.failed[row]]
        return replace(self.runs, points=self.runs.points[rows], runs=tuple(self.runs.runs[i] for i in rows))

    @property
    def errors(self) -> tuple[str, ...]:
        """One line per failed run: where, and why."""
        return tuple(run.described for run in self.runs.failures())
