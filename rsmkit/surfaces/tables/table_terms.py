"""Fitting given terms to the runs of a table, or saying which smaller model they can estimate."""

from __future__ import annotations

from typing import Any

import numpy as np

from rsmkit.errors import FitError
from rsmkit.language.scheffe import MODELS, scheffe_terms
from rsmkit.language.space import Floats, Space
from rsmkit.language.terms import Terms, parse_terms
from rsmkit.surfaces.fitted_response import FittedResponse
from rsmkit.surfaces.models.polynomial import PolynomialSurface
from rsmkit.surfaces.models.reduction.term_chooser import Method
from rsmkit.surfaces.polynomial_fit import fit_surface
from rsmkit.surfaces.tables.table_mixture import sum_note

__all__ = ["fit_terms", "reduced"]

SMALLER = (("SO",), ("FO", "TWI"), ("FO",), ("0", "FO", "TWI"), ("0", "FO"))
"""Models to offer when a larger one cannot be estimated; the last two for mixtures."""


def reduced(
    fitted: FittedResponse[PolynomialSurface], method: Method
) -> tuple[FittedResponse[PolynomialSurface], str]:
    """The same with fewer terms, and what was left out in words."""
    from rsmkit.surfaces.models.reduction.reduced import reduce_surface

    found = reduce_surface(fitted.surface, method)
    told = f"left out {', '.join(found.dropped)}" if found.dropped else "no term left out"
    return FittedResponse(found.surface), f"{fitted.response}: {told} ({method})"


def fit_terms(
    space: Space, points: Floats, y: Floats, terms: Terms, **request: Any
) -> FittedResponse[PolynomialSurface]:
    """Fit given terms; if these runs cannot estimate them, say which smaller model they can."""
    try:
        return fit_surface(space, points, y, terms=terms, deterministic=False, **request)
    except FitError as error:
        if terms.components:
            raise FitError(f"{error}{_smaller_blending(space, points, y, terms, request)}") from None
        columns = dict(zip(space.names, points.T, strict=True))
        if note := sum_note({name: x for name, x in columns.items() if space[name].domain.is_numeric}):
            error = FitError(f"{error}; {note}")
        for words in SMALLER if np.ptp(points, axis=0).all() else SMALLER[:3]:
            fewer = parse_terms(space, words).with_contrasts(terms.contrasts)
            if set(fewer.exponents) < set(terms.exponents):
                try:
                    fit_surface(space, points, y, terms=fewer, deterministic=False, **request)
                except FitError:
                    continue
                raise FitError(f"{error}; these runs can estimate --terms {','.join(words)}") from None
        raise


def _smaller_blending(space: Space, points: Floats, y: Floats, terms: Terms, request: dict[str, Any]) -> str:
    """Say which smaller model of a mixture these runs can estimate."""
    components = [space.names[j] for j in terms.components]
    for word in reversed(MODELS):
        fewer = scheffe_terms(space, components, MODELS[word]).with_contrasts(terms.contrasts)
        if set(fewer.exponents) < set(terms.exponents):
            try:
                fit_surface(space, points, y, terms=fewer, deterministic=False, **request)
            except FitError:
                continue
            return f"; these runs can estimate --model {word}"
    return ""
