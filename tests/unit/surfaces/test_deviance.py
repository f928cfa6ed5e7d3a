"""The compiled likelihood of a process against the one in matrices."""

import math

import numpy as np
import pytest

from rsmkit.surfaces.estimation.processes.correlation import Separable, squared_differences
from rsmkit.surfaces.estimation.processes.deviance import Deviance
from rsmkit.surfaces.estimation.processes.kriging import Kriging


def _runs(n, m, seed):
    rng = np.random.default_rng(seed)
    points = rng.random((n, m))
    categorical = np.zeros(m, bool)
    if m > 2:
        points[:, -1] = rng.integers(0, 3, n)
        categorical[-1] = True
    return rng, points, categorical, np.sin(5.0 * points[:, 0]) + points[:, -1] ** 2


@pytest.mark.parametrize("kernel", ["rbf", "matern52"])
@pytest.mark.parametrize(
    ("n", "m", "parts"), [(5, 1, 0), (12, 2, 0), (12, 2, 1), (30, 3, 2), (30, 5, 0), (40, 6, 2)]
)
def test_it_is_that_of_the_matrices(kernel, n, m, parts):
    rng, points, categorical, y = _runs(n, m, seed=n + m)
    lengths, logits, nugget = np.exp(rng.normal(-0.7, 0.5, m)), rng.normal(size=parts), 1e-4
    apart = squared_differences(points, categorical)
    wanted = Kriging(Separable(kernel, lengths, categorical, logits, apart), points, y, nugget)
    value, slopes = Deviance(kernel, apart, y, parts)(lengths, logits, nugget)
    # both round sums of n covariances, magnified by the condition of the matrix, at most n / nugget
    roundoff = n * np.finfo(float).eps * n / nugget
    assert value == pytest.approx(wanted.deviance, rel=roundoff)
    expected = wanted.deviance_slopes[:-1]
    assert slopes == pytest.approx(expected, rel=0, abs=roundoff * np.abs(expected).max())


def test_it_is_infinite_where_there_is_none():
    points = np.array([[0.1], [0.1], [0.7]])
    apart = squared_differences(points, np.zeros(1, bool))
    deviance = Deviance("rbf", apart, np.array([1.0, 2.0, 3.0]), 0)
    assert deviance(np.ones(1), np.zeros(0), 0.0)[0] == math.inf  # the same point twice, without noise
    assert math.isfinite(deviance(np.ones(1), np.zeros(0), 0.1)[0])
