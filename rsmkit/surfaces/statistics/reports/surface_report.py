"""Statistics of polynomial surfaces as JSON values, as text, and as a table for notebooks."""

from __future__ import annotations

import math
from html import escape
from typing import Any

import numpy as np

from rsmkit.errors import RsmkitError
from rsmkit.surfaces.estimation.stretch import FAMILIES
from rsmkit.surfaces.models.box_cox import box_cox, box_cox_curve
from rsmkit.surfaces.models.polynomial import PolynomialSurface
from rsmkit.surfaces.models.stretched import StretchedSurface
from rsmkit.surfaces.reading import number, numbers
from rsmkit.surfaces.statistics.collinearity import variance_inflation
from rsmkit.surfaces.statistics.equations.equations import equations, natural_terms
from rsmkit.surfaces.statistics.intervals import simultaneous_band, tolerance_interval
from rsmkit.surfaces.statistics.reports.anova_table import anova_table
from rsmkit.surfaces.statistics.reports.fit_figures import (
    about_zero,
    adequate_precision,
    durbin_watson,
    total_about_mean,
)
from rsmkit.surfaces.statistics.reports.mixture_report import (
    blending_report,
    equations_of_mixture,
    mixture_report,
    mixture_words,
)
from rsmkit.surfaces.statistics.reports.optimum_report import NO_PATH, optimum_report
from rsmkit.surfaces.statistics.reports.report_words import (
    canonical_words,
    coding_of,
    coding_words,
    coefficient_table,
    equation_words,
    model_words,
)
from rsmkit.surfaces.statistics.terms.anova import (
    Row,
    lack_of_fit,
    overall_test,
    partial_anova,
    sequential_anova,
)
from rsmkit.surfaces.statistics.terms.effects import effects, standardised_coefficients
from rsmkit.surfaces.statistics.terms.term_tests import term_report, term_words
from rsmkit.surfaces.statistics.texts import short, text_table
from rsmkit.surfaces.statistics.two_level.dispersion import dispersion_report
from rsmkit.surfaces.statistics.two_level.lenth import screening_report, screening_words
from rsmkit.surfaces.statistics.two_level.two_levels import curvature_report, curvature_words

__all__ = [
    "polynomial_html",
    "polynomial_report",
    "polynomial_summary",
    "stretched_html",
    "stretched_report",
    "stretched_summary",
    "stretched_words",
]

CONFIDENCE = 0.95
"""Of the intervals in a report; of tolerance intervals the share of runs, too."""
STRETCHED = "the surface is stretched"
POWERS = [0.25 * i - 2.0 for i in range(17)]
"""At which the curve of Box and Cox is shown, and as far on as the best one lies."""
MOST_RUNS = 2_000
"""With more runs a report leaves out the intervals at each of them, which cost time by its square."""


def polynomial_report(surface: PolynomialSurface) -> dict[str, Any]:
    """All statistics of a polynomial surface; undefined numbers are None."""
    fit = surface.fit
    anova = {row.source: _row(row) for row in _whole_anova(surface)}
    return {
        "response": surface.response,
        "model": "polynomial",
        "order": surface.terms.order,
        "units": surface.units,
        "coding": coding_of(surface.space),
        "contrasts": surface.terms.contrasts if any(surface.terms.levels) else None,
        "runs": fit.n,
        "duplicates_left_out": surface.data.duplicates,
        "terms": _terms(surface),
        **_other_units(surface),
        "sigma": number(fit.sigma),
        "sigma_units": surface.response,
        "df": fit.df,
        "r2": number(fit.r2),
        "r2_adjusted": number(fit.r2_adjusted),
        "r2_predicted": number(fit.r2_predicted),
        "press": number(fit.press),
        **_weighted(surface),
        "press_units": f"{surface.response}^2",
        "rmse_loo": number(math.sqrt(fit.press / fit.n)),
        "log_likelihood": number(fit.log_likelihood),
        "aic": number(fit.aic),
        "aicc": number(fit.aicc),
        "bic": number(fit.bic),
        "model_test": _model_test(surface),
        "about_zero": about_zero(surface),
        "adequate_precision": number(adequate_precision(surface)),
        "durbin_watson": number(durbin_watson(surface)),
        "anova": anova,
        "anova_table": anova_table(surface, anova),
        "anova_partial": {row.source: _row(row) for row in partial_anova(surface)},
        "anova_terms": term_report(surface) if surface.units != "stretched" else None,
        "lack_of_fit": _lack_of_fit(surface),
        **_where_factors_lead(surface),
        "box_cox": _box_cox(surface),
        "note": "; ".join(filter(None, [surface.note, _exactness(surface)])),
        "intervals": _intervals(surface),
        "diagnostics": {
            "observed": numbers(fit.y),
            "fitted": numbers(fit.fitted),
            "residual": numbers(fit.residuals),
            "leverage": numbers(fit.leverages),
            "loo_residual": numbers(fit.loo_residuals),
            "studentised": numbers(fit.studentised),
            "deleted": numbers(fit.deleted),
            "cooks_distance": numbers(fit.cooks_distances),
            "dffits": numbers(fit.dffits),
        },
    }


def stretched_report(surface: StretchedSurface) -> dict[str, Any]:
    """Report of a stretched surface: tests joint with the stretch, PRESS with the stretch chosen anew."""
    report = polynomial_report(surface)
    fit, press = surface.fit, surface.nested_press
    count = fit.p - len(surface.theta)
    total = float(((fit.y - fit.y.mean()) ** 2).sum())
    for key in ("press_weighted", "r2_predicted_weighted"):  # those of the stretch kept; see `press`
        report.pop(key, None)
    return {
        **report,
        "model": "stretched",
        "terms": report["terms"][:count],
        "press": press,
        "r2_predicted": number(1.0 - press / total if total > 0 else math.nan),
        "rmse_loo": math.sqrt(press / fit.n),
        "model_test": None,
        "anova": report["anova_partial"],
        "anova_terms": None,
        "curvature": {"reason": STRETCHED},
        "screening": {"reason": STRETCHED},
        "dispersion": {"reason": STRETCHED},
        "anova_table": None,
        "inference": "joint with the stretch, whose parameters count in the degrees of freedom; t, F, p are "
        "score tests, so t is not the estimate over its standard error",
        "stretch": {
            "adopted": surface.adopted,
            "rmse_loo_plain": math.sqrt(surface.plain_press / fit.n),
            "factors": _stretched_factors(surface),
        },
    }


def _stretched_factors(surface: StretchedSurface) -> dict[str, Any]:
    limits = iter(surface.intervals_of_theta())
    found: dict[str, Any] = {}
    for name, member in zip(surface.space.names, surface.coordinates.stretches, strict=True):
        if member.family == "identity":
            continue
        family = FAMILIES[member.family]
        found[name] = {"family": member.family, "formula": member.expression, "parameters": {}}
        for parameter, value, identity in zip(
            family.parameters, member.parameters, family.identity, strict=True
        ):
            low, high = next(limits)
            found[name]["parameters"][parameter] = {
                "estimate": value,
                "low": number(low),
                "high": number(high),
                "identity": identity,
                "identity_excluded": bool(identity < low or identity > high),
            }
    return found


def stretched_words(surface: StretchedSurface) -> str:
    """Say which factors were stretched, how, and what it bought."""
    parts = []
    for name, factor in _stretched_factors(surface).items():
        values = ", ".join(f"{key} = {p['estimate']:.3g}" for key, p in factor["parameters"].items())
        parts.append(f"{name} ({factor['formula'] or factor['family']}{': ' if values else ''}{values})")
    plain, own = (math.sqrt(press / surface.fit.n) for press in (surface.plain_press, surface.nested_press))
    bought = f"leave-one-out error {short(own)} instead of {short(plain)}"
    verdict = "adopted" if surface.adopted else "not enough to adopt it"
    return f"stretched {', '.join(parts)}: {bought}, {verdict}"


def polynomial_summary(surface: PolynomialSurface, report: dict[str, Any], more: str = "") -> str:
    """The report as text; `more` goes into the line that says what was fitted.

    A report whose ``details`` are False shows of a model of many terms the largest alone.
    """
    details = report.get("details", True)
    lines = [f"{surface.response}: {model_words(surface, report)}{more}", *coding_words(report), ""]
    lines += coefficient_table(report, details=details)
    lines += equation_words(report, details=details)
    lines += [
        "",
        f"R2 {short(report['r2'])}   adjusted {short(report['r2_adjusted'])}   "
        f"predicted {short(report['r2_predicted'])}   PRESS {short(report['press'])} "
        f"({report['press_units']})   sigma {short(report['sigma'])} ({report['sigma_units']}) on "
        f"{report['df']} degrees of freedom",
    ]
    if "press_weighted" in report:
        lines.append(
            f"PRESS counts every run alike; weighted like the rest: predicted "
            f"{short(report['r2_predicted_weighted'])}   PRESS {short(report['press_weighted'])}"
        )
    if test := report["model_test"]:
        lines.append(
            f"All terms at once: F {short(test['F'])} on {test['df'][0]} and {test['df'][1]} degrees of "
            f"freedom, p {short(test['p'])}"
        )
    lines.append("")
    rows = report["anova_table"] or [{"source": source, **row} for source, row in report["anova"].items()]
    lines += text_table(
        ["source", "df", "sum of squares", "mean square", "F", "p"],
        [
            [row["source"], str(row["df"]), *(short(row[key]) for key in ("ss", "ms", "F", "p"))]
            for row in rows
        ],
    )
    lines += term_words(surface, report)
    lines += mixture_words(report) if "mixture" in report else []
    if "reason" in report["lack_of_fit"]:
        lines += ["", f"Lack of fit not tested: {report['lack_of_fit']['reason']}."]
    lines += curvature_words(report["curvature"])
    lines += screening_words(report["screening"], report["df"])
    lines += ["", *canonical_words(report, details=details)]
    if report["note"]:
        lines += ["", f"Note: {report['note']}."]
    return "\n".join(lines)


def stretched_summary(surface: StretchedSurface, report: dict[str, Any]) -> str:
    """The report as text, with what the stretch bought."""
    return polynomial_summary(surface, report, f"; {stretched_words(surface)}")


def polynomial_html(surface: PolynomialSurface, report: dict[str, Any], more: str = "") -> str:
    """Give the coefficients as a table for notebooks."""
    head = "<tr><th>term</th><th>estimate</th><th>std. error</th><th>t</th><th>p</th></tr>"
    rows = "".join(
        f"<tr><td>{escape(t['name'])}</td>"
        + "".join(f"<td>{short(t[key])}</td>" for key in ("estimate", "std_error", "t", "p"))
        + "</tr>"
        for t in report["terms"]
    )
    title = f"<b>{escape(surface.response)}</b>: {escape(model_words(surface, report) + more)}"
    fit = f"R2 {short(report['r2'])}, predicted {short(report['r2_predicted'])}"
    return f"<p>{title}; {fit}</p><table>{head}{rows}</table>"


def stretched_html(surface: StretchedSurface, report: dict[str, Any]) -> str:
    """Give the coefficients as a table for notebooks, with what the stretch bought."""
    return polynomial_html(surface, report, f"; {stretched_words(surface)}")


def _terms(surface: PolynomialSurface) -> list[dict[str, Any]]:
    limits = surface.confidence_intervals()
    columns = zip(
        surface.names, surface.groups, surface.coefficients, surface.std_errors, surface.t_values,
        surface.p_values, limits[:, 0], limits[:, 1], variance_inflation(surface), effects(surface),
        standardised_coefficients(surface), strict=True,
    )  # fmt: skip
    keys = ("estimate", "std_error", "t", "p", "low", "high", "vif", "effect", "standardised")
    rows = [
        {"name": name, "group": group, **{k: number(v) for k, v in zip(keys, values, strict=True)}}
        for name, group, *values in columns
    ]
    for row in rows:
        known = row["effect"] is not None and row["std_error"] is not None and row["estimate"]
        scale = abs(row["effect"] / row["estimate"]) if known else math.nan
        row["effect_std_error"] = number(scale * row["std_error"] if known else math.nan)
    return rows


def _where_factors_lead(surface: PolynomialSurface) -> dict[str, Any]:
    """What single factors do and where they lead; components of a mixture move together instead."""
    if surface.terms.components:
        refused = {key: {"reason": NO_PATH} for key in ("curvature", "screening", "dispersion")}
        found = {**refused, **mixture_report(surface), **blending_report(surface)}
    else:
        found = {
            "curvature": curvature_report(surface),
            "screening": screening_report(surface),
            "dispersion": dispersion_report(surface),
        }
    return {**found, **optimum_report(surface)}


def _other_units(surface: PolynomialSurface) -> dict[str, Any]:
    """Coefficients in natural units and the equations; a stretched surface has none in natural units."""
    if surface.units == "stretched":
        return {
            "terms_natural": None,
            "equations": {"reason": f"the surface is a polynomial in {surface.units} units"},
        }
    found = equations(surface)
    if surface.terms.components:
        found |= equations_of_mixture(surface)
    return {"terms_natural": natural_terms(surface), "equations": found}


def _whole_anova(surface: PolynomialSurface) -> list[Row]:
    split = lack_of_fit(surface)
    return [*sequential_anova(surface), *(row for row in (split.lack, split.pure) if row)]


def _row(row: Row) -> dict[str, Any]:
    return {"df": row.df, "ss": number(row.ss), "ms": number(row.ms), "F": number(row.f), "p": number(row.p)}


def _model_test(surface: PolynomialSurface) -> dict[str, Any]:
    row = overall_test(surface)
    return {"F": number(row.f), "p": number(row.p), "df": [row.df, surface.fit.df]}


def _weighted(surface: PolynomialSurface) -> dict[str, Any]:
    """Leave-one-out figures with the weights of the fit, beside those with every run counted alike."""
    fit = surface.fit
    if surface.data.weights is None:
        return {}
    return {
        "press_weighted": number(fit.press_weighted),
        "r2_predicted_weighted": number(fit.r2_predicted_weighted),
    }


def _exactness(surface: PolynomialSurface) -> str:
    """Warn where residuals are rounding errors, as R does of an essentially perfect fit."""
    if not surface.fit.exact:
        return ""
    return "the residuals are rounding errors: standard errors mean nothing, and there are no t, F and p"


def _lack_of_fit(surface: PolynomialSurface) -> dict[str, Any]:
    split = lack_of_fit(surface)
    if split.lack is None or split.pure is None or split.absent:
        return {"reason": split.absent}
    best = number(1.0 - split.pure.ss / total if (total := total_about_mean(surface)) > 0 else math.nan)
    return {"F": split.lack.f, "p": split.lack.p, "df": [split.lack.df, split.pure.df], "largest_r2": best}


def _box_cox(surface: PolynomialSurface) -> dict[str, Any]:
    try:
        found = box_cox(surface)
    except RsmkitError as error:
        return {"reason": str(error)}
    beyond = [sign * (2.0 + 0.25 * i) for sign in (-1.0, 1.0) for i in range(1, 13)]
    powers = sorted(
        [*POWERS, *(p for p in beyond if abs(p) < abs(found.power) + 0.5 and p * found.power > 0)]
    )
    return {
        "power": found.power,
        "low": number(found.low),
        "high": number(found.high),
        "confidence": found.confidence,
        "needed": found.needed,
        "curve": {"power": powers, "sse": numbers(box_cox_curve(surface, np.array(powers)))},
    }


def _intervals(surface: PolynomialSurface) -> dict[str, Any]:
    """Limits at the runs."""
    points, found = surface.data.points, dict[str, Any]()
    if surface.judge.fit.df == 0:
        return {"reason": "no degrees of freedom left"}
    if len(points) > MOST_RUNS:
        return {"reason": f"more than {MOST_RUNS:,} runs; Surface.predict gives them at any point"}
    for name, (_, low, high) in {
        "mean": surface.predict(points, interval=CONFIDENCE, kind="mean"),
        "simultaneous": simultaneous_band(surface, points, CONFIDENCE),
        "prediction": surface.predict(points, interval=CONFIDENCE),
        "jackknife+": surface.predict(points, interval=CONFIDENCE, kind="jackknife+"),
        "tolerance": tolerance_interval(surface, points, CONFIDENCE, CONFIDENCE),
    }.items():
        found[name] = {"low": numbers(low), "high": numbers(high)}
    return {"confidence": CONFIDENCE, **found}
