"""Minimise models in a box, constraints included: where a refinement proposes to run next."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
from scipy.optimize import minimize

from rsmkit.language.space import Floats
from rsmkit.optimum.problem import Problem
from rsmkit.verification.refinement.models.cube import Box, Cube
from rsmkit.verification.refinement.models.failures import Failures
from rsmkit.verification.refinement.models.learner import Model, Ranked

__all__ = ["Proposal", "Subproblem", "limits_of"]

POOL = 256
STARTS = 3
STEPS = 35
ALIVE = 0.3
"""Least latent value of the classifier at a proposal, unless another is asked for."""
STEP = 1e-6
PENALTY = 1000.0
VIOLATED = 1e-6
UNDEFINED = 1e100
"""Stands for an objective that is not a number."""
INSIDE = 1e-9
"""By how much a proposal keeps to cheap constraints, so that rounding does not violate them."""


@dataclass(frozen=True)
class Proposal:
    """A point and what the models say of it.

    Parameters
    ----------
    unit : array, shape (k,)
        Allowed, inside the bounds.
    value : float
        Predicted objective.
    violation : float
        Sum of scaled predicted violations; 0 when feasible.
    """

    unit: Floats
    value: float
    violation: float

    @property
    def feasible(self) -> bool:
        """Whether the models call it feasible."""
        return self.violation <= VIOLATED


@dataclass(frozen=True)
class Subproblem:
    """Models to minimise and to keep to.

    Parameters
    ----------
    cube : Cube
        Coordinates.
    problem : Problem
        Gives cheap constraints.
    objective : Model
        To be minimised.
    margins : sequence of (Model, float, float)
        Each with its size and with what it must reach.
    failures : Failures or None
        Where runs fail.
    alive : float
        Least latent value of these at a proposal.
    """

    cube: Cube
    problem: Problem
    objective: Model
    margins: Sequence[tuple[Model, float, float]]
    failures: Failures | None
    alive: float = ALIVE

    def minimise(self, box: Box, center: Floats, seed: int) -> Proposal:
        """Find the least value in a box, or where the violation is least."""
        pool = np.vstack([self.cube.snapped(box.clip(center))[None], self.cube.sample(box, POOL, seed)])
        values, violations = self.judge(pool)
        defined = values[values < UNDEFINED]
        size = (float(np.std(defined)) if len(defined) else 0.0) or 1.0
        merit = values + PENALTY * size * violations
        starts = self._starts(pool, merit, box)
        free = (box.high > box.low) & ~self.cube.stepped
        stepped = (box.high > box.low) & self.cube.stepped
        ends = [self._descend(start, box, free | stepped, size) for start in starts]
        if stepped.any():
            ends = self._on_levels(ends, box, free, stepped, size)
        return self._best(np.vstack([pool[[int(merit.argmin())]], *[end[None] for end in ends]]), size)

    def judge(self, unit: Floats) -> tuple[Floats, Floats]:
        """Predicted values and sums of scaled violations, shape (q,) each."""
        values = np.nan_to_num(self.objective.mean(unit), nan=UNDEFINED, posinf=UNDEFINED, neginf=UNDEFINED)
        return values, np.maximum(0.0, -self._margins(unit)).sum(axis=1)

    def _best(self, unit: Floats, size: float) -> Proposal:
        unit = self.cube.snapped(unit)
        values, violations = self.judge(unit)
        row = int((values + PENALTY * size * np.where(violations <= VIOLATED, 0.0, violations)).argmin())
        return Proposal(unit[row], float(values[row]), float(violations[row]))

    def _margins(self, unit: Floats) -> Floats:
        """Scaled margins of all constraints, shape (q, c)."""
        columns = [(model.mean(unit) - floor) / size for model, size, floor in self.margins]
        columns += list((self._cheap(unit) - INSIDE).T)
        if self.failures is not None:
            columns.append(self.failures.latent(unit) - self.alive)
        made = np.column_stack(columns) if columns else np.empty((len(unit), 0))
        return np.nan_to_num(made, nan=-1.0, posinf=1e9, neginf=-1e9)

    def _cheap(self, unit: Floats) -> Floats:
        """Scaled cheap margins; steps of levels are not taken, so that slopes exist."""
        space = self.cube.space
        inside = np.where(self.cube.categorical, unit, np.clip(unit, 0.0, 1.0))
        wide = np.where(self.cube.categorical, inside, (1.0 - inside) * space.lows + inside * space.highs)
        return np.asarray(self.problem.cheap_margins(wide) / self._cheap_sizes)

    @cached_property
    def _cheap_sizes(self) -> Floats:
        sample = self.cube.natural(self.cube.sample(self.cube.whole(np.zeros(len(self.cube))), 64, 5))
        size = np.abs(self.problem.cheap_margins(sample))
        return np.asarray(np.maximum(np.median(np.where(np.isfinite(size), size, 0.0), axis=0), 1e-300))

    def _starts(self, pool: Floats, merit: Floats, box: Box) -> list[Floats]:
        chosen = [pool[0]]
        width = float((box.high - box.low).max()) or 1.0
        for row in np.argsort(merit, kind="stable"):
            if len(chosen) > STARTS:
                break
            if min(float(np.abs(pool[row] - other).max()) for other in chosen) > 0.1 * width:
                chosen.append(pool[row])
        return chosen

    def _descend(self, start: Floats, box: Box, free: Any, size: float) -> Floats:
        """SLSQP (L-BFGS-B without constraints) in the free coordinates."""
        if not free.any():
            return start
        width = np.where(free, box.high - box.low, 1.0)
        offset = float(self.objective.mean(start[None])[0])
        spread = max(size, 1e-300)

        def whole(x: Floats) -> Floats:
            unit = start.copy()
            unit[free] = box.low[free] + np.clip(x, 0.0, 1.0) * width[free]
            return unit[None]

        def value(x: Floats) -> tuple[float, Floats]:
            unit = whole(x)
            f = (float(self.objective.mean(unit)[0]) - offset) / spread
            slope = (self.objective.gradient(unit)[0] * width)[free] / spread
            return (f, slope) if np.isfinite(f) and np.isfinite(slope).all() else (1e10, np.zeros_like(x))

        constraints = self._constraints(whole, width, free) + self._equalities(whole, width, free)
        begin: Any = (start - box.low)[free] / width[free]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            found = minimize(
                value,
                begin,
                jac=True,
                bounds=[(0.0, 1.0)] * int(free.sum()),
                method="SLSQP" if constraints else "L-BFGS-B",
                constraints=constraints,
                options={"maxiter": STEPS, "ftol": 1e-12},
            )
        x = np.nan_to_num(found.x, nan=0.5)
        return np.asarray(whole(x)[0])

    def _equalities(self, whole: Callable[[Floats], Floats], width: Floats, free: Any) -> list[Any]:
        """Equalities of the space, each over its size."""
        affine, space = self.cube.space.affine, self.cube.space
        if affine is None:
            return []
        ranges = np.where(self.cube.categorical, 0.0, space.highs - space.lows)
        slopes = (affine.matrix * ranges * width)[:, free] / affine.size[:, None]

        def misses(x: Floats) -> Floats:
            return affine.residuals(space.lows + whole(x)[0] * ranges) / affine.size

        return [{"type": "eq", "fun": misses, "jac": lambda x: slopes}]

    def _constraints(self, whole: Callable[[Floats], Floats], width: Floats, free: Any) -> list[Any]:
        if not self.margins and self.failures is None and not self.problem.cheap_constraints:
            return []

        def margins(x: Floats) -> Floats:
            return np.asarray(self._margins(whole(x))[0])

        def slopes(x: Floats) -> Floats:
            unit = whole(x)
            rows = [model.gradient(unit)[0] / size for model, size, _ in self.margins]
            if self.problem.cheap_constraints:
                step = STEP * np.eye(len(width))
                ends = self._cheap(np.vstack([unit + step, unit - step]))
                k = len(width)
                reach = np.minimum(unit[0] + STEP, 1.0) - np.maximum(unit[0] - STEP, 0.0)
                rows += list(((ends[:k] - ends[k:]) / np.where(self.cube.categorical, 1.0, reach)[:, None]).T)
            if self.failures is not None:
                rows.append(self.failures.gradient(unit)[0])
            return np.nan_to_num((np.array(rows) * width)[:, free])

        return [{"type": "ineq", "fun": margins, "jac": slopes}]

    def _on_levels(self, ends: list[Floats], box: Box, free: Any, stepped: Any, size: float) -> list[Floats]:
        """Put stepped factors on neighbouring levels, then polish the other factors of the best few."""
        candidates = np.vstack([self._neighbours(end, box, stepped) for end in ends])
        candidates = np.unique(candidates, axis=0)
        values, violations = self.judge(candidates)
        usual = float(np.median(violations[violations > 0])) if (violations > 0).any() else 1.0
        orders = [
            np.argsort(values + PENALTY * size * violations, kind="stable")[:3],
            np.argsort(values + size * violations / usual, kind="stable")[:2],
        ]
        rows = dict.fromkeys(int(row) for order in orders for row in order)
        return [self._descend(candidates[row], box, free, size) for row in rows]

    def _neighbours(self, unit: Floats, box: Box, stepped: Any) -> Floats:
        """Combinations of one level more or less: all of up to three factors, else one at a time or all."""
        here = self.cube.snapped(unit[None])[0]
        natural = self.cube.natural(here[None])[0]
        columns = np.flatnonzero(stepped)
        choices: list[list[float]] = []
        for j in columns:
            domain = self.cube.space.factors[j].domain
            allowed = domain.allowed
            at = int(np.abs(allowed - natural[j]).argmin())
            near = [allowed[i] for i in (at - 1, at, at + 1) if 0 <= i < len(allowed)]
            width = domain.high - domain.low
            codes = [(value - domain.low) / width for value in near]
            choices.append([c for c in codes if box.low[j] - 1e-9 <= c <= box.high[j] + 1e-9] or [here[j]])
        if len(columns) <= 3:
            moves = [dict(zip(columns, combination, strict=True)) for combination in product(*choices)]
        else:
            moves = [{j: code} for j, codes in zip(columns, choices, strict=True) for code in codes]
            moves.append({j: codes[0] for j, codes in zip(columns, choices, strict=True)})
            moves.append({j: codes[-1] for j, codes in zip(columns, choices, strict=True)})
            moves.append({})
        found = np.repeat(here[None], len(moves), axis=0)
        for row, move in zip(found, moves, strict=True):
            for j, code in move.items():
                row[j] = code
        return found


def limits_of(
    ranked: Sequence[Sequence[Ranked]], number: int, caution: float, unit: Floats
) -> list[tuple[Model, float, float]]:
    """Of every constraint the model of that `number`, its usual size at runs, what it must reach.

    Parameters
    ----------
    ranked : sequence of sequences of Ranked
        Models of each constraint, the best first; the last one stands for those that are missing.
    number : int
        From 0.
    caution : float
        Part of a model's error that is kept away from the limit.
    unit : array, shape (n, k)
        Runs that succeeded.
    """
    chosen = [models[min(number, len(models) - 1)] for models in ranked]
    return [
        (one.model, float(np.median(np.abs(one.model.mean(unit)))) or 1.0, caution * one.error)
        for one in chosen
    ]
