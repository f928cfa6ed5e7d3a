"""Compiled coordinate exchange: the inner loop of every optimal design.

The criterion is a function of the information matrix ``M = prior + F' P F`` with ``F`` the model matrix of
all runs and ``P`` the inverse covariance of the runs (identity unless runs share blocks or whole plots).
Changing row i of ``F`` by ``d`` changes ``M`` by ``d g' + g d' + P_ii d d'`` with ``g = F' P_i``, so with
``V = inv(M)`` and ``A = V W V``::

    ratio = det M_new / det M = (1 + g'Vd)^2 + (P_ii - g'Vg) d'Vd
    tr W V_new = tr W V + ((g'Vg - P_ii) d'Ad - 2 (1 + g'Vd) g'Ad + d'Vd g'Ag) / ratio

Along one coordinate ``d`` is a polynomial, both are known in closed form, and the best value of the
coordinate is found on the continuous line, not on a grid of levels
(:mod:`rsmkit.design.optimal.line_search`). The exchange by coordinates is due to Meyer & Nachtsheim (1995),
Technometrics 37(1), 60-69; kicking and climbing again is iterated local search. For many coefficients the
first climb is preceded by slow cooling, in which coordinates take random values, good ones more often
(Kirkpatrick, Gelatt & Vecchi 1983, Science 220, 671-680; for designs Haines 1987, Technometrics 29(4),
439-447): the best designs are regular, and climbing from random points seldom meets them. Everything is in
coded units and deterministic for a given seed.
"""
# ruff: noqa: NPY002 - inside compiled code this is numba's own generator, one per thread, seeded per start

from __future__ import annotations

import numpy as np

from rsmkit.design.compiled import compiled
from rsmkit.design.optimal.encoding import (
    DAD,
    DVD,
    GAD,
    GAG,
    GVD,
    GVG,
    PII,
    TRACE,
    Integers,
    Lines,
    Model,
    RowChange,
    Search,
    State,
    Work,
)
from rsmkit.design.optimal.line_search import (
    allowed_interval,
    basis,
    best_on_line,
    clear,
    drawn_on_line,
    separation,
)
from rsmkit.language.space import Floats
from rsmkit.machine_code import Reference, reference

__all__ = [
    "HOPE",
    "PASSES",
    "copy_matrix",
    "criterion",
    "fill_row",
    "invert",
    "precision_row",
    "rank_two",
    "search",
    "update",
]

SWEEPS = 2  # times a row's coordinates are gone through before the next row
ROUGH = 1e-2  # tolerance of the climb before cooling
PASSES = 200  # most passes over the rows of one climb; it stops long before
HEAT, TRACE_HEAT = 0.045, 0.07  # where a design freezes with as many runs as coefficients
HOTTEST, COLDEST = 2.0, 0.5  # where cooling begins and ends, times that temperature
REFRESH = 10  # passes of cooling after which V is computed afresh
HOPE = 4.0  # a climb is given up when this many times its last gain would not reach the best


@compiled
def fill_row(model: Model, x: Floats, row: Floats) -> None:
    """Fill the model row of a point."""
    for m in range(len(row)):
        first, second = model.pairs[m, 0], model.pairs[m, 1]
        value = 1.0 if first < 0 else x[first] - x[second]
        for q in range(model.active.shape[1]):
            j = model.active[m, q]
            if j < 0:
                break
            value *= basis(model, j, x[j], 1 if j == first else model.exponents[m, j])
        row[m] = value


@compiled
def copy_matrix(source: Floats, target: Floats) -> None:
    """Element by element: assigning arrays would allocate one in case they overlap."""
    for i in range(len(source)):
        for j in range(source.shape[1]):
            target[i, j] = source[i, j]


@compiled
def invert(matrix: Floats, inverse: Floats, lower: Floats, columns: Floats) -> float:
    """Invert a positive definite matrix through its Cholesky factor; give log det, -inf when singular."""
    n = len(matrix)
    log_det = 0.0
    for i in range(n):
        for j in range(i + 1):
            total = matrix[i, j]
            for m in range(j):
                total -= lower[i, m] * lower[j, m]
            if i > j:
                lower[i, j] = total / lower[j, j]
            else:
                if not total > 1e-12 * matrix[i, i]:
                    return -np.inf
                lower[i, i] = np.sqrt(total)
                log_det += np.log(total)
    for j in range(n):  # columns of inv(lower), stored as rows so that the inner loop runs along memory
        columns[j, j] = 1.0 / lower[j, j]
        for i in range(j + 1, n):
            total = 0.0
            for m in range(j, i):
                total -= lower[i, m] * columns[j, m]
            columns[j, i] = total / lower[i, i]
    for i in range(n):
        for j in range(i + 1):
            total = 0.0
            for m in range(i, n):
                total += columns[i, m] * columns[j, m]
            inverse[i, j] = inverse[j, i] = total
    return log_det


@compiled
def criterion(state: State, work: Work, ridge: float) -> float:
    """Recompute V and A from the model matrix; give the criterion, larger is better, -inf when singular."""
    rows, V, A, M = state.rows, state.V, state.A, work.squares[0]
    n, p = rows.shape
    copy_matrix(state.prior, M)
    g = work.row.g
    for i in range(n):
        precision_row(state, i, g)
        for a in range(p):
            f = g[a]
            if f != 0.0:
                for b in range(p):
                    M[a, b] += f * rows[i, b]
    for a in range(p):
        M[a, a] += ridge
    log_det = invert(M, V, work.squares[1], work.squares[2])
    if len(state.weights) == 0 or log_det == -np.inf:
        return log_det
    half = work.squares[0]
    trace = 0.0
    for a in range(p):
        for b in range(p):
            half[a, b] = 0.0
            A[a, b] = 0.0
    for a in range(p):
        for b in range(p):
            v = V[a, b]
            for c in range(p):
                half[a, c] += v * state.weights[b, c]
        trace += half[a, a]
    for a in range(p):
        for b in range(p):
            h = half[a, b]
            for c in range(p):
                A[a, c] += h * V[b, c]
    return -trace


@compiled
def precision_row(state: State, i: int, g: Floats) -> float:
    """Fill g with F' P_i; return P_ii."""
    for m in range(len(g)):
        g[m] = state.rows[i, m]
    if len(state.precision) == 0:
        return 1.0
    for m in range(len(g)):
        g[m] *= state.precision[i, i]
    for q in range(len(state.rows)):
        w = state.precision[i, q]
        if q != i and w != 0.0:
            for m in range(len(g)):
                g[m] += w * state.rows[q, m]
    return float(state.precision[i, i])


@compiled
def _change_row(
    at: Reference[Search],
    i: int,
    trace: float,
    temperature: float,
    values: int,
) -> float:
    """Exchange every coordinate of row i for its best value; update V and A; return the new tr W V.

    At a temperature above zero for a random value, of so many on a continuous coordinate.

    One long function on purpose: taken apart, its steps hand dozens of arrays to each other for every
    coordinate of every run, and the search takes a quarter longer (numba 0.68, also when told to inline).
    """
    model, lines, state, work = at[0]
    points, rows, V, A, line, others = state.points, state.rows, state.V, state.A, work.line, work.others
    g, before, Vg, Ag, Vd, Ad, rest = work.row
    s = line.scalars
    p, size = rows.shape[1], len(line.base)
    linear = len(state.weights) > 0
    for a in range(p):
        Vg[a], Ag[a], Vd[a], Ad[a] = 0.0, 0.0, 0.0, 0.0
    for e in range(len(s)):
        s[e] = 0.0
    # what stays the same while the row changes; d, and so Vd and Ad, are nothing yet
    s[PII], s[TRACE] = precision_row(state, i, g), trace
    for a in range(p):
        before[a] = rows[i, a]
        f = g[a]
        for b in range(p):
            Vg[b] += f * V[a, b]
        if linear:
            for b in range(p):
                Ag[b] += f * A[a, b]
    for a in range(p):
        s[GVG] += g[a] * Vg[a]
        s[GAG] += g[a] * Ag[a]
    changed = False
    for _ in range(1 if temperature > 0.0 else SWEEPS):
        moved = False
        for j in range(points.shape[1]):
            # A term is a basis function of the factor that moves, times a rest that stays as it is. So the
            # sums over terms shrink to sums over few basis functions: a value on the line costs next to
            # nothing, however many terms the model has.
            for e in range(size):
                line.base[e] = basis(model, j, points[i, j], e)
                line.gV[e], line.dV[e], line.gA[e], line.dA[e] = 0.0, 0.0, 0.0, 0.0
                for f in range(size):
                    line.hV[e, f], line.hA[e, f] = 0.0, 0.0
            for m in model.members[j]:
                if m < 0:
                    break
                product = 1.0
                for a in range(model.active.shape[1]):
                    q = model.active[m, a]
                    if q < 0:
                        break
                    if q != j:
                        product *= basis(model, q, points[i, q], model.exponents[m, q])
                rest[m] = product
                e = model.exponents[m, j]
                line.gV[e] += product * Vg[m]
                line.dV[e] += product * Vd[m]
                if linear:
                    line.gA[e] += product * Ag[m]
                    line.dA[e] += product * Ad[m]
                for q in model.members[j]:  # rest is known up to m; the matrices are symmetric
                    weight = product * rest[q] * (1.0 if q == m else 2.0)
                    line.hV[e, model.exponents[q, j]] += weight * V[m, q]
                    if linear:
                        line.hA[e, model.exponents[q, j]] += weight * A[m, q]
                    if q == m:
                        break
            if lines.distance > 0.0:
                separation(points, model.categorical, i, j, others)
            if temperature > 0.0:
                t = drawn_on_line(line, model, lines, points, i, j, linear, others, temperature, values)
            else:
                t = best_on_line(line, model, lines, points, i, j, linear, others)
            if t == points[i, j]:
                continue
            moved = True
            points[i, j] = t
            for m in model.members[j]:  # d, Vd and Ad follow at once; V and A wait until the row is done
                if m < 0:
                    break
                e = model.exponents[m, j]
                step = rest[m] * (basis(model, j, t, e) - line.base[e])
                rows[i, m] += step
                for a in range(p):
                    Vd[a] += step * V[m, a]
                if linear:
                    for a in range(p):
                        Ad[a] += step * A[m, a]
            s[GVD], s[DVD], s[GAD], s[DAD] = 0.0, 0.0, 0.0, 0.0
            for m in range(p):
                d = rows[i, m] - before[m]
                s[GVD] += g[m] * Vd[m]
                s[DVD] += d * Vd[m]
                s[GAD] += g[m] * Ad[m]
                s[DAD] += d * Ad[m]
        if not moved:
            break
        changed = True
    # they cost p^2 each: brought up to date once per row, not once per coordinate
    return update(V, A, work.row, s, linear) if changed else trace


@compiled
def rank_two(s: Floats) -> tuple[float, float, float, float, float, float]:
    """Give K = inv([[d'Vd, 1 + g'Vd], [1 + g'Vd, g'Vg - P_ii]]), and C = K Z'AZ K with Z = [d, g]."""
    pii, gg, gd, dd, ggA, gdA, ddA, _ = s
    ratio = (1.0 + gd) ** 2 + (pii - gg) * dd
    k11, k12, k22 = (pii - gg) / ratio, (1.0 + gd) / ratio, -dd / ratio
    c11 = k11 * (ddA * k11 + gdA * k12) + k12 * (gdA * k11 + ggA * k12)
    c12 = k11 * (ddA * k12 + gdA * k22) + k12 * (gdA * k12 + ggA * k22)
    c22 = k12 * (ddA * k12 + gdA * k22) + k22 * (gdA * k12 + ggA * k22)
    return k11, k12, k22, c11, c12, c22


@compiled
def update(V: Floats, A: Floats, row: RowChange, s: Floats, linear: bool) -> float:
    """V - Z K Z' with Z = [Vd, Vg], A likewise; return the new tr W V."""
    Vd, Vg, Ad, Ag = row.Vd, row.Vg, row.Ad, row.Ag
    k11, k12, k22, c11, c12, c22 = rank_two(s)
    for a in range(len(V)):
        x, y = k11 * Vd[a] + k12 * Vg[a], k12 * Vd[a] + k22 * Vg[a]
        if linear:
            xA = k11 * Ad[a] + k12 * Ag[a] - c11 * Vd[a] - c12 * Vg[a]
            yA = k12 * Ad[a] + k22 * Ag[a] - c12 * Vd[a] - c22 * Vg[a]
            for b in range(len(V)):
                A[a, b] -= x * Ad[b] + y * Ag[b] + xA * Vd[b] + yA * Vg[b]
        for b in range(len(V)):
            V[a, b] -= x * Vd[b] + y * Vg[b]
    return float(s[TRACE] - k11 * s[DAD] - 2.0 * k12 * s[GAD] - k22 * s[GAG])


@compiled
def _scatter(model: Model, lines: Lines, state: State, others: Floats, i: int) -> None:
    """Move row i to a random place of the region (hit and run along the coordinates)."""
    points = state.points
    for _ in range(SWEEPS):
        for j in range(points.shape[1]):
            separation(points, model.categorical, i, j, others)
            low, high = allowed_interval(lines, model.categorical, points[i], j)
            for _try in range(20):
                t = low + (high - low) * np.random.random()
                if lines.level_counts[j] > 0:
                    t = lines.levels[j, np.random.randint(lines.level_counts[j])]
                inside = low - 1e-9 <= t <= high + 1e-9
                if inside and clear(model, lines, points, i, j, t, others):
                    points[i, j] = t
                    break
    fill_row(model, points[i], state.rows[i])


@compiled
def _climb(at: Reference[Search], free: Integers, tolerance: float, best: float, values: int) -> float:
    """Improve all free rows until a pass gains less than `tolerance`, or `best` is out of reach."""
    state, work = at[0].state, at[0].work
    value, ridge = -np.inf, 0.0
    for _ in range(PASSES):
        before, had_ridge = value, ridge > 0.0
        ridge = 0.0
        value = criterion(state, work, ridge)
        if value == -np.inf:  # singular so far: a little prior information shows the way out
            ridge = 1e-4 * len(state.rows)
            value = criterion(state, work, ridge)
        scale = abs(value) if len(state.weights) > 0 else float(len(state.V))
        if not had_ridge and value - before < max(tolerance * scale, (best - value) / HOPE):
            break
        trace = -value
        for i in free:
            trace = _change_row(at, i, trace, 0.0, values)
    return value if ridge == 0.0 else -np.inf


@compiled
def _cool(at: Reference[Search], free: Integers, passes: int, values: int) -> None:
    """Let all free rows take random values while the temperature falls, in so many passes over them."""
    state, work = at[0].state, at[0].work
    if _climb(at, free, ROUGH, -np.inf, values) == -np.inf:
        return
    n, p = state.rows.shape
    freezing = (TRACE_HEAT if len(state.weights) > 0 else HEAT) * min(1.0, p / n) ** 2
    trace = 0.0
    for q in range(passes):
        if q % REFRESH == 0:
            trace = -criterion(state, work, 0.0)
            if trace == np.inf:
                return
        temperature = freezing * HOTTEST * (COLDEST / HOTTEST) ** (q / passes)
        for i in free:
            trace = _change_row(at, i, trace, temperature, values)


@compiled
def search(
    model: Model,
    lines: Lines,
    state: State,
    work: Work,
    free: Integers,
    seed: int,
    kicks: int,
    kick_rows: int,
    tolerance: float,
    passes: int,
    values: int,
) -> float:
    """One start: cool and climb from the given points, then kick a few rows at a time and climb again.

    The last round has no kick and goes on until nothing moves; ``state.points`` ends as the best design.

    Parameters
    ----------
    state : State
        Fixed rows, and for each free row a point of the region to begin from; everything but points,
        precision, prior and weights is working space.
    work : Work
        Working space.
    free : array of int
        The rows that may change.
    kicks, kick_rows : int
        How often, and how many rows at a time at most.
    tolerance : float
        Relative gain of a pass below which a climb stops.
    passes : int
        Passes over the rows while cooling; 0 climbs at once.
    values : int
        Equally spaced values of a continuous coordinate that cooling draws from.

    Returns
    -------
    float
        Larger is better: log det M, or minus trace(weights @ inv(M)); -inf if singular.
    """
    np.random.seed(seed)
    at = reference(Search(model, lines, state, work))
    for i in range(len(state.points)):
        fill_row(model, state.points[i], state.rows[i])
    best = -np.inf
    for i in free:
        separation(state.points, model.categorical, i, -1, work.others)
        for q in range(len(work.others)):
            if q != i and work.others[q] < lines.distance**2:
                _scatter(model, lines, state, work.others, i)
                break
    if passes > 0:
        _cool(at, free, passes, values)
    for trial in range(kicks + 2):
        if trial > kicks:
            tolerance *= 1e-6
        elif trial > 0:
            for _ in range(1 + np.random.randint(kick_rows)):
                _scatter(model, lines, state, work.others, free[np.random.randint(len(free))])
        last = trial > kicks
        value = _climb(
            at,
            free,
            1e-6 * tolerance if last else tolerance,
            -np.inf if last else best,
            values,
        )
        if value > best + 1e-9 * abs(best) or trial == 0:
            best = value
            copy_matrix(state.points, work.points)
            copy_matrix(state.rows, work.rows)
        else:
            copy_matrix(work.points, state.points)
            copy_matrix(work.rows, state.rows)
    return float(best)
