"""Local search from the best points of a genetic algorithm, and over neighbouring levels."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from scipy.optimize import NonlinearConstraint, minimize

from rsmkit.language.space import Floats
from rsmkit.optimum.local.determined import WORSE, determined
from rsmkit.optimum.local.local_search import Local, LocalSearch
from rsmkit.optimum.local.settle import settle
from rsmkit.optimum.problem import Archive, Evaluation
from rsmkit.optimum.unit_box import from_unit, to_unit

__all__ = ["best_row", "polish", "pull_back"]

MOST_TURNS = 4
"""Descents from one start under equalities."""
ROUNDING = 1e-12
"""An end this close to a bound, as a fraction of the range, is meant to lie on it."""


def best_row(archive: Archive, evaluation: Evaluation) -> int:
    """Row of the best point of a scalar problem: the least violation first, then the least objective."""
    objective = np.nan_to_num(evaluation.objectives[:, 0], nan=np.inf)
    return int(np.lexsort((objective, archive.violation(evaluation)))[0])


def _starts(archive: Archive, local: LocalSearch) -> Floats:
    """Best points so far that differ enough from each other, natural units, shape (n, k)."""
    known = archive.everything()
    objective = np.nan_to_num(known.objectives[:, 0], nan=np.inf)
    unit = to_unit(archive.problem.space, known.points)
    chosen: list[int] = []
    for row in np.lexsort((objective, archive.violation(known))):
        if all(np.abs(unit[row] - unit[other]).max() >= local.distance for other in chosen):
            chosen.append(int(row))
            if len(chosen) == local.starts:
                break
    return known.points[chosen]


def polish(archive: Archive, local: LocalSearch | None = None) -> Evaluation:
    """Improve the best points so far by SLSQP (L-BFGS-B without constraints), then try neighbouring levels.

    Parameters
    ----------
    archive : Archive
        Scalar problem and what has been evaluated of it.
    local : LocalSearch, optional
        Starts and differences; the default suits surfaces.

    Returns
    -------
    Evaluation
        One row: the best point of all, worse than the best before by no more than rounding.
    """
    local = local or LocalSearch()
    known = archive.everything()
    best = known.rows([best_row(archive, known)])
    for start in _starts(archive, local):
        best = _better(archive, best, _descend(archive, start, local))
    while True:
        improved = best
        for neighbour in _neighbours(archive, best.points[0]):
            improved = _better(archive, improved, _descend(archive, neighbour, local))
        if improved is best:
            return determined(archive, settle(archive, best)) if local.settle else best
        best = improved


def _better(archive: Archive, old: Evaluation, new: Evaluation) -> Evaluation:
    """The better of two; the old one when they differ by rounding, so that rounding decides nothing."""
    before, after = old.objectives[0, 0], new.objectives[0, 0]
    violation = np.r_[archive.violation(old), archive.violation(new)]
    if violation[1] == violation[0]:
        return new if after < before - WORSE * abs(before) else old
    return new if violation[1] < violation[0] else old


def _neighbours(archive: Archive, point: Floats) -> list[Floats]:
    """Points one level away in one factor (any other level of a categorical one), natural units."""
    space = archive.problem.space
    found = []
    for j, factor in enumerate(space):
        count = factor.domain.level_count
        here = int(to_unit(space, point[None])[0, j] * count)
        for level in factor.domain.neighbours(here):
            unit = to_unit(space, point[None])
            unit[0, j] = (level + 0.5) / count
            found.append(from_unit(space, unit)[0])
    return found


def _descend(archive: Archive, start: Floats, settings: LocalSearch) -> Evaluation:
    """Minimise locally from one natural point, shape (k,); one row.

    Where a factor that an equality is solved for ends on a bound, the descent goes on with another one.
    """
    found = _descend_once(archive, start, settings)
    if archive.problem.space.affine is None or settings.method == "cobyqa":
        return found
    for _ in range(MOST_TURNS):
        again = _descend_once(archive, found.points[0], settings)
        if _better(archive, found, again) is found:
            break
        found = again
    return found


def _descend_once(archive: Archive, start: Floats, settings: LocalSearch) -> Evaluation:
    local = Local(archive, start, settings)
    begin = local.begin
    if not len(begin):
        return archive.evaluate(start[None])
    if settings.method == "cobyqa":
        found = _cobyqa(local, begin)
    else:
        found = _slsqp(local, begin) if local.constrained else _lbfgsb(local, begin)
    end = np.clip(np.nan_to_num(found, nan=0.5), 0.0, 1.0)
    end[end < ROUNDING] = 0.0
    end[end > 1.0 - ROUNDING] = 1.0
    return pull_back(local, end)


def _slsqp(local: Local, begin: Floats) -> Floats:
    margins: Any = {
        "type": "ineq",
        "fun": lambda u: local.linearise(u).margins,
        "jac": lambda u: local.linearise(u).margin_slopes,
    }
    with warnings.catch_warnings():
        # SLSQP may step a rounding error outside the bounds, where `local` clips.
        warnings.simplefilter("ignore", RuntimeWarning)
        found = minimize(
            local.value,
            begin,
            jac=local.slope,
            bounds=[(0.0, 1.0)] * len(begin),
            method="SLSQP",
            constraints=margins,
            options={"maxiter": 200, "ftol": local.settings.tolerance},
        )
    return np.asarray(found.x, float)


def _lbfgsb(local: Local, begin: Floats) -> Floats:
    found = minimize(
        local.value,
        begin,
        jac=local.slope,
        bounds=[(0.0, 1.0)] * len(begin),
        method="L-BFGS-B",
        options={"maxiter": 200, "ftol": local.settings.tolerance, "gtol": 1e-12},
    )
    return np.asarray(found.x, float)


def _cobyqa(local: Local, begin: Floats) -> Floats:
    def level(u: Floats) -> float:
        return float(local.level(u)[0][0])

    def margins(u: Floats) -> Floats:
        return local.level(u)[1]

    constraints = [NonlinearConstraint(margins, 0.0, np.inf)] if local.constrained else []
    radius = max(local.settings.tolerance, 1e-8)
    found = minimize(
        level,
        begin,
        bounds=[(0.0, 1.0)] * len(begin),
        method="COBYQA",
        constraints=constraints,
        options={"initial_tr_radius": 0.1, "final_tr_radius": radius, "maxfev": 200 * len(begin)},
    )
    return np.asarray(found.x, float)


def pull_back(local: Local, end: Floats) -> Evaluation:
    """Evaluate `end`, shape (f,), or the nearest place towards the start that violates no constraint at all.

    A local search ends within rounding of an active constraint, on either side; a simulator may refuse the
    wrong one. Where no such place is found the end itself is returned.
    """
    archive = local.archive
    last = archive.evaluate(local.natural(end[None]))
    if not archive.problem.constraints or (last.margins >= 0).all():
        return last
    back = np.r_[10.0 ** -np.arange(12.0, 0.0, -1.0), 0.5, 1.0]
    along = archive.evaluate(local.natural(end + back[:, None] * (local.begin - end)))
    good = np.flatnonzero((along.margins >= 0).all(axis=1))
    return along.rows(good[:1]) if len(good) else last
