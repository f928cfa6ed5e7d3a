"""Runs that do not fit the model, or that decide it alone, and what the model says without them.

An outlier is a run whose deleted residual is too large for the largest of n: two-sided p times n (Bonferroni)
below 0.05; after the worst is taken out the next one is judged again. A run is influential if Cook's distance
exceeds the median of F(p, n - p) (Cook, *Technometrics* 19 (1977), 15-18), and of high leverage above 3 p/n,
as R's ``influence.measures`` has it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import fdtri

from rsmkit.errors import FitError
from rsmkit.io.arguments import checked
from rsmkit.io.shown import Shown
from rsmkit.language.space import Floats
from rsmkit.surfaces.estimation.least_squares import LeastSquares, two_sided_p
from rsmkit.surfaces.models.polynomial import PolynomialSurface, fit_polynomial
from rsmkit.surfaces.reading import number
from rsmkit.surfaces.statistics.texts import short, text_table

__all__ = [
    "FlaggedRun",
    "bonferroni_p",
    "flagged_runs",
    "influence_report",
    "influence_words",
    "without_runs",
]

SIGNIFICANCE = 0.05
ROUNDING = 1e-13
"""Residual standard deviation as a share of the response that is rounding."""
MOST_SHOWN = 60
"""Runs of which a text shows every residual; of more only those that are flagged."""
MOST_OUTLIERS = 0.2
"""Share of the runs up to which outliers are taken out one after the other."""


@dataclass(frozen=True)
class FlaggedRun(Shown):
    """A run to look at.

    Parameters
    ----------
    run : int
        Its position among the runs of the surface, from 0.
    reasons : tuple of {"outlier", "influential", "leverage"}
    p_bonferroni : float
        Of the deleted residual; of an outlier that others hid, without these.
    """

    run: int
    reasons: tuple[str, ...]
    p_bonferroni: float


@checked
def flagged_runs(surface: PolynomialSurface) -> list[FlaggedRun]:
    """Name outliers, influential runs and runs of high leverage, in the order of the runs.

    None of runs in random groups, whose errors are not independent.
    """
    fit = surface.fit
    if surface.data.random or not _has_noise(fit):
        return []
    outliers = _outliers(surface)
    p, median = bonferroni_p(fit), float(fdtri(fit.p, fit.df, 0.5))
    influential = np.nan_to_num(fit.cooks_distances, nan=0.0, posinf=0.0) > median
    leverage = fit.leverages > 3.0 * fit.p / fit.n
    found = []
    for run in range(fit.n):
        signs = {"outlier": run in outliers, "influential": influential[run], "leverage": leverage[run]}
        if reasons := tuple(reason for reason, holds in signs.items() if holds):
            found.append(FlaggedRun(run, reasons, outliers.get(run, float(p[run]))))
    return found


def bonferroni_p(fit: LeastSquares) -> Floats:
    """P of every deleted residual as the largest of n, at most 1; nan where it is not defined, shape (n,)."""
    if fit.exact:
        return np.full(fit.n, np.nan)
    return np.asarray(np.minimum(1.0, fit.n * two_sided_p(fit.deleted, fit.df - 1)))


@checked
def without_runs(surface: PolynomialSurface, runs: list[int]) -> PolynomialSurface:
    """The same model fitted without some runs, given by their position from 0.

    Raises
    ------
    FitError
        If the others cannot estimate it.
    """
    data = surface.data.rows(np.setdiff1d(np.arange(len(surface.data)), runs))
    return fit_polynomial(surface.space, surface.response, data, surface.terms).refined()


def influence_report(surface: PolynomialSurface, rows: list[int] | None = None) -> dict[str, Any]:
    """Flagged runs, and the model without the outliers and influential ones, as JSON values.

    Parameters
    ----------
    surface : PolynomialSurface
    rows : list of int, optional
        Number of each run as people know it; from 1 by default.
    """
    fit, flagged = surface.fit, flagged_runs(surface)
    numbers = rows or list(range(1, fit.n + 1))
    removed = [item.run for item in flagged if set(item.reasons) & {"outlier", "influential"}]
    found: dict[str, Any] = {
        "flagged": [
            {
                "row": numbers[item.run],
                "reasons": list(item.reasons),
                "observed": number(fit.y[item.run]),
                "fitted": number(fit.fitted[item.run]),
                "residual": number(fit.residuals[item.run]),
                "deleted": number(fit.deleted[item.run]),
                "p_bonferroni": number(item.p_bonferroni),
                "cooks_distance": number(fit.cooks_distances[item.run]),
                "leverage": number(fit.leverages[item.run]),
            }
            for item in flagged
        ],
        "without": None,
    }
    if removed:
        found["without"] = {"rows": [numbers[run] for run in removed], **_without(surface, removed)}
    return found


def influence_words(
    surface: PolynomialSurface, found: dict[str, Any], rows: list[int] | None = None
) -> list[str]:
    """Residuals as a table of text, flagged rows marked, and what the model says without these."""
    fit = surface.fit
    numbers = rows or list(range(1, fit.n + 1))
    flags = {row["row"]: row for row in found["flagged"]}
    shown = [i for i in range(fit.n) if fit.n <= MOST_SHOWN or numbers[i] in flags]
    if not shown or surface.data.random or not _has_noise(fit):
        return []
    head = ["row", "observed", "fitted", "residual", "deleted", "p (Bonferroni)", "Cook", "leverage", ""]
    columns = (
        fit.y,
        fit.fitted,
        fit.residuals,
        fit.deleted,
        bonferroni_p(fit),
        fit.cooks_distances,
        fit.leverages,
    )
    lines = [
        [
            str(numbers[i]),
            *(short(number(column[i])) for column in columns),
            _flag_words(flags.get(numbers[i])),
        ]
        for i in shown
    ]
    text = ["", *(line.rstrip() for line in text_table(head, lines))]
    if without := found["without"]:
        text += ["", *_without_words(surface, without)]
    return text


def _has_noise(fit: LeastSquares) -> bool:
    """Whether residuals are more than rounding, and can be judged one by one."""
    return fit.df > 1 and fit.sigma > ROUNDING * float(np.sqrt(np.mean(fit.y**2)))


def _outliers(surface: PolynomialSurface) -> dict[int, float]:
    """Outliers by position, the worst taken out before the next is looked for, with their p."""
    runs, found = np.arange(surface.fit.n), dict[int, float]()
    while _has_noise(surface.fit) and len(found) <= MOST_OUTLIERS * (len(runs) + len(found)):
        p = np.nan_to_num(bonferroni_p(surface.fit), nan=1.0)
        worst = int(p.argmin())
        if p[worst] >= SIGNIFICANCE:
            break
        found[int(runs[worst])] = float(p[worst])
        try:
            surface = without_runs(surface, [worst])
        except FitError:
            break
        runs = np.delete(runs, worst)
    return found


def _without(surface: PolynomialSurface, runs: list[int]) -> dict[str, Any]:
    try:
        other = without_runs(surface, runs)
    except FitError as error:
        return {"reason": str(error)}
    columns = zip(other.names, other.coefficients, other.std_errors, other.p_values, strict=True)
    return {
        "sigma": number(other.fit.sigma),
        "df": other.fit.df,
        "r2": number(other.fit.r2),
        "r2_adjusted": number(other.fit.r2_adjusted),
        "r2_predicted": number(other.fit.r2_predicted),
        "terms": [
            {"name": name, "estimate": number(b), "std_error": number(error), "p": number(p)}
            for name, b, error, p in columns
        ],
    }


def _without_words(surface: PolynomialSurface, without: dict[str, Any]) -> list[str]:
    named = f"Without row{'s' * (len(without['rows']) > 1)} {', '.join(map(str, without['rows']))}"
    if "reason" in without:
        return [f"{named} the model cannot be estimated: {without['reason']}."]
    fit = surface.fit
    pairs = (
        ("R2", fit.r2, without["r2"]),
        ("predicted R2", fit.r2_predicted, without["r2_predicted"]),
        ("sigma", fit.sigma, without["sigma"]),
    )
    lines = [
        f"{named}: "
        + ", ".join(f"{name} {short(new)} (with: {short(number(old))})" for name, old, new in pairs)
    ]
    before = dict(zip(surface.names, surface.coefficients.tolist(), strict=True))
    errors = dict(zip(surface.names, surface.std_errors.tolist(), strict=True))
    moved = [
        (abs(row["estimate"] - before[row["name"]]) / errors[row["name"]], row)
        for row in without["terms"]
        if row["name"] in before and errors[row["name"]] > 0
    ]
    if moved:
        size, row = max(moved, key=lambda pair: pair[0])
        lines.append(
            f"The coefficient that moves most is that of {row['name']}: {short(row['estimate'])} instead of "
            f"{short(before[row['name']])} ({size:.2g} standard errors)"
        )
    return lines


def _flag_words(flag: dict[str, Any] | None) -> str:
    return ", ".join(flag["reasons"]) if flag else ""
