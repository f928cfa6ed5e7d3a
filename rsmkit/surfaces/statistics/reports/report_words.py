"""The report of a polynomial surface in words and tables of text."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Mapping
from typing import Any

from rsmkit.language.space import Space
from rsmkit.surfaces.models.polynomial import PolynomialSurface
from rsmkit.surfaces.statistics.reports.mixture_report import mixture_title, mixture_units
from rsmkit.surfaces.statistics.reports.optimum_report import category_words
from rsmkit.surfaces.statistics.texts import pairs, short, text_table

__all__ = [
    "canonical_words",
    "coding_of",
    "coding_words",
    "coefficient_table",
    "equation_words",
    "model_words",
    "wrapped",
]

WIDTH = 110
"""Characters of a line of words; tables may be wider."""
UNBROKEN = "\xa0"
"""A blank at which a line is not broken."""
CONTRASTS = {
    "treatment": "each level after the first less the first",
    "sum": "each level before the last less the average of all",
}
MIXTURE_EQUATIONS = {"coded": "proportions", "natural": "amounts", "pseudo": "pseudo"}
MANY_COEFFICIENTS = 40
"""Beyond so many a short text shows the largest alone."""
SHOWN = 20
"""Coefficients, besides the constant, in a short text of a model with many."""
MANY_FACTORS = 8
"""Beyond so many a short text leaves out the axes of the surface."""
MANY_CATEGORIES = 12
"""Beyond so many a short text leaves out the equations by category."""


def model_words(surface: PolynomialSurface, report: Mapping[str, Any]) -> str:
    """Order, units, and numbers of coefficients and of runs."""
    if surface.terms.components:
        return mixture_title(surface, report)
    words = {1: "first-order", 2: "second-order", 3: "third-order"}
    order = words.get(surface.terms.order, f"order-{surface.terms.order}")
    units = "the factors' own" if _as_they_are(report) else surface.units
    text = f"{order} surface in {units} units, {len(report['terms'])} coefficients, {surface.fit.n} runs"
    if surface.data.duplicates:
        text += f" ({surface.data.duplicates} exact repetitions counted once)"
    return text


def coding_words(report: Mapping[str, Any]) -> list[str]:
    """Units of the coefficients, unless those of the columns; what coefficients of categories compare."""
    lines = wrapped(mixture_units(report), lists=True) if "mixture" in report else []
    if report["units"] == "coded" and not _as_they_are(report):
        codes = _numeric_coding(report).items()
        texts = (f"({name} - {x['center']:.6g})/{x['half_range']:.6g}" for name, x in codes)
        lines += wrapped(f"coded units: {', '.join(texts)}", lists=True)
    if contrasts := report.get("contrasts"):
        lines.append(f"categories: {CONTRASTS[contrasts]} ({contrasts} contrasts)")
    return lines


def coefficient_table(report: Mapping[str, Any], *, details: bool) -> list[str]:
    """Coefficients with their tests; of very many only the largest, unless details are wanted."""
    terms, hidden = list(report["terms"]), []
    if len(terms) > MANY_COEFFICIENTS and not details:
        key = "estimate" if any(term["t"] is None for term in terms) else "t"
        ranked = sorted(terms, key=lambda term: (term["group"] != "", -abs(term[key] or 0.0)))
        kept = {term["name"] for term in ranked[: SHOWN + 1]}
        hidden = [term for term in terms if term["name"] not in kept]
        largest = max(abs(term[key] or 0.0) for term in hidden)
        terms = [term for term in terms if term["name"] in kept]
    keys = ("estimate", "std_error", "t", "p", "vif", *(() if "mixture" in report else ("effect",)))
    lines = text_table(
        ["term", "estimate", "std. error", "t", "p", "VIF", *(key for key in keys if key == "effect")],
        [[term["name"], *(short(term[key]) for key in keys)] for term in terms],
    )
    if hidden:
        bound = f"|{key}| of at most {short(largest)}"
        lines.append(f"... and {len(hidden)} more with {bound}; --details shows all")
    return lines


def equation_words(report: Mapping[str, Any], *, details: bool = True) -> list[str]:
    """Equations in coded and in natural units, and for each category."""
    found = report["equations"]
    if "reason" in found or (len(report["terms"]) > MANY_COEFFICIENTS and not details):
        return []
    labels = {"natural": "natural"} if _as_they_are(report) else {"coded": "coded", "natural": "natural"}
    if "mixture" in report:
        labels = {key: label for key, label in MIXTURE_EQUATIONS.items() if key in found}
        if found["coded"] == found["natural"]:  # amounts are proportions
            del labels["natural"]
    width = max(map(len, labels.values())) + 2

    def both(equations: Mapping[str, str]) -> list[str]:
        return [
            line
            for key, label in labels.items()
            if key in equations
            for line in wrapped(f"  {label + ':':{width}}{equations[key]}", indent=width + 4)
        ]

    blocks = " (average of the blocks)" if any(t["group"] == "block" for t in report["terms"]) else ""
    lines = ["", f"Equation{'s' if len(labels) > 1 else ''}{blocks}", *both(found)]
    lines += [f"  ({found['note']})"] if "note" in found else []
    categories = found.get("by_category", [])
    if "reason" in categories or (len(categories) > MANY_CATEGORIES and not details):
        return lines
    for row in categories:
        lines += [", ".join(f"{name} = {level}" for name, level in row["category"].items()), *both(row)]
    return lines


def canonical_words(report: Mapping[str, Any], *, details: bool = True) -> list[str]:
    """Stationary point and axes, or the direction of steepest ascent."""
    if "stationary_points" in report:
        return category_words(report)
    point, ascent = report["stationary_point"], report["ascent"]
    if "reason" in point:
        lines = [f"No stationary point: {point['reason']}."]
        if ascent.get("kind") == "straight":
            start, end = ascent["points"][0], next(x for x in ascent["points"] if x["radius"] == 1)
            step = {name: x - start["natural"][name] for name, x in end["natural"].items()}
            words = f"Steepest ascent by one coded unit: {pairs(end['coded'])} coded; {pairs(step)} natural"
            lines += wrapped(words, lists=True)
        return lines
    place = "inside the bounds" if point["inside_bounds"] else "inside the box of the runs"
    place = place if point["inside_bounds"] or point["inside_runs"] else "outside the runs: extrapolated"
    lines = [
        *wrapped(
            f"Stationary point ({point['kind']}, {place}): {pairs(point['natural'])}; "
            f"predicted {short(point['predicted'])}",
            lists=True,
        ),
        *wrapped(f"in {_units_of(report)}: {pairs(point['coded'])}", lists=True),
        "",
    ]
    values, errors = report["eigenvalues"], report["eigenvalue_std_errors"]
    if len(values) > MANY_FACTORS and not details:
        ends = f"{short(values[-1])} to {short(values[0])}"
        return [*lines, f"{len(values)} eigenvalues from {ends}; --details shows them with their axes"]
    axes = zip(values, errors, zip(*report["eigenvectors"], strict=True), strict=True)
    return lines + text_table(
        ["eigenvalue", "std. error", *point["coded"]],
        [[short(value), short(error), *map(short, vector)] for value, error, vector in axes],
    )


def wrapped(text: str, indent: int = 2, *, lists: bool = False) -> list[str]:
    """Lines of words, each after the first indented.

    Nothing is broken but at blanks; with `lists` at those after a comma, semicolon or colon alone.
    """
    kept = re.sub("(?<![,;:]) ", UNBROKEN, text) if lists else re.sub(r"(?<= [+-]) ", UNBROKEN, text)
    lines = textwrap.wrap(
        kept, WIDTH, subsequent_indent=" " * indent, break_long_words=False, break_on_hyphens=False
    )
    return [line.replace(UNBROKEN, " ") for line in lines]


def _units_of(report: Mapping[str, Any]) -> str:
    return "proportions" if report["units"] == "proportions" else f"{report['units']} units"


def coding_of(space: Space) -> dict[str, Any]:
    """How the factors of a report are coded: centre and half range, or the categories."""
    return {
        f.name: {"center": f.center, "half_range": f.half_range} if f.domain.is_numeric else list(f.levels)
        for f in space
    }


def _numeric_coding(report: Mapping[str, Any]) -> dict[str, Any]:
    return {name: x for name, x in report["coding"].items() if isinstance(x, dict)}


def _as_they_are(report: Mapping[str, Any]) -> bool:
    """Whether coded units are those of the columns."""
    codes = _numeric_coding(report).values()
    return report["units"] == "coded" and all((x["center"], x["half_range"]) == (0, 1) for x in codes)
