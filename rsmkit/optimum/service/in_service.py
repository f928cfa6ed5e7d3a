"""Searches over what responses do in service: mean, deviation, quantiles, and how often they are outside.

Each point of a search is asked at the same points of its laws (a Sobol sequence), on surfaces and on the
simulator alike; what follows from the values there is in :mod:`rsmkit.optimum.service.tails`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
from scipy.special import ndtri
from scipy.stats import qmc

from rsmkit.language.joint_law import Laws
from rsmkit.language.space import Floats
from rsmkit.optimum.problem import Problem
from rsmkit.optimum.service.tails import Limits, outside, outside_any, served

__all__ = ["QUANTILES", "service_names", "service_points", "service_problem"]

QUANTILES = {"q01": 0.01, "q05": 0.05, "q50": 0.5, "q95": 0.95, "q99": 0.99, "q999": 0.999}
"""Prefixes of quantiles."""
SEED = 20_011
WHITE = 4
"""Points for each factor from which on they are made uncorrelated."""
FEW = 512
"""Points up to which they are mirrored: more have third moments that are good enough, and see more."""


def service_names(responses: Sequence[str], specifications: Sequence[str]) -> tuple[str, ...]:
    """What a search may use beside the responses, which are their means."""
    of_each = [f"{word}_{name}" for name in responses for word in ("mean", "sd", *QUANTILES)]
    return (*of_each, *(f"out_{name}" for name in specifications), *(["out_any"] if specifications else []))


def service_points(laws: Laws, points: Floats, nodes: int) -> Floats:
    """Every point, shape (n, k) natural, at `nodes` points of the laws about it, in its place."""
    numbers = _normal_numbers(len(laws.makers), nodes)
    return np.vstack([laws.at(point).of_independent(numbers) for point in points])


@cache
def _normal_numbers(m: int, nodes: int) -> Floats:
    """Standard normal numbers of a Sobol sequence, shape (nodes, m), whose means and deviations are exact.

    Few ones are mirrored, so that third moments are exact too; enough ones are uncorrelated.
    """
    mirrored = nodes <= FEW
    count = nodes // 2 if mirrored else nodes
    z = np.asarray(ndtri(qmc.Sobol(m, rng=np.random.default_rng(SEED)).random(count)))
    z = np.vstack([z, -z]) if mirrored else z - z.mean(axis=0)
    shared = z.T @ z / nodes
    if count < WHITE * m:
        shared = np.diag(np.diag(shared))
    return np.asarray(np.linalg.solve(np.linalg.cholesky(shared), z.T).T)


def service_problem(
    problem: Problem,
    laws: Laws,
    specifications: Mapping[str, Limits],
    nodes: int,
    posed: Problem,
    noise_sd: Mapping[str, float] | None = None,
) -> Problem:
    """Give a problem the statistics of service as responses.

    Parameters
    ----------
    problem : Problem
        Whose evaluator gives the responses themselves.
    laws : Laws
        About each point in turn.
    specifications : mapping of str to limits
        By response.
    nodes : int
        Points of the laws at which each point is asked, a power of 2.
    posed : Problem
        The same, with objectives and constraints that may use :func:`service_names`.
    noise_sd : mapping of str to float, optional
        Standard deviation of a repeated run of each response, where the evaluator gives means of runs.
    """

    def evaluator(points: Floats) -> dict[str, Floats]:
        found = problem.evaluator(service_points(laws, points, nodes))
        made: dict[str, Floats] = {}
        kept = {}
        for name, column in found.items():
            values = np.asarray(column, float).reshape(len(points), nodes)
            own = served(values, (noise_sd or {}).get(name, 0.0))
            made |= {name: own.mean, f"mean_{name}": own.mean, f"sd_{name}": own.sd}
            made |= {f"{word}_{name}": own.quantile(p) for word, p in QUANTILES.items()}
            if name in specifications:
                made[f"out_{name}"] = outside(own, specifications[name])
                kept[name] = own
        return made | ({"out_any": outside_any(kept, specifications)} if specifications else {})

    return replace(posed, evaluator=evaluator)
