"""Statistics of a surface of counts or of yes/no as JSON values and as text."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.special import chdtrc

from rsmkit.surfaces.estimation.counts.scoring import score
from rsmkit.surfaces.models.glm import GlmSurface
from rsmkit.surfaces.reading import number, numbers
from rsmkit.surfaces.statistics.reports.mixture_report import mixture_report, mixture_words
from rsmkit.surfaces.statistics.reports.report_words import coding_of
from rsmkit.surfaces.statistics.terms.anova import LINEAR
from rsmkit.surfaces.statistics.terms.term_tests import containing_terms, term_members
from rsmkit.surfaces.statistics.texts import columns_of, short

__all__ = ["glm_report", "glm_summary"]

CONFIDENCE = 0.95
"""Of the intervals in a report."""
DOUBTED = 0.05
"""Size of the test that judges whether the runs vary more than their distribution says."""


def glm_report(surface: GlmSurface) -> dict[str, Any]:
    """All statistics of a surface of counts; undefined numbers are None."""
    fit, y, size = surface.fit, surface.data.y, surface.size
    constant = surface.terms.has_constant or bool(surface.terms.components)
    null = score(surface.family, np.ones((fit.n, 1)), y, size)[1] if constant else None
    likelihood = surface.family.log_likelihood(y, size, surface.means)
    with np.errstate(over="ignore"):  # of a run that nothing but itself tells of
        error = math.sqrt(float((surface.loo_residuals**2).mean()))
    return {
        "response": surface.response,
        "model": "glm",
        "distribution": surface.distribution,
        "link": surface.family.link,
        "bias_reduced": surface.bias_reduced,
        "order": surface.terms.order,
        "units": surface.units,
        "coding": coding_of(surface.space),
        "runs": fit.n,
        "terms": _terms(surface),
        "deviance": surface.deviance,
        "df": fit.df,
        "null_deviance": null,
        "null_df": fit.n - 1 if null is not None else None,
        "anova_terms": _tests(surface),
        "dispersion": _dispersion(surface),
        "log_likelihood": likelihood,
        "aic": 2.0 * fit.p - 2.0 * likelihood,
        "rmse_loo": number(error),
        **(mixture_report(surface) if surface.terms.components else {}),
        "note": surface.note,
        "intervals": _intervals(surface),
        "diagnostics": _diagnostics(surface),
    }


def glm_summary(surface: GlmSurface, report: dict[str, Any]) -> str:
    """The report as text."""
    terms = {"term": "name", "estimate": "estimate", "std. error": "std_error", "z": "z", "p": "p"}
    limits = {"low": "low", "high": "high"}
    tests = {"term": "term", "df": "df", "deviance": "chi2", "p": "p"}
    spread = report["dispersion"]
    lines = [
        f"{surface.response}: {surface.distribution} surface of order {surface.terms.order}, "
        f"{surface.link_words}, {len(report['terms'])} coefficients, {surface.fit.n} runs"
        + ("; bias-reduced estimates (Firth)" if surface.bias_reduced else ""),
        "",
        *columns_of(report["terms"], terms | limits),
        "",
        "Likelihood-ratio tests, each term after all that do not contain it:",
        *columns_of(report["anova_terms"], tests),
        "",
        f"Residual deviance {short(report['deviance'])} on {report['df']} degrees of freedom, "
        f"null {short(report['null_deviance'])}; AIC {short(report['aic'])}",
    ]
    if "reason" in spread:
        lines.append(f"Dispersion not judged: {spread['reason']}.")
    else:
        lines.append(
            f"Dispersion {short(spread['estimate'])} (1 as the distribution has it): {spread['words']}."
        )
    lines += mixture_words(report) if "mixture" in report else []
    return "\n".join([*lines, *(["", f"Note: {report['note']}."] if report["note"] else [])])


def _terms(surface: GlmSurface) -> list[dict[str, Any]]:
    limits = surface.confidence_intervals(CONFIDENCE)
    columns = zip(
        surface.names, surface.groups, surface.coefficients, surface.std_errors, surface.t_values,
        surface.p_values, limits[:, 0], limits[:, 1], strict=True,
    )  # fmt: skip
    keys = ("estimate", "std_error", "z", "p", "low", "high")
    return [
        {"name": name, "group": group, **{k: number(v) for k, v in zip(keys, values, strict=True)}}
        for name, group, *values in columns
    ]


def _tests(surface: GlmSurface) -> list[dict[str, Any]]:
    """Likelihood-ratio tests of each term: after those before it, and after all that do not contain it."""
    names, members = term_members(surface)
    containing = containing_terms(surface)
    everything = np.arange(surface.fit.p)
    start = np.setdiff1d(everything, np.concatenate(members)) if members else everything
    rows, so_far = [], start
    for t, columns in enumerate(members):
        test = _linear_blending if names[t] == LINEAR else _drop
        before = test(surface, so_far, columns)
        so_far = np.concatenate([so_far, columns])
        larger = [members[u] for u in containing[t]]
        others = np.setdiff1d(everything, np.concatenate([columns, *larger]))
        second = test(surface, others, columns)
        df = len(columns) - (names[t] == LINEAR)
        rows.append({"term": names[t], "df": df, **second, "type1": before, "type2": second})
    return rows


def _drop(surface: GlmSurface, without: np.ndarray, columns: np.ndarray) -> dict[str, float | None]:
    """Fall of the deviance when columns are added to others, with its p-value."""
    lower = surface.deviance_of(np.sort(np.concatenate([without, columns])).tolist())
    upper = surface.deviance_of(np.sort(without).tolist()) if len(without) else None
    if upper is None:
        return {"chi2": None, "p": None}
    fall = max(upper - lower, 0.0)
    return {"chi2": fall, "p": float(chdtrc(len(columns), fall))}


def _linear_blending(
    surface: GlmSurface, without: np.ndarray, columns: np.ndarray
) -> dict[str, float | None]:
    """The same for the components of a mixture, which without an effect leave their sum, a constant."""
    lower = surface.deviance_of(np.sort(np.concatenate([without, columns])).tolist())
    constant = np.column_stack([np.ones(surface.fit.n), surface.matrix[:, without]])
    upper = surface.least_deviance(constant)
    fall = max(upper - lower, 0.0)
    return {"chi2": fall, "p": float(chdtrc(len(columns) - 1, fall))}


def _dispersion(surface: GlmSurface) -> dict[str, Any]:
    """Whether runs vary more than their distribution says, by Pearson's statistic."""
    if surface.fit.df == 0:
        return {"reason": "there are as many terms as runs"}
    statistic = float((surface.pearson**2).sum())
    p = float(chdtrc(surface.fit.df, statistic))
    ratio = statistic / surface.fit.df
    root = math.sqrt(ratio)
    words = "nothing speaks against the distribution"
    single = surface.distribution == "binomial" and (surface.size == 1.0).all()
    if single:  # a single trial has the variance p (1 - p) whatever the runs differ by
        p, words = math.nan, "not judged, for single trials never vary more than their distribution allows"
    elif p < DOUBTED:
        words = (
            f"the runs vary more than a {surface.distribution} distribution allows (p {short(p)}), so "
            f"standard errors should be {root:.3g} times as large (std_error_quasi)"
        )
    return {
        "estimate": ratio,
        "pearson": statistic,
        "df": surface.fit.df,
        "p": number(p),
        "over": p < DOUBTED,
        "words": words,
        "std_error_quasi": dict(zip(surface.names, (root * surface.std_errors).tolist(), strict=True)),
    }


def _intervals(surface: GlmSurface) -> dict[str, Any]:
    """Limits of the probability or rate at the runs."""
    _, low, high = surface.predict(surface.data.points, CONFIDENCE, "mean")
    return {"confidence": CONFIDENCE, "mean": {"low": numbers(low), "high": numbers(high)}}


def _diagnostics(surface: GlmSurface) -> dict[str, Any]:
    share = surface.data.y / surface.size
    signed = np.copysign(np.sqrt(np.maximum(surface.deviances, 0.0)), share - surface.means)
    with np.errstate(divide="ignore", invalid="ignore"):
        studentised = signed / np.sqrt(1.0 - surface.fit.leverages)
    return {
        "observed": numbers(share),
        "fitted": numbers(surface.means),
        "residual": numbers(share - surface.means),
        "deviance_residual": numbers(signed),
        "pearson_residual": numbers(surface.pearson),
        "leverage": numbers(surface.fit.leverages),
        "studentised": numbers(studentised),
    }
