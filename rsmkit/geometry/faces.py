"""The faces of a polytope, each as the set of its corners, and their centroids.

McLean & Anderson (1966), Technometrics 8(3), 447-454, and Piepel (1988), Journal of Quality Technology 20(2),
125-139: the centroid of a face is the mean of its corners.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from rsmkit.errors import RsmkitError
from rsmkit.geometry.polytope import Flags, Polytope

__all__ = ["MOST_FACES", "centroids", "different_directions", "edges", "faces", "subfaces"]

Floats = NDArray[np.float64]
Corners = int
"""A set of corners: bit i stands for corner i."""

MOST_FACES = 50_000


def faces(polytope: Polytope) -> list[list[Corners]]:
    """The faces of every dimension, corners first, the whole set last."""
    whole, facets = _whole(polytope.touched)
    found: list[list[Corners]] = [[whole]]
    for _ in range(polytope.dimension):
        below = dict.fromkeys(face for above in found[-1] for face in subfaces(above, facets))
        if len(below) > MOST_FACES:
            raise RsmkitError(f"the bounds and limits leave more than {MOST_FACES} faces: too many to list")
        found.append(sorted(below))
    return found[::-1]


def subfaces(face: Corners, facets: Iterable[Corners]) -> list[Corners]:
    """The faces of one dimension less in a face, given those that have one less than the whole."""
    parts = sorted({face & facet for facet in facets} - {face, 0}, key=int.bit_count, reverse=True)
    largest: list[Corners] = []
    for part in parts:
        if not any(part & other == part for other in largest):
            largest.append(part)
    return largest


def _whole(touched: Flags) -> tuple[Corners, list[Corners]]:
    """All corners, and the set that each limit touches; the largest of these are the facets."""
    columns = {sum(1 << int(i) for i in np.flatnonzero(column)) for column in touched.T}
    whole = (1 << len(touched)) - 1
    return whole, sorted(columns - {whole, 0})


def members(face: Corners, count: int) -> NDArray[np.bool_]:
    """The corners of a face as a mask, shape (count,)."""
    return np.array([face >> i & 1 for i in range(count)], bool)


def centroids(polytope: Polytope, dimension: int) -> Floats:
    """Mean of the corners of every face of that dimension, shape (n, k)."""
    corners = polytope.corners
    if not 0 <= dimension <= polytope.dimension:
        return np.empty((0, polytope.k))
    if dimension == polytope.dimension:
        return np.asarray(corners.mean(axis=0, keepdims=True))
    if dimension == 1:
        return np.asarray(corners[polytope.edges].mean(axis=1))
    inside = np.array([members(face, len(corners)) for face in faces(polytope)[dimension]], float)
    return np.asarray(inside @ corners / inside.sum(axis=1, keepdims=True))


def edges(polytope: Polytope) -> Floats:
    """Different directions of the edges, of length one in scaled coordinates, shape (n, k)."""
    corners = polytope.corners
    along = corners[polytope.edges[:, 1]] - corners[polytope.edges[:, 0]]
    return different_directions(along / polytope.scale) * polytope.scale


def different_directions(along: Floats) -> Floats:
    """Directions of length one, each once, whichever way they point; shape (n, k)."""
    along = along / np.linalg.norm(along, axis=1, keepdims=True)
    largest = along[np.arange(len(along)), np.abs(np.round(along, 9)).argmax(axis=1)]
    along = along * np.sign(largest)[:, None]
    _, index = np.unique(np.round(along, 9) + 0.0, axis=0, return_index=True)
    return np.asarray(along[np.sort(index)])
