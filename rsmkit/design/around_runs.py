"""A design around runs that are there already: only what is missing beside them is added.

What Augment Design is in other packages. The design that would be made from nothing says how many runs the
study is to have and how far they reach; runs that were paid for count, wherever they came from.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rsmkit.design.build import grow, region_of_interest
from rsmkit.design.design import Design
from rsmkit.design.optimal.criteria import lattice
from rsmkit.design.options import DesignOptions
from rsmkit.design.region import Margin, Region
from rsmkit.errors import RsmkitError
from rsmkit.language.space import Floats, Space, place_of
from rsmkit.language.terms import Terms

__all__ = ["OUTSIDE", "Around", "PaidRuns", "design_around"]

OUTSIDE = "outside"
"""Kind of a run that lies outside the study's bounds by now: it counts in the fit and for nothing else."""
WORTH = 0.95
"""Share of the D-efficiency that a design around runs may not fall below by how far these reach."""
RIDGE = 1e-6
CANDIDATES = 512

Rows = NDArray[np.bool_]


@dataclass(frozen=True)
class PaidRuns:
    """Runs that are there, and how the rows of a design from nothing have fared.

    Parameters
    ----------
    rows : Design
        A row for every run of the design before, failed ones included.
    done : array of bool, shape (len(rows),)
        Which ended well; the others failed.
    ideal_done, ideal_failed : array of bool, shape (len(ideal),)
        Which rows of the design from nothing have been run, and how that ended.
    """

    rows: Design
    done: Rows
    ideal_done: Rows
    ideal_failed: Rows


@dataclass(frozen=True)
class Around:
    """A design around runs.

    Parameters
    ----------
    design : Design
        All rows of the study: runs that stay, failed ones, those outside, and new points.
    counted : array of bool, shape (len(design),)
        Rows that make up the design: neither failed nor outside.
    wanted : int
        Runs that the study is to have, failed ones and those outside not counted.
    """

    design: Design
    counted: Rows
    wanted: int


def design_around(
    ideal: Design,
    paid: PaidRuns,
    options: DesignOptions,
    *,
    terms: Terms,
    constraints: Sequence[Margin] = (),
    avoid: Sequence[Margin] = (),
    folder: Path | str = ".",
    deterministic: bool = True,
) -> Around:
    """Complete runs to a design, or the design from nothing by its missing rows, whichever costs fewer runs.

    Runs count up to as many as the design from nothing has. There are more where these runs do not reach as
    far as it does, or cannot estimate the model: as many as it takes to have 95 % of the D-efficiency of as
    many that do.

    Parameters
    ----------
    ideal : Design
        The design from nothing.
    paid : PaidRuns
    options : DesignOptions
    terms : Terms
        The model.
    constraints : sequence of callable
        Margins that every point must keep; runs that do not are outside.
    avoid : sequence of callable
        Margins that every *new* point must keep besides: away from where runs failed.
    folder : path
        Folder of the study.
    deterministic : bool
        Whether repeated points are one run.

    Raises
    ------
    RsmkitError
        When there is no room for what is missing.
    """
    task = _Task(ideal, paid, options, terms, (*constraints, *avoid), Path(folder), deterministic)
    inside = _inside(ideal, paid.rows, constraints)
    if task.beside_runs(inside) is not None:
        try:
            return _complete_runs(task, inside)
        except RsmkitError:  # no room between them: the design from nothing has its points already
            pass
    return _complete_ideal(task, inside)


@dataclass(frozen=True)
class _Task:
    ideal: Design
    paid: PaidRuns
    options: DesignOptions
    terms: Terms
    constraints: tuple[Margin, ...]
    folder: Path
    deterministic: bool

    @property
    def wanted(self) -> int:
        return self.count(self.ideal, np.ones(len(self.ideal), bool))

    @property
    def missing(self) -> Rows:
        """Rows of the design from nothing that have not been run."""
        return ~(self.paid.ideal_done | self.paid.ideal_failed)

    def count(self, design: Design, rows: Rows) -> int:
        """Runs that these rows of a design need."""
        return len({place_of(p) for p in design.points[rows]}) if self.deterministic else int(rows.sum())

    @cached_property
    def extra(self) -> Rows:
        """Runs that are not rows of the design from nothing."""
        left = Counter(place_of(point) for point in self.ideal.points)
        if self.deterministic:
            return np.array([place_of(point) not in left for point in self.paid.rows.points], bool)
        extra = []
        for point in self.paid.rows.points:
            left[place_of(point)] -= 1
            extra.append(left[place_of(point)] < 0)
        return np.array(extra, bool)

    def lost(self, inside: Rows) -> int:
        """Rows of the design from nothing that failed and that no other run stands in for."""
        others = int((self.paid.done & inside & self.extra).sum())
        return max(0, self.wanted - self.count(self.ideal, ~self.paid.ideal_failed) - others)

    def beside_runs(self, inside: Rows) -> int | None:
        """Runs to be made beside those that are there; None if completing the design from nothing is better.

        Where the user named the very points, or the covariance of the very runs, there is no choice.
        """
        base = self.paid.rows.select(self.paid.done & inside)
        most = self.count(self.ideal, self.missing) + self.lost(inside)
        least = max(0, self.wanted - len(base))
        if not len(base) or least >= most or self.options.fixed or self.options.covariance:
            return None
        needed = max(least, self.further(base, most))
        return needed if needed < most else None

    @cached_property
    def region(self) -> Region:
        """Where new points may lie."""
        space, options = self.ideal.space, self.options
        return region_of_interest(space, options, self.constraints, self.folder, stars=self.ideal)

    def further(self, base: Design, most: int) -> int:
        """Runs that these lack to be worth as much as runs that reach as far as the design from nothing."""
        space, terms = self.ideal.space, self.terms
        aim = self._aim(base)
        if aim is None:
            return 0
        candidates = np.vstack(
            [
                self.ideal.coded[self.missing],
                self.region.sample(CANDIDATES, self.options.seed),
                lattice(self.region, CANDIDATES),
            ]
        )
        rows = terms.matrix(space.encode(space.snap(space.decode(candidates))))
        known = terms.matrix(base.coded)
        information = known.T @ known + RIDGE * np.eye(terms.p)
        for added in range(most):
            if np.linalg.slogdet(information)[1] >= aim:
                return added
            gains = np.einsum("ij,ij->i", rows @ np.linalg.inv(information), rows)
            best = rows[int(gains.argmax())]
            information = information + np.outer(best, best)
        return most

    def _aim(self, base: Design) -> float | None:
        """Log determinant to be reached; None where the design from nothing cannot estimate the model."""
        values = []
        compared = [self.ideal.coded]
        if not self.ideal.space.equalities:  # stretched points of a mixture would be none
            compared.append(_stretched(base.coded, self.ideal.coded, self.ideal.space.numeric))
        for coded in compared:
            X = self.terms.matrix(coded)
            if len(X) >= self.terms.p and np.linalg.matrix_rank(X) == self.terms.p:
                values.append(float(np.linalg.slogdet(X.T @ X)[1]))
            elif not values:
                return None
        return min(values) + self.terms.p * float(np.log(WORTH))

    def grown(self, base: Design, added: int) -> Design:
        """New points beside those of a design."""
        if not added:
            return base.select([])
        variance = self.options.block_variance if base.blocks else None
        options = replace(self.options, blocks=(), covariance=None, block_variance=variance)
        total = len(base) + added
        spread = (options.fills and options.augment_to is None) or total < self.terms.p
        made = grow(
            base,
            total,
            options,
            region=self.region,
            terms=self.terms,
            folder=self.folder,
            spread=spread,
        )
        return made.select(list(range(len(base), total)))


def _complete_runs(task: _Task, inside: Rows) -> Around:
    """The runs that are there come first, in the order they had."""
    rows, done = task.paid.rows, task.paid.done
    added = task.beside_runs(inside)
    assert added is not None
    base = rows.select(done & inside)
    new = task.grown(base, added)
    return _around(
        task, [(base, True), (rows.select(~done & inside), False), *_outside(task, inside), (new, True)]
    )


def _complete_ideal(task: _Task, inside: Rows) -> Around:
    """The design from nothing comes first, row by row, whatever became of it."""
    rows, done, extra = task.paid.rows, task.paid.done, task.extra
    ideal = task.ideal
    alive = ideal.select(~task.paid.ideal_failed)
    useful = rows.select(done & inside & extra)
    new = task.grown(_joined([alive, useful], ideal.space), task.lost(inside))
    parts = [
        (useful, True),
        (rows.select(~done & extra & inside), False),
        *_outside(task, inside),
        (new, True),
    ]
    return _around(task, parts, ideal)


def _outside(task: _Task, inside: Rows) -> Iterator[tuple[Design, bool]]:
    chosen = task.paid.rows.select(task.paid.done & ~inside & task.extra)
    yield replace(chosen, kinds=(OUTSIDE,) * len(chosen)), False


def _around(task: _Task, parts: list[tuple[Design, bool]], ideal: Design | None = None) -> Around:
    first = [] if ideal is None else [ideal]
    counted = [np.full(len(part), counts) for part, counts in parts]
    if ideal is not None:
        counted.insert(0, ~task.paid.ideal_failed)
    design = _joined([*first, *(part for part, _ in parts)], task.ideal.space)
    if ideal is not None and len(design) == len(ideal):
        design = ideal
    return Around(design, np.concatenate(counted), task.wanted)


def _joined(parts: Sequence[Design], space: Space) -> Design:
    """Several designs as one; where one has blocks, rows without are a block of their own."""
    parts = [part for part in parts if len(part)]
    if not parts:
        return Design(space, np.empty((0, len(space))), ())
    if any(part.blocks for part in parts):
        last = 0
        blocks: list[int] = []
        for part in parts:
            own = part.blocks or (last + 1,) * len(part)
            blocks += own
            last = max(blocks)
        joined = tuple(blocks)
    else:
        joined = ()
    return Design(
        space,
        np.vstack([part.points for part in parts]),
        tuple(kind for part in parts for kind in part.kinds),
        joined,
        parts[0].found if len(parts) == 1 else None,
    )


def _inside(ideal: Design, rows: Design, constraints: Sequence[Margin]) -> Rows:
    """Rows within the bounds, or as far out as the design from nothing goes, that keep the constraints."""
    numeric = ideal.space.numeric
    reach = np.maximum(1.0, np.abs(ideal.coded).max(axis=0, initial=0.0))
    inside: Rows = (np.abs(rows.coded) <= reach * (1.0 + 1e-9))[:, numeric].all(axis=1)
    if ideal.space.equalities:
        inside &= ideal.space.contains(rows.points)
    for constraint in constraints:
        inside &= np.asarray(constraint(rows.points)) >= -1e-9
    return inside


def _stretched(coded: Floats, ideal: Floats, numeric: Rows) -> Floats:
    """The points as they would be if they reached as far as others do within the bounds."""
    low, high = coded.min(axis=0), coded.max(axis=0)
    wide_low = np.minimum(low, np.maximum(ideal.min(axis=0), -1.0))
    wide_high = np.maximum(high, np.minimum(ideal.max(axis=0), 1.0))
    scale = np.where(
        numeric & (high > low), (wide_high - wide_low) / np.where(high > low, high - low, 1.0), 1.0
    )
    start = np.where(numeric & (high > low), wide_low, low)
    return np.asarray(start + scale * (coded - low))
