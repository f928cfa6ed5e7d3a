"""Exact moments and Sobol indices of polynomials under independent laws.

A polynomial is written in products of functions that are orthonormal under each factor's law: the square of
each coefficient is the part of the variance that these factors cause together (Sudret, *Global sensitivity
analysis using polynomial chaos expansions*, Reliability Engineering & System Safety 93, 2008). Nothing is
sampled: the functions are found by a QR decomposition of the powers at the nodes of a Gauss rule.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from rsmkit.language.joint_law import JointLaw
from rsmkit.language.laws import Law
from rsmkit.language.space import Floats
from rsmkit.language.terms import Terms
from rsmkit.surfaces.estimation.coordinates import Coordinates
from rsmkit.surfaces.posterior import DrawnPolynomials

__all__ = ["Expansion", "expand", "expand_drawn"]

ROUNDING = 1e-16
"""Entries of a table below this part of the largest in their row are rounding."""

Index = tuple[tuple[int, int], ...]
"""Which function of which factor: pairs of both, ascending, without the constants."""


@dataclass(frozen=True, eq=False)
class Expansion:
    """A polynomial, or several of the same terms, in orthonormal functions.

    Parameters
    ----------
    names : tuple of str
        The factors that vary.
    indices : tuple of Index
        The functions; factors are counted as in `names`.
    coefficients : array, shape (functions, m)
        Of each of m polynomials.
    slopes : array, shape (factors, functions, m)
        The same of ``(x_i - mean_i) dy/dx_i`` for every factor i: what widening its law changes.
    """

    names: tuple[str, ...]
    indices: tuple[Index, ...]
    coefficients: Floats
    slopes: Floats

    @property
    def mean(self) -> Floats:
        """Of each polynomial, shape (m,)."""
        return self.coefficients[self.indices.index(())] if () in self.indices else 0.0 * self.variance

    @cached_property
    def _varying(self) -> list[int]:
        return [i for i, index in enumerate(self.indices) if index]

    @cached_property
    def variance(self) -> Floats:
        """Of each polynomial, shape (m,)."""
        return np.asarray(np.square(self.coefficients[self._varying]).sum(axis=0))

    @cached_property
    def parts(self) -> dict[tuple[int, ...], Floats]:
        """Variance that exactly these factors cause together, each shape (m,)."""
        found: dict[tuple[int, ...], Floats] = {}
        for i in self._varying:
            group = tuple(factor for factor, _ in self.indices[i])
            found[group] = found.get(group, 0.0) + np.square(self.coefficients[i])
        return found

    @property
    def first(self) -> Floats:
        """Variance that each factor causes alone, shape (factors, m)."""
        nothing = np.zeros_like(self.variance)
        return np.array([self.parts.get((j,), nothing) for j in range(len(self.names))])

    @property
    def total(self) -> Floats:
        """Variance that each factor has a part in, shape (factors, m)."""
        whole = np.zeros((len(self.names), *self.variance.shape))
        for group, part in self.parts.items():
            whole[list(group)] += part
        return whole

    @property
    def pairs(self) -> dict[tuple[int, int], Floats]:
        """Variance that exactly two factors cause together, each shape (m,)."""
        return {(g[0], g[1]): part for g, part in self.parts.items() if len(g) == 2}

    @property
    def stretching(self) -> Floats:
        """Derivative of half the variance by the relative width of each law, shape (factors, m)."""
        varying = self._varying
        return np.asarray(np.einsum("fm,jfm->jm", self.coefficients[varying], self.slopes[:, varying]))


def expand(terms: Terms, coordinates: Coordinates, coefficients: Floats, law: JointLaw) -> Expansion:
    """Write polynomials in orthonormal functions of independent laws.

    Parameters
    ----------
    terms : Terms
    coordinates : Coordinates
        In which the terms are powers.
    coefficients : array, shape (p, m)
    law : JointLaw
        Independent.
    """
    tables = _Tables(terms, coordinates, law)
    columns = [tables.functions_of(column) for column in terms.columns]
    values = [_sparse(table) for table in tables.values]
    beta = np.asarray(coefficients, float).reshape(terms.p, -1) * tables.held()[:, None]
    place, entries = _combined(columns, values)
    of_values = _matrix(entries, len(place), terms.p) @ beta
    slopes = np.zeros((len(law), *of_values.shape))
    for j, table in enumerate(tables.slopes):
        touched = [i for i, column in enumerate(columns) if j in column]
        of_slopes = [*values[:j], _sparse(table), *values[j + 1 :]]
        moved, weights = _combined([columns[i] for i in touched], of_slopes)
        known = {row: place[index] for index, row in moved.items() if index in place}
        kept = [(known[row], column, weight) for row, column, weight in weights if row in known]
        slopes[j] = _matrix(kept, len(place), len(touched)) @ beta[touched]
    return Expansion(law.names, tuple(place), of_values, slopes)


def _matrix(entries: list[tuple[int, int, float]], rows: int, columns: int) -> csr_array:
    table = np.array(entries, float).reshape(-1, 3)
    where = table[:, 0].astype(int), table[:, 1].astype(int)
    return csr_array((table[:, 2], where), shape=(rows, columns))


def expand_drawn(polynomials: DrawnPolynomials, law: JointLaw) -> tuple[Expansion, Expansion]:
    """The surface itself, and all drawn ones, in orthonormal functions."""
    terms, own = polynomials.terms, polynomials.coordinates
    if not polynomials.drawn_coordinates:
        both = np.column_stack([polynomials.coefficients, polynomials.drawn])
        whole = expand(terms, own, both, law)
        return _columns(whole, slice(0, 1)), _columns(whole, slice(1, None))
    drawn = [
        expand(terms, coordinates, polynomials.drawn[:, i], law)
        for i, coordinates in enumerate(polynomials.drawn_coordinates)
    ]
    first = drawn[0]
    joined = Expansion(
        first.names,
        first.indices,
        np.hstack([item.coefficients for item in drawn]),
        np.concatenate([item.slopes for item in drawn], axis=2),
    )
    return expand(terms, own, polynomials.coefficients, law), joined


def _columns(whole: Expansion, chosen: slice) -> Expansion:
    return Expansion(whole.names, whole.indices, whole.coefficients[:, chosen], whole.slopes[:, :, chosen])


class _Tables:
    """Functions of each factor of a model: powers, or indicators of levels, in orthonormal ones."""

    def __init__(self, terms: Terms, coordinates: Coordinates, law: JointLaw) -> None:
        self.law, self.terms = law, terms
        self.place = {column: j for j, column in enumerate(law.columns)}
        variables = terms.variable_factors
        self.first_variable = [variables.index(j) for j in range(terms.k)]
        powers = np.array(terms.columns, int).reshape(terms.p, -1)
        self.values: list[Floats] = []
        self.slopes: list[Floats] = []
        for column, own in zip(law.columns, law.laws.values(), strict=True):
            highest = int(powers[:, self.first_variable[column]].max(initial=0))
            values, slopes = _orthonormal(own, coordinates, column, terms.levels[column], highest)
            self.values.append(values)
            self.slopes.append(slopes)
        z = coordinates.forward(np.atleast_2d(law.point))[0]
        self.fixed = self.terms.variables(z[None])[:, 0]

    def functions_of(self, column: tuple[int, ...]) -> dict[int, int]:
        """Which function of each factor that varies a column holds, without constants."""
        found: dict[int, int] = {}
        for variable, power in enumerate(column):
            factor = self.terms.variable_factors[variable]
            if power and factor in self.place:
                offset = variable - self.first_variable[factor]
                found[self.place[factor]] = offset + 1 if self.terms.levels[factor] else power
        return found

    def held(self) -> Floats:
        """What the factors that do not vary contribute to each column, shape (p,)."""
        powers = np.array(self.terms.columns, float).reshape(self.terms.p, -1)
        stays = [v for v, factor in enumerate(self.terms.variable_factors) if factor not in self.place]
        return np.asarray(np.prod(self.fixed[stays] ** powers[:, stays], axis=1))


def _orthonormal(
    law: Law, coordinates: Coordinates, column: int, levels: int, highest: int
) -> tuple[Floats, Floats]:
    """Functions of one factor, and ``(x - mean) df/dx`` of each, in orthonormal ones, shape (f, f) each."""
    low, high = coordinates.low[column], coordinates.high[column]
    stretched = bool(coordinates.stretches) and coordinates.stretches[column].family != "identity"
    x, weight = law.rule((low, high) if stretched else ())
    if levels:
        functions = np.column_stack([np.ones_like(x), *(x == level for level in range(1, levels))])
        slopes = np.zeros_like(functions)
    else:
        points = np.tile(coordinates.center, (len(x), 1))
        points[:, column] = x
        z = coordinates.forward(points)[:, column]
        by_x = coordinates.slopes(points)[:, column] * (x - law.mean)
        powers = np.arange(highest + 1)
        functions = z[:, None] ** powers
        slopes = powers * z[:, None] ** np.maximum(powers - 1, 0) * by_x[:, None]
    root = np.sqrt(weight)[:, None]
    basis, upper = np.linalg.qr(root * functions)
    signs = np.where(np.diag(upper) < 0, -1.0, 1.0)
    return (signs[:, None] * upper).T, ((root * slopes).T @ basis) * signs


def _sparse(table: Floats) -> list[list[tuple[int, float]]]:
    """Each row as its entries that are more than rounding."""
    least = ROUNDING * np.abs(table).max(axis=1, initial=0.0)
    return [
        [(b, w) for b, w in enumerate(row) if abs(w) > smallest]
        for row, smallest in zip(table.tolist(), least.tolist(), strict=True)
    ]


def _combined(
    columns: Sequence[Mapping[int, int]], tables: Sequence[Sequence[Sequence[tuple[int, float]]]]
) -> tuple[dict[Index, int], list[tuple[int, int, float]]]:
    """Each column as a sum of products of orthonormal functions: these, and (product, column, weight)."""
    place: dict[Index, int] = {}
    entries = []
    for number, column in enumerate(columns):
        sums: list[tuple[Index, float]] = [((), 1.0)]
        for j in sorted(column):
            row = tables[j][column[j]]
            sums = [
                ((*index, (j, b)) if b else index, weight * part) for index, weight in sums for b, part in row
            ]
        entries += [(place.setdefault(index, len(place)), number, weight) for index, weight in sums]
    return place, entries
