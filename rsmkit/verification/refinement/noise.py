"""How much the simulator's answer varies when a run is made again."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rsmkit.optimum.problem import Evaluation
from rsmkit.verification.refinement.models.cube import Cube
from rsmkit.verification.refinement.models.processes import NOISY, Form, fit_process

__all__ = ["first_of_each", "fitted_sd", "repeated_sd"]

SAME = 1e-12
"""Relative difference of repeated runs that is rounding."""


def repeated_sd(known: Evaluation) -> float:
    """Standard deviation of the first objective at repeated points, pooled; 0 without any."""
    alive = known.rows(known.succeeded)
    group = np.unique(alive.points, axis=0, return_inverse=True)[1].reshape(-1)  # numpy 2.0 gives a column
    count = np.bincount(group)
    values = alive.objectives[:, 0]
    apart = values - (np.bincount(group, values) / count)[group]
    freedom = int((count - 1).sum())
    size = float(np.abs(values).max(initial=0.0))
    if not freedom or not np.abs(apart).max() > SAME * size:
        return 0.0
    return float(np.sqrt((apart**2).sum() / freedom))


def fitted_sd(cube: Cube, known: Evaluation) -> float:
    """Standard deviation of the first objective's noise where no point is repeated: what no process explains.

    0 with fewer runs than a plane with three degrees of freedom takes.
    """
    alive = known.rows(known.succeeded)
    if len(alive) < len(cube) + 4:
        return 0.0
    unit, values = cube.unit(alive.points), alive.objectives[:, 0]
    process = fit_process(Form("matern52"), unit, values, cube.categorical, nugget=NOISY)
    return process.noise_sd if process else 0.0


def first_of_each(known: Evaluation) -> NDArray[np.intp]:
    """Rows of different points, the first of each: a run made again says nothing new without noise."""
    return np.sort(np.unique(known.points, axis=0, return_index=True)[1])
