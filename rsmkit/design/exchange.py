"""Compiled coordinate exchange: the inner loop of every optimal design.

The criterion is a function of the information matrix ``M = prior + F' P F`` with ``F`` the model matrix of
all runs and ``P`` the inverse covariance of the runs (identity unless runs share blocks or whole plots).
Changing row i of ``F`` by ``d`` changes ``M`` by ``d g' + g d' + P_ii d d'`` with ``g = F' P_i``, so with
``V = inv(M)`` and ``A = V W V``::

    ratio = det M_new / det M = (1 + g'Vd)^2 + (P_ii - g'Vg) d'Vd
    tr W V_new = tr W V + ((g'Vg - P_ii) d'Ad - 2 (1 + g'Vd) g'Ad + d'Vd g'Ag) / ratio

Along one coordinate ``d`` is a polynomial, both are known in closed form, and the best value of the
coordinate is found on the continuous line, not on a grid of levels. The exchange by coordinates is due to
Meyer & Nachtsheim (1995), Technometrics 37(1), 60-69; kicking and climbing again is iterated local search.

Everything here is in coded units, deterministic for a given seed, and in one file because numba renews the
machine code of a function only when the file that holds it changes.
"""
# ruff: noqa: NPY002 - inside compiled code this is numba's own generator, one per thread, seeded per start

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numpy as np
from numba import njit

from rsmkit.design.encoding import Flags, Integers, Line, Lines, Model, State
from rsmkit.space import Floats

__all__ = ["search"]

Function = TypeVar("Function", bound=Callable[..., Any])

GRID = 7  # points tried along a coordinate before the best is refined; a quartic has at most two maxima
SWEEPS = 2  # times a row's coordinates are gone through before the next row
PASSES = 200  # most passes over the rows of one climb; it stops long before


def _compiled(function: Function) -> Function:
    return cast(Function, njit(cache=True, nogil=True, error_model="numpy")(function))


@_compiled
def _basis(model: Model, j: int, t: float, e: int) -> float:
    value = 1.0
    if e > 0 and model.categorical[j]:
        value = model.contrasts[j, int(t), e - 1]
    else:
        for _ in range(e):
            value *= t
    return value


@_compiled
def _fill_row(model: Model, x: Floats, row: Floats) -> None:
    for m in range(len(row)):
        value = 1.0
        for j in range(len(x)):
            if model.exponents[m, j] > 0:
                value *= _basis(model, j, x[j], model.exponents[m, j])
        row[m] = value


@_compiled
def _copy(source: Floats, target: Floats) -> None:
    for i in range(len(source)):
        for j in range(source.shape[1]):
            target[i, j] = source[i, j]


@_compiled
def _invert(matrix: Floats, inverse: Floats) -> float:
    """Invert a positive definite matrix through its Cholesky factor; give log det, -inf when singular."""
    n = len(matrix)
    lower, columns = np.zeros((n, n)), np.zeros((n, n))
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


@_compiled
def _criterion(state: State, ridge: float) -> float:
    """Recompute V and A from the model matrix; give the criterion, larger is better, -inf when singular."""
    rows, V, A = state.rows, state.V, state.A
    n, p = rows.shape
    M = state.prior.copy()
    g = np.zeros(p)
    for i in range(n):
        _precision_row(state, i, g)
        for a in range(p):
            f = g[a]
            if f != 0.0:
                for b in range(p):
                    M[a, b] += f * rows[i, b]
    for a in range(p):
        M[a, a] += ridge
    log_det = _invert(M, V)
    if len(state.weights) == 0 or log_det == -np.inf:
        return log_det
    half = np.zeros((p, p))
    trace = 0.0
    for a in range(p):
        for b in range(p):
            v = V[a, b]
            for c in range(p):
                half[a, c] += v * state.weights[b, c]
        trace += half[a, a]
    for a in range(p):
        for b in range(p):
            A[a, b] = 0.0
        for b in range(p):
            h = half[a, b]
            for c in range(p):
                A[a, c] += h * V[b, c]
    return -trace


@_compiled
def _precision_row(state: State, i: int, g: Floats) -> float:
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


@_compiled
def _interval(lines: Lines, categorical: Flags, x: Floats, j: int) -> tuple[float, float]:
    """Give the part of the line through x along coordinate j that lies in the region."""
    low, high = lines.lows[j], lines.highs[j]
    if not categorical[j] and lines.radius < np.inf:
        rest = lines.radius**2
        for q in range(len(x)):
            if q != j and not categorical[q]:
                rest -= x[q] ** 2
        reach = np.sqrt(max(rest, 0.0))
        low, high = max(low, -reach), min(high, reach)
    for c in range(len(lines.offsets)):
        slope = lines.normals[c, j]
        if slope != 0.0:
            rest = lines.offsets[c]
            for q in range(len(x)):
                if q != j:
                    rest -= lines.normals[c, q] * x[q]
            if slope > 0.0:
                high = min(high, rest / slope)
            else:
                low = max(low, rest / slope)
    return low, high


@_compiled
def _separation(points: Floats, categorical: Flags, i: int, j: int, others: Floats) -> None:
    """Fill `others` with the squared distance of row i to every row, coordinate j left out."""
    for q in range(len(points)):
        others[q] = 0.0
        for c in range(points.shape[1]):
            if c != j:
                gap = points[i, c] - points[q, c]
                if categorical[c] and gap != 0.0:
                    gap = 2.0
                others[q] += gap * gap


@_compiled
def _clear(model: Model, lines: Lines, points: Floats, i: int, j: int, t: float, others: Floats) -> bool:
    """Whether row i may take the value t at coordinate j without coming too close to another row."""
    if lines.distance > 0.0:
        for q in range(len(points)):
            gap = t - points[q, j]
            if model.categorical[j] and gap != 0.0:
                gap = 2.0
            if q != i and others[q] + gap * gap < lines.distance**2 * (1.0 - 1e-9):
                return False
    return True


@_compiled
def _value(line: Line, model: Model, j: int, t: float, linear: bool) -> float:
    """Evaluate the criterion with coordinate j at t; larger is better."""
    pii, gg, gd, dd, ggA, gdA, ddA, trace = line.scalars
    for e in range(1, len(line.base)):
        u = _basis(model, j, t, e) - line.base[e]
        gd += u * line.gV[e]
        dd += 2.0 * u * line.dV[e]
        gdA += u * line.gA[e]
        ddA += 2.0 * u * line.dA[e]
        for f in range(1, len(line.base)):
            w = u * (_basis(model, j, t, f) - line.base[f])
            dd += w * line.hV[e, f]
            ddA += w * line.hA[e, f]
    ratio = (1.0 + gd) ** 2 + (pii - gg) * dd
    if not linear:
        return float(ratio)
    if ratio < 1e-10:
        return -np.inf
    return float(-trace - ((gg - pii) * ddA - 2.0 * (1.0 + gd) * gdA + dd * ggA) / ratio)


@_compiled
def _best_on_line(
    line: Line, model: Model, lines: Lines, points: Floats, i: int, j: int, linear: bool, others: Floats
) -> float:
    """Find the best allowed value of coordinate j of row i."""
    now = float(points[i, j])
    present = _value(line, model, j, now, linear)
    needed = present + 1e-9 * abs(present)
    low, high = _interval(lines, model.categorical, points[i], j)
    best_t, best = now, -np.inf
    if lines.level_counts[j] > 0:
        for q in range(lines.level_counts[j]):
            t = lines.levels[j, q]
            value = _value(line, model, j, t, linear)
            inside = low - 1e-9 <= t <= high + 1e-9
            if value > best and inside and _clear(model, lines, points, i, j, t, others):
                best_t, best = t, value
        return best_t if best > needed else now
    if high <= low:
        return now
    step = (high - low) / (GRID - 1)
    for q in range(GRID):
        t = low + q * step if q < GRID - 1 else high
        value = _value(line, model, j, t, linear)
        if value > best:
            best_t, best = t, value
    left, middle, right = max(low, best_t - step), best_t, min(high, best_t + step)
    at_left, at_right = _value(line, model, j, left, linear), _value(line, model, j, right, linear)
    for _ in range(12):  # successive parabolas through three points that bracket the maximum
        towards_left = (middle - left) * (best - at_right)
        towards_right = (middle - right) * (best - at_left)
        if towards_left == towards_right:
            break
        shift = (middle - left) * towards_left - (middle - right) * towards_right
        t = middle - 0.5 * shift / (towards_left - towards_right)
        if not left < t < right or abs(t - middle) < 1e-8:
            break
        value = _value(line, model, j, t, linear)
        if value > best:
            if t > middle:
                left, at_left = middle, best
            else:
                right, at_right = middle, best
            middle, best = t, value
        elif t > middle:
            right, at_right = t, value
        else:
            left, at_left = t, value
    best_t = middle
    if not _clear(model, lines, points, i, j, best_t, others):
        best = -np.inf
        for q in range(GRID + 2 * len(points)):
            t = low + q * step
            if q >= GRID:
                room = max(lines.distance**2 - others[(q - GRID) // 2], 0.0)
                t = points[(q - GRID) // 2, j] + (2.0 * (q % 2) - 1.0) * np.sqrt(room)
            if low <= t <= high:
                value = _value(line, model, j, t, linear)
                if value > best and _clear(model, lines, points, i, j, t, others):
                    best_t, best = t, value
    return best_t if best > needed else now


@_compiled
def _improve_row(model: Model, lines: Lines, state: State, i: int, trace: float) -> float:
    """Exchange every coordinate of row i for its best value; update V and A; return the new tr W V."""
    points, rows, V, A = state.points, state.rows, state.V, state.A
    n, p = rows.shape
    linear = len(state.weights) > 0
    size = model.contrasts.shape[2] + 1
    g, start = np.zeros(p), np.zeros(p)
    Vg, Ag, Vd, Ad = np.zeros(p), np.zeros(p), np.zeros(p), np.zeros(p)
    s = np.zeros(8)
    s[0], s[7] = _precision_row(state, i, g), trace
    for a in range(p):
        start[a] = rows[i, a]
        for b in range(p):
            Vg[a] += V[a, b] * g[b]
        if linear:
            for b in range(p):
                Ag[a] += A[a, b] * g[b]
        s[1] += g[a] * Vg[a]
        s[4] += g[a] * Ag[a]
    one, two = np.zeros((5, size)), np.zeros((2, size, size))
    line = Line(one[0], one[1], one[2], two[0], one[3], one[4], two[1], s)
    rest, others = np.zeros(p), np.zeros(n)
    changed = False
    for _ in range(SWEEPS):
        moved = False
        for j in range(points.shape[1]):
            one[:] = 0.0
            two[:] = 0.0
            for e in range(size):
                line.base[e] = _basis(model, j, points[i, j], e)
            for m in model.members[j]:
                if m < 0:
                    break
                rest[m] = 1.0
                for q in range(points.shape[1]):
                    if q != j and model.exponents[m, q] > 0:
                        rest[m] *= _basis(model, q, points[i, q], model.exponents[m, q])
                e = model.exponents[m, j]
                line.gV[e] += rest[m] * Vg[m]
                line.dV[e] += rest[m] * Vd[m]
                line.gA[e] += rest[m] * Ag[m]
                line.dA[e] += rest[m] * Ad[m]
                for q in model.members[j]:  # rest is known up to m; the matrices are symmetric
                    weight = rest[m] * rest[q] * (1.0 if q == m else 2.0)
                    line.hV[e, model.exponents[q, j]] += weight * V[m, q]
                    if linear:
                        line.hA[e, model.exponents[q, j]] += weight * A[m, q]
                    if q == m:
                        break
            if lines.distance > 0.0:
                _separation(points, model.categorical, i, j, others)
            t = _best_on_line(line, model, lines, points, i, j, linear, others)
            if t == points[i, j]:
                continue
            moved = True
            points[i, j] = t
            for m in model.members[j]:
                if m < 0:
                    break
                e = model.exponents[m, j]
                step = rest[m] * (_basis(model, j, t, e) - line.base[e])
                rows[i, m] += step
                for a in range(p):
                    Vd[a] += step * V[m, a]
                if linear:
                    for a in range(p):
                        Ad[a] += step * A[m, a]
            s[2], s[3], s[5], s[6] = 0.0, 0.0, 0.0, 0.0
            for m in range(p):
                d = rows[i, m] - start[m]
                s[2] += g[m] * Vd[m]
                s[3] += d * Vd[m]
                s[5] += g[m] * Ad[m]
                s[6] += d * Ad[m]
        if not moved:
            break
        changed = True
    return _update(V, A, Vd, Vg, Ad, Ag, s, linear) if changed else trace


@_compiled
def _update(
    V: Floats, A: Floats, Vd: Floats, Vg: Floats, Ad: Floats, Ag: Floats, s: Floats, linear: bool
) -> float:
    """V - Z K Z' with Z = [Vd, Vg] and K = inv([[d'Vd, 1 + g'Vd], [1 + g'Vd, g'Vg - P_ii]]); A likewise."""
    pii, gg, gd, dd, ggA, gdA, ddA, trace = s
    ratio = (1.0 + gd) ** 2 + (pii - gg) * dd
    k11, k12, k22 = (pii - gg) / ratio, (1.0 + gd) / ratio, -dd / ratio
    c11 = k11 * (ddA * k11 + gdA * k12) + k12 * (gdA * k11 + ggA * k12)
    c12 = k11 * (ddA * k12 + gdA * k22) + k12 * (gdA * k12 + ggA * k22)
    c22 = k12 * (ddA * k12 + gdA * k22) + k22 * (gdA * k12 + ggA * k22)
    for a in range(len(V)):
        x, y = k11 * Vd[a] + k12 * Vg[a], k12 * Vd[a] + k22 * Vg[a]
        if linear:
            xA = k11 * Ad[a] + k12 * Ag[a] - c11 * Vd[a] - c12 * Vg[a]
            yA = k12 * Ad[a] + k22 * Ag[a] - c12 * Vd[a] - c22 * Vg[a]
            for b in range(len(V)):
                A[a, b] -= x * Ad[b] + y * Ag[b] + xA * Vd[b] + yA * Vg[b]
        for b in range(len(V)):
            V[a, b] -= x * Vd[b] + y * Vg[b]
    return float(trace - k11 * ddA - 2.0 * k12 * gdA - k22 * ggA)


@_compiled
def _scatter(model: Model, lines: Lines, state: State, i: int) -> None:
    """Move row i to a random place of the region (hit and run along the coordinates)."""
    points = state.points
    others = np.zeros(len(points))
    for _ in range(SWEEPS):
        for j in range(points.shape[1]):
            _separation(points, model.categorical, i, j, others)
            low, high = _interval(lines, model.categorical, points[i], j)
            for _try in range(20):
                t = low + (high - low) * np.random.random()
                if lines.level_counts[j] > 0:
                    t = lines.levels[j, np.random.randint(lines.level_counts[j])]
                inside = low - 1e-9 <= t <= high + 1e-9
                if inside and _clear(model, lines, points, i, j, t, others):
                    points[i, j] = t
                    break
    _fill_row(model, points[i], state.rows[i])


@_compiled
def _climb(model: Model, lines: Lines, state: State, free: Integers, tolerance: float) -> float:
    """Improve all free rows until a pass gains less than `tolerance`; return the criterion."""
    value, ridge = -np.inf, 0.0
    for _ in range(PASSES):
        before, had_ridge = value, ridge > 0.0
        ridge = 0.0
        value = _criterion(state, ridge)
        if value == -np.inf:  # singular so far: a little prior information shows the way out
            ridge = 1e-4 * len(state.rows)
            value = _criterion(state, ridge)
        scale = abs(value) if len(state.weights) > 0 else float(len(state.V))
        if value - before < tolerance * scale and not had_ridge:
            break
        trace = -value
        for i in free:
            trace = _improve_row(model, lines, state, i, trace)
    return value if ridge == 0.0 else -np.inf


@_compiled
def search(
    model: Model,
    lines: Lines,
    state: State,
    free: Integers,
    seed: int,
    kicks: int,
    kick_rows: int,
    tolerance: float,
) -> float:
    """One start: climb from the given points, then kick a few rows at a time and climb again.

    The last round has no kick and goes on until nothing moves; ``state.points`` ends as the best design.

    Parameters
    ----------
    state : State
        Fixed rows, and for each free row a point of the region to begin from; everything but points,
        precision, prior and weights is working space.
    free : array of int
        The rows that may change.
    kicks, kick_rows : int
        How often, and how many rows at a time at most.
    tolerance : float
        Relative gain of a pass below which a climb stops.

    Returns
    -------
    float
        Larger is better: log det M, or minus trace(weights @ inv(M)); -inf if singular.
    """
    np.random.seed(seed)
    best_points, best_rows = np.zeros(state.points.shape), np.zeros(state.rows.shape)
    for i in range(len(state.points)):
        _fill_row(model, state.points[i], state.rows[i])
    others, best = np.zeros(len(state.points)), -np.inf
    for i in free:
        _separation(state.points, model.categorical, i, -1, others)
        for q in range(len(others)):
            if q != i and others[q] < lines.distance**2:
                _scatter(model, lines, state, i)
                break
    for trial in range(kicks + 2):
        if 0 < trial <= kicks:
            for _ in range(1 + np.random.randint(kick_rows)):
                _scatter(model, lines, state, free[np.random.randint(len(free))])
        value = _climb(model, lines, state, free, tolerance if trial <= kicks else 1e-6 * tolerance)
        if value > best + 1e-9 * abs(best) or trial == 0:
            best = value
            _copy(state.points, best_points)
            _copy(state.rows, best_rows)
        else:
            _copy(best_points, state.points)
            _copy(best_rows, state.rows)
    return float(best)
