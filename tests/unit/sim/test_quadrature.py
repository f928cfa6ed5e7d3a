"""Quadrature that does not depend on the numerical library."""

import math

import numpy as np
import pytest

from sim.core.quadrature import apply, dot, gauss_legendre

# NIST Digital Library of Mathematical Functions, Table 3.5.2: nodes on (-1, 1) and weights of five points
NODES = [-0.906179845938664, -0.538469310105683, 0.0, 0.538469310105683, 0.906179845938664]
WEIGHTS = [0.236926885056189, 0.478628670499366, 0.568888888888889, 0.478628670499366, 0.236926885056189]


def test_five_points_are_the_published_ones():
    nodes, weights = gauss_legendre(5)
    np.testing.assert_allclose(2.0 * nodes - 1.0, NODES, rtol=0, atol=1e-15)  # fifteen digits are printed
    np.testing.assert_allclose(2.0 * weights, WEIGHTS, rtol=0, atol=1e-15)


@pytest.mark.parametrize("points", [1, 2, 3, 8, 24])
def test_lower_powers_are_integrated_exactly(points):
    nodes, weights = gauss_legendre(points)
    assert (np.diff(nodes) > 0).all()
    for power in range(2 * points):
        assert dot(weights, nodes**power) == pytest.approx(1.0 / (power + 1), rel=1e-13)


@pytest.mark.parametrize("points", [1, 2, 3])
def test_the_next_power_is_missed_by_what_theory_says(points):
    nodes, weights = gauss_legendre(points)
    missed = 1.0 / (2 * points + 1) - dot(weights, nodes ** (2 * points))
    f = math.factorial  # Abramowitz & Stegun 25.4.30 on (0, 1); the derivative is (2 points)!
    assert missed == pytest.approx(f(points) ** 4 / ((2 * points + 1) * f(2 * points) ** 2), rel=1e-11)


def test_a_rule_is_kept_and_cannot_be_changed():
    nodes, weights = gauss_legendre(4)
    assert gauss_legendre(4)[0] is nodes
    with pytest.raises(ValueError, match="read-only"):
        weights[0] = 0.0


def test_functions_are_those_of_the_math_module():
    values = np.array([0.1, 1.7, 250.0])
    assert apply(math.log10, values).tolist() == [math.log10(v) for v in values.tolist()]
