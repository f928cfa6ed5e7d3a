"""Space-filling designs: Latin hypercubes, Sobol and Halton points, maximin augmentation."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import ClassVar, Literal

import numpy as np

from rsmkit.design.design import Design
from rsmkit.design.families.site import Site, allowed, needed_runs
from rsmkit.design.families.without_repeats import in_rounds, least_used, without_repeats
from rsmkit.design.options import MOST_RUNS, DesignOptions, Problems, counts
from rsmkit.design.region import MOST_DRAWS, Region, box, placed
from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.io.option_fields import doc
from rsmkit.language.space import Floats, Space

__all__ = [
    "LatinHypercubeOptions",
    "SequenceOptions",
    "fill",
    "halton",
    "latin_hypercube",
    "make_halton",
    "make_latin_hypercube",
    "make_sobol",
    "sobol",
]

Spread = Literal["maximin", "discrepancy", "correlation"]

CLOSENESS = 15.0
"""Power of the inverse distances whose sum stands for the smallest one (Morris & Mitchell 1995)."""
CANDIDATES = 4096
SAME = 1e-9
"""Points nearer than this are one."""


@dataclass(frozen=True, kw_only=True)
class SequenceOptions(DesignOptions):
    """Space-filling design: the first points of a low-discrepancy sequence."""

    fills: ClassVar[bool] = True

    runs: int | None = doc("number of runs; also under constraints", None)

    def problems(self) -> Problems:
        """Report what is wrong beyond types."""
        return super().problems() + counts(self, 1, MOST_RUNS, "runs")


@dataclass(frozen=True, kw_only=True)
class LatinHypercubeOptions(SequenceOptions):
    """Space-filling design: Latin hypercube, every factor has one point in each of equal slices."""

    spread: Spread = doc("what it is improved for", "maximin")


def make_latin_hypercube(space: Space, options: LatinHypercubeOptions, site: Site) -> Design:
    """The design of the study file; where points are forbidden, others far from all take their place."""
    runs = needed_runs(options)
    design = allowed(latin_hypercube(space, runs, spread=options.spread, seed=options.seed), site.constraints)
    if len(design) == runs:
        return design
    return fill(design, runs, region=box(space, 1.0, site.constraints), seed=options.seed)


def make_sobol(space: Space, options: SequenceOptions, site: Site) -> Design:
    """The design of the study file: the first allowed Sobol points."""
    return _first_allowed(sobol, space, options, site)


def make_halton(space: Space, options: SequenceOptions, site: Site) -> Design:
    """The design of the study file: the first allowed Halton points."""
    return _first_allowed(halton, space, options, site)


def _first_allowed(
    sequence: Callable[..., Design], space: Space, options: SequenceOptions, site: Site
) -> Design:
    """Go along the sequence, twice as far every time, until there are enough allowed points."""
    runs = drawn = needed_runs(options)
    if space.equalities and site.constraints:
        region = box(space, 1.0, site.constraints)  # spread over what the limits leave
        points = placed(space, region.sample(runs, options.seed))
        return Design(space, points, ("space-filling",) * runs)
    design = allowed(sequence(space, drawn, seed=options.seed), site.constraints)
    while len(design) < runs:
        drawn *= 2
        if drawn > MOST_DRAWS:
            raise RsmkitError(
                f"design: only {len(design)} of the first {drawn // 2} {options.kind} points satisfy "
                "the constraints (subject_to); widen them or shrink the factor ranges around them"
            )
        design = allowed(sequence(space, drawn, seed=options.seed), site.constraints)
    return design if len(design) == runs else design.select(in_rounds(design.points)[:runs])


@checked
def latin_hypercube(
    space: Space, runs: int, *, spread: Spread = "maximin", centered: bool = True, seed: int = 1
) -> Design:
    """Latin hypercube: every factor has one point in each of `runs` equal slices.

    Parameters
    ----------
    space : Space
    runs : int
    spread : {"maximin", "discrepancy", "correlation"}
        Swaps within columns make the smallest distance large, the centred discrepancy small (Hickernell
        1998), or the largest correlation between columns small.
    centered : bool
        Points in the middle of their slices, not at random in them.
    seed : int
    """
    if space.equalities:
        raise RsmkitError(
            f"a Latin hypercube cuts every factor into equal slices, and '{space.equalities[0].text}' leaves "
            "no such points; take sobol or maximin"
        )
    if runs < 2:
        raise RsmkitError(f"a Latin hypercube needs at least 2 runs, got {runs}")
    rng = np.random.default_rng(seed)
    k = len(space)
    cells = np.stack([rng.permutation(runs) for _ in range(k)], axis=1).astype(float)
    unit = (cells + (0.5 if centered else rng.random(cells.shape))) / runs
    measures: dict[Spread, Callable[[Floats], _Crowding | _Recomputed]] = {
        "maximin": _Crowding,
        "discrepancy": partial(_Recomputed, _discrepancy),
        "correlation": partial(_Recomputed, _correlation),
    }
    tries = int(np.clip(100 * runs * k, 500, 20000))
    return _design(space, _swap(unit, measures[spread], rng, tries), seed)


@checked
def sobol(space: Space, runs: int, *, seed: int = 1) -> Design:
    """Scrambled Sobol points; best balanced when `runs` is a power of two."""
    from scipy.stats import qmc

    power = max(0, math.ceil(math.log2(max(runs, 1))))
    unit = qmc.Sobol(len(space), rng=np.random.default_rng(seed)).random_base2(power)[:runs]
    return _design(space, unit, seed)


@checked
def halton(space: Space, runs: int, *, seed: int = 1) -> Design:
    """Scrambled Halton points."""
    from scipy.stats import qmc

    return _design(space, qmc.Halton(len(space), rng=np.random.default_rng(seed)).random(runs), seed)


@checked
def fill(design: Design, runs: int, *, region: Region | None = None, seed: int = 1) -> Design:
    """Add points far from all others, one after the other, until there are `runs` runs.

    Parameters
    ----------
    design : Design
        Kept as it is; may be empty.
    region : Region, optional
        Where new points may lie; the bounds by default.

    Notes
    -----
    Kennard & Stone (1969), Technometrics 11(1), 137-148, over allowed Sobol points and the lattice, each
    point found then moved to the farthest place nearby.
    """
    if runs < len(design):
        raise RsmkitError(f"the design has {len(design)} runs already, {runs} in all were asked for")
    space = design.space
    region = box(space) if region is None else region
    from rsmkit.design.optimal.criteria import lattice

    if region.candidates is not None:
        candidates = region.candidates
        free = (
            len(candidates)
            if len(design) == 0
            else int((_nearest(space, candidates, design.coded) > 0).sum())
        )
        if free < runs - len(design):
            raise RsmkitError(
                f"the list of candidates has {free} points that are not in the design yet, "
                f"{runs - len(design)} are to be added"
            )
    else:
        candidates = np.vstack([region.sample(CANDIDATES, seed), lattice(region, CANDIDATES)])
    points = design.coded if len(design) else candidates[:0]
    if len(points) == 0 and runs > 0:
        points = region.inner_point[None, :]
    rng = np.random.default_rng(seed)
    finite = all(len(levels) for levels in region.levels)
    while len(points) < runs:
        distances = _nearest(space, candidates, points)
        if finite and distances.max() <= SAME:  # all are taken: begin another round
            distances = np.where(least_used(candidates, points), 1.0, 0.0)
        best = candidates[distances.argmax()]
        for width in (0.3, 0.1, 0.03, 0.01):
            around = np.where(space.numeric, best + width * rng.normal(size=(64, len(space))), best)
            around = space.encode(placed(space, np.clip(around, region.lows, region.highs)))
            around = np.vstack([best, around[region.contains(around)]])
            if region.candidates is None and distances.max() > SAME:
                best = around[_nearest(space, around, points).argmax()]
        points = np.vstack([points, best])
    if region.flat and region.candidates is None:
        points = _spread_out(region, points, len(design), rng)
    added = placed(space, points[len(design) :])
    kinds = design.kinds + ("space-filling",) * (runs - len(design))
    return Design(space, np.vstack([design.points, added]), kinds)


def _spread_out(region: Region, points: Floats, given: int, rng: np.random.Generator) -> Floats:
    """Move added points of a flat region one by one to where the nearest other is farthest.

    Greedy points on a simplex lie on its corners first and crowd later; a few rounds mend that.
    """
    points = points.copy()
    for width in (0.3, 0.1, 0.1, 0.03, 0.03, 0.01):
        for i in range(given, len(points)):
            others = np.delete(points, i, axis=0)
            far = np.where(region.space.numeric, width * rng.normal(size=(64, points.shape[1])), 0.0)
            trials = np.clip(points[i] + far, region.lows, region.highs)
            trials = region.space.encode(placed(region.space, trials))
            trials = np.vstack([points[i], trials[region.contains(trials)]])
            points[i] = trials[_nearest(region.space, trials, others).argmax()] if len(others) else points[i]
    return points


def _nearest(space: Space, points: Floats, others: Floats) -> Floats:
    """Distance of every point to the nearest of the others, categories counting two."""
    gap = points[:, None, :] - others[None, :, :]
    gap[:, :, ~space.numeric] = 2.0 * (gap[:, :, ~space.numeric] != 0.0)
    return np.asarray(np.sqrt((gap**2).sum(axis=2)).min(axis=1))


def _design(space: Space, unit: Floats, seed: int) -> Design:
    """Unit cube to natural units; levels get equal shares of the runs, and points are repeated last."""
    points = space.lows + (space.highs - space.lows) * unit if space.affine is None else space.spread(unit)
    for j, factor in enumerate(space):
        if not factor.domain.is_continuous:
            ranks = unit[:, j].argsort(kind="stable").argsort()
            points[:, j] = factor.domain.from_unit((ranks + 0.5) / len(unit))
    return Design(space, without_repeats(space, points, seed), ("space-filling",) * len(points))


class _Crowding:
    """Sum of inverse distances to a high power; small when the smallest distance is large."""

    def __init__(self, unit: Floats) -> None:
        self.squares = ((unit[:, None, :] - unit[None, :, :]) ** 2).sum(axis=2)
        np.fill_diagonal(self.squares, np.inf)
        self.value = float((self.squares ** (-CLOSENESS / 2)).sum())

    def swapped(self, unit: Floats, a: int, b: int, j: int) -> tuple[float, Floats]:
        rows = []
        for here, there in ((a, b), (b, a)):
            row = self.squares[here] - (unit[here, j] - unit[:, j]) ** 2 + (unit[there, j] - unit[:, j]) ** 2
            row[here] = np.inf
            row[there] = self.squares[a, b]
            rows.append(row)
        new = np.array(rows)
        change = (new ** (-CLOSENESS / 2)).sum() - (self.squares[[a, b]] ** (-CLOSENESS / 2)).sum()
        return self.value + 2.0 * float(change), new

    def accept(self, a: int, b: int, value: float, rows: Floats) -> None:
        self.value = value
        self.squares[[a, b]] = rows
        self.squares[:, [a, b]] = rows.T


class _Recomputed:
    """A measure that is worked out afresh for every swap."""

    def __init__(self, measure: Callable[[Floats], float], unit: Floats) -> None:
        self.measure = measure
        self.value = measure(unit)

    def swapped(self, unit: Floats, a: int, b: int, j: int) -> tuple[float, Floats]:
        trial = unit.copy()
        trial[[a, b], j] = trial[[b, a], j]
        return self.measure(trial), trial

    def accept(self, a: int, b: int, value: float, rows: Floats) -> None:
        self.value = value


def _discrepancy(unit: Floats) -> float:
    from scipy.stats import qmc

    return float(qmc.discrepancy(unit, method="CD"))


def _correlation(unit: Floats) -> float:
    off = np.corrcoef(unit, rowvar=False) - np.eye(unit.shape[1])
    return float(np.abs(off).max() + (off**2).mean())


def _swap(
    unit: Floats, measure: Callable[[Floats], _Crowding | _Recomputed], rng: np.random.Generator, tries: int
) -> Floats:
    """Swap two entries of a column whenever that helps; the points stay a Latin hypercube."""
    unit = unit.copy()
    state = measure(unit)
    n, k = unit.shape
    if k == 1:
        return unit
    for _ in range(tries):
        a, b = (int(i) for i in rng.choice(n, 2, replace=False))
        j = int(rng.integers(k))
        value, rows = state.swapped(unit, a, b, j)
        if value < state.value * (1.0 - 1e-12):
            unit[[a, b], j] = unit[[b, a], j]
            state.accept(a, b, value, rows)
    return unit
