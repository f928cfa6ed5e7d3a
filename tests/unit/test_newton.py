"""Newton's method on differences, against closed forms."""

import numpy as np
import pytest

from rsmkit.newton import descended, expand, minimum_nearby, slopes_changed


def quartic(p):
    """Two quantities of degree four and two, whose derivatives are written out below."""
    x, y = p.T
    return np.column_stack([x**4 + 3 * x * y - y**3 + 2, x**2 + 5 * y])


def test_differences_of_a_quartic():
    """Slopes and pure curvatures are exact for degree four; mixed ones here too, x*y being of degree two."""
    x, y = 0.7, -0.4
    found = expand(quartic, np.array([x, y]), np.array([1e-2, 2e-2]))
    # roundoff 2e-16 of values up to 3, divided by h and h^2, times the weights of the differences
    np.testing.assert_allclose(found.values, [x**4 + 3 * x * y - y**3 + 2, x**2 + 5 * y], rtol=1e-15)
    np.testing.assert_allclose(found.slopes, [[4 * x**3 + 3 * y, 3 * x - 3 * y**2], [2 * x, 5]], atol=3e-13)
    expected = [[[12 * x * x, 3], [3, -6 * y]], [[2, 0], [0, 0]]]
    np.testing.assert_allclose(found.curvatures, expected, atol=5e-11)


def test_one_coordinate_has_no_pairs():
    found = expand(lambda p: p**2, np.array([3.0]), np.array([0.1]))
    np.testing.assert_allclose(found.slopes, [[6.0]], rtol=1e-13)
    np.testing.assert_allclose(found.curvatures, [[[2.0]]], rtol=1e-11)


def test_minimum_inside():
    """x - ln x is least at 1: to what differences over 1e-3 of fourth order are good for, 1e-12."""

    def logarithm(p):
        return p - np.log(p)

    found = minimum_nearby(logarithm, np.array([1.0001]), 0.5, 2.0, 1e-3)
    assert found is not None
    # h^4 f'''''/30 = 1e-12 * 24 / 30, and rounding 2e-16 / 1e-3
    assert found.point == pytest.approx([1.0], abs=2e-12)
    assert found.free.all()
    assert not len(found.active)


def test_minimum_on_a_constraint():
    """Lagrange: x^2 + y^2 on x + 2 y = 5 is least at (1, 2)."""

    def disc(p):
        return np.column_stack([(p**2).sum(axis=1), p @ [1.0, 2.0] - 5.0])

    found = minimum_nearby(disc, np.array([1.001, 2.0 - 0.0005]), -10.0, 10.0, 1e-2)
    assert found is not None
    np.testing.assert_allclose(found.point, [1.0, 2.0], atol=1e-12)
    assert found.active.tolist() == [0]
    np.testing.assert_allclose(found.slopes, [[1.0, 2.0]], rtol=1e-12)


def test_a_step_that_leaves_a_curved_constraint_keeps_to_it():
    """Outside the unit circle, nearest to (0.1, 0.1), from a degree away: the tangent ends 1.5e-4 outside."""

    def outside(p):
        return np.column_stack([((p - 0.1) ** 2).sum(axis=1), (p**2).sum(axis=1) - 1.0])

    angle = np.deg2rad(46.0)
    found = minimum_nearby(outside, np.array([np.cos(angle), np.sin(angle)]), -2.0, 2.0, 1e-3)
    assert found is not None
    np.testing.assert_allclose(found.point, np.sqrt([0.5, 0.5]), atol=1e-12)
    assert found.active.tolist() == [0]


def test_of_constraints_that_are_the_same_the_first_holds_back():
    def disc(p):
        line = p @ [1.0, 2.0] - 5.0
        return np.column_stack([(p**2).sum(axis=1), 0.5 * line, line, 3.0 * line])

    found = minimum_nearby(disc, np.array([1.001, 2.0 - 0.0005]), -10.0, 10.0, 1e-2)
    assert found is not None
    np.testing.assert_allclose(found.point, [1.0, 2.0], atol=1e-12)
    assert found.active.tolist() == [0]


def test_a_constraint_that_does_not_hold_back_is_not_active():
    def touching(p):
        return np.column_stack([(p**2).sum(axis=1), p[:, 0] - p[:, 1]])

    found = minimum_nearby(touching, np.array([1e-5, 0.0]), -1.0, 1.0, 1e-2)
    assert found is not None
    np.testing.assert_allclose(found.point, 0.0, atol=1e-13)


def test_a_bound_is_kept():
    found = minimum_nearby(
        lambda p: ((p - [-1.0, 0.3]) ** 2).sum(axis=1)[:, None], np.array([0.0, 0.301]), 0, 1, 1e-3
    )
    assert found is not None
    assert found.point[0] == 0.0
    assert found.point[1] == pytest.approx(0.3, abs=1e-12)
    assert found.free.tolist() == [False, True]


def test_all_on_bounds():
    found = minimum_nearby(lambda p: p[:, :1], np.array([0.0, 1.0]), 0.0, 1.0, 1e-3)
    assert found is not None
    assert found.point.tolist() == [0.0, 1.0]


def test_where_nothing_is_curved_the_start_decides():
    def trough(p):
        return ((p[:, 0] - 0.4) ** 2)[:, None]

    found = minimum_nearby(trough, np.array([0.4001, 0.7]), 0.0, 1.0, 1e-3)
    assert found is not None
    np.testing.assert_allclose(found.point, [0.4, 0.7], atol=1e-12)


@pytest.mark.parametrize(
    "function",
    [
        lambda p: p[:, 0] * p[:, 1],
        lambda p: p[:, 0] + (p[:, 1] - 0.5) ** 2,
        lambda p: np.full(len(p), np.nan),
    ],
    ids=["saddle", "slope", "not a number"],
)
def test_no_minimum_nearby(function):
    assert minimum_nearby(lambda p: function(p)[:, None], np.array([0.5, 0.5]), 0.0, 1.0, 1e-3) is None


BOX = np.array([-2.0, -2.0]), np.array([2.0, 2.0])


def rosenbrock(p):
    """Value and slopes; least at (1, 1)."""
    x, y = p
    rest = y - x**2
    return 100 * rest**2 + (1 - x) ** 2, np.array([-400 * x * rest - 2 * (1 - x), 200 * rest])


def bend_of_rosenbrock(x, y):
    return np.array([[1200 * x**2 - 400 * y + 2, -400 * x], [-400 * x, 200.0]])


def test_curvatures_from_slopes():
    """Central differences err by a sixth of 2400, the slope's third derivative, times the step squared."""
    found = slopes_changed(rosenbrock, np.array([0.7, 0.4]), *BOX, 1e-3)
    np.testing.assert_allclose(found, bend_of_rosenbrock(0.7, 0.4), atol=400 * 1e-6 + 1e-9)
    np.testing.assert_array_equal(found, found.T)


def test_curvatures_at_a_bound_look_inwards():
    """One-sided, they err by half the third derivative, 2400 x, times the step."""
    asked = []

    def watched(p):
        asked.append(p)
        return rosenbrock(p)

    found = slopes_changed(watched, np.array([2.0, -2.0]), *BOX, 1e-3)
    np.testing.assert_allclose(found, bend_of_rosenbrock(2.0, -2.0), atol=1200 * 2.0 * 1e-3 * 1.001)
    assert (np.abs(asked) <= 2.0).all()


def test_a_descent_learns_curvatures_on_the_way():
    """Those of its start are wrong by up to a third at its end; steps of a gradient would need hundreds."""
    calls = []

    def counted(p):
        calls.append(p)
        return rosenbrock(p)

    found = descended(counted, np.array([1.15, 1.3]), bend_of_rosenbrock(1.15, 1.3), *BOX, 1e-9)
    np.testing.assert_allclose(found, [1.0, 1.0], atol=1e-8)
    assert len(calls) <= 30


def test_a_descent_keeps_to_its_bounds():
    """With y up to 0.8 the least is where ``100 (0.8 - x^2)^2 + (1 - x)^2`` is."""
    high = np.array([2.0, 0.8])
    found = descended(rosenbrock, np.array([0.9, 0.8]), bend_of_rosenbrock(0.9, 0.8), BOX[0], high, 1e-10)
    roots = np.roots([400.0, 0.0, 2.0 - 320.0, -2.0])
    assert found[1] == 0.8
    assert found[0] == pytest.approx(roots.real.max(), abs=1e-8)


def test_a_descent_held_in_a_corner_is_at_its_end():
    found = descended(lambda p: (p.sum(), np.ones(2)), np.array([-2.0, -2.0]), np.eye(2), *BOX, 1e-9)
    np.testing.assert_array_equal(found, [-2.0, -2.0])


@pytest.mark.parametrize(
    ("function", "bend"),
    [
        (lambda p: (-p @ p, -2 * p), -2 * np.eye(2)),
        (lambda p: (np.nan, np.full(2, np.nan)), np.eye(2)),
        (lambda p: (p @ p, -2 * p), np.eye(2)),
    ],
    ids=["bends down", "no number", "slopes that lead upwards"],
)
def test_no_descent(function, bend):
    assert descended(function, np.array([0.5, 0.4]), bend, *BOX, 1e-9) is None
