"""How far a large study's runs have come, kept beside the journal (``runs.jsonl.index``).

A hundred thousand lines take seconds to read, and a look at a study wants a few counts. They are kept with
what they were counted from, and counted anew when any of that has changed or the file is missing: nothing
depends on it but time. Small studies have none.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rsmkit.errors import RsmkitError
from rsmkit.io.json_codec import from_json, read_json, to_json, write_json

__all__ = ["INDEX_FILE", "Standing", "journal_state", "kept_standing"]

INDEX_FILE = "runs.jsonl.index"
WORTH_BYTES = 2 << 20
"""Smaller journals are read in a moment."""


@dataclass(frozen=True)
class Standing:
    """How far the runs of a design have come.

    Parameters
    ----------
    points : int
        Rows of the design.
    distinct, done, failed, missing, usable : int
        As :class:`rsmkit.runs.record.design_runs.DesignRuns` counts them.
    words : str
        The same for people.
    measured : dict
        Hashes of what a fit takes from the runs; empty where that is not kept.
    """

    points: int
    distinct: int
    done: int
    failed: int
    missing: int
    usable: int
    words: str
    measured: dict[str, str]

    @property
    def errors(self) -> tuple[str, ...]:
        """Nothing: only the journal itself tells why runs failed."""
        return ()


def kept_standing(
    path: Path, counted_from: Callable[[], dict[str, Any]], count: Callable[[], Standing]
) -> Standing:
    """Read what was counted, or count.

    Parameters
    ----------
    path : path
        The index.
    counted_from : callable
        Gives everything the counts depend on, the journal's state among it; nothing where they are not worth
        keeping.
    count : callable
        Counts.
    """
    basis = counted_from()
    if not basis:
        return count()
    with suppress(RsmkitError):
        document = read_json(path, "")
        if document.get("counted_from") == basis:
            return from_json(Standing, document.get("standing"), path, "", at="standing")
    standing = count()
    if counted_from() == basis:  # nobody has written meanwhile
        with suppress(RsmkitError):  # a folder that cannot be written can be looked at all the same
            write_json(path, {"schema": 1, "counted_from": basis, "standing": to_json(standing)})
    return standing


def journal_state(path: Path) -> list[int]:
    """What changes when anybody writes to the journal; empty while it is small, or not there."""
    try:
        found = path.lstat()
    except OSError:
        return []
    return [found.st_ino, found.st_size, found.st_mtime_ns] if found.st_size >= WORTH_BYTES else []
