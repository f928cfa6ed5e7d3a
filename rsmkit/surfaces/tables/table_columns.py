"""Columns of a table of finished experiments: rows that can be used, numbers, categories."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rsmkit.errors import RsmkitError
from rsmkit.io.tables.csv_tables import Table
from rsmkit.language.space import Floats

__all__ = [
    "Columns",
    "category_column",
    "is_numeric",
    "numbers",
    "outcomes",
    "run_weights",
    "sort_out",
    "texts_of",
    "without_rows",
]

MISSING = ("", "na", "nan", "n/a", "#n/a", "null", "none", ".", "*")
OUTCOMES = {"yes": 1.0, "no": 0.0, "true": 1.0, "false": 0.0}
"""Words for one trial."""
EXTREME = 1e70
"""Products of a few numbers up to this size, or down to its reciprocal, can be computed."""


@dataclass(frozen=True)
class Columns:
    """Which columns of a table are what.

    Parameters
    ----------
    factors, responses : tuple of str
    blocks, weights : str, optional
    random : tuple of str
    size : str, optional
        Trials or exposure.
    """

    factors: tuple[str, ...]
    responses: tuple[str, ...]
    blocks: str | None = None
    weights: str | None = None
    random: tuple[str, ...] = ()
    size: str | None = None

    @property
    def others(self) -> list[str]:
        """Columns beside factors and responses."""
        return [name for name in (self.blocks, self.weights, self.size, *self.random) if name]

    def check(self) -> None:
        """Refuse what means nothing.

        Raises
        ------
        RsmkitError
            Without factors or responses, or for a column that is named twice.
        """
        if not self.factors or not self.responses:
            raise RsmkitError("name at least one factor column and one response column")
        columns = [*self.factors, *self.responses, *self.others]
        for name in columns:
            if columns.count(name) > 1:
                raise RsmkitError(
                    f"column {name} is named twice; a column is one factor or component, one response, or "
                    "one of blocks, weights, random groups, trials and exposure"
                )


def sort_out(table: Table, columns: Columns) -> dict[str, dict[int, str]]:
    """Say per response why rows cannot be used: line of the file and reason.

    Raises
    ------
    RsmkitError
        If no row is left.
    """
    needed = [*columns.factors, *columns.others]
    given = {name: _given(table, name) for name in [*needed, *columns.responses]}
    common = [", ".join(f"no {name}" for name in needed if not given[name][i]) for i in range(len(table))]
    if columns.weights:
        kept = [i for i, reason in enumerate(common) if not reason]
        weights = run_weights(table.rows([not reason for reason in common]), columns.weights)
        for i, weight in zip(kept, weights.tolist(), strict=True):
            common[i] = "" if weight > 0 else "weight 0"
    left_out = {}
    for response in columns.responses:
        missing = [
            reason or ("" if ok else f"no {response}")
            for reason, ok in zip(common, given[response], strict=True)
        ]
        left_out[response] = {
            line: reason for line, reason in zip(table.lines, missing, strict=True) if reason
        }
        if all(missing):
            names = ", ".join([response, *columns.factors, *filter(None, [columns.blocks]), *columns.random])
            weighing = " and a weight above zero" if columns.weights else ""
            raise RsmkitError(f"{table.source}: no row has a value of {names}{weighing}")
    return left_out


def without_rows(table: Table, exclude: Sequence[int]) -> Table:
    """Leave rows out by their number, from 1 below the line of names.

    Raises
    ------
    RsmkitError
        For a number that no row has.
    """
    wrong = [row for row in exclude if not 1 <= row <= len(table)]
    if wrong:
        raise RsmkitError(
            f"{table.source}: has no row {wrong[0]} to exclude; its rows are 1 to {len(table)}, counted "
            "below the line of names"
        )
    left_out = set(exclude)
    return table.rows([i + 1 not in left_out for i in range(len(table))])


def is_numeric(table: Table, name: str) -> bool:
    """Whether any value of a column is a number."""
    return any(table.number(text) is not None for text in table.texts(name))


def numbers(table: Table, name: str) -> Floats:
    """One column as numbers.

    Raises
    ------
    RsmkitError
        With the line, for a text or a number of a size that cannot be squared.
    """
    values = []
    for line, text in zip(table.lines, table.texts(name), strict=True):
        value = table.number(text)
        if value is None:
            raise RsmkitError(f"column {name}, line {line}: '{text}' is not a finite number")
        if value and not 1 / EXTREME < abs(value) < EXTREME:
            size, unit = ("large", "larger") if abs(value) > 1 else ("small", "smaller")
            raise RsmkitError(
                f"column {name}, line {line}: {text} is too {size} to be squared; take a {unit} unit"
            )
        values.append(value)
    return np.array(values)


def outcomes(table: Table, name: str) -> Floats:
    """One column as numbers, or, where it holds no number, yes as 1 and no as 0.

    Raises
    ------
    RsmkitError
        With the line, for any other text.
    """
    if is_numeric(table, name):
        return numbers(table, name)
    values = []
    for line, text in zip(table.lines, table.texts(name), strict=True):
        if text.lower() not in OUTCOMES:
            raise RsmkitError(
                f"column {name}, line {line}: '{text}' is neither yes nor no; write 1 or 0, "
                f"or one of {', '.join(OUTCOMES)}"
            )
        values.append(OUTCOMES[text.lower()])
    return np.array(values)


def run_weights(table: Table, name: str) -> Floats:
    """Weights, of which some may be zero.

    Raises
    ------
    RsmkitError
        With the line, for what is no number or below zero.
    """
    values = numbers(table, name)
    for line, value in zip(table.lines, values.tolist(), strict=True):
        if value < 0:
            raise RsmkitError(f"column {name}, line {line}: a weight of {value:g} is negative")
    return values


def texts_of(table: Table, name: str) -> list[str]:
    """One column as texts; 1, 1.0 and 01 are the same."""
    found = [table.number(text) for text in table.texts(name)]
    if any(number is None for number in found):
        return list(table.texts(name))
    return [format(number, ".15g") for number in found]


def category_column(table: Table, name: str) -> tuple[tuple[str, ...], Floats]:
    """Levels of a column of names, numbers by size, and the index of the level in each row.

    Raises
    ------
    RsmkitError
        If there is one level only.
    """
    texts = texts_of(table, name)
    levels = _ordered(set(texts))
    if len(levels) < 2:
        raise RsmkitError(f"column {name} holds '{levels[0]}' only: it is no factor of these runs")
    position = {level: float(i) for i, level in enumerate(levels)}
    return levels, np.array([position[text] for text in texts])


def _ordered(texts: set[str]) -> tuple[str, ...]:
    try:
        return tuple(sorted(texts, key=float))
    except ValueError:
        return tuple(sorted(texts))


def _given(table: Table, name: str) -> Sequence[bool]:
    """Whether there is a value in each row of a column; other words than NA may be categories."""
    texts = table.texts(name)
    if is_numeric(table, name):
        return [text.lower() not in MISSING for text in texts]
    return [text not in ("", "NA") for text in texts]
