"""The unit box in which searches move: every factor, of whatever kind, as a number from 0 to 1.

A factor with levels (integer, discrete, categorical) divides 0..1 into equal bins, so that a uniform random
number makes every level equally likely.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rsmkit.language.space import Factor, Floats, Space

__all__ = ["continuous", "from_unit", "level_count", "to_unit"]


def continuous(space: Space) -> NDArray[np.bool_]:
    """Which factors can be moved by any small amount, shape (k,)."""
    return np.array([factor.kind == "continuous" for factor in space])


def level_count(factor: Factor) -> int:
    """Number of values a factor with levels can take."""
    return len(factor.levels) or round(factor.high - factor.low) + 1


def from_unit(space: Space, unit: ArrayLike) -> Floats:
    """Unit box to natural units, shape (n, k); exact at both ends, always a value the factor can take."""
    u = np.clip(np.asarray(unit, float), 0.0, 1.0)
    natural: Floats = (1.0 - u) * space.lows + u * space.highs
    for j, factor in enumerate(space):
        if factor.kind != "continuous":
            count = level_count(factor)
            index = np.minimum((u[:, j] * count).astype(int), count - 1)
            natural[:, j] = (
                np.array(factor.levels)[index] if factor.kind == "discrete" else factor.low + index
            )
    return natural


def to_unit(space: Space, natural: ArrayLike) -> Floats:
    """Natural units to the unit box, shape (n, k); a level goes to the middle of its bin."""
    x = np.asarray(natural, float)
    unit: Floats = (x - space.lows) / (space.highs - space.lows)
    for j, factor in enumerate(space):
        if factor.kind != "continuous":
            steps = (
                np.searchsorted(np.array(factor.levels, float), x[:, j])
                if factor.kind == "discrete"
                else (x[:, j] - factor.low)
            )
            unit[:, j] = (steps + 0.5) / level_count(factor)
    return unit
