"""Optimal designs for any hierarchical polynomial, from scratch or by augmenting given points.

Random starts, each an iterated local search that begins by cooling where the model is large
(:mod:`rsmkit.design.optimal.exchange` on boxes and under linear constraints,
:mod:`rsmkit.design.optimal.fedorov` on lists of candidates and in curved regions). Every start has its own
seed, so a design depends on nothing but its options.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rsmkit.design.design import Design, Found
from rsmkit.design.optimal.criteria import Aim, Criterion, aim_for, precision_of
from rsmkit.design.optimal.edge import candidate_points, move_freely
from rsmkit.design.optimal.encoding import (
    Integers,
    Lines,
    Model,
    State,
    encode_candidates,
    encode_model,
    encode_region,
    model_rows,
    working_space,
)
from rsmkit.design.region import Region, box, placed, starting_points
from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.language.space import Floats, Space
from rsmkit.language.space_terms import space_terms
from rsmkit.language.terms import Terms

__all__ = ["augment", "optimal_design"]

TOLERANCE = 1e-4
"""Relative gain of a pass below which a climb stops; the last climb goes a million times further."""
EFFORT = 1.25e9
"""Work of a whole search in the units of :func:`_effort`, some seconds at most."""
SAME = 1e-5
"""Two starts found the same value when their efficiencies differ by less than this."""
SETTLED = 1e-9
"""Relative gain below which the points of the best design on a mixture are moved no more."""
SURE = 0.01
"""The search ends when another start would end at a value not seen before with less than this chance."""
MOST_STARTS = 100
COOLED = 28
"""Starts for models of first or second order with more coefficients begin by cooling; for smaller ones quick
starts agree, and those of higher order need more values than cooling draws from."""
COORDINATE = 500
"""Work of drawing a coordinate, beside the square of the number of its terms."""
FEWEST_PASSES, PASSES = 300, 25
"""Passes of cooling: at least, and per coefficient at most; slower cooling is better but for the time."""
COOLED_STARTS, COOLED_KICKS = 2, 10
NODES = 4000
"""Corners and centroids that a point may be moved to when it is near one."""
MINIMAX_EFFORT = 2e7
"""Work of a search for G, likewise."""


@checked
def optimal_design(
    space: Space,
    runs: int,
    *,
    given: Design | None = None,
    terms: Terms | int = 2,
    criterion: Criterion = "D",
    region: Region | None = None,
    min_distance: float = 0.0,
    blocks: Sequence[int] | None = None,
    covariance: Floats | None = None,
    starts: int | None = None,
    seed: int = 1,
) -> Design:
    """Find the points that are best for estimating a polynomial.

    Parameters
    ----------
    space : Space
    runs : int
        Number of runs in all, at least the number of model columns.
    given : Design, optional
        Runs that are kept: they come first, unchanged, and may lie outside the region.
    terms : Terms or int
        The model, or its order (2: full second order).
    criterion : {"D", "A", "G", "I", "bayesian-D"}
        D: largest determinant of the information matrix. A: smallest average variance of the coefficients.
        I: smallest prediction variance averaged over the region (exact moments on boxes and balls). G: small
        largest prediction variance in the region. bayesian-D: D, guarding against terms of the next order.
    region : Region, optional
        Where new points may lie; the bounds by default.
    min_distance : float
        No new point closer than this to any other, in coded units; any positive value forbids replicates,
        which tell nothing about a deterministic simulator.
    blocks : sequence of int, optional
        Block of every run, given ones first: the design is best for the model beside unknown block effects.
    covariance : array, shape (runs, runs), optional
        Covariance of the runs' errors, up to a factor (split plots, random blocks).
    starts : int, optional
        Random starts at most; chosen from the size of the problem by default. The search ends early when
        another start would most likely find nothing new.
    seed : int

    Returns
    -------
    Design
        New points of kind ``optimal``, or ``augmented`` beside given ones; ``found`` says how it was found.

    Raises
    ------
    RsmkitError
        When there are too few runs for the model, the constraints leave no room, or every design tried is
        singular.
    """
    region = box(space) if region is None else region
    terms = terms if isinstance(terms, Terms) else space_terms(space, terms)
    given = Design(space, np.empty((0, len(space))), ()) if given is None else given
    added = runs - len(given)
    if added < 0:
        raise RsmkitError(f"the given design has {len(given)} runs already, {runs} in all were asked for")
    effects = 0 if blocks is None else len(set(blocks)) - 1
    if runs < terms.p + effects:
        raise RsmkitError(
            f"{runs} runs cannot estimate the {terms.p} coefficients of the model"
            f"{f' beside {effects} block effects' if effects else ''}: "
            f"ask for at least {terms.p + effects} runs or a smaller model"
        )
    aim = aim_for(criterion, terms, region)
    candidates = candidate_points(region, seed) if region.irregular else None
    task = _Task(
        encode_model(aim.terms),
        region,
        encode_region(region, min_distance),
        aim,
        precision_of(runs, blocks, covariance),
        given.coded,
        added,
        *_effort(added, aim.terms, len(aim.weights) > 0, candidates, starts),
        candidates=candidates,
    )
    if criterion == "G":
        points, found = _smallest_largest_variance(task, starts, seed)
    else:
        points, found = _best_of_starts(task, criterion, seed)
        points[len(given) :] = _tidy(points, task)
    return Design(
        space,
        np.vstack([given.points, placed(space, points[len(given) :])]),
        given.kinds + ("augmented" if len(given) else "optimal",) * added,
        given.blocks if blocks is None else tuple(map(int, blocks)),
        found,
    )


@checked
def augment(design: Design, runs: int, **options: Any) -> Design:
    """Add the best points to a design until it has `runs` runs in all.

    `options` are those of :func:`optimal_design`.
    """
    return design if runs == len(design) else optimal_design(design.space, runs, given=design, **options)


@dataclass(frozen=True)
class _Task:
    """One search, ready for the exchange."""

    model: Model
    region: Region
    lines: Lines
    aim: Aim
    precision: Floats
    given: Floats
    added: int
    starts: int
    kicks: int
    kick_rows: int
    passes: int
    candidates: Floats | None

    @property
    def free(self) -> Integers:
        """Indices of the rows that may change."""
        return np.arange(len(self.given), len(self.given) + self.added)

    @property
    def scale(self) -> int:
        """Log determinants are compared per coefficient, traces relative to themselves (0)."""
        return 0 if len(self.aim.weights) else len(self.aim.prior)

    def state(self, points: Floats) -> State:
        """Working space for one start."""
        p = len(self.aim.prior)
        return State(
            points.copy(),
            np.zeros((len(points), p)),
            self.precision,
            self.aim.prior,
            self.aim.weights,
            np.zeros((p, p)),
            np.zeros((p, p)),
        )


def _effort(
    added: int, terms: Terms, linear: bool, candidates: Floats | None, starts: int | None
) -> tuple[int, int, int, int]:
    """Starts, kicks per start, most rows per kick, and passes of cooling before the first climb.

    Small problems are searched harder than large ones. A few starts that cool slowly find better designs than
    many that cool fast.
    """
    reach = terms.p + 60 * terms.k if candidates is None else 12 * len(candidates)
    factor = 2 if linear else 1
    climbs = EFFORT / (max(added, 1) * terms.p * reach * factor)
    rows = max(2, added // 5, min(10, added // 2))
    longest = max(sum(e[j] > 0 for e in terms.exponents) for j in range(terms.k))
    affordable = EFFORT / ((COORDINATE + longest**2) * max(added, 1) * terms.k * factor)
    passes = int(min(affordable / COOLED_STARTS, PASSES * terms.p))
    if candidates is None and terms.order <= 2 and terms.p > COOLED and passes >= FEWEST_PASSES:
        return starts or min(1 + int(affordable / passes), MOST_STARTS), COOLED_KICKS, rows, passes
    kicks = int(np.clip(climbs / 2, 10 if candidates is None else 3, np.clip(terms.p, 10, 60) // factor))
    return starts or int(np.clip(climbs / kicks, 2, MOST_STARTS)), kicks, rows, 0


def _best_of_starts(task: _Task, criterion: str, seed: int) -> tuple[Floats, Found]:
    results, values, unseen = list[tuple[float, Floats]](), np.empty(0), 1.0
    for result in _results(task, seed):
        results.append(result)
        values = np.array([value for value, _ in results])
        unseen = _chance_of_another_value(values, task.scale or abs(values.max()))
        if unseen < SURE:
            break
    best = float(values.max())
    if best == -np.inf:
        raise RsmkitError(
            f"no non-singular design was found in {task.starts} starts: the region, the factors' levels or "
            f"the minimum distance leave too few different points for the model{_flatter(task.region)}"
        )
    hits = int((best - values < SAME * (task.scale or abs(best))).sum())
    order = np.argsort(-values, kind="stable")
    points = results[int(order[0])][1]
    if task.candidates is not None and task.region.candidates is None:  # the best few leave the candidates
        few = _different(values, order, task)
        moved = [
            move_freely(task.model, task.region, task.state(results[i][1]), task.free, task.lines.distance)
            for i in few
        ]
        reached = [_value(design, task) for design in moved]
        points = moved[int(np.argmax(reached))]
        if task.region.flat:
            points = move_freely(
                task.model, task.region, task.state(points), task.free, task.lines.distance, SETTLED
            )
        best = _value(points, task)
    return points, Found(
        criterion, best if task.scale else -best, len(values), hits, unseen, task.lines.distance
    )


def _different(values: Floats, order: Integers, task: _Task) -> list[int]:
    """The best tenth of the starts; of those in flat regions that ended at the same value one."""
    few = [int(i) for i in order[: 1 + len(values) // 10] if np.isfinite(values[i])]
    if not task.region.flat:
        return few
    scale = SAME * (task.scale or abs(float(values.max())))
    return [i for place, i in enumerate(few) if not place or values[few[place - 1]] - values[i] > scale]


def _flatter(region: Region) -> str:
    """What to say where limits take more room away than the equalities do."""
    for group in region.groups if region.flat else ():
        wanted = len(group.columns) - len(group.polytope.rhs)
        if group.polytope.dimension < wanted:
            names = ", ".join(region.space.names[j] for j in group.columns)
            return (
                f". Limits on {names} hold with equality and leave {group.polytope.dimension} of {wanted} "
                "dimensions; widen them, or write them as an equality"
            )
    return ""


def _smallest_largest_variance(task: _Task, starts: int | None, seed: int) -> tuple[Floats, Found]:
    """Begin from designs that are nearly D-optimal, and lower the largest variance of each."""
    from rsmkit.design.optimal.minimax import largest_variance, lower_largest_variance, probe_points, sharpen

    probes = probe_points(task.region)
    trials = len(probes) * len(task.aim.prior) * task.model.exponents.shape[1] * task.added**2
    starts = starts or int(np.clip(MINIMAX_EFFORT / trials, 2, 40))
    fixed = task.model, task.region
    options = task.lines, task.precision
    descended = [
        lower_largest_variance(*fixed, *options, points, len(task.given), probes)
        for value, points in _results(replace(task, starts=starts, kicks=0, passes=0), seed)
        if np.isfinite(value)
    ]
    if not descended:
        raise RsmkitError("no non-singular design was found to begin from: ask for more runs or more levels")
    values = np.array([largest_variance(*fixed, task.precision, points, probes)[0] for points in descended])
    if not task.region.irregular:
        for i in np.argsort(values, kind="stable")[: 1 + len(values) // 4]:
            descended[i] = sharpen(*fixed, *options, descended[i], len(task.given), probes)
            values[i] = largest_variance(*fixed, task.precision, descended[i], probes)[0]
    best = float(values.min())
    hits = int((values < best * (1.0 + 1e-3)).sum())
    points = descended[int(values.argmin())]
    tidied = np.vstack([task.given, _neat(points[len(task.given) :], task)])
    after = largest_variance(*fixed, task.precision, tidied, probes)[0]
    if (
        after <= best * (1.0 + 1e-8)
        and task.lines.distance == 0.0
        and task.region.contains(tidied[len(task.given) :]).all()
    ):
        best, points = after, tidied
    return points, Found("G", best, len(values), hits, distance=task.lines.distance)


def _chance_of_another_value(values: Floats, scale: float) -> float:
    """Chance that one more start ends at a value none has ended at: w (w + 1) / (N (N - 1)).

    For w different values in N starts; Boender & Rinnooy Kan (1987), Mathematical Programming 37, 59-80.
    """
    if len(values) < 2:
        return 1.0
    ordered = np.sort(values[np.isfinite(values)])
    different = 1 + int((np.diff(ordered) > SAME * scale).sum())
    return min(1.0, different * (different + 1) / (len(values) * (len(values) - 1)))


def _results(task: _Task, seed: int) -> Iterator[tuple[float, Floats]]:
    """Results of the starts, each made when it is asked for: the search often ends early."""
    for index, state in enumerate(np.random.SeedSequence(seed).generate_state(task.starts)):
        yield _one_start(task, index, int(state))


def _one_start(task: _Task, index: int, seed: int) -> tuple[float, Floats]:
    """One start; the first is for a quick answer, the others cool, in turn over three and five values."""
    state = task.state(np.vstack([task.given, starting_points(task.region, task.added, seed)]))
    work = working_space(task.model, len(state.points))
    effort = task.free, seed, task.kicks, task.kick_rows, TOLERANCE
    if task.candidates is not None:
        from rsmkit.design.optimal.fedorov import search_candidates

        listed = encode_candidates(task.model, task.candidates)
        value = search_candidates(listed, task.model, task.lines.distance, state, work, *effort)
    else:
        from rsmkit.design.optimal.exchange import search

        passes = task.passes if index > 0 else 0
        value = search(task.model, task.lines, state, work, *effort, passes, 5 - 2 * (index % 2))
    return value, state.points


def _tidy(points: Floats, task: _Task) -> Floats:
    """Added points, with coordinates that all but equal a bound or the centre put there."""
    free = points[len(task.given) :]
    tidied = _on_nodes(free, task.region) if task.region.flat else _neat(free, task)
    before, after = (_value(np.vstack([task.given, rows]), task) for rows in (free, tidied))
    allowed = task.lines.distance == 0.0 and bool(task.region.contains(tidied).all())
    return tidied if allowed and after >= before - 1e-8 * (1.0 + abs(before)) else free


def _neat(free: Floats, task: _Task) -> Floats:
    """Coordinates that are near a bound or the centre, moved there."""
    neat = free.copy()
    for value in (task.lines.lows, np.zeros(free.shape[1]), task.lines.highs):
        neat = np.where(np.abs(free - value) < 1e-3, value, neat)
    return neat


def _on_nodes(free: Floats, region: Region) -> Floats:
    """Points of a flat region that are near a corner or a centroid, moved there."""
    nodes = region.nodes(NODES)
    if not len(nodes):
        return free
    nearest = nodes[((free[:, None, :] - nodes) ** 2).sum(axis=2).argmin(axis=1)]
    near = (np.abs(free - nearest) < 1e-3).all(axis=1)
    return np.where(near[:, None], nearest, free)


def _value(points: Floats, task: _Task) -> float:
    """The criterion by plain linear algebra, larger is better."""
    rows = model_rows(task.model, points)
    weighted = task.precision @ rows if len(task.precision) else rows
    information = task.aim.prior + rows.T @ weighted
    if task.scale:
        return float(np.linalg.slogdet(information)[1])
    return -float(np.trace(np.linalg.solve(information, task.aim.weights)))
