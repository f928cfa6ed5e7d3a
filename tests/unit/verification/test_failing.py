"""Where a simulator fails: in words, and as a constraint on a search of surfaces."""

import numpy as np
import pytest
from scipy.stats import qmc

from rsmkit.language.space import Factor, Space
from rsmkit.optimum.options import SearchOptions
from rsmkit.optimum.problem import build_problem
from rsmkit.optimum.search import search_problem
from rsmkit.verification.failing import avoiding_failures, failing_rule, without_margin

SPACE = Space([Factor("a", 0.0, 1.0), Factor("b", 10.0, 20.0), Factor("c", levels=("p", "q"))])
POINTS = qmc.Sobol(3, rng=3).random(32) * [1.0, 10.0, 2.0] + [0.0, 10.0, 0.0]
POINTS[:, 2] = np.floor(POINTS[:, 2])
A, B, C = POINTS.T


@pytest.mark.parametrize(
    ("failed", "words"),
    [
        (A > 0.7, ["a > 0.7"]),
        (B < 13.0, ["b < 1"]),
        (C == 1, ["c = q"]),
        ((A > 0.5) & (C == 0), ["a > 0.", "c = p"]),
        ((A < 0.6) & (B > 14), ["a < 0.", "b > 1"]),
    ],
)
def test_one_or_two_limits_are_found(failed, words):
    rule = failing_rule(SPACE, POINTS, failed)
    assert rule.startswith("the simulator fails where ")
    assert all(word in rule for word in words)
    assert f"({failed.sum()} of {failed.sum()} runs there, 0 of {(~failed).sum()} elsewhere)" in rule


def test_no_rule_is_made_up():
    random = np.random.default_rng(1).random(32) < 0.4
    assert failing_rule(SPACE, POINTS, random) == ""
    assert failing_rule(SPACE, POINTS, np.arange(32) == 3) == ""
    assert failing_rule(SPACE, POINTS, np.ones(32, bool)) == ""


def test_a_search_keeps_away_from_where_runs_fail():
    space = Space(a=(0.0, 1.0), b=(0.0, 1.0))
    points = qmc.Sobol(2, rng=4).random(32)
    failed = points[:, 0] > 0.6
    problem = build_problem(space, "y", lambda p: {"y": -p[:, 0] + (p[:, 1] - 0.5) ** 2}, responses=["y"])
    safe = avoiding_failures(problem, points, failed)
    found = without_margin(search_problem(safe, SearchOptions(minimize="y")))
    assert 0.4 < found.point[0] < 0.75
    assert found.subject_to == ()
    assert found.best.margins == ()
    assert avoiding_failures(problem, points, np.zeros(32, bool)) is problem
