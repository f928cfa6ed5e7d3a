"""How far the run of every row of a large design has come, so that only what was appended since is read."""

from __future__ import annotations

import base64
import binascii
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rsmkit.language.space import Floats
from rsmkit.runs.record.journal import EMPTY, Journal
from rsmkit.runs.record.meaning import Meaning
from rsmkit.runs.record.run import Run

__all__ = ["RowStates", "RowStatesForm", "row_states"]

MISSING, DONE, FAILED = range(3)
AT_ONCE = 4_096
"""Runs that are looked up together."""


@dataclass(frozen=True)
class RowStatesForm:
    """What is written of :class:`RowStates`: arrays as base64 of their bytes, least significant first."""

    keys: str
    states: str
    size: int
    digest: str
    others: int

    def read(self, rows: int) -> RowStates | None:
        """Make the arrays again; None where they are not those of so many rows."""
        try:
            keys = np.frombuffer(base64.b64decode(self.keys, validate=True), "<u8")
            states = np.frombuffer(base64.b64decode(self.states, validate=True), np.uint8)
        except (ValueError, binascii.Error):
            return None
        if len(keys) != rows or len(states) != rows or (states > FAILED).any() or self.size < 0:
            return None
        return RowStates(keys, states, self.size, self.digest, self.others)


@dataclass(frozen=True, eq=False)
class RowStates:
    """The state of each row's run, as the first `size` bytes of a journal have it.

    Parameters
    ----------
    keys : array of uint64, shape (n,)
        The run that each row needs.
    states : array of uint8, shape (n,)
        ``MISSING``, ``DONE`` or ``FAILED``.
    size : int
        Bytes of the journal that were read, whole lines.
    digest : str
        Their hash: more may have been appended, nothing else may have changed.
    others : int
        Records of runs that no row needs.
    values : array, shape (n, m), optional
        The responses of the rows that are ``DONE``, where the whole journal was read for them.
    """

    keys: NDArray[np.uint64]
    states: NDArray[np.uint8]
    size: int
    digest: str
    others: int
    values: Floats | None = None

    @classmethod
    def of_nothing(cls, keys: NDArray[np.uint64], responses: int) -> RowStates:
        """What an empty journal says of rows that need these runs, and so many responses of each."""
        states, values = np.zeros(len(keys), np.uint8), np.full((len(keys), responses), np.nan)
        return cls(keys, states, *EMPTY, 0, values)

    @cached_property
    def _sorted(self) -> tuple[NDArray[np.intp], NDArray[np.uint64]]:
        order = np.argsort(self.keys, kind="stable")
        return order, self.keys[order]

    @cached_property
    def firsts(self) -> NDArray[np.intp]:
        """The first row of each run, in the order of the design."""
        order, keys = self._sorted
        new = np.ones(len(keys), bool)
        new[1:] = keys[1:] != keys[:-1]
        return np.asarray(np.sort(order[new]))

    @property
    def counts(self) -> tuple[int, int, int]:
        """Runs missing, done and failed, each counted once however many rows need it."""
        missing, done, failed = np.bincount(self.states[self.firsts], minlength=3).tolist()
        return missing, done, failed

    @property
    def missing(self) -> NDArray[np.intp]:
        """Rows whose runs are to be made, the first of each."""
        return np.asarray(self.firsts[self.states[self.firsts] == MISSING])

    @property
    def done(self) -> NDArray[np.intp]:
        """Rows whose runs ended well, the first of each."""
        return np.asarray(self.firsts[self.states[self.firsts] == DONE])

    def followed(self, journal: Journal, meaning: Meaning, responses: Sequence[str]) -> RowStates | None:
        """Read what the journal has beyond; None where all of it must be read.

        Parameters
        ----------
        journal : Journal
        meaning : Meaning
            Tells runs of this study that were called otherwise, which may stand for any row.
        responses : sequence of str
            What is asked for.
        """
        reading = _Reading(self, meaning, responses)
        end = journal.read_on(self.size, self.digest, reading.take)
        return reading.result(*end) if end is not None and reading.settle() else None

    def form(self) -> RowStatesForm:
        """What is written."""
        keys, states = (
            base64.b64encode(array.tobytes()).decode("ascii")
            for array in (self.keys.astype("<u8"), self.states)
        )
        return RowStatesForm(keys, states, self.size, self.digest, self.others)


class _Reading:
    """What the runs of a journal say of rows, one after the other; only few of them are in memory.

    Works on the rows in the order of their keys, and on the first of those that share a run.
    """

    def __init__(self, rows: RowStates, meaning: Meaning, responses: Sequence[str]) -> None:
        self._rows, self._meaning, self._responses = rows, meaning, responses
        self._order, self._keys = rows._sorted
        self._states = rows.states[self._order]
        self._values = None if rows.values is None else rows.values[self._order]
        self._others = rows.others
        self._waiting: list[Run] = []

    def take(self, run: Run) -> bool:
        """Note a run; False where all runs together must be looked at."""
        self._waiting.append(run)
        return len(self._waiting) < AT_ONCE or self.settle()

    def settle(self) -> bool:
        """Look up the runs that wait."""
        runs, self._waiting = self._waiting, []
        keys = np.array([int(run.key, 16) for run in runs], np.uint64)
        places = np.searchsorted(self._keys, keys)
        is_known = self._keys[np.minimum(places, len(self._keys) - 1)] == keys
        for run, place, known in zip(runs, places.tolist(), is_known.tolist(), strict=True):
            if not known:
                self._others += 1
                reader = self._meaning.reader(run)
                if not (reader.own or reader.reason):
                    return False
                continue
            state = _STATES.get(run.state(self._responses))
            if state is None:
                return False
            self._states[place] = state
            if self._values is not None and state == DONE:
                self._measure(place, [run.value(name) for name in self._responses])
        return True

    def _measure(self, place: int, values: Sequence[float]) -> None:
        if self._values is not None and all(type(value) is float for value in values):
            self._values[place] = values
        else:
            self._values = None  # a whole number would not be the same text again

    def result(self, size: int, digest: str) -> RowStates:
        """All rows, those included that share a run."""
        firsts, back = np.searchsorted(self._keys, self._keys), np.argsort(self._order)
        chosen = firsts[back]
        values = None if self._values is None else self._values[chosen]
        return RowStates(self._rows.keys, self._states[chosen], size, digest, self._others, values)


def row_states(
    keys: Sequence[str],
    runs: Sequence[Run | None],
    responses: Sequence[str],
    journaled: Iterable[str],
    extent: tuple[int, str],
) -> RowStates | None:
    """Note how far each row has come; None where a run is not simply missing, done or failed.

    Parameters
    ----------
    keys : sequence of str
        The run each row needs.
    runs : sequence of Run or None
        The run each row has.
    responses : sequence of str
        What is asked for.
    journaled : iterable of str
        Every run of the journal.
    extent : tuple of int and str
        Size and hash of what was read, see :meth:`rsmkit.runs.record.journal.Journal.extent`.
    """
    states: list[Any] = []
    for key, run in zip(keys, runs, strict=True):
        if run is not None and run.key != key:
            return None  # made under another key: which one counts is for all runs together to say
        states.append(MISSING if run is None else _STATES.get(run.state(responses)))
    if None in states:
        return None
    numbers = np.array([int(key, 16) for key in keys], np.uint64)
    return RowStates(numbers, np.array(states, np.uint8), *extent, len({*journaled} - {*keys}))


_STATES = {"done": DONE, "failed": FAILED}
