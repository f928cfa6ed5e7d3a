"""The one door to pyDOE3: its classical designs as coded arrays, put right where it is wrong."""

from __future__ import annotations

import numpy as np

from rsmkit.space import Floats

__all__ = ["star", "two_level_factorial"]


def two_level_factorial(k: int) -> Floats:
    """All corners of the cube, first factor changing fastest, shape (2^k, k)."""
    from pyDOE3 import ff2n

    return np.asarray(ff2n(k), float)


def star(k: int) -> Floats:
    """The star points at distance 1, shape (2k, k): factor by factor, low before high."""
    from pyDOE3.doe_star import star as pydoe_star

    points, _ = pydoe_star(k, alpha="faced")
    return np.asarray(points, float)
