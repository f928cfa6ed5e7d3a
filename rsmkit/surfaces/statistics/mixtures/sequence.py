"""How much blending there is: linear, quadratic, special cubic and full cubic models one after the other."""

from __future__ import annotations

import math
from typing import Any, get_args

import numpy as np
from scipy.special import fdtrc

from rsmkit.errors import FitError
from rsmkit.language.exponents import Exponents
from rsmkit.language.scheffe import Blending, scheffe_terms
from rsmkit.language.terms import Terms
from rsmkit.surfaces.models.polynomial import PolynomialSurface, fit_polynomial
from rsmkit.surfaces.reading import number
from rsmkit.surfaces.statistics.mixtures.components import mixture_of
from rsmkit.surfaces.statistics.terms.anova import lack_of_fit
from rsmkit.surfaces.statistics.texts import short, text_table

__all__ = ["sequence_words", "sequential_models"]

SIGNIFICANT = 0.05
"""Level at which added terms count."""


def sequential_models(surface: PolynomialSurface) -> dict[str, Any]:
    """Scheffe models from the linear to the full cubic, each tested against the one before it.

    The sum of squares of the terms that a model adds is compared with its own residual. Terms with process
    factors are those of the surface in every model, as far as its blending terms allow. The model suggested
    is the largest whose added terms are significant at 5 %; where residuals are rounding, or no terms are,
    the one with the largest predicted R2.

    Returns
    -------
    dict
        ``models``, rows with ``model``, ``df``, ``ss``, ``F``, ``p`` of what is added, ``lack_of_fit``
        (``F``, ``p``, ``df`` or ``reason``), ``sigma``, ``r2``, ``r2_adjusted``, ``r2_predicted``,
        ``press``; or ``reason`` where it cannot be estimated. ``suggested``, or None.
    """
    data, fit = surface.data, surface.fit
    mean = float(np.average(data.y, weights=fit.weights))
    rows: list[dict[str, Any]] = [
        {"model": "mean", "df": 1, "ss": number(float(fit.weights.sum()) * mean**2)}
    ]
    before = (fit.tss, 1)
    for blending in get_args(Blending):
        try:
            found = fit_polynomial(surface.space, surface.response, data, _with_blending(surface, blending))
        except FitError as error:
            rows.append({"model": blending, "reason": str(error).partition(": ")[2]})
            continue
        df = found.fit.p - before[1]
        if not df:
            continue
        rows.append({"model": blending, **_added(found, df, before[0] - found.fit.rss), **_quality(found)})
        before = (found.fit.rss, found.fit.p)
    return {"models": rows, "suggested": _suggested(rows)}


def sequence_words(report: dict[str, Any]) -> list[str]:
    """The table of models as lines of text."""
    head = ["blending", "df", "sum of squares", "F", "p", "lack of fit p", "sigma", "R2", "adjusted",
            "predicted", "PRESS"]  # fmt: skip
    keys = ("ss", "F", "p"), ("sigma", "r2", "r2_adjusted", "r2_predicted", "press")
    rows = [
        [
            row["model"],
            str(row["df"]),
            *(short(row.get(key)) for key in keys[0]),
            short(row.get("lack_of_fit", {}).get("p")),
            *(short(row.get(key)) for key in keys[1]),
        ]
        for row in report["models"]
        if "reason" not in row
    ]
    lines = text_table(head, rows)
    gone = [row["model"] for row in report["models"] if "reason" in row]
    lines += [f"These runs cannot estimate {' and '.join(gone)} blending."] if gone else []
    lines += [f"Suggested: {report['suggested']} blending."] if report["suggested"] else []
    return lines


def _with_blending(surface: PolynomialSurface, blending: Blending) -> Terms:
    """Scheffe terms of an order, and the surface's terms with process factors whose blending it holds."""
    pure = scheffe_terms(surface.space, mixture_of(surface).components, blending)
    process = [j for j in range(pure.k) if j not in pure.components]
    kept = [e for e in pure.exponents if not any(e[j] for j in process)]

    def blends(e: Exponents) -> bool:
        inside = tuple(0 if j in process else x for j, x in enumerate(e))
        return inside in kept or not any(inside)

    more = [e for e in surface.terms.exponents if any(e[j] for j in process) and blends(e)]
    return Terms((*kept, *more), pure.levels, surface.terms.contrasts, pure.components)


def _added(found: PolynomialSurface, df: int, ss: float) -> dict[str, Any]:
    fit = found.fit
    tested = fit.df > 0 and fit.rss > 0 and not fit.exact
    f = ss / df / fit.sigma**2 if tested else math.nan
    p = float(fdtrc(df, fit.df, f)) if tested else math.nan
    return {
        "df": df,
        "ss": number(ss),
        "F": number(f),
        "p": number(p),
    }


def _quality(found: PolynomialSurface) -> dict[str, Any]:
    split, fit = lack_of_fit(found), found.fit
    lack = {"reason": split.absent}
    if split.lack is not None and split.pure is not None and not split.absent:
        lack = {"F": split.lack.f, "p": split.lack.p, "df": [split.lack.df, split.pure.df]}  # type: ignore[dict-item]
    return {
        "lack_of_fit": lack,
        "sigma": number(fit.sigma),
        "r2": number(fit.r2),
        "r2_adjusted": number(fit.r2_adjusted),
        "r2_predicted": number(fit.r2_predicted),
        "press": number(fit.press),
    }


def _suggested(rows: list[dict[str, Any]]) -> str | None:
    fitted = [row for row in rows[1:] if "reason" not in row]
    significant = [row["model"] for row in fitted if row["p"] is not None and row["p"] <= SIGNIFICANT]
    if significant:
        return str(significant[-1])
    judged = [row for row in fitted if row["r2_predicted"] is not None]
    best = max(judged, key=lambda row: row["r2_predicted"], default=None)
    return str(best["model"]) if best and best["r2_predicted"] > 0 else "mean" if judged else None
