"""The part of a report that says where a polynomial surface leads: stationary point, axes, paths."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from rsmkit.errors import RsmkitError
from rsmkit.language.space import Floats
from rsmkit.surfaces.models.polynomial import PolynomialSurface
from rsmkit.surfaces.reading import number, numbers
from rsmkit.surfaces.statistics.mixtures.stationary import stationary_blend
from rsmkit.surfaces.statistics.optima.canonical import Quadratic, canonical_analysis, stationary_region
from rsmkit.surfaces.statistics.optima.ridge import Goal, ridge_path, steepest_path
from rsmkit.surfaces.statistics.terms.categories import (
    Category,
    all_categories,
    at_category,
    differing_curvature,
)
from rsmkit.surfaces.statistics.texts import pairs, short, text_table

__all__ = ["category_words", "optimum_report"]

RADII = np.r_[np.arange(0.0, 2.0, 0.25), np.arange(2.0, 5.01, 0.5)]
"""Distances from the centre in coded units along the paths."""
REGION_FACTORS = 6
"""Up to so many factors the report holds the region of the stationary point; beyond, it costs seconds."""
MOST_CATEGORIES = 24
"""Combinations of categories that a report tells apart."""
GOALS: dict[str, Goal] = {"ascent": "maximize", "descent": "minimize"}
NO_PATH = "components of a mixture trade off against each other, so no factor moves alone"
NO_AXES: dict[str, Any] = dict.fromkeys(("eigenvalues", "eigenvalue_std_errors", "eigenvectors"))


def optimum_report(surface: PolynomialSurface) -> dict[str, Any]:
    """Stationary point, eigenvalues, eigenvectors, and the paths of ascent and descent, as JSON values.

    With categories ``stationary_points`` has one point for each combination of them, and the paths are listed
    ``by_category``; ``stationary_point`` is there too if it does not depend on them. Of a mixture the point
    is stationary among blends, and there are no paths.
    """
    if surface.terms.components:
        refused = {"reason": NO_PATH}
        return {**stationary_blend(surface), "ascent": refused, "descent": refused}
    if all(f.domain.is_numeric for f in surface.space):
        return {
            **_canonical(surface, None),
            "ascent": _path(surface, "maximize", None),
            "descent": _path(surface, "minimize", None),
        }
    if reason := _no_categories(surface):
        refused = {"reason": reason}
        return {"stationary_point": refused, **NO_AXES, "ascent": refused, "descent": refused}
    categories = all_categories(surface.space)
    found = [_canonical(surface, category) for category in categories]
    points = [
        {"category": category, **one["stationary_point"]}
        for category, one in zip(categories, found, strict=True)
    ]
    paths = {
        name: {"by_category": [{"category": c, **_path(surface, goal, c)} for c in categories]}
        for name, goal in GOALS.items()
    }
    return {**found[0], "stationary_point": _common(surface, points), "stationary_points": points, **paths}


def category_words(report: Mapping[str, Any]) -> list[str]:
    """Stationary points and directions of every category as lines of text."""
    lines: list[str] = []
    if all("reason" in point for point in report["stationary_points"]):
        lines.append(f"No stationary point: {report['stationary_point']['reason']}.")
    for point in report["stationary_points"]:
        where = ", ".join(f"{name} {level}" for name, level in point["category"].items())
        if "reason" not in point:
            place = _place(point)
            lines.append(
                f"Stationary point at {where} ({point['kind']}, {place}): {pairs(point['natural'])}; "
                f"predicted {short(point['predicted'])}"
            )
    for path in report["ascent"].get("by_category", []):
        if path.get("kind") == "straight":
            where = ", ".join(f"{name} {level}" for name, level in path["category"].items())
            lines.append(f"Steepest ascent at {where}: {_step(path)}")
    if report["eigenvalues"]:
        names = report["ascent"]["by_category"][0]["points"][0]["coded"]
        vectors = zip(*report["eigenvectors"], strict=True)
        axes = zip(report["eigenvalues"], report["eigenvalue_std_errors"], vectors, strict=True)
        rows = [[short(value), short(error), *map(short, vector)] for value, error, vector in axes]
        lines += ["", *text_table(["eigenvalue", "std. error", *names], rows)]
    return lines


def _place(point: dict[str, Any]) -> str:
    if point["inside_bounds"]:
        return "inside the bounds"
    return "inside the box of the runs" if point["inside_runs"] else "outside the runs: extrapolated"


def _step(path: dict[str, Any]) -> str:
    """One coded unit along a straight path in words."""
    start, end = path["points"][0], next(x for x in path["points"] if x["radius"] == 1)
    step = {name: x - start["natural"][name] for name, x in end["natural"].items()}
    return f"by one coded unit {pairs(end['coded'])} coded, {pairs(step)} natural"


def _no_categories(surface: PolynomialSurface) -> str:
    """Say why there is nothing to report for each category."""
    if not surface.space.numeric.any():
        return "there is no numeric factor"
    if names := differing_curvature(surface):
        levels = f"the levels of {', '.join(names)}"
        return f"the second-order part differs between {levels}; fit one surface for each"
    count = math.prod(len(f.levels) for f in surface.space if not f.domain.is_numeric)
    return f"there are {count} combinations of categories" if count > MOST_CATEGORIES else ""


def _common(surface: PolynomialSurface, points: list[dict[str, Any]]) -> dict[str, Any]:
    """Give the stationary point where categories do not move it, with the average of its predictions."""
    if "reason" in points[0]:
        return {"reason": points[0]["reason"]}
    numeric = surface.space.numeric
    if any(np.array(e)[numeric].any() and np.array(e)[~numeric].any() for e in surface.terms.exponents):
        return {"reason": "it depends on the category; stationary_points has one for each"}
    shared = {key: value for key, value in points[0].items() if key != "category"}
    return {**shared, "predicted": float(np.mean([point["predicted"] for point in points]))}


def _canonical(surface: PolynomialSurface, category: Category | None) -> dict[str, Any]:
    view = at_category(surface, category)
    if view.terms.order < 2:
        reason = "a surface of first order has a direction of steepest ascent instead"
        return {"stationary_point": {"reason": reason}, **NO_AXES}
    try:
        canonical = canonical_analysis(surface, category)
    except RsmkitError as error:
        return {"stationary_point": {"reason": _reason(surface, error)}, **NO_AXES}
    axes = {
        "eigenvalues": canonical.eigenvalues.tolist(),
        "eigenvalue_std_errors": numbers(canonical.std_errors),
        "eigenvectors": canonical.eigenvectors.tolist(),
    }
    if canonical.kind == "ridge":
        reason = "the surface is flat along an axis: any point of a line or plane is stationary, or none"
        return {"stationary_point": {"reason": reason}, **axes}
    natural = view.from_units(canonical.stationary)
    point: dict[str, Any] = {
        "coded": _by_factor(view, canonical.stationary),
        "natural": _by_factor(view, natural),
        "kind": canonical.kind,
        "predicted": float(view.predict(natural[None])[0]),
        "inside_bounds": bool(view.space.contains(natural)),
        "inside_runs": bool((np.abs(view.box_of_runs.forward(natural[None])) <= 1 + 1e-9).all()),
    }
    if surface.fit.df and not surface.fit.exact and len(view.space) <= REGION_FACTORS:
        region = stationary_region(surface, category=category)
        point["region"] = {
            "confidence": region.confidence,
            "share_of_box_of_runs": region.share,
            "low": _by_factor(view, view.from_units(region.low)),
            "high": _by_factor(view, view.from_units(region.high)),
        }
    return {"stationary_point": point, **axes}


def _path(surface: PolynomialSurface, goal: Goal, category: Category | None) -> dict[str, Any]:
    """Ridge path of a second-order surface, straight path of steepest ascent of any other."""
    view = at_category(surface, category)
    second = view.terms.order == 2
    try:
        path = (ridge_path if second else steepest_path)(surface, RADII, goal, category)
    except RsmkitError as error:
        return {"reason": _reason(surface, error)}
    return {
        "kind": "ridge" if second else "straight",
        "points": [
            {
                "radius": radius,
                "coded": _by_factor(view, coded),
                "natural": _by_factor(view, natural),
                "predicted": predicted,
                "std_error": number(error),
                "multiplier": number(multiplier),
            }
            for radius, coded, natural, predicted, error, multiplier in zip(
                path.radii.tolist(),
                path.coded,
                path.natural,
                path.predicted.tolist(),
                path.std_errors,
                path.multipliers,
                strict=True,
            )
        ],
    }


def _by_factor(view: Quadratic, values: Floats) -> dict[str, float | None]:
    return dict(zip(view.space.names, numbers(values), strict=True))


def _reason(surface: PolynomialSurface, error: RsmkitError) -> str:
    """Its words without the response they begin with, which a report names already."""
    return str(error).removeprefix(f"{surface.response}: ")
