import json

import numpy as np
import pytest

from rsmkit.errors import RsmkitError
from rsmkit.io.json_codec import from_json, to_json
from rsmkit.language.space import Factor, Space
from rsmkit.optimum.problem import build_problem
from rsmkit.verification.options import RefineOptions
from rsmkit.verification.refinement.noise import repeated_sd
from rsmkit.verification.refinement.refinement import RefinementRecord
from rsmkit.verification.refinement.trust_search import TrustSearch
from rsmkit.verification.refinement.waves import refine_problem

SPACE = Space(a=(0.0, 1.0), b=(0.0, 1.0), c=(0.0, 1.0))
COMPOSITE = 0.5 + 0.5 * np.vstack(
    [
        0.5946 * np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)]),
        np.eye(3),
        -np.eye(3),
        np.zeros((1, 3)),
    ]
)


def skew(points):
    z = np.array([6.0, -5.0, 4.0]) * (points - [0.35, 0.6, 0.45])
    return {"f": 1 + (np.exp(z) - z).sum(axis=1), "g": points.sum(axis=1)}


def start(*subject_to, minimize="f", responses=skew, space=SPACE, points=COMPOSITE, functions=None):
    problem = build_problem(
        space, minimize, responses, responses=["f", "g"], subject_to=subject_to, functions=functions
    )
    return problem, problem.evaluate(points)


@pytest.fixture(scope="module")
def result():
    return refine_problem(*start())


def test_minimum_of_skewed_exponentials(result):
    # Each term exp(z) - z is least at z = 0 with value 1: minimum 4 at (0.35, 0.6, 0.45).
    assert result.best.objectives[0, 0] == pytest.approx(4.0, abs=1e-5)
    np.testing.assert_allclose(result.best.points[0], [0.35, 0.6, 0.45], atol=1e-3)
    after = np.cumsum([len(wave.points) for wave in result.waves])
    assert after[[wave.best < 4.01 for wave in result.waves]][0] <= 16
    assert result.runs < 60
    assert result.start_runs == 15


def test_it_stops_when_nothing_is_left_to_gain_and_says_so(result):
    assert "nothing promised a further gain" in result.reason
    assert result.settled
    assert all(wave.expected_gain < 1e-3 for wave in result.waves[-2:])
    assert 0 <= result.result.remaining_gain < 0.1


@pytest.mark.parametrize(("boldly", "waves"), [(5.0, 1), (20.0, 0)])
def test_a_wave_is_quiet_only_if_little_is_expected_anywhere_also_by_bolder_models(boldly, waves):
    problem, known = start()
    search = TrustSearch(problem, known, RefineOptions())
    search.ask(4)
    plan = search._plan
    plan.feasible, plan.promised, plan.better, plan.expected = True, 0.0, 0.0, 0.0
    plan.boldly = boldly * search.tolerance
    search.tell(problem.evaluate(COMPOSITE[:4]))  # nothing new, so nothing gained
    assert len(search._quiet) == waves


def test_repeated_centre_runs_change_nothing():
    short = RefineOptions(max_runs=8)
    repeated = np.vstack([COMPOSITE, COMPOSITE[-1:], COMPOSITE[-1:]])
    once, thrice = (refine_problem(*start(points=points), short) for points in (COMPOSITE, repeated))
    assert thrice.start_runs == 17
    assert [w.points.tolist() for w in thrice.waves] == [w.points.tolist() for w in once.waves]


def test_budget_is_kept_exactly():
    result = refine_problem(*start(), RefineOptions(batch=4, max_runs=10))
    assert [len(wave.points) for wave in result.waves] == [4, 4, 2]
    assert result.reason == "the budget of 10 runs is spent"


def test_never_worse_than_the_start_and_never_outside():
    problem, known = start()
    result = refine_problem(problem, known, RefineOptions(max_runs=12))
    assert result.best.objectives[0, 0] <= known.objectives.min()
    assert SPACE.contains(np.vstack([wave.points for wave in result.waves]), tolerance=0.0).all()


def test_same_seed_same_runs(result):
    again = refine_problem(*start(), RefineOptions(max_runs=8))
    assert [wave.points.tobytes() for wave in again.waves] == [w.points.tobytes() for w in result.waves[:2]]


def test_resuming_repeats_the_runs_already_made():
    asked = []

    def journal(points):
        asked.append(points)
        return skew(points)

    problem, known = start(responses=journal)
    asked.clear()
    short = refine_problem(problem, known, RefineOptions(max_runs=8))
    before = [points.copy() for points in asked]
    asked.clear()
    refine_problem(problem, known, RefineOptions(max_runs=12))
    np.testing.assert_array_equal(asked[:2], before)
    assert short.runs == 8


def test_cheap_constraints_hold_at_every_run_and_the_minimum_lies_on_one():
    # With a >= 0.5 active the other two factors keep their free minimum.
    problem, known = start("a >= 0.5")
    result = refine_problem(problem, known)
    assert all(problem.cheap_margins(wave.points).min() >= 0 for wave in result.waves)
    np.testing.assert_allclose(result.best.points[0], [0.5, 0.6, 0.45], atol=2e-3)


@pytest.mark.slow
def test_a_constraint_on_a_response_is_modelled_and_kept_by_the_result():
    # Minimise sum(exp(z) - z) on a + b + c <= 1.2: Lagrange, solved here by bisection on the multiplier.
    slope = np.array([6.0, -5.0, 4.0])

    def point(multiplier):
        return np.array([0.35, 0.6, 0.45]) + np.log(1 - multiplier / slope) / slope

    low, high = 0.0, 3.99
    for _ in range(100):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if point(middle).sum() > 1.2 else (low, middle)
    result = refine_problem(*start("g <= 1.2"))
    assert result.best.margins[0, 0] >= -1e-6
    expected = skew(point(low)[None])["f"][0]
    assert result.best.objectives[0, 0] == pytest.approx(expected, rel=1e-3)


def test_failed_runs_are_passed_over():
    def flaky(points):
        found = skew(points)
        found["f"] = np.where(points[:, 1] > 0.7, np.nan, found["f"])
        return found

    result = refine_problem(*start(responses=flaky), RefineOptions(max_runs=28))
    assert result.best.objectives[0, 0] == pytest.approx(4.0, abs=1e-3)


def test_levels_and_categories():
    space = Space([Factor("n", 0, 20, integer=True), Factor("x", 0.0, 1.0), Factor("c", levels=("p", "q"))])
    grid = np.stack(np.meshgrid([0.0, 10.0, 20.0], [0.0, 0.5, 1.0], [0.0, 1.0]), -1).reshape(-1, 3)

    def response(p):
        return {"f": (p[:, 0] / 20 - 0.37) ** 2 + (p[:, 1] - 0.2) ** 2 + 0.3 * p[:, 2], "g": p[:, 0]}

    result = refine_problem(*start(space=space, points=grid, responses=response))
    assert space.values(result.best.points[0]) == {"n": 7, "x": pytest.approx(0.2, abs=1e-2), "c": "p"}


def test_noise_does_not_make_it_chase_lucky_values():
    rng = np.random.default_rng(0)

    def noisy(points):
        found = skew(points)
        return {**found, "f": found["f"] + 0.005 * rng.normal(size=len(points))}

    result = refine_problem(*start(responses=noisy), RefineOptions(noise_sd=0.005, max_runs=40))
    assert skew(result.best.points)["f"][0] == pytest.approx(4.0, abs=0.05)


def test_every_wave_is_one_line_and_the_record_is_plain():
    seen = []
    result = refine_problem(*start(), RefineOptions(max_runs=8), on_wave=seen.append)
    assert seen == list(result.waves)
    assert seen[0].sentence.startswith("wave 1: 4 runs in the whole box; ")
    assert all("\n" not in wave.sentence for wave in seen)
    document = json.loads(json.dumps(to_json(result.record()), allow_nan=False))
    assert from_json(RefinementRecord, document, "refinement.json", "") == result.record()


def test_without_any_run_it_cannot_begin():
    with pytest.raises(RsmkitError, match="needs runs to begin with"):
        refine_problem(*start(points=COMPOSITE[:0]))


def test_from_two_runs_it_looks_around_first():
    result = refine_problem(*start(points=COMPOSITE[[0, 8]]), RefineOptions(max_runs=40))
    assert result.waves[0].kinds == ("filling",) * 4
    assert result.best.objectives[0, 0] == pytest.approx(4.0, abs=1e-2)


def test_failed_runs_are_never_made_again():
    def fails(points):
        found = skew(points)
        return {**found, "f": np.where(points @ [1.0, 1.0, 0.0] < 1.05, np.nan, found["f"])}

    result = refine_problem(*start(responses=fails), RefineOptions(max_runs=44))
    points = np.vstack([COMPOSITE, *(wave.points for wave in result.waves)])
    assert len(np.unique(points, axis=0)) == len(points)
    # least on a + b = 1.05, where the slopes of both terms agree
    along = np.linspace(0.05, 1.0, 100_001)
    least = skew(np.column_stack([along, 1.05 - along, np.full_like(along, 0.45)]))["f"].min()
    assert result.best.objectives[0, 0] == pytest.approx(least, abs=0.05)
    assert len(result.record().failed) == np.isnan(fails(points)["f"]).sum()


def test_all_runs_failing_is_said():
    result = refine_problem(
        *start(responses=lambda p: {"f": np.full(len(p), np.nan), "g": p[:, 0]}), RefineOptions(max_runs=8)
    )
    assert not result.result.feasible
    assert result.runs == 8


def test_nothing_feasible_at_first():
    # the ball about the corner is missed by every point of the design
    problem, known = start("f <= 8", "g >= 2.2", minimize="a")
    assert not (known.margins >= 0).all(axis=1).any()
    result = refine_problem(problem, known, RefineOptions(max_runs=16))
    assert result.result.feasible
    assert (result.best.margins >= -1e-14).all()  # g is a sum of three numbers, each rounded to 2e-16


def test_infeasible_for_good_is_not_called_found():
    result = refine_problem(*start("g >= 4"), RefineOptions(max_runs=12))
    assert not result.result.feasible
    assert result.best.margins[0, 0] == pytest.approx(-1.0, abs=0.05)  # the corner misses least


def test_a_composed_objective_keeps_its_kinks():
    # |f - 5| is zero on a surface; a model of the whole would round the kink off
    result = refine_problem(*start(minimize="abs(f - 5) + max(g - 1.2, 0)"), RefineOptions(max_runs=20))
    assert result.best.objectives[0, 0] < 1e-3


def test_the_other_basin_is_found():
    # two valleys, the deeper one narrow; the design sees only the other
    def two(points):
        far, near = points - [0.15, 0.2, 0.8], points - [0.7, 0.7, 0.3]
        f = 2.0 * (near**2).sum(axis=1) - 2.5 * np.exp(-(far**2).sum(axis=1) / 0.04)
        return {"f": f, "g": points[:, 0]}

    result = refine_problem(*start(responses=two))
    assert result.best.objectives[0, 0] < two(np.array([[0.16, 0.21, 0.79]]))["f"][0]


def test_categories_other_than_that_of_the_best_run_are_searched():
    space = Space([Factor("x", 0.0, 1.0), Factor("c", levels=("p", "q", "r"))])

    def response(p):
        best = np.array([0.2, 0.9, 0.45])[p[:, 1].astype(int)]
        sharp = np.array([1.0, 1.0, 30.0])[p[:, 1].astype(int)]
        return {
            "f": sharp * (p[:, 0] - best) ** 2 + np.array([0.1, 0.2, 0.0])[p[:, 1].astype(int)],
            "g": p[:, 0],
        }

    grid = np.array([[x, c] for x in (0.0, 1.0) for c in (0.0, 1.0, 2.0)] + [[0.2, 0.0]])
    result = refine_problem(*start(space=space, points=grid, responses=response), RefineOptions(max_runs=32))
    assert space.values(result.best.points[0]) == {"x": pytest.approx(0.45, abs=1e-2), "c": "r"}


def test_sixteen_at_once_and_one_at_a_time_end_alike():
    for batch, runs in ((1, 32), (16, 48)):
        result = refine_problem(*start(), RefineOptions(batch=batch, max_runs=runs))
        assert result.best.objectives[0, 0] == pytest.approx(4.0, abs=1e-3)
        assert all(len(wave.points) <= batch for wave in result.waves)


def test_noise_is_estimated_from_repeated_points():
    rng = np.random.default_rng(3)

    def noisy(points):
        found = skew(points)
        return {**found, "f": found["f"] + 0.05 * rng.normal(size=len(points))}

    _, known = start(responses=noisy, points=np.vstack([COMPOSITE, *[COMPOSITE[-1:]] * 8]))
    assert repeated_sd(known) == pytest.approx(0.05, rel=0.6)
    assert repeated_sd(start(points=np.vstack([COMPOSITE, COMPOSITE]))[1]) == 0.0


def test_the_front_of_two_objectives():
    # minimise distances to two corners: the front is the segment between them
    def two(points):
        return {"f": ((points - 0.1) ** 2).sum(axis=1), "g": ((points - 0.9) ** 2).sum(axis=1)}

    problem, known = start(minimize=["f", "g"], responses=two)
    result = refine_problem(problem, known, RefineOptions(max_runs=16))
    front = result.result.front
    assert len(front) >= 10
    np.testing.assert_allclose(front.points, front.points.mean(axis=1, keepdims=True) * [1, 1, 1], atol=0.1)
    record = result.record()
    assert record.measure == "hypervolume"
    assert [wave.best for wave in record.waves] == sorted(wave.best for wave in record.waves)
    document = json.loads(json.dumps(to_json(record), allow_nan=False))
    assert from_json(RefinementRecord, document, "refinement.json", "") == record
