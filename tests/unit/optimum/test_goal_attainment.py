import numpy as np
import pytest

from rsmkit.language.space import Space
from rsmkit.optimum.goal_attainment import attain_goals
from rsmkit.optimum.options import SearchOptions
from rsmkit.optimum.problem import Archive, build_problem
from rsmkit.optimum.search import search_problem


def example(*subject_to):
    """The example of MathWorks' fgoalattain page: F = [2 + (x-3)^2, 5 + x^2/4], goal [3, 6]."""
    space = Space(x=(-10.0, 10.0))
    problem = build_problem(
        space, ["2 + (x - 3)**2", "5 + x**2/4"], lambda p: {}, responses=[], subject_to=subject_to
    )
    archive = Archive(problem)
    archive.evaluate(np.linspace(-10, 10, 9)[:, None])
    return archive


def attain(archive, goal, weights, start=1.0):
    return attain_goals(archive, np.array([start]), np.array(goal), np.array(weights))


def test_mathworks_example():
    reached, gamma = attain(example(), [3.0, 6.0], [1.0, 1.0])
    assert reached.points[0, 0] == pytest.approx(2.0, abs=1e-8)
    np.testing.assert_allclose(reached.objectives[0], [3.0, 6.0], atol=1e-8)
    assert gamma == pytest.approx(0.0, abs=1e-8)


def test_both_goals_missed_by_equal_shares_of_the_weights():
    # (x-3)^2 - 1 = 2 g and x^2/4 - 1 = g with goals [3, 6] and weights [2, 1]: x^2/2 - 6x + 10 = 0.
    reached, gamma = attain(example(), [3.0, 6.0], [2.0, 1.0])
    x = 6 - np.sqrt(16.0)
    assert reached.points[0, 0] == pytest.approx(x, abs=1e-7)
    assert gamma == pytest.approx(x**2 / 4 - 1, abs=1e-7)


def test_constraints_hold():
    reached, gamma = attain(example("x <= 1.5"), [3.0, 6.0], [1.0, 1.0], start=-4.0)
    assert reached.margins[0, 0] >= 0
    assert reached.points[0, 0] == pytest.approx(1.5, abs=1e-8)
    assert gamma == pytest.approx(1.25, abs=1e-7)


def test_polished_front_has_the_exact_extremes_and_a_nondominated_knee():
    def two(points):
        return {"f": (points**2).sum(axis=1), "g": ((points - 1) ** 2).sum(axis=1)}

    problem = build_problem(Space(x=(-2.0, 2.0), y=(-2.0, 2.0)), ["f", "g"], two, responses=["f", "g"])
    knee, lowest_f, lowest_g = search_problem(problem, SearchOptions(("f", "g"), preset="fast")).candidates
    np.testing.assert_allclose(lowest_f.point, [0.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(lowest_g.point, [1.0, 1.0], atol=1e-6)
    assert np.sqrt(knee.objectives).sum() == pytest.approx(np.sqrt(2), abs=1e-4)
