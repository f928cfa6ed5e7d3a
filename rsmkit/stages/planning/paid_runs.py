"""Which runs of the journal stay when a study has changed, and which do not and why."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from rsmkit.design.around_runs import OUTSIDE, PaidRuns, design_around
from rsmkit.design.build import region_of_interest
from rsmkit.design.design import Design
from rsmkit.design.options import MOST_RUNS
from rsmkit.design.region import Margin
from rsmkit.errors import RsmkitError, listed
from rsmkit.language.space import Floats, Space, Value, place_of
from rsmkit.language.terms import Terms
from rsmkit.runs.agenda import caller_of
from rsmkit.runs.record.meaning import Meaning
from rsmkit.runs.record.run import Run, canonical
from rsmkit.study.folder import KeptRuns, StudyFolder
from rsmkit.verification.refinement.models.cube import Cube
from rsmkit.verification.refinement.models.failures import fit_failures

__all__ = ["Inventory", "Stock", "look_at_stock", "plan_around", "take_inventory"]

MOST_TOLD = 5
APART = 0.2
"""Distance that new points keep from failed runs, coded: a tenth of a factor's range."""
SURE = 0.8
"""Chance to succeed of new points: an optimal design goes to the very edge of where they may lie."""

_Named = frozenset[tuple[str, Value]]
Place = tuple[float, ...]


@dataclass(frozen=True)
class Stock:
    """What the design has of the runs that were paid for, and what of them is left out.

    Parameters
    ----------
    kept : int
        Runs of the design that are there.
    outside : int
        Runs that lie outside the study's bounds by now, and stay in the fit only.
    failed : int
        Runs that failed and are not repeated.
    new : int
        Runs still to be made.
    left_out : tuple of str
        Finished runs that mean nothing to the study any more: how many, and why.
    """

    kept: int
    outside: int
    failed: int
    new: int
    left_out: tuple[str, ...] = ()

    @property
    def sentences(self) -> list[str]:
        """All of it for people."""
        parts = [f"{self.kept} run{'s are' if self.kept != 1 else ' is'} there already"]
        parts += [f"{self.outside} more outside the bounds stay in the fit"] if self.outside else []
        parts += [f"{self.failed} failed and are not repeated"] if self.failed else []
        parts.append(f"{self.new or 'no'} new run{'s' * (self.new != 1)} to be made")
        more = len(self.left_out) - MOST_TOLD
        rest = [f"... and for {more} more reasons"] if more > 0 else []
        return ["; ".join(parts), *self.left_out[:MOST_TOLD], *rest]


def look_at_stock(folder: StudyFolder) -> Stock | None:
    """Look what an up-to-date design has of the runs in the journal; None while there are none.

    Parameters
    ----------
    folder : StudyFolder
    """
    rows = folder.row_states()
    if rows and not rows.others:  # then the counts say it all
        known, outside = folder.standing(), folder.plan().design.kinds.count(OUTSIDE)
        return Stock(known.done - outside, outside, known.failed, known.missing)
    journaled = folder.journal.load()
    if not journaled:
        return None
    study, plan, state = folder.study, folder.plan(), folder.design_runs()
    meaning = Meaning(caller_of(folder.simulator, study.space))
    dropped: Counter[str] = Counter()
    for run in journaled.values():
        if run.done:
            point = meaning.point(run)
            dropped[point if isinstance(point, str) else _unanswered(run, study.asked)] += 1
    del dropped[""]
    outside = plan.design.kinds.count(OUTSIDE)
    told = [
        f"{count} finished {'runs are' if count > 1 else 'run is'} left out: {reason}"
        for reason, count in dropped.most_common()
    ]
    return Stock(state.done + state.partial - outside, outside, state.failed, state.missing, tuple(told))


@dataclass(frozen=True)
class Inventory:
    """What the journal holds for a study.

    Parameters
    ----------
    paid : PaidRuns
        The runs of the design.
    dropped : dict
        Finished runs that mean nothing to the study any more: how many, by reason.
    earlier : tuple of str
        Keys of those of them that were part of a design.
    failed, succeeded : array, shape (m, k)
        Where runs failed and where they did not, those elsewhere included.
    """

    paid: PaidRuns
    dropped: dict[str, int]
    earlier: tuple[str, ...]
    failed: Floats
    succeeded: Floats

    def avoiding(self, design: Design) -> list[Margin]:
        """Margins that keep new points away from where runs failed: from each, and from where more would."""
        if not len(self.failed):
            return []
        space = design.space
        margins: list[Margin] = [partial(_apart, space.encode(self.failed), space)]
        cube = Cube(space)
        points = np.vstack([self.succeeded, self.failed])
        good = np.arange(len(points)) < len(self.succeeded)
        failures = fit_failures(cube.unit(points), good, cube.categorical) if good.any() else None
        if failures is not None:
            sure = float(np.log(SURE))
            margins.append(lambda x: failures.log_chance(cube.unit(np.atleast_2d(x))) - sure)
        return margins


def take_inventory(folder: StudyFolder, ideal: Design) -> Inventory:
    """Look through the journal for runs of the design before; for all runs when that is not there.

    Parameters
    ----------
    folder : StudyFolder
    ideal : Design
        The design from nothing, in which earlier runs may be found as well.
    """
    study = folder.study
    meaning = Meaning(caller_of(folder.simulator, study.space))
    before, earlier = _rows_before(folder), folder.earlier_runs()
    records = _Records(study.deterministic, folder.simulator.options.replicates)
    dropped: Counter[str] = Counter()
    left: list[str] = []
    for run in folder.journal.load().values():
        if run.is_outside or (run.by_hand and run.state(study.asked) in ("excluded", "missing")):
            continue
        row = _UNKNOWN if before is None or run.key in earlier else before.get(_named(run.factors))
        point = meaning.point(run)
        reason = point if isinstance(point, str) else _unanswered(run, study.asked)
        if not isinstance(point, str) and not reason:
            good = run.state(study.asked) in ("done", "partial")
            records.add(point, run.replicate, good, row)
        elif run.done:
            dropped[reason] += 1
            left += [run.key] if row is not None else []
    rows, done = records.rows(study.space)
    return Inventory(
        PaidRuns(rows, done, *records.fates(ideal.points)),
        dict(dropped),
        tuple(left),
        *(np.array(records.places(good)).reshape(-1, len(study.space)) for good in (False, True)),
    )


def _unanswered(run: Run, responses: Sequence[str]) -> str:
    """Why a finished run is none of this study's, where it was not asked for all that the study asks for."""
    if not run.done or run.by_hand or run.answers(responses):
        return ""
    return f"made without {listed([name for name in responses if not np.isfinite(run.value(name))])}"


@dataclass(frozen=True)
class _Before:
    """A row of the design before: where it first stood, how often, what it was."""

    index: int
    count: int
    kind: str
    block: int


_UNKNOWN = _Before(MOST_RUNS, MOST_RUNS, "kept", 0)
"""Of a run whose row is not known any more; it comes after those that are."""


class _Records:
    """Runs by where they lie."""

    def __init__(self, deterministic: bool, replicates: int) -> None:
        self._deterministic = deterministic
        self._replicates = replicates
        self.ends: dict[Place, dict[int, bool]] = {}
        self._before: dict[Place, _Before] = {}

    def add(self, point: Floats, replicate: int, good: bool, row: _Before | None) -> None:
        """Note a run, whether it ended well, and the row of the design before that it was made for."""
        place = place_of(point)
        ends = self.ends.setdefault(place, {})
        ends[replicate] = good or ends.get(replicate, False)
        if row is not None:
            self._before.setdefault(place, row)

    def places(self, good: bool) -> list[Place]:
        """Where runs succeeded, or where they did not."""
        return [place for place, ends in self.ends.items() if any(ends.values()) is good]

    def fates(self, points: Floats) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Which rows have a good run, and which only failed ones; shape (n,) each."""
        seen: Counter[Place] = Counter()
        done, failed = np.zeros(len(points), bool), np.zeros(len(points), bool)
        for i, place in enumerate(map(place_of, points)):
            first = 0 if self._deterministic else seen[place] * self._replicates
            seen[place] += 1
            ends = self.ends.get(place, {})
            own = [ends[r] for r in range(first, first + self._replicates) if r in ends]
            done[i], failed[i] = any(own), bool(own) and not any(own)
        return done, failed

    def rows(self, space: Space) -> tuple[Design, NDArray[np.bool_]]:
        """The design that was run, in its order, and which of its rows ended well."""
        places = sorted(self._before, key=lambda place: (self._before[place].index, place))
        points, kinds, blocks = list[Place](), list[str](), list[int]()
        for place in places:
            row = self._before[place]
            made = -(-(max(self.ends[place]) + 1) // self._replicates)
            count = 1 if self._deterministic else min(row.count, made)
            points += [place] * count
            kinds += [row.kind] * count
            blocks += [row.block] * count
        array = np.array(points, float).reshape(-1, len(space))
        design = Design(space, array, tuple(kinds), tuple(blocks) if all(blocks) else ())
        done, failed = self.fates(array)
        made_rows = done | failed
        return design.select(made_rows), done[made_rows]


def _rows_before(folder: StudyFolder) -> dict[_Named, _Before] | None:
    """Rows of the design on the disk, by the factors' values; None when there is none that can be read."""
    design = folder.last_design()
    if design is None:
        return None
    rows: dict[_Named, _Before] = {}
    for i, point in enumerate(design.points):
        name = _named(design.space.values(point))
        known = rows.get(name)
        block = design.blocks[i] if design.blocks else 0
        rows[name] = replace(known, count=known.count + 1) if known else _Before(i, 1, design.kinds[i], block)
    return rows


def _named(factors: Mapping[str, Value]) -> _Named:
    return frozenset((name, canonical(value)) for name, value in factors.items())


def _apart(failed: Floats, space: Space, points: Floats) -> Floats:
    """Distance from the nearest failed run beyond what is kept, coded."""
    gap = space.encode(np.atleast_2d(points))[:, None, :] - failed[None, :, :]
    gap[:, :, ~space.numeric] *= 2.0
    return np.asarray(np.sqrt((gap**2).sum(axis=2)).min(axis=1) - APART)


def plan_around(
    folder: StudyFolder, ideal: Design, terms: Terms, constraints: Sequence[Margin]
) -> tuple[Design, Design, KeptRuns | None]:
    """Make the design around the runs that are there.

    Parameters
    ----------
    folder : StudyFolder
    ideal : Design
        The design from nothing.
    terms : Terms
        The model.
    constraints : sequence of callable
        Margins that every point must keep.

    Returns
    -------
    design : Design
        Every row; the design from nothing itself where that is all.
    counted : Design
        The rows that make it up, without failed runs and those outside.
    kept : KeptRuns or None
        None where nothing was run before.
    """
    study, options = folder.study, folder.study.file.design
    stock = take_inventory(folder, ideal)
    if not len(stock.paid.rows):
        return ideal, ideal, KeptRuns(ideal.distinct, stock.earlier) if stock.earlier else None
    found = design_around(
        ideal,
        stock.paid,
        options,
        terms=terms,
        constraints=constraints,
        avoid=_with_room(folder, ideal, constraints, stock.avoiding(ideal)),
        folder=folder.path,
        deterministic=study.deterministic,
    )
    counted = found.design if found.counted.all() else found.design.select(found.counted)
    if found.design is ideal and not stock.earlier:
        return ideal, counted, None
    return found.design, counted, KeptRuns(found.wanted, stock.earlier)


def _with_room(
    folder: StudyFolder, ideal: Design, constraints: Sequence[Margin], avoid: list[Margin]
) -> list[Margin]:
    """As many of the margins, the first ones, as leave room for new points."""
    options = folder.study.file.design
    while avoid:
        try:
            region_of_interest(ideal.space, options, (*constraints, *avoid), folder.path).sample(
                64, options.seed
            )
            break
        except RsmkitError:
            avoid = avoid[:-1]
    return avoid
