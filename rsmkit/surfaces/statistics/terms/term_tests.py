"""Tests of whole terms: sums of squares of types I, II and III, whatever contrasts the surface is printed in.

Type I: each term after the terms before it. Type II: after all terms that do not contain it (it stays with
the lower ones; ``a*b`` contains ``a`` and ``b``). Type III: after all other terms, with contrasts that add to
zero over the levels of a category, so that a main effect is an average over the other factors. Containment is
that of R's ``car::Anova``: powers of a number are variables of their own, so ``x^2`` does not contain ``x``.
Numbers are in coded units, on whose centre the test of ``x`` beside ``x^2`` or ``x*z`` depends.

Fox, *Applied Regression Analysis and Generalized Linear Models*, 3rd ed. (2016), section 8.2.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.io.shown import Shown
from rsmkit.language.exponents import Exponents, blending_of, difference_in, monomial_name
from rsmkit.language.space import Floats
from rsmkit.language.terms import Terms
from rsmkit.surfaces.models.polynomial import PolynomialSurface
from rsmkit.surfaces.reading import number
from rsmkit.surfaces.statistics.terms.anova import LINEAR, Row, sequential_anova, tested
from rsmkit.surfaces.statistics.texts import short, text_table

__all__ = [
    "TermTest",
    "combinations_tested",
    "containing_terms",
    "sum_coded",
    "term_members",
    "term_name",
    "term_report",
    "term_tests",
    "term_words",
    "wald",
]


@dataclass(frozen=True)
class TermTest(Shown):
    """The tests of one term.

    Parameters
    ----------
    term : str
        ``x1``, ``x1*tool``, ``x1^2``; ``block`` for the blocks.
    df : int
        Number of its coefficients.
    type1, type2, type3 : Row
        Sum of squares with F and p; these are nan without residual degrees of freedom.
    """

    term: str
    df: int
    type1: Row
    type2: Row
    type3: Row


@checked
def term_tests(surface: PolynomialSurface) -> list[TermTest]:
    """Test every term of a polynomial but the constant, the blocks as one term.

    Parameters
    ----------
    surface : PolynomialSurface
        Not stretched.

    Returns
    -------
    list of TermTest
        In the order of the columns.

    Raises
    ------
    RsmkitError
        For a stretched surface, whose score tests know no types.
    """
    if surface.units == "stretched":
        raise RsmkitError(f"{surface.response}: a stretched surface has no sums of squares by type")
    names, members = term_members(surface)
    own_to_sum = sum_coded(surface)
    factor = own_to_sum @ surface.coded_factor
    estimates = own_to_sum @ surface.coefficients
    containing, found = containing_terms(surface), []
    linear = sequential_anova(surface)[0].ss if surface.terms.components else np.nan
    for t, columns in enumerate(members):
        chosen = combinations_tested(names[t], np.eye(len(factor))[columns])
        third = wald(chosen @ factor, chosen @ estimates)
        larger = [members[u] for u in containing[t]]
        second = _without(factor, estimates, chosen, np.concatenate(larger)) if larger else third
        first = linear if names[t] == LINEAR else float((surface.fit.effects[columns] ** 2).sum())
        rows = (tested(surface, names[t], len(chosen), ss) for ss in (first, second, third))
        found.append(TermTest(names[t], len(chosen), *rows))
    return found


def combinations_tested(name: str, rows: Floats) -> Floats:
    """Combinations of coefficients whose test is that of a term, from a row for each of its coefficients.

    Linear blending has no effect where the coefficients of all components are the same, not where they are
    zero.
    """
    return np.asarray(rows[1:] - rows[0] if name == LINEAR else rows)


def term_report(surface: PolynomialSurface) -> list[dict[str, Any]]:
    """The tests of all terms as JSON values, with the share of the total that each sum of squares is."""
    fit = surface.fit
    centre = np.average(fit.y, weights=fit.weights) if fit.has_constant else 0.0
    total = float(fit.weights @ (fit.y - centre) ** 2) or np.nan
    return [
        {
            "term": test.term,
            "df": test.df,
            **{
                kind: {
                    "ss": number(row.ss),
                    "ms": number(row.ms),
                    "F": number(row.f),
                    "p": number(row.p),
                    "share": number(row.ss / total),
                }
                for kind, row in (("type1", test.type1), ("type2", test.type2), ("type3", test.type3))
            },
        }
        for test in term_tests(surface)
    ]


def term_words(surface: PolynomialSurface, report: dict[str, Any]) -> list[str]:
    """The tests as lines of text, where they say more than the t of the coefficients: with categories."""
    if not report["anova_terms"] or not (any(surface.terms.levels) or surface.terms.components):
        return []
    kinds = {"II": "type2", "III": "type3"}
    head = ["tests by term", "df", *(f"{x} ({kind})" for kind in kinds for x in ("sum of squares", "F", "p"))]
    rows = [
        [
            row["term"],
            str(row["df"]),
            *(short(row[key][x]) for key in kinds.values() for x in ("ss", "F", "p")),
        ]
        for row in report["anova_terms"]
    ]
    return ["", *text_table(head, rows)]


def sum_coded(surface: PolynomialSurface) -> Floats:
    """Matrix that turns the surface's coefficients into those of sum-to-zero contrasts, shape (p, p).

    Without hierarchy the two span different functions, and the surface's own coding is all there is.
    """
    terms, blocks = surface.terms, surface.fit.p - surface.terms.p
    whole = np.eye(surface.fit.p)
    if terms.contrasts == "sum" or not any(terms.levels) or not _closed(terms):
        return whole
    places = np.r_[0, 1 + blocks : terms.p + blocks]
    whole[np.ix_(places, places)] = _treatment_in_sums(terms)
    return whole


def _treatment_in_sums(terms: Terms) -> Floats:
    """Columns of treatment contrasts as combinations of those of sum contrasts, one per column, shape (p, p).

    The indicator of a level is ``1/c`` plus deviations of the sum contrasts (R's ``contr.sum``, the last of
    c levels left out), so a product of indicators goes to its term and to that term's margins.
    """
    of_term = np.array(terms.column_terms)
    members = [np.flatnonzero(of_term == t) for t in range(len(terms))]
    found = np.zeros((terms.p, terms.p))
    for exponents, own in zip(terms.exponents, members, strict=True):
        categories = [j for j, count in enumerate(terms.levels) if exponents[j] and count]
        for kept in product((True, False), repeat=len(categories)):
            block: Floats = np.ones((1, 1))
            for j, stays in zip(categories, kept, strict=True):
                block = np.asarray(np.kron(block, _indicators(terms.levels[j], stays)), float)
            dropped = {j for j, stays in zip(categories, kept, strict=True) if not stays}
            margin = tuple(0 if j in dropped else power for j, power in enumerate(exponents))
            for place in _places(terms, margin):
                found[np.ix_(members[place], own)] = block.T
    return found


def _places(terms: Terms, exponents: Exponents) -> list[int]:
    """Where a term is among others; in a mixture ``1`` is the sum of components, ``z`` that of ``a*z``, ...

    Empty where it is not.
    """
    if exponents in terms.exponents:
        return [terms.exponents.index(exponents)]
    units = np.eye(terms.k, dtype=int)[list(terms.components)]
    found = [tuple((np.array(exponents) + unit).tolist()) for unit in units]
    return [terms.exponents.index(e) for e in found] if set(found) <= set(terms.exponents) else []


def _closed(terms: Terms) -> bool:
    """Whether terms without a category are there for all terms with it."""
    if not terms.components:
        return terms.hierarchical
    levels = [j for j, count in enumerate(terms.levels) if count]
    lower = {tuple(0 if i == j else x for i, x in enumerate(e)) for e in terms.exponents for j in levels}
    return all(_places(terms, e) for e in lower)


def _indicators(count: int, stays: bool) -> Floats:
    """Indicators of all levels but the first: what of each goes to the sum contrasts, or to the margin."""
    if not stays:
        return np.full((count - 1, 1), 1.0 / count)
    indicators: Floats = np.eye(count)[1:, :-1] - 1.0 / count
    return indicators


def term_members(surface: PolynomialSurface) -> tuple[list[str], list[np.ndarray]]:
    """Names of the terms and the columns of each, the constant left out."""
    terms, names = surface.terms, surface.space.names
    blocks = surface.fit.p - terms.p
    places = np.arange(terms.p) + blocks
    if blocks:
        places[0] = 0
    of_term = np.array(terms.column_terms)
    found = [("block", np.arange(1, 1 + blocks))] if blocks else []
    linear = [t for t, e in enumerate(terms.exponents) if blending_of(e, terms.components) == LINEAR]
    if terms.components and linear:
        found.append((LINEAR, places[np.isin(of_term, linear)]))
    for t, exponents in enumerate(terms.exponents):
        if any(exponents) and not (terms.components and t in linear):
            found.append((term_name(exponents, names, terms.components), places[of_term == t]))
    return [name for name, _ in found], [columns for _, columns in found]


def term_name(exponents: Exponents, names: tuple[str, ...], components: tuple[int, ...] = ()) -> str:
    """Name a term by its factors: ``a*b^2``; ``a*b*(a-b)`` of components of a mixture."""
    return monomial_name(exponents, names, difference_in(exponents, components))


def containing_terms(surface: PolynomialSurface) -> list[list[int]]:
    """For each term of :func:`term_members` those that contain it: its factors to its powers, and others."""
    mixed = surface.terms.components
    terms = np.array(
        [e for e in surface.terms.exponents if any(e) and not (mixed and blending_of(e, mixed) == LINEAR)]
    ).reshape(-1, surface.terms.k)
    found = []
    for t, exponents in enumerate(terms):
        inside = ((exponents == 0) | (exponents == terms)).all(axis=1)
        inside[t] = False
        found.append(np.flatnonzero(inside).tolist())
    if mixed:
        blending = np.flatnonzero(terms[:, list(mixed)].any(axis=1)) + 1
        return [blending.tolist(), *([u + 1 for u in larger] for larger in found)]
    if surface.fit.p == surface.terms.p:
        return found
    return [[], *([u + 1 for u in larger] for larger in found)]  # the blocks come first


def wald(factor: Floats, estimates: Floats) -> float:
    """Sum of squares of coefficients after all others: ``b' (F F')^-1 b``."""
    if len(estimates) == 1:
        return float(estimates[0] ** 2 / (factor[0] @ factor[0]))
    solved = np.linalg.lstsq(factor, estimates, rcond=None)[0]
    return float(solved @ solved)


def _without(factor: Floats, estimates: Floats, chosen: Floats, left_out: np.ndarray) -> float:
    """Sum of squares of combinations of coefficients in the model without others, after the rest of it.

    Leaving coefficients out conditions the estimates on these being zero: what they say of the others, by
    their covariance ``F F'``, is taken out of both the estimates and F.
    """
    own, values = chosen @ factor, chosen @ estimates
    shares = np.linalg.lstsq(factor[left_out].T, own.T, rcond=None)[0].T
    return wald(own - shares @ factor[left_out], values - shares @ estimates[left_out])
