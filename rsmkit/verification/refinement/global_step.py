"""Where a run could gain most anywhere in the space, and how much may still be gained.

Expected improvement (Jones, Schonlau and Welch, Journal of Global Optimization 13, 1998) times the chances
that every constraint holds and that the run succeeds; in logarithms, so that it has a slope wherever it is
small.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rsmkit.language.space import Floats
from rsmkit.optimum.problem import Problem
from rsmkit.verification.refinement.models.cube import Cube
from rsmkit.verification.refinement.models.failures import Failures
from rsmkit.verification.refinement.models.quantities import Quantity

__all__ = ["Doubt", "GlobalStep"]

POOL = 1024
STEPS = (0.15, 0.03, 0.006)
AROUND = 120
"""Steps of each size together, around the best runs."""
ROUNDS = 7
PARENTS = 10
CHILDREN = 14
IMPOSSIBLE = 1e6
LEAST_CHANCE, UNLIKELY = 0.3, 0.1
"""Chances to succeed: of any proposal, and of any point at which something may still be gained."""
DRAWS, PROMISING, ELSEWHERE = 400, 100, 256
"""Joint draws, and the points they are made at, for what may still be gained."""


@dataclass(frozen=True)
class Doubt:
    """What may still be gained, and where.

    Parameters
    ----------
    gain : float
        At most, with a confidence.
    points : array, shape (p, k)
        Of the cube, where draws found a gain; the one with the greatest expected share of it first.
    """

    gain: float
    points: Floats


@dataclass(frozen=True)
class GlobalStep:
    """What to look for.

    Parameters
    ----------
    cube : Cube
        Coordinates.
    problem : Problem
        Gives cheap constraints.
    objective : Quantity
        To be improved.
    margins : sequence of Quantity
        To be kept.
    failures : Failures or None
        Where runs fail.
    best : float or None
        Best feasible value; None while there is none, when only feasibility counts.
    taken : array, shape (n, k)
        Points that are not proposed again.
    boldness : float
        By which the models' standard deviations are multiplied.
    least_chance : float
        Of a run to succeed.
    """

    cube: Cube
    problem: Problem
    objective: Quantity
    margins: Sequence[Quantity]
    failures: Failures | None
    best: float | None
    taken: Floats = field(default_factory=lambda: np.empty((0, 0)))
    boldness: float = 1.0
    least_chance: float = LEAST_CHANCE

    def score(self, unit: Floats) -> Floats:
        """Logarithm of the expected gain of a run at points, shape (q,)."""
        found = np.zeros(len(unit))
        if self.best is not None:
            found = self.objective.log_improvement(unit, self.best, self.boldness)
        for margin in self.margins:
            found = found + margin.log_chance(unit)
        if self.failures is not None:
            chance = self.failures.log_chance(unit)
            found = found + chance - IMPOSSIBLE * (chance < np.log(self.least_chance))
        if self.problem.cheap_constraints:
            missed = np.maximum(
                0.0, -np.nan_to_num(self.problem.cheap_margins(self.cube.natural(unit)), nan=-1e9)
            )
            found = found - IMPOSSIBLE * (missed > 0).any(axis=1) - missed.sum(axis=1)
        if len(self.taken):
            repeated = self.cube.apart(unit, self.taken).min(axis=1) < 1e-6
            found = np.where(repeated, -np.inf, found)
        return np.nan_to_num(found, nan=-np.inf)

    def maximise(self, near: Floats, seed: int) -> tuple[Floats, float]:
        """Find the point with the greatest score, from everywhere and from points `near`, shape (r, k)."""
        pool, scores = self._evolved(near, seed)
        row = int(scores.argmax())
        return pool[row], float(scores[row])

    def doubt(self, near: Floats, seed: int, confidence: float = 0.95) -> Doubt:
        """What a run may gain at most, with a confidence: a quantile of draws; and where the draws gain.

        The draws, of values, constraints and failures, are joint over the most promising points and others
        all over the space.
        """
        assert self.best is not None
        rng = np.random.default_rng(seed)
        pool, scores = replace(self, least_chance=UNLIKELY)._evolved(near, seed)
        keep = np.argsort(-scores, kind="stable")[:PROMISING]
        whole = self.cube.whole(np.zeros(len(self.cube)))
        others = self.cube.sample(whole, ELSEWHERE, seed + 1, categories=True)
        points = np.unique(np.vstack([pool[keep], others]), axis=0)
        held = np.ones((DRAWS, len(points)), bool)
        for margin in self.margins:
            held &= margin.samples(points, DRAWS, rng, self.boldness) >= 0.0
        if self.failures is not None:
            held &= self.failures.samples(points, DRAWS, rng) > 0.0
        if self.problem.cheap_constraints:
            margins = np.nan_to_num(self.problem.cheap_margins(self.cube.natural(points)), nan=-1.0)
            held &= (margins >= 0.0).all(axis=1)
        values = np.where(held, self.objective.samples(points, DRAWS, rng, self.boldness), np.inf)
        values = np.nan_to_num(values, nan=np.inf, posinf=np.inf)
        where = values.argmin(axis=1)
        gains = np.maximum(0.0, self.best - values[np.arange(DRAWS), where])
        shares = np.bincount(where, gains, len(points))
        order = np.argsort(-shares, kind="stable")[: int((shares > 0).sum())]
        return Doubt(float(np.quantile(gains, confidence)), points[order])

    def _evolved(self, near: Floats, seed: int) -> tuple[Floats, Floats]:
        """Points and their scores, ever nearer to the greatest."""
        rng = np.random.default_rng(seed)
        whole = self.cube.whole(np.zeros(len(self.cube)))
        pool = self.cube.sample(whole, POOL, seed, categories=True)
        pool = np.vstack([pool, self._around(near, rng)])
        scores = self.score(pool)
        for number in range(ROUNDS):
            keep = np.argsort(-scores, kind="stable")[:PARENTS]
            pool, scores = pool[keep], scores[keep]
            children = self._children(pool, 0.08 * 0.45**number, rng)
            pool, scores = np.vstack([pool, children]), np.r_[scores, self.score(children)]
        return pool, scores

    def believing(self, unit: Floats) -> GlobalStep:
        """The same when runs at points, shape (q, k), are under way: they are taken to go as predicted."""
        return replace(
            self,
            objective=self.objective.believing(unit),
            margins=[margin.believing(unit) for margin in self.margins],
            taken=np.vstack([self.taken, unit]) if len(self.taken) else unit,
        )

    def _around(self, near: Floats, rng: np.random.Generator) -> Floats:
        if not len(near):
            return np.empty((0, len(self.cube)))
        numeric = ~self.cube.categorical
        each = AROUND // len(STEPS)
        moved = np.vstack(
            [
                point + step * rng.standard_normal((each, len(self.cube))) * numeric
                for point in near
                for step in STEPS
            ]
        )
        return self.cube.snapped(moved)

    def _children(self, parents: Floats, step: float, rng: np.random.Generator) -> Floats:
        k = len(self.cube)
        made = np.repeat(parents, CHILDREN, axis=0)
        moves = rng.random(made.shape) < max(0.4, 1.5 / k)
        normal = rng.standard_normal(made.shape)
        redrawn = rng.random(made.shape)
        for j, factor in enumerate(self.cube.space):
            if self.cube.categorical[j]:
                levels = factor.domain.from_unit(redrawn[:, j])
                made[:, j] = np.where(moves[:, j] & (rng.random(len(made)) < 0.3), levels, made[:, j])
            elif self.cube.stepped[j]:
                gap = 1.0 / max(factor.domain.level_count - 1, 1)
                size = np.maximum(np.abs(normal[:, j]) * step, gap)
                made[:, j] += np.where(moves[:, j], np.sign(normal[:, j]) * size, 0.0)
            else:
                made[:, j] += np.where(moves[:, j], step * normal[:, j], 0.0)
        return self.cube.snapped(made)
