"""Points far from all others, where runs should succeed: what is run while nothing is known yet."""

from __future__ import annotations

import numpy as np

from rsmkit.language.space import Floats
from rsmkit.optimum.problem import Problem
from rsmkit.verification.refinement.models.cube import Box, Cube
from rsmkit.verification.refinement.models.failures import Failures

__all__ = ["far_from_all"]

CANDIDATES = 512
NOT_APART = 1e-9
HOPELESS = 0.1
"""Chance to succeed below which no point is run."""


def far_from_all(
    cube: Cube,
    problem: Problem,
    box: Box,
    taken: Floats,
    failures: Failures | None,
    count: int,
    seed: int,
    *,
    categories: bool = True,
) -> list[Floats]:
    """Choose points of a box, cheap constraints kept where any candidate keeps them.

    Parameters
    ----------
    cube, problem, box
        Where.
    taken : array, shape (n, k)
        Points already run or chosen.
    failures : Failures or None
        Distances count by the chance to succeed.
    count : int
        How many; fewer when the allowed points are used up.
    seed : int
        Of the candidates.
    categories : bool
        Whether categories other than the box's may be chosen.
    """
    if count < 1:
        return []
    pool = cube.sample(box, CANDIDATES, seed, categories=categories)
    margins = np.nan_to_num(problem.cheap_margins(cube.natural(pool)), nan=-1.0)
    allowed = (margins >= 0).all(axis=1)
    pool = pool[allowed] if allowed.any() else pool
    chance = np.ones(len(pool)) if failures is None else np.exp(failures.log_chance(pool))
    chance[chance < HOPELESS] = 0.0
    distance = np.minimum(cube.apart(pool, taken).min(axis=1), 2.0)
    found: list[Floats] = []
    while len(found) < count:
        row = int((distance * chance).argmax())
        if not distance[row] * chance[row] > NOT_APART:
            break
        found.append(pool[row])
        distance = np.minimum(distance, np.minimum(cube.apart(pool, pool[[row]])[:, 0], 2.0))
    return found
