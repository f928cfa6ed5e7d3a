"""A surface's coefficients estimated so that a few wrong runs cannot turn them, beside least squares."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from rsmkit.errors import FitError, RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.surfaces.estimation.least_squares import two_sided_p
from rsmkit.surfaces.estimation.robust_regression import RobustFit, RobustMethod, robust_fit
from rsmkit.surfaces.models.polynomial import PolynomialSurface
from rsmkit.surfaces.reading import number, numbers
from rsmkit.surfaces.statistics.texts import short, text_table

__all__ = ["robust_estimates", "robust_report", "robust_words"]

LOW = 0.5
"""A run that counts less than this is named."""


@checked
def robust_estimates(surface: PolynomialSurface, method: RobustMethod = "mm") -> RobustFit:
    """Estimate the coefficients of a polynomial robustly.

    Parameters
    ----------
    surface : PolynomialSurface
        Not stretched.
    method : {"mm", "huber"}
        The MM estimate withstands up to half of the runs wherever they lie; Huber's only wild responses, not
        wild ones at far-out points.

    Returns
    -------
    RobustFit
        Coefficients and covariance in coded units, in the order of ``surface.names``.

    Raises
    ------
    FitError
        With too few runs, or if most runs are fitted exactly.
    """
    if surface.units == "stretched":
        raise RsmkitError(f"{surface.response}: a stretched surface has no robust estimates")
    root = np.sqrt(surface.fit.weights)
    try:
        found = robust_fit(surface.matrix * root[:, None], surface.fit.y * root, method)
    except FitError as error:
        raise FitError(f"response {surface.response}: {error}") from None
    into_coded = surface.coded_factor @ np.linalg.inv(surface.fit.factor)
    return replace(
        found,
        coefficients=into_coded @ found.coefficients,
        covariance=into_coded @ found.covariance @ into_coded.T,
    )


def robust_report(
    surface: PolynomialSurface, method: RobustMethod, rows: list[int] | None = None
) -> dict[str, Any]:
    """Robust estimates as JSON values, or why there are none; `rows` are the runs as people number them."""
    try:
        found = robust_estimates(surface, method)
    except FitError as error:
        return {"method": method, "reason": str(error).removeprefix(f"response {surface.response}: ")}
    labels = rows or list(range(1, surface.fit.n + 1))
    errors = np.sqrt(np.diag(found.covariance))
    with np.errstate(divide="ignore", invalid="ignore"):
        t = found.coefficients / errors
    columns = (found.coefficients, errors, t, two_sided_p(t, surface.fit.df))
    return {
        "method": method,
        "scale": number(found.scale),
        "terms": [
            {
                "name": name,
                **{k: number(v) for k, v in zip(("estimate", "std_error", "t", "p"), values, strict=True)},
            }
            for name, *values in zip(surface.names, *columns, strict=True)
        ],
        "weights": numbers(found.weights),
        "downweighted": [
            {"row": labels[i], "weight": float(found.weights[i])} for i in np.flatnonzero(found.weights < LOW)
        ],
    }


def robust_words(surface: PolynomialSurface, report: dict[str, Any]) -> list[str]:
    """Least squares and robust estimates side by side as lines of text."""
    head = {"huber": "Huber", "mm": "MM"}[report["method"]]
    if "reason" in report:
        return ["", f"No {head} estimate: {report['reason']}."]
    rows = [
        [row["name"], *map(short, (number(b), number(error), row["estimate"], row["std_error"], row["p"]))]
        for row, b, error in zip(report["terms"], surface.coefficients, surface.std_errors, strict=True)
    ]
    lines = text_table(["term", "least squares", "std. error", head, "std. error", "p"], rows)
    few = ", ".join(f"{row['row']} ({row['weight']:.2f})" for row in report["downweighted"])
    least = short(number(surface.fit.sigma))
    lines.append(f"{head} scale {short(report['scale'])}, least squares sigma {least}")
    lines.append(f"Rows that count less than half: {few}" if few else "Every row counts at least half")
    return ["", *lines]
