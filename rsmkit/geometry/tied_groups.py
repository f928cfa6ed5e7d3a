"""Factors that limits and equalities tie together, group by group: a region is the product of the groups.

Each group is a polytope of its own, so corners and volumes are those of few coordinates.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rsmkit.errors import RsmkitError
from rsmkit.geometry.faces import centroids, different_directions, edges
from rsmkit.geometry.polytope import Polytope
from rsmkit.geometry.simplices import Simplices, simplices

__all__ = ["Group", "groups_of"]

Floats = NDArray[np.float64]

WALK = 20
"""Steps of a random walk per dimension."""
MOST_CORNERS_FOR_FACES = 200
"""Of sets with more corners no faces are listed."""


@dataclass(frozen=True, eq=False)
class Group:
    """Coordinates tied together, and where they may lie.

    Parameters
    ----------
    columns : array of int
        The coordinates.
    polytope : Polytope
        In these coordinates.
    """

    columns: NDArray[np.int64]
    polytope: Polytope

    @cached_property
    def simplices(self) -> Simplices | None:
        """The set cut into simplices; None where there are too many."""
        try:
            return simplices(self.polytope)
        except RsmkitError:
            return None

    @cached_property
    def corners(self) -> Floats:
        """The corners, or where there are too many some of them."""
        try:
            return self.polytope.corners
        except RsmkitError:
            return self.polytope.some_corners(200)

    def nodes(self, dimensions: Sequence[int]) -> Floats:
        """Centroids of the faces of these dimensions (0: corners) and of the whole, each once."""
        found = [self.corners]
        if len(found[0]) <= MOST_CORNERS_FOR_FACES:
            found += [centroids(self.polytope, d) for d in dimensions if 0 < d < self.polytope.dimension]
        if self.polytope.dimension:
            found.append(self.corners.mean(axis=0, keepdims=True))
        return np.vstack(found)

    @cached_property
    def directions(self) -> Floats:
        """Directions along which one can go far: edges, one coordinate against another, shape (n, q)."""
        polytope, q = self.polytope, self.polytope.k
        try:
            found = [edges(polytope)]
        except RsmkitError:
            found = []
        pairs = [np.eye(q)[a] - np.eye(q)[b] for a in range(q) for b in range(a)]
        found += [np.array(pairs).reshape(-1, q), np.eye(q)]
        along = np.vstack(found)
        kept = np.abs(along @ polytope.matrix.reshape(-1, q).T).max(axis=1, initial=0.0) <= 1e-9
        return different_directions(along[kept]) if kept.any() else np.empty((0, q))

    def points(self, unit: Floats, seed: int) -> Floats:
        """Points spread evenly, shape (n, q), from even numbers of the unit cube, shape (n, q)."""
        if self.simplices is None:
            return self.polytope.walked(len(unit), seed, WALK * self.polytope.dimension)
        return self.polytope.restored(self.simplices.points(unit))

    def means(self, powers: NDArray[np.int64]) -> Floats | None:
        """Averages of products of powers, shape (m,); None where they cannot be worked out."""
        return None if self.simplices is None else self.simplices.means(powers)


def groups_of(whole: Polytope, columns: NDArray[np.int64]) -> tuple[Group, ...]:
    """Part the coordinates in question into groups that share no limit and no equality.

    Limits and equalities with a coordinate that is not in question must be left out before.
    """
    ties = np.vstack([whole.normals.reshape(-1, whole.k), whole.matrix.reshape(-1, whole.k)]) != 0.0
    groups: list[set[int]] = [{int(j)} for j in columns]
    for tie in ties:
        members = {int(j) for j in np.flatnonzero(tie)}
        joined = set().union(*(group for group in groups if group & members))
        groups = [group for group in groups if not group & members] + ([joined] if joined else [])
    made = []
    for chosen in sorted(groups, key=min):
        at = np.array(sorted(chosen), np.int64)
        limits = (whole.normals.reshape(-1, whole.k)[:, at] != 0.0).any(axis=1)
        equal = (whole.matrix.reshape(-1, whole.k)[:, at] != 0.0).any(axis=1)
        names = list(whole.labels) or [f"x{j + 1}" for j in range(whole.k)]
        last = whole.k + len(whole.offsets)
        kept = [*at, *(whole.k + np.flatnonzero(limits)), *(last + np.flatnonzero(equal))]
        made.append(
            Group(
                at,
                replace(
                    whole,
                    lows=whole.lows[at],
                    highs=whole.highs[at],
                    normals=whole.normals.reshape(-1, whole.k)[np.ix_(limits, at)],
                    offsets=whole.offsets[limits],
                    matrix=whole.matrix.reshape(-1, whole.k)[np.ix_(equal, at)],
                    rhs=whole.rhs[equal],
                    labels=[names[j] for j in kept if j < len(names)],
                ),
            )
        )
    return tuple(made)
