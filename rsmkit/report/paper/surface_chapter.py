"""What a report says of one surface: how good it is, its equation, its tests, and pictures."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from io import BytesIO
from typing import Any

import numpy as np

from rsmkit.language.space import Floats
from rsmkit.report.explorer.verdict import quality_words
from rsmkit.report.paper.blocks import Block, Grid, Heading, Picture, Text
from rsmkit.surfaces.fitted_response import FittedResponse
from rsmkit.surfaces.models.polynomial import PolynomialSurface
from rsmkit.surfaces.models.surface import Surface

__all__ = ["picture", "surface_chapter"]

MOST_CATEGORIES = 6
"""Equations by category that are written out."""
RESOLUTION = 110
STATISTICS = {
    "r2": "R²",
    "r2_adjusted": "R² adjusted",
    "r2_predicted": "R² predicted",
    "press": "PRESS",
    "sigma": "residual standard deviation",
    "df": "degrees of freedom of the residual",
    "rmse_loo": "error at runs left out (root mean square)",
}


def surface_chapter(
    title: str,
    surface: FittedResponse[Surface],
    polynomial: FittedResponse[PolynomialSurface],
    *,
    sentence: str = "",
    at: Floats | None = None,
) -> list[Block]:
    """Tell all about one surface.

    Parameters
    ----------
    title : str
        Of the response, with its unit.
    surface : FittedResponse
        The one that is predicted with.
    polynomial : FittedResponse
        The polynomial of the same runs, to be read beside it.
    sentence : str
        Why this kind of surface.
    at : array, shape (k,), optional
        Where pictures hold the factors that they do not show.
    """
    report, plain = surface.report(), polynomial.report()
    ahead = report.get("r2_predicted")
    blocks: list[Block] = [
        Heading(title, 2),
        Text(f"As a description of these runs: {quality_words(ahead)}."),
    ]
    blocks += [Text(sentence)] if sentence else []
    told = [[words, report[key]] for key, words in STATISTICS.items() if report.get(key) is not None]
    blocks.append(Grid(f"{title}: how well it fits", ["", "value"], [["runs", len(surface.data)], *told]))
    if surface is not polynomial:
        blocks.append(Text("The polynomial of the same runs, to read beside it:"))
    blocks += _equations(plain)
    blocks.append(_anova(title, plain))
    blocks.append(_coefficients(title, plain))
    blocks += _pictures(title, surface, polynomial, at)
    return blocks


def picture(draw: Callable[[Any], object], size: tuple[float, float] = (8.5, 3.6)) -> bytes:
    """Draw a figure without any window; give it as PNG."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout="constrained")
    FigureCanvasAgg(figure)
    draw(figure)
    stream = BytesIO()
    figure.savefig(stream, format="png", dpi=RESOLUTION)
    return stream.getvalue()


def _equations(report: Mapping[str, Any]) -> list[Block]:
    found = report.get("equations") or {}
    if not isinstance(found, Mapping) or "natural" not in found:
        return []
    blocks: list[Block] = [
        Text(f"In natural units: {found['natural']}"),
        Text(f"In coded units (-1 to +1): {found['coded']}"),
    ]
    for each in list(found.get("by_category") or [])[:MOST_CATEGORIES]:
        where = ", ".join(f"{name} = {level}" for name, level in each["category"].items())
        blocks.append(Text(f"For {where}: {each['natural']}"))
    return blocks


def _anova(title: str, report: Mapping[str, Any]) -> Grid:
    keys = ("source", "df", "ss", "ms", "F", "p")
    heads = ["source", "df", "sum of squares", "mean square", "F", "p"]
    rows = [[row.get(key) for key in keys] for row in report.get("anova_table") or []]
    return Grid(f"{title}: analysis of variance", heads, rows)


def _coefficients(title: str, report: Mapping[str, Any]) -> Grid:
    keys = ("name", "estimate", "std_error", "t", "p", "low", "high", "vif")
    heads = ["term (coded)", "estimate", "standard error", "t", "p", "low", "high", "VIF"]
    rows = [[term.get(key) for key in keys] for term in report.get("terms") or []]
    return Grid(f"{title}: coefficients", heads, rows)


def _pictures(
    title: str,
    surface: FittedResponse[Surface],
    polynomial: FittedResponse[PolynomialSurface],
    at: Floats | None,
) -> list[Block]:
    """What can be drawn of this surface; what cannot is left out."""
    from rsmkit.report.figures.diagnostic_plots import parity, residuals
    from rsmkit.report.figures.surface_plots import contours

    def checks(figure: Any) -> None:
        first, second, third = figure.subplots(1, 3)
        parity(polynomial.surface, ax=first)
        residuals(polynomial.surface, ax=second)
        residuals(polynomial.surface, "run", ax=third)

    names = [factor.name for factor in surface.space if factor.domain.is_numeric][:2]
    blocks: list[Block] = []
    with suppress(Exception):  # a picture that fails ends no report
        blocks.append(
            Picture(
                picture(checks),
                f"{title}: predicted against measured, and residuals by prediction and by run",
            )
        )
    if len(names) == 2:
        held = "" if at is None else _held(surface, np.asarray(at, float), names)
        with suppress(Exception):
            drawn = picture(
                lambda figure: contours(surface.surface, *names, at=at, ax=figure.subplots()), (6.5, 4.2)
            )
            blocks.append(Picture(drawn, f"{title} over {names[0]} and {names[1]}{held}"))
    return blocks


def _held(surface: FittedResponse[Surface], at: Floats, shown: list[str]) -> str:
    others = {n: v for n, v in surface.space.values(at).items() if n not in shown}
    told = ", ".join(f"{n} = {v:.5g}" if isinstance(v, float) else f"{n} = {v}" for n, v in others.items())
    return f", at {told}" if told else ""
