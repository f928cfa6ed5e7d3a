"""Desirability, robust objectives and shares: hand-computed cases."""

import numpy as np
import pytest

from rsmkit.errors import RsmkitError
from rsmkit.expression import parse_expression
from rsmkit.optimum.desirability import Desire, desirability_problem, overall_desirability, overlay
from rsmkit.optimum.options import SearchOptions
from rsmkit.optimum.problem import build_problem
from rsmkit.optimum.robust import NoiseFactor, robust_problem
from rsmkit.optimum.search import search
from rsmkit.optimum.shares import dominance_warning, normalised, term_shares
from rsmkit.space import Space

SPACE = Space(x=(-1.0, 1.0), z=(-3.0, 3.0))


def test_scales():
    x = np.array([0.0, 2.0, 5.0, 8.0, 10.0, 12.0])
    squared = Desire("y", "maximise", 0.0, 10.0, weight=2.0)
    assert squared(x).tolist() == pytest.approx([0, 0.04, 0.25, 0.64, 1, 1])
    assert Desire("y", "minimise", 2.0, 10.0)(x).tolist() == pytest.approx([1, 1, 0.625, 0.25, 0, 0])
    sided = Desire("y", "target", 0.0, 10.0, target=8.0, weight=2.0, weight_above=0.5)
    assert sided(np.array([4.0, 8.0, 9.5, 11.0])).tolist() == pytest.approx([0.25, 1.0, 0.5, 0.0])


def test_geometric_mean_with_importance():
    desires = (Desire("a", "maximise", 0.0, 1.0, importance=3.0), Desire("b", "maximise", 0.0, 1.0))
    values = {"a": np.array([0.5, 0.0]), "b": np.array([0.25, 1.0])}
    assert overall_desirability(desires, values).tolist() == pytest.approx([(0.5**3 * 0.25) ** 0.25, 0.0])


def test_search_leaves_the_unacceptable_plateau():
    # y = x is acceptable from 0.98 only: almost everywhere the desirability is flat at zero.
    problem = build_problem(SPACE, "y", lambda p: {"y": p[:, 0]}, responses=["y"])
    wanted = desirability_problem(problem, (Desire("y", "maximise", 0.98, 1.0),))
    assert search(wanted, SearchOptions("y", preset="fast")).point[0] == 1.0


@pytest.mark.parametrize(
    "wrong",
    [
        {"goal": "target", "low": 0.0, "high": 1.0},
        {"goal": "target", "low": 0.0, "high": 1.0, "target": 2.0},
        {"goal": "maximise", "low": 1.0, "high": 1.0},
        {"goal": "maximise", "low": 0.0, "high": 1.0, "weight": 0.0},
    ],
)
def test_impossible_scales_are_refused(wrong):
    with pytest.raises(RsmkitError, match="desirability of y"):
        Desire("y", **wrong)


def test_overlay_of_constraints():
    problem = build_problem(SPACE, "x", lambda p: {}, responses=[], subject_to=["x >= 0", "z <= 1"])
    _, feasible = overlay(problem, np.array([[0.5, 0.0], [0.5, 2.0], [-0.5, 0.0]]))
    assert feasible.tolist() == [True, False, False]


def noisy_problem():
    def response(p):
        return {"y": p[:, 0] ** 2 + (1 + p[:, 0]) * p[:, 1]}

    return build_problem(SPACE, "y", response, responses=["y"], subject_to=["z <= 9"])


@pytest.mark.parametrize(("distribution", "variance"), [("normal", 0.25), ("uniform", 0.25 / 3)])
def test_robust_objective_is_mean_plus_weighted_deviation(distribution, variance):
    # y = x^2 + (1 + x) z with z of mean 2: mean x^2 + 2 (1 + x), standard deviation (1 + x) sigma.
    robust = robust_problem(noisy_problem(), (NoiseFactor("z", 2.0, 0.5, distribution),), weight=3.0)
    x = np.array([[0.0], [0.5], [-1.0]])
    expected = x[:, 0] ** 2 + (1 + x[:, 0]) * (2 + 3 * np.sqrt(variance))
    np.testing.assert_allclose(robust.evaluate(x).objectives[:, 0], expected, rtol=1e-9, atol=1e-7)
    assert robust.space.names == ("x",)
    np.testing.assert_allclose(robust.evaluate(x).margins[:, 0], 7.0)


def test_robust_optimum():
    robust = robust_problem(noisy_problem(), (NoiseFactor("z", 0.0, 0.5),), weight=2.0)
    # x^2 + (1 + x) is least at x = -1/2.
    assert search(robust, SearchOptions("y", preset="fast")).point[0] == pytest.approx(-0.5, abs=1e-4)


def test_noise_factors_must_exist_and_leave_something():
    for noise in ((NoiseFactor("q", 0.0, 1.0),), (NoiseFactor("x", 0.0, 1.0), NoiseFactor("z", 0.0, 1.0))):
        with pytest.raises(RsmkitError, match="noise factors"):
            robust_problem(noisy_problem(), noise, weight=1.0)


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
