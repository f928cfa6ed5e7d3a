"""A polytope cut into simplices: volume, points spread evenly, exact averages of polynomials.

The simplices are those of pulling a corner: it and a simplex of a facet away from it, facet after facet.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray

from rsmkit.errors import RsmkitError
from rsmkit.geometry.faces import subfaces
from rsmkit.geometry.polytope import Polytope

__all__ = ["MOST_SIMPLICES", "Simplices", "simplices"]

Floats = NDArray[np.float64]

MOST_SIMPLICES = 200_000
CHUNK = 2**20


@dataclass(frozen=True, eq=False)
class Simplices:
    """Simplices that fill a set and overlap nowhere.

    Parameters
    ----------
    corners : array, shape (v, k)
    index : array of int, shape (s, d + 1)
        The corners of each.
    volumes : array, shape (s,)
        Their shares of the whole; they add up to one.
    """

    corners: Floats
    index: NDArray[np.int64]
    volumes: Floats

    def points(self, unit: Floats) -> Floats:
        """Numbers of the unit cube, shape (n, d or more), to points of the set, (n, k): evenly to evenly.

        The first says which simplex and how far into its share; they all, sorted, are barycentric coordinates
        (the spacings of uniform numbers are uniform on a simplex).
        """
        d = self.index.shape[1] - 1
        if d == 0:
            return np.repeat(self.corners[self.index[0]], len(unit), axis=0)
        ends = np.cumsum(self.volumes)
        which = np.minimum(np.searchsorted(ends, unit[:, 0] * ends[-1], side="right"), len(ends) - 1)
        start = ends[which] - self.volumes[which]
        inside = unit[:, :d].copy()
        share = np.where(self.volumes[which] > 0.0, self.volumes[which], 1.0)
        inside[:, 0] = np.clip((unit[:, 0] * ends[-1] - start) / share, 0.0, 1.0)
        shares = np.diff(np.sort(inside, axis=1), axis=1, prepend=0.0, append=1.0)
        return np.asarray(np.einsum("ni,nik->nk", shares, self.corners[self.index[which]]))

    def means(self, powers: NDArray[np.int64]) -> Floats:
        """Average of ``prod x_j^powers_j`` over the set, exact; powers of shape (m, k), result (m,).

        The rules of Grundmann & Moeller (1978), SIAM Journal on Numerical Analysis 15(2), 282-290.
        """
        degree = int(powers.sum(axis=1).max(initial=0))
        shares, weights = _rule(self.index.shape[1] - 1, degree)
        total = np.zeros(len(powers))
        step = max(1, CHUNK // (len(weights) * self.corners.shape[1]))
        for start in range(0, len(self.index), step):
            part = slice(start, start + step)
            nodes = np.einsum("ri,sik->srk", shares, self.corners[self.index[part]])
            values = np.ones((len(powers), *nodes.shape[:2]))
            for j in range(powers.shape[1]):
                for power in range(1, int(powers[:, j].max(initial=0)) + 1):
                    values[powers[:, j] >= power] *= nodes[:, :, j]
            total += (values @ weights) @ self.volumes[part]
        return total


def simplices(polytope: Polytope) -> Simplices:
    """Cut a polytope into simplices.

    Raises
    ------
    RsmkitError
        When there are too many.
    """
    d, corners = polytope.dimension, polytope.corners
    columns = {sum(1 << int(i) for i in np.flatnonzero(column)) for column in polytope.touched.T}
    whole = (1 << len(corners)) - 1
    facets = sorted(columns - {whole, 0})
    known: dict[int, list[tuple[int, ...]]] = {}

    def cut(face: int, dimension: int) -> list[tuple[int, ...]]:
        lowest = (face & -face).bit_length() - 1
        if dimension == 0:
            return [(lowest,)]
        if face not in known:
            away = [part for part in subfaces(face, facets) if not part >> lowest & 1]
            known[face] = [(lowest, *rest) for part in away for rest in cut(part, dimension - 1)]
            if len(known[face]) > MOST_SIMPLICES:
                raise RsmkitError(f"the region falls into more than {MOST_SIMPLICES} simplices")
        return known[face]

    index = np.array(cut(whole, d), np.int64)
    if d == 0:
        return Simplices(corners, index, np.ones(1))
    inner = (corners / polytope.scale) @ polytope.flat[1]
    sides = inner[index[:, 1:]] - inner[index[:, :1]]
    volumes = np.abs(np.linalg.det(sides))
    return Simplices(corners, index, volumes / volumes.sum())


def _rule(d: int, degree: int) -> tuple[Floats, Floats]:
    """Barycentric coordinates and weights of a rule that is exact to a degree, shapes (r, d + 1) and (r,)."""
    s = max(0, math.ceil((degree - 1) / 2))
    shares, weights = [], []
    for i in range(s + 1):
        size = d + 2 * s + 1 - 2 * i
        weight = (-1) ** i * 2.0 ** (-2 * s) * size ** (2 * s + 1) * math.factorial(d)
        weight /= math.factorial(i) * math.factorial(d + 2 * s + 1 - i)
        for chosen in combinations_with_replacement(range(d + 1), s - i):
            counts = np.bincount(np.array(chosen, int), minlength=d + 1)
            shares.append((2 * counts + 1) / size)
            weights.append(weight)
    return np.array(shares), np.array(weights)
