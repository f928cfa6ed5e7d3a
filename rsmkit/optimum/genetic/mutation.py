"""Mutation along random directions with an adapted step, kept feasible.

After MATLAB's ``mutationadaptfeasible`` as publicly described: random directions, a step that shrinks after
an unsuccessful generation and grows after a successful one, points kept within bounds and constraints. The
factor 4 of the adaptation is ours.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from rsmkit.language.space import Floats

__all__ = ["AdaptiveFeasibleMutation"]

MAX_HALVINGS = 30
SMALLEST_STEP = 1e-6


class AdaptiveFeasibleMutation:
    """Move points of the unit box by a step along a random direction, only to allowed places.

    Parameters
    ----------
    allowed : callable
        Unit points, shape (n, k), to a mask, shape (n,): whether the cheap constraints hold.
    """

    def __init__(self, allowed: Callable[[Floats], NDArray[np.bool_]]) -> None:
        self._allowed = allowed
        self.step = 1.0

    def adapt(self, improved: bool) -> None:
        """Grow the step after a generation that improved the best point, shrink it after any other."""
        self.step = min(1.0, 4.0 * self.step) if improved else max(SMALLEST_STEP, self.step / 4.0)

    def mutate(self, points: Floats, rng: np.random.Generator) -> Floats:
        """Move every point, shape (n, k); one that cannot move stays."""
        count, k = points.shape
        directions = rng.normal(size=(count, k))
        along_axis = rng.random(count) < 0.5
        axes = np.eye(k)[rng.integers(k, size=count)] * rng.choice([-1.0, 1.0], size=count)[:, None]
        directions[along_axis] = axes[along_axis]
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        moved = points.copy()
        pending = np.arange(count)
        step = self.step
        for attempt in range(2 * MAX_HALVINGS):
            trial = points[pending] + (step if attempt % 2 == 0 else -step) * directions[pending]
            good = np.array(((trial >= 0.0) & (trial <= 1.0)).all(axis=1))
            good[good] = self._allowed(trial[good])
            moved[pending[good]] = trial[good]
            pending = pending[~good]
            if not len(pending):
                break
            if attempt % 2:
                step /= 2.0
        return moved
