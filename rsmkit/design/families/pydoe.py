"""The one door to pyDOE3: its classical designs as coded arrays, put right where it is wrong.

pyDOE3 is imported inside the functions because that takes over a second. Its Box-Behnken designs are the
published ones only up to five factors, its Plackett-Burman designs with 24, 28, 36, 44 and 48 runs are not,
its composite designs take neither a numeric star distance nor a fractional cube, its fractions no more than
eleven basic factors when I is kept for the identity, and its optimal designs can be singular: the modules
beside this one say what is used instead.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rsmkit.language.space import Floats

__all__ = [
    "full_factorial",
    "pairwise_edges",
    "star",
    "subset_factorial",
]


def full_factorial(levels: Sequence[int]) -> Floats:
    """All combinations of level indices 0, 1, ..., first factor changing fastest, shape (prod levels, k)."""
    from pyDOE3 import fullfact

    return np.asarray(fullfact(list(levels)), float)


def subset_factorial(levels: Sequence[int], reduction: int) -> Floats:
    """One of `reduction` complementary parts of all combinations of level indices, shape (n, k)."""
    from pyDOE3 import gsd

    return np.asarray(gsd(list(levels), reduction), float)


def star(k: int) -> Floats:
    """The star points at distance 1, shape (2k, k): factor by factor, low before high."""
    from pyDOE3.doe_star import star as pydoe_star

    points, _ = pydoe_star(k, alpha="faced")
    return np.asarray(points, float)


def pairwise_edges(k: int) -> Floats:
    """The factorial in every pair of factors, all others at 0: Box-Behnken's design for three to five."""
    from pyDOE3 import bbdesign

    return np.asarray(bbdesign(k, center=0), float)
