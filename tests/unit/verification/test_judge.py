import json

import numpy as np
import pytest

from rsmkit.errors import RsmkitError
from rsmkit.language.space import Space
from rsmkit.optimum.optimum import Candidate, Optimum
from rsmkit.optimum.problem import build_problem
from rsmkit.verification.judge import best_known, judge_optimum
from rsmkit.verification.options import VerifyOptions
from rsmkit.verification.verification import Comparison, SimulatorRuns, Verification

SPACE = Space(x=(0.0, 10.0))


class Flat:
    """A surface that predicts one value with one half width."""

    def __init__(self, value, half_width=1.0):
        self.value, self.half_width = value, half_width

    def predict(self, X, *, interval):
        mean = np.full(len(X), self.value)
        return mean, mean - self.half_width, mean + self.half_width


def optimum(*labels, minimize=("f",), subject_to=()):
    candidates = tuple(Candidate(np.array([4.0]), (10.0,) * len(minimize), {}, (), label) for label in labels)
    front = candidates if len(labels) > 1 else ()
    return Optimum("scalar", SPACE, minimize, subject_to, {}, 1, 1080, candidates[0], {}, front)


def problem(minimize="f", subject_to=()):
    return build_problem(SPACE, minimize, lambda p: {}, responses=["f", "g"], subject_to=subject_to)


def confirm(actual, *, design=(12.0, 11.0, 15.0), half_width=1.0, subject_to=(), options=None, own=True):
    about = problem(subject_to=subject_to)
    points = np.linspace(0, 10, len(design))[:, None]
    runs = about.evaluation(points, {"f": np.array(design), "g": np.zeros(len(design))})
    return judge_optimum(
        about,
        optimum("optimum"),
        [{"f": actual, "g": 0.0}],
        surfaces={"f": Flat(10.0), "g": Flat(0.0)},
        objective_surfaces={"f": Flat(10.0, half_width)} if own else None,
        design=runs,
        options=options,
    )


def test_the_errors_of_table_9():
    row = Comparison(predicted=522566321068.260, actual=565385440921.823)
    assert row.error_pct == pytest.approx(7.5734, abs=5e-5)
    assert row.signed_error_pct == row.error_pct  # the true value is higher: the prediction was optimistic
    assert Comparison(predicted=5.0, actual=-4.0).signed_error_pct == pytest.approx(-225.0)


@pytest.mark.parametrize(("excess", "verdict"), [(1e-7, "CONFIRMED"), (1e-5, "NOT CONFIRMED")])
def test_an_optimum_that_is_a_design_point_is_not_worse_for_its_last_digits(excess, verdict):
    result = confirm(10.0 * (1 + excess), design=(12.0, 10.0, 15.0), half_width=1e-7)
    assert result.verdict == verdict
    assert ("as good as the best of 3 design runs" in result.sentence) == (verdict == "CONFIRMED")


def test_an_error_on_zero_is_undefined_unless_there_is_none():
    assert Comparison(1.0, 0.0).error_pct is None
    assert not Comparison(1.0, 0.0).within(50.0)
    assert Comparison(0.0, 0.0).error_pct == 0.0


def test_confirmed():
    result = confirm(10.1)
    assert result.verdict == "CONFIRMED"
    assert result.improvement_pct == pytest.approx(100 * 0.9 / 11)
    assert "0.99 % off" in result.sentence
    assert "8.18 % better than the best of 3 design runs" in result.sentence


def test_better_but_beyond_the_tolerance():
    result = confirm(10.5)
    assert result.verdict == "IMPROVED, MODEL POOR"
    assert "more than the 2 % allowed" in result.sentence
    assert not result.within(2.0)
    assert result.within(5.0)
    assert confirm(10.5, options=VerifyOptions(tolerance_pct=5.0)).verdict == "CONFIRMED"


def test_better_but_outside_the_interval():
    result = confirm(10.1, half_width=0.05)
    assert result.verdict == "IMPROVED, MODEL POOR"
    assert "outside the 95 % prediction interval" in result.sentence


def test_without_a_surface_of_the_objective_only_error_and_improvement_count():
    result = confirm(10.1, own=False)
    assert result.verdict == "CONFIRMED"
    assert result.objective.inside is None
    assert "interval" not in result.sentence


def test_worse_than_the_best_design_run():
    result = confirm(10.1, design=(12.0, 10.05, 15.0))
    assert result.verdict == "NOT CONFIRMED"
    assert "worse than the best of 3 design runs" in result.sentence


def test_a_violated_constraint_cannot_be_confirmed():
    result = confirm(10.1, subject_to=("f <= 9.8",))
    assert result.verdict == "NOT CONFIRMED"
    assert "violates 'f <= 9.8' by 0.3" in result.sentence
    assert result.constraints[0].actual == pytest.approx(-0.3)


def test_a_constraint_on_a_response_has_the_same_tolerance_as_the_objective():
    result = confirm(10.1, subject_to=("f <= 10",))
    assert result.constraints[0].predicted == 0.0
    assert result.constraints[0].actual == pytest.approx(-0.1)
    assert result.verdict == "CONFIRMED"


def test_runs_outside_the_bounds_or_infeasible_or_failed_are_no_rivals():
    about = problem(subject_to=["x >= 1"])
    points = np.array([[-2.0], [0.0], [5.0], [6.0], [7.0]])
    runs = about.evaluation(points, {"f": np.array([1.0, 2.0, np.nan, 4.0, 5.0]), "g": np.zeros(5)})
    assert best_known(about, runs).points.tolist() == [[6.0]]


def test_no_rival_at_all():
    result = confirm(10.1, design=())
    assert result.verdict == "CONFIRMED"
    assert result.best_design is None
    assert "no design run inside the bounds" in result.sentence


def test_front_points_are_judged_by_dominance():
    about = problem(["f", "g"])
    runs = about.evaluation(
        np.array([[1.0], [2.0]]), {"f": np.array([10.0, 20.0]), "g": np.array([9.9, 1.0])}
    )
    result = judge_optimum(
        about,
        optimum("knee", "lowest f", "lowest g", minimize=("f", "g")),
        [{"f": 10.1, "g": 10.1}, {"f": 9.9, "g": 10.0}, {"f": 10.2, "g": 9.8}],
        surfaces={"f": Flat(10.0), "g": Flat(10.0)},
        design=runs,
    )
    assert result.point == "knee"
    assert result.verdict == "NOT CONFIRMED"
    assert [e.point for e in result.extremes] == ["lowest f", "lowest g"]
    assert [e.verdict for e in result.extremes] == ["CONFIRMED", "IMPROVED, MODEL POOR"]
    assert result.simulator_runs.verification == 3
    assert list(result.extremes[1].objectives) == ["f", "g"]
    # The headline of a front is its worst predicted objective.
    assert result.extremes[1].objective.actual == 9.8


def confirm_runs():
    return problem().evaluation(np.empty((0, 1)), {"f": np.empty(0), "g": np.empty(0)})


def test_a_run_without_the_response_is_refused():
    with pytest.raises(RsmkitError, match="gave no f"):
        confirm(float("nan"))
    with pytest.raises(RsmkitError, match="1 points to verify but 0 runs"):
        judge_optimum(problem(), optimum("optimum"), [], surfaces={}, design=confirm_runs())


def document():
    return Verification((confirm(10.1, subject_to=("f <= 11",)),), SimulatorRuns(50, 1)).to_json()


def test_document():
    found = json.loads(json.dumps(document(), allow_nan=False))
    record = found["searches"][0]
    assert found["simulator_runs"] == {"design": 50, "verification": 1}
    assert record["name"] == "scalar"
    assert record["factors"] == {"x": 4.0}
    assert record["objective"] == pytest.approx(
        {"predicted": 10.0, "low": 9.0, "high": 11.0, "actual": 10.1}
        | dict.fromkeys(("error_pct", "signed_error_pct"), 100 * 0.1 / 10.1)
    )
    assert set(record["responses"]["f"]) >= {"predicted", "low", "high", "actual", "error_pct"}
    assert record["simulator_runs"] == {"design": 3, "verification": 1}
    assert Verification.from_json(found).to_json() == found


def test_html_table_escapes():
    found = document()
    found["searches"][0]["name"] = "<i>"
    assert "&lt;i&gt;" in Verification.from_json(found)._repr_html_()


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("name", 1),
        ("verdict", "EXCELLENT"),
        ("factors", {"x": [1]}),
        ("objectives", {}),
        ("objectives", {"f": 3}),
        ("objectives", {"f": {"predicted": 1.0, "actual": float("nan")}}),
        ("responses", {"f": {"predicted": 1.0, "actual": 1.0, "low": "a", "high": 2.0}}),
        ("responses", None),
        ("constraints", [{}]),
        ("constraints", ["f <= 1"]),
        ("best_design", "low"),
        ("simulator_runs", {"design": 1.5}),
        ("extremes", [None]),
    ],
)
def test_malformed_documents_are_refused(key, value):
    broken = document()
    broken["searches"][0][key] = value
    with pytest.raises(RsmkitError, match=r"verification\.json"):
        Verification.from_json(broken)
