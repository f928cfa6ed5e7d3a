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
    from rsmkit.language.space import Floats
    from rsmkit.runs.one_run.simulator import Simulator
    from rsmkit.runs.record.design_runs import DesignRuns
    from rsmkit.runs.record.journal import Journal
    from rsmkit.runs.record.row_states import RowStates

__all__ = ["INDEX_FILE", "Counted", "RunIndex", "Sources", "Standing", "journal_state", "kept_counts"]

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
    *,
    anew: bool = False,
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
    anew : bool
        Count, whatever is kept.
    """
    basis = counted_from()
    if not basis:
        return count()
    before, counted = (None, None) if anew else _read(path)
    if counted and before == basis:
        return counted
    rows = counted.rows if counted else None
    if rows and isinstance(before, dict) and before | {"journal": basis["journal"]} == basis:
        rows = follow(rows)
        counted = Counted(_standing_of(rows), rows) if rows else None
    else:
        counted = None
    counted = counted or count()
    if counted_from() == basis:  # nobody has written meanwhile
        document = {"schema": 1, "counted_from": basis, "standing": to_json(counted.standing)}
        if counted.rows:
            document["rows"] = to_json(counted.rows.form())
        with suppress(RsmkitError):  # a folder that cannot be written can be looked at all the same
            write_json(path, document)
    return counted


def _read(path: Path) -> tuple[Any, Counted | None]:
    """What is kept, and what it was counted from; nothing where it cannot be read."""
    from rsmkit.runs.record.row_states import RowStatesForm

    with suppress(RsmkitError):
        document = read_json(path, "")
        standing = from_json(Standing, document.get("standing"), path, "", at="standing")
        kept = document.get("rows")
        form = from_json(RowStatesForm, kept, path, "", at="rows") if kept else None
        return document.get("counted_from"), Counted(standing, form.read(standing.points) if form else None)
    return None, None


def _standing_of(rows: RowStates) -> Standing:
    """The counts of rows; what a fit takes from them only the whole journal can tell."""
    from rsmkit.runs.record.design_runs import run_words
    from rsmkit.study.records import measured_in_rows

    missing, done, failed = rows.counts
    words = run_words(done, len(rows.firsts), {"failed": failed})
    distinct, taken = len(rows.firsts), measured_in_rows(rows)
    return Standing(len(rows.keys), distinct, done, failed, missing, done, words, taken)


@dataclass(frozen=True)
class Sources:
    """What is counted.

    Parameters
    ----------
    design : callable
        Gives the hash of the design.
    points : callable
        Gives its points, shape (n, k).
    count : callable
        Counts: gives also the key of each row, and its run.
    at_hand : callable
        Whether all runs are in memory anyway.
    """

    design: Callable[[], str]
    points: Callable[[], Floats]
    count: Callable[[], tuple[Standing, list[str], DesignRuns]]
    at_hand: Callable[[], bool]


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
    sources : Sources
    """

    def __init__(
        self, path: Path, study: Study, journal: Journal, simulator: Simulator, sources: Sources
    ) -> None:
        self._path, self._study, self._journal, self._simulator = path, study, journal, simulator
        self._sources = sources
        self._last: tuple[list[Any], Counted] | None = None

    def counted(self, *, anew: bool = False) -> Counted:
        """How far the runs of the design have come; counted `anew` whatever is kept.

        Raises
        ------
        RsmkitError
            If there is no up-to-date design, or the journal is damaged.
        """
        state = journal_state(self._journal.path)
        looked = [state, self._sources.design()] if state else []
        if anew or not state or self._last is None or self._last[0] != looked:
            found = kept_counts(self._path, self._basis, self._count, self._follow, anew=anew)
            self._last = looked, found
        return self._last[1]

    def _count(self) -> Counted:
        rows = None if self._sources.at_hand() else self._read_once()
        if rows:
            return Counted(_standing_of(rows), rows)
        standing, keys, runs = self._sources.count()
        return Counted(standing, self._rows(keys, runs))

    def _read_once(self) -> RowStates | None:
        """Read a large journal without keeping its runs in memory."""
        if not self.follows or not journal_state(self._journal.path):
            return None
        from rsmkit.runs.agenda import row_keys
        from rsmkit.runs.record.row_states import RowStates

        keys = row_keys(self._simulator, self._sources.points(), self._study.space)
        return self._follow(RowStates.of_nothing(keys, len(self._study.asked)))

    def _basis(self) -> dict[str, Any]:
        """Everything that the counts depend on; empty where they are not worth keeping."""
        study, options = self._study, self._simulator.options
        state = journal_state(self._journal.path)
        if not state or study.random or study.counts:
            return {}
        how = [options.settings, options.defaults, options.deterministic, options.replicates]
        return {
            "journal": state,
            "design": self._sources.design(),
            "simulator": digest([self._simulator.identity, study.file.simulator is None, *how]),
            "factors": digest({name: given(options) for name, options in study.file.factors.items()}),
            "responses": list(study.asked),
        }

    @property
    def follows(self) -> bool:
        """Whether each row has a run of its own, of which one more line of the journal decides."""
        study = self._study
        return study.file.simulator is not None and study.deterministic and not (study.random or study.counts)

    def _rows(self, keys: list[str], runs: DesignRuns) -> RowStates | None:
        from rsmkit.runs.record.row_states import row_states

        if not self.follows or not journal_state(self._journal.path):
            return None
        journal = self._journal
        return row_states(keys, runs.runs.runs, self._study.asked, journal.load(), journal.extent())

    def _follow(self, rows: RowStates) -> RowStates | None:
        from rsmkit.runs.agenda import caller_of
        from rsmkit.runs.record.meaning import Meaning

        meaning = Meaning(caller_of(self._simulator, self._study.space))
        return rows.followed(self._journal, meaning, self._study.asked) if self.follows else None


def journal_state(path: Path) -> list[int]:
    """What changes when anybody writes to the journal; empty while it is small, or not there."""
    try:
        found = path.lstat()
    except OSError:
        return []
    return [found.st_ino, found.st_size, found.st_mtime_ns] if found.st_size >= WORTH_BYTES else []
