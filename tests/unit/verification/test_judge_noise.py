"""Verdicts where a run made again gives another value."""

import math

import numpy as np
import pytest
from judged_optima import SPACE, Flat, confirm, optimum

from rsmkit.optimum.problem import build_problem
from rsmkit.verification.flown import Flown
from rsmkit.verification.judge import judge_optimum
from rsmkit.verification.options import RefineOptions, VerifyOptions


def noisy_runs(about, rows):
    """Runs given as (x, f): repeated x are repeated points."""
    x, f = np.array(rows, float).T
    return about.evaluation(x[:, None], {"f": f, "g": np.zeros(len(f))})


class Line:
    """The surface f = 10 + slope (x - 4), whose mean is known within +- `half_width`."""

    def __init__(self, slope=0.0, half_width=0.0):
        self.slope, self.half_width = slope, half_width

    def predict(self, X, *, interval, kind="prediction"):
        mean = 10.0 + self.slope * np.abs(np.asarray(X)[:, 0] - 4.0)
        return mean, mean - self.half_width, mean + self.half_width


def judge_noisy(actual, rows, *, slope=0.5, half_width=0.0, noise_sd=0.0, subject_to=()):
    """A search on the surface f = 10 + slope |x - 4|, verified at x = 4, where it promises 10."""
    surface = Line(slope, half_width)

    def evaluate(points):
        mean, _, _ = surface.predict(points, interval=0.95)
        return {"f": mean, "g": np.zeros(len(points))}

    about = build_problem(SPACE, "f", evaluate, responses=["f", "g"], subject_to=subject_to)
    return judge_optimum(
        about,
        optimum("optimum"),
        [Flown(tuple({"f": value, "g": 0.0} for value in actual))],
        surfaces={"f": surface, "g": Flat(0.0)},
        design=noisy_runs(about, rows),
        options=VerifyOptions(refine=RefineOptions(noise_sd=noise_sd)),
    )


CENTRE = [(5.0, 10.2), (5.0, 10.8), (5.0, 10.4), (5.0, 10.6)]
"""Four runs of one point: mean 10.5, standard deviation sqrt(0.2 / 3) = 0.258 with 3 degrees of freedom."""


def test_the_error_bar_of_a_mean_pools_repeated_runs_of_design_and_optimum():
    result = judge_noisy([10.1, 10.3, 9.9, 10.1], [*CENTRE, (1.0, 11.5), (9.0, 12.5)])
    # squares 0.2 and 0.08 on 3 + 3 degrees of freedom; t(0.975, 6) = 2.446912 (tables)
    half = 2.446912 * math.sqrt(0.28 / 6) / math.sqrt(4)
    assert result.objective.actual == pytest.approx(10.1)
    assert result.objective.margin_of_error == pytest.approx(half, rel=1e-6)
    assert result.replicates == 4
    assert f"+- {half:.2g} (mean of 4 runs)" in result.sentence


def test_the_luckiest_of_many_noisy_runs_is_no_rival_but_its_smoothed_value_is():
    lucky = [*CENTRE, (3.0, 10.05), (1.0, 11.5), (9.0, 12.5)]  # the surface says 10.5 at x = 3
    result = judge_noisy([10.1, 10.3, 9.9, 10.1], lucky)
    assert result.verdict == "CONFIRMED"
    assert result.best_design == pytest.approx(10.5)
    without_noise = confirm(10.1, design=(12.0, 10.05, 15.0))
    assert without_noise.verdict == "NOT CONFIRMED"


def test_a_design_run_far_below_the_noise_counts_even_where_the_surface_smooths_it_away():
    result = judge_noisy([10.1, 10.3, 9.9, 10.1], [*CENTRE, (3.0, 7.0), (1.0, 11.5), (9.0, 12.5)])
    assert result.verdict == "NOT CONFIRMED"
    assert "worse than the best of 7 design runs" in result.sentence


@pytest.mark.parametrize(("lucky", "verdict"), [(9.4, "CONFIRMED"), (9.2, "NOT CONFIRMED")])
def test_the_least_of_four_runs_must_lie_below_the_noise_of_four(lucky, verdict):
    """By the tables t(0.975, 6) = 2.447 and t(1 - 0.025 / 4, 6) = 3.521; s = sqrt(0.28 / 6) = 0.216.

    So a lone run is known within 0.761 among four points (alone within 0.529), the mean of four within 0.264,
    and their difference within 0.805 (0.591).
    """
    result = judge_noisy([10.1, 10.3, 9.9, 10.1], [*CENTRE, (3.0, lucky), (1.0, 11.5), (9.0, 12.5)])
    assert result.verdict == verdict


def test_as_good_as_the_best_takes_the_noise_of_both():
    """The surface knows its value at x = 5 within 0.4, the runs their mean within 0.264: 0.479 together."""
    for actual, words in ((10.1, "as good as the best"), (9.9, "better than the best")):
        runs = [actual, actual + 0.2, actual - 0.2, actual]
        result = judge_noisy(runs, [*CENTRE, (1.0, 11.5), (9.0, 12.5)], half_width=0.4)
        assert words in result.sentence


def test_three_degrees_of_freedom_are_believed_more_than_a_stated_deviation():
    result = judge_noisy([10.1], [*CENTRE, (1.0, 11.5), (9.0, 12.5)], noise_sd=5.0)
    half = 3.182446 * math.sqrt(0.2 / 3)  # t(0.975, 3), tables
    assert result.objective.margin_of_error == pytest.approx(half, rel=1e-6)
    fewer = judge_noisy([10.1], [*CENTRE[:3], (1.0, 11.5), (9.0, 12.5)], noise_sd=5.0)
    assert fewer.objective.margin_of_error == pytest.approx(1.959964 * 5.0, rel=1e-6)


def test_a_miss_that_is_noise_is_within_the_tolerance_and_said_to_be_noise():
    spread = [(5.0, 9.5), (5.0, 11.5), (5.0, 10.0), (5.0, 11.0), (1.0, 11.5)]
    result = judge_noisy([10.9, 9.9, 11.2, 9.6], spread)
    assert result.objective.scaled_error_pct > 2.0
    assert result.verdict == "CONFIRMED"
    assert "within the noise" in result.sentence


def test_stated_noise_counts_where_no_run_is_repeated():
    rows = [(1.0, 11.5), (5.0, 10.5), (9.0, 12.5), (3.0, 9.9)]
    result = judge_noisy([10.3], rows, noise_sd=0.3)
    assert result.objective.margin_of_error == pytest.approx(1.959964 * 0.3, rel=1e-6)  # normal quantile
    assert result.verdict == "CONFIRMED"
    assert judge_noisy([10.3], rows).verdict == "NOT CONFIRMED"  # without noise 9.9 at x = 3 is better


def test_noise_of_a_constraint_is_forgiven_as_well():
    rows = [*CENTRE, (1.0, 11.5), (9.0, 12.5)]
    far = judge_noisy([10.1, 10.3, 9.9, 10.1], rows, subject_to=("f - 9.5 <= 0",))
    near = judge_noisy([10.1, 10.3, 9.9, 10.1], rows, subject_to=("f - 10 <= 0.0",))
    assert far.verdict == "NOT CONFIRMED"
    assert "violates 'f - 9.5 <= 0' by 0.6" in far.sentence
    assert near.verdict == "CONFIRMED"
