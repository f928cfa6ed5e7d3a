"""Runs in the order of the points they belong to: what fitting, tables and ``responses.csv`` read."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rsmkit.errors import RsmkitError
from rsmkit.io.tables.csv_tables import free_name, write_table
from rsmkit.language.space import Floats, Space
from rsmkit.runs.record.run import Run, State

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["Runs"]


@dataclass(frozen=True)
class Runs:
    """A design's points with the run of each.

    Parameters
    ----------
    space : Space
        The factors.
    points : array, shape (n, k)
        Natural units.
    runs : tuple of Run or None
        One for each point; None where no run has ended yet. Repeated points of a deterministic simulator
        share one.
    responses : tuple of str
        Names of the numbers asked for. When empty, those of the first successful run.
    outcomes : tuple of str
        Those among them that a run has also when it ended badly: whether it did.
    """

    space: Space
    points: Floats
    runs: tuple[Run | None, ...]
    responses: tuple[str, ...] = ()
    outcomes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not self.responses:
            first = next((run for run in self.runs if run is not None and run.done), None)
            object.__setattr__(self, "responses", tuple(first.responses) if first else ())

    def __len__(self) -> int:
        return len(self.runs)

    @property
    def X(self) -> Floats:
        """All points, natural units, shape (n, k)."""
        return self.points

    def y(self, name: str) -> Floats:
        """One response (or any other number the simulator returned), shape (n,); nan where there is none.

        Raises
        ------
        RsmkitError
            If no run has such a number.
        """
        usable = self.usable | self.failed if name in self.outcomes else self.usable
        values = np.array(
            [
                run.value(name) if run is not None and ok else np.nan
                for run, ok in zip(self.runs, usable, strict=True)
            ]
        )
        if usable.any() and np.isnan(values).all():
            raise RsmkitError(f"no run has a number named {name}; there are {', '.join(self.responses)}")
        return values

    @cached_property
    def done(self) -> NDArray[np.bool_]:
        """Which points have a run with all responses, shape (n,)."""
        return self._are("done")

    @cached_property
    def partial(self) -> NDArray[np.bool_]:
        """Which points have a run made by hand with some of the responses, shape (n,)."""
        return self._are("partial")

    @cached_property
    def excluded(self) -> NDArray[np.bool_]:
        """Which points have a run that was excluded, shape (n,)."""
        return self._are("excluded")

    @cached_property
    def failed(self) -> NDArray[np.bool_]:
        """Which points have a run that ended badly, shape (n,)."""
        return self._are("failed")

    @cached_property
    def missing(self) -> NDArray[np.bool_]:
        """Which points have not been run, or by a run that was not asked for all responses, shape (n,)."""
        return self._are("missing")

    @cached_property
    def usable(self) -> NDArray[np.bool_]:
        """Which points have a run with any response, shape (n,)."""
        return self.done | self.partial

    @cached_property
    def states(self) -> tuple[State, ...]:
        """How far each point's run has come."""
        return tuple("missing" if run is None else run.state(self.responses) for run in self.runs)

    def _are(self, state: State) -> NDArray[np.bool_]:
        return np.array([other == state for other in self.states], bool)

    def as_made(self) -> Runs:
        """The same runs at the settings they were made at, which by hand are not always the planned ones."""
        made = [
            point if run is None or run.made_at == run.factors else self.space.point(run.made_at)
            for point, run in zip(self.points, self.runs, strict=True)
        ]
        return replace(self, points=np.array(made).reshape(self.points.shape))

    def finished(self) -> Runs:
        """Only the points whose run has responses: all of them, or by hand any."""
        keep = self.usable
        runs = tuple(run for run, ok in zip(self.runs, keep, strict=True) if ok)
        return replace(self, points=self.points[keep], runs=runs)

    def failures(self) -> list[Run]:
        """Runs that ended badly, each once."""
        unique = {
            run.key: run for run, bad in zip(self.runs, self.failed, strict=True) if bad and run is not None
        }
        return list(unique.values())

    def to_csv(self, path: Path, kinds: Sequence[str] = ()) -> None:
        """Write the table for a spreadsheet (``responses.csv``), in one step; a view, never read back.

        Parameters
        ----------
        path : path
            File to replace.
        kinds : sequence of str, optional
            What each point of the design is; replicates follow their point.
        """
        write_table(path, self._rows(kinds))

    def _rows(self, kinds: Sequence[str]) -> Iterator[list[object]]:
        extras = list(dict.fromkeys(name for run in self.runs if run for name in run.extras))
        columns = [name for name in extras if name not in self.responses]
        taken = (*self.space.names, *self.responses, *columns)
        number, status, kind_head, *about = (
            free_name(name, taken) for name in ("run", "status", "kind", "seconds", "error", "key")
        )
        kind = [kind_head] if kinds else []
        yield [number, *kind, *self.space.names, status, *self.responses, *about, *columns]
        table = zip(self.points, self.runs, self.states, strict=True)
        for index, (point, run, state) in enumerate(table):
            kind_here = kinds[index * len(kinds) // len(self)] if kinds else ""
            row: list[object] = [index + 1, *[kind_here] * len(kind), *self.space.values(point).values()]
            if run is None:
                row += ["missing", *[""] * (len(self.responses) + len(about) + len(columns))]
            else:
                row += [
                    state if run.by_hand else run.status,
                    *(_cell(run.value(name)) for name in self.responses),
                ]
                row += [run.seconds, run.error, run.key, *(_cell(run.extras.get(name)) for name in columns)]
            yield row

    def to_frame(self) -> pd.DataFrame:
        """Give the table to pandas, one row per point in the order of the design.

        Returns
        -------
        pandas.DataFrame
            Factors in natural units (categories by name), responses (nan where there is none) and ``status``:
            ``done``, ``failed``, ``timeout``, ``crashed`` or ``missing``. The index ``run`` counts from 1,
            as in ``responses.csv``.
        """
        import pandas as pd

        rows = [
            [
                *self.space.values(point).values(),
                *(run.value(name) if run else np.nan for name in self.responses),
                run.status if run else "missing",
            ]
            for point, run in zip(self.points, self.runs, strict=True)
        ]
        columns = [*self.space.names, *self.responses, "status"]
        return pd.DataFrame(rows, pd.RangeIndex(1, len(self) + 1, name="run"), columns)

    def _overview(self) -> str:
        words: tuple[State, ...] = ("done", "partial", "excluded", "failed", "missing")
        states = ", ".join(f"{count} {word}" for word in words if (count := self.states.count(word)))
        of = f" of {', '.join(self.responses)}" if self.responses else ""
        text = f"{len(self)} runs{of}{f': {states}' if states else ''}"
        failures = self.failures()
        return f"{text}; first failure at {failures[0].described}" if failures else text

    def __repr__(self) -> str:
        return f"<Runs: {self._overview()}>"

    def _repr_html_(self) -> str:
        head = "".join(f"<th>{escape(name)}</th>" for name in (*self.space.names, *self.responses, "status"))
        body = []
        for point, run in zip(self.points, self.runs, strict=True):
            cells = [str(value) for value in self.space.values(point).values()]
            cells += [f"{run.value(name):.6g}" if run else "" for name in self.responses]
            cells.append(f"{run.status} {run.error}".strip() if run else "missing")
            body.append("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in cells) + "</tr>")
        caption = f"<caption>{escape(self._overview())}</caption>"
        return f"<table>{caption}<tr>{head}</tr>{''.join(body)}</table>"


def _cell(value: object) -> object:
    return "" if value is None or (isinstance(value, float) and np.isnan(value)) else value
