"""Coded units of a table: how they are written, and how its columns are read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.io.tables.csv_tables import split_line
from rsmkit.language.space import Floats

__all__ = ["ColumnUnits", "Reading", "parse_coding", "read_columns"]

ColumnUnits = Literal["natural", "coded"]
"""What numeric factor columns hold."""

TOUCHING = 1e-9
"""Coded values differ from -1, 0 and 1 by rounding of at most this size."""


@dataclass(frozen=True)
class Reading:
    """How the numeric factor columns of a table are read.

    Parameters
    ----------
    hold : {"natural", "coded"}
    ends : dict of str to (low, high)
        Natural values at coded -1 and +1 of every numeric factor.
    notes : tuple of str
        What was assumed because nothing said it.
    """

    hold: ColumnUnits
    ends: Mapping[str, tuple[float, float]]
    notes: tuple[str, ...] = ()


@checked
def parse_coding(text: str) -> dict[str, tuple[float, float]]:
    """Read ``x1=85:5,x2=175:5``: center and half range of each factor.

    Raises
    ------
    RsmkitError
        With the part that does not read so.
    """
    coding: dict[str, tuple[float, float]] = {}
    for part in filter(None, (p.strip() for p in split_line(text))):
        name, _, numbers = part.rpartition("=")
        center, _, half = numbers.partition(":")
        try:
            pair = (float(center), float(half))
        except ValueError:
            raise RsmkitError(
                f"coding '{part}': write it as factor=center:half_range, e.g. x1=85:5"
            ) from None
        if not (abs(pair[0]) < 1e70 and 1e-70 < pair[1] < 1e70):
            raise RsmkitError(f"coding '{part}': needs a finite center and a half range above zero")
        if name.strip() in coding:
            raise RsmkitError(f"coding '{part}': {name.strip()} has a coding already")
        coding[name.strip()] = pair
    return coding


def read_columns(
    columns: Mapping[str, Floats],
    coding: Mapping[str, tuple[float, float]],
    hold: ColumnUnits | None = None,
    *,
    shifted: bool = True,
) -> Reading:
    """Settle how numeric columns are read: as they are asked to be, else as they look.

    With a coding, columns hold natural values unless these contradict it: all columns look coded, and as
    natural values the runs of some factor would have their middle outside the range that its coding gives; or
    no run of some factor would lie in that range, while as coded values all columns reach to both sides of 0.
    Without one, columns hold coded values if all look coded. Natural columns without a coding are coded by
    their range, coded ones are used as they are.

    Parameters
    ----------
    columns : mapping of str to array
        Numeric factor columns.
    coding : mapping of str to (center, half range)
    hold : {"natural", "coded"}, optional
        What the columns hold; judged for all together if nothing says it.
    shifted : bool
        Whether a range may move the origin: not in a model without a constant, which would become another
        one.
    """
    notes: list[str] = []
    if hold is None:
        hold, notes = _guess(columns, coding)
    ends = {}
    for name, values in columns.items():
        center, half = coding.get(name, (0.0, 1.0))
        ends[name] = (center - half, center + half)
        if name not in coding and hold == "natural" and shifted:
            ends[name] = _range(values)
    return Reading(hold, ends, tuple(notes))


def _guess(
    columns: Mapping[str, Floats], coding: Mapping[str, tuple[float, float]]
) -> tuple[ColumnUnits, list[str]]:
    """Judge what columns hold, and say so where the other reading would be another one."""
    names = ", ".join(columns)
    reaches = {name: _reach(columns[name], *pair) for name, pair in coding.items()}
    outside = [name for name, (low, high) in reaches.items() if abs(low + high) >= 2.0]
    nowhere_near = any(low > 1.0 or high < -1.0 for low, high in reaches.values())
    as_coded = all(map(_looks_coded, columns.values())) or (
        nowhere_near and all(values.min() < 0.0 < values.max() for values in columns.values())
    )
    if not columns or not as_coded:
        told = (
            f"the runs are not about the range that --coding gives for {', '.join(outside)}; if the columns"
        )
        return "natural", [f"{told} hold coded values, say --columns coded"] if outside else []
    if not coding:
        if all(_range(values) == (-1.0, 1.0) for values in columns.values()):
            return "coded", []
        told = f"the columns {names} look like coded values and are used as they are; --columns natural"
        return "coded", [f"{told} codes them by their ranges"]
    if outside:
        told = f"the columns {names} hold coded values: as natural ones the runs would not be about the range"
        told += f" that --coding gives for {', '.join(outside)}"
        return "coded", [f"{told}; --columns natural reads them so all the same"]
    if all(low <= -0.5 and high >= 0.5 for low, high in reaches.values()):
        return "natural", []
    told = (
        f"the columns {names} look like coded values but are read as natural ones, which --coding turns into"
    )
    return "natural", [f"{told} coded ones; if they are coded already, say --columns coded"]


def _looks_coded(values: Floats) -> bool:
    """Whether a column looks like coded values.

    Either all lie between -1 and 1 and reach at least halfway to both, or most are -1, 0 or 1, both ends
    among them, however far the others (star points, runs along a path) lie.
    """
    low, high = float(values.min()), float(values.max())
    if max(-low, high) <= 1.0 + TOUCHING:
        return low <= -0.5 and high >= 0.5
    near = [np.abs(values - level) <= TOUCHING for level in (-1.0, 0.0, 1.0)]
    return bool(near[0].any() and near[2].any() and 2 * np.any(near, axis=0).sum() >= len(values))


def _reach(values: Floats, center: float, half: float) -> tuple[float, float]:
    """Ends of a column in coded units if it holds natural values."""
    return (float(values.min()) - center) / half, (float(values.max()) - center) / half


def _range(values: Floats) -> tuple[float, float]:
    """Ends of a column; one unit to either side of a column that never varies."""
    low, high = float(values.min()), float(values.max())
    return (low, high) if low < high else (low - 1.0, high + 1.0)
