"""The fitted polynomial as numbers, for programs that write its equation in a language of their own."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from rsmkit.language.space import Floats
from rsmkit.language.terms import Terms
from rsmkit.surfaces.models.polynomial import PolynomialSurface
from rsmkit.surfaces.statistics.equations import categories, natural_polynomial, with_levels

__all__ = ["equation_terms"]

MOST_TERMS = 6_000
"""Terms of all equations together; of more only the coded one without categories is given."""


def equation_terms(surface: PolynomialSurface) -> list[dict[str, Any]]:
    """Every equation of a polynomial that is not stretched, as JSON values.

    One for each unit and each combination of categories: ``units`` is "natural" or "coded", ``category`` maps
    each categorical factor to its level, ``terms`` is a list of ``[coefficient, [[factor, power], ...]]``
    with all digits; factors are counted from 0. Empty where categories are too many to write all of them.
    """
    if surface.units != "coded":
        return []
    terms, coded = surface.polynomial()
    natural = natural_polynomial(surface)
    forms = {"natural": (natural.terms, natural.coefficients), "coded": (terms, coded)}
    if not any(terms.levels):
        return [
            {"units": units, "category": {}, "terms": _sparse(form, beta)}
            for units, (form, beta) in forms.items()
        ]
    numbers = [levels for levels in terms.levels if levels]
    if int(np.prod(numbers, dtype=float)) * len(coded) > MOST_TERMS:
        return []
    return [
        {
            "units": units,
            "category": category,
            "terms": _sparse(*with_levels(form, beta, levels)),
        }
        for category, levels in categories(surface.space)
        for units, (form, beta) in forms.items()
    ]


def _sparse(terms: Terms, coefficients: Floats) -> list[list[Any]]:
    pairs: Iterable[tuple[Any, float]] = zip(terms.columns, coefficients.tolist(), strict=True)
    return [[b, [[j, int(power)] for j, power in enumerate(powers) if power]] for powers, b in pairs if b]
