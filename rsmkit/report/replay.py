"""Time tables of single runs, which the explorer page plays back."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from rsmkit.errors import RsmkitError

__all__ = ["Replay", "read_replay"]


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
        with open(path, encoding="utf-8", newline="") as stream:
            head, *rows = list(csv.reader(stream))
        columns = {text: [_finite(float(row[j])) for row in rows] for j, text in enumerate(head)}
    except (OSError, ValueError, IndexError) as error:
        raise RsmkitError(f"{path}: cannot be read ({error}). Run: rsmkit verify --force") from None
    return Replay(name, dict(factors), columns)


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
