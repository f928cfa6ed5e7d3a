import json

import numpy as np
import pytest

from rsmkit.errors import RsmkitError
from rsmkit.io.json_codec import from_json, to_json
from rsmkit.language.space import Factor, Space
from rsmkit.language.terms import full_terms
from rsmkit.optimum.problem import build_problem
from rsmkit.verification.options import RefineOptions
from rsmkit.verification.refinement.refinement import RefinementRecord
from rsmkit.verification.refinement.trust_region import TrustRegion, fill, scaled
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
    assert result.runs <= 40
    assert result.start_runs == 15


def test_it_stops_when_nothing_is_left_to_gain_and_says_so(result):
    assert "no further gain" in result.reason
    assert all(wave.predicted_gain < 1e-3 for wave in result.waves[-2:])


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
    assert refine_problem(*start()).record() == result.record()


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
    assert result.best.margins[0, 0] >= 0
    expected = skew(point(low)[None])["f"][0]
    assert result.best.objectives[0, 0] == pytest.approx(expected, rel=1e-3)


def test_failed_runs_are_passed_over():
    def flaky(points):
        found = skew(points)
        found["f"] = np.where(points[:, 1] > 0.7, np.nan, found["f"])
        return found

    result = refine_problem(*start(responses=flaky))
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


def test_several_objectives_or_too_few_runs_are_refused():
    with pytest.raises(RsmkitError, match="one objective"):
        refine_problem(*start(minimize=["f", "g"]))
    with pytest.raises(RsmkitError, match="at least 5 successful runs"):
        refine_problem(*start(points=COMPOSITE[:4]))


def test_fill_is_d_optimal_first_and_then_far_from_everything():
    problem, _ = start()
    region = TrustRegion(problem, np.full(3, 0.5), 0.25)
    corner = np.full((1, 3), 0.5)
    points = fill(region, corner, 12, seed=1, well_poised=10)
    assert region.contains(points, 1.0).all()
    information = full_terms(3, 2).matrix((np.vstack([corner, points[:9]]) - 0.5) / 0.25)
    random = np.random.default_rng(0).uniform(0.25, 0.75, size=(200, 9, 3))
    rivals = [full_terms(3, 2).matrix((np.vstack([corner, r]) - 0.5) / 0.25) for r in random]
    assert abs(np.linalg.det(information)) > np.quantile([abs(np.linalg.det(r)) for r in rivals], 0.99)
    gaps = np.abs(scaled(SPACE, points[9:])[:, None] - scaled(SPACE, points[:9])[None]).max(axis=2)
    assert gaps.min() > 0.1
