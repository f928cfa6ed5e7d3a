"""When enough is known: what would be worth having, whether going on could tell, what no run has seen."""

from __future__ import annotations

import math

import numpy as np

from rsmkit.language.space import Floats
from rsmkit.optimum.problem import Problem
from rsmkit.verification.refinement.models.cube import Cube

__all__ = ["largest_gap", "noise_hides", "spread_out", "worth_having"]

SAMPLES = 2048
APART = 0.05
"""Ranges between points of one wave that are run because of a doubt."""


def worth_having(value: float, spread: float, tolerance_pct: float) -> float:
    """Least gain that counts: a part of the objective or, where that is larger, of its spread."""
    return tolerance_pct / 100.0 * max(abs(value), spread)


def noise_hides(gain: float, worth: float, noise_sd: float, known: int, left: int) -> bool:
    """Whether a gain is less than the noise of one run, and runs cannot tell it from nothing.

    What noise leaves unknown shrinks with the square root of the number of runs at best, so `left` more
    runs beyond the `known` ones bring a `gain` down to what is `worth` having only if they are enough.
    """
    return gain <= noise_sd and gain * math.sqrt(known / (known + left)) > worth


def largest_gap(cube: Cube, problem: Problem, unit: Floats) -> float:
    """Half the width, in ranges of the factors, of the largest cube without a run, shape (n, k); at most 1.

    Among points that satisfy the constraints that are known beforehand; a combination of categories that
    no run has is a gap of 1.
    """
    points = cube.sample(cube.whole(np.zeros(len(cube))), SAMPLES, 11, categories=True)
    margins = np.nan_to_num(problem.cheap_margins(cube.natural(points)), nan=-1.0)
    allowed = points[(margins >= 0.0).all(axis=1)]
    if not len(allowed):
        return 0.0
    return min(1.0, float(cube.apart(allowed, unit).min(axis=1).max()))


def spread_out(cube: Cube, points: Floats, count: int) -> list[Floats]:
    """Choose the first `count` of points, shape (p, k), that lie apart from those before."""
    chosen: list[Floats] = []
    for point in points:
        if len(chosen) < count and (not chosen or cube.apart(point[None], np.array(chosen)).min() > APART):
            chosen.append(point)
    return chosen
