import json
from dataclasses import replace

import numpy as np
import pytest
from judged_optima import SPACE, Flat, confirm, optimum, problem

from rsmkit.errors import RsmkitError
from rsmkit.optimum.desirability import Desire, undesirability
from rsmkit.optimum.optimum import Candidate, Optimum
from rsmkit.verification.flown import Flown
from rsmkit.verification.judge import best_known, judge_optimum, judge_refinement
from rsmkit.verification.options import VerifyOptions
from rsmkit.verification.verification import BestKnown, Comparison, SimulatorRuns, SpentRuns, Verification


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


def test_within_the_tolerance_but_outside_the_interval():
    """Within the tolerance of the value itself it is said; within that of a larger spread alone it counts."""
    result = confirm(10.1, half_width=0.05)
    assert result.verdict == "CONFIRMED"
    assert "outside the 95 % prediction interval" in result.sentence
    wide = (110.0, 11.0, 210.0)  # spread 99: 2 % of it are 1.98
    assert confirm(10.5, design=wide).verdict == "CONFIRMED"
    assert "(0.505 % of the spread of the design runs)" in confirm(10.5, design=wide).sentence
    poor = confirm(10.5, design=wide, half_width=0.05)
    assert poor.verdict == "IMPROVED, MODEL POOR"
    assert "outside the 95 % prediction interval" in poor.sentence


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
        | dict.fromkeys(("error_pct", "signed_error_pct", "scaled_error_pct"), 100 * 0.1 / 10.1)
        | {"spread": 1.0}
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


@pytest.mark.parametrize("offset", [0.0, 1e-9, 1.0])
def test_a_constraint_with_a_limit_of_zero_forgives_rounding_however_it_is_written(offset):
    """Margins of the runs 1 to 5: their quartiles are 2 apart, so 2e-6 is rounding and 2e-4 is not."""

    def violated_by(amount):
        about = problem(subject_to=[f"g + {offset} <= {offset}"])
        runs = about.evaluation(
            np.linspace(0, 10, 5)[:, None], {"f": np.linspace(11, 15, 5), "g": -np.arange(1.0, 6.0)}
        )
        return judge_optimum(
            about,
            optimum("optimum"),
            [{"f": 10.0, "g": amount}],
            surfaces={"f": Flat(10.0), "g": Flat(0.0)},
            design=runs,
            options=VerifyOptions(tolerance_pct=1e-3),
        )

    assert violated_by(3.8e-15).verdict == "CONFIRMED"
    assert violated_by(1e-6).verdict == "CONFIRMED"
    assert violated_by(2e-4).verdict == "NOT CONFIRMED"


@pytest.mark.parametrize(
    ("actual", "words"),
    [(0.001, "0.9 % of the spread of the design runs off"), (0.01, "90 % off (0.45 % of the spread")],
)
def test_an_error_of_what_is_nothing_beside_the_spread_is_told_by_the_spread(actual, words):
    """Runs 1, 3, 7, whose spread is 2; below a thousandth of it a percentage of the value says nothing."""
    about = problem()
    runs = about.evaluation(
        np.array([[1.0], [2.0], [3.0]]), {"f": np.array([3.0, 1.0, 7.0]), "g": np.zeros(3)}
    )
    predicted = actual + (0.018 if actual == 0.001 else 0.009)
    result = judge_optimum(
        about, optimum("optimum"), [{"f": actual, "g": 0.0}], surfaces={"f": Flat(predicted)}, design=runs
    )
    assert words in result.sentence


@pytest.mark.parametrize(
    ("predicted", "actual", "verdict"),
    [(6e-15, 4e-17, "CONFIRMED"), (-0.03, 0.01, "CONFIRMED"), (-0.2, 0.1, "IMPROVED, MODEL POOR")],
)
def test_an_objective_near_zero_is_judged_by_the_spread_of_the_runs(predicted, actual, verdict):
    """Runs 1, 3, 7: median less least is 2, of which 2 % is 0.04."""
    about = problem()
    runs = about.evaluation(
        np.array([[1.0], [2.0], [3.0]]), {"f": np.array([3.0, 1.0, 7.0]), "g": np.zeros(3)}
    )
    result = judge_optimum(
        about, optimum("optimum"), [{"f": actual, "g": 0.0}], surfaces={"f": Flat(predicted)}, design=runs
    )
    assert result.verdict == verdict
    assert result.objective.spread == 2.0
    assert result.objective.scaled_error_pct == pytest.approx(50 * abs(actual - predicted))
    assert "of the spread" in result.sentence or "the same" in result.sentence


def test_a_percentage_of_a_value_that_is_nothing_beside_its_spread_is_not_given():
    assert Comparison(6e-15, 4e-17, spread=2.0).error_pct is None
    assert Comparison(6e-15, 4e-17).error_pct == pytest.approx(14900.0)


def test_a_failed_point_gets_its_verdict_and_the_others_theirs():
    about = problem(["f", "g"])
    runs = about.evaluation(
        np.array([[1.0], [2.0]]), {"f": np.array([11.0, 20.0]), "g": np.array([11.0, 12.0])}
    )
    result = judge_optimum(
        about,
        optimum("knee", "lowest f", "lowest g", minimize=("f", "g")),
        [{"f": 10.0, "g": 10.0}, Flown((), "timeout: 60 s"), {"f": 10.1, "g": 9.9}],
        surfaces={"f": Flat(10.0), "g": Flat(10.0)},
        design=runs,
    )
    assert [point.verdict for point in result.points] == ["CONFIRMED", "FAILED", "CONFIRMED"]
    failed = result.extremes[0]
    assert "the simulator fails at the predicted optimum (timeout: 60 s)" in failed.sentence
    assert failed.objective.actual is None
    assert not failed.within(1e9)
    whole = Verification((result,), result.simulator_runs)
    assert Verification.from_json(json.loads(json.dumps(whole.to_json(), allow_nan=False))) == whole


def test_what_is_best_known_where_the_optimum_fails_is_the_best_design_run():
    about = problem()
    runs = about.evaluation(np.array([[1.0], [2.0]]), {"f": np.array([12.0, 11.0]), "g": np.zeros(2)})
    result = judge_optimum(
        about, optimum("optimum"), [Flown((), "crashed: 9")], surfaces={"f": Flat(10.0)}, design=runs
    )
    assert result.best_known == BestKnown("design run", {"x": 2.0}, 11.0)
    assert result.best_known.sentence == "best known: 11 at x = 2, a run of the design"


def test_what_is_best_known_is_the_verified_point_or_the_run_that_beats_it():
    assert confirm(10.1).best_known == BestKnown("verified optimum", {"x": 4.0}, 10.1)
    assert confirm(10.1, design=(12.0, 10.05, 15.0)).best_known == BestKnown("design run", {"x": 5.0}, 10.05)


def test_a_miss_within_the_tolerance_is_said_and_the_point_is_not_best_known():
    result = confirm(10.1, design=(9.9, 11.0, 15.0), subject_to=("f <= 10", "x <= 4"))
    assert "'f <= 10' by 0.1 missed, within the tolerance" in result.sentence
    assert result.best_known == BestKnown("design run", {"x": 0.0}, 9.9)


def infeasible(actual):
    """Surfaces that see f >= 10 everywhere, and f <= 9 asked for."""
    about = problem(subject_to=["f <= 9"])
    runs = about.evaluation(np.array([[1.0], [2.0]]), {"f": np.array([12.0, 11.0]), "g": np.zeros(2)})
    found = replace(optimum("least violation", subject_to=("f <= 9",)), missed={"f <= 9": 1.0})
    return judge_optimum(
        about,
        found,
        [{"f": actual, "g": 0.0}],
        surfaces={"f": Flat(10.0)},
        design=runs,
        options=VerifyOptions(tolerance_pct=20.0),
    )


def test_an_optimum_that_violates_a_constraint_as_predicted_is_infeasible():
    result = infeasible(12.0)
    assert result.verdict == "INFEASIBLE"
    assert "no point of the surfaces satisfies every constraint" in result.sentence
    assert "the nearest misses 'f <= 9' by 1; there the true run misses 'f <= 9' by 3" in result.sentence
    assert result.best_known.source == "design run"  # 11 misses 9 by less than 12 does
    assert result.best_known.missed == {"f <= 9": 2.0}
    assert "no run satisfies every constraint; the nearest: 11 at x = 2" in result.best_known.sentence


def test_an_optimum_that_is_feasible_against_the_prediction_improves_on_everything():
    result = infeasible(8.9)
    assert result.verdict == "IMPROVED, MODEL POOR"
    assert "feasible, where the surfaces miss 'f <= 9' by 1" in result.sentence


WISH = {"goal": "maximize", "low": 80.0, "high": 100.0}


def wished(actual, predicted=60.0, design=(50.0, 55.0)):
    """The greatest desirability of f, unacceptable up to 80."""
    text = undesirability({"f": Desire(**WISH)})
    about = problem(text)
    runs = about.evaluation(np.array([[1.0], [2.0]]), {"f": np.array(design), "g": np.zeros(2)})
    best = Candidate(np.array([4.0]), (1.0,), {"f": predicted}, (), "optimum")
    found = Optimum("wish", SPACE, (text,), (), {"desirability": {"f": WISH}}, 1, 9, best)
    return judge_optimum(
        about, found, [{"f": actual, "g": 0.0}], surfaces={"f": Flat(predicted)}, design=runs
    )


def test_a_desirability_that_nothing_reaches_is_not_confirmed():
    result = wished(60.0)
    assert result.verdict == "INFEASIBLE"
    assert (
        "no point of the surfaces reaches any desirability: at the nearest, f is 60, acceptable above 80"
        in result.sentence
    )


def test_a_desirability_that_only_the_surfaces_reach_is_not_confirmed():
    result = wished(70.0, predicted=90.0)
    assert result.verdict == "NOT CONFIRMED"
    assert "the true run reaches no desirability: f is 70, acceptable above 80" in result.sentence


def test_a_desirability_that_a_design_run_reaches_is_not_out_of_reach():
    result = wished(60.0, design=(50.0, 90.0))
    assert result.verdict == "NOT CONFIRMED"
    assert "worse than the best of 2 design runs" in result.sentence
    assert wished(90.0, predicted=90.0).verdict == "CONFIRMED"


def settled(gain, *, feasible=True, objective=10.0, **more):
    return judge_refinement({"x": 4.0}, objective, remaining_gain=gain, feasible=feasible, runs=12, **more)


def test_a_refinement_is_settled_when_no_more_than_the_tolerance_may_be_gained():
    assert settled(0.2).verdict == "SETTLED"
    assert settled(0.21).verdict == "NOT SETTLED"
    assert settled(0.21, spread=20.0).verdict == "SETTLED"
    assert settled(None).verdict == "NOT SETTLED"
    assert settled(0.0, objective=0.0).verdict == "SETTLED"
    assert "10 at x = 4 after 12 more runs" in settled(0.2).sentence
    assert "with 95 % confidence at most 0.2 may still be gained anywhere" in settled(0.2).sentence
    assert "12 more runs, 2 of which failed" in settled(0.2, failed_runs=2).sentence


def test_a_gain_within_the_noise_of_one_run_settles_and_the_sentence_says_so():
    found = settled(0.5, noise_sd=0.5, standard_error=0.1)
    assert found.verdict == "SETTLED"
    assert "10 +- 0.1 (as all runs together tell it) at x = 4" in found.sentence
    assert "at most 0.5 may still be gained anywhere, less than the noise of one run" in found.sentence
    assert settled(0.51, noise_sd=0.5).verdict == "NOT SETTLED"
    assert "noise" not in settled(0.2, noise_sd=0.5).sentence


def test_a_settled_refinement_says_what_its_runs_cannot_have_seen():
    assert "gaps between runs (up to +-25 % of the ranges) apart" in settled(0.2, gap=0.25).sentence


def test_a_refinement_without_a_feasible_run_is_infeasible_whatever_it_gained():
    found = settled(0.0, feasible=False, missed={"f <= 9": 1.0})
    assert found.verdict == "INFEASIBLE"
    assert "no run satisfies every constraint" in found.sentence
    assert "misses 'f <= 9' by 1" in found.sentence


def test_a_refinement_that_reaches_no_desirability_is_infeasible_and_says_what_is_in_the_way():
    found = settled(0.0, desirability=0.0, unacceptable="a is 30, acceptable above 40 (misses by 10)")
    assert found.verdict == "INFEASIBLE"
    assert (
        "no run reaches any desirability; the nearest: overall desirability 0.000 at x = 4" in found.sentence
    )
    assert "where a is 30, acceptable above 40" in found.sentence
    assert "overall desirability 0.800" in settled(0.0, objective=-0.8, desirability=0.8).sentence


def test_a_file_of_an_earlier_version_is_read():
    old = document()
    for record in old["searches"]:
        for key in ("replicates", "best_known", "next_step"):
            del record[key]
        for comparison in (*record["objectives"].values(), *record["responses"].values()):
            for key in ("spread", "scaled_error_pct"):
                comparison.pop(key, None)
    read = Verification.from_json(old)
    assert read.searches[0].verdict == "CONFIRMED"
    assert read.searches[0].best_known is None


@pytest.mark.parametrize(
    ("runs", "words", "others"),
    [
        ((18, 1, 19), "18 for the design + 1 to verify = 19", 0),
        (
            (18, 1, 24),
            "18 for the design + 1 to verify "
            "+ 5 others (failed, excluded, confirming, refining, or of an earlier design) = 24",
            5,
        ),
        ((18, 1, 18), "18 for the design + 1 to verify (1 of them made for the design already) = 18", 0),
        ((18, 0, 18), "18 for the design", 0),
    ],
)
def test_every_run_on_record_is_told_of(runs, words, others):
    spent = SpentRuns(*runs)
    assert spent.words == words
    assert spent.counts() == {"design": 18, "verification": runs[1], "others": others, "total": runs[2]}
