"""Model, region and design as plain arrays: the form in which the compiled exchange takes them."""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rsmkit.design.region import Region
from rsmkit.language.exponents import difference_in
from rsmkit.language.space import Floats
from rsmkit.language.terms import Terms

__all__ = [
    "DAD",
    "DVD",
    "GAD",
    "GAG",
    "GVD",
    "GVG",
    "PII",
    "TRACE",
    "Candidates",
    "Line",
    "Lines",
    "Model",
    "RowChange",
    "Search",
    "State",
    "Work",
    "encode_candidates",
    "encode_model",
    "encode_region",
    "model_rows",
    "moments",
    "working_space",
]

Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]


class Model(NamedTuple):
    """The columns of the model matrix.

    A column is a product over factors of basis functions: powers of a numeric factor, indicators of the
    levels of a categorical one. In the full cubic terms of mixtures, ``a*b*(a-b)``, which have the exponents
    2 and 1, a difference takes the place of the second power.
    """

    exponents: Integers  # (p, k) power, or index of the level indicated; 0 leaves the factor out
    members: Integers  # (k, longest) the columns that contain factor j, padded with -1
    active: Integers  # (p, longest) the factors in column m, padded with -1
    categorical: Flags  # (k,)
    contrasts: Floats  # (k, levels, highest exponent) value of each indicator at each level
    pairs: Integers  # (p, 2) the components a and b of a column a*b*(a-b); -1 in others


class Lines(NamedTuple):
    """Where points may lie, coordinate by coordinate."""

    lows: Floats  # (k,)
    highs: Floats  # (k,)
    levels: Floats  # (k, most levels) allowed values of discrete and categorical factors
    level_counts: Integers  # (k,) 0 for a continuous factor
    normals: Floats  # (c, k) linear constraints normals @ x <= offsets
    offsets: Floats  # (c,)
    radius: float  # numeric coordinates lie in the ball of this radius
    distance: float  # no two points are closer than this (Euclidean, different categories count 2)


class State(NamedTuple):
    """The design and what follows from it."""

    points: Floats  # (n, k) coded
    rows: Floats  # (n, p) model matrix
    precision: Floats  # (n, n) inverse covariance of the runs; (0, 0) for independent runs
    prior: Floats  # (p, p) added to the information matrix
    weights: Floats  # (p, p) moment matrix of a trace criterion; (0, 0) for the determinant
    V: Floats  # (p, p) inverse of the information matrix
    A: Floats  # (p, p) V weights V


PII, GVG, GVD, DVD, GAG, GAD, DAD, TRACE = range(8)
"""Places in ``Line.scalars``. An array and not a tuple with names, because compiled code fills it in place;
the names are constants when it is compiled and cost nothing."""


class Line(NamedTuple):
    """The criterion along one coordinate: what is needed to evaluate it at any value."""

    base: Floats  # (B,) basis functions at the present value
    gV: Floats  # (B,) h_e' V g, with h_e the other factors' part of the terms of basis function e
    dV: Floats  # (B,) h_e' V d
    hV: Floats  # (B, B) h_e' V h_f
    gA: Floats
    dA: Floats
    hA: Floats
    scalars: Floats  # (8,) P_ii, g'Vg, g'Vd, d'Vd, g'Ag, g'Ad, d'Ad, tr W V at the places PII ... TRACE
    alone: Floats  # (2, B) 1 + g'Vd and g'Ad as polynomials in a continuous coordinate, lowest power first
    square: Floats  # (2, 2 B - 1) d'Vd and d'Ad
    ratio: Floats  # (2 B - 1,) det M_new / det M
    change: Floats  # (2 B - 1,) the change of tr W V times the ratio


class RowChange(NamedTuple):
    """One row of the model matrix while it changes by d; all (p,)."""

    g: Floats  # F' P_i
    before: Floats  # the row as it was
    Vg: Floats
    Ag: Floats
    Vd: Floats
    Ad: Floats
    rest: Floats  # scratch: the change itself, or every term without the factor that moves


class Work(NamedTuple):
    """Working space of one search."""

    row: RowChange
    squares: Floats  # (3, p, p) scratch
    others: Floats  # (n,) squared distances of a row to the others, the moving coordinate left out
    points: Floats  # (n, k) the best design so far
    rows: Floats  # (n, p)
    line: Line


class Search(NamedTuple):
    """All that one search works on."""

    model: Model
    lines: Lines
    state: State
    work: Work


class Candidates(NamedTuple):
    """Points to choose from, and their products with V and A that the exchange keeps up to date."""

    points: Floats  # (N, k) coded
    columns: Floats  # (p, N) model matrix, transposed
    own: Floats  # (2, N) c'Vc and c'Ac
    along: Floats  # (4, N) working space


def encode_candidates(model: Model, points: Floats) -> Candidates:
    """Model rows of the candidates, and working space."""
    columns = np.ascontiguousarray(model_rows(model, points).T)
    return Candidates(points.copy(), columns, np.zeros((2, len(points))), np.zeros((4, len(points))))


def working_space(model: Model, runs: int) -> Work:
    """Room for a search of so many runs."""
    p, k = model.exponents.shape
    size = model.contrasts.shape[2] + 1
    line = Line(
        base=np.zeros(size),
        gV=np.zeros(size),
        dV=np.zeros(size),
        hV=np.zeros((size, size)),
        gA=np.zeros(size),
        dA=np.zeros(size),
        hA=np.zeros((size, size)),
        scalars=np.zeros(8),
        alone=np.zeros((2, size)),
        square=np.zeros((2, 2 * size - 1)),
        ratio=np.zeros(2 * size - 1),
        change=np.zeros(2 * size - 1),
    )
    return Work(
        RowChange(*np.zeros((7, p))),
        np.zeros((3, p, p)),
        np.zeros(runs),
        np.zeros((runs, k)),
        np.zeros((runs, p)),
        line,
    )


def encode_model(terms: Terms) -> Model:
    """Spell out the columns of ``terms.matrix``, in the same order."""
    columns = []
    for exponents in terms.exponents:
        choices = [
            range(1, levels) if levels and power else (power,)
            for power, levels in zip(exponents, terms.levels, strict=True)
        ]
        columns += list(product(*choices))
    table = np.array(columns, dtype=np.int64).reshape(len(columns), terms.k)
    members = [np.flatnonzero(table[:, j]) for j in range(terms.k)]
    padded = np.full((terms.k, max(1, *map(len, members)) if terms.k > 1 else max(1, len(members[0]))), -1)
    active = np.full((len(table), max(1, int((table > 0).sum(axis=1).max()))), -1)
    for m, row in enumerate(table):
        inside = np.flatnonzero(row)
        active[m, : len(inside)] = inside
    contrasts = np.zeros((terms.k, max(1, *terms.levels, 1), max(1, int(table.max()))))
    for j, found in enumerate(members):
        padded[j, : len(found)] = found
        for level in range(1, terms.levels[j] if len(found) else 0):  # a factor left out has no columns
            contrasts[j, level, level - 1] = 1.0
    pairs = np.full((len(table), 2), -1, dtype=np.int64)
    for m, t in enumerate(terms.column_terms):
        pairs[m] = difference_in(terms.exponents[t], terms.components) or (-1, -1)
    return Model(table, padded.astype(np.int64), active, np.array(terms.levels) > 0, contrasts, pairs)


def encode_region(region: Region, distance: float) -> Lines:
    """Bounds, levels and linear constraints of a region; its nonlinear constraints are not in here."""
    levels = region.levels
    counts = np.array([len(found) for found in levels], dtype=np.int64)
    table = np.zeros((len(levels), max(1, int(counts.max()))))
    for j, found in enumerate(levels):
        table[j, : len(found)] = found
    normals, offsets = region.halfspaces
    return Lines(region.lows, region.highs, table, counts, normals, offsets, region.radius, distance)


def moments(model: Model, region: Region) -> Floats:
    """Average of ``f(x) f(x)'`` over the region, shape (p, p): exact for a box or ball, else by sampling.

    Numeric factors are uniform over the region, categorical ones uniform over their levels.
    """
    sample = region.sample_for_moments()
    if sample is not None:
        rows = model_rows(model, sample)
        return rows.T @ rows / len(rows)
    if (model.pairs >= 0).any():  # a^2 b - a b^2
        apart, weights = _powers_alone(model)
        return np.asarray(weights.T @ moments(apart, region) @ weights)
    p, k = model.exponents.shape
    result = np.ones((p, p))
    powers = np.zeros((p, p, k), dtype=np.int64)
    for j in range(k):
        e = model.exponents[:, j]
        if model.categorical[j]:
            count = len(region.levels[j])
            indicator = np.vstack([np.ones(count), model.contrasts[j, :count].T])[e]
            result *= indicator @ indicator.T / count
        else:
            powers[:, :, j] = e[:, None] + e[None, :]
    return result * region.monomial_means(powers)


def _powers_alone(model: Model) -> tuple[Model, Floats]:
    """Columns that are products of powers, and how the columns of the model are made of them."""
    different = np.flatnonzero(model.pairs[:, 0] >= 0)
    swapped = model.exponents[different].copy()
    for row, (a, b) in zip(swapped, model.pairs[different], strict=True):
        row[a], row[b] = 1, 2
    weights = np.vstack([np.eye(len(model.exponents)), -np.eye(len(model.exponents))[different]])
    exponents = np.vstack([model.exponents, swapped])
    return model._replace(exponents=exponents, pairs=np.full((len(exponents), 2), -1)), weights


def model_rows(model: Model, points: Floats) -> Floats:
    """The model matrix at coded points, shape (n, p)."""
    rows = np.ones((len(points), len(model.exponents)))
    for j in range(points.shape[1]):
        e = model.exponents[:, j]
        if model.categorical[j]:
            indicators = np.hstack([np.ones((len(points), 1)), model.contrasts[j][points[:, j].astype(int)]])
            rows *= indicators[:, e]
        else:
            e = np.where(model.pairs[:, 0] == j, 1, e)
            powers = np.vander(points[:, j], int(e.max()) + 1, increasing=True)
            rows *= powers[:, e]
    different = np.flatnonzero(model.pairs[:, 0] >= 0)
    a, b = model.pairs[different].T
    rows[:, different] *= points[:, a] - points[:, b]
    return rows
