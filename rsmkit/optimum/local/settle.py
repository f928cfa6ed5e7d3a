"""Random steps without slopes: the last bit of an optimum that lies on a kink.

A gradient search stops short where an objective has an edge, and desirabilities, ``max`` and ``abs`` have
edges just where their optimum is. Evaluations must be free: this is for surfaces.
"""

from __future__ import annotations

import numpy as np

from rsmkit.optimum.problem import Archive, Evaluation
from rsmkit.optimum.unit_box import continuous, from_unit, to_unit

__all__ = ["settle"]

STEPS = 64
FIRST_RADIUS = 0.01
LAST_RADIUS = 1e-10
NEAR_BOUND = 1e-8
"""Fraction of a range that steps may have strayed from a bound on which the optimum lies."""


def settle(archive: Archive, best: Evaluation) -> Evaluation:
    """Improve the best point (one row) by random steps, longer after a success and shorter after a failure.

    Continuous factors move, the others keep their level. Every point accepted satisfies all constraints.
    """
    space = archive.problem.space
    free = np.flatnonzero(continuous(space))
    if not len(free) or archive.violation(best)[0] > 0:
        return best
    rng = np.random.default_rng(0)
    radius = FIRST_RADIUS
    axes = np.eye(len(free))
    while radius > LAST_RADIUS:
        directions = rng.normal(size=(STEPS, len(free)))
        directions *= rng.random((STEPS, 1)) / np.linalg.norm(directions, axis=1, keepdims=True)
        steps = np.vstack([directions, axes, -axes])
        unit = np.repeat(to_unit(space, best.points), len(steps), axis=0)
        unit[:, free] = np.clip(unit[:, free] + radius * steps, 0.0, 1.0)
        tried = archive.evaluate(from_unit(space, unit))
        allowed = (tried.margins >= 0).all(axis=1)
        value = np.where(allowed, np.nan_to_num(tried.objectives[:, 0], nan=np.inf), np.inf)
        row = int(value.argmin())
        if value[row] < best.objectives[0, 0]:
            best = tried.rows([row])
            radius = min(2.0 * radius, 10.0 * FIRST_RADIUS)
        else:
            radius /= 2.0
    return _on_bounds(archive, best)


def _on_bounds(archive: Archive, best: Evaluation) -> Evaluation:
    """Put what lies next to a bound on it, when that costs no more than rounding."""
    space = archive.problem.space
    unit = to_unit(space, best.points)
    near = continuous(space) & (np.abs(unit - np.round(unit)) <= NEAR_BOUND)
    moved = archive.evaluate(from_unit(space, np.where(near, np.round(unit), unit)))
    value = best.objectives[0, 0]
    allowed = (moved.margins >= 0).all() and moved.objectives[0, 0] <= value + 1e-14 * abs(value)
    return moved if allowed else best
