"""A surface at one combination of its categories: a polynomial of the numbers alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np

from rsmkit.errors import RsmkitError, one_of
from rsmkit.language.space import Floats, Space
from rsmkit.language.terms import Exponents, Terms
from rsmkit.surfaces.estimation.coordinates import Coordinates
from rsmkit.surfaces.estimation.fit_data import FitData
from rsmkit.surfaces.estimation.least_squares import LeastSquares
from rsmkit.surfaces.models.polynomial import PolynomialSurface

__all__ = ["Category", "CategorySlice", "all_categories", "at_category", "differing_curvature"]

Category = Mapping[str, str]
"""A level for each categorical factor, by name."""


@dataclass(frozen=True, eq=False)
class CategorySlice:
    """What is left of a polynomial where every category is given.

    It offers what the analysis of second-order surfaces asks of a polynomial; points have a column for each
    number only.

    Parameters
    ----------
    surface : PolynomialSurface
    category : dict of str to str
    """

    surface: PolynomialSurface
    category: dict[str, str]

    @property
    def response(self) -> str:
        """Name of the response."""
        return self.surface.response

    @property
    def fit(self) -> LeastSquares:
        """The fit to all runs, whatever their category."""
        return self.surface.fit

    @property
    def data(self) -> FitData:
        """All runs."""
        return self.surface.data

    @cached_property
    def space(self) -> Space:
        """The numeric factors."""
        return Space(f for f in self.surface.space if f.domain.is_numeric)

    @cached_property
    def box_of_runs(self) -> Coordinates:
        """Coordinates that put the ends of the runs at -1 and 1 in each number."""
        whole = self.surface.box_of_runs
        low, high = (tuple(np.array(end)[self._numeric].tolist()) for end in (whole.low, whole.high))
        return Coordinates(low, high, tuple(whole.stretches[j] for j in self._numeric if whole.stretches))

    @property
    def terms(self) -> Terms:
        """Terms of the numbers."""
        return self._restriction[0]

    @cached_property
    def term_factor(self) -> Floats:
        """Covariance factor of the coefficients of :meth:`polynomial`, shape (terms, p)."""
        return np.asarray(self._restriction[1] @ self.surface.term_factor)

    def polynomial(self) -> tuple[Terms, Floats]:
        """Terms of the numbers and their coefficients in the units of the surface."""
        return self.terms, np.asarray(self._restriction[1] @ self.surface.polynomial()[1])

    def to_units(self, natural: Floats) -> Floats:
        """Natural units to those of the coefficients, shape (n, numbers) or (numbers,)."""
        return np.asarray(self.surface.to_units(self.whole(natural))[..., self._numeric])

    def from_units(self, values: Floats) -> Floats:
        """Inverse of :meth:`to_units`."""
        return np.asarray(self.surface.from_units(self.whole(values))[..., self._numeric])

    def predict(self, natural: Floats) -> Floats:
        """Predict at points of the numbers, shape (n,)."""
        return self.surface.predict(self.whole(natural))

    def leverage(self, natural: Floats) -> Floats:
        """Variance of the predicted mean in units of sigma squared, shape (n,)."""
        return self.surface.leverage(self.whole(natural))

    def whole(self, numbers: Floats) -> Floats:
        """Points of all factors, the categories filled in."""
        points = np.tile(self._row, (*np.shape(numbers)[:-1], 1))
        points[..., self._numeric] = numbers
        return points

    @cached_property
    def _numeric(self) -> list[int]:
        return np.flatnonzero(self.surface.space.numeric).tolist()

    @cached_property
    def _row(self) -> Floats:
        """Coordinates of a point at the category, zero for numbers."""
        space = self.surface.space
        row = np.zeros(len(space))
        for name, level in self.category.items():
            row[space.names.index(name)] = [str(text) for text in space[name].levels].index(level)
        return row

    @cached_property
    def _restriction(self) -> tuple[Terms, Floats]:
        """Terms of the numbers, and the matrix from the coefficients of the surface to theirs."""
        terms = self.surface.terms
        values = terms.variables(self._row[None])[:, 0]
        places: dict[Exponents, int] = {}
        entries = []
        for column, powers in enumerate(terms.columns):
            weight, left = 1.0, [0] * terms.k
            for value, factor, power in zip(values.tolist(), terms.variable_factors, powers, strict=True):
                if terms.levels[factor]:
                    weight *= value**power
                else:
                    left[factor] = power
            kept = tuple(left[j] for j in self._numeric)
            entries.append((places.setdefault(kept, len(places)), column, weight))
        matrix = np.zeros((len(places), terms.p))
        for row, column, weight in entries:
            matrix[row, column] = weight
        return Terms(tuple(places), (0,) * len(self._numeric)), matrix


def at_category(surface: PolynomialSurface, category: Category | None) -> PolynomialSurface | CategorySlice:
    """Give the surface itself if it has numbers only, else what is left of it at a combination of categories.

    Raises
    ------
    RsmkitError
        For categories that are not given, or are none.
    """
    names = [f.name for f in surface.space if not f.domain.is_numeric]
    given = dict(category or {})
    for name in given:
        one_of("categorical factor", name, names)
    if missing := [name for name in names if name not in given]:
        raise RsmkitError(
            f"{surface.response}: the answer depends on {', '.join(missing)}; say which level, such as "
            f"category={{'{missing[0]}': '{surface.space[missing[0]].levels[0]}'}}"
        )
    for name, level in given.items():
        one_of(name, level, [str(text) for text in surface.space[name].levels])
    if len(names) == len(surface.space):
        raise RsmkitError(f"{surface.response}: there is no numeric factor")
    return CategorySlice(surface, given) if names else surface


def all_categories(space: Space) -> list[dict[str, str]]:
    """Every combination of levels of the categorical factors."""
    factors = [f for f in space if not f.domain.is_numeric]
    return [
        {f.name: str(level) for f, level in zip(factors, levels, strict=True)}
        for levels in product(*(f.levels for f in factors))
    ]


def differing_curvature(surface: PolynomialSurface) -> list[str]:
    """Categorical factors between whose levels the second-order part in the numbers differs."""
    numeric = surface.space.numeric
    found = []
    for j, factor in enumerate(surface.space):
        degrees = [np.array(e)[numeric].sum() for e in surface.terms.exponents if e[j]]
        if not factor.domain.is_numeric and max(degrees, default=0) >= 2:
            found.append(factor.name)
    return found
