"""Objectives and constraints as a refinement sees them: learnt whole, or composed of their responses.

A weighted sum, a largest value, a distance from a target or a desirability has kinks that its responses have
not, and is known exactly once they are: the expression is never learnt.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr, ndtri

from rsmkit.language.expression import Expression
from rsmkit.language.space import Floats
from rsmkit.optimum.problem import Evaluation, Problem
from rsmkit.verification.refinement.models.cube import Cube
from rsmkit.verification.refinement.models.learner import Learner, Model, Ranked

__all__ = ["Knowledge", "Quantity", "composed_of"]

DRAWS = 64
"""Of the responses, for the expected improvement of a composed objective."""
STEP = 1e-6


@dataclass(frozen=True, eq=False)
class Composed:
    """An expression of modelled responses.

    Parameters
    ----------
    expression : Expression
        Of factors, functions and responses.
    problem : Problem
        Gives factors and functions.
    cube : Cube
        Coordinates.
    models : dict of str to Model
        Of the responses in the expression.
    """

    expression: Expression
    problem: Problem
    cube: Cube
    models: Mapping[str, Model]

    @property
    def name(self) -> str:
        """In words."""
        return ", ".join(dict.fromkeys(model.name for model in self.models.values()))

    def mean(self, unit: Floats) -> Floats:
        """The expression at the predicted responses, shape (q,)."""
        return self._value(unit, {name: model.mean(unit) for name, model in self.models.items()})

    def gradient(self, unit: Floats) -> Floats:
        """By the chain rule, the expression by differences, shape (q, k)."""
        means = {name: model.mean(unit) for name, model in self.models.items()}
        found = np.zeros_like(unit)
        for name, model in self.models.items():
            step = STEP * (np.abs(means[name]) + 1e-3 * np.abs(means[name]).max() + 1e-12)
            up = self._value(unit, {**means, name: means[name] + step})
            down = self._value(unit, {**means, name: means[name] - step})
            found += ((up - down) / (2.0 * step))[:, None] * model.gradient(unit)
        if self.expression.names - set(self.models):
            for j in np.flatnonzero(~self.cube.categorical):
                move = np.zeros(unit.shape[1])
                move[j] = STEP
                up, down = self._value(unit + move, means), self._value(unit - move, means)
                found[:, j] += (up - down) / (2.0 * STEP)
        return np.asarray(np.nan_to_num(found))

    def _value(self, unit: Floats, responses: Mapping[str, Floats]) -> Floats:
        space = self.cube.space
        wide = np.where(self.cube.categorical, unit, (1.0 - unit) * space.lows + unit * space.highs)
        known = {**self.problem.cheap_values(wide), **responses}
        return np.broadcast_to(self.expression(known), (len(unit),)).astype(float)


@dataclass
class Quantity:
    """One objective or one expensive constraint.

    Parameters
    ----------
    expression : Expression
        What it is.
    learners : dict of str to Learner
        Of its responses; or one of itself, under the name "".
    problem, cube
        Where it belongs.
    """

    expression: Expression
    learners: dict[str, Learner]
    problem: Problem
    cube: Cube

    @property
    def whole(self) -> Learner | None:
        """The learner of the quantity itself, unless it is composed."""
        return self.learners.get("")

    @property
    def exact(self) -> bool:
        """Whether it seems to be known exactly everywhere."""
        return all(learner.exact is not None for learner in self.learners.values())

    def exact_model(self) -> Model:
        """Of a quantity that is known exactly."""
        exact = {name: learner.exact for name, learner in self.learners.items()}
        assert all(exact.values())
        known = {name: model for name, model in exact.items() if model is not None}
        return known[""] if "" in known else self._composed(known)

    def global_models(self) -> list[Model]:
        """What describes it over the whole space, the likeliest first."""
        return self._combined({name: learner.global_models() for name, learner in self.learners.items()})

    def ranked(self, center: Floats, half_width: float) -> list[Ranked]:
        """What describes it in a region, the best first; of several responses every one's best, next ..."""
        lists = {name: learner.ranked(center, half_width) for name, learner in self.learners.items()}
        if "" in lists:
            return lists[""]
        models = self._combined({name: [r.model for r in found] for name, found in lists.items()})
        errors = [self._error(lists, center, t) for t in range(len(models))]
        return [Ranked(model, error) for model, error in zip(models, errors, strict=True)]

    def log_improvement(self, unit: Floats, best: float, boldness: float = 1.0) -> Floats:
        """Logarithm of the expected improvement on `best`, shape (q,)."""
        if self.whole is not None:
            return self.whole.log_improvement(unit, best, boldness)
        if not self.learners:  # of factors and functions alone
            return np.log(np.maximum(best - self._composed({}).mean(unit), 1e-300))
        values = self._draws(unit, boldness)
        values = np.where(np.isfinite(values), values, np.inf)
        gain = np.maximum(best - values, 0.0).mean(axis=0)
        # far from any gain: the nearest draws still tell which way to go
        short = values.min(axis=0) - best
        defined = np.abs(short[np.isfinite(short)])
        size = (float(np.median(defined)) if len(defined) else 0.0) or 1.0
        lost = -700.0 - np.minimum(short / size, 1e6)
        return np.asarray(np.where(gain > 0, np.log(np.maximum(gain, 1e-300)), lost))

    def log_chance(self, unit: Floats) -> Floats:
        """Logarithm of the probability that a margin is satisfied, shape (q,)."""
        if self.whole is not None:
            return self.whole.log_chance(unit)
        mean, sd = self.normal(unit)
        return np.asarray(log_ndtr(mean / np.maximum(sd, 1e-300)))

    def normal(self, unit: Floats) -> tuple[Floats, Floats]:
        """Mean and standard deviation over the uncertainty of the models, shape (q,) each."""
        if self.whole is not None:
            return self.whole.normal(unit)
        values = self._draws(unit)
        return np.nan_to_num(values.mean(axis=0), nan=-1e300), values.std(axis=0) + 1e-12

    def samples(self, unit: Floats, count: int, rng: np.random.Generator, boldness: float = 1.0) -> Floats:
        """Draw it at all points jointly, shape (count, q); a margin perhaps as its asinh."""
        drawn = {name: learner.samples(unit, count, rng, boldness) for name, learner in self.learners.items()}
        if self.whole is not None:
            return drawn[""]
        known = {**self.problem.cheap_values(self.cube.natural(unit)), **drawn}
        return np.broadcast_to(self.expression(known), (count, len(unit))).astype(float)

    def believing(self, unit: Floats) -> Quantity:
        """The same after runs at points whose responses were as predicted."""
        return replace(self, learners={name: one.believing(unit) for name, one in self.learners.items()})

    def _draws(self, unit: Floats, boldness: float = 1.0) -> Floats:
        """The quantity for draws of its responses, shape (DRAWS, q)."""
        names = list(self.learners)
        if not names:
            return self._composed({}).mean(unit)[None]
        from scipy.stats import qmc  # takes half a second to import

        normals = ndtri(qmc.Sobol(len(names), rng=7).random(DRAWS) * (1 - 2e-6) + 1e-6)
        drawn = {}
        for name, column in zip(names, normals.T, strict=True):
            mean, sd = self.learners[name].normal(unit)
            drawn[name] = mean + column[:, None] * boldness * sd
        known = {**self.problem.cheap_values(self.cube.natural(unit)), **drawn}
        return np.broadcast_to(self.expression(known), (DRAWS, len(unit))).astype(float)

    def _combined(self, lists: Mapping[str, list[Model]]) -> list[Model]:
        """The t-th combination takes every response's t-th model."""
        if "" in lists:
            return list(lists[""])
        longest = max((len(models) for models in lists.values()), default=1)
        return [
            self._composed({name: models[min(t, len(models) - 1)] for name, models in lists.items()})
            for t in range(longest)
        ]

    def _composed(self, models: Mapping[str, Model]) -> Composed:
        return Composed(self.expression, self.problem, self.cube, models)

    def _error(self, lists: Mapping[str, list[Ranked]], center: Floats, t: int) -> float:
        """By first-order propagation at the centre."""
        picked = {name: found[min(t, len(found) - 1)] for name, found in lists.items()}
        model = self._composed({name: one.model for name, one in picked.items()})
        here = center[None]
        means = {name: one.model.mean(here) for name, one in picked.items()}
        middle = model._value(here, means)[0]
        moved = [
            model._value(here, {**means, name: means[name] + one.error})[0] - middle
            for name, one in picked.items()
        ]
        return float(np.sqrt(np.nansum(np.square(moved))))


class Knowledge:
    """Everything a refinement learns, from responses to objectives and constraints.

    Parameters
    ----------
    problem : Problem
        On the true simulator.
    noisy : bool
        Whether the simulator does not repeat itself.
    """

    def __init__(self, problem: Problem, start: Evaluation, *, noisy: bool) -> None:
        self.problem = problem
        self.cube = Cube(problem.space)
        cheap = problem.cheap_constraints
        self.expensive = [j for j, c in enumerate(problem.constraints) if c not in cheap]
        alive = start.rows(np.isfinite(start.objectives).all(axis=1) & np.isfinite(start.margins).all(axis=1))
        shared: dict[str, Learner] = {}

        def quantity(expression: Expression, values: Floats, *, margin: bool) -> Quantity:
            parts = composed_of(expression, alive.responses)
            if len(parts) > 1 or not _is_linear(expression, parts, alive.responses):
                learners = {
                    name: shared.setdefault(name, Learner(self.cube, noisy=noisy)) for name in sorted(parts)
                }
            else:
                warped = not margin and len(problem.objectives) == 1
                learners = {"": Learner(self.cube, margin=margin, warped=warped, noisy=noisy)}
            return Quantity(expression, learners, problem, self.cube)

        self.objectives = [
            quantity(expression, column, margin=False)
            for expression, column in zip(problem.objectives, alive.objectives.T, strict=True)
        ]
        self.margins = [
            quantity(problem.constraints[j].margin, alive.margins[:, j], margin=True) for j in self.expensive
        ]
        self._shared = shared

    def learn(self, alive: Evaluation) -> None:
        """Fit everything again to the runs that succeeded."""
        unit = self.cube.unit(alive.points)
        for name, learner in self._shared.items():
            learner.learn(unit, alive.responses[name])
        for quantity, column in zip(self.objectives, alive.objectives.T, strict=True):
            if quantity.whole is not None:
                quantity.whole.learn(unit, column)
        for quantity, j in zip(self.margins, self.expensive, strict=True):
            if quantity.whole is not None:
                quantity.whole.learn(unit, alive.margins[:, j])


def composed_of(expression: Expression, responses: Mapping[str, Floats]) -> set[str]:
    """The responses in an expression."""
    return set(expression.names) & set(responses)


def _is_linear(expression: Expression, parts: set[str], responses: Mapping[str, Floats]) -> bool:
    """Whether an expression is a straight line in the only quantity it uses."""
    if expression.names != parts or len(parts) != 1:
        return False
    name = next(iter(parts))
    low, high = float(responses[name].min()), float(responses[name].max())
    line = expression({name: np.linspace(low, high, 9)})
    bend: NDArray[np.float64] = np.abs(np.diff(np.broadcast_to(line, (9,)), 2))
    return bool(np.isfinite(bend).all() and bend.max() <= 1e-9 * max(float(np.ptp(line)), 1e-300))
