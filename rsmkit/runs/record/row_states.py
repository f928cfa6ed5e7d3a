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

from rsmkit.runs.record.journal import Journal
from rsmkit.runs.record.meaning import Meaning
from rsmkit.runs.record.run import Run

__all__ = ["RowStates", "RowStatesForm", "row_states"]

MISSING, DONE, FAILED = range(3)


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
    """

    keys: NDArray[np.uint64]
    states: NDArray[np.uint8]
    size: int
    digest: str
    others: int

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
        order, keys = self._sorted
        states, others = self.states.copy(), self.others

        def take(run: Run) -> bool:
            nonlocal others
            key = np.uint64(int(run.key, 16))
            first, after = np.searchsorted(keys, key), np.searchsorted(keys, key, "right")
            if first == after:
                others += 1
                reader = meaning.reader(run)
                return bool(reader.own or reader.reason)
            state = _STATES.get(run.state(responses))
            if state is not None:
                states[order[first:after]] = state
            return state is not None

        end = journal.read_on(self.size, self.digest, take)
        return None if end is None else RowStates(self.keys, states, *end, others)

    def form(self) -> RowStatesForm:
        """What is written."""
        keys, states = (
            base64.b64encode(array.tobytes()).decode("ascii")
            for array in (self.keys.astype("<u8"), self.states)
        )
        return RowStatesForm(keys, states, self.size, self.digest, self.others)


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
