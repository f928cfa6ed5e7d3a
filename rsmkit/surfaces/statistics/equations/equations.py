"""The fitted polynomial written out: in coded and in natural units, and once per category."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
from scipy.special import stdtrit

from rsmkit.language.exponents import Exponents, hierarchical_closure, monomials
from rsmkit.language.scheffe import movable
from rsmkit.language.space import Floats, Space
from rsmkit.language.terms import Terms
from rsmkit.surfaces.estimation.coordinates import Coordinates, conversion
from rsmkit.surfaces.estimation.least_squares import two_sided_p
from rsmkit.surfaces.models.polynomial import PolynomialSurface
from rsmkit.surfaces.reading import number

__all__ = [
    "DOUBLE",
    "NaturalPolynomial",
    "categories",
    "digits_needed",
    "equation_in",
    "equations",
    "natural_polynomial",
    "natural_terms",
    "terms_in",
    "with_levels",
]

DIGITS = 5
"""Of the spread of the fitted values: what the predictions of an equation are right to."""
DOUBLE = 15
"""Digits with which an equation can be evaluated."""
ROUNDING = 1e-13
"""Sum of coefficients, as a share of their sizes, that is rounding and nothing else."""
MOST_CATEGORIES = 60
"""Combinations of categories up to which each has its equation."""


@dataclass(frozen=True)
class NaturalPolynomial:
    """The fitted polynomial in natural units.

    Parameters
    ----------
    terms : Terms
        Those of the surface; in a model without hierarchy also those they contain, because a shift of the
        origin brings them in.
    coefficients : array, shape (p,)
        Block effects averaged, as in predictions.
    factor : array, shape (p, m)
        ``sigma^2 factor factor'`` is their covariance.
    """

    terms: Terms
    coefficients: Floats
    factor: Floats


def natural_polynomial(surface: PolynomialSurface) -> NaturalPolynomial:
    """Convert a polynomial that is not stretched, with 32 digits up to the last rounding."""
    k = len(surface.space)
    natural = Coordinates((-1.0,) * k, (1.0,) * k)
    coded, terms = surface.own_units, surface.terms
    free = movable(terms)
    if all(free[j] or natural.center[j] == coded.center[j] for j in range(k)):
        total = np.array([coded.half_range[j] if j in terms.components else 1.0 for j in range(k)])
        # only proportions add up to one, as a move of the origin of another factor takes for granted
        found, factor = surface.estimates_in(Coordinates(tuple((-total).tolist()), tuple(total.tolist())))
        share = _products(terms, 1.0 / total)
        return NaturalPolynomial(
            terms, share * surface.over_blocks(found), share[:, None] * surface.over_blocks(factor)
        )
    plain, weights = surface.terms.plain
    closed = replace(plain, exponents=hierarchical_closure(plain.exponents), components=())
    position = [closed.columns.index(column) for column in plain.columns]
    into = conversion(closed, natural, coded).high[:, position] @ weights
    return NaturalPolynomial(closed, into @ surface.polynomial()[1], into @ surface.term_factor)


def _products(terms: Terms, scales: Floats) -> Floats:
    """By what each term grows when every factor is multiplied by its scale, shape (p,)."""
    own = scales[list(terms.variable_factors)]
    columns = (monomials(*each)[0][0] for each in zip(terms.columns, terms.differences, strict=True))
    return np.array([np.prod(own ** np.array(powers)) for powers in columns])


def natural_terms(surface: PolynomialSurface, confidence: float = 0.95) -> list[dict[str, Any]]:
    """Coefficients in natural units with standard errors and tests, as JSON values."""
    return _tested(surface, natural_polynomial(surface), confidence)


def terms_in(surface: PolynomialSurface, units: Coordinates) -> list[dict[str, Any]]:
    """Coefficients in other units in which the terms are the same model, as JSON values."""
    estimates = surface.estimates_in(units)[0].tolist()
    rows = []
    for name, estimate, row in zip(surface.names, estimates, surface.rows_in(units), strict=True):
        _, error, df = surface.judged(row)
        t = estimate / error if error > 0 and not surface.fit.exact else math.nan
        p = float(two_sided_p(np.array(t), df))
        found = {"estimate": estimate, "std_error": error, "t": t, "p": p}
        rows.append({"name": name, **{key: number(value) for key, value in found.items()}})
    return rows


def _tested(surface: PolynomialSurface, found: NaturalPolynomial, confidence: float) -> list[dict[str, Any]]:
    fit = surface.fit
    errors = fit.sigma * np.sqrt(np.einsum("ij,ij->i", found.factor, found.factor))
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.where(fit.exact, np.nan, found.coefficients / errors)
    half = errors * float(stdtrit(fit.df, 0.5 + 0.5 * confidence)) if fit.df else np.full(len(errors), np.inf)
    half = half if surface.considered is None else np.full(len(errors), np.nan)
    low, high = found.coefficients - half, found.coefficients + half
    columns = (found.coefficients, errors, t, two_sided_p(t, fit.df), low, high)
    keys = ("estimate", "std_error", "t", "p", "low", "high")
    return [
        {"name": name, **{key: number(value) for key, value in zip(keys, values, strict=True)}}
        for name, *values in zip(found.terms.names(surface.space), *columns, strict=True)
    ]


def equations(surface: PolynomialSurface) -> dict[str, Any]:
    """Equations as text: ``coded``, ``natural``, with categories both ``by_category``, perhaps a ``note``.

    With as many digits as five digits of the predictions at the runs need. Block effects are averaged.
    """
    space, response, points = surface.space, surface.response, surface.data.points
    terms, coded = surface.polynomial()
    natural = natural_polynomial(surface)
    spread = float(np.ptp(surface.fit.fitted))
    forms = {
        "coded": (terms, coded, digits_needed(terms.matrix(surface.to_units(points)), coded, spread)),
        "natural": (
            natural.terms,
            natural.coefficients,
            digits_needed(natural.terms.matrix(points), natural.coefficients, spread),
        ),
    }
    found: dict[str, Any] = {
        key: _equation(response, form.names(space), beta, digits)
        for key, (form, beta, digits) in forms.items()
    }
    if forms["natural"][2] > DOUBLE:
        found["note"] = (
            "terms of the natural equation cancel so much that it has no digits left: use the coded"
        )
    if any(terms.levels):
        count = math.prod(level for level in terms.levels if level)
        if count > MOST_CATEGORIES:
            found["by_category"] = {"reason": f"there are {count} combinations of categories"}
        else:
            found["by_category"] = [
                {
                    "category": category,
                    **{
                        key: _equation(response, left.names(space.names), values, digits)
                        for key, (form, beta, digits) in forms.items()
                        for left, values in [with_levels(form, beta, levels)]
                    },
                }
                for category, levels in categories(space)
            ]
    return found


def equation_in(surface: PolynomialSurface, units: Coordinates) -> str:
    """The equation in other units in which the terms are the same model."""
    beta = surface.over_blocks(surface.estimates_in(units)[0])
    matrix = surface.terms.matrix(units.forward(surface.data.points))
    digits = digits_needed(matrix, beta, float(np.ptp(surface.fit.fitted)))
    return _equation(surface.response, surface.terms.names(surface.space), beta, digits)


def categories(space: Space) -> Iterator[tuple[dict[str, str], Floats]]:
    """Every combination of categories by name, and as a row of coded values (numeric ones 1)."""
    places = [j for j, f in enumerate(space) if not f.domain.is_numeric]
    for levels in product(*(range(space.factors[j].domain.categories) for j in places)):
        row = np.ones(len(space))
        row[places] = levels
        yield (
            {space.names[j]: str(space.factors[j].levels[i]) for j, i in zip(places, levels, strict=True)},
            row,
        )


def with_levels(terms: Terms, coefficients: Floats, row: Floats) -> tuple[Terms, Floats]:
    """What is left of a polynomial where the categories are given: terms of numbers, and coefficients."""
    terms, weights = terms.plain
    coefficients = weights @ coefficients
    values = terms.variables(row[None])[:, 0]
    found: dict[Exponents, list[float]] = {}
    for powers, b in zip(terms.columns, coefficients.tolist(), strict=True):
        weight, left = 1.0, [0] * terms.k
        for value, factor, power in zip(values.tolist(), terms.variable_factors, powers, strict=True):
            if terms.levels[factor]:
                weight *= value**power
            else:
                left[factor] = power
        found.setdefault(tuple(left), []).append(weight * b)
    return Terms(tuple(found), (0,) * terms.k), np.array(list(map(_sum, found.values())))


def _sum(parts: list[float]) -> float:
    """Their sum, zero where they cancel but for rounding."""
    total = math.fsum(parts)
    return total if abs(total) > ROUNDING * sum(map(abs, parts)) else 0.0


def digits_needed(matrix: Floats, coefficients: Floats, spread: float) -> int:
    """Digits that coefficients need so that cancellation leaves :data:`DIGITS` of the predictions."""
    largest = float((np.abs(matrix) @ np.abs(coefficients)).max())
    lost = math.log10(largest / spread) if spread > 0 and largest > spread else 0.0
    return DIGITS + math.ceil(lost)


def _equation(response: str, names: Sequence[str], coefficients: Floats, digits: int) -> str:
    """One equation; terms that are exactly zero are left out."""
    text = ""
    for name, b in zip(names, coefficients.tolist(), strict=True):
        if b:
            sign = "-" if b < 0 else "+"
            size = f"{abs(b):.{min(digits, DOUBLE + 2)}g}" + ("" if name == "1" else f"*{name}")
            text += f" {sign} {size}" if text else f"{'-' if b < 0 else ''}{size}"
    return f"{response} = {text or '0'}"
