"""Polynomial model terms: which products of factors a surface or a design is made for.

A term is a tuple of exponents, one per factor: with three factors ``(1, 0, 2)`` is ``x1*x3^2`` and
``(0, 0, 0)`` the constant. A categorical factor enters with exponent 0 or 1 and stands for one column per
level but one, so a term may span several columns of the design matrix. With treatment contrasts (the
convention of R) these are indicators of the levels after the first; with sum contrasts (JMP, Minitab,
Design-Expert) there is one for each level before the last, -1 at the last.
Everything here is in coded units; see :meth:`rsmkit.language.space.Space.encode`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.io.shown import Shown
from rsmkit.language.exponents import (
    Exponents,
    blending_of,
    difference_in,
    group_of,
    hierarchical_closure,
    monomial_name,
    monomials,
    reading_order,
)
from rsmkit.language.space import Floats, Space

__all__ = [
    "EXACT",
    "Contrasts",
    "Exponents",
    "Terms",
    "full_terms",
    "group_of",
    "hierarchical_closure",
    "parse_terms",
]

Contrasts = Literal["treatment", "sum"]
"""What the coefficients of a categorical factor compare: levels with the first, or with the average."""

HIGHEST = 20
"""Highest degree of a term written by hand."""

MOST_TERMS = 20_000

EXACT = "exact"
"""Word for: add nothing to the terms given but the constant."""

GROUPS = {"FO": ("FO",), "TWI": ("TWI",), "PQ": ("PQ",), "SO": ("FO", "TWI", "PQ"), "cubic": ("cubic",)}
"""Words for groups of terms and the groups they stand for."""

CHUNK = 8192
"""Points evaluated at a time: the working columns then stay in the processor's cache."""


@dataclass(frozen=True)
class Terms(Shown):
    """The terms of a polynomial in a fixed order.

    Parameters
    ----------
    exponents : tuple of tuple of int
        One tuple of k exponents per term.
    levels : tuple of int
        Per factor the number of levels of a categorical factor, 0 for a numeric one.
    contrasts : {"treatment", "sum"}
        Columns of categorical factors.
    components : tuple of int
        Factors that are the proportions of a mixture, in order. Exponents 2 and 1 of two of them, the larger
        first, then stand for ``a*b*(a-b)`` of Scheffe's full cubic; see :mod:`rsmkit.language.scheffe`.

    Examples
    --------
    >>> full_terms(2, order=2).names(["a", "b"])
    ('1', 'a', 'b', 'a*b', 'a^2', 'b^2')
    """

    exponents: tuple[Exponents, ...]
    levels: tuple[int, ...]
    contrasts: Contrasts = "treatment"
    components: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        problem = self._problem()
        if problem:
            raise RsmkitError(f"model terms: {problem}")

    def _problem(self) -> str:
        if not self.levels or not self.exponents:
            return "there must be at least one factor and one term"
        if any(len(e) != self.k for e in self.exponents):
            return f"every term needs {self.k} exponents, one per factor"
        if any(x < 0 for e in self.exponents for x in e):
            return "exponents must not be negative"
        if len(set(self.exponents)) != len(self.exponents):
            return "a term is given twice"
        if any(e[j] > 1 for e in self.exponents for j in range(self.k) if self.levels[j]):
            return "a categorical factor has no squares"
        if any(level == 1 for level in self.levels):
            return "a categorical factor needs at least two levels"
        if any(not 0 <= j < self.k or self.levels[j] for j in self.components):
            return "the components of a mixture must be numeric factors"
        if any(
            pair and pair[0] > pair[1] for pair in (difference_in(e, self.components) for e in self.exponents)
        ):
            return "a*b*(a-b) of two components has exponents 2 and 1, in this order"
        return ""

    def __len__(self) -> int:
        return len(self.exponents)

    @property
    def k(self) -> int:
        """Number of factors."""
        return len(self.levels)

    @property
    def p(self) -> int:
        """Number of columns of the design matrix (more than terms when a factor is categorical)."""
        return len(self.columns)

    @property
    def order(self) -> int:
        """Highest total degree."""
        return max(sum(e) for e in self.exponents)

    @property
    def has_constant(self) -> bool:
        """Whether the constant is one of the terms."""
        return (0,) * self.k in self.exponents

    @property
    def hierarchical(self) -> bool:
        """Whether every factor of every term is a term too (``x1*x2`` brings ``x1``, ``x2`` and ``1``)."""
        return set(hierarchical_closure(self.exponents)) == set(self.exponents)

    @cached_property
    def columns(self) -> tuple[Exponents, ...]:
        """Exponents of every column over the variables: numeric factors, contrasts of levels."""
        return tuple(column for e in self.exponents for column in self._expansions(e))

    @cached_property
    def variable_factors(self) -> tuple[int, ...]:
        """Index of the factor each variable of :attr:`columns` belongs to."""
        return tuple(j for j, count in enumerate(self.levels) for _ in range(max(1, count - 1)))

    @cached_property
    def column_terms(self) -> tuple[int, ...]:
        """Index of the term each column of the design matrix belongs to, shape (p,)."""
        return tuple(t for t, e in enumerate(self.exponents) for _ in self._expansions(e))

    @cached_property
    def groups(self) -> tuple[str, ...]:
        """Group of each column: ``""`` (constant), ``FO``, ``TWI``, ``PQ``, ``cubic``, ``order 4``, ...

        With components of a mixture ``linear blending``, ``quadratic blending``, ...
        """
        names = [blending_of(e, self.components) if self.components else group_of(e) for e in self.exponents]
        return tuple(names[t] for t in self.column_terms)

    def names(self, factors: Space | Sequence[str]) -> tuple[str, ...]:
        """Name every column: ``1``, ``x1``, ``x1*x2``, ``x1^2``, ``tool[B]``.

        Parameters
        ----------
        factors : Space or sequence of str
            Factor names; a Space also gives the texts of categorical levels (their index otherwise).
        """
        names = factors.names if isinstance(factors, Space) else tuple(factors)
        if len(names) != self.k:
            raise RsmkitError(f"model terms: {len(names)} names for {self.k} factors")
        variables = []
        for j, name in enumerate(names):
            if self.levels[j]:
                texts = factors.factors[j].levels if isinstance(factors, Space) else range(self.levels[j])
                variables += [f"{name}[{text}]" for text in list(texts)[self._own_columns(j)]]
            else:
                variables.append(name)
        pairs = zip(self.columns, self.differences, strict=True)
        return tuple(monomial_name(column, variables, pair) for column, pair in pairs)

    def matrix(self, coded: ArrayLike) -> Floats:
        """Design matrix.

        Parameters
        ----------
        coded : array, shape (n, k)
            Points in coded units (categorical columns: level index).

        Returns
        -------
        array, shape (n, p)
            Column-major, one column per entry of :meth:`names`.
        """
        variables = self.variables(coded)
        return self._rows(variables, np.empty((self.p, variables.shape[1]))).T

    def sum_matrix(self, coded: ArrayLike) -> Floats:
        """Like :meth:`matrix`, categories as deviations from the mean over their levels, shape (n, p).

        The column of a level is 1 there, -1 at the first level and 0 elsewhere.
        """
        variables, row = np.array(self.variables(coded)), 0
        for count in self.levels:
            if count:
                variables[row : row + count - 1] -= 1.0 - variables[row : row + count - 1].sum(axis=0)
            row += max(1, count - 1)
        return self._rows(variables, np.empty((self.p, variables.shape[1]))).T

    def evaluate(self, coded: ArrayLike, coefficients: ArrayLike) -> Floats:
        """Values of the polynomial, ``matrix(coded) @ coefficients``, without the whole matrix in memory.

        Parameters
        ----------
        coded : array, shape (n, k)
        coefficients : array, shape (p,) or (p, m)

        Returns
        -------
        array, shape (n,) or (n, m)
        """
        coded = self._check(coded)
        beta = np.asarray(coefficients, float)
        values = np.empty((len(coded), *beta.shape[1:]))
        work = np.empty((self.p, min(CHUNK, len(coded))))
        for start in range(0, len(coded), CHUNK):
            part = slice(start, start + CHUNK)
            variables = self.variables(coded[part])
            values[part] = self._rows(variables, work[:, : variables.shape[1]]).T @ beta
        return values

    def gradient(self, coded: ArrayLike) -> Floats:
        """Derivatives of the design-matrix rows by the coded factors; zero for categorical ones.

        Returns
        -------
        array, shape (n, p, k)
        """
        base, maps = self.derivatives
        rows = base.matrix(coded)
        return np.stack([rows @ maps[j] for j in range(self.k)], axis=2)

    def slopes(self, coded: ArrayLike, coefficients: ArrayLike) -> Floats:
        """Gradient of the polynomial by the coded factors, shape (n, k); fast on many points."""
        base, maps = self.derivatives
        return base.evaluate(coded, np.stack([m @ np.asarray(coefficients, float) for m in maps], axis=1))

    def hessian(self, coded: ArrayLike, coefficients: ArrayLike) -> Floats:
        """Second derivatives of the polynomial by the coded factors at one point.

        Parameters
        ----------
        coded : array, shape (k,)
        coefficients : array, shape (p,)

        Returns
        -------
        array, shape (k, k)
        """
        base, maps = self.derivatives
        rows = base.gradient(np.atleast_2d(np.asarray(coded, float)))[0]
        return np.array([(m @ np.asarray(coefficients, float)) @ rows for m in maps])

    def subset(self, keep: Iterable[Exponents]) -> Terms:
        """Only the given terms, in this object's order."""
        wanted = set(keep)
        unknown = wanted - set(self.exponents)
        if unknown:
            raise RsmkitError(f"model terms: {sorted(unknown)} are not terms of this model")
        return replace(self, exponents=tuple(e for e in self.exponents if e in wanted))

    @cached_property
    def plain(self) -> tuple[Terms, Floats]:
        """The same polynomials as products of powers alone.

        Returns
        -------
        terms : Terms
            Without any ``a*b*(a-b)``; these terms themselves where there is none.
        matrix : array, shape (plain.p, p)
            ``self.matrix(x) = terms.matrix(x) @ matrix``.
        """
        if not any(self.differences):
            return self, np.eye(self.p)
        parts = [monomials(e, difference_in(e, self.components)) for e in self.exponents]
        found = dict.fromkeys(e for part in parts for e, _ in part)
        plain = replace(self, exponents=tuple(found), components=())
        position, weights = {column: i for i, column in enumerate(plain.columns)}, np.zeros((plain.p, self.p))
        for index, (column, pair) in enumerate(zip(self.columns, self.differences, strict=True)):
            for monomial, weight in monomials(column, pair):
                weights[position[monomial], index] = weight
        return plain, weights

    def with_contrasts(self, contrasts: Contrasts) -> Terms:
        """The same terms with other columns for categorical factors."""
        return replace(self, contrasts=contrasts)

    def _check(self, coded: ArrayLike) -> Floats:
        points = np.asarray(coded, float)
        if points.ndim != 2 or points.shape[1] != self.k:
            raise RsmkitError(f"points must have shape (n, {self.k}), got {points.shape}")
        return points

    def variables(self, coded: ArrayLike) -> Floats:
        """One row per numeric factor and per contrast of a categorical one, shape (m, n)."""
        points = self._check(coded)
        if not any(self.levels):
            return points.T
        rows: list[Floats] = []
        for j, count in enumerate(self.levels):
            if not count:
                rows.append(points[:, j])
                continue
            index = np.round(points[:, j])
            if not ((index >= 0) & (index < count)).all():
                raise RsmkitError(f"factor {j + 1} is categorical: level indices run from 0 to {count - 1}")
            last = (index == count - 1) * float(self.contrasts == "sum")
            rows += [(index == level) - last for level in range(count)[self._own_columns(j)]]
        return np.array(rows)

    def _own_columns(self, factor: int) -> slice:
        """Levels of a categorical factor that have a column."""
        return slice(1, None) if self.contrasts == "treatment" else slice(self.levels[factor] - 1)

    def _expansions(self, exponents: Exponents) -> list[Exponents]:
        """Exponents over the variables of :meth:`variables` of every column a term stands for."""
        choices: list[list[Exponents]] = []
        for power, count in zip(exponents, self.levels, strict=True):
            if not count:
                choices.append([(power,)])
            elif power:
                choices.append([tuple(int(i == j) for i in range(count - 1)) for j in range(count - 1)])
            else:
                choices.append([(0,) * (count - 1)])
        return [tuple(x for part in combination for x in part) for combination in product(*choices)]

    @cached_property
    def differences(self) -> tuple[tuple[int, int] | None, ...]:
        """Per column the variables a and b of ``a*b*(a-b)``."""
        found = [difference_in(self.exponents[t], self.components) for t in self.column_terms]
        place = self.variable_factors.index
        return tuple(pair and (place(pair[0]), place(pair[1])) for pair in found)

    @cached_property
    def _recipes(self) -> tuple[tuple[int, int], ...]:
        """Per column the (column, variable) it is the product of; -1: one, -2: no such column yet."""
        known: dict[Exponents, int] = {}
        recipes = []
        for index, column in enumerate(self.columns):
            used = [v for v, power in enumerate(column) if power]
            if not used:
                recipe = (-1, -1)
            else:
                parent = tuple(x - (v == used[-1]) for v, x in enumerate(column))
                recipe = (-1 if sum(column) == 1 else known.get(parent, -2), used[-1])
            recipes.append(recipe)
            if self.differences[index] is None:
                known[column] = index
        return tuple(recipes)

    def _rows(self, variables: Floats, out: Floats) -> Floats:
        for index, (source, variable) in enumerate(self._recipes):
            if pair := self.differences[index]:
                np.subtract(variables[pair[0]], variables[pair[1]], out=out[index])
                for v, power in enumerate(self.columns[index]):
                    for _ in range(min(power, 1) if v in pair else power):
                        out[index] *= variables[v]
            elif variable < 0:
                out[index] = 1.0
            elif source == -1:
                out[index] = variables[variable]
            elif source == -2:
                out[index] = 1.0
                for v, power in enumerate(self.columns[index]):
                    for _ in range(power):
                        out[index] *= variables[v]
            else:
                np.multiply(out[source], variables[variable], out=out[index])
        return out

    @cached_property
    def derivatives(self) -> tuple[Terms, tuple[Floats, ...]]:
        """Terms B and one matrix D_j per factor so that d matrix(x)/dx_j = B.matrix(x) @ D_j."""
        plain, weights = self.plain
        base = replace(plain, exponents=hierarchical_closure(plain.exponents), components=())
        position = {column: i for i, column in enumerate(base.columns)}
        maps = []
        for j in range(self.k):
            row = self.variable_factors.index(j)
            derivative = np.zeros((base.p, plain.p))
            for index, column in enumerate(plain.columns):
                if column[row] and not self.levels[j]:
                    lowered = tuple(x - (v == row) for v, x in enumerate(column))
                    derivative[position[lowered], index] = column[row]
            maps.append(derivative @ weights if plain is not self else derivative)
        return base, tuple(maps)


@checked
def full_terms(factors: Space | int, order: int = 2) -> Terms:
    """All terms up to a total degree, in the order constant, linear, interactions, squares, cubic.

    Parameters
    ----------
    factors : Space or int
        The factors, or the number of numeric factors.
    order : int
        Highest total degree (1 linear, 2 full second order, 3 full third order).

    Raises
    ------
    RsmkitError
        If the order is below 0, or there would be too many terms to fit.
    """
    if order < 0:
        raise RsmkitError(f"model terms: order must be 0 or more, got {order}")
    levels = space_levels(factors) if isinstance(factors, Space) else (0,) * factors
    found: list[Exponents] = [()]
    for count in levels:
        highest = 1 if count else order
        found = [(*e, x) for e in found for x in range(min(highest, order - sum(e)) + 1)]
        if len(found) > MOST_TERMS:
            raise RsmkitError(
                f"model terms: order {order} of {len(levels)} factors has over {MOST_TERMS} terms"
            )
    return Terms(tuple(sorted(found, key=reading_order)), levels)


def space_levels(space: Space) -> tuple[int, ...]:
    """Give :attr:`Terms.levels` for the factors of a space."""
    return tuple(f.domain.categories for f in space)


@checked
def parse_terms(space: Space, words: Iterable[str]) -> Terms:
    """Read a model written by hand and complete its hierarchy, unless told not to.

    Parameters
    ----------
    space : Space
    words : iterable of str
        Groups ``FO`` (linear), ``TWI`` (two-way interactions), ``PQ`` (squares), ``SO`` (all three),
        ``cubic`` (all of the third degree), or single terms ``x1*x2^2``; ``0`` for a model
        without a constant; ``exact`` for the terms given and the constant alone.

    Returns
    -------
    Terms
        The constant and, without ``exact``, everything the given terms contain are added.

    Examples
    --------
    >>> space = Space(a=(0, 1), b=(0, 1))
    >>> parse_terms(space, ["FO", "b^2"]).names(space)
    ('1', 'a', 'b', 'b^2')
    >>> parse_terms(space, ["exact", "a*b"]).names(space)
    ('1', 'a*b')
    """
    cubic, words = full_terms(space, 3), list(words)
    constant = (0,) * len(space)
    wanted = {constant}
    for word in words:
        if word in ("0", EXACT) and word not in space.names:
            continue
        if word in GROUPS:
            wanted |= {e for e in cubic.exponents if group_of(e) in GROUPS[word]}
        else:
            wanted.add(_read_monomial(word, space))
    exact = EXACT in words and EXACT not in space.names
    chosen = tuple(sorted(wanted, key=reading_order)) if exact else hierarchical_closure(wanted)
    return Terms(tuple(e for e in chosen if e != constant) if "0" in words else chosen, cubic.levels)


def _read_monomial(text: str, space: Space) -> Exponents:
    names = "|".join(re.escape(name) for name in sorted(space.names, key=len, reverse=True))
    power = rf"\s*({names})(?:\^(\d+))?\s*"
    if not re.fullmatch(f"{power}([*:]{power})*", text):
        raise RsmkitError(
            f"model terms: '{text}' is neither a group (FO, TWI, PQ, SO, cubic) nor a product of powers "
            f"of {', '.join(space.names)}"
        )
    exponents = [0] * len(space)
    for name, exponent in re.findall(power, text):
        exponents[space.names.index(name)] += int(exponent or "1")
    if sum(exponents) > HIGHEST:
        raise RsmkitError(
            f"model terms: '{text}' is of degree {sum(exponents)}; at most {HIGHEST} is allowed"
        )
    return tuple(exponents)
