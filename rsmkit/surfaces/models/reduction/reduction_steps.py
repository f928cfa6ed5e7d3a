"""Which models are one step away from another when terms go and come, and what a step is judged by."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from rsmkit.language.space import Floats
from rsmkit.language.terms import Exponents, hierarchical_closure
from rsmkit.surfaces.models.polynomial import PolynomialSurface

__all__ = ["SAME", "Steps", "Subset", "corrected_akaike"]

SAME = 1e-9
"""A difference of the criterion that means nothing."""

Subset = frozenset[int]
"""Terms, by number."""


def corrected_akaike(rss: ArrayLike, p: ArrayLike, n: int) -> Floats:
    """Akaike's criterion, corrected for few runs, up to a constant; infinite for nearly saturated models.

    Parameters
    ----------
    rss : array
        Residual sums of squares.
    p : array
        Coefficients, to which sigma is added.
    n : int
        Runs.
    """
    q = np.asarray(p) + 1
    left = np.maximum(n - q - 1, 0)
    with np.errstate(divide="ignore"):
        penalty = 2 * q + np.where(left > 0, 2 * q * (q + 1) / left, np.inf)
    return np.asarray(n * np.log(np.maximum(rss, 1e-300)) + penalty)


class Steps:
    """Terms of a surface by number, in the order of their exponents, and what keeps their hierarchy."""

    def __init__(self, surface: PolynomialSurface) -> None:
        self.surface = surface
        self.exponents = tuple(sorted(surface.terms.exponents))
        self.everything = frozenset(range(len(self.exponents)))
        numbers = {e: t for t, e in enumerate(self.exponents)}
        constant = (0,) * surface.terms.k
        components = surface.terms.components
        linear = [t for e, t in numbers.items() if sum(e) == 1 and any(e[j] for j in components)]
        self.always = frozenset([numbers[constant]] if constant in numbers else linear)
        self.inside = [
            frozenset(numbers[f] for f in hierarchical_closure([e]) if f in numbers) for e in self.exponents
        ]
        """What each term contains, and itself."""
        powers = np.array(self.exponents)
        within = (powers[:, None] <= powers).all(axis=2) & ~np.eye(len(powers), dtype=bool)
        self.above = [frozenset(np.flatnonzero(row).tolist()) for row in within]
        """What contains each term."""
        self.columns = self._columns_of_terms(constant)

    def _columns_of_terms(self, constant: Exponents) -> list[list[int]]:
        terms = self.surface.terms
        blocks = len(self.surface.names) - terms.p
        of = [list[int]() for _ in self.exponents]
        for column, t in enumerate(terms.column_terms):
            of[self.exponents.index(terms.exponents[t])].append(column + (blocks if column else 0))
        if constant in self.exponents:
            of[self.exponents.index(constant)] = list(range(1 + blocks))
        return of

    def smaller(self, terms: Subset) -> dict[int, Subset]:
        """What is left without each term that no other contains."""
        return {t: terms - {t} for t in sorted(terms - self.always) if self.above[t].isdisjoint(terms)}

    def larger(self, terms: Subset) -> list[Subset]:
        """The terms with one more, and what it contains."""
        return [terms | self.inside[t] for t in sorted(self.everything - terms)]

    def columns_of(self, terms: Iterable[int]) -> list[int]:
        """Columns of the matrix that belong to the terms, in order."""
        return sorted(column for t in terms for column in self.columns[t])

    def chosen(self, terms: Subset) -> set[Exponents]:
        """Exponents of the terms."""
        return {self.exponents[t] for t in terms}

    def name(self, terms: Iterable[int]) -> str:
        """Names of the terms, with commas."""
        named = tuple(sorted(self.exponents[t] for t in terms))
        return ", ".join(replace(self.surface.terms, exponents=named).names(self.surface.space))
