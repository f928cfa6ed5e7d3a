"""The runs of a set of points, each counted once however many points share it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from rsmkit.runs.record.run_table import Runs

__all__ = ["DesignRuns"]


@dataclass(frozen=True)
class DesignRuns:
    """The runs of a set of points; a run shared by repeated points counts once."""

    runs: Runs

    @cached_property
    def _distinct(self) -> list[int]:
        first: dict[str, int] = {}
        for row, run in enumerate(self.runs.runs):
            first.setdefault(run.key if run else f"missing {self.runs.points[row].tolist()}", row)
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
    def missing(self) -> int:
        """Runs still to be made."""
        return int(self.runs.missing[self._distinct].sum())

    @cached_property
    def usable(self) -> Runs:
        """Runs that ended well, each once: what a surface can be fitted to."""
        chosen = tuple(self.runs.runs[row] for row in self._distinct)
        points = self.runs.points[self._distinct]
        return Runs(self.runs.space, points, chosen, self.runs.responses).finished()

    @property
    def errors(self) -> tuple[str, ...]:
        """One line per failed run: where, and why."""
        return tuple(run.described for run in self.runs.failures())
