"""Central composite designs: a cube, a star and centre points (Box & Wilson 1951)."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from rsmkit.design import pydoe
from rsmkit.design.table import Design
from rsmkit.errors import RsmkitError
from rsmkit.space import Floats, Space

__all__ = ["Alpha", "Star", "ccd", "star_distance"]

Star = Literal["circumscribed", "inscribed", "faced"]
Alpha = Literal["rotatable", "orthogonal", "spherical", "uncorrelated"] | float

LARGEST_CUBE = 2**12


def ccd(
    space: Space,
    *,
    star: Star = "circumscribed",
    alpha: Alpha = "rotatable",
    center: int = 3,
    center_axial: int = 0,
) -> Design:
    """Central composite design.

    Parameters
    ----------
    space : Space
        Two or more numeric factors.
    star : {"circumscribed", "inscribed", "faced"}
        Circumscribed: the cube is on the bounds, the star points lie outside. Inscribed: the star points are
        on the bounds, the cube inside. Faced: both on the bounds.
    alpha : float or {"rotatable", "orthogonal", "spherical", "uncorrelated"}
        Star distance when the cube is at +-1; see :func:`star_distance`. Not used when faced.
    center, center_axial : int
        Centre points run with the cube, and with the star.

    Returns
    -------
    Design
        Kinds factorial, center, axial, center, in this order.

    Raises
    ------
    RsmkitError
        For fewer than two factors, a categorical factor, or an impossible star distance.
    """
    k = _numeric_count(space, "a central composite design")
    cube = pydoe.two_level_factorial(k)
    distance = 1.0 if star == "faced" else star_distance(k, len(cube), center, center_axial, alpha)
    tips = distance * pydoe.star(k)
    scale = 1.0 / distance if star == "inscribed" else 1.0
    coded = scale * np.vstack([cube, np.zeros((center, k)), tips, np.zeros((center_axial, k))])
    kinds = (
        ["factorial"] * len(cube) + ["center"] * center + ["axial"] * len(tips) + ["center"] * center_axial
    )
    return Design(space, _natural(space, coded), tuple(kinds))


def star_distance(k: int, cube: int, center: int, center_axial: int, alpha: Alpha) -> float:
    """Distance of the star points from the centre, with the cube at +-1.

    Parameters
    ----------
    k : int
        Number of factors.
    cube : int
        Runs of the cube, F.
    center, center_axial : int
        Centre points with the cube, n_c, and with the star, n_a.
    alpha : float or str
        ``rotatable``: F^(1/4), equal precision at equal distance from the centre. ``orthogonal``:
        sqrt(k (1 + n_a / 2k) / (1 + n_c / F)), cube and star can be run as blocks that do not disturb the
        coefficients. ``spherical``: sqrt(k), all points but the centre on one sphere. ``uncorrelated``:
        sqrt((sqrt(F N) - F) / 2) with N runs in all, the estimates of the squares are uncorrelated.
        A number is taken as it is.

    Notes
    -----
    Box & Hunter (1957), Ann. Math. Statist. 28, 195-241; Myers, Montgomery & Anderson-Cook, Response Surface
    Methodology, section 8.
    """
    if isinstance(alpha, str):
        runs = cube + 2 * k + center + center_axial
        rules = {
            "rotatable": math.sqrt(math.sqrt(cube)),
            "orthogonal": math.sqrt(k * (1 + center_axial / (2 * k)) / (1 + center / cube)),
            "spherical": math.sqrt(k),
            "uncorrelated": math.sqrt((math.sqrt(cube * runs) - cube) / 2),
        }
        return rules[alpha]
    if not alpha > 0:
        raise RsmkitError(f"central composite design: alpha must be positive, got {alpha:g}")
    return float(alpha)


def _numeric_count(space: Space, what: str) -> int:
    """Number of factors, when all are numeric and there are at least two."""
    categorical = [factor.name for factor in space if factor.kind == "categorical"]
    if categorical:
        raise RsmkitError(
            f"{what} is for numeric factors; {', '.join(categorical)} is categorical: use an optimal design"
        )
    if len(space) < 2:
        raise RsmkitError(f"{what} needs at least two factors, got {len(space)}")
    if 2 ** len(space) > LARGEST_CUBE:
        raise RsmkitError(
            f"{what} of {len(space)} factors has {2 ** len(space)} cube runs: use an optimal design"
        )
    return len(space)


def _natural(space: Space, coded: Floats) -> Floats:
    """Decode; integer and discrete factors go to the nearest value they can take."""
    return space.snap(space.decode(coded))
