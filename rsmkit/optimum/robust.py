"""Robust objectives: mean and spread over what cannot be controlled.

A noise factor is a factor of the surfaces that the user sets in the study but nature sets in service. Its
effect is integrated by Gauss-Hermite quadrature (normal) or Gauss-Legendre quadrature (uniform), both exact
for surfaces of moderate order (Myers, Montgomery and Anderson-Cook, Response Surface Methodology, ch. 11).
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Literal

import numpy as np

from rsmkit.errors import RsmkitError
from rsmkit.expression import parse_expression
from rsmkit.optimum.problem import Function, Problem
from rsmkit.space import Floats, Space

__all__ = ["NoiseFactor", "robust_problem"]

NODES = 7
"""Quadrature nodes per noise factor: exact to degree 13."""


@dataclass(frozen=True)
class NoiseFactor:
    """A factor that varies in service.

    Parameters
    ----------
    name : str
        A factor of the surfaces.
    mean, spread : float
        Natural units: standard deviation of a normal, half-width of a uniform distribution.
    distribution : {"normal", "uniform"}
        Its law.
    """

    name: str
    mean: float
    spread: float
    distribution: Literal["normal", "uniform"] = "normal"

    def nodes(self) -> tuple[Floats, Floats]:
        """Quadrature nodes in natural units and weights that sum to 1."""
        if self.distribution == "normal":
            x, weight = np.polynomial.hermite_e.hermegauss(NODES)
        else:
            x, weight = np.polynomial.legendre.leggauss(NODES)
        return self.mean + self.spread * x, weight / weight.sum()


def robust_problem(problem: Problem, noise: tuple[NoiseFactor, ...], weight: float) -> Problem:
    """Replace each objective by ``mean + weight * standard deviation`` over the noise factors.

    Parameters
    ----------
    problem : Problem
        On surfaces of all factors.
    noise : tuple of NoiseFactor
        Independent; they leave the list of factors to be chosen.
    weight : float
        0 gives the mean, 3 a bound that a normal response exceeds once in 700 times.

    Returns
    -------
    Problem
        Over the remaining factors, with objectives ``robust_1``, ``robust_2``, ...; responses are means.
        Constraints on responses hold for the means.
    """
    names = [item.name for item in noise]
    kept = [factor for factor in problem.space if factor.name not in names]
    if len(kept) + len(noise) != len(problem.space) or not kept:
        raise RsmkitError(
            "noise factors must be factors of the study, each named once, and leave at least one to choose"
        )
    controlled = Space(kept)
    quadratures = [item.nodes() for item in noise]
    nodes = np.array(list(itertools.product(*[x for x, _ in quadratures])))
    weights = np.array([np.prod(w) for w in itertools.product(*[w for _, w in quadratures])])

    def lifted(points: Floats) -> Floats:
        whole = np.empty((len(points) * len(nodes), len(problem.space)))
        for j, factor in enumerate(problem.space):
            if factor.name in names:
                whole[:, j] = np.tile(nodes[:, names.index(factor.name)], len(points))
            else:
                whole[:, j] = np.repeat(points[:, controlled.names.index(factor.name)], len(nodes))
        return whole

    def mean_of(column: Floats) -> Floats:
        mean: Floats = column.reshape(-1, len(nodes)) @ weights
        return mean

    def evaluator(points: Floats) -> dict[str, Floats]:
        result = problem.evaluate(lifted(points))
        means = {name: mean_of(column) for name, column in result.responses.items()}
        for j in range(len(problem.objectives)):
            column = result.objectives[:, j]
            mean = mean_of(column)
            variance = np.maximum(mean_of(column**2) - mean**2, 0.0)
            means[f"robust_{j + 1}"] = mean + weight * np.sqrt(variance)
        return means

    def averaged(name: str) -> Function:
        return lambda points: mean_of(problem.functions[name](lifted(points)))

    def constant(value: float) -> Function:
        return lambda points: np.full(len(points), value)

    functions = {name: averaged(name) for name in problem.functions}
    functions |= {item.name: constant(item.mean) for item in noise}
    objectives = tuple(parse_expression(f"robust_{j + 1}") for j in range(len(problem.objectives)))
    return Problem(controlled, objectives, evaluator, problem.constraints, functions)
