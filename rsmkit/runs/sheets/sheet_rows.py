"""What the rows of a filled-in run sheet say, cell by cell."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rsmkit.errors import RsmkitError
from rsmkit.io.tables.csv_tables import Table, free_name, read_table
from rsmkit.language.space import Factor, Floats, Space, Value
from rsmkit.runs.record.run import ACTUAL, EXCLUDED

__all__ = ["WITHDRAWN", "SheetRow", "own_heads", "read_rows"]

OWN_COLUMNS = ("run_order", "run", "kind", "block", "excluded", "comment")
"""Columns that the sheet has of its own, besides factors and responses."""
WITHDRAWN = "withdrawn"
"""Takes back what was recorded before, where an empty cell leaves it."""
BLANKS = ("", "na", "n/a", "n.a.", "nan", "#n/a", "null", "none", "-", ".", "*")
INCLUDED = ("no", WITHDRAWN)
_PLAIN = re.compile(r"[+-]?(0|[1-9]\d{0,14})(\.\d+)?")


@dataclass(frozen=True, eq=False)
class SheetRow:
    """One row of a sheet.

    Parameters
    ----------
    line : int
        Of the file.
    number : int or None
        Of the run in the design, from 1.
    place : float or None
        In the order in which the runs were made, as the row says.
    kind : str
        As the row says, in lower case.
    planned : array, shape (k,)
        The factor columns, natural units; nan where a cell is empty.
    actual : dict of str to value
        Factors that were not as planned; None takes an earlier one back.
    responses : dict of str to float or None
        What was measured; None takes an earlier value back.
    extras : dict of str to float, str or None
        Other columns, and under ``excluded`` why the run is left out; None takes an earlier one back.
    """

    line: int
    number: int | None
    place: float | None
    kind: str
    planned: Floats
    actual: dict[str, Value | None]
    responses: dict[str, float | None]
    extras: dict[str, float | str | None]


def own_heads(space: Space, responses: Sequence[str]) -> dict[str, str]:
    """Heads of the sheet's own columns: ``kind_`` for ``kind`` where a factor or response is called so."""
    taken = (*space.names, *responses)
    return {name: free_name(name, taken) for name in OWN_COLUMNS}


def read_rows(path: Path, space: Space, responses: Sequence[str]) -> list[SheetRow]:
    """Read a filled-in sheet.

    Raises
    ------
    RsmkitError
        Naming every cell that cannot be read.
    """
    needed = (*space.names, *responses)
    table = read_table(path, needed, fill=True)
    missing = [name for name in needed if table.names.count(name) != 1]
    if missing:
        raise RsmkitError(
            f"{path}: needs exactly one column {', '.join(missing)} (its head is {', '.join(table.names)})"
        )
    reader = _Reader(table, space, responses)
    rows = [reader.row(index) for index in range(len(table))]
    if reader.problems:
        raise RsmkitError("\n".join(f"{path.name} {problem}" for problem in reader.problems))
    return rows


class _Reader:
    """Reads the rows of one table, and collects what is wrong with them."""

    def __init__(self, table: Table, space: Space, responses: Sequence[str]) -> None:
        self.table = table
        self.space = space
        self.responses = responses
        self.problems: list[str] = []
        taken = {*space.names, *responses}
        heads = {f"{factor}{ACTUAL}": factor for factor in space.names}
        self.actual = {
            name: heads[head]
            for name in table.names
            if name not in taken and (head := _head_of_actual(name)) in heads
        }
        self.others: dict[int, str] = {}
        self.heads = own_heads(space, responses)
        own = {self.heads[name] for name in ("run_order", "run", "kind", "block")}
        for column, name in enumerate(table.names):
            if name and name not in {*taken, *own, *self.actual}:
                again = table.names[:column].count(name)
                self.others[column] = f"{name} ({again + 1})" if again else name

    def row(self, index: int) -> SheetRow:
        """Read one row."""
        return SheetRow(
            self.table.lines[index],
            self._number(index),
            self._place(index),
            self._own(index, "kind").lower(),
            np.array([self._planned(index, factor) for factor in self.space]),
            self._actual(index),
            self._results(index),
            self._extras(index),
        )

    def _own(self, index: int, column: str) -> str:
        head = self.heads[column]
        return self.table.texts(head)[index] if head in self.table.names else ""

    def _number(self, index: int) -> int | None:
        text = self._own(index, "run")
        number = self.table.number(text) if text else 1.0
        if number is None or number != int(number) or number < 1:
            self._problem(index, f"run = {text!r} is not the number of a run")
            return None
        return int(number) if text else None

    def _place(self, index: int) -> float | None:
        try:
            return self.table.number(self._own(index, "run_order"))
        except RsmkitError:
            return None

    def _planned(self, index: int, factor: Factor) -> float:
        text = self.table.texts(factor.name)[index]
        return self._coordinate(index, factor, text) if text else math.nan

    def _coordinate(self, index: int, factor: Factor, text: str) -> float:
        try:
            value = self.table.value(text, factor.coordinate)
        except RsmkitError as error:
            self._problem(index, str(error))
            return math.nan
        if not math.isfinite(value):
            self._problem(index, f"factor {factor.name}: {text!r} is not a finite number")
        return value

    def _actual(self, index: int) -> dict[str, Value | None]:
        found: dict[str, Value | None] = {}
        for column, name in self.actual.items():
            factor, text = self.space[name], self.table.texts(column)[index]
            if text.lower() == WITHDRAWN:
                found[name] = None
            elif text and not (factor.domain.is_numeric and text.lower() in BLANKS):
                value = self._coordinate(index, factor, text)
                # a number between the levels is kept as it was
                found[name] = value if factor.domain.is_numeric or math.isnan(value) else factor.value(value)
        return found

    def _results(self, index: int) -> dict[str, float | None]:
        found: dict[str, float | None] = {}
        for name in self.responses:
            text = self.table.texts(name)[index]
            if text.lower() == WITHDRAWN:
                found[name] = None
            elif text.lower() not in BLANKS:
                try:
                    found[name] = self.table.number(text)
                    reason = f"{name} = {text!r} is not a number" if found[name] is None else ""
                except RsmkitError as error:
                    reason = f"{name}: {error}"
                if reason:
                    self._problem(index, reason)
        return found

    def _extras(self, index: int) -> dict[str, float | str | None]:
        """What else is in the row: numbers as numbers, but a batch 007 or 12E3 as it stands."""
        found: dict[str, float | str | None] = {}
        for column, name in self.others.items():
            text = self.table.cells[column][index]
            if name == self.heads["excluded"]:
                found |= {EXCLUDED: None if text.lower() in INCLUDED else text} if text else {}
            elif text:
                found[name] = None if text.lower() == WITHDRAWN else self._plain(text)
        return found

    def _plain(self, text: str) -> float | str:
        try:
            plain = self.table.plain(text)
        except RsmkitError:
            return text
        return float(plain) if _PLAIN.fullmatch(plain) else text

    def _problem(self, index: int, text: str) -> None:
        self.problems.append(f"line {self.table.lines[index]}: {text}")


def _head_of_actual(name: str) -> str:
    """The head of a column as people vary it: ``T_actual``, ``T (actual)`` and ``actual T``."""
    for end in ("_actual", " (actual)", ACTUAL):
        if name.lower().endswith(end):
            return f"{name[: -len(end)]}{ACTUAL}"
    return f"{name[7:]}{ACTUAL}" if name.lower().startswith("actual ") else name
