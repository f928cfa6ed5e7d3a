"""Sobol indices against closed forms and another program."""

import numpy as np
import pytest

import rsmkit as rk
from rsmkit.language.joint_law import JointLaw, box_law
from rsmkit.language.laws import Normal
from rsmkit.variation.sensitivity.sampled_indices import sample_indices, sobol_estimates


def ishigami(x):
    a, b, c = x.T
    return np.sin(a) + 7.0 * np.sin(b) ** 2 + 0.1 * c**4 * np.sin(a)


PI = np.pi
CUBE = rk.Space(a=(-PI, PI), b=(-PI, PI), c=(-PI, PI))
# Saltelli et al., Global Sensitivity Analysis: The Primer (2008), section 4.6, with a = 7, b = 0.1
SHARES = 0.5 * (1 + 0.1 * PI**4 / 5) ** 2, 49 / 8, 0.1**2 * PI**8 * (1 / 18 - 1 / 50)
VARIANCE = sum(SHARES)


def test_ishigami():
    found = sample_indices(ishigami, box_law(CUBE), 4096, 1, pairs=True)
    first = np.array([SHARES[0], SHARES[1], 0.0])
    total = np.array([SHARES[0] + SHARES[2], SHARES[1], SHARES[2]])
    assert (first / VARIANCE).round(4).tolist() == [0.3139, 0.4424, 0.0]
    assert (total / VARIANCE).round(4).tolist() == [0.5576, 0.4424, 0.2437]
    for key, truth in (("variance", VARIANCE), ("first", first), ("total", total)):
        # 3 standard errors, from eight sequences: 4.5 by Student's t with 7 degrees of freedom
        assert (np.abs(found.mean_of(key) - truth) <= 4.5 * found.error_of(key)).all(), key
        assert (found.error_of(key) <= 0.03 * VARIANCE).all()
    assert found.mean_of("pairs")[0, 2] == pytest.approx(SHARES[2], abs=4.5 * found.error_of("pairs")[0, 2])


def test_g_function():
    # Sobol's g: V_i = 1 / (3 (1 + a_i)^2), V = prod(1 + V_i) - 1, total_i = V_i prod of the others (1 + V_j)
    a = np.array([0.0, 1.0, 4.5, 9.0])
    space = rk.Space(**{f"x{i}": (0.0, 1.0) for i in range(4)})
    alone = 1.0 / (3.0 * (1.0 + a) ** 2)
    variance = np.prod(1.0 + alone) - 1.0
    total = alone * np.prod(1.0 + alone) / (1.0 + alone)
    found = sample_indices(
        lambda x: np.prod((np.abs(4.0 * x - 2.0) + a) / (1.0 + a), axis=1), box_law(space), 4096, 2
    )
    assert (np.abs(found.mean_of("variance") - variance) <= 4.5 * found.error_of("variance")).all()
    assert (np.abs(found.mean_of("first") - alone) <= 4.5 * found.error_of("first")).all()
    assert (np.abs(found.mean_of("total") - total) <= 4.5 * found.error_of("total")).all()


def test_the_same_sample_gives_what_salib_gives():
    # SALib 1.6.0, sobol.analyze(..., calc_second_order=True) of these values of the Ishigami function
    steps = np.arange(1, 33)[:, None] * np.sqrt([2.0, 3.0, 5.0, 7.0, 11.0, 13.0]) % 1.0
    a, b = 2.0 * PI * steps[:, :3] - PI, 2.0 * PI * steps[:, 3:] - PI

    def mixed(base, other, j):
        points = base.copy()
        points[:, j] = other[:, j]
        return ishigami(points)

    found = sobol_estimates(
        ishigami(a),
        ishigami(b),
        np.array([mixed(a, b, j) for j in range(3)]),
        np.array([mixed(b, a, j) for j in range(3)]),
    )
    first = [0.20750155543910548, 0.5856317596625376, -0.2164772431301961]
    total = [0.11168146870611086, 0.3972606179088136, 0.17293903361087035]
    # sums of 32 products of numbers up to 15 variances: 1e-12 is 100 times their rounding
    assert found.first / found.variance == pytest.approx(first, abs=1e-12)
    assert found.total / found.variance == pytest.approx(total, abs=1e-12)
    assert found.pairs[0, 1] / found.variance == pytest.approx(-0.29936152011984724, abs=1e-12)
    assert found.pairs[1, 2] / found.variance == pytest.approx(-0.2617120431780138, abs=1e-12)


def test_correlated_normal_factors():
    # of a sum of normal factors with covariance S: first_i = (S 1)_i^2 / S_ii, total_i = 1 / (S^-1)_ii
    space = rk.Space(a=(-9, 9), b=(-9, 9), c=(-9, 9))
    matrix = np.array([[1.0, 0.5, 0.8], [0.5, 1.0, 0.0], [0.8, 0.0, 1.0]])
    sds = np.array([1.0, 1.0, 2.0])
    laws = {name: Normal(0.0, sd) for name, sd in zip("abc", sds, strict=True)}
    found = sample_indices(lambda x: x.sum(axis=1), JointLaw(space, np.zeros(3), laws, matrix), 2048, 3)
    covariance = matrix * np.outer(sds, sds)
    first = covariance.sum(axis=1) ** 2 / np.diag(covariance)
    total = 1.0 / np.diag(np.linalg.inv(covariance))
    assert (np.abs(found.mean_of("first") - first) <= 4.5 * found.error_of("first")).all()
    assert (np.abs(found.mean_of("total") - total) <= 4.5 * found.error_of("total")).all()
