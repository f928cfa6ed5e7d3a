"""Highest and lowest prediction of a surface among the blends between bounds."""

from __future__ import annotations

import math
from itertools import product

import numpy as np

from rsmkit.errors import RsmkitError
from rsmkit.language.space import Floats, Space
from rsmkit.surfaces.models.surface import Surface
from rsmkit.surfaces.statistics.optima.ridge import Goal

__all__ = ["best_blend"]

STARTS = 1024
"""Points spread over the region from which searches start, besides its corners."""
SEARCHES = 6
"""Local searches, from the best of them."""
PRECISION = 1e-9
"""Of the search, as a share of the range of a factor."""
ROUNDING = 1e-14
MOST_COMPONENTS = 8
MOST_CORNERS = 4_000


def best_blend(
    surface: Surface, goal: Goal = "maximize", *, within: Space | None = None
) -> tuple[Floats, float]:
    """Best point of a surface on a space whose factors keep to sums.

    Sequential quadratic programming with the exact gradient from the best of many points and the corners of
    the region, for every combination of categories. Integer and discrete factors are treated as continuous.

    Parameters
    ----------
    surface : Surface
    goal : {"maximize", "minimize"}
    within : Space, optional
        The same factors, with mixtures, and other bounds.

    Returns
    -------
    point : array, shape (k,)
        Natural units; the components add up to the total but for rounding.
    value : float

    Raises
    ------
    RsmkitError
        If the space keeps to no sums.
    """
    from scipy.optimize import Bounds, LinearConstraint, minimize
    from scipy.stats import qmc

    space = within or surface.space
    affine = space.affine
    if affine is None:
        raise RsmkitError("there is no mixture among these factors, so no blend is best")
    sign, numeric = -1.0 if goal == "maximize" else 1.0, space.numeric
    scale = np.where(numeric, affine.high - affine.low, 1.0)
    sums = LinearConstraint(affine.matrix * scale, affine.values, affine.values)
    starts = np.vstack([_corners(space), space.spread(qmc.Sobol(len(space), seed=0).random(STARTS))])
    starts = _tidy(starts, space, ROUNDING)

    def value_and_slope(z: Floats) -> tuple[float, Floats]:
        x = (z * scale)[None]
        return sign * float(surface.predict(x)[0]), sign * surface.gradient(x)[0] * scale

    best, best_value = starts[0], np.inf
    for levels in product(*(range(f.domain.categories) for f in space if not f.domain.is_numeric)):
        starts[:, ~numeric] = levels
        low, high = np.where(numeric, [affine.low, affine.high], starts[0]) / scale
        points = starts[np.argsort(sign * surface.predict(starts))[:SEARCHES]]
        found = [
            minimize(
                value_and_slope, start / scale, jac=True, method="SLSQP", bounds=Bounds(low, high),
                constraints=[sums], options={"ftol": 1e-14, "maxiter": 200},
            ).x
            for start in points
        ]  # fmt: skip
        ends = _tidy(space.clip(_tidy(np.array(found) * scale, space, PRECISION)), space, ROUNDING)
        points = np.vstack([points, ends])
        values = sign * surface.predict(points)
        if values.min() < best_value:
            best_value, best = float(values.min()), points[values.argmin()]
    return best, sign * best_value


def _tidy(points: Floats, space: Space, share: float) -> Floats:
    """Put what misses a bound by a share of the range onto it."""
    for bound in (space.lows, space.highs):
        near = np.abs(points - bound) <= share * (space.highs - space.lows)
        points = np.where(near & space.numeric, bound, points)
    return points


def _corners(space: Space) -> Floats:
    """Corners of the regions of components with other factors at each of their ends, shape (m, k).

    None where there are too many.
    """
    affine, none = space.affine, np.empty((0, len(space)))
    if affine is None or any(len(columns) > MOST_COMPONENTS for _, columns in affine.blocks):
        return none
    sets: list[tuple[list[int], Floats]] = [
        (group.columns.tolist(), group.corners) for group in affine.groups
    ]
    sets += [
        ([j], np.array([[factor.low], [factor.center], [factor.high]]))
        for j, factor in enumerate(space)
        if factor.domain.is_numeric and not affine.involved[j]
    ]
    if math.prod(len(points) for _, points in sets) > MOST_CORNERS:
        return none
    made = np.zeros((math.prod(len(points) for _, points in sets), len(space)))
    grids = np.meshgrid(*(np.arange(len(points)) for _, points in sets), indexing="ij")
    for index, (columns, points) in zip(grids, sets, strict=True):
        made[:, columns] = points[index.ravel()]
    return made
