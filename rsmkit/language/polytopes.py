"""Points spread evenly over a bounded polytope, from numbers spread evenly over the unit cube.

A polytope of few dimensions is cut into simplices around a point inside; equal shares of the unit interval
choose a simplex by its volume, the other numbers a place in it. That is exact and keeps the even spread of a
Sobol sequence. In many dimensions there are too many simplices: random walks take their place.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from rsmkit.language.domains import Floats

__all__ = ["Polytope"]

MOST_CUT = 6
"""Dimensions up to which a polytope is cut into simplices."""
STEPS = 20
"""Steps of a random walk per dimension."""


class Polytope:
    """The points ``inner + z @ directions`` with ``low <= point <= high``.

    Parameters
    ----------
    inner : array, shape (q,)
        A point strictly between the bounds.
    directions : array, shape (d, q)
        Orthonormal rows.
    low, high : array, shape (q,)
    """

    def __init__(self, inner: Floats, directions: Floats, low: Floats, high: Floats) -> None:
        self.inner, self.directions, self.low, self.high = inner, directions, low, high

    @cached_property
    def corners(self) -> Floats:
        """Extreme points, shape (c, q), in a fixed order."""
        return np.asarray(self.inner + self._corners @ self.directions)

    @cached_property
    def _corners(self) -> Floats:
        """Extreme points in the coordinates of the directions, shape (c, d)."""
        from scipy.spatial import HalfspaceIntersection

        normals = np.vstack([self.directions.T, -self.directions.T])
        room = np.concatenate([self.high - self.inner, self.inner - self.low])
        real = np.linalg.norm(normals, axis=1) > 1e-12
        normals, room = normals[real], room[real]
        if len(self.directions) == 1:
            ends = room / normals[:, 0]
            return np.array([[ends[normals[:, 0] < 0].max()], [ends[normals[:, 0] > 0].min()]])
        found = HalfspaceIntersection(np.column_stack([normals, -room]), np.zeros(normals.shape[1]))
        points = found.intersections[np.isfinite(found.intersections).all(axis=1)]
        size = np.abs(points).max()
        _, first = np.unique(np.round(points / size, 9), axis=0, return_index=True)
        return np.asarray(points[first])

    @cached_property
    def _simplices(self) -> tuple[Floats, Floats]:
        """Corners of simplices that fill it, shape (s, d + 1, d), and their shares summed up, shape (s,)."""
        corners, d = self._corners, len(self.directions)
        if d == 1:
            return corners[None], np.ones(1)
        from scipy.spatial import ConvexHull

        faces = np.sort(ConvexHull(corners).simplices, axis=1)
        faces = faces[np.lexsort(faces.T[::-1])]
        middle = np.repeat(corners.mean(axis=0)[None, None], len(faces), axis=0)
        made = np.concatenate([middle, corners[faces]], axis=1)
        volumes = np.abs(np.linalg.det(made[:, 1:] - made[:, :1]))
        return made, np.cumsum(volumes) / volumes.sum()

    def spread(self, unit: Floats) -> Floats:
        """Even numbers from 0 to 1, shape (n, d or more), to even points, shape (n, q)."""
        d = len(self.directions)
        if d > MOST_CUT:
            return self._walked(unit)
        simplices, shares = self._simplices
        u = np.clip(unit[:, :d], 0.0, 1.0)
        chosen = np.minimum(np.searchsorted(shares, u[:, 0], side="right"), len(shares) - 1)
        before = np.concatenate([[0.0], shares])[chosen]
        first = np.clip((u[:, 0] - before) / np.maximum(shares[chosen] - before, 1e-300), 0.0, 1.0)
        cuts = np.sort(np.column_stack([first, u[:, 1:]]), axis=1)
        weights = np.diff(cuts, axis=1, prepend=0.0, append=1.0)
        place = np.einsum("nc,ncd->nd", weights, simplices[chosen])
        return np.asarray(self.inner + place @ self.directions)

    def _walked(self, unit: Floats) -> Floats:
        """Ends of random walks from the inner point, one per row of `unit` (hit and run).

        Smith (1984), Operations Research 32, 1296-1308. Numbers of `unit` seed all walks together.
        """
        d = len(self.directions)
        seed = [int(part) for part in np.floor(unit[0] * 2.0**32)] if len(unit) else [0]
        rng = np.random.default_rng(seed)
        at = np.repeat(self.inner[None], len(unit), axis=0)
        for _ in range(STEPS * d):
            ways = rng.standard_normal((len(unit), d)) @ self.directions
            with np.errstate(divide="ignore", invalid="ignore"):
                ends = np.stack([(self.low - at) / ways, (self.high - at) / ways])
            near = np.nan_to_num(ends.min(axis=0), nan=-np.inf, neginf=-np.inf).max(axis=1)
            far = np.nan_to_num(ends.max(axis=0), nan=np.inf, posinf=np.inf).min(axis=1)
            at = at + (near + rng.random(len(unit)) * (far - near))[:, None] * ways
        return np.asarray(np.clip(at, self.low, self.high))
