"""Exact moments and indices of polynomials."""

import numpy as np
import pytest

import rsmkit as rk
from rsmkit.language.joint_law import JointLaw, box_law
from rsmkit.language.laws import Levels, Lognormal, Normal, Sample, Triangular, Truncated, Uniform
from rsmkit.language.terms import full_terms
from rsmkit.surfaces.estimation.coordinates import bounds
from rsmkit.surfaces.estimation.stretch import Stretch
from rsmkit.variation.sensitivity.expansion import expand


def normal_law(space, centre, sd):
    return JointLaw(
        space, np.array(centre), {n: Normal(c, sd) for n, c in zip(space.names, centre, strict=True)}
    )


def test_quadratic_in_normal_factors():
    # y = b0 + b.x + x'Bx about the mean: mean b0 + s^2 tr B, variance s^2 b.b + 2 s^4 tr(B B)
    k, sd = 20, 0.3
    space, rng = rk.Space(**{f"x{i}": (-1.0, 1.0) for i in range(k)}), np.random.default_rng(1)
    terms, centre = full_terms(space, 2), np.full(k, 0.2)
    beta = rng.standard_normal(terms.p)
    found = expand(terms, bounds(space), beta, normal_law(space, centre, sd))
    slope = terms.slopes(centre[None], beta)[0]
    half = 0.5 * terms.hessian(centre, beta)
    mean = terms.evaluate(centre[None], beta)[0] + sd**2 * np.trace(half)
    variance = sd**2 * slope @ slope + 2.0 * sd**4 * np.trace(half @ half)
    # a factor alone: s^2 b_i^2 + 2 s^4 B_ii^2; with others: 4 s^4 B_ij^2 each
    first = sd**2 * slope**2 + 2.0 * sd**4 * np.diag(half) ** 2
    off = 4.0 * sd**4 * (half**2 - np.diag(np.diag(half) ** 2))
    assert found.mean[0] == pytest.approx(mean, abs=1e-10)
    assert found.variance[0] == pytest.approx(variance, rel=1e-10)
    assert found.first[:, 0] == pytest.approx(first, rel=1e-10)
    assert found.total[:, 0] == pytest.approx(first + off.sum(axis=1), rel=1e-10)
    assert found.pairs[3, 7][0] == pytest.approx(off[3, 7], rel=1e-10)
    # half the derivative of the variance by the relative width of law i
    assert found.stretching[:, 0] == pytest.approx(
        sd**2 * slope**2 + 4.0 * sd**4 * np.diag(half) ** 2 + off.sum(axis=1), rel=1e-10
    )


def test_product_of_different_laws():
    # y = a b^2: mean E a E b^2, variance E a^2 E b^4 - mean^2
    space = rk.Space(a=(-10.0, 10.0), b=(-10.0, 10.0))
    terms = full_terms(space, 3)
    beta = np.zeros(terms.p)
    beta[terms.exponents.index((1, 2))] = 1.0
    laws = {
        Uniform(1.0, 4.0): lambda n: (4.0 ** (n + 1) - 1.0) / (3.0 * (n + 1)),
        # of the triangle 0, 1, 3: 2 / ((n+1)(n+2)) (3^(n+1) - 1) / 2
        Triangular(0.0, 1.0, 3.0): lambda n: (3.0 ** (n + 1) - 1.0) / ((n + 1) * (n + 2)),
        Lognormal(2.0, 1.5): lambda n: 2.0**n * (1.0 + 0.5625) ** (n * (n - 1) / 2),
    }
    for one, moment in laws.items():
        for other, of_other in laws.items():
            found = expand(
                terms,
                bounds(space),
                beta * 1000.0,  # a coded unit is ten natural ones
                JointLaw(space, np.zeros(2), {"a": one, "b": other}),
            )
            mean = moment(1) * of_other(2)
            assert found.mean[0] == pytest.approx(mean, rel=1e-10)
            assert found.variance[0] == pytest.approx(moment(2) * of_other(4) - mean**2, rel=1e-10)
            alone = (moment(2) - moment(1) ** 2) * of_other(2) ** 2
            assert found.first[0, 0] == pytest.approx(alone, rel=1e-9)


def test_categories_samples_and_factors_that_stay():
    space = rk.Space(a=(-1.0, 1.0), tool=["x", "y", "z"], b=(-1.0, 1.0), c=(0.0, 2.0))
    terms, rng = full_terms(space, 2), np.random.default_rng(2)
    beta = rng.standard_normal(terms.p)
    values = np.array([-0.5, 0.1, 0.2, 0.9])
    laws = {"a": Sample(values), "tool": Levels(space["tool"].domain), "b": Uniform(-1.0, 0.5)}
    found = expand(terms, bounds(space), beta, JointLaw(space, np.array([0.0, 0.0, 0.0, 1.7]), laws))
    x, weight = np.polynomial.legendre.leggauss(8)
    grid = np.array([[v, t, 0.75 * z - 0.25, 1.7] for v in values for t in range(3) for z in x])
    weights = np.tile(weight / 2.0, 12) / 12.0
    y = terms.evaluate(bounds(space).forward(grid), beta)
    mean = weights @ y
    assert found.mean[0] == pytest.approx(mean, abs=1e-12)
    assert found.variance[0] == pytest.approx(weights @ (y - mean) ** 2, rel=1e-12)
    by_tool = np.array([weights[grid[:, 1] == t] @ y[grid[:, 1] == t] * 3.0 for t in range(3)])
    assert found.first[1, 0] == pytest.approx(by_tool.var(), rel=1e-11)


def test_stretched_factors_by_quadrature():
    space = rk.Space(a=(0.0, 1.0), b=(0.0, 1.0))
    terms = full_terms(space, 2)
    beta = np.arange(1.0, 7.0)
    stretches = (Stretch("exp", (2.0,), 0.0, 1.0), Stretch("identity", (), 0.0, 1.0))
    coordinates = bounds(space)
    coordinates = type(coordinates)(coordinates.low, coordinates.high, stretches)
    # the law reaches beyond the runs, where a stretch goes on straight
    laws = {"a": Normal(0.95, 0.1), "b": Truncated(0.5, 0.2, 0.2, 0.6)}
    found = expand(terms, coordinates, beta, JointLaw(space, np.zeros(2), laws))
    z, (x, weight) = np.linspace(-8.0, 8.0, 1601), np.polynomial.legendre.leggauss(40)
    by_a, by_b = np.exp(-0.5 * z**2), weight * np.exp(-0.5 * (x - 0.5) ** 2)  # b = 0.4 + 0.2 x
    weights = np.outer(by_a / by_a.sum(), by_b / by_b.sum()).ravel()
    grid = np.array(np.meshgrid(0.95 + 0.1 * z, 0.4 + 0.2 * x, indexing="ij")).reshape(2, -1).T
    y = terms.evaluate(coordinates.forward(grid), beta)
    mean = weights @ y
    # the even steps meet the end of the runs, where the second derivative jumps, with an error of order h^2:
    # h = 0.01, and a jump of the order of the values
    assert found.mean[0] == pytest.approx(mean, rel=1e-5)
    assert found.variance[0] == pytest.approx(weights @ (y - mean) ** 2, rel=1e-4)


def test_the_box_of_a_line_has_the_variance_of_a_uniform_law():
    space = rk.Space(a=(0.0, 1.0), b=(2.0, 6.0))
    terms = full_terms(space, 1)
    found = expand(terms, bounds(space), np.array([5.0, 2.0, 3.0]), box_law(space))
    assert found.mean[0] == pytest.approx(5.0)
    assert found.total[:, 0] == pytest.approx([4.0 / 3.0, 3.0])
