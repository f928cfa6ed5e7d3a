"""Points around the body: what each rule integrates exactly, and which rule is taken where."""

import math

import pytest

from sim.aero.around import around, chosen, meridian, room

FRICTION, PRESSURE = around(4, 3, True, 0.05), around(8, 4, True, 0.05)
EVEN = around(8, 4, False, 0.05)


def integral(function, points, a, b, border):
    """Integral over half the circle by the points that belong to inclinations a + b cos(phi)."""
    lit, lee, rule = chosen.py_func(a, b, border, points)
    assert lit + lee <= room(points)
    places = [meridian.py_func(j, lit, rule, border, points) for j in range(lit + lee)]
    return sum(share * function(cosine) for cosine, share in places)


def power(k):
    """Integral of cos^k over (0, pi/2), by the gamma function."""
    return 0.5 * math.sqrt(math.pi) * math.gamma(0.5 * (k + 1)) / math.gamma(0.5 * k + 1.0)


@pytest.mark.parametrize(
    ("points", "ratio", "count"),
    [(FRICTION, 0.05, 2), (FRICTION, 0.2, 3), (FRICTION, 0.8, 4), (PRESSURE, 0.05, 3), (PRESSURE, 0.8, 8)],
)
def test_a_ring_lit_all_around_has_few_points_and_loses_no_polynomial(points, ratio, count):
    assert chosen.py_func(0.5, 0.5 * ratio, math.pi, points) == (count, 0, 1)
    for k in range(2 * count):
        exact = 2.0 * power(k) if k % 2 == 0 else 0.0
        got = integral(lambda c, k=k: c**k, points, 0.5, 0.5 * ratio, math.pi)
        assert got == pytest.approx(exact, abs=1e-14)


@pytest.mark.parametrize(
    ("points", "b", "side"), [(FRICTION, 0.009, 2), (FRICTION, 0.019, 3), (PRESSURE, 0.009, 3)]
)
def test_either_side_of_a_cylinder_keeps_its_polynomials_apart(points, b, side):
    assert chosen.py_func(0.0, b, 0.5 * math.pi, points) == (side, side, 2)
    for k in range(2 * side):
        lit = integral(lambda c, k=k: c**k if c > 0.0 else 0.0, points, 0.0, b, 0.5 * math.pi)
        lee = integral(lambda c, k=k: (-c) ** k if c < 0.0 else 0.0, points, 0.0, b, 0.5 * math.pi)
        assert (lit, lee) == pytest.approx((power(k), power(k)), abs=1e-14)


@pytest.mark.parametrize("border", [0.5 * math.pi, 2.0])
def test_elsewhere_both_rules_are_the_same(border):
    a, b = -math.cos(border) * 0.3, 0.3  # the inclination vanishes at the border
    assert chosen.py_func(a, b, border, PRESSURE) == chosen.py_func(a, b, border, EVEN) == (8, 4, 0)
    assert integral(lambda c: math.exp(c), PRESSURE, a, b, border) == pytest.approx(
        integral(lambda c: math.exp(c), EVEN, a, b, border), rel=1e-15
    )


def test_with_many_points_a_cylinder_keeps_them_at_any_incidence():
    assert chosen.py_func(0.0, 1e-3, 0.5 * math.pi, around(24, 12, True, 0.05)) == (24, 12, 0)
