"""The unit box in which searches move: every factor, of whatever kind, as a number from 0 to 1.

Under equalities the box is wider than what is allowed: its points go to the nearest allowed ones.

A factor with levels (integer, discrete, categorical) divides 0..1 into equal bins, so that a uniform random
number makes every level equally likely.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rsmkit.language.domains import natural_to_unit, unit_to_natural
from rsmkit.language.space import Floats, Space

__all__ = ["continuous", "from_unit", "to_unit"]


def continuous(space: Space) -> NDArray[np.bool_]:
    """Which factors can be moved by any small amount, shape (k,)."""
    return np.array([factor.domain.is_continuous for factor in space])


def from_unit(space: Space, unit: ArrayLike) -> Floats:
    """Unit box to natural units, shape (n, k); exact at both ends, always a value the factor can take."""
    u = np.clip(np.asarray(unit, float), 0.0, 1.0)
    natural = unit_to_natural(u, space.lows, space.highs)
    for j, factor in enumerate(space):
        if not factor.domain.is_continuous:
            natural[:, j] = factor.domain.from_unit(u[:, j])
    return natural if space.affine is None else space.clip(natural)


def to_unit(space: Space, natural: ArrayLike) -> Floats:
    """Natural units to the unit box, shape (n, k); a level goes to the middle of its bin."""
    x = np.asarray(natural, float)
    unit = natural_to_unit(x, space.lows, space.highs)
    for j, factor in enumerate(space):
        if not factor.domain.is_continuous:
            unit[:, j] = factor.domain.to_unit(x[:, j])
    return unit
