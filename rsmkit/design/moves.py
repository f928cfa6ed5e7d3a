"""Where a point of a flat region can go: along edges, one component against another, along Cox directions.

The coordinate exchange of Piepel, Cooley & Jones (2005), Journal of Quality Technology 37(2), 87-103, moves
one component and lets the others give way in proportion (Cox 1971, Biometrika 58(1), 155-159). Together with
the directions of the edges no point is left that cannot be reached.
"""

from __future__ import annotations

import numpy as np

from rsmkit.design.region import Region
from rsmkit.language.space import Floats

__all__ = ["cox_directions", "moves", "reach"]


def moves(region: Region, x: Floats, parts: Floats) -> Floats:
    """Places that a point of a flat region can be moved to, coded.

    Parameters
    ----------
    x : array, shape (k,)
    parts : array, shape (s,)
        How far to go along every direction, as parts of the way to the edge of the region.

    Returns
    -------
    array, shape (m, k)
        The point itself is the first.
    """
    ways = np.vstack([region.directions, -region.directions, cox_directions(region, x)])
    steps = (reach(region, x, ways)[:, None] * parts)[:, :, None] * ways[:, None, :]
    found = [x[None], (x + steps).reshape(-1, len(x))]
    for j, levels in enumerate(region.levels):
        others = np.tile(x, (len(levels), 1))
        others[:, j] = levels
        found.append(others)
    points = np.vstack(found)
    keep = region.contains(points)
    keep[0] = True
    return points[keep]


def reach(region: Region, x: Floats, ways: Floats) -> Floats:
    """How far one can go along each direction within the bounds and linear limits, shape (m,)."""
    normals, offsets = region.halfspaces
    eye = np.eye(len(x))
    rows = np.vstack([eye, -eye, normals])
    room = np.concatenate([region.highs - x, x - region.lows, offsets - normals @ x])
    speed = ways @ rows.T
    with np.errstate(divide="ignore", invalid="ignore"):
        times = np.where(speed > 1e-12, np.maximum(room, 0.0) / speed, np.inf)
    longest = times.min(axis=1)
    return np.where(np.isfinite(longest), longest, 0.0)


def cox_directions(region: Region, x: Floats) -> Floats:
    """To and from each pure component, coded, shape (m, k): the others keep their proportions."""
    found = [np.empty((0, len(x)))]
    for at in region.mixed:
        ways = np.zeros((len(at), len(x)))
        ways[:, at] = x[at].sum() * np.eye(len(at)) - x[at]
        ways = np.vstack([ways, -ways])
        lengths = np.linalg.norm(ways, axis=1)
        found.append(ways[lengths > 1e-9] / lengths[lengths > 1e-9, None])
    return np.vstack(found)
