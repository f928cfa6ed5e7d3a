"""Robust objectives: mean and spread over what cannot be controlled.

A noise factor is a factor of the study that the user sets there but nature sets in service. Its effect is
integrated by Gauss-Hermite quadrature (normal) or Gauss-Legendre quadrature (uniform): with three nodes exact
for surfaces of second order (Myers, Montgomery and Anderson-Cook, Response Surface Methodology, ch. 11).
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from rsmkit.errors import RsmkitError
from rsmkit.language.expression import parse_expression
from rsmkit.language.space import Floats, Space
from rsmkit.optimum.options import Noise, RobustOptions
from rsmkit.optimum.problem import Function, Problem

__all__ = ["pinned", "quadrature", "robust_names", "robust_problem", "spread_points"]


def quadrature(noise: Noise, nodes: int) -> tuple[Floats, Floats]:
    """Nodes in natural units and weights that sum to 1, each shape (nodes,)."""
    if noise.distribution == "normal":
        x, weight = np.polynomial.hermite_e.hermegauss(nodes)
    else:
        x, weight = np.polynomial.legendre.leggauss(nodes)
    return noise.mean + noise.spread * x, weight / weight.sum()


def robust_names(objectives: int) -> tuple[str, ...]:
    """What the robust forms of so many objectives are called."""
    return ("robust_objective",) if objectives == 1 else tuple(f"robust_{j + 1}" for j in range(objectives))


def robust_problem(problem: Problem, options: RobustOptions) -> Problem:
    """Replace each objective by its mean plus a multiple of its standard deviation over the noise factors.

    Parameters
    ----------
    problem : Problem
        On surfaces of all factors, or on the simulator; it is asked at every combination of nodes.
    options : RobustOptions
        Independent noise factors, nodes, number of standard deviations.

    Returns
    -------
    Problem
        On the same space; what a point says about the noise factors is ignored. Responses, functions and
        constraints are means; the objectives are responses called :func:`robust_names`.

    Raises
    ------
    RsmkitError
        When a noise factor is not a continuous factor of the space, when none is left to choose, or when a
        node lies outside the bounds of its factor, where nothing is known.
    """
    space = problem.space
    _check(space, options)
    each = [quadrature(noise, options.nodes)[1] for noise in options.noise.values()]
    weights = np.array([np.prod(combination) for combination in itertools.product(*each)])
    names = robust_names(len(problem.objectives))

    def mean_of(column: Floats) -> Floats:
        mean: Floats = np.asarray(column, float).reshape(-1, len(weights)) @ weights
        return mean

    def evaluator(points: Floats) -> dict[str, Floats]:
        result = problem.evaluate(spread_points(space, options, points))
        means = {name: mean_of(column) for name, column in result.responses.items()}
        for name, column in zip(names, result.objectives.T, strict=True):
            mean = mean_of(column)
            away = column - np.repeat(mean, len(weights))
            means[name] = mean + options.deviations * np.sqrt(mean_of(away**2))
        return means

    def averaged(function: Function) -> Function:
        return lambda points: mean_of(function(spread_points(space, options, points)))

    return replace(
        problem,
        objectives=tuple(parse_expression(name) for name in names),
        evaluator=evaluator,
        functions={name: averaged(function) for name, function in problem.functions.items()},
    )


def spread_points(space: Space, options: RobustOptions, points: Floats) -> Floats:
    """Every point, shape (n, k) natural, at every combination of nodes of the noise factors, in its place."""
    each = [quadrature(noise, options.nodes)[0] for noise in options.noise.values()]
    nodes = np.array(list(itertools.product(*each)))
    whole = np.repeat(points, len(nodes), axis=0)
    whole[:, [space.names.index(name) for name in options.noise]] = np.tile(nodes, (len(points), 1))
    return whole


def pinned(problem: Problem, values: Mapping[str, float]) -> Problem:
    """The same problem with some factors at given natural values; the others remain to be chosen."""
    space = problem.space
    kept = [j for j, factor in enumerate(space) if factor.name not in values]
    base = np.array([values.get(name, np.nan) for name in space.names])

    def whole(points: Floats) -> Floats:
        full = np.tile(base, (len(points), 1))
        full[:, kept] = points
        return full

    def lifted(function: Function) -> Function:
        return lambda points: function(whole(points))

    def constant(value: float) -> Function:
        return lambda points: np.full(len(points), value)

    functions = {name: lifted(function) for name, function in problem.functions.items()}
    functions |= {name: constant(value) for name, value in values.items()}
    return replace(
        problem,
        space=space.with_factors(factor for j, factor in enumerate(space) if j in kept),
        evaluator=lambda points: problem.evaluator(whole(points)),
        functions=functions,
    )


def _check(space: Space, options: RobustOptions) -> None:
    usable = [factor.name for factor in space if factor.domain.is_continuous]
    if not set(options.noise) <= set(usable) or len(options.noise) == len(space):
        raise RsmkitError(
            f"robust: noise factors must be continuous factors of the study ({', '.join(usable)}) and leave "
            f"at least one factor to choose; got {', '.join(options.noise)}"
        )
    for equality in space.equalities:
        for name in set(equality.names) & set(options.noise):
            raise RsmkitError(
                f"robust: {name} takes part in '{equality.text}', which it would break if it varied by "
                "itself; give noise to other factors"
            )
    for name, noise in options.noise.items():
        x, factor = quadrature(noise, options.nodes)[0], space[name]
        if not (factor.low <= x[0] and x[-1] <= factor.high):
            raise RsmkitError(
                f"robust: {name} varies from {x[0]:.6g} to {x[-1]:.6g} over the {len(x)} nodes of its "
                f"distribution, beyond its bounds {factor.low:g} to {factor.high:g}, where no run was made. "
                "Widen the factor, or give fewer nodes or a smaller spread"
            )
