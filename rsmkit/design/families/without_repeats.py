"""Sampling without replacement where factors have levels only: no point twice while another is not taken."""

from __future__ import annotations

import math
from collections import Counter
from itertools import product

import numpy as np
from numpy.typing import NDArray

from rsmkit.language.space import Floats, Space

__all__ = ["in_rounds", "least_used", "without_repeats"]

ROUNDS, TRIES = 10, 10
"""Exchanges tried for each run that repeats another, before it is moved to a free point instead."""
MOST_POINTS = 2**16
"""Points of a space that are listed to find the free ones."""

Point = tuple[float, ...]


def without_repeats(space: Space, points: Floats, seed: int) -> Floats:
    """Exchange entries of columns until no point stands twice while another is not taken.

    The levels of every factor stay as frequent as they were, unless no exchange helps any more. With more
    runs than points every point is taken equally often, or once more than the others. Spaces with a
    continuous factor are left alone.

    Parameters
    ----------
    space : Space
    points : array, shape (n, k)
        Natural units, on the levels.
    seed : int
    """
    counts = [factor.domain.level_count for factor in space]
    if not all(counts):
        return points
    total, rng, points = math.prod(counts), np.random.default_rng(seed), points.copy()
    taken = Counter(map(_key, points))
    for _ in range(ROUNDS):
        crowded = _crowded(points, taken, total)
        for a in crowded:
            for b in rng.integers(len(points), size=TRIES):
                _exchange(points, taken, a, int(b), int(rng.integers(len(space))))
    return points if total > MOST_POINTS else _moved(space, points)


def in_rounds(points: Floats) -> list[int]:
    """Order of rows in which a point stands again only after every other has stood as often."""
    seen: Counter[Point] = Counter()
    rounds = []
    for point in map(_key, points):
        rounds.append(seen[point])
        seen[point] += 1
    return [int(i) for i in np.argsort(rounds, kind="stable")]


def least_used(candidates: Floats, points: Floats) -> NDArray[np.bool_]:
    """Which candidates stand least often among the points, shape (N,)."""
    taken = Counter(map(_key, np.round(points, 9)))
    uses = np.array([taken[_key(row)] for row in np.round(candidates, 9)])
    return np.asarray(uses == uses.min())


def _key(row: Floats) -> Point:
    return tuple((row + 0.0).tolist())


def _crowded(points: Floats, taken: Counter[Point], total: int) -> list[int]:
    """Runs whose point stands twice more than another of the space."""
    standing = [count for count in taken.values() if count]
    least = min(standing) if len(standing) == total else 0
    return [i for i, row in enumerate(points) if taken[_key(row)] > least + 1]


def _exchange(points: Floats, taken: Counter[Point], a: int, b: int, j: int) -> None:
    """Exchange entry j of two rows unless points are then repeated more."""
    rows = points[[a, b]]
    rows[:, j] = rows[::-1, j].copy()
    old, new = [_key(points[a]), _key(points[b])], [_key(row) for row in rows]
    touched = {*old, *new}
    before = sum(taken[point] ** 2 for point in touched)
    taken.subtract(old)
    taken.update(new)
    if sum(taken[point] ** 2 for point in touched) <= before:
        points[[a, b]] = rows
    else:
        taken.subtract(new)
        taken.update(old)


def _moved(space: Space, points: Floats) -> Floats:
    """Move runs that repeat others to the free points nearest to them."""
    everything = np.array(list(product(*(factor.domain.allowed for factor in space))))
    place = {_key(row): index for index, row in enumerate(everything)}
    at = np.array([place[_key(row)] for row in points])
    uses, coded = np.bincount(at, minlength=len(everything)), space.encode(everything)
    for i in range(len(points)):
        least = uses.min()
        if uses[at[i]] > least + 1:
            free = np.flatnonzero(uses == least)
            near = free[((coded[free] - coded[at[i]]) ** 2).sum(axis=1).argmin()]
            uses[[at[i], near]] += [-1, 1]
            at[i] = near
    return np.asarray(everything[at])
