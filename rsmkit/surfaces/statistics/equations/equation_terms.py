"""The fitted polynomial as numbers, for programs that write its equation in a language of their own."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from rsmkit.language.space import Floats
from rsmkit.language.terms import Terms
from rsmkit.surfaces.models.polynomial import PolynomialSurface
from rsmkit.surfaces.statistics.equations.equations import (
    DOUBLE,
    categories,
    digits_needed,
    natural_polynomial,
    with_levels,
)

__all__ = ["equation_terms"]

MOST_TERMS = 6_000
"""Terms of all equations in one unit together."""


def equation_terms(surface: PolynomialSurface) -> list[dict[str, Any]]:
    """Every equation of a polynomial that is not stretched, as JSON values.

    One for each unit and each combination of categories: ``units`` is "natural" or "coded" (proportions of
    the components of a mixture), ``category`` maps each categorical factor to its level, ``terms`` is a list
    of ``[coefficient, [[factor, power], ...]]`` with all digits; factors are counted from 0. With ``digits``
    significant digits predictions are right to five; ``coding`` has the center and half range of each factor
    in coded units. Empty where categories are too many to write all of them.
    """
    if surface.units == "stretched":
        return []
    terms, coded = surface.polynomial()
    natural, points = natural_polynomial(surface), surface.data.points
    forms = {
        "natural": (natural.terms, natural.coefficients, natural.terms.matrix(points)),
        "coded": (terms, coded, terms.matrix(surface.to_units(points))),
    }
    _, beta, matrix = forms["coded"]
    spread = float(np.ptp(matrix @ beta))
    digits = {
        units: min(DOUBLE, digits_needed(matrix, beta, spread)) for units, (_, beta, matrix) in forms.items()
    }
    own = surface.own_units
    coding = [list(pair) for pair in zip(own.center.tolist(), own.half_range.tolist(), strict=True)]
    places: list[tuple[dict[str, str], Floats | None]] = [({}, None)]
    if any(terms.levels):
        if math.prod(levels for levels in terms.levels if levels) * len(coded) > MOST_TERMS:
            return []
        places = list(categories(surface.space))
    return [
        {
            "units": units,
            "category": category,
            "digits": digits[units],
            "coding": [] if units == "natural" else coding,
            "terms": _sparse(*((form, beta) if levels is None else with_levels(form, beta, levels))),
        }
        for category, levels in places
        for units, (form, beta, _) in forms.items()
    ]


def _sparse(terms: Terms, coefficients: Floats) -> list[list[Any]]:
    terms, weights = terms.plain
    coefficients = weights @ coefficients
    pairs: Iterable[tuple[Any, float]] = zip(terms.columns, coefficients.tolist(), strict=True)
    return [[b, [[j, int(power)] for j, power in enumerate(powers) if power]] for powers, b in pairs if b]
