"""Which run each row of a sheet is about: one of the plan, one recorded before, or a new one."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from rsmkit.errors import RsmkitError
from rsmkit.language.space import Floats, Space, Value
from rsmkit.runs.record.run import KIND, Run
from rsmkit.runs.sheets.hand_runs import (
    ADDED,
    BESIDE_THE_PLAN,
    CONFIRMATION,
    OPTIMUM,
    UNPLANNED,
    hand_key,
    off_plan,
    outside_words,
    place_words,
    planned_keys,
)
from rsmkit.runs.sheets.sheet_rows import SheetRow

__all__ = ["Match", "match_rows"]

MATCH_FRACTION = 1e-3  # of a factor's range: what is lost when a person types 92.07 for 92.0710678
DRIFT_FRACTION = 0.5  # of a factor's range: farther from its plan a row is a run of its own


@dataclass(frozen=True)
class Match:
    """The run that a row is about.

    Parameters
    ----------
    row : SheetRow
    key : str
    factors : dict
        The planned settings, which are part of the key.
    replicate : int
    label : str
        The run in words.
    kind : str
        Empty for a run of the design.
    drift : dict of str to value
        Factors whose planned cell was changed to what they really were.
    note : str
        What was not as it should be.
    """

    row: SheetRow
    key: str
    factors: dict[str, Value]
    replicate: int
    label: str
    kind: str = ""
    drift: dict[str, Value] = field(default_factory=dict)
    note: str = ""


def match_rows(
    path: Path,
    rows: Sequence[SheetRow],
    space: Space,
    planned: Floats,
    kinds: Sequence[str],
    known: Mapping[str, Run],
) -> list[Match]:
    """Find the run of every row.

    A row with the number of a run is that run, wherever it stands in the sheet; a planned cell that was
    changed says what the factor really was. Other rows belong to the planned point whose factors they give to
    within a thousandth of their ranges, repeated ones in the order of the sheet; what is left are runs
    outside the plan.

    Parameters
    ----------
    path : path
        The sheet, for messages.
    rows : sequence of SheetRow
    space : Space
    planned : array, shape (n, k)
        Natural units.
    kinds : sequence of str
        Of the planned points; only those of the design, not optima, have a number.
    known : mapping of str to Run
        The journal.

    Raises
    ------
    RsmkitError
        If two rows are the same run, or one does not say where it was made.
    """
    matcher = _Matcher(space, planned, kinds, known)
    found: dict[int, Match] = {}
    problems = []
    for index, row in enumerate(rows):
        slot = matcher.numbered(row)
        if slot is None and np.isnan(row.planned).any():
            names = [name for name, x in zip(space.names, row.planned, strict=True) if math.isnan(x)]
            problems.append(f"line {row.line}: {', '.join(names)} is empty, and so is the number of the run")
        elif slot is not None and not matcher.claim(slot):
            problems.append(f"line {row.line}: another row is run {slot + 1} as well")
        elif slot is not None:
            found[index] = matcher.planned_match(row, slot)
    if problems:
        raise RsmkitError("\n".join(f"{path.name} {problem}" for problem in problems))
    for index, row in enumerate(rows):
        if index not in found:
            slot = matcher.free_slot(row)
            found[index] = matcher.planned_match(row, slot) if slot is not None else matcher.outside(row)
    return [found[index] for index in range(len(rows))]


class _Matcher:
    """The plan and the journal, and which of their runs rows have claimed."""

    def __init__(self, space: Space, planned: Floats, kinds: Sequence[str], known: Mapping[str, Run]) -> None:
        self.space, self.planned, self.known = space, planned, known
        self.kinds = list(kinds) or [""] * len(planned)
        finite = np.isfinite(planned).all(axis=1)
        self.keys = planned_keys(space, planned) if finite.all() else [""] * len(planned)
        self.numbers = sum(kind != OPTIMUM for kind in self.kinds)
        self.claimed: set[str] = set()
        self.beside: dict[tuple[Value, ...], list[Run]] = defaultdict(list)
        for run in off_plan(space, known, set(self.keys)):
            self.beside[tuple(run.factors[name] for name in space.names)].append(run)

    def distances(self, point: Floats) -> Floats:
        """Largest difference from each planned point in any factor, of its range; shape (n,)."""
        scale = np.where(self.space.numeric, self.space.highs - self.space.lows, DRIFT_FRACTION / 2)
        away = np.abs(self.planned - point) / scale
        return np.asarray(np.where(np.isnan(away), np.inf, away).max(axis=1))

    def numbered(self, row: SheetRow) -> int | None:
        """The planned run whose number the row has, if that can be."""
        if row.number is None or row.number > self.numbers:
            return None
        slot = row.number - 1
        distances = self.distances(np.where(np.isnan(row.planned), self.planned[slot], row.planned))
        own = distances[slot]
        return slot if own <= MATCH_FRACTION or own <= min(DRIFT_FRACTION, distances.min()) else None

    def claim(self, slot: int) -> bool:
        """Take a planned run; not twice."""
        is_free = self.keys[slot] not in self.claimed
        self.claimed.add(self.keys[slot])
        return is_free

    def free_slot(self, row: SheetRow) -> int | None:
        """Take the first planned run at the row's point that no other row has."""
        if row.kind in (CONFIRMATION, ADDED) or not len(self.planned):
            return None
        distances = self.distances(row.planned)
        if not distances.min() <= MATCH_FRACTION:
            return None
        point = self.planned[distances.argmin()]
        same = np.flatnonzero((self.planned == point).all(axis=1)).tolist()
        same.sort(key=lambda slot: (self.kinds[slot] == OPTIMUM) != (row.kind == OPTIMUM))
        return next((slot for slot in same if self.keys[slot] not in self.claimed and self.claim(slot)), None)

    def planned_match(self, row: SheetRow, slot: int) -> Match:
        """Make the match of a row with a planned run."""
        point = self.planned[slot]
        away = np.abs(row.planned - point) / (self.space.highs - self.space.lows)
        drift = {
            factor.name: float(x) if factor.domain.is_numeric else factor.value(float(x))
            for factor, x, far in zip(self.space, row.planned, away, strict=True)
            if far > MATCH_FRACTION
        }
        replicate = sum((self.planned[:slot] == point).all(axis=1))
        factors = self.space.values(point)
        is_optimum = self.kinds[slot] == OPTIMUM
        label = outside_words(OPTIMUM, factors, int(replicate)) if is_optimum else f"run {slot + 1}"
        kind = OPTIMUM if is_optimum else ""
        return Match(row, self.keys[slot], factors, int(replicate), label, kind, drift)

    def outside(self, row: SheetRow) -> Match:
        """Make the match of a row with a run outside the plan: one known before, else a new one."""
        factors = self.space.values(row.planned)
        run = self._known_beside(row, tuple(factors.values()))
        if run is None:
            key, replicate = self._new(row, factors)
        else:
            key, replicate, factors = run.key, run.replicate, dict(run.factors)
        self.claimed.add(key)
        kind = row.kind if row.kind in (CONFIRMATION, ADDED, OPTIMUM) else ""
        kind = kind or (str(run.extras.get(KIND, "")) if run else "") or UNPLANNED
        note = ""
        if row.number is not None and row.number <= self.numbers:
            there = place_words(self.space.values(self.planned[row.number - 1]))
            note = f"line {row.line} says run {row.number}, which is at {there}: kept as a run of its own"
        drift: dict[str, Value] = {
            factor.name: float(x)  # a whole number, say, that was none
            for factor, x in zip(self.space, row.planned, strict=True)
            if factor.domain.is_numeric and factor.coordinate(factors[factor.name]) != x
        }
        label = outside_words(kind, factors, replicate)
        return Match(row, key, factors, replicate, label, kind, drift, note)

    def _known_beside(self, row: SheetRow, place: tuple[Value, ...]) -> Run | None:
        """A run outside the plan at the same point: best one of the same kind that the row agrees with."""
        free = [run for run in self.beside.get(place, ()) if run.key not in self.claimed]
        free.sort(key=lambda run: run.extras.get(KIND, UNPLANNED) != (row.kind or UNPLANNED))
        alike = [run for run in free if (run.extras.get(KIND) == CONFIRMATION) == (row.kind == CONFIRMATION)]
        agreeing = [run for run in [*alike, *free] if _agree(run, row)]
        return next(iter(agreeing or alike), None)

    def _new(self, row: SheetRow, factors: dict[str, Value]) -> tuple[str, int]:
        at_plan = bool((self.planned == row.planned).all(axis=1).any())
        replicate = BESIDE_THE_PLAN if at_plan or row.kind == CONFIRMATION else 0
        while (key := hand_key(factors, replicate)) in self.known or key in self.claimed:
            replicate += 1
        return key, replicate


def _agree(run: Run, row: SheetRow) -> bool:
    """Whether a row may be about a run: no value of it differs."""
    values = ((run.value(name), value) for name, value in row.responses.items())
    return all(old == new or math.isnan(old) for old, new in values)
