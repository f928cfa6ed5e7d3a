"""Compiled exchange of whole points over a list of candidates, for regions no coordinate line describes.

Fedorov's exchange (Theory of Optimal Experiments, 1972) in the row-wise form of Cook & Nachtsheim (1980),
Technometrics 22(3), 315-324: in turn every free row is replaced by the candidate that is best for the
criterion. What each candidate would give follows from its products with the inverse information matrix by the
rank-two formulas of :mod:`rsmkit.design.optimal.exchange`, and those products are updated, not computed
afresh.
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
    Candidates,
    Flags,
    Integers,
    Model,
    State,
    Work,
)
from rsmkit.design.optimal.exchange import (
    HOPE,
    PASSES,
    copy_matrix,
    criterion,
    fill_row,
    precision_row,
    rank_two,
    update,
)
from rsmkit.language.space import Floats

__all__ = ["search_candidates"]

TRIES = 50


@compiled
def _project(candidates: Candidates, vector: Floats, result: Floats) -> None:
    """Product of every candidate's model row with a vector."""
    result[:] = 0.0
    for m in range(len(vector)):
        f = vector[m]
        for c in range(len(result)):
            result[c] += f * candidates.columns[m, c]


@compiled
def _times(matrix: Floats, vector: Floats, result: Floats) -> None:
    """Product with a symmetric matrix."""
    result[:] = 0.0
    for a in range(len(vector)):
        f = vector[a]
        for b in range(len(result)):
            result[b] += f * matrix[a, b]


@compiled
def _dot(a: Floats, b: Floats) -> float:
    total = 0.0
    for m in range(len(a)):
        total += a[m] * b[m]
    return total


@compiled
def _own(candidates: Candidates, matrix: Floats, scratch: Floats, result: Floats) -> None:
    """Quadratic form of every candidate's model row in a matrix."""
    result[:] = 0.0
    for a in range(len(matrix)):
        _project(candidates, matrix[a], scratch)
        for c in range(len(result)):
            result[c] += scratch[c] * candidates.columns[a, c]


@compiled
def _apart(points: Floats, i: int, x: Floats, categorical: Flags, distance: float) -> bool:
    """Whether x keeps its distance from all rows but the i-th."""
    if distance <= 0.0:
        return True
    for q in range(len(points)):
        if q != i:
            total = 0.0
            for j in range(points.shape[1]):
                gap = x[j] - points[q, j]
                if categorical[j] and gap != 0.0:
                    gap = 2.0
                total += gap * gap
            if total < distance**2 * (1.0 - 1e-9):
                return False
    return True


@compiled
def _scatter(candidates: Candidates, model: Model, distance: float, state: State, i: int) -> None:
    """Put a random candidate in row i."""
    for _ in range(TRIES):
        c = np.random.randint(len(candidates.points))
        if _apart(state.points, i, candidates.points[c], model.categorical, distance):
            for j in range(state.points.shape[1]):
                state.points[i, j] = candidates.points[c, j]
            for m in range(state.rows.shape[1]):
                state.rows[i, m] = candidates.columns[m, c]
            break


@compiled
def _replace_row(
    candidates: Candidates, model: Model, distance: float, state: State, work: Work, i: int, trace: float
) -> float:
    """Put the best candidate in row i if it beats what is there; return the new tr W V."""
    points, rows, V, A, row, s = state.points, state.rows, state.V, state.A, work.row, work.line.scalars
    linear = len(state.weights) > 0
    g, old, Vg, Ag = row.g, row.before, row.Vg, row.Ag
    Vo, Ao = row.Vd, row.Ad  # of the row as it is; of its change once a candidate is chosen
    own, own_A = candidates.own[0], candidates.own[1]
    cVo, cVg, cAo, cAg = candidates.along[0], candidates.along[1], candidates.along[2], candidates.along[3]
    pii = precision_row(state, i, g)
    for m in range(len(old)):
        old[m] = rows[i, m]
    _times(V, g, Vg)
    _times(V, old, Vo)
    _project(candidates, Vo, cVo)
    _project(candidates, Vg, cVg)
    gg, go, oo = _dot(g, Vg), _dot(g, Vo), _dot(old, Vo)
    ggA, goA, ooA = 0.0, 0.0, 0.0
    if linear:
        _times(A, g, Ag)
        _times(A, old, Ao)
        _project(candidates, Ao, cAo)
        _project(candidates, Ag, cAg)
        ggA, goA, ooA = _dot(g, Ag), _dot(g, Ao), _dot(old, Ao)
    best, chosen = 1.0 + 1e-9 if not linear else 1e-9 * abs(trace), -1
    for c in range(len(own)):
        dd, gd = own[c] - 2.0 * cVo[c] + oo, cVg[c] - go
        value = (1.0 + gd) ** 2 + (pii - gg) * dd
        if linear:
            ddA, gdA = own_A[c] - 2.0 * cAo[c] + ooA, cAg[c] - goA
            change = (gg - pii) * ddA - 2.0 * (1.0 + gd) * gdA + dd * ggA
            value = -change / value if value > 1e-10 else -np.inf
        if value > best and _apart(points, i, candidates.points[c], model.categorical, distance):
            best, chosen = value, c
    if chosen < 0:
        return trace
    dd, gd = own[chosen] - 2.0 * cVo[chosen] + oo, cVg[chosen] - go
    ddA, gdA = own_A[chosen] - 2.0 * cAo[chosen] + ooA, cAg[chosen] - goA
    s[PII], s[GVG], s[GVD], s[DVD], s[GAG], s[GAD], s[DAD], s[TRACE] = pii, gg, gd, dd, ggA, gdA, ddA, trace
    for j in range(points.shape[1]):
        points[i, j] = candidates.points[chosen, j]
    for m in range(len(old)):
        rows[i, m] = candidates.columns[m, chosen]
        row.rest[m] = rows[i, m] - old[m]
    _times(V, row.rest, row.Vd)
    _project(candidates, row.Vd, cVo)
    if linear:
        _times(A, row.rest, row.Ad)
        _project(candidates, row.Ad, cAo)
    _follow(candidates, s, linear)
    return update(V, A, row, s, linear)


@compiled
def _follow(candidates: Candidates, s: Floats, linear: bool) -> None:
    """Bring every candidate's own forms to the new V and A; afresh they would cost p times as much."""
    own, own_A = candidates.own[0], candidates.own[1]
    cVd, cVg, cAd, cAg = candidates.along[0], candidates.along[1], candidates.along[2], candidates.along[3]
    k11, k12, k22, c11, c12, c22 = rank_two(s)
    for c in range(len(own)):
        x, y = k11 * cVd[c] + k12 * cVg[c], k12 * cVd[c] + k22 * cVg[c]
        own[c] -= x * cVd[c] + y * cVg[c]
        if linear:
            xA = k11 * cAd[c] + k12 * cAg[c] - c11 * cVd[c] - c12 * cVg[c]
            yA = k12 * cAd[c] + k22 * cAg[c] - c12 * cVd[c] - c22 * cVg[c]
            own_A[c] -= x * cAd[c] + y * cAg[c] + xA * cVd[c] + yA * cVg[c]


@compiled
def _climb(
    candidates: Candidates,
    model: Model,
    distance: float,
    state: State,
    work: Work,
    free: Integers,
    tolerance: float,
    best: float,
) -> float:
    """Exchange all free rows until a pass gains less than `tolerance`, or `best` is out of reach."""
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
        _own(candidates, state.V, candidates.along[0], candidates.own[0])
        if len(state.weights) > 0:
            _own(candidates, state.A, candidates.along[0], candidates.own[1])
        trace = -value
        for i in free:
            trace = _replace_row(candidates, model, distance, state, work, i, trace)
    return value if ridge == 0.0 else -np.inf


@compiled
def search_candidates(
    candidates: Candidates,
    model: Model,
    distance: float,
    state: State,
    work: Work,
    free: Integers,
    seed: int,
    kicks: int,
    kick_rows: int,
    tolerance: float,
) -> float:
    """One start over a list of candidates; the counterpart of :func:`rsmkit.design.optimal.exchange.search`.

    Parameters
    ----------
    candidates : Candidates
    distance : float
        No two rows closer than this.
    state : State
        ``state.points`` is changed in place and ends as the best design found.

    Returns
    -------
    float
        The criterion, larger is better; -inf if singular.
    """
    np.random.seed(seed)
    for i in range(len(state.points)):
        fill_row(model, state.points[i], state.rows[i])
    for i in free:
        if not _apart(state.points, i, state.points[i], model.categorical, distance):
            _scatter(candidates, model, distance, state, i)
    best = -np.inf
    for trial in range(kicks + 1):
        for _ in range(1 + np.random.randint(kick_rows) if trial > 0 else 0):
            _scatter(candidates, model, distance, state, free[np.random.randint(len(free))])
        value = _climb(candidates, model, distance, state, work, free, tolerance, best)
        if value > best + 1e-9 * abs(best) or trial == 0:
            best = value
            copy_matrix(state.points, work.points)
            copy_matrix(state.rows, work.rows)
        else:
            copy_matrix(work.points, state.points)
            copy_matrix(work.rows, state.rows)
    return float(best)
