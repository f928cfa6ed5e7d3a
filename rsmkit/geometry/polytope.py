"""Points within bounds that keep linear limits and equalities: the flat they lie in, the corners, the edges.

The double description method (Motzkin, Raiffa, Thompson & Thrall 1953; Fukuda & Prodon 1996, LNCS 1120,
91-111): a simplex around everything is cut by one limit after the other. Which corners are the ends of an
edge is told from the limits that both touch, not from coordinates, so corners where more limits meet than
must are one corner. It happens in the flat that the equalities leave, with coordinates of about one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rsmkit.errors import RsmkitError

__all__ = ["MOST_CORNERS", "Flags", "Polytope"]

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

TOUCHING = 1e-9
"""A point this near to a limit, as a part of the ranges, is on it."""
MOST_CORNERS = 5_000
CHUNK = 2**22
EXACTLY: Any = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}


@dataclass(frozen=True, eq=False)
class Polytope:
    """``lows <= x <= highs``, ``normals @ x <= offsets``, ``matrix @ x == rhs``.

    Parameters
    ----------
    lows, highs : array, shape (k,)
        Bounds; equal ones fix a coordinate.
    normals, offsets : array, shapes (m, k) and (m,)
        Linear limits.
    matrix, rhs : array, shapes (e, k) and (e,)
        Linear equalities.
    labels : sequence of str
        What to call the bounds of each coordinate, then the limits, then the equalities, in messages.
    """

    lows: Floats
    highs: Floats
    normals: Floats
    offsets: Floats
    matrix: Floats
    rhs: Floats
    labels: Sequence[str] = ()

    @property
    def k(self) -> int:
        """Number of coordinates."""
        return len(self.lows)

    @cached_property
    def scale(self) -> Floats:
        """Length that counts as one along every coordinate, shape (k,)."""
        span = self.highs - self.lows
        return np.where(span > 0.0, span, 1.0)

    @cached_property
    def limits(self) -> tuple[Floats, Floats]:
        """All inequalities, rows of length one in scaled coordinates: upper bounds, lower bounds, limits."""
        eye = np.eye(self.k)
        normals = np.vstack([eye, -eye, self.normals.reshape(-1, self.k) * self.scale])
        middle = self._middle
        offsets = np.concatenate(
            [
                (self.highs - middle) / self.scale,
                (middle - self.lows) / self.scale,
                self.offsets - self.normals.reshape(-1, self.k) @ middle,
            ]
        )
        return _unit_rows(normals, offsets)

    @cached_property
    def equalities(self) -> tuple[Floats, Floats]:
        """All equalities, rows of length one in scaled coordinates."""
        matrix = self.matrix.reshape(-1, self.k)
        middle = self._middle
        return _unit_rows(matrix * self.scale, self.rhs - matrix @ middle)

    @cached_property
    def flat(self) -> tuple[Floats, Floats, Flags]:
        """The smallest flat that holds the set: a point inside, a basis, and which limits hold with equality.

        In scaled coordinates, shapes (k,), (k, d) with orthonormal columns, and (m,). The point is the centre
        of the largest ball.

        Raises
        ------
        RsmkitError
            When there is no point at all, naming what cannot hold together.
        """
        normals, offsets = self.limits
        matrix, rhs = self.equalities
        tight = np.zeros(len(normals), bool)
        while True:
            basis = _null_space(np.vstack([matrix, normals[tight]]))
            centre, radius = self._ball(basis, tight)
            if centre is None:
                raise RsmkitError(f"no point satisfies {self._conflict()} at once")
            if radius > TOUCHING or basis.shape[1] == 0:
                return _onto(np.vstack([matrix, normals[tight]]),
                             np.concatenate([rhs, offsets[tight]]), centre), basis, tight  # fmt: skip
            found = [i for i in np.flatnonzero(~tight) if self._reach(int(i), tight) <= TOUCHING]
            if not found:
                return centre, basis, tight
            tight[found] = True

    @property
    def dimension(self) -> int:
        """Number of independent directions: 0 for a single point."""
        return int(self.flat[1].shape[1])

    @cached_property
    def _corners(self) -> tuple[Floats, Flags]:
        """Corners in scaled coordinates, shape (v, k), and the limits that each touches, shape (v, m)."""
        centre, basis, tight = self.flat
        normals, offsets = self.limits
        slack = np.maximum(offsets - normals @ centre, 0.0)
        inner = normals @ basis
        lengths = np.linalg.norm(inner, axis=1)
        used = np.roll(
            np.arange(len(normals)), -self.k
        )  # lower bounds first: of mixtures they leave a simplex
        used = used[(~tight & (lengths > TOUCHING))[used]]
        if not basis.shape[1]:
            return centre[None], np.ones((1, len(normals)), bool) & tight
        flat_normals, flat_offsets = inner[used] / lengths[used, None], slack[used] / lengths[used]
        points, touched = _cut(flat_normals, flat_offsets, np.sqrt(self.k))
        whole = np.zeros((len(points), len(normals)), bool)
        whole[:, used] = touched
        whole[:, tight] = True
        return centre + points @ basis.T, whole

    @cached_property
    def corners(self) -> Floats:
        """The corners, shape (v, k); the equalities hold to rounding."""
        scaled, touched = self._corners
        normals, offsets = self.limits
        matrix, rhs = self.equalities
        points = self._middle + self.scale * np.array(
            [
                _onto(np.vstack([normals[on], matrix]), np.concatenate([offsets[on], rhs]), point)
                for point, on in zip(scaled, touched, strict=True)
            ]
        )
        for bound in (self.lows, self.highs):
            points = np.where(np.abs(points - bound) <= 1e-14 * self.scale, bound, points)
        return _tidied(points)

    @property
    def touched(self) -> Flags:
        """Which limits each corner touches: upper bounds, lower bounds, linear limits; shape (v, 2k + m)."""
        return self._corners[1]

    @property
    def _middle(self) -> Floats:
        return 0.5 * (self.lows + self.highs)

    @cached_property
    def edges(self) -> NDArray[np.int64]:
        """The two corners of every edge, shape (n, 2)."""
        touched = self._corners[1]
        every = np.arange(len(touched))
        pairs = list(_edges(touched, every, every, self.dimension)) if self.dimension else []
        a, b = (np.concatenate(side) for side in zip(*pairs, strict=True)) if pairs else (_NONE, _NONE)
        return np.stack([a[a < b], b[a < b]], axis=1)

    def contains(self, points: Floats, tolerance: float = TOUCHING) -> Flags:
        """Whether each point, shape (n, k), is in the set, within a part of the ranges."""
        scaled = (points - self._middle) / self.scale
        normals, offsets = self.limits
        matrix, rhs = self.equalities
        inside = scaled @ normals.T <= offsets + tolerance
        held = np.abs(scaled @ matrix.T - rhs) <= tolerance
        return np.asarray(inside.all(axis=1) & held.all(axis=1), bool)

    def restored(self, points: Floats) -> Floats:
        """The nearest points (in scaled coordinates) that keep the equalities, shape (n, k)."""
        matrix, rhs = self.equalities
        if not len(matrix):
            return points
        middle = self._middle
        return np.asarray(middle + self.scale * _onto(matrix, rhs, (points - middle) / self.scale))

    def some_corners(self, count: int) -> Floats:
        """Corners that are farthest in random directions, at most so many: for sets with too many of them."""
        rng = np.random.default_rng(0)
        centre, basis, tight = self.flat
        ways = rng.normal(size=(count, basis.shape[1])) @ basis.T
        found = [self._solved(way, self.limits[0], tight) for way in ways]
        points = self._middle + self.scale * np.array([centre if x is None else x for x in found])
        _, first = np.unique(np.round(points / self.scale, 9), axis=0, return_index=True)
        return self.restored(np.clip(points[np.sort(first)], self.lows, self.highs))

    def walked(self, count: int, seed: int, steps: int) -> Floats:
        """Ends of random walks: hit and run (Smith 1984, Operations Research 32(6), 1296-1308)."""
        rng = np.random.default_rng(seed)
        centre, basis, tight = self.flat
        normals, offsets = self.limits[0][~tight], self.limits[1][~tight]
        at = np.repeat(centre[None], count, axis=0)
        for _ in range(steps):
            ways = rng.normal(size=(count, basis.shape[1])) @ basis.T
            speed, room = ways @ normals.T, np.maximum(offsets - at @ normals.T, 0.0)
            with np.errstate(divide="ignore", invalid="ignore"):
                times = room / speed
            ahead = np.where(speed > 1e-14, times, np.inf).min(axis=1)
            back = np.where(speed < -1e-14, times, -np.inf).max(axis=1)
            at = at + (back + rng.random(count) * (ahead - back))[:, None] * ways
        return self.restored(np.clip(self._middle + self.scale * at, self.lows, self.highs))

    def _ball(self, basis: Floats, tight: Flags) -> tuple[Floats | None, float]:
        """Centre and radius of the largest ball in the flat; None when there is no point."""
        normals = self.limits[0]
        lengths = np.where(tight, 0.0, np.linalg.norm(normals @ basis, axis=1))
        result = self._solved(
            np.append(np.zeros(self.k), -1.0), np.column_stack([normals, lengths]), tight, ball=True
        )
        if result is None:
            return None, 0.0
        return result[:-1], float(result[-1])

    def _reach(self, limit: int, tight: Flags) -> float:
        """How far inside a limit one can be."""
        normals, offsets = self.limits
        point = self._solved(normals[limit], normals, tight)
        return np.inf if point is None else float(offsets[limit] - normals[limit] @ point)

    def _solved(self, cost: Floats, normals: Floats, tight: Flags, *, ball: bool = False) -> Floats | None:
        """Least cost over the set by linear programming; None where it is empty."""
        from scipy.optimize import linprog

        matrix, rhs = self.equalities
        if ball:
            matrix = np.column_stack([matrix, np.zeros(len(matrix))])
        options: dict[str, Any] = {"A_eq": matrix, "b_eq": rhs} if len(matrix) else {}
        result = linprog(
            cost,
            A_ub=normals,
            b_ub=self.limits[1] + 1e-12,
            bounds=[(None, None)] * (len(cost) - ball) + [(0.0, 1.0)] * ball,
            options=EXACTLY,
            **options,
        )
        return None if result.x is None or result.status != 0 else np.asarray(result.x, float)

    def _conflict(self) -> str:
        """What cannot hold together, in words: nothing can be left out of it."""
        kept = list(range(self.k + len(self.offsets) + len(self.rhs)))
        for index in list(kept):
            without = [i for i in kept if i != index]
            if not self._feasible(without):
                kept = without
        names = list(self.labels) or [f"x{j + 1}" for j in range(self.k)]
        names += [f"limit {i + 1}" for i in range(len(self.offsets) + len(self.rhs))]
        found = [f"the bounds of {names[i]}" if i < self.k else names[i] for i in kept]
        return " and ".join(filter(None, [", ".join(found[:-1]), found[-1]])) if found else "the bounds"

    def _feasible(self, kept: list[int]) -> bool:
        bounds = [i for i in kept if i < self.k]
        lows, highs = np.full(self.k, -np.inf), np.full(self.k, np.inf)
        lows[bounds], highs[bounds] = self.lows[bounds], self.highs[bounds]
        limits = [i - self.k for i in kept if self.k <= i < self.k + len(self.offsets)]
        equal = [i - self.k - len(self.offsets) for i in kept if i >= self.k + len(self.offsets)]
        from scipy.optimize import linprog

        options: dict[str, Any] = {
            "method": "highs",
            "bounds": np.column_stack([lows, highs]),
            "options": EXACTLY,
        }
        if limits:
            options |= {"A_ub": self.normals[limits], "b_ub": self.offsets[limits]}
        if equal:
            options |= {"A_eq": self.matrix[equal], "b_eq": self.rhs[equal]}
        return bool(linprog(np.zeros(self.k), **options).status == 0)


def _unit_rows(rows: Floats, values: Floats) -> tuple[Floats, Floats]:
    lengths = np.linalg.norm(rows, axis=1)
    lengths = np.where(lengths > 0.0, lengths, 1.0)
    return rows / lengths[:, None], values / lengths


def _null_space(rows: Floats) -> Floats:
    """Orthonormal directions that no row sees, shape (k, d)."""
    _, sizes, directions = np.linalg.svd(rows, full_matrices=True)
    rank = int((sizes > 1e-10 * max(1.0, sizes.max(initial=0.0))).sum())
    return np.asarray(directions[rank:].T)


def _onto(rows: Floats, values: Floats, points: Floats) -> Floats:
    """The nearest points that satisfy ``rows @ x = values``; the last axis of `points` is x."""
    if not len(rows):
        return points
    inverse = np.linalg.pinv(rows, rcond=1e-10)
    for _ in range(2):  # the second time for the rounding of the first
        points = points - (points @ rows.T - values) @ inverse.T
    return points


def _cut(normals: Floats, offsets: Floats, reach: float) -> tuple[Floats, Flags]:
    """Corners of ``normals @ z <= offsets`` (the origin inside), and the limits each touches."""
    m, d = normals.shape
    around = np.vstack([-np.eye(d), np.ones((1, d)) / np.sqrt(d)])
    far = np.concatenate([np.full(d, 2.0 * reach), [2.0 * reach * np.sqrt(d)]])
    rows, values = np.vstack([normals, around]), np.concatenate([offsets, far])
    points = np.array(
        [np.linalg.solve(np.delete(around, i, axis=0), np.delete(far, i)) for i in range(d + 1)]
    )
    touched = np.zeros((d + 1, m + d + 1), bool)
    touched[:, m:] = ~np.eye(d + 1, dtype=bool)
    for limit in range(m):
        slack = values[limit] - points @ rows[limit]
        outside, inside = slack < -TOUCHING, slack > TOUCHING
        touched[:, limit] = ~(outside | inside)
        if not outside.any():
            continue
        ends = list(_edges(touched, np.flatnonzero(inside), np.flatnonzero(outside), d))
        a, b = (np.concatenate(side) for side in zip(*ends, strict=True)) if ends else (_NONE, _NONE)
        share = (slack[a] / (slack[a] - slack[b]))[:, None]
        new, on = points[a] + share * (points[b] - points[a]), touched[a] & touched[b]
        on[:, limit] = True
        points = np.vstack([points[~outside], _refined(new, on, rows, values)])
        touched = np.vstack([touched[~outside], on])
        if len(points) > MOST_CORNERS:
            raise RsmkitError(
                f"the bounds and limits leave more than {MOST_CORNERS} corners: too many to list"
            )
    slack = values[:m] - points @ rows[:m].T
    touched = np.abs(slack) <= TOUCHING
    _, first = np.unique(touched, axis=0, return_index=True)
    return points[np.sort(first)], touched[np.sort(first)]


_NONE = np.empty(0, np.int64)


def _edges(
    touched: Flags, inside: NDArray[np.int64], outside: NDArray[np.int64], d: int
) -> Iterator[tuple[NDArray[np.int64], NDArray[np.int64]]]:
    """Pairs of corners that are the ends of an edge: no third corner touches all that both touch."""
    marks = touched.astype(np.float32)
    step = max(1, CHUNK // max(1, len(outside)))
    for start in range(0, len(inside), step):
        part = inside[start : start + step]
        common = marks[part] @ marks[outside].T
        i, j = np.nonzero(common > d - 1.5)
        a, b = part[i], outside[j]
        size = max(1, CHUNK // len(touched))
        for begin in range(0, len(a), size):
            pair = slice(begin, begin + size)
            both = marks[a[pair]] * marks[b[pair]]
            holders = (both @ marks.T > both.sum(axis=1, keepdims=True) - 0.5).sum(axis=1)
            yield a[pair][holders == 2], b[pair][holders == 2]


def _refined(points: Floats, touched: Flags, rows: Floats, values: Floats) -> Floats:
    """The same corners with the rounding of the cuts before taken out."""
    return np.array(
        [_onto(rows[on], values[on], point) for point, on in zip(points, touched, strict=True)]
    ).reshape(points.shape)


def _tidied(points: Floats) -> Floats:
    """With 0.3 for 0.30000000000000004: what differs from a number of few digits by rounding only is that."""
    largest = max(1e-300, float(np.abs(points).max(initial=0.0)))
    short = np.round(points, 12 - math.ceil(math.log10(largest)))
    return np.asarray(np.where(np.abs(short - points) <= 4e-16 * largest, short, points) + 0.0)
