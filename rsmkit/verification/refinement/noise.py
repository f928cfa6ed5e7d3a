"""How much the simulator's answer varies when a run is made again."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rsmkit.optimum.problem import Evaluation

__all__ = ["first_of_each", "repeated_sd"]

SAME = 1e-12
"""Relative difference of repeated runs that is rounding."""


def repeated_sd(known: Evaluation) -> float:
    """Standard deviation of the first objective at repeated points, pooled; 0 without any."""
    alive = known.rows(known.succeeded)
    _, group = np.unique(alive.points, axis=0, return_inverse=True)
    count = np.bincount(group)
    values = alive.objectives[:, 0]
    apart = values - (np.bincount(group, values) / count)[group]
    freedom = int((count - 1).sum())
    size = float(np.abs(values).max(initial=0.0))
    if not freedom or not np.abs(apart).max() > SAME * size:
        return 0.0
    return float(np.sqrt((apart**2).sum() / freedom))


def first_of_each(known: Evaluation) -> NDArray[np.intp]:
    """Rows of different points, the first of each: a run made again says nothing new without noise."""
    return np.sort(np.unique(known.points, axis=0, return_index=True)[1])
