import json
from dataclasses import replace

import numpy as np
import pytest

from rsmkit.errors import RsmkitError
from rsmkit.language.space import Factor, Space
from rsmkit.optimum.optimum import Optimum
from rsmkit.optimum.options import SearchOptions
from rsmkit.optimum.pareto_front import hypervolume
from rsmkit.optimum.problem import build_problem
from rsmkit.optimum.search import search_problem

SPACE = Space(x=(0.0, 10.0), y=(-1.0, 1.0))


def bowl(points):
    return {"f": (points[:, 0] - 3) ** 2 + 5 * (points[:, 1] - 0.2) ** 2}


def bowl_problem(*subject_to):
    return build_problem(SPACE, "f", bowl, responses=["f"], subject_to=subject_to)


@pytest.mark.parametrize("preset", ["paper", "fast", "matlab_like"])
def test_interior_minimum(preset):
    optimum = search_problem(bowl_problem(), SearchOptions("f", preset=preset))
    np.testing.assert_allclose(optimum.point, [3.0, 0.2], atol=1e-8)


def test_minimum_on_an_active_constraint():
    # Lagrange: minimise (x-3)^2 + 5 (y-0.2)^2 on x + y = 4 gives x = 11/3, y = 1/3, f = 8/15.
    optimum = search_problem(bowl_problem("x + y >= 4"), SearchOptions("f"))
    np.testing.assert_allclose(optimum.point, [11 / 3, 1 / 3], atol=1e-6)
    assert optimum.best.objectives[0] == pytest.approx(8 / 15, rel=1e-9)
    assert optimum.best.margins[0] >= 0.0


def test_equality_as_two_inequalities():
    optimum = search_problem(bowl_problem("4 <= x + y <= 4"), SearchOptions("f"))
    assert optimum.point.sum() == pytest.approx(4.0, abs=1e-8)
    assert optimum.best.objectives[0] == pytest.approx(8 / 15, rel=1e-6)


def test_minimum_at_a_corner_stays_inside_the_bounds():
    problem = build_problem(SPACE, "-x*x - y", bowl, responses=["f"])
    assert search_problem(problem, SearchOptions("f")).point.tolist() == [10.0, 1.0]


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_what_lies_on_a_bound_lies_there_exactly_beside_a_kink(seed):
    space = Space(x=(0.0, 10.0), y=(-1.0, 1.0), z=(2.0, 5.0))
    problem = build_problem(space, "max(x - y, 7 - 2*x) + 1e-7*z", bowl, responses=["f"])
    x, y, z = search_problem(problem, SearchOptions("f", seed=seed)).point
    assert (y, z) == (1.0, 2.0)
    assert x == pytest.approx(8 / 3, abs=1e-9)


def test_mixed_factors_against_enumeration():
    space = Space(
        [
            Factor("n", 0, 40, integer=True),
            Factor("d", levels=(0.5, 2.0, 7.0, 9.0)),
            Factor("c", levels=("a", "b", "c")),
            Factor("x", 0.0, 1.0),
        ]
    )
    extra = np.array([3.0, 1.0, 2.0])

    def response(p):
        level = p[:, 2].astype(int)
        return {
            "f": (p[:, 0] - 17.2 + level) ** 2 + (p[:, 1] - 6) ** 2 + extra[level] + (p[:, 3] - 0.31) ** 2
        }

    problem = build_problem(space, "f", response, responses=["f"])
    grid = np.stack(np.meshgrid(np.arange(41.0), [0.5, 2.0, 7.0, 9.0], np.arange(3.0), [0.31]), -1).reshape(
        -1, 4
    )
    truth = grid[response(grid)["f"].argmin()]
    for seed in range(3):
        optimum = search_problem(problem, SearchOptions("f", seed=seed))
        np.testing.assert_allclose(optimum.point, truth, atol=1e-6)
    assert optimum.factors == {"n": 16, "d": 7.0, "c": "b", "x": pytest.approx(0.31)}


def test_all_factors_with_levels():
    space = Space([Factor("n", 0, 9, integer=True), Factor("c", levels=("a", "b"))])
    problem = build_problem(space, "(n - 6.6)**2 - c", lambda p: {}, responses=[])
    assert search_problem(problem, SearchOptions("f", preset="fast")).factors == {"n": 7, "c": "b"}


def test_the_algorithm_spends_exactly_population_times_generations():
    counted = search_problem(bowl_problem(), SearchOptions("f", polish=False))
    assert counted.evaluations == 24 * 45
    assert counted.history["evaluations"] == [24 * (g + 1) for g in range(45)]
    # Two elites are not run again: 24 + 44 * 22.
    assert (
        search_problem(bowl_problem(), SearchOptions("f", preset="matlab_like", polish=False)).evaluations
        == 992
    )


def test_same_seed_same_result_other_seed_other_history():
    first, again, other = (search_problem(bowl_problem(), SearchOptions("f", seed=s)) for s in (5, 5, 6))
    assert first.to_json() == again.to_json()
    assert first.history != other.history


def test_polish_is_never_worse():
    rough = search_problem(bowl_problem("x + y >= 4"), SearchOptions("f", generations=3, polish=False))
    fine = search_problem(bowl_problem("x + y >= 4"), SearchOptions("f", generations=3))
    assert fine.best.objectives <= rough.best.objectives


def test_history_follows_the_population():
    history = search_problem(bowl_problem(), SearchOptions("f")).history
    best, mean, worst = (np.array(history[key]) for key in ("best", "mean", "worst"))
    assert len(best) == 45
    assert (best <= mean).all()
    assert (mean <= worst).all()
    assert (np.diff(best) <= 0).all()
    assert history["mean_distance"][0] > 10 * history["mean_distance"][-1] > 0


def test_where_nothing_is_feasible_the_point_of_least_violation_is_found():
    optimum = search_problem(bowl_problem("x >= 12"), SearchOptions("f", name="hopeless"))
    assert optimum.missed == {"x >= 12": pytest.approx(2.0)}
    assert optimum.best.label == "least violation"
    assert optimum.point[0] == 10.0
    assert optimum.obstacles.endswith("satisfies every constraint; the nearest misses 'x >= 12' by 2")
    assert Optimum.from_json(json.loads(json.dumps(optimum.to_json())), SPACE).to_json() == optimum.to_json()


def test_two_constraints_that_exclude_each_other_are_missed_in_equal_shares():
    """x <= 2 and x >= 6 on 0..10: margins of sizes near 8 and 6 at first, missed by 4 in all."""
    optimum = search_problem(bowl_problem("x <= 2", "x >= 6"), SearchOptions("f"))
    low, high = optimum.missed["x <= 2"], optimum.missed["x >= 6"]
    assert low + high == pytest.approx(4.0)
    # sizes: the largest |margin| of the first generation is at most 8 and 6, and near it
    assert low / high == pytest.approx(8 / 6, rel=0.2)


def test_an_optimum_that_satisfies_everything_misses_nothing():
    optimum = search_problem(bowl_problem("x >= 5"), SearchOptions("f"))
    assert optimum.missed is None
    assert not optimum.obstacles
    assert "missed" not in optimum.to_json()


def test_a_tiny_feasible_region_is_found_from_outside():
    """The line x + y = 7.123 within 1e-5: no population lies on it, the search for less violation does."""
    problem = bowl_problem("7.12299 <= x + y <= 7.12301")
    optimum = search_problem(problem, SearchOptions("f", preset="fast"))
    assert optimum.missed is None
    assert optimum.point.sum() == pytest.approx(7.123, abs=1.1e-5)


def test_infeasible_front_is_its_point_of_least_violation():
    problem = build_problem(SPACE, ["x", "y"], bowl, responses=["f"], subject_to=["x >= 12"])
    optimum = search_problem(problem, SearchOptions(("x", "y"), preset="fast"))
    assert optimum.front == ()
    assert optimum.missed == {"x >= 12": pytest.approx(2.0)}
    assert [candidate.label for candidate in optimum.candidates] == ["least violation"]
    assert Optimum.from_json(json.loads(json.dumps(optimum.to_json())), SPACE).to_json() == optimum.to_json()


def test_objective_that_is_never_a_number_is_refused():
    problem = build_problem(SPACE, "sqrt(-1 - f)", bowl, responses=["f"])
    with pytest.raises(RsmkitError, match="not a number at any"):
        search_problem(problem, SearchOptions("f", preset="fast"))


def test_failed_evaluations_are_survived():
    def partly(points):
        return {"f": np.where(points[:, 1] < 0.1, np.nan, bowl(points)["f"])}

    problem = build_problem(SPACE, "f", partly, responses=["f"])
    np.testing.assert_allclose(search_problem(problem, SearchOptions("f")).point, [3.0, 0.2], atol=1e-6)


def test_front_between_two_bowls_is_the_segment_between_their_centres():
    def two(points):
        return {"f": (points**2).sum(axis=1), "g": ((points - 1) ** 2).sum(axis=1)}

    problem = build_problem(Space(x=(-2.0, 2.0), y=(-2.0, 2.0)), ["f", "g"], two, responses=["f", "g"])
    optimum = search_problem(problem, SearchOptions(("f", "g"), polish=False))
    values = np.array([c.objectives for c in optimum.front])
    assert len(values) > 100
    # On the segment x = y = t the front is sqrt(f) + sqrt(g) = sqrt(2); its hypervolume is 1.1**2 - 1/6.
    assert (np.sqrt(values).sum(axis=1) >= np.sqrt(2) - 1e-12).all()
    assert 0.97 < hypervolume(values, np.zeros(2), np.full(2, 2.0)) / (1.21 - 1 / 6) < 1
    np.testing.assert_allclose(optimum.point, [0.5, 0.5], atol=0.1)
    assert optimum.best.label == "knee"
    assert [c.label for c in optimum.candidates] == ["knee", "lowest f", "lowest g"]
    assert (np.diff(optimum.history["hypervolume"]) >= -1e-12).all()
    assert optimum.history["front_size"][-1] == len(optimum.front)


def test_an_optimum_on_an_edge_is_found_to_the_last_digits():
    # The kinks are steeper than x*y, so the optimum lies on both: x = y = 1/3.
    space = Space(x=(0.0, 1.0), y=(0.0, 1.0))
    text = "max(3*x - 1, 1 - 3*x) + max(6*y - 2, 2 - 6*y) + x*y"
    problem = build_problem(space, text, lambda p: {}, responses=[])
    found = search_problem(problem, SearchOptions(text, preset="fast"))
    np.testing.assert_allclose(found.point, [1 / 3, 1 / 3], atol=1e-8)
    assert found.best.objectives[0] == pytest.approx(1 / 9, abs=1e-8)


def test_the_method_of_one_objective_is_the_one_asked_for():
    """NSGA-II finds the same minimum by other points: its mutation is polynomial, its selection by rank."""
    options = SearchOptions("f", seed=3, polish=False)
    by_ga = search_problem(bowl_problem(), options)
    by_rank = search_problem(bowl_problem(), replace(options, method="nsga2"))
    assert by_ga.history["best"] != by_rank.history["best"]
    assert by_rank.best.objectives[0] == pytest.approx(by_ga.best.objectives[0], abs=0.05)
