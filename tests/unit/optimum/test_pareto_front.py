import numpy as np
import pytest

from rsmkit.optimum.pareto_front import extremes, hypervolume, igd_plus, knee, nondominated, spread_rows

FRONT = np.array([[0.0, 1.0], [0.2, 0.3], [0.6, 0.25], [1.0, 0.0]])


def test_dominated_and_repeated_rows_are_dropped():
    rows = np.array([[2.0, 2.0], [1.0, 3.0], [2.0, 2.5], [3.0, 1.0], [1.0, 3.0]])
    assert nondominated(rows).tolist() == [0, 1, 3]


def test_knee_is_farthest_below_the_line_through_the_ends():
    assert knee(FRONT) == 1


def test_extremes_break_ties_by_the_other_objectives():
    front = np.array([[0.0, 1.0, 5.0], [0.0, 2.0, 0.0], [3.0, 0.0, 9.0]])
    assert extremes(front) == (1, 2, 1)


def test_hypervolume_of_two_corners():
    # Two boxes of 0.1 x 1.1 that overlap in 0.1 x 0.1.
    corners = np.array([[0.0, 1.0], [1.0, 0.0]])
    assert hypervolume(corners, np.zeros(2), np.ones(2)) == pytest.approx(0.21, rel=1e-12)


def test_hypervolume_is_free_of_units():
    scaled = FRONT * [1e12, 1e-3] + [5.0, 7.0]
    ideal, nadir = scaled.min(axis=0), scaled.max(axis=0)
    assert hypervolume(scaled, ideal, nadir) == pytest.approx(hypervolume(FRONT, np.zeros(2), np.ones(2)))


def test_hypervolume_of_points_beyond_the_reference_is_zero():
    assert hypervolume(np.array([[1.2, 0.0]]), np.zeros(2), np.ones(2)) == 0.0


def test_igd_plus_counts_only_what_is_worse():
    reference = np.array([[0.0, 1.0], [1.0, 0.0]])
    assert igd_plus(np.array([[0.5, 0.5]]), reference) == pytest.approx(0.5)
    assert igd_plus(np.array([[-1.0, -1.0]]), reference) == 0.0


def test_spread_rows_are_the_ends_and_then_the_farthest():
    angles = np.radians([0.0, 2.0, 4.0, 45.0, 47.0, 90.0])
    front = np.column_stack([1 - np.sin(angles), 1 - np.cos(angles)]) * [1.0, 1e6]
    assert sorted(spread_rows(front, 3)) == [0, 3, 5]  # 45 deg is farther from its nearer end than 47 deg
    assert set(spread_rows(front, 2)) == {0, 5}
    assert sorted(spread_rows(front, 6)) == list(range(6))
