"""The part of a report that says where a polynomial surface leads: stationary point, axes, paths."""

from __future__ import annotations

from typing import Any

import numpy as np

from rsmkit.errors import RsmkitError
from rsmkit.language.space import Floats
from rsmkit.surfaces.models.polynomial import PolynomialSurface
from rsmkit.surfaces.reading import numbers
from rsmkit.surfaces.statistics.canonical import canonical_analysis, stationary_region
from rsmkit.surfaces.statistics.ridge import Goal, ridge_path, steepest_path

__all__ = ["optimum_report"]

RADII = np.r_[np.arange(0.0, 2.0, 0.25), np.arange(2.0, 5.01, 0.5)]
"""Distances from the centre in coded units along the paths."""
REGION_FACTORS = 6
"""Up to so many factors the report holds the region of the stationary point; beyond, it costs seconds."""


def optimum_report(surface: PolynomialSurface) -> dict[str, Any]:
    """Stationary point, eigenvalues, eigenvectors, and the paths of ascent and descent, as JSON values."""
    return {
        **_canonical(surface),
        "ascent": _path(surface, "maximize"),
        "descent": _path(surface, "minimize"),
    }


def _canonical(surface: PolynomialSurface) -> dict[str, Any]:
    nothing = dict.fromkeys(("eigenvalues", "eigenvalue_std_errors", "eigenvectors"))
    if surface.terms.order < 2:
        reason = "a surface of first order has a direction of steepest ascent instead"
        return {"stationary_point": {"reason": reason}, **nothing}
    try:
        canonical = canonical_analysis(surface)
    except RsmkitError as error:
        return {"stationary_point": {"reason": _reason(surface, error)}, **nothing}
    axes = {
        "eigenvalues": canonical.eigenvalues.tolist(),
        "eigenvalue_std_errors": numbers(canonical.std_errors),
        "eigenvectors": canonical.eigenvectors.tolist(),
    }
    if canonical.kind == "ridge":
        reason = "the surface is flat along an axis: any point of a line or plane is stationary, or none"
        return {"stationary_point": {"reason": reason}, **axes}
    names, natural = surface.space.names, surface.from_units(canonical.stationary)
    point: dict[str, Any] = {
        "coded": _by_factor(surface, canonical.stationary),
        "natural": _by_factor(surface, natural),
        "kind": canonical.kind,
        "predicted": float(surface.predict(natural[None])[0]),
        "inside_bounds": bool(surface.space.contains(natural)),
        "inside_runs": bool((np.abs(surface.box_of_runs.forward(natural[None])) <= 1 + 1e-9).all()),
    }
    if surface.fit.df and surface.fit.rss > 0 and len(names) <= REGION_FACTORS:
        region = stationary_region(surface)
        point["region"] = {
            "confidence": region.confidence,
            "share_of_box_of_runs": region.share,
            "low": _by_factor(surface, surface.from_units(region.low)),
            "high": _by_factor(surface, surface.from_units(region.high)),
        }
    return {"stationary_point": point, **axes}


def _path(surface: PolynomialSurface, goal: Goal) -> dict[str, Any]:
    """Ridge path of a second-order surface, straight path of steepest ascent of any other."""
    second = surface.terms.order == 2
    try:
        path = (ridge_path if second else steepest_path)(surface, RADII, goal)
    except RsmkitError as error:
        return {"reason": _reason(surface, error)}
    return {
        "kind": "ridge" if second else "straight",
        "points": [
            {
                "radius": radius,
                "coded": _by_factor(surface, coded),
                "natural": _by_factor(surface, natural),
                "predicted": predicted,
                "std_error": numbers(np.array([error]))[0],
            }
            for radius, coded, natural, predicted, error in zip(
                path.radii.tolist(),
                path.coded,
                path.natural,
                path.predicted.tolist(),
                path.std_errors,
                strict=True,
            )
        ],
    }


def _by_factor(surface: PolynomialSurface, values: Floats) -> dict[str, float | None]:
    return dict(zip(surface.space.names, numbers(values), strict=True))


def _reason(surface: PolynomialSurface, error: RsmkitError) -> str:
    """Its words without the response they begin with, which a report names already."""
    return str(error).removeprefix(f"{surface.response}: ")
