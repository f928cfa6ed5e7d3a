"""Extra sums of squares: what several terms at once add to the rest of a model."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.special import fdtrc

from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.language.exponents import Exponents, blending_of
from rsmkit.language.scheffe import parse_scheffe
from rsmkit.language.terms import EXACT, parse_terms
from rsmkit.surfaces.models.polynomial import PolynomialSurface
from rsmkit.surfaces.reading import number
from rsmkit.surfaces.statistics.terms.anova import LINEAR, Row, tested
from rsmkit.surfaces.statistics.terms.term_tests import sum_coded, term_members, wald

__all__ = ["extra_report", "extra_sum_of_squares"]


@checked
def extra_sum_of_squares(
    surface: PolynomialSurface, terms: Sequence[str], error: PolynomialSurface | None = None
) -> Row:
    """Test several terms at once: the model against the model without them.

    Exactly the terms that are named leave. Where a term that contains one of them stays, the test is that of
    type III: in coded units, with contrasts that add to zero over the levels of a category.

    Parameters
    ----------
    surface : PolynomialSurface
        The larger model, not stretched.
    terms : sequence of str
        Single terms ``x1*x2``, ``x1^2``, groups ``TWI``, ``PQ``, ``FO``; ``block`` for the blocks.
    error : PolynomialSurface, optional
        Model whose residual mean square is the error; `surface` by default.

    Returns
    -------
    Row
        ``df``, ``ss``, ``f``, ``p``.

    Raises
    ------
    RsmkitError
        If a term is not in the model, or the surface is stretched or has random groups.
    """
    if surface.units == "stretched" or surface.data.random:
        raise RsmkitError(f"{surface.response}: sums of squares are those of ordinary polynomials")
    names, members = term_members(surface)
    places = _asked_for(surface, terms, names)
    columns = np.concatenate([members[place] for place in sorted(places)])
    own_to_sum = sum_coded(surface)
    factor, estimates = own_to_sum @ surface.coded_factor, own_to_sum @ surface.coefficients
    ss = wald(factor[columns], estimates[columns])
    row = tested(surface, ", ".join(names[place] for place in sorted(places)), len(columns), ss)
    if error is None:
        return row
    if error.fit.n != surface.fit.n or error.fit.df == 0 or not error.fit.rss > 0:
        return replace(row, f=math.nan, p=math.nan)
    f = row.ms / error.fit.sigma**2
    return replace(row, f=f, p=float(fdtrc(row.df, error.fit.df, f)))


def extra_report(surface: PolynomialSurface, terms: Sequence[str]) -> dict[str, Any]:
    """The test as JSON values."""
    row = extra_sum_of_squares(surface, terms)
    values = {"ss": row.ss, "ms": row.ms, "F": row.f, "p": row.p}
    return {
        "terms": row.source.split(", "),
        "df": [row.df, surface.fit.df],
        **{key: number(value) for key, value in values.items()},
    }


def _read(surface: PolynomialSurface, word: str) -> tuple[Exponents, ...]:
    components = [surface.space.names[j] for j in surface.terms.components]
    if components and word != "TWI":
        return parse_scheffe(surface.space, components, [EXACT, word]).exponents
    return parse_terms(surface.space, [word]).exponents


def _asked_for(surface: PolynomialSurface, words: Sequence[str], names: list[str]) -> set[int]:
    """Places of the terms that are meant."""
    found: set[int] = set()
    components = surface.terms.components
    linear = [e for e in surface.terms.exponents if components and blending_of(e, components) == LINEAR]
    exponents = [e for e in surface.terms.exponents if any(e) and e not in linear]
    first = len(names) - len(exponents)
    for word in words:
        if word == "block" and first:
            found.add(0)
            continue
        if linear and word in ("FO", *(surface.space.names[j] for j in components)):
            raise RsmkitError(
                f"{surface.response}: {word} cannot leave a model of a mixture; linear blending has a test "
                "of its own. Name blending terms to test together"
            )
        meant = _read(surface, word)
        group = word in ("FO", "TWI", "PQ", "SO", "cubic")
        wanted = set(meant) if group else {meant[-1]}
        here = {first + i for i, e in enumerate(exponents) if e in wanted}
        if group and word != "SO":
            degree = max(sum(e) for e in meant)
            here = {place for place in here if sum(exponents[place - first]) == degree}
        if not here:
            raise RsmkitError(
                f"{surface.response}: {word} is not in the model, whose terms are {', '.join(names)}"
            )
        found |= here
    if not found:
        raise RsmkitError(f"{surface.response}: name at least one term to test")
    return found
