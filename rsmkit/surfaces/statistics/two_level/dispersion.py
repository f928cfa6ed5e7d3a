"""Dispersion effects of a two-level design: does the spread of the residuals depend on a factor?

Box & Meyer, *Technometrics* 28 (1986), 19-27: for each column of signs the logarithm of the ratio of the
residuals' variances at its two levels, once the effects on the mean are taken out by the model.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.io.shown import Shown
from rsmkit.surfaces.models.polynomial import PolynomialSurface
from rsmkit.surfaces.reading import number
from rsmkit.surfaces.statistics.two_level.two_levels import two_levels

__all__ = ["DispersionEffect", "dispersion_effects", "dispersion_report"]

FEWEST = 3
"""Residuals at a level that have a spread worth comparing."""


@dataclass(frozen=True)
class DispersionEffect(Shown):
    """How the spread of the residuals differs between the levels of a column.

    Parameters
    ----------
    name : str
        A factor, or factors whose product the column is; those with the same column up to sign after ``=``.
    low, high : float
        Standard deviations of the residuals at the lower and at the upper level.
    log_ratio : float
        Logarithm of the ratio of the variances, upper over lower.
    """

    name: str
    low: float
    high: float
    log_ratio: float


@checked
def dispersion_effects(surface: PolynomialSurface, order: int = 2) -> list[DispersionEffect]:
    """Compare the residuals' spread at the two levels of every factor, and of products of them.

    Parameters
    ----------
    surface : PolynomialSurface
        Its model holds the effects on the mean; runs at the centre are left out.
    order : int
        Products of up to so many factors.

    Raises
    ------
    RsmkitError
        If the runs are not at two levels, or nothing is left over by the model.
    """
    two, fit = two_levels(surface), surface.fit
    if not np.isfinite(two.points).all():
        raise RsmkitError(f"{surface.response}: a category has more than two levels")
    if fit.df == 0 or not fit.rss > 1e-24 * max(fit.tss, 1e-300):
        raise RsmkitError(f"{surface.response}: the model leaves no residuals to compare")
    signs, residuals = two.points[~two.center], (np.sqrt(fit.weights) * fit.residuals)[~two.center]
    columns: dict[tuple[float, ...], list[str]] = {}
    names = surface.space.names
    for count in range(1, min(order, len(names)) + 1):
        for factors in combinations(range(len(names)), count):
            column = signs[:, factors].prod(axis=1)
            key = tuple(column.tolist())
            mirror = tuple((-column).tolist())
            place = mirror if mirror in columns else key
            columns.setdefault(place, []).append("*".join(names[j] for j in factors))
    found = []
    for key, named in columns.items():
        high, low = (residuals[np.array(key) == side] for side in (1.0, -1.0))
        if min(len(high), len(low)) >= FEWEST:
            spreads = float(low.std(ddof=1)), float(high.std(ddof=1))
            ratio = 2.0 * math.log(spreads[1] / spreads[0]) if min(spreads) > 0 else math.nan
            found.append(DispersionEffect(" = ".join(named), *spreads, ratio))
    return found


def dispersion_report(surface: PolynomialSurface) -> dict[str, Any]:
    """The comparison as JSON values, or why there is none."""
    try:
        found = dispersion_effects(surface)
    except RsmkitError as error:
        return {"reason": str(error).removeprefix(f"{surface.response}: ")}
    return {
        "effects": [
            {
                "name": effect.name,
                "std_dev_low": number(effect.low),
                "std_dev_high": number(effect.high),
                "log_ratio": number(effect.log_ratio),
            }
            for effect in found
        ]
    }
