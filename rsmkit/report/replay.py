"""Time tables of single runs, which the explorer page plays back."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from rsmkit.errors import DamagedError, RsmkitError
from rsmkit.io.tables.csv_tables import parse_table, read_table_text

__all__ = ["Replay", "read_replay"]

REDO = "Run: rsmkit verify --force"


@dataclass(frozen=True)
class Replay:
    """What happened during one run.

    Parameters
    ----------
    name : str
        Shown in the page; usually the search whose optimum was run.
    factors : mapping
        The design, as the simulator received it.
    columns : mapping of str to list of float or None
        Equally long; the first is the time, rising. None where a number is not finite.
    """

    name: str
    factors: Mapping[str, float | int | str]
    columns: Mapping[str, list[float | None]] = field(repr=False)


def read_replay(path: str | Path, name: str, factors: Mapping[str, float | int | str]) -> Replay:
    """Read a ``history-<key>.csv`` written by the verify stage.

    Raises
    ------
    RsmkitError
        If the file is damaged.
    """
    try:
        table = parse_table(read_table_text(Path(path)), str(path), by_program=True)
        if not len(table):
            raise ValueError("is empty")
        columns = {text: [_finite(float(cell)) for cell in table.texts(text)] for text in table.names}
    except ValueError as error:
        raise DamagedError(path, [str(error)], REDO) from None
    except RsmkitError as error:
        raise RsmkitError(f"{error}. {REDO}") from None
    return Replay(name, dict(factors), columns)


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
