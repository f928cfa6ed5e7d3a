"""Statistics of a mixed surface as JSON values, as text, and as a table for notebooks."""

from __future__ import annotations

import math
from html import escape
from typing import Any

import numpy as np
from scipy.special import ndtri

from rsmkit.surfaces.models.mixed import MixedSurface
from rsmkit.surfaces.reading import number, numbers
from rsmkit.surfaces.statistics.equations.equations import equations
from rsmkit.surfaces.statistics.reports.mixture_report import mixture_report, mixture_words
from rsmkit.surfaces.statistics.reports.optimum_report import optimum_report
from rsmkit.surfaces.statistics.reports.report_words import (
    canonical_words,
    coding_of,
    coding_words,
    equation_words,
)
from rsmkit.surfaces.statistics.terms.mixed_tests import mixed_term_report
from rsmkit.surfaces.statistics.texts import columns_of, short

__all__ = ["mixed_html", "mixed_report", "mixed_summary"]

CONFIDENCE = 0.95
"""Of the intervals in a report."""
MOST_RUNS = 500
"""With more runs a report leaves out the limits in the groups that there are, which cost time by its cube."""
WORDS = {
    "kenward-roger": "Kenward and Roger",
    "kenward-roger-observed": "Kenward and Roger with the observed information",
    "satterthwaite": "Satterthwaite",
}


def mixed_report(surface: MixedSurface) -> dict[str, Any]:
    """All statistics of a mixed surface; undefined numbers are None."""
    mixed, fit = surface.mixed, surface.fit
    errors = fit.loo_residuals
    in_groups, in_groups_adjusted = _fit_in_groups(surface)
    total = float(((fit.y - fit.y.mean()) ** 2).sum())
    return {
        "response": surface.response,
        "model": "mixed",
        "order": surface.terms.order,
        "units": surface.units,
        "coding": coding_of(surface.space),
        "contrasts": surface.terms.contrasts if any(surface.terms.levels) else None,
        "runs": fit.n,
        "duplicates_left_out": 0,
        "random": {group.name: len(group.levels) for group in mixed.groups},
        "degrees_of_freedom": surface.method,
        "terms": _terms(surface),
        "equations": equations(surface),
        "variance_components": _components(surface),
        "variance_ratios": dict(zip(mixed.names, mixed.ratios.tolist(), strict=False)),
        "anova_terms": mixed_term_report(surface),
        "variance_covariance": [numbers(row) for row in surface.inference.variance_covariance],
        "sigma": fit.sigma,
        "r2_in_groups": number(in_groups),
        "r2_in_groups_adjusted": number(in_groups_adjusted),
        "r2": number(1.0 - float(fit.residuals @ fit.residuals) / total if total > 0 else math.nan),
        "r2_predicted": number(1.0 - fit.press / total if total > 0 else math.nan),
        "press": number(fit.press),
        "rmse_loo": number(math.sqrt(fit.press / fit.n)),
        "reml_deviance": surface.deviance,
        "log_likelihood": -0.5 * surface.deviance,
        "blups": {
            group.name: dict(zip(group.levels, effects.tolist(), strict=True))
            for group, effects in zip(mixed.groups, mixed.effects, strict=True)
        },
        **(mixture_report(surface) if surface.terms.components else {}),
        **_where_it_leads(surface),
        "note": "; ".join(filter(None, [surface.note, *_notes(surface)])),
        "intervals": _intervals(surface),
        "diagnostics": _diagnostics(surface, errors),
    }


def mixed_summary(surface: MixedSurface, report: dict[str, Any]) -> str:
    """The report as text."""
    lines = [_title(surface, report), *coding_words(report)]
    variances = {"variance": "name", "estimate": "variance", "std. error": "std_error", "low": "low"}
    variances |= {"high": "high", "share": "share"}
    terms = {
        "term": "name",
        "estimate": "estimate",
        "std. error": "std_error",
        "df": "df",
        "t": "t",
        "p": "p",
    }
    tests = {"test by term (III)": "term", "df": "df", "error df": "denominator_df", "F": "F", "p": "p"}
    for key, columns in (("variance_components", variances), ("terms", terms), ("anova_terms", tests)):
        lines += ["", *columns_of(report[key], columns)]
    lines += mixture_words(report) if "mixture" in report else []
    lines += equation_words(report)
    lines += [
        "",
        f"R2 {short(report['r2'])}, with the groups {short(report['r2_in_groups'])}   "
        f"leave-one-out error {short(report['rmse_loo'])}   "
        f"restricted deviance {short(report['reml_deviance'])}   "
        f"degrees of freedom by {WORDS[surface.method]}",
        "",
        *canonical_words(report),
    ]
    if report["note"]:
        lines += ["", f"Note: {report['note']}."]
    return "\n".join(lines)


def mixed_html(surface: MixedSurface, report: dict[str, Any]) -> str:
    """Give the coefficients as a table for notebooks."""
    keys = ("estimate", "std_error", "df", "t", "p")
    head = "".join(f"<th>{name}</th>" for name in ("term", "estimate", "std. error", "df", "t", "p"))
    rows = "".join(
        f"<tr><td>{escape(t['name'])}</td>" + "".join(f"<td>{short(t[key])}</td>" for key in keys) + "</tr>"
        for t in report["terms"]
    )
    return f"<p>{escape(_title(surface, report))}</p><table><tr>{head}</tr>{rows}</table>"


def _title(surface: MixedSurface, report: dict[str, Any]) -> str:
    groups = ", ".join(f"{count} random groups of {name}" for name, count in report["random"].items())
    return (
        f"{surface.response}: mixed surface of order {surface.terms.order}, {len(report['terms'])} "
        f"coefficients, {surface.fit.n} runs in {groups}; restricted maximum likelihood"
    )


def _terms(surface: MixedSurface) -> list[dict[str, Any]]:
    limits = surface.confidence_intervals(CONFIDENCE)
    columns = zip(
        surface.names, surface.groups, surface.coefficients, surface.std_errors, surface.adjusted_std_errors,
        surface.degrees_of_freedom, surface.t_values, surface.p_values, limits[:, 0], limits[:, 1],
        strict=True,
    )  # fmt: skip
    keys = ("estimate", "std_error", "std_error_adjusted", "df", "t", "p", "low", "high")
    return [
        {"name": name, "group": group, **{k: number(v) for k, v in zip(keys, values, strict=True)}}
        for name, group, *values in columns
    ]


def _components(surface: MixedSurface) -> list[dict[str, Any]]:
    mixed, unknown = surface.mixed, surface.inference.unknown_groups
    limits = surface.variance_intervals(CONFIDENCE)
    rows = []
    errors = np.sqrt(np.diag(surface.inference.variance_covariance))
    total, wald = float(mixed.variances.sum()), float(ndtri(0.5 + 0.5 * CONFIDENCE))
    each = zip(mixed.names, mixed.variances.tolist(), errors.tolist(), limits.tolist(), strict=True)
    for name, value, error, (low, high) in each:
        values = {
            "variance": value,
            "sd": math.sqrt(value),
            "low": low,
            "high": high,
            "std_error": error,
            "wald_low": value - wald * error,
            "wald_high": value + wald * error,
            "share": value / total if not unknown else math.nan,
        }
        known = name not in unknown
        rows.append({"name": name} | {key: number(x) if known else None for key, x in values.items()})
    return rows


def _fit_in_groups(surface: MixedSurface) -> tuple[float, float]:
    """Share of the variation that terms and estimated group effects explain, and adjusted for the terms."""
    fit, mixed = surface.fit, surface.mixed
    shifts = sum((z @ u for z, u in zip(mixed.columns, mixed.effects, strict=True)), np.zeros(fit.n))
    rest = fit.residuals - shifts / np.sqrt(fit.weights)
    total = float(fit.weights @ (fit.y - np.average(fit.y, weights=fit.weights)) ** 2)
    if total <= 0:
        return math.nan, math.nan
    left = float(fit.weights @ rest**2) / total
    spare = fit.n - fit.p
    return 1.0 - left, 1.0 - left * (fit.n - 1) / spare if spare else math.nan


def _notes(surface: MixedSurface) -> list[str]:
    """Say in words what the numbers alone do not."""
    mixed, unknown = surface.mixed, surface.inference.unknown_groups
    zero = [name for name in mixed.boundary if name not in unknown]
    notes = []
    if zero:
        listed = " and ".join(zero)
        notes.append(
            f"the estimated variance of {listed} is zero: groups differ no more than runs within them do"
            + (", so the coefficients are those of ordinary least squares" if not any(mixed.ratios) else "")
        )
    if surface.inference.unknown.size:
        untested = [row["term"] for row in mixed_term_report(surface) if "reason" in row]
        what = f"no test of {', '.join(untested)}" if untested else "no standard error of some coefficients"
        notes.append(f"{what}: {surface.inference.refusal}")
    return notes


def _where_it_leads(surface: MixedSurface) -> dict[str, Any]:
    """Stationary point and paths, without standard errors where a variance is unknown."""
    found = optimum_report(surface)
    if surface.inference.unknown.size:
        found["eigenvalue_std_errors"] = [None] * len(found["eigenvalues"] or ()) or None
        for place in (found["stationary_point"], *found.get("stationary_points", [])):
            place.pop("region", None)
        for path in (found["ascent"], found["descent"]):
            for part in path.get("by_category", [path]):
                part["points"] = [{**point, "std_error": None} for point in part.get("points", [])]
    return found


def _intervals(surface: MixedSurface) -> dict[str, Any]:
    """Limits at the runs: of the mean, and of a run in new groups and in those of the run."""
    points, found = surface.data.points, dict[str, Any]()
    _, mean_low, mean_high = surface.predict(points, interval=CONFIDENCE, kind="mean")
    _, low, high = surface.predict(points, interval=CONFIDENCE)
    found["mean"] = {"low": numbers(mean_low), "high": numbers(mean_high)}
    found["prediction"] = {"low": numbers(low), "high": numbers(high)}
    if surface.fit.n <= MOST_RUNS:
        found["in_same_groups"] = _within_groups(surface)
    return {"confidence": CONFIDENCE, **found}


def _within_groups(surface: MixedSurface) -> dict[str, Any]:
    groups = surface.mixed.groups
    limits = np.empty((surface.fit.n, 2))
    kinds = np.column_stack([group.index for group in groups])
    for combination in np.unique(kinds, axis=0):
        rows = np.nonzero((kinds == combination).all(axis=1))[0]
        named = {group.name: group.levels[i] for group, i in zip(groups, combination, strict=True)}
        _, low, high = surface.predict_in(surface.data.points[rows], named, CONFIDENCE)
        limits[rows] = np.column_stack([low, high])
    return {"low": numbers(limits[:, 0]), "high": numbers(limits[:, 1])}


def _diagnostics(surface: MixedSurface, errors: np.ndarray) -> dict[str, Any]:
    """Residuals about the fixed part, and about the fixed part with the groups."""
    fit, mixed = surface.fit, surface.mixed
    shifts = sum(e[group.index] for e, group in zip(mixed.effects, mixed.groups, strict=True))
    conditional = fit.residuals - shifts
    spread = np.sqrt(
        sum(
            v * np.square(z).sum(axis=1)
            for v, z in zip(mixed.variances, (*mixed.columns, np.eye(fit.n)), strict=True)
        )
    )
    return {
        "observed": numbers(fit.y),
        "fitted": numbers(fit.fitted),
        "fitted_conditional": numbers(fit.y - conditional),
        "residual": numbers(fit.residuals),
        "residual_conditional": numbers(conditional),
        "leverage": numbers(fit.leverages),
        "loo_residual": numbers(errors),
        "studentised": numbers(np.sqrt(fit.weights) * fit.residuals / spread),
    }
