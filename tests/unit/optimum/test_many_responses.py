"""Desirability, robust objectives and shares: hand-computed cases."""

import numpy as np
import pytest

from rsmkit.errors import RsmkitError
from rsmkit.language.expression import parse_expression
from rsmkit.language.space import Space
from rsmkit.optimum.desirability import Desire, desirability, undesirability
from rsmkit.optimum.feasible import feasible_region
from rsmkit.optimum.options import Noise, RobustOptions, SearchOptions
from rsmkit.optimum.problem import build_problem
from rsmkit.optimum.search import search_problem
from rsmkit.optimum.service.robust import pinned, robust_problem
from rsmkit.optimum.term_shares import dominance_warning, normalised, term_shares

SPACE = Space(x=(-1.0, 1.0), z=(-3.0, 3.0))


def desirable(desire, y):
    return np.asarray(parse_expression(desire.text("y"))({"y": np.array(y)})).tolist()


def test_scales():
    y = [0.0, 2.0, 5.0, 8.0, 10.0, 12.0]
    squared = Desire("maximize", 0.0, 10.0, weight=2.0)
    assert desirable(squared, y) == pytest.approx([0, 0.04, 0.25, 0.64, 1, 1])
    assert desirable(Desire("minimize", 2.0, 10.0), y) == pytest.approx([1, 1, 0.625, 0.25, 0, 0])
    sided = Desire("target", -2.0, 10.0, target=8.0, weight=2.0, weight_above=0.5)
    assert desirable(sided, [3.0, 8.0, 9.5, 11.0, -4.0]) == pytest.approx([0.25, 1.0, 0.5, 0.0, 0.0])


def test_geometric_mean_with_importance():
    desires = {"a": Desire("maximize", 0.0, 1.0, importance=3.0), "b": Desire("maximize", 0.0, 1.0)}
    values = {"a": np.array([0.5, 0.0]), "b": np.array([0.25, 1.0])}
    overall = parse_expression(desirability(desires))
    assert overall(values).tolist() == pytest.approx([(0.5**3 * 0.25) ** 0.25, 0.0])


def test_search_leaves_the_unacceptable_plateau():
    # y = x is acceptable from 0.98 only: almost everywhere the desirability is flat at zero.
    text = undesirability({"y": Desire("maximize", 0.98, 1.0)})
    problem = build_problem(SPACE, text, lambda p: {"y": p[:, 0]}, responses=["y"])
    assert search_problem(problem, SearchOptions(text, preset="fast")).point[0] == 1.0


@pytest.mark.parametrize(
    ("wrong", "key"),
    [
        ({"goal": "target", "low": 0.0, "high": 1.0}, "target"),
        ({"goal": "target", "low": 0.0, "high": 1.0, "target": 2.0}, "target"),
        ({"goal": "minimize", "low": 0.0, "high": 1.0, "target": 0.5}, "target"),
        ({"goal": "maximize", "low": 1.0, "high": 1.0}, "low"),
        ({"goal": "maximize", "low": 0.0, "high": 1.0, "weight": 0.0}, "weight"),
    ],
)
def test_impossible_scales_are_refused(wrong, key):
    assert [found for found, _ in Desire(**wrong).problems()] == [key]


def test_a_search_wants_either_a_minimum_or_desirability():
    wish = {"y": Desire("maximize", 0.0, 1.0)}
    assert [key for key, _ in SearchOptions("y", desirability=wish).problems()] == ["minimize"]
    assert [key for key, _ in SearchOptions().problems()] == ["minimize"]
    assert not SearchOptions(desirability=wish).problems()


def test_region_that_two_constraints_leave():
    problem = build_problem(SPACE, "x", lambda p: {}, responses=[], subject_to=["x >= 0", "z <= 1"])
    region = feasible_region(problem)
    assert region.share == pytest.approx(0.5 * 4 / 6, abs=0.01)
    assert region.low == pytest.approx((0.0, -3.0), abs=0.01)
    assert region.high == pytest.approx((1.0, 1.0), abs=0.01)
    nothing = build_problem(SPACE, "x", lambda p: {}, responses=[], subject_to=["x >= 2"])
    assert feasible_region(nothing).share == 0


def noisy_problem():
    def response(p):
        return {"y": p[:, 0] ** 2 + (1 + p[:, 0]) * p[:, 1]}

    return build_problem(SPACE, "y", response, responses=["y"], subject_to=["z <= 9"])


@pytest.mark.parametrize(("distribution", "variance"), [("normal", 0.25), ("uniform", 0.25 / 3)])
@pytest.mark.parametrize("nodes", [3, 7])
def test_robust_objective_is_mean_plus_weighted_deviation(distribution, variance, nodes):
    # y = x^2 + (1 + x) z with z of mean 1: mean x^2 + (1 + x), standard deviation (1 + x) sigma.
    options = RobustOptions({"z": Noise(1.0, 0.5, distribution)}, deviations=3.0, nodes=nodes)
    robust = robust_problem(noisy_problem(), options)
    x = np.array([[0.0, 9.0], [0.5, np.nan], [-1.0, 0.0]])  # what a point says of z does not count
    expected = x[:, 0] ** 2 + (1 + x[:, 0]) * (1 + 3 * np.sqrt(variance))
    np.testing.assert_allclose(robust.evaluate(x).objectives[:, 0], expected, rtol=1e-9, atol=1e-7)
    np.testing.assert_allclose(pinned(robust, {"z": 1.0}).evaluate(x[:, :1]).margins[:, 0], 8.0)


def test_robust_optimum():
    options = RobustOptions({"z": Noise(0.0, 0.5)}, deviations=2.0)
    problem = pinned(robust_problem(noisy_problem(), options), {"z": 0.0})
    found = search_problem(problem, SearchOptions("y", preset="fast", robust=options))
    # x^2 + (1 + x) is least at x = -1/2.
    assert found.space.names == ("x",)
    assert found.point[0] == pytest.approx(-0.5, abs=1e-4)
    whole = found.completed(SPACE, {"z": 0.0})
    assert whole.factors == {"x": found.point[0], "z": 0.0}
    assert whole.aim == "minimise y; mean + 2 standard deviations over z"


@pytest.mark.parametrize(
    ("noise", "message"),
    [
        ({"q": Noise(0.0, 1.0)}, "noise factors"),
        ({"x": Noise(0.0, 0.1), "z": Noise(0.0, 1.0)}, "noise factors"),
        ({"z": Noise(0.0, 2.0)}, "beyond its bounds -3 to 3"),
    ],
)
def test_noise_factors_must_exist_stay_where_runs_are_and_leave_something(noise, message):
    with pytest.raises(RsmkitError, match=message):
        robust_problem(noisy_problem(), RobustOptions(noise))


def test_shares_of_the_papers_sum():
    # Row 2 of the paper's Table 7 with the weights of its Table 1.
    row = {"F1": 5165120394485.97, "F2": 5674185057.20986, "F3": 10411760398.0818}
    values = {name: np.array([value]) for name, value in row.items()}
    objective = parse_expression("0.2*F1 + 0.7*F2 + 0.1*F3")
    assert float(objective(values)[0]) == pytest.approx(1.038037e12, rel=1e-6)
    shares = term_shares(objective, values)
    assert [round(100 * s.share, 1) for s in shares] == [99.5, 0.4, 0.1]
    assert "'0.2 * F1' carries 99.5 % of the objective" in dominance_warning(shares)
    table9 = parse_expression("0.1*F1 + 0.7*F2 + 0.2*F3")
    assert float(table9(values)[0]) == pytest.approx(522566321068.260, abs=1e-2)
    assert round(100 * term_shares(table9, values)[0].share, 1) == 98.8


def test_balanced_or_single_terms_give_no_warning():
    values = {"a": np.array([1.0, 2.0]), "b": np.array([2.0, 0.5])}
    assert dominance_warning(term_shares(parse_expression("a - b"), values)) is None
    assert dominance_warning(term_shares(parse_expression("a"), values)) is None
    assert [s.spread for s in term_shares(parse_expression("a - b"), values)] == pytest.approx([0.4, 0.6])


def test_normalised_objective_gives_every_quantity_its_weight():
    values = {"a": np.array([1.0, 3.0]), "b": np.array([1e12, 5e12])}
    text = normalised(parse_expression("a + b"), values, {"a": 0.25, "b": 0.75})
    assert parse_expression(text)({"a": 2.0, "b": 5e12}) == pytest.approx(0.25 * 0.5 + 0.75)
