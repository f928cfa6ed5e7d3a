"""Arithmetic with 32 digits, and what it makes of a least-squares estimate; exact values from fractions."""

from fractions import Fraction

import numpy as np
import pytest

from rsmkit.language.space import Space
from rsmkit.surfaces.estimation.coordinates import bounds, conversion, hull
from rsmkit.surfaces.estimation.double_double import DoubleDouble, double_double
from rsmkit.surfaces.polynomial_fit import fit_surface

# One addition or multiplication errs by a few units of 2^-104 at most (Joldes, Muller & Popescu 2017).
ROUNDING = Fraction(10, 2**104)


def random_numbers(seed, count=200):
    rng = np.random.default_rng(seed)
    high = rng.normal(size=count) * 10.0 ** rng.integers(-8, 8, count)
    return DoubleDouble(high, high * rng.uniform(-1, 1, count) * 2.0**-54)


def exact(value):
    return [Fraction(float(h)) + Fraction(float(w)) for h, w in zip(value.high, value.low, strict=True)]


@pytest.mark.parametrize("name", ["__add__", "__sub__", "__mul__"])
def test_operations_are_right_to_32_digits(name):
    a, b = random_numbers(1), random_numbers(2)
    for x, y, found in zip(exact(a), exact(b), exact(getattr(a, name)(b)), strict=True):
        assert abs(found - getattr(x, name)(y)) <= ROUNDING * abs(getattr(x, name)(y))


def test_division_by_doubles():
    a, b = random_numbers(3), random_numbers(4).high
    for x, y, found in zip(exact(a), b.tolist(), exact(a / b), strict=True):
        assert abs(found - x / Fraction(y)) <= ROUNDING * abs(x / Fraction(y))


@pytest.mark.parametrize("count", [1, 2, 7, 200])
def test_totals_are_sums(count):
    a = random_numbers(5, count)
    total = a.total()
    error = Fraction(float(total.high)) + Fraction(float(total.low)) - sum(exact(a))
    assert abs(error) <= 8 * ROUNDING * sum(map(abs, exact(a)))  # eight levels of pairs at most


def test_a_product_with_an_array_on_the_left():
    assert isinstance(np.array([2.0]) * double_double([3.0]), DoubleDouble)


def test_conversion_of_a_cube_far_from_zero():
    """((x - a) / h)^3 written out in powers of (x - b) / g, by the binomial theorem in fractions."""
    space = Space(x=(1990.0, 2023.0))
    terms = fit_surface(space, np.linspace(1990, 2023, 9)[:, None], np.arange(9.0), order=3).terms
    working = hull(space, np.array([[1991.5], [2020.0]]))
    shift = Fraction(bounds(space).center[0] - working.center[0]) / Fraction(working.half_range[0])
    scale = Fraction(bounds(space).half_range[0]) / Fraction(working.half_range[0])
    column = conversion(terms, bounds(space), working)[:, 3]
    for found, right in zip(
        exact(column), [shift**3, 3 * shift**2 * scale, 3 * shift * scale**2, scale**3], strict=True
    ):
        assert abs(found - right) <= 8 * ROUNDING * abs(right)


@pytest.mark.parametrize("factor", [1.0, 1.0 + 1e-6, 0.9])
def test_any_start_ends_at_the_same_bits(factor):
    rng = np.random.default_rng(6)
    space = Space(a=(0.0, 3.0), b=(100.0, 101.0))
    points = space.decode(rng.uniform(-1, 1, (40, 2)))
    surface = fit_surface(
        space, points, np.exp(points[:, 0]) + rng.normal(size=40), weights=rng.uniform(1, 2, 40)
    )
    again = surface.refined(factor * surface.fit.coefficients)
    np.testing.assert_array_equal(again.fit.coefficients, surface.fit.coefficients)
    np.testing.assert_array_equal(again.fit.residuals, surface.fit.residuals)
    np.testing.assert_array_equal(again.coefficients, surface.coefficients)
