"""What a verified point competes with, and how repeated runs are pooled."""

import numpy as np
import pytest
from judged_optima import problem

from rsmkit.verification.pure_error import merged
from rsmkit.verification.rivals import Rivals, spreads


def runs(x, f):
    about = problem()
    return about, about.evaluation(np.array(x)[:, None], {"f": np.array(f), "g": np.zeros(len(f))})


@pytest.mark.parametrize(("value", "is_beaten"), [(10.9, False), (11.1, True)])
def test_a_rival_is_better_only_beyond_the_noise_of_both(value, is_beaten):
    """Half widths of 0.8 and 0.6 are 1.0 of their difference."""
    _, known = runs([1.0], [10.0])
    rivals = Rivals(known, np.array([[0.8]]), np.empty((0, 1)), np.empty((0, 1)))
    assert rivals.beat(np.array([value]), np.array([0.6]), np.array([1.0])) is is_beaten


def test_zero_and_minus_zero_are_one_point():
    about, made = runs([0.0, -0.0, 1.0], [1.0, 3.0, 7.0])
    points, counts, repeated = merged(about, made)
    assert points.points[:, 0].tolist() == [0.0, 1.0]
    assert points.responses["f"].tolist() == [2.0, 7.0]
    assert (counts.tolist(), len(repeated)) == ([2, 1], 1)


def test_where_the_median_is_the_least_all_of_the_range_is_the_spread():
    objectives, each = spreads(*runs([1.0, 2.0, 3.0, 4.0], [5.0, 5.0, 5.0, 7.0]))
    assert objectives.tolist() == [2.0]
    assert each == {"f": 2.0, "g": 0.0}
