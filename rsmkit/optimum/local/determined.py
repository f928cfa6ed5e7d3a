"""The same optimum on every processor: the last digits by Newton's method, then a grid.

A search ends within rounding of the optimum, and which rounding that is depends on the processor. Here the
optimum is found anew to some 1e-12 of a range and put on a grid far coarser than that and far finer than
anything that is printed or set. Evaluations must be free: this is for surfaces.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rsmkit.language.space import Floats
from rsmkit.newton import Minimum, minimum_nearby
from rsmkit.optimum.local.local_search import Local, LocalSearch
from rsmkit.optimum.problem import FEASIBLE, Archive, Evaluation

__all__ = ["WORSE", "centred", "determined"]

STEP = 1e-3
"""Of the differences, as a fraction of a range: their rounding error is then 1e-13 of the objective."""
DIGITS = 8
"""Decimals of a range that are kept where the objective is flat: half of the last costs 1e-17 of it."""
FINE_DIGITS = (13, 14)
"""Decimals kept where constraints decide and the objective is steep: the first that cost nothing."""
WORSE = 1e-12
"""Part of the objective, or of its spread over the box, that counts as nothing."""


def determined(archive: Archive, best: Evaluation) -> Evaluation:
    """Replace the best point (one row) by the same to all digits that are determined.

    Coordinates on a bound stay there, levels stay as they are, the others are multiples of 1e-8 of the range.
    As many as there are active constraints are determined by these, on the allowed side, and multiples of
    1e-13. Where the objective has an edge, or no minimum nearby, the point stays as it is.
    """
    local = Local(archive, best.points[0], LocalSearch())
    if not len(local.begin) or archive.violation(best)[0] > 0:
        return best
    found = minimum_nearby(local.quantities, local.begin, 0.0, 1.0, STEP)
    if found is None:
        return best
    for unit in _on_grid(local, found):
        tried = archive.evaluate(local.natural(unit[None]))
        if _as_good(archive, tried, best)[0]:
            return tried
    return best


def _on_grid(local: Local, found: Minimum) -> list[Floats]:
    """Free unit coordinates near the minimum, shape (f,), the best first: on the grid as far as possible."""
    unit = np.round(found.point, DIGITS)
    if not len(found.active):
        return [unit]
    columns = _dependent(found.slopes)
    dependent, slopes = np.flatnonzero(found.free)[columns], found.slopes[:, columns]
    unit[dependent] = found.point[dependent]
    for _ in range(5):
        unit[dependent] -= np.linalg.solve(slopes, local.quantities(unit[None])[0, 1 + found.active])
    inward = np.linalg.solve(slopes, np.abs(slopes).sum(axis=1))
    tries = []
    for digits in FINE_DIGITS:
        tries.append(unit.copy())
        tries[-1][dependent] = np.round(unit[dependent] + 10.0**-digits * inward, digits)
    return [*tries, unit]


def _dependent(slopes: Floats) -> list[int]:
    """Columns that the rows determine: per row that of the largest slope, of nearly equal ones the first."""
    left, chosen = slopes.copy(), []
    for row in left:
        column = int(np.round(np.abs(row) / np.abs(row).max(), 6).argmax())
        chosen.append(column)
        left -= np.outer(left[:, column] / row[column], row)
    return chosen


def centred(archive: Archive, best: Evaluation) -> Evaluation:
    """Put every factor on which nothing depends at the optimum into the middle, or on its first category.

    Otherwise the last random number would decide.
    """
    if archive.violation(best)[0] > 0:
        return best
    for j, factor in enumerate(archive.problem.space):
        domain = factor.domain
        plain = np.arange(domain.categories) if domain.categories else [domain.snap(np.array(domain.middle))]
        points = np.repeat(best.points, len(plain), axis=0)
        points[:, j] = plain
        points = points if archive.problem.space.affine is None else archive.problem.space.clip(points)
        tried = archive.evaluate(points)
        good = np.flatnonzero(_as_good(archive, tried, best))
        best = tried.rows(good[:1]) if len(good) else best
    return best


def _as_good(archive: Archive, tried: Evaluation, best: Evaluation) -> NDArray[np.bool_]:
    """Which points, shape (n,), are no worse than the best; it may be better by as much as it violates."""
    value = best.objectives[0, 0]
    less = WORSE if (best.margins >= 0.0).all() else FEASIBLE
    spread = np.abs(archive.first.objectives[:, 0] - value)
    size = max(abs(value), float(np.median(np.nan_to_num(spread, posinf=0.0))))
    allowed = (tried.margins >= np.minimum(best.margins, 0.0)).all(axis=1)
    return np.asarray(allowed & (tried.objectives[:, 0] <= value + less * size))
