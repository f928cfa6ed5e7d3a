"""Runs at two levels of every factor, perhaps with runs at the centre, and what the centre says of curvature.

Montgomery, *Design and Analysis of Experiments*, 8th ed. (2013), section 6.8; Box & Draper, *Response
Surfaces, Mixtures, and Ridge Analyses*, 2nd ed. (2007), section 6.3.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc

from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.io.shown import Shown
from rsmkit.language.space import Floats
from rsmkit.surfaces.estimation.least_squares import EXACT
from rsmkit.surfaces.models.polynomial import PolynomialSurface
from rsmkit.surfaces.reading import number
from rsmkit.surfaces.statistics.terms.anova import lack_of_fit
from rsmkit.surfaces.statistics.texts import short

__all__ = ["Curvature", "TwoLevels", "curvature_report", "curvature_test", "curvature_words", "two_levels"]

ROUNDING = 1e-6
"""Share of the range by which a level may be off."""
ALIASED = 1e-8
"""Length left of the unit column of the centre beside the model, below which the model holds it already."""


@dataclass(frozen=True)
class TwoLevels:
    """Runs on the scale on which the two levels are -1 and +1.

    Parameters
    ----------
    points : array, shape (n, k)
        -1 and +1, 0 at the middle of a number; of a category of two levels the second is +1, of one with more
        all are nan.
    center : array of bool, shape (n,)
        Runs at the middle of every number.
    """

    points: Floats
    center: NDArray[np.bool_]


@dataclass(frozen=True)
class Curvature(Shown):
    """Single-degree-of-freedom test of curvature.

    Parameters
    ----------
    difference, std_error : float
        Mean of the runs at two levels less that at the centre, all else equal: minus the sum of the pure
        quadratic coefficients.
    ss : float
        Sum of squares of the centre after the model.
    f, p : float
        Against the error below; nan where there is none.
    df : int
        Degrees of freedom of the error.
    error : {"pure error", "residual"}
        Repeated runs, or without any the residual of the model with a term for the centre.
    """

    difference: float
    std_error: float
    ss: float
    f: float
    p: float
    df: int
    error: str


@checked
def curvature_test(surface: PolynomialSurface) -> Curvature:
    """Test whether the centre of a two-level design lies off the surface of the model.

    Parameters
    ----------
    surface : PolynomialSurface
        Without squares, fitted to runs at two levels and at the centre.

    Raises
    ------
    RsmkitError
        Where the runs are no such design, with the reason.
    """
    fit, name = surface.fit, surface.response
    center = two_levels(surface).center
    if not center.any() or center.all():
        raise RsmkitError(f"{name}: there are no runs at the centre")
    root = np.sqrt(fit.weights)
    q = np.linalg.qr(surface.matrix * root[:, None])[0]
    column = center * root
    rest = column - q @ (q.T @ column)
    rest -= q @ (q.T @ rest)
    length = float(np.linalg.norm(rest))
    if length <= ALIASED * np.linalg.norm(column):
        raise RsmkitError(f"{name}: the terms of the model take up the curvature")
    slope = float(rest @ (fit.residuals * root)) / length**2
    ss = (slope * length) ** 2
    pure = lack_of_fit(surface).pure
    error, square, df = "residual", (fit.rss - ss) / max(fit.df - 1, 1), fit.df - 1
    if pure is not None and pure.df and pure.ss > 0:
        error, square, df = "pure error", pure.ms, pure.df
    tested = df > 0 and not fit.exact and square > EXACT**2 * float((fit.weights * fit.y**2).sum())
    f = ss / square if tested else math.nan
    p = float(fdtrc(1, df, f)) if tested else math.nan
    return Curvature(-slope, math.sqrt(square) / length if tested else math.nan, ss, f, p, df, error)


def curvature_report(surface: PolynomialSurface) -> dict[str, Any]:
    """The test of curvature as JSON values, or why there is none."""
    try:
        found = curvature_test(surface)
    except RsmkitError as error:
        return {"reason": str(error).removeprefix(f"{surface.response}: ")}
    return {
        "difference": found.difference,
        "std_error": number(found.std_error),
        "ss": found.ss,
        "F": number(found.f),
        "p": number(found.p),
        "df": [1, found.df],
        "error": found.error,
    }


def curvature_words(report: dict[str, Any]) -> list[str]:
    """The test as a line of text; nothing where there is none."""
    if "reason" in report:
        return []
    text = f"Curvature: mean at two levels less mean at the centre {short(report['difference'])}"
    if report["F"] is not None:
        text += f", F {short(report['F'])} on 1 and {report['df'][1]} degrees of freedom ({report['error']})"
        text += f", p {short(report['p'])}"
    return ["", text]


def two_levels(surface: PolynomialSurface) -> TwoLevels:
    """Put the levels of a two-level design at -1 and +1.

    Raises
    ------
    RsmkitError
        If a number has other values than two levels and their middle, or a run mixes levels and middles.
    """
    points, space = surface.data.points, surface.space
    scaled = np.full(points.shape, np.nan)
    for j, factor in enumerate(space):
        column = points[:, j]
        if factor.domain.is_numeric:
            scaled[:, j] = _levels(column)
            if np.isnan(scaled[:, j]).any():
                raise RsmkitError(
                    f"{surface.response}: {factor.name} has other values than two levels and their middle"
                )
        elif factor.domain.categories == 2:
            scaled[:, j] = 2.0 * np.round(column) - 1.0
    numbers = scaled[:, space.numeric]
    center = (numbers == 0).all(axis=1) if numbers.shape[1] else np.zeros(len(points), bool)
    if (numbers[~center] == 0).any():
        raise RsmkitError(f"{surface.response}: some runs hold one factor at the middle and others not")
    return TwoLevels(scaled, center)


def _levels(column: Floats) -> Floats:
    """-1, 0 and +1 for the ends and the middle of a column; nan for anything else."""
    low, high = column.min(), column.max()
    if low == high:
        return np.full(len(column), np.nan)
    coded = (2.0 * column - low - high) / (high - low)
    nearest = np.round(coded)
    return np.where(np.abs(coded - nearest) <= ROUNDING, nearest, np.nan)
