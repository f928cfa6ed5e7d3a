"""Optimal designs for any hierarchical polynomial, from scratch or by augmenting given points.

Many random starts of the compiled coordinate exchange; every start has its own seed, so the design is the
same for any number of workers.
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Literal

import numpy as np

from rsmkit.design.encoding import Lines, Model, State, encode_model, encode_region, model_rows, moments
from rsmkit.design.region import Region, box
from rsmkit.design.table import Design, Found
from rsmkit.errors import RsmkitError
from rsmkit.space import Floats, Space
from rsmkit.terms import Terms, full_terms

__all__ = ["Criterion", "augment", "optimal_design"]

Criterion = Literal["D", "A", "I"]

TOLERANCE = 1e-4
"""Relative gain of a pass below which a climb stops; the last climb goes a million times further."""
EFFORT = 8e7
"""Work of a whole search in the units of :func:`_effort`, a second or two."""
SAME = 1e-5
"""Two starts found the same value when their efficiencies differ by less than this."""
ENOUGH_HITS = 3
"""The search ends when this many starts have found the best value."""


def optimal_design(
    space: Space,
    runs: int,
    *,
    terms: Terms | int = 2,
    criterion: Criterion = "D",
    region: Region | None = None,
    min_distance: float = 0.0,
    starts: int | None = None,
    seed: int = 1,
    workers: int = 1,
) -> Design:
    """Find `runs` points that are best for estimating a polynomial.

    Parameters
    ----------
    space : Space
    runs : int
        Number of runs, at least the number of model columns.
    terms : Terms or int
        The model, or its order (2: full second order).
    criterion : {"D", "A", "I"}
        D: largest determinant of the information matrix. A: smallest average variance of the coefficients.
        I: smallest prediction variance averaged over the region (exact moments).
    region : Region, optional
        Where points may lie; the bounds by default.
    min_distance : float
        No two points closer than this, in coded units; any positive value forbids replicates, which tell
        nothing about a deterministic simulator.
    starts : int, optional
        Random starts; chosen from the size of the problem by default.
    seed : int
    workers : int
        Threads; the result does not depend on it.

    Returns
    -------
    Design
        Kind ``optimal``; ``found`` says how it was found.

    Raises
    ------
    RsmkitError
        When there are too few runs for the model, or no non-singular design can be found.
    """
    nothing = Design(space, np.empty((0, len(space))), ())
    return _extend(nothing, runs, "optimal", terms, criterion, region, min_distance, starts, seed, workers)


def augment(
    design: Design,
    runs: int,
    *,
    terms: Terms | int = 2,
    criterion: Criterion = "D",
    region: Region | None = None,
    min_distance: float = 0.0,
    starts: int | None = None,
    seed: int = 1,
    workers: int = 1,
) -> Design:
    """Add the best points to a design until it has `runs` runs in all; the given ones stay first, unchanged.

    Parameters are those of :func:`optimal_design`. Given points may lie outside the region (the star of a
    circumscribed central composite design does); added ones, of kind ``augmented``, may not.
    """
    if runs < len(design):
        raise RsmkitError(f"augment: the design has {len(design)} runs already, {runs} in all were asked for")
    if runs == len(design):
        return design
    return _extend(design, runs, "augmented", terms, criterion, region, min_distance, starts, seed, workers)


def _extend(
    given: Design,
    runs: int,
    kind: str,
    terms: Terms | int,
    criterion: Criterion,
    region: Region | None,
    min_distance: float,
    starts: int | None,
    seed: int,
    workers: int,
) -> Design:
    space = given.space
    region = box(space) if region is None else region
    terms = terms if isinstance(terms, Terms) else full_terms(space, terms)
    if runs < terms.p:
        raise RsmkitError(
            f"{runs} runs cannot estimate the {terms.p} coefficients of the model: "
            f"ask for at least {terms.p} runs or a smaller model"
        )
    model = encode_model(terms)
    weights = {"D": np.zeros((0, 0)), "A": np.eye(terms.p)}.get(criterion)
    task = _Task(
        model,
        encode_region(region, min_distance),
        given.coded,
        runs - len(given),
        np.zeros((terms.p, terms.p)),
        moments(model, region) if weights is None else weights,
        region,
        *_effort(runs - len(given), terms, criterion, starts),
    )
    points, found = _best_of_starts(task, criterion, seed, workers)
    points[len(given) :] = _tidy(points, task)
    added = space.snap(space.decode(points[len(given) :]))
    return Design(
        space,
        np.vstack([given.points, added]),
        given.kinds + (kind,) * (runs - len(given)),
        found=found,
    )


@dataclass(frozen=True)
class _Task:
    """One search, ready for the kernel."""

    model: Model
    lines: Lines
    given: Floats
    added: int
    prior: Floats
    weights: Floats
    region: Region
    starts: int
    kicks: int
    kick_rows: int


def _effort(added: int, terms: Terms, criterion: Criterion, starts: int | None) -> tuple[int, int, int]:
    """Starts, kicks per start and most rows per kick: small problems are searched harder than large ones."""
    work = added * terms.p * (terms.p + 20 * terms.k) * (1 if criterion == "D" else 4)
    climbs = EFFORT / work
    kicks = int(np.clip(climbs / 2, 3, min(100, max(30, 4 * terms.p))))
    return starts or int(np.clip(climbs / kicks, 2, 6)), kicks, max(2, added // 5)


def _best_of_starts(task: _Task, criterion: str, seed: int, workers: int) -> tuple[Floats, Found]:
    seeds = [int(s) for s in np.random.SeedSequence(seed).generate_state(task.starts)]
    scale = len(task.model.exponents) if criterion == "D" else 0
    best, hits, points = -np.inf, 0, task.given
    for made, (value, found) in enumerate(_results(task, seeds, workers), start=1):
        if value > best and (best - value) / (scale or abs(value)) < -SAME:
            hits = 0
        if value > best:
            best, points = value, found
        hits += (best - value) / (scale or abs(best)) < SAME
        if hits == ENOUGH_HITS or made == task.starts:
            break
    if best == -np.inf:
        raise RsmkitError(
            f"no non-singular design was found in {task.starts} starts: the region, the factors' levels or "
            "the minimum distance leave too few different points for the model"
        )
    return points, Found(criterion, float(best if criterion == "D" else -best), made, int(hits))


def _tidy(points: Floats, task: _Task) -> Floats:
    """Added points, with coordinates that all but equal a bound or the centre put there."""
    free = points[len(task.given) :]
    tidied = free.copy()
    for value in (task.lines.lows, np.zeros(free.shape[1]), task.lines.highs):
        tidied = np.where(np.abs(free - value) < 1e-4, value, tidied)
    before, after = (_value(np.vstack([task.given, rows]), task) for rows in (free, tidied))
    allowed = bool(task.region.contains(tidied).all()) and task.lines.distance == 0.0
    return tidied if allowed and after >= before - 1e-8 * (1.0 + abs(before)) else free


def _value(points: Floats, task: _Task) -> float:
    """The criterion by plain linear algebra, larger is better."""
    rows = model_rows(task.model, points)
    information = task.prior + rows.T @ rows
    if len(task.weights) == 0:
        return float(np.linalg.slogdet(information)[1])
    return -float(np.trace(np.linalg.solve(information, task.weights)))


def _results(task: _Task, seeds: list[int], workers: int) -> Iterator[tuple[float, Floats]]:
    """Results of the starts in the order of their seeds, `workers` at a time."""
    with ThreadPoolExecutor(max_workers=max(1, workers)) as pool:
        for first in range(0, len(seeds), max(1, workers)):
            batch = seeds[first : first + max(1, workers)]
            yield from pool.map(lambda start: _one_start(task, start), batch)


def _one_start(task: _Task, seed: int) -> tuple[float, Floats]:
    from rsmkit.design.exchange import search

    p = len(task.model.exponents)
    n = len(task.given) + task.added
    points = np.vstack([task.given, task.region.sample(task.added, seed)])
    state = State(
        points,
        np.zeros((n, p)),
        np.zeros((0, 0)),
        task.prior,
        task.weights,
        np.zeros((p, p)),
        np.zeros((p, p)),
    )
    free = np.arange(len(task.given), n)
    value, _ = search(task.model, task.lines, state, free, seed, task.kicks, task.kick_rows, TOLERANCE)
    return float(value), points
