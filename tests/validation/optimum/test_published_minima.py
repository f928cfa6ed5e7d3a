"""Global minima from Surjanovic and Bingham, Virtual Library of Simulation Experiments (Simon Fraser)."""

import numpy as np
import pytest

from rsmkit.language.space import Space
from rsmkit.optimum.options import SearchOptions
from rsmkit.optimum.problem import build_problem
from rsmkit.optimum.search import search_problem


def branin(p):
    x, y = p.T
    return (
        (y - 5.1 / (4 * np.pi**2) * x**2 + 5 / np.pi * x - 6) ** 2
        + 10 * (1 - 1 / (8 * np.pi)) * np.cos(x)
        + 10
    )


def hartmann3(p):
    a = np.array([[3, 10, 30], [0.1, 10, 35], [3, 10, 30], [0.1, 10, 35]])
    c = 1e-4 * np.array([[3689, 1170, 2673], [4699, 4387, 7470], [1091, 8732, 5547], [381, 5743, 8828]])
    weights = np.array([1.0, 1.2, 3.0, 3.2])
    return -(weights * np.exp(-(a * (p[:, None, :] - c) ** 2).sum(axis=2))).sum(axis=1)


def rosenbrock(p):
    return (100 * (p[:, 1:] - p[:, :-1] ** 2) ** 2 + (1 - p[:, :-1]) ** 2).sum(axis=1)


CASES = {
    "branin": (branin, Space(x=(-5.0, 10.0), y=(0.0, 15.0)), 0.397887, 2e-6),
    "hartmann3": (hartmann3, Space(a=(0.0, 1.0), b=(0.0, 1.0), c=(0.0, 1.0)), -3.86278, 5e-6),
    "rosenbrock3": (rosenbrock, Space(a=(-2.0, 2.0), b=(-2.0, 2.0), c=(-2.0, 2.0)), 0.0, 1e-8),
}


@pytest.mark.parametrize("preset", ["paper", "fast", "matlab_like"])
@pytest.mark.parametrize("name", list(CASES))
def test_minimum(name, preset):
    function, space, value, tolerance = CASES[name]
    problem = build_problem(space, "f", lambda p: {"f": function(p)}, responses=["f"])
    optimum = search_problem(problem, SearchOptions("f", preset=preset))
    assert optimum.best.objectives[0] == pytest.approx(value, abs=tolerance)
