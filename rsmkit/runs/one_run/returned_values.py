"""Values that a simulator returned, as numbers and as what a line of the journal can hold.

What is kept beside the responses is bounded in depth, number and length, all of a run together, so that no
run can make the journal large, or a line of it unreadable.
"""

from __future__ import annotations

import math
import numbers
from collections.abc import Mapping
from typing import Any

__all__ = ["MOST_VALUES", "number_of", "plain_values"]

MOST_VALUES = 10_000
"""Values of one run, nested ones included."""
LONGEST_TEXT = 10_000
MOST_CHARACTERS = 100_000
"""Characters of all texts and names of one run."""
MOST_REFUSED, LONGEST_NAME = 100, 200
"""Of extras that are too large."""
DEEPEST = 20
"""Lists and mappings within each other."""


def number_of(value: Any) -> float | None:
    """Give a real number as float; None for anything else (texts and truth values included)."""
    if getattr(value, "shape", None) == () and hasattr(value, "item"):
        value = value.item()  # a numpy scalar, or an array without dimensions
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        return None
    try:
        return float(value)
    except OverflowError:
        return math.inf


def plain_values(values: Mapping[str, Any]) -> dict[str, Any]:
    """Turn what a simulator returned besides its responses into something JSON can hold.

    Numbers that are not finite become null, unknown objects their text; a value that is too large or nested
    too deeply is replaced by a sentence that says so.
    """
    room = _Room()
    kept: dict[str, Any] = {}
    for name, value in values.items():
        before = room.values, room.characters
        try:
            kept[room.text(name)] = room.plain(value, DEEPEST)
        except _TooMuchError as error:
            room.values, room.characters = before
            if len(kept) >= MOST_REFUSED:
                kept["..."] = f"{len(values) - len(kept)} more, which were not kept"
                break
            kept[_written(name[:LONGEST_NAME])] = str(error)
    return kept


class _TooMuchError(Exception):
    """A value that is not kept."""


class _Room:
    """What is left for the values of one run."""

    def __init__(self) -> None:
        self.values = MOST_VALUES
        self.characters = MOST_CHARACTERS

    def plain(self, value: Any, depth: int) -> Any:
        """One value, and all that it holds."""
        size = getattr(value, "size", 0)
        if isinstance(size, int) and size > self.values:
            raise _TooMuchError(f"more than {MOST_VALUES:,} values, which were not kept")
        if hasattr(value, "tolist") and number_of(value) is None:
            value = value.tolist()
        if isinstance(value, Mapping) and len(value):
            self._fits(len(value), depth)
            return {self.text(str(name)): self.plain(inner, depth - 1) for name, inner in value.items()}
        if isinstance(value, list | tuple) and value:
            self._fits(len(value), depth)
            return [self.plain(inner, depth - 1) for inner in value]
        self.values -= 1
        self._fits(0, depth)
        return self._single(value)

    def _single(self, value: Any) -> Any:
        """A value that holds no others."""
        if value is None or isinstance(value, bool):
            return value
        number = None if isinstance(value, str) else number_of(value)
        if number is not None:
            whole = isinstance(value, numbers.Integral) and abs(number) < 2**63
            return (int(value) if whole else number) if math.isfinite(number) else None
        if isinstance(value, Mapping | list | tuple):
            return {} if isinstance(value, Mapping) else []
        return self.text(value if isinstance(value, str) else str(value))

    def text(self, value: str) -> str:
        """A text, its end cut off when it is long."""
        plain = _written(value[: LONGEST_TEXT + 1])
        if len(plain) > LONGEST_TEXT:
            plain = plain[:LONGEST_TEXT] + "..."
        self.characters -= len(plain)
        if self.characters < 0:
            raise _TooMuchError(f"more than {MOST_CHARACTERS:,} characters, which were not kept")
        return plain

    def _fits(self, count: int, depth: int) -> None:
        if depth < 0:
            raise _TooMuchError(f"nested more than {DEEPEST} deep, which was not kept")
        if count > self.values or self.values < 0:
            raise _TooMuchError(f"more than {MOST_VALUES:,} values, which were not kept")


def _written(text: str) -> str:
    """A plain text; half a character, which no file can hold, as its code."""
    return str.__str__(text).encode("utf-8", "backslashreplace").decode("utf-8")
