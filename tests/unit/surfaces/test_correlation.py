"""Correlations against sums written out, and their derivatives against differences."""

from itertools import combinations

import numpy as np
import pytest
from scipy.stats import qmc

from rsmkit.surfaces.estimation.processes.correlation import Radial, Separable, squared_differences

POINTS = qmc.Sobol(4, rng=1).random(16) * [1.0, 2.0, 1.0, 3.0]
POINTS[:, 3] = np.floor(POINTS[:, 3])
FRESH = qmc.Sobol(4, rng=2).random(4)
FRESH[:, 3] = [0.0, 1.0, 2.0, 1.0]
CATEGORICAL = np.array([False, False, False, True])
LENGTHS = np.array([0.4, 1.5, 0.8, 0.9])
LAWS = {
    "rbf": lambda r: np.exp(-0.5 * r**2),
    "matern52": lambda r: (1 + np.sqrt(5) * r + 5 * r**2 / 3) * np.exp(-np.sqrt(5) * r),
}
PARTS = [(), (0.7,), (0.7, -0.4)]


def written_out(kernel, parts, a, b):
    """Mixture of the product, the mean over columns and the mean over pairs of columns."""
    apart = [
        abs(x - y) if not unordered else float(x != y)
        for x, y, unordered in zip(a, b, CATEGORICAL, strict=True)
    ]
    z = [LAWS[kernel](d / length) for d, length in zip(apart, LENGTHS, strict=True)]
    forms = [np.prod(z), np.mean(z), np.mean([z[i] * z[j] for i, j in combinations(range(4), 2)])]
    shares = np.exp([0.0, *parts])
    return shares @ forms[: len(shares)] / shares.sum()


@pytest.mark.parametrize("kernel", LAWS)
@pytest.mark.parametrize("parts", PARTS)
def test_mixture_of_product_columns_and_pairs(kernel, parts):
    law = Separable(kernel, LENGTHS, CATEGORICAL, np.array(parts))
    expected = [[written_out(kernel, parts, a, b) for b in POINTS] for a in FRESH]
    np.testing.assert_allclose(law.between(FRESH, POINTS), expected, rtol=1e-13)
    among = [[written_out(kernel, parts, a, b) for b in POINTS] for a in POINTS]
    np.testing.assert_allclose(law.among(POINTS).values, among, rtol=1e-13)


@pytest.mark.parametrize("kernel", LAWS)
def test_radial_is_the_law_of_the_euclidean_distance(kernel):
    law = Radial(kernel, LENGTHS)
    expected = LAWS[kernel](np.linalg.norm((FRESH[:, None] - POINTS) / LENGTHS, axis=2))
    np.testing.assert_allclose(law.between(FRESH, POINTS), expected, rtol=1e-12)


def by_differences(function, x, step=1e-6):
    return np.array([(function(x + e) - function(x - e)) / (2 * step) for e in step * np.eye(len(x))])


@pytest.mark.parametrize("kernel", LAWS)
@pytest.mark.parametrize("parts", [None, *PARTS])
def test_derivatives(kernel, parts):
    rng = np.random.default_rng(0)
    pull = rng.normal(size=(16, 16))
    pull += pull.T
    differences = squared_differences(POINTS, CATEGORICAL)

    def law(theta):
        if parts is None:
            return Radial(kernel, np.exp(theta))
        return Separable(kernel, np.exp(theta[:4]), CATEGORICAL, theta[4:], differences)

    theta = np.r_[np.log(LENGTHS), parts or ()]
    slopes = by_differences(lambda t: (pull * law(t).among(POINTS).values).sum(), theta)
    np.testing.assert_allclose(law(theta).among(POINTS).slopes(pull), slopes, rtol=1e-5, atol=1e-6)
    weights = rng.normal(size=16)
    moves = by_differences(lambda x: (law(theta).between(x[None], POINTS) @ weights)[0], FRESH[0])
    found = law(theta).gradient(FRESH[:1], POINTS, weights)[0]
    free = slice(None) if parts is None else ~CATEGORICAL
    np.testing.assert_allclose(found[free], moves[free], rtol=1e-5, atol=1e-7)
    if parts is not None:
        assert found[3] == 0.0
