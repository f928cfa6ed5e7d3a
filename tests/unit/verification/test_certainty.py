"""When a refinement knows enough: arithmetic."""

import numpy as np
import pytest
from scipy.stats import qmc

from rsmkit.language.space import Factor, Space
from rsmkit.optimum.problem import build_problem
from rsmkit.verification.options import RefineOptions
from rsmkit.verification.refinement.certainty import largest_gap, noise_hides, spread_out, worth_having
from rsmkit.verification.refinement.models.cube import Cube
from rsmkit.verification.refinement.models.processes import NOISY, Form, fit_process
from rsmkit.verification.refinement.noise import fitted_sd
from rsmkit.verification.refinement.waves import refine_problem

SQUARE = Space(a=(0.0, 10.0), b=(-1.0, 1.0))


def nothing(points):
    return {"f": np.zeros(len(points))}


def test_what_is_worth_having_is_a_part_of_the_larger_of_value_and_spread():
    assert worth_having(-3.0, 2.0, 2.0) == pytest.approx(0.06)
    assert worth_having(0.0, 2.0, 2.0) == pytest.approx(0.04)


def test_noise_hides_what_the_runs_that_are_left_could_not_tell():
    # 25 runs known, 75 left: errors halve at best, 0.4 to 0.2.
    assert noise_hides(0.4, 0.19, 0.5, 25, 75)
    assert not noise_hides(0.4, 0.21, 0.5, 25, 75)
    assert not noise_hides(0.6, 0.1, 0.5, 25, 75)
    assert not noise_hides(0.0, 0.1, 0.0, 25, 0)


def test_the_largest_gap_is_in_ranges_of_the_factors_and_where_runs_are_allowed():
    problem = build_problem(SQUARE, "f", nothing, responses=["f"], subject_to=["a <= 5"])
    cube = Cube(SQUARE)
    # one run at the corner (0, 0): the farthest allowed point is half the first range, or all of the second
    assert largest_gap(cube, problem, np.array([[0.0, 0.0]])) == pytest.approx(1.0, abs=0.01)
    # runs on both ends of the second: the farthest point is half of either range away
    assert largest_gap(cube, problem, np.array([[0.0, 0.0], [0.0, 1.0]])) == pytest.approx(0.5, abs=0.01)


def test_a_category_without_a_run_is_a_gap_of_everything():
    space = Space([Factor("a", low=0.0, high=1.0), Factor("m", levels=("p", "q"))])
    problem = build_problem(space, "f", nothing, responses=["f"])
    unit = np.column_stack([np.linspace(0, 1, 11), np.zeros(11)])
    assert largest_gap(Cube(space), problem, unit) == 1.0


def test_points_of_doubt_lie_apart():
    points = np.array([[0.1, 0.1], [0.12, 0.1], [0.5, 0.1], [0.9, 0.9]])
    chosen = spread_out(Cube(SQUARE), points, 2)
    np.testing.assert_array_equal(chosen, points[[0, 2]])


def test_boldness_enlarges_what_lies_between_runs_and_not_what_noise_leaves_unknown():
    unit = np.repeat(np.linspace(0.0, 1.0, 6), 4)[:, None]
    y = np.sin(6.0 * unit[:, 0]) + 0.2 * np.tile([1.0, -1.0, -1.0, 1.0], 6)
    found = fit_process(Form("rbf"), unit, y, np.zeros(1, bool), nugget=NOISY)
    there, between = np.array([[0.4]]), np.array([[0.5]])
    # at a run only noise is unknown: the process as if without noise knows the value
    assert found.covariance(there, 3.0)[0, 0] == pytest.approx(found.covariance(there, 1.0)[0, 0], rel=1e-3)
    assert found.covariance(between, 3.0)[0, 0] > 1.01 * found.covariance(between, 1.0)[0, 0]
    # without noise all of it is unknown for want of runs: nine times the variance
    quiet = fit_process(Form("rbf"), unit[::4], np.sin(6.0 * unit[::4, 0]), np.zeros(1, bool))
    ratio = quiet.covariance(between, 3.0) / quiet.covariance(between, 1.0)
    assert ratio[0, 0] == pytest.approx(9.0 / quiet.calibration**2)


def test_a_noisy_search_ends_with_a_claim_that_holds():
    rng = np.random.default_rng(4)

    def noisy(points):
        return {"f": 5.0 + (points**2).sum(axis=1) + 0.3 * rng.standard_normal(len(points))}

    space = Space(a=(-1.0, 1.0), b=(-1.0, 1.0))
    grid = np.array([[i, j] for i in (-1, 0, 1) for j in (-1, 0, 1)] + [[0, 0]] * 4, float)
    problem = build_problem(space, "f", noisy, responses=["f"])
    found = refine_problem(problem, problem.evaluate(grid), RefineOptions(max_runs=24))
    result = found.result
    assert result.remaining_gain <= result.noise_sd
    assert found.settled
    # the least value is 5 and may be missed by what is said; its estimate by three standard errors
    truth = 5.0 + (result.best.points[0] ** 2).sum()
    assert truth - 5.0 <= result.remaining_gain
    assert abs(result.smoothed - truth) <= 3.0 * result.error


def test_noise_without_a_repeated_point_is_what_no_process_explains():
    rng = np.random.default_rng(2)
    points = qmc.Sobol(2, rng=3).random(64)
    values = points @ [1.0, 2.0] + 0.2 * rng.standard_normal(64)
    problem = build_problem(
        Space(a=(0.0, 1.0), b=(0.0, 1.0)), "f", lambda x: {"f": values[: len(x)]}, responses=["f"]
    )
    # 64 runs tell a standard deviation to 1 / sqrt(2 * 61) = 9 %: three of these
    assert fitted_sd(Cube(problem.space), problem.evaluate(points)) == pytest.approx(0.2, rel=0.27)
    assert fitted_sd(Cube(problem.space), problem.evaluate(points[:5])) == 0.0
