"""The part of the design space a refinement looks at, and which points to run in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from rsmkit.language.expression import Constraint, parse_expression
from rsmkit.language.space import Factor, Floats, Space
from rsmkit.language.terms import full_terms
from rsmkit.optimum.local.local_search import LocalSearch
from rsmkit.optimum.local.polish import best_row, polish
from rsmkit.optimum.problem import Archive, Function, Problem
from rsmkit.verification.refinement.local_models import LocalModel

__all__ = ["TrustRegion", "fill", "minimise_model", "scaled"]

CANDIDATES = 512
"""Quasi-random points from which fill points and starts of the sub-problem are taken."""


@dataclass(frozen=True)
class TrustRegion:
    """A box of half-width `half_width` (in ranges of the factors) about a natural point, cut by the bounds.

    Parameters
    ----------
    problem : Problem
        The whole problem.
    center : ndarray, shape (k,)
        Natural units. Categorical factors keep their level at the centre.
    half_width : float
        1 or more is the whole box.
    """

    problem: Problem
    center: Floats
    half_width: float

    def space(self) -> Space:
        """Factors that move, with their bounds in this region."""
        factors = [factor.narrowed(x, self.half_width) for factor, x in self._moving()]
        return Space(factors)

    def whole(self, points: Floats) -> Floats:
        """Points of :meth:`space` with the fixed factors put in, shape (n, k) natural."""
        full = np.repeat(self.center[None], len(points), axis=0)
        full[:, self.problem.space.numeric] = points
        return full

    def sample(self, seed: int) -> Floats:
        """Quasi-random points of the region that satisfy every cheap constraint, shape (n, k) natural."""
        space = self.space()
        unit = qmc.Sobol(len(space), rng=seed).random(CANDIDATES)
        points = self.whole(space.snap(space.lows + unit * (space.highs - space.lows)))
        allowed: Floats = points[(self.problem.cheap_margins(points) >= 0.0).all(axis=1)]
        return allowed

    def contains(self, points: Floats, stretch: float = 1.25) -> NDArray[np.bool_]:
        """Which natural points lie within `stretch` half-widths of the centre and keep its categories."""
        numeric = self.problem.space.numeric
        away = np.abs(scaled(self.problem.space, points) - scaled(self.problem.space, self.center[None]))
        near = (away <= stretch * self.half_width + 1e-12).all(axis=1)
        same = (points[:, ~numeric] == self.center[~numeric]).all(axis=1)
        return np.asarray(near & same)

    def _moving(self) -> list[tuple[Factor, float]]:
        pairs = zip(self.problem.space, self.center.tolist(), strict=True)
        return [(factor, x) for factor, x in pairs if factor.domain.is_numeric]


def scaled(space: Space, points: Floats) -> Floats:
    """Numeric factors of natural points as 0..1 between their bounds, shape (n, numeric factors)."""
    unit: Floats = ((points - space.lows) / (space.highs - space.lows))[:, space.numeric]
    return unit


def minimise_model(
    region: TrustRegion, objective: LocalModel, margins: dict[Constraint, LocalModel], seed: int
) -> tuple[Floats, float] | None:
    """Find where a model is least in the region, cheap constraints exact and the others modelled.

    Returns
    -------
    tuple of ndarray (k,) and float, or None
        Natural point and predicted objective; None when the models leave nothing feasible.
    """
    problem = region.problem
    names = {constraint: f"modelled_margin_{j}" for j, constraint in enumerate(margins)}
    moving = region.space()

    def predict(points: Floats) -> dict[str, Floats]:
        unit = scaled(problem.space, region.whole(points))
        made = {names[c]: model.predict(unit) for c, model in margins.items()}
        return {"modelled_objective": objective.predict(unit), **made}

    def lifted(name: str) -> Function:
        return lambda points: problem.cheap_values(region.whole(points))[name]

    fixed = [f.name for f in problem.space if not f.domain.is_numeric]
    local = Problem(
        moving,
        (parse_expression("modelled_objective"),),
        predict,
        tuple(
            Constraint(c.text, parse_expression(names[c])) if c in names else c for c in problem.constraints
        ),
        {name: lifted(name) for name in (*fixed, *problem.functions)},
    )
    archive = Archive(local)
    start = region.sample(seed)[: CANDIDATES // 2]
    start = np.vstack([region.center[None], start])[:, problem.space.numeric]
    archive.evaluate(moving.clip(start))
    found = polish(archive, LocalSearch(starts=6, distance=0.25, tolerance=1e-10))
    row = best_row(archive, found)
    if archive.violation(found)[row] > 0:
        return None
    return region.whole(found.points)[row], float(found.objectives[row, 0])


def fill(region: TrustRegion, known: Floats, count: int, seed: int, *, well_poised: int) -> Floats:
    """Choose further points to run: D-optimal until `well_poised` points lie in the region, then far apart.

    Parameters
    ----------
    region : TrustRegion
        Where.
    known : ndarray, shape (n, k)
        Points already run or chosen, natural units.
    count : int
        How many points to add.
    seed : int
        Of the candidates.
    well_poised : int
        Number of points in the region from which a quadratic is well determined.

    Returns
    -------
    ndarray, shape (up to count, k)
        Natural units, all satisfying the cheap constraints.
    """
    space = region.problem.space
    chosen = known
    pool = region.sample(seed)
    for _ in range(count):
        distance = np.abs(scaled(space, pool)[:, None] - scaled(space, chosen)[None]).max(axis=2).min(axis=1)
        if not len(pool) or not distance.max() > 1e-3 * region.half_width:
            break
        inside = chosen[region.contains(chosen, 1.0)]
        pick = distance.argmax() if len(inside) >= well_poised else _variance(region, inside, pool).argmax()
        chosen = np.vstack([chosen, pool[[pick]]])
    return chosen[len(known) :]


def _variance(region: TrustRegion, inside: Floats, pool: Floats) -> Floats:
    """Prediction variance of a full quadratic at the pool; its maximum is the greedy D-optimal step."""
    space = region.problem.space

    def matrix(points: Floats) -> Floats:
        local = scaled(space, points) - scaled(space, region.center[None])
        return full_terms(local.shape[1], 2).matrix(local / region.half_width)

    have = matrix(inside)
    information = have.T @ have + 1e-3 * np.eye(have.shape[1])
    rows = matrix(pool)
    variance: Floats = (rows * np.linalg.solve(information, rows.T).T).sum(axis=1)
    return variance
