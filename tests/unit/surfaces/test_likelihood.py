"""Maximum likelihood of a Gaussian process, against scikit-learn's and against guesses."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, Matern, WhiteKernel

from rsmkit.surfaces.estimation.processes.correlation import Radial
from rsmkit.surfaces.estimation.processes.likelihood import LENGTHS, NUGGET, fit_kriging, fits_without

RNG = np.random.default_rng(3)
POINTS = RNG.random((18, 2))
VALUES = np.sin(4 * POINTS[:, 0]) + POINTS[:, 1] ** 2 + 5
FRESH = RNG.random((7, 2))
NOISE = RNG.uniform(0.5, 2.0, 18)
PEERS = {"rbf": RBF, "matern52": lambda *arguments: Matern(*arguments, nu=2.5)}

kernels = pytest.mark.parametrize("kernel", PEERS)


def with_categories():
    numeric, level = RNG.random((30, 2)), RNG.integers(3, size=30)
    y = np.cos(3 * numeric[:, 0]) * (1 + level) + numeric[:, 1]
    return np.hstack([numeric, np.eye(3)[level]]), y


def data_sets():
    several, many, line = RNG.random((30, 3)), RNG.random((40, 10)), RNG.random((12, 1))
    smooth = np.exp(2 * several[:, 0] - several[:, 1]) + several[:, 2] ** 2
    repeated = np.repeat(several[:12], 3, axis=0)
    yield "smooth", several, smooth
    yield "noisy", several, smooth + 0.5 * RNG.normal(size=30)
    yield "nothing but noise", several, RNG.normal(size=30)
    yield "replicates", repeated, np.repeat(smooth[:12], 3) + 0.3 * RNG.normal(size=36)
    yield "runs twice, the same", np.vstack([several, several[:5]]), np.append(smooth, smooth[:5])
    yield "categories", *with_categories()
    yield "one factor", line, np.sin(7 * line[:, 0])
    yield "ten factors", many, np.sin(3 * many[:, 0]) + many[:, 1] * many[:, 2]


SETS = {name: (x, (y - y.mean()) / y.std()) for name, x, y in data_sets()}


def peer(kernel, points, y, noise=None):
    """Likelihood that scikit-learn finds within our bounds, about the average of the runs."""
    lengths = (np.full(points.shape[1], 0.5), np.outer(np.ptp(points, axis=0), LENGTHS))
    model = ConstantKernel(1.0, (0.1, 1e5)) * PEERS[kernel](*lengths)
    if noise is None:
        model = model + WhiteKernel(1e-3, (1e-5, 1.0))
    regressor = GaussianProcessRegressor(
        model, n_restarts_optimizer=4, random_state=0, alpha=1e-13 if noise is None else noise
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        return regressor.fit(points, y).log_marginal_likelihood_value_


@kernels
@pytest.mark.parametrize("name", SETS)
def test_at_least_as_likely_as_what_scikit_learn_finds(kernel, name):
    points, y = SETS[name]
    # a mean that is estimated can only be likelier; a thousandth is what a search may leave
    assert -0.5 * fit_kriging(kernel, points, y).deviance >= peer(kernel, points, y) - 1e-3


@kernels
def test_with_known_noise_at_least_as_likely_as_what_scikit_learn_finds(kernel):
    points, y = SETS["noisy"]
    variances = 0.05 * np.linspace(0.5, 2.0, len(y))
    found = fit_kriging(kernel, points, y, variances / 0.05, noise_variance=0.05)
    assert found.noise_variance == pytest.approx(0.05, rel=1e-12)
    assert -0.5 * found.deviance >= peer(kernel, points, y, variances) - 1e-3


@kernels
@pytest.mark.parametrize("noise", [0.0, 0.2])
@pytest.mark.parametrize("known", [None, 0.03])
def test_no_guess_is_likelier_than_what_is_found(kernel, noise, known):
    y = VALUES + noise * np.random.default_rng(5).normal(size=18)
    found = fit_kriging(kernel, POINTS, y, NOISE, noise_variance=known)
    bounds = np.log([LENGTHS, LENGTHS, NUGGET])
    compared = 0
    for guess in np.exp(np.random.default_rng(6).uniform(*bounds.T, (500, 3))):
        variance = None if known is None else known / guess[2]
        other = replace(
            found, correlation=Radial(kernel, guess[:2]), nugget=guess[2], known_variance=variance
        )
        try:
            assert other.deviance >= found.deviance - 1e-6
            compared += 1
        except np.linalg.LinAlgError:
            continue
    assert compared > 300


@kernels
def test_units_change_nothing(kernel):
    units, origin = np.array([1e3, 1e-4]), np.array([-2e4, 0.3])
    found = fit_kriging(kernel, POINTS, VALUES)
    other = fit_kriging(kernel, POINTS * units + origin, 1e6 * VALUES - 7)
    np.testing.assert_allclose(other.correlation.lengths, found.correlation.lengths * units, rtol=1e-2)
    np.testing.assert_allclose(
        other.predict(FRESH * units + origin), 1e6 * found.predict(FRESH) - 7, rtol=1e-4
    )


def test_averages_with_their_noise_predict_as_the_replicates_behind_them():
    points, y = SETS["replicates"]
    whole = fit_kriging("rbf", points, y)
    averages = replace(
        whole,
        points=points[::3],
        y=y.reshape(-1, 3).mean(axis=1),
        noise=np.full(12, 1 / 3),
        known_variance=whole.variance,
    )
    fresh = RNG.random((7, 3))
    np.testing.assert_allclose(averages.predict(fresh), whole.predict(fresh), rtol=1e-7)
    np.testing.assert_allclose(averages.variances(fresh), whole.variances(fresh), rtol=1e-7)


@pytest.mark.parametrize("known", [None, 0.1])
def test_what_does_not_vary(known):
    found = fit_kriging("matern52", POINTS * [1, 0], np.ones(18), noise_variance=known)
    np.testing.assert_allclose(found.predict(FRESH), 1.0)
    assert np.isfinite(found.correlation.lengths).all()


def test_no_more_noise_than_is_allowed():
    _, y = SETS["nothing but noise"]
    assert fit_kriging("rbf", SETS["noisy"][0], y).nugget > 0.1
    assert fit_kriging("rbf", SETS["noisy"][0], y, nuggets=(1e-12, 1e-6)).nugget <= 1e-6 * (1 + 1e-12)


def test_fits_without_groups_are_fits_of_the_rest():
    """The likelihood is flat where both end: the deviances agree, the places need not."""
    points, y = SETS["noisy"]
    groups = [np.arange(len(y)) == i for i in (0, 7)] + [np.arange(len(y)) % 5 == 1]
    for out, found in zip(
        groups, fits_without("matern52", fit_kriging("matern52", points, y), groups), strict=True
    ):
        np.testing.assert_array_equal(found.points, points[~out])
        np.testing.assert_array_equal(found.y, y[~out])
        assert found.deviance <= fit_kriging("matern52", points[~out], y[~out]).deviance + 1e-4


def test_fits_without_keep_the_noise_of_the_runs_that_stay():
    noise = np.linspace(0.5, 2.0, len(VALUES))
    out = np.arange(len(VALUES)) < 3
    (found,) = fits_without("rbf", fit_kriging("rbf", POINTS, VALUES, noise), [out])
    np.testing.assert_array_equal(found.noise, noise[3:])
    assert found.deviance <= fit_kriging("rbf", POINTS[3:], VALUES[3:], noise[3:]).deviance + 1e-4
