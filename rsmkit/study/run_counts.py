"""How far a large study's runs have come, kept beside the journal (``runs.jsonl.index``).

A hundred thousand lines take seconds to read, and a look at a study wants a few counts. They are kept with
what they were counted from, and counted anew when any of that has changed or the file is missing: nothing
depends on it but time. With the state of every row beside them, what was appended to the journal is all that
need be read. Small studies have none.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rsmkit.errors import RsmkitError
from rsmkit.io.files.digests import digest
from rsmkit.io.json_codec import from_json, read_json, to_json, write_json
from rsmkit.io.option_fields import given
from rsmkit.study.file import Study

if TYPE_CHECKING:  # which loads the numerical libraries
    from rsmkit.runs.one_run.simulator import Simulator
    from rsmkit.runs.record.design_runs import DesignRuns
    from rsmkit.runs.record.journal import Journal
    from rsmkit.runs.record.row_states import RowStates

__all__ = ["INDEX_FILE", "Counted", "RunIndex", "Standing", "journal_state", "kept_counts"]

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


@dataclass(frozen=True)
class Counted:
    """What the index keeps: the counts, and where it helps the state of every row."""

    standing: Standing
    rows: RowStates | None = None


def kept_counts(
    path: Path,
    counted_from: Callable[[], dict[str, Any]],
    count: Callable[[], Counted],
    follow: Callable[[RowStates], RowStates | None] = lambda rows: None,
) -> Counted:
    """Read what was counted, go on from there with what was appended, or count.

    Parameters
    ----------
    path : path
        The index.
    counted_from : callable
        Gives everything the counts depend on, the journal's state among it; nothing where they are not worth
        keeping.
    count : callable
        Counts.
    follow : callable
        Takes the states of rows on to the journal of today.
    """
    basis = counted_from()
    if not basis:
        return count()
    from rsmkit.runs.record.row_states import RowStatesForm

    counted = None
    with suppress(RsmkitError):
        document = read_json(path, "")
        before = document.get("counted_from")
        standing = from_json(Standing, document.get("standing"), path, "", at="standing")
        kept = document.get("rows")
        form = from_json(RowStatesForm, kept, path, "", at="rows") if kept else None
        rows = form.read(standing.points) if form else None
        if before == basis:
            return Counted(standing, rows)
        if rows and isinstance(before, dict) and before | {"journal": basis["journal"]} == basis:
            rows = follow(rows)
            counted = Counted(_standing_of(rows), rows) if rows else None
    counted = counted or count()
    if counted_from() == basis:  # nobody has written meanwhile
        document = {"schema": 1, "counted_from": basis, "standing": to_json(counted.standing)}
        if counted.rows:
            document["rows"] = to_json(counted.rows.form())
        with suppress(RsmkitError):  # a folder that cannot be written can be looked at all the same
            write_json(path, document)
    return counted


def _standing_of(rows: RowStates) -> Standing:
    """The counts of rows that were read on; what a fit takes from them only the whole journal can tell."""
    from rsmkit.runs.record.design_runs import run_words

    missing, done, failed = rows.counts
    words = run_words(done, len(rows.firsts), {"failed": failed})
    return Standing(len(rows.keys), len(rows.firsts), done, failed, missing, done, words, {})


class RunIndex:
    """The index of one study's runs.

    Parameters
    ----------
    path : path
        Where it is kept.
    study : Study
    journal : Journal
    simulator : Simulator
        What has made its runs.
    """

    def __init__(self, path: Path, study: Study, journal: Journal, simulator: Simulator) -> None:
        self._path, self._study, self._journal, self._simulator = path, study, journal, simulator

    def counted(
        self, design: Callable[[], str], count: Callable[[], tuple[Standing, list[str], DesignRuns]]
    ) -> Counted:
        """How far the runs of the design have come.

        Parameters
        ----------
        design : callable
            Gives the hash of the design.
        count : callable
            Counts: gives also the key of each row, and its run.
        """

        def counted() -> Counted:
            standing, keys, runs = count()
            return Counted(standing, self._rows(keys, runs))

        return kept_counts(self._path, lambda: self._basis(design), counted, self._follow)

    def _basis(self, design: Callable[[], str]) -> dict[str, Any]:
        """Everything that the counts depend on; empty where they are not worth keeping."""
        study, options = self._study, self._simulator.options
        state = journal_state(self._journal.path)
        if not state or study.random or study.counts:
            return {}
        how = [options.settings, options.defaults, options.deterministic, options.replicates]
        return {
            "journal": state,
            "design": design(),
            "simulator": digest([self._simulator.identity, study.file.simulator is None, *how]),
            "factors": digest({name: given(options) for name, options in study.file.factors.items()}),
            "responses": list(study.responses),
        }

    @property
    def _follows(self) -> bool:
        """Whether each row has a run of its own, of which one more line of the journal decides."""
        return self._study.file.simulator is not None and self._study.deterministic

    def _rows(self, keys: list[str], runs: DesignRuns) -> RowStates | None:
        from rsmkit.runs.record.row_states import row_states

        if not self._follows or not journal_state(self._journal.path):
            return None
        journal = self._journal
        return row_states(keys, runs.runs.runs, self._study.responses, journal.load(), journal.extent())

    def _follow(self, rows: RowStates) -> RowStates | None:
        from rsmkit.runs.agenda import caller_of
        from rsmkit.runs.record.meaning import Meaning

        meaning = Meaning(caller_of(self._simulator, self._study.space))
        return rows.followed(self._journal, meaning, self._study.responses) if self._follows else None


def journal_state(path: Path) -> list[int]:
    """What changes when anybody writes to the journal; empty while it is small, or not there."""
    try:
        found = path.lstat()
    except OSError:
        return []
    return [found.st_ino, found.st_size, found.st_mtime_ns] if found.st_size >= WORTH_BYTES else []
