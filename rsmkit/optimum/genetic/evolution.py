"""Genetic algorithms behind one narrow interface: ask for unit points, tell what they are worth.

GA and NSGA-II are pymoo's. The MATLAB-like algorithm differs in its bones (elites, fixed shares of crossover
and mutation children), so it is written out here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.algorithms.soo.nonconvex.ga import GA
from pymoo.core.evaluator import Evaluator as PymooEvaluator
from pymoo.core.population import Population
from pymoo.core.problem import Problem as PymooProblem
from pymoo.operators.mutation.pm import PolynomialMutation
from pymoo.problems.static import StaticProblem

from rsmkit.language.space import Floats
from rsmkit.optimum.genetic.mutation import AdaptiveFeasibleMutation
from rsmkit.optimum.options import Preset
from rsmkit.optimum.pareto_front import nondominated, spread_rows
from rsmkit.optimum.problem import Archive
from rsmkit.optimum.unit_box import from_unit, to_unit

__all__ = ["Generation", "evolve"]

BAD = 1e30
"""Stands for the objective or the violation of a point that could not be evaluated."""


@dataclass(frozen=True)
class Generation:
    """The population after one generation.

    Parameters
    ----------
    evaluations : int
        Evaluations spent so far.
    unit : ndarray, shape (n, k)
        Individuals in the unit box.
    objectives : ndarray, shape (n, m)
        Their objectives.
    feasible : ndarray of bool, shape (n,)
        Which satisfy every constraint.
    """

    evaluations: int
    unit: Floats
    objectives: Floats
    feasible: NDArray[np.bool_]


class _Algorithm(Protocol):
    def ask(self) -> Floats: ...

    def repair(self, unit: Floats) -> None:
        """Take these points, shape (n, k), for those asked: the nearest that keep the equalities."""
        ...

    def tell(self, objectives: Floats, violation: Floats) -> None: ...

    def population(self) -> tuple[Floats, Floats, Floats]:
        """Unit points, objectives and violations of those who survived."""
        ...


def evolve(archive: Archive, preset: Preset, seed: int) -> list[Generation]:
    """Run a genetic algorithm on the problem of `archive`, which remembers every evaluation.

    Reproducible: the same problem, preset and seed give the same points. Serial and parallel evaluators see
    whole generations and give identical results.

    Parameters
    ----------
    archive : Archive
        Problem and memory.
    preset : Preset
        Size and operators; sorting by dominance makes it NSGA-II (with polynomial mutation).
    seed : int
        Of every random choice.

    Returns
    -------
    list of Generation
        One per generation, the initial population first.
    """
    problem = archive.problem
    space = problem.space

    def allowed(unit: Floats) -> NDArray[np.bool_]:
        return np.array((problem.cheap_margins(from_unit(space, unit)) >= 0.0).all(axis=1))

    if len(problem.objectives) > 1:
        preset = replace(preset, nondominated_sorting=True)
    plain = preset.operators == "polynomial" or preset.nondominated_sorting
    mutation = None if plain else AdaptiveFeasibleMutation(allowed)
    algorithm: _Algorithm
    if preset.operators == "scattered" and mutation is not None:
        algorithm = _Scattered(len(space), preset.population, mutation, seed)
    else:
        algorithm = _Pymoo(len(space), len(problem.objectives), preset, mutation, seed)

    generations: list[Generation] = []
    best = (math.inf, math.inf)
    for _ in range(preset.generations):
        points = from_unit(space, algorithm.ask())
        if space.affine is not None:
            algorithm.repair(to_unit(space, points))
        evaluation = archive.evaluate(points)
        violation = archive.violation(evaluation)
        algorithm.tell(evaluation.objectives, violation)
        unit, objectives, violations = algorithm.population()
        generations.append(Generation(archive.count, unit, objectives, violations == 0.0))
        if mutation is not None:
            leader = min(zip(violations.tolist(), objectives[:, 0].tolist(), strict=True))
            if len(generations) > 1:
                mutation.adapt(leader < best)
            best = min(best, leader)
    return generations


class _Pymoo:
    """pymoo's GA or NSGA-II, driven by ask and tell.

    With several objectives the next parents are the most spread of all non-dominated individuals so far, not
    only of the last two generations: for equal evaluations the archive then covers the front more evenly.
    """

    def __init__(
        self, k: int, m: int, preset: Preset, mutation: AdaptiveFeasibleMutation | None, seed: int
    ) -> None:
        self._problem = PymooProblem(n_var=k, n_obj=m, n_ieq_constr=1, xl=0.0, xu=1.0)
        operators = {} if mutation is None else {"mutation": _AdaptiveOperator(mutation)}
        self._algorithm = (NSGA2 if preset.nondominated_sorting else GA)(
            pop_size=preset.population, **operators
        )
        self._algorithm.setup(
            self._problem, termination=("n_gen", preset.generations), seed=seed, verbose=False
        )
        self._asked: Any = None
        self._best: Any = None

    def ask(self) -> Floats:
        self._asked = self._algorithm.ask()
        return np.asarray(self._asked.get("X"), float)

    def repair(self, unit: Floats) -> None:
        self._asked.set("X", unit)

    def tell(self, objectives: Floats, violation: Floats) -> None:
        known = StaticProblem(
            self._problem, F=np.nan_to_num(objectives, nan=BAD), G=np.minimum(violation, BAD)[:, None]
        )
        PymooEvaluator().eval(known, self._asked)
        self._algorithm.tell(infills=self._asked)
        if self._problem.n_obj > 1:
            self._spread()

    def _spread(self) -> None:
        known = self._asked if self._best is None else Population.merge(self._best, self._asked)
        known = known[[individual.G[0] <= 0.0 for individual in known]]
        if not len(known):
            return
        self._best = known[nondominated(known.get("F"))]
        size = len(self._algorithm.pop)
        if len(self._best) > size:
            chosen = self._best[spread_rows(self._best.get("F"), size)]
            self._algorithm.pop = self._algorithm.survival.do(
                self._problem, chosen, n_survive=size, random_state=self._algorithm.random_state
            )

    def population(self) -> tuple[Floats, Floats, Floats]:
        alive = self._algorithm.pop
        return alive.get("X"), alive.get("F"), alive.get("G")[:, 0]


class _AdaptiveOperator(PolynomialMutation):  # type: ignore[misc]
    """Adaptive feasible mutation of one child in five, pymoo's polynomial mutation of the others.

    The share is that of mutation children in MATLAB's ``ga``. Alone, without its elites and selection, the
    adaptive step lets the population collapse too early.
    """

    def __init__(self, mutation: AdaptiveFeasibleMutation) -> None:
        super().__init__()
        self._mutation = mutation

    def _do(self, problem: Any, X: Floats, *args: Any, random_state: Any = None, **kwargs: Any) -> Floats:
        children = np.array(super()._do(problem, X, *args, random_state=random_state, **kwargs))
        chosen = random_state.random(len(X)) < 0.2
        children[chosen] = self._mutation.mutate(X[chosen], random_state)
        return children


class _Scattered:
    """A GA in the manner of MATLAB's ``ga``: rank scaling, stochastic uniform selection, elites.

    Two elites (5 % of 24, rounded up) survive; of the other children 80 % come from scattered crossover (each
    gene from either parent) and the rest from adaptive feasible mutation.
    """

    def __init__(self, k: int, size: int, mutation: AdaptiveFeasibleMutation, seed: int) -> None:
        self._rng = np.random.default_rng(seed)
        self._elites = math.ceil(0.05 * size)
        self._crossed = round(0.8 * (size - self._elites))
        self._mutated = size - self._elites - self._crossed
        self._mutation = mutation
        self._asked = self._rng.random((size, k))
        self._unit = np.empty((0, k))
        self._objectives = np.empty((0, 1))
        self._violation = np.empty(0)

    def ask(self) -> Floats:
        if len(self._unit):
            parents = self._select(2 * self._crossed + self._mutated)
            first, second, single = np.split(parents, [self._crossed, 2 * self._crossed])
            from_first = self._rng.random(first.shape) < 0.5
            crossed = np.where(from_first, first, second)
            self._asked = np.vstack([crossed, self._mutation.mutate(single, self._rng)])
        return self._asked

    def repair(self, unit: Floats) -> None:
        self._asked = unit

    def tell(self, objectives: Floats, violation: Floats) -> None:
        elite = slice(0, self._elites)
        self._unit = np.vstack([self._unit[elite], self._asked])
        self._objectives = np.vstack([self._objectives[elite], np.nan_to_num(objectives, nan=BAD)])
        self._violation = np.r_[self._violation[elite], np.minimum(violation, BAD)]
        order = np.lexsort((self._objectives[:, 0], self._violation))
        self._unit = self._unit[order]
        self._objectives = self._objectives[order]
        self._violation = self._violation[order]

    def population(self) -> tuple[Floats, Floats, Floats]:
        return self._unit, self._objectives, self._violation

    def _select(self, count: int) -> Floats:
        """Stochastic uniform selection on expectations proportional to 1/sqrt(rank), in random order."""
        share = 1.0 / np.sqrt(1.0 + np.arange(len(self._unit)))
        cumulative = np.cumsum(share) / share.sum()
        pointers = (self._rng.random() + np.arange(count)) / count
        chosen = np.minimum(np.searchsorted(cumulative, pointers), len(self._unit) - 1)
        return np.array(self._unit[self._rng.permutation(chosen)])
