"""Blends: points of one mixture, as shares of its corners or as centroids of its faces."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from rsmkit.errors import RsmkitError
from rsmkit.geometry.faces import centroids
from rsmkit.geometry.tied_groups import Group
from rsmkit.language.space import Floats

__all__ = ["Blend", "axial_shares", "centroid_shares", "face_blends", "lattice_shares", "of_corners"]

Blend = tuple[str, Floats]
"""What it is, and its coordinates."""

MOST = 100_000


def lattice_shares(q: int, degree: int) -> list[Blend]:
    """Shares that are multiples of ``1 / degree``: Scheffe's {q, m} lattice, pure components first."""

    def parts(left: int, places: int) -> Iterator[tuple[int, ...]]:
        if places == 1:
            yield (left,)
            return
        for first in range(left, -1, -1):
            for rest in parts(left - first, places - 1):
                yield (first, *rest)

    rows = sorted(parts(degree, q), key=lambda row: (sum(x > 0 for x in row), [-x for x in row]))
    return [("vertex" if max(row) == degree else "lattice", np.array(row) / degree) for row in rows]


def centroid_shares(q: int, most: int) -> list[Blend]:
    """Equal shares of one component, of two, ..., of so many at most: Scheffe's simplex-centroid design."""
    words = {1: "vertex", 2: "edge", q: "centroid"}
    return [
        (words.get(size, "face"), np.isin(np.arange(q), chosen) / size)
        for size in range(1, most + 1)
        for chosen in combinations(range(q), size)
    ]


def axial_shares(q: int, centroid: bool) -> list[Blend]:
    """Check blends half-way from the centroid to the corners, and the centroid where it is asked for."""
    middle = np.full(q, 1.0 / q)
    found = [("centroid", middle)] if centroid else []
    return found + [("axial", 0.5 * (middle + corner)) for corner in np.eye(q)]


def of_corners(group: Group, shares: list[Blend], names: list[str], word: str) -> list[Blend]:
    """Shares of the corners of a simplex as points of it.

    Raises
    ------
    RsmkitError
        When bounds have made something else of the simplex.
    """
    corners = group.corners[np.lexsort(-group.corners.T[::-1])]
    q = group.polytope.dimension + 1
    if len(corners) != q:
        raise RsmkitError(
            f"design.kind: '{word}' is for a simplex, and the bounds of {', '.join(names)} leave a region "
            f"with {len(corners)} corners in {q - 1} dimensions; take kind = 'extreme-vertices' or 'optimal'"
        )
    return [(kind, share @ corners) for kind, share in shares]


def face_blends(group: Group, highest: int, centroid: bool) -> list[Blend]:
    """Corners, then centroids of faces of 1, 2, ..., `highest` dimensions, then that of all corners."""
    dimension, corners = group.polytope.dimension, group.polytope.corners
    found = [("vertex", corner) for corner in corners[np.lexsort(-corners.T[::-1])]]
    for d in range(1, min(highest, dimension - 1) + 1):
        found += [("edge" if d == 1 else "face", point) for point in centroids(group.polytope, d)]
    if centroid and dimension > 0:
        found.append(("centroid", corners.mean(axis=0)))
    return found
