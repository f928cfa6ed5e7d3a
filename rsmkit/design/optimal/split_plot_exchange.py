"""Compiled coordinate exchange at both levels of a split plot: see :mod:`rsmkit.design.optimal.split_plot`.

A run's change of its model row by ``d`` changes M by ``d g' + g d' + own d d'`` with ``g`` the row of
``X' V^-1`` and ``own = 1 - c``; what that does to the criterion is known in closed form. A plot's change is
worked out with a Cholesky factor.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rsmkit.design.compiled import compiled
from rsmkit.design.optimal.encoding import Flags, Integers, Lines, Model
from rsmkit.design.optimal.exchange import copy_matrix, fill_row, invert
from rsmkit.language.space import Floats

__all__ = ["PlotState", "PlotWork", "climb", "plot_work"]

GAIN = 1e-9  # relative gain that counts
PASSES = 60  # most passes over all coordinates; a climb stops long before
NEAR = 7  # values tried around the present one in a refinement


class PlotState(NamedTuple):
    """The design and what follows from it; rows of a plot follow each other."""

    points: Floats  # (n, k) coded
    rows: Floats  # (n, p) model matrix
    ends: Integers  # (plots + 1,) first row of every plot, and the number of rows
    shrinks: Floats  # (plots,) c: the plot's block of V^-1 is I - c 1 1'
    held: Flags  # (k,) factors that keep one setting in a plot
    free_from: int  # first row that may change
    free_plots: Flags  # (plots,) whether hard factors may change
    prior: Floats  # (p, p) added to the information matrix
    weights: Floats  # (p, p) of a trace criterion; (0, 0) for the determinant


class PlotWork(NamedTuple):
    """Working space."""

    M: Floats
    V: Floats
    A: Floats  # (p, p) V weights V
    others: Floats
    trial: Floats
    lower: Floats
    columns: Floats
    inverse: Floats
    plot: Floats  # (n, p) rows of a plot that are tried
    best: Floats  # (n, p) the best of them
    vectors: Floats  # (6, p)
    x: Floats  # (k,)


def plot_work(n: int, k: int, p: int) -> PlotWork:
    """Working space for one problem."""
    M, V, A, others, trial, lower, columns, inverse = np.zeros((8, p, p))
    return PlotWork(
        M,
        V,
        A,
        others,
        trial,
        lower,
        columns,
        inverse,
        np.zeros((n, p)),
        np.zeros((n, p)),
        np.zeros((6, p)),
        np.zeros(k),
    )


@compiled
def _add_plot(rows: Floats, first: int, last: int, shrink: float, sums: Floats, total: Floats) -> None:
    """Add what a plot tells to an information matrix."""
    p = rows.shape[1]
    sums[:] = 0.0
    for i in range(first, last):
        for a in range(p):
            sums[a] += rows[i, a]
            for b in range(p):
                total[a, b] += rows[i, a] * rows[i, b]
    for a in range(p):
        for b in range(p):
            total[a, b] -= shrink * sums[a] * sums[b]


@compiled
def _trace(weights: Floats, inverse: Floats) -> float:
    total = 0.0
    for a in range(len(weights)):
        for b in range(len(weights)):
            total += weights[a, b] * inverse[a, b]
    return total


@compiled
def _worth(state: PlotState, work: PlotWork, matrix: Floats, inverse: Floats) -> float:
    """The criterion of an information matrix, larger is better; fills its inverse."""
    log_det = invert(matrix, inverse, work.lower, work.columns)
    if len(state.weights) == 0 or log_det == -np.inf:
        return log_det
    return -_trace(state.weights, inverse)


@compiled
def _refresh(state: PlotState, work: PlotWork, ridge: float) -> float:
    """Work out M, V and A from the rows; give the criterion."""
    p = state.rows.shape[1]
    copy_matrix(state.prior, work.M)
    for plot in range(len(state.shrinks)):
        first, last = state.ends[plot], state.ends[plot + 1]
        _add_plot(state.rows, first, last, state.shrinks[plot], work.vectors[0], work.M)
    for a in range(p):
        work.M[a, a] += ridge
    return _settle(state, work)


@compiled
def _settle(state: PlotState, work: PlotWork) -> float:
    """Work out V and A from M; give the criterion."""
    value = _worth(state, work, work.M, work.V)
    p = len(work.M)
    if len(state.weights) > 0:
        for a in range(p):
            for b in range(p):
                total = 0.0
                for c in range(p):
                    total += work.V[a, c] * state.weights[c, b]
                work.trial[a, b] = total
        for a in range(p):
            for b in range(p):
                total = 0.0
                for c in range(p):
                    total += work.trial[a, c] * work.V[c, b]
                work.A[a, b] = total
    return value


@compiled
def _count(lines: Lines, j: int, width: float) -> int:
    """How many values of a factor are tried."""
    if width > 0.0 and lines.level_counts[j] < 0:
        return NEAR
    return int(abs(lines.level_counts[j]))


@compiled
def _tried(lines: Lines, j: int, width: float, number: int, present: float) -> float:
    """One of them: of the list, or around the present one."""
    if width > 0.0 and lines.level_counts[j] < 0:
        value = present + width * (2.0 * number / (NEAR - 1) - 1.0)
        return float(min(max(value, lines.lows[j]), lines.highs[j]))
    return float(lines.levels[j, number])


@compiled
def _allowed(lines: Lines, model: Model, x: Floats) -> bool:
    for c in range(len(lines.offsets)):
        total = -lines.offsets[c]
        for j in range(len(x)):
            total += lines.normals[c, j] * x[j]
        if total > 1e-9:
            return False
    if lines.radius < np.inf:
        total = 0.0
        for j in range(len(x)):
            if not model.categorical[j]:
                total += x[j] ** 2
        return bool(total <= lines.radius**2 * (1.0 + 1e-9))
    return True


@compiled
def _quadratic(a: Floats, matrix: Floats, b: Floats) -> float:
    total = 0.0
    for i in range(len(a)):
        part = 0.0
        for j in range(len(b)):
            part += matrix[i, j] * b[j]
        total += a[i] * part
    return total


@compiled
def _move_plot(
    model: Model,
    lines: Lines,
    state: PlotState,
    work: PlotWork,
    value: float,
    plot: int,
    j: int,
    width: float,
) -> float:
    """Give a hard factor its best value in a plot."""
    first, last = state.ends[plot], state.ends[plot + 1]
    p, shrink = state.rows.shape[1], state.shrinks[plot]
    sums = work.vectors[0]
    work.others[:] = 0.0
    _add_plot(state.rows, first, last, shrink, sums, work.others)
    for a in range(p):
        for b in range(p):
            work.others[a, b] = work.M[a, b] - work.others[a, b]
    best, chosen = value + GAIN * max(1.0, abs(value)), np.nan
    present = state.points[first, j]
    for number in range(_count(lines, j, width)):
        tried = _tried(lines, j, width, number, present)
        sound = tried != present
        for i in range(first, last):
            if not sound:
                break
            for q in range(len(work.x)):
                work.x[q] = state.points[i, q]
            work.x[j] = tried
            sound = _allowed(lines, model, work.x)
            fill_row(model, work.x, work.plot[i])
        if not sound:
            continue
        copy_matrix(work.others, work.trial)
        _add_plot(work.plot, first, last, shrink, sums, work.trial)
        worth = _worth(state, work, work.trial, work.inverse)
        if worth > best:
            best, chosen = worth, tried
            for i in range(first, last):
                for a in range(p):
                    work.best[i, a] = work.plot[i, a]
    if np.isnan(chosen):
        return value
    copy_matrix(work.others, work.M)
    _add_plot(work.best, first, last, shrink, sums, work.M)
    for i in range(first, last):
        state.points[i, j] = chosen
        for a in range(p):
            state.rows[i, a] = work.best[i, a]
    return _settle(state, work)


@compiled
def _move_run(
    model: Model,
    lines: Lines,
    state: PlotState,
    work: PlotWork,
    value: float,
    plot: int,
    i: int,
    width: float,
) -> float:
    """Give the easy factors of a run their best values, one after the other."""
    p, shrink = state.rows.shape[1], state.shrinks[plot]
    row, d, g = work.vectors[1], work.vectors[2], work.vectors[3]
    own = 1.0 - shrink
    for j in range(len(state.held)):
        if state.held[j]:
            continue
        for a in range(p):
            g[a] = state.rows[i, a]
            for q in range(state.ends[plot], state.ends[plot + 1]):
                g[a] -= shrink * state.rows[q, a]
        gvg = _quadratic(g, work.V, g)
        gag = _quadratic(g, work.A, g) if len(state.weights) > 0 else 0.0
        best, chosen = value + GAIN * max(1.0, abs(value)), np.nan
        present = state.points[i, j]
        for q in range(len(work.x)):
            work.x[q] = state.points[i, q]
        for number in range(_count(lines, j, width)):
            work.x[j] = _tried(lines, j, width, number, present)
            if work.x[j] == present or not _allowed(lines, model, work.x):
                continue
            fill_row(model, work.x, row)
            for a in range(p):
                d[a] = row[a] - state.rows[i, a]
            gvd, dvd = _quadratic(g, work.V, d), _quadratic(d, work.V, d)
            ratio = (1.0 + gvd) ** 2 + (own - gvg) * dvd
            if ratio <= 1e-12:
                continue
            if len(state.weights) == 0:
                worth = value + np.log(ratio)
            else:
                gad, dad = _quadratic(g, work.A, d), _quadratic(d, work.A, d)
                worth = value - ((gvg - own) * dad - 2.0 * (1.0 + gvd) * gad + dvd * gag) / ratio
            if worth > best:
                best, chosen = worth, work.x[j]
        if np.isnan(chosen):
            continue
        work.x[j] = chosen
        fill_row(model, work.x, row)
        for a in range(p):
            d[a] = row[a] - state.rows[i, a]
        for a in range(p):
            for b in range(p):
                work.M[a, b] += d[a] * g[b] + g[a] * d[b] + own * d[a] * d[b]
        for a in range(p):
            state.rows[i, a] = row[a]
        state.points[i, j] = chosen
        value = _settle(state, work)
    return value


@compiled
def climb(model: Model, lines: Lines, state: PlotState, work: PlotWork, width: float, ridge: float) -> float:
    """Exchange coordinates until a pass gains nothing; give the criterion, -inf when singular.

    `width` is 0 to try the values listed in `lines`, whose counts are negative for continuous factors; else
    the half width of steps around the present value of these. A small `ridge` helps through singular designs
    and is taken away after the first pass.
    """
    for i in range(len(state.points)):
        fill_row(model, state.points[i], state.rows[i])
    value = _refresh(state, work, ridge)
    for _ in range(PASSES):
        before = value
        for plot in range(len(state.shrinks)):
            if state.free_plots[plot]:
                for j in range(len(state.held)):
                    if state.held[j]:
                        value = _move_plot(model, lines, state, work, value, plot, j, width)
            for i in range(max(state.ends[plot], state.free_from), state.ends[plot + 1]):
                value = _move_run(model, lines, state, work, value, plot, i, width)
        if ridge > 0.0:
            ridge = 0.0
            value = _refresh(state, work, 0.0)
        elif not value - before > GAIN * max(1.0, abs(before)):
            break
    return _refresh(state, work, 0.0)
