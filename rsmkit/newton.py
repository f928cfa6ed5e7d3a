"""The last digits of a minimum: Newton's method on differences, with the bounds and constraints it lies on.

A descent ends where rounding hides the slope of what it descends, about 1e-8 of a range away from the
minimum, and two processors round differently. The place where the slopes vanish is known to some 1e-12:
differences of fourth order over a step h leave a rounding error of 1e-16 / h in them.
Nocedal & Wright, *Numerical Optimization* (2006), chapter 18 (null-space method).
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

__all__ = ["Expansion", "Minimum", "Slopes", "descended", "expand", "minimum_nearby", "slopes_changed"]

Floats = NDArray[np.float64]
Slopes = Callable[[Floats], tuple[float, Floats]]
"""A point, shape (k,), to what is minimised and its slopes, shape (k,)."""
Quantities = Callable[[Floats], Floats]
"""Points, shape (n, k), to what is minimised and margins that stay >= 0, shape (n, 1 + c)."""

MOST = 8
"""Newton steps; three are usual."""
ENOUGH = 1e-9
"""A step this small, in lengths of the differences' unit, leaves nothing but rounding to gain."""
LONGEST = 0.02
"""Whoever starts farther away than this has not found the minimum."""
ACTIVE = 1e-6
"""A margin this small may be one the minimum lies on."""
FLAT = 1e-8
"""Curvature, as a part of the largest, along which the minimum is not determined; no slope may be larger."""

LONGEST_DESCENT = 30
"""Steps of a descent that begins next to its end, ten times the usual."""
SAME = 1e-12
"""Rise of a function, as a part of it, that is rounding."""
HALVES = 6
"""How often a step that rises is halved."""


class Expansion(NamedTuple):
    """Quantities at a point, shape (q,), their slopes, (q, k), and curvatures, (q, k, k)."""

    values: Floats
    slopes: Floats
    curvatures: Floats


class Minimum(NamedTuple):
    """A minimum.

    Parameters
    ----------
    point : array, shape (k,)
    free : array of bool, shape (k,)
        Which coordinates do not lie on a bound.
    active : array of int, shape (w,)
        Margins that are zero there.
    slopes : array, shape (w, free coordinates)
        Of these margins.
    """

    point: Floats
    free: NDArray[np.bool_]
    active: NDArray[np.intp]
    slopes: Floats


def expand(quantities: Quantities, at: Floats, steps: Floats) -> Expansion:
    """Values and derivatives by differences, all points in one batch.

    Slopes and pure curvatures are of fourth order in `steps`, shape (k,), mixed curvatures of second.
    """
    count, axes = len(at), np.diag(steps)
    pairs = list(combinations(range(count), 2))
    both = np.array([axes[i] + axes[j] for i, j in pairs]).reshape(-1, count)
    offsets = np.vstack([np.zeros((1, count)), axes, -axes, 2.0 * axes, -2.0 * axes, both, -both])
    found = quantities(at + offsets)
    here, around = found[0], found[1 : 4 * count + 1]
    ahead, behind, beyond, before = np.split(around, 4)
    slopes = (8.0 * (ahead - behind) - (beyond - before)) / (12.0 * steps[:, None])
    pure = (16.0 * (ahead + behind) - (beyond + before) - 30.0 * here) / (12.0 * steps[:, None] ** 2)
    curvatures = np.zeros((found.shape[1], count, count))
    curvatures[:, range(count), range(count)] = pure.T
    sums = np.split(found[4 * count + 1 :], 2)
    for (i, j), plus, minus in zip(pairs, *sums, strict=True):
        mixed = plus + minus - ahead[i] - behind[i] - ahead[j] - behind[j] + 2.0 * here
        curvatures[:, i, j] = curvatures[:, j, i] = mixed / (2.0 * steps[i] * steps[j])
    return Expansion(here, slopes.T, curvatures)


def minimum_nearby(
    quantities: Quantities, start: Floats, low: Floats | float, high: Floats | float, step: float
) -> Minimum | None:
    """Find the minimum next to a point that a descent has found.

    Parameters
    ----------
    quantities : callable
        Smooth; the first is minimised, the others stay >= 0.
    start : array, shape (k,)
        Coordinates of order one; those on a bound stay there.
    low, high : array, shape (k,), or float
        Bounds; differences stay within them.
    step : float
        Of the differences.

    Returns
    -------
    Minimum or None
        None when there is no minimum nearby. In directions without curvature `start` decides.
    """
    at = np.array(start, float)
    active = np.empty(0, np.intp)
    for _ in range(MOST):
        room = np.minimum(at - low, high - at)
        free = room > 0.0
        if not free.any():
            return Minimum(at, free, np.empty(0, np.intp), np.empty((0, 0)))

        def of_free(values: Floats, at: Floats = at, free: NDArray[np.bool_] = free) -> Floats:
            whole = np.repeat(at[None], len(values), axis=0)
            whole[:, free] = values
            return quantities(whole)

        here = expand(of_free, at[free], np.minimum(step, 0.5 * room[free]))
        active, multipliers = _active(here, active)
        move = _newton_step(here, active, multipliers)
        if move is None or not np.abs(move).max() <= LONGEST:
            return None
        at[free] += move
        at = np.clip(at, low, high)
        if np.abs(move).max() <= ENOUGH:
            return Minimum(at, free, active, here.slopes[1 + active])
    return None


def _active(here: Expansion, before: NDArray[np.intp]) -> tuple[NDArray[np.intp], Floats]:
    """Margins that hold the minimum back, and their multipliers (positive).

    Of those that did `before` the last step, along a straight line, may have left a curved one.
    """
    close = here.values[1:] <= ACTIVE
    close[before] = True
    near = np.flatnonzero(close)
    if not len(near) or not np.isfinite(here.slopes).all():
        return near[:0], np.empty(0)
    near = near[_first_of_their_kind(here.slopes[1 + near])]
    try:
        multipliers = nnls(here.slopes[1 + near].T, here.slopes[0])[0]
    except RuntimeError:  # too many iterations
        return near[:0], np.empty(0)
    return near[multipliers > 0.0], multipliers[multipliers > 0.0]


def _first_of_their_kind(normals: Floats) -> NDArray[np.bool_]:
    """Which normals no earlier one points along: of equal margins rounding would choose, or take both."""
    lengths = np.linalg.norm(normals, axis=1)
    units = normals / np.where(lengths > 0.0, lengths, 1.0)[:, None]
    return np.asarray(~np.triu(units @ units.T > 1.0 - FLAT, 1).any(axis=0))


def _newton_step(here: Expansion, active: NDArray[np.intp], multipliers: Floats) -> Floats | None:
    """Step onto the active margins, and to the minimum of the Lagrangian's parabola along them."""
    hessian = here.curvatures[0] - np.tensordot(multipliers, here.curvatures[1 + active], axes=1)
    if not (np.isfinite(hessian).all() and np.isfinite(here.slopes).all()):
        return None
    normals = here.slopes[1 + active]
    if len(normals) and np.linalg.matrix_rank(normals, FLAT * np.abs(normals).max()) < len(normals):
        return None
    onto: Floats = -np.linalg.pinv(normals) @ here.values[1 + active]
    along = np.linalg.svd(normals)[2][len(normals) :].T if len(normals) else np.eye(len(onto))
    curvatures, axes = np.linalg.eigh(along.T @ hessian @ along)
    if not len(curvatures):
        return onto
    largest = np.abs(curvatures).max()
    if curvatures.min() < -FLAT * largest:
        return None
    rise = axes.T @ (along.T @ (here.slopes[0] + hessian @ onto))
    curved = curvatures > FLAT * largest
    if (np.abs(rise[~curved]) > FLAT * largest).any():
        return None
    rest = np.where(curved, -rise / np.where(curved, curvatures, 1.0), 0.0)
    step: Floats = onto + along @ (axes @ rest)
    return step


def slopes_changed(function: Slopes, at: Floats, low: Floats, high: Floats, step: float) -> Floats:
    """Curvatures by differences of slopes at two points per coordinate, within bounds, shape (k, k)."""
    found = np.empty((len(at), len(at)))
    for j in range(len(at)):
        ends = []
        for sign in (1.0, -1.0):
            there = at.copy()
            there[j] = np.clip(at[j] + sign * step, low[j], high[j])
            ends.append((there[j], function(there)[1]))
        (after, ahead), (before, behind) = ends
        found[j] = (ahead - behind) / (after - before)
    return np.asarray(0.5 * (found + found.T))


def descended(
    function: Slopes, start: Floats, curvatures: Floats, low: Floats, high: Floats, enough: float
) -> Floats | None:
    """Descend to a minimum that is near, of a function whose curvatures are about known.

    The step of Newton's method within bounds, with curvatures that learn from the slopes on the way (BFGS;
    Nocedal & Wright 2006, section 6.1): a few steps where a descent that knows nothing needs dozens.

    Parameters
    ----------
    function : callable
        A point to its value and slopes.
    start : array, shape (k,)
    curvatures : array, shape (k, k)
    low, high : array, shape (k,)
    enough : float
        The first step of which no part is longer is the last.

    Returns
    -------
    array, shape (k,), or None
        None where the function does not bend upwards or the steps do not come to an end.
    """
    at, bend = np.clip(start, low, high), curvatures.copy()
    value, slopes = function(at)
    for _ in range(LONGEST_DESCENT):
        free = ~((at <= low) & (slopes > 0.0) | (at >= high) & (slopes < 0.0))
        if not free.any():
            return at
        if not (np.isfinite(slopes).all() and np.isfinite(bend).all()):
            return None
        try:
            half = np.linalg.cholesky(bend[np.ix_(free, free)])
        except np.linalg.LinAlgError:
            return None
        step = np.zeros_like(at)
        step[free] = -np.linalg.solve(half.T, np.linalg.solve(half, slopes[free]))
        move = np.clip(at + step, low, high) - at
        if np.abs(move).max() <= enough:
            return np.asarray(at + move)
        for _ in range(HALVES):
            reached, ahead = function(at + move)
            if reached <= value + SAME * (1.0 + abs(value)):
                break
            move *= 0.5
        else:
            return None
        change, along = ahead - slopes, bend @ move
        if move @ change > 0.0:
            bend += np.outer(change, change) / (move @ change) - np.outer(along, along) / (move @ along)
        at, value, slopes = at + move, reached, ahead
    return None
