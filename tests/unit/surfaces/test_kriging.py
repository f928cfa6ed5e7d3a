"""One Gaussian process, for surfaces and for refinement, against the kriging system and scikit-learn."""

from dataclasses import replace

import numpy as np
import pytest
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, Matern

from rsmkit.surfaces.estimation.processes.correlation import Radial
from rsmkit.surfaces.estimation.processes.kriging import Kriging

RNG = np.random.default_rng(3)
POINTS = RNG.random((18, 2))
VALUES = np.sin(4 * POINTS[:, 0]) + POINTS[:, 1] ** 2 + 5
FRESH = RNG.random((7, 2))
NOISE = RNG.uniform(0.5, 2.0, 18)
LENGTH = np.array([0.4, 0.9])
PEERS = {"rbf": RBF, "matern52": lambda lengths: Matern(lengths, nu=2.5)}

kernels = pytest.mark.parametrize("kernel", PEERS)
means = pytest.mark.parametrize("mean", [None, 5.5])


def at(kernel, **changes):
    return replace(Kriging(Radial(kernel, LENGTH), POINTS, VALUES, 1e-3, NOISE), **changes)


def covariance(kernel):
    return PEERS[kernel](LENGTH)(POINTS) + 1e-3 * np.diag(NOISE)


def central(function, x, step):
    """Derivatives of a function of one point by central differences."""
    return np.array([(function(x + e) - function(x - e)) / (2 * step) for e in step * np.eye(len(x))])


@kernels
@pytest.mark.parametrize("variance", [None, 0.7])
def test_slopes_of_the_deviance(kernel, variance):
    def deviance(theta):
        lengths, nugget = np.exp(theta[:2]), np.exp(theta[2])
        known = None if variance is None else np.exp(theta[3])
        return at(kernel, correlation=Radial(kernel, lengths), nugget=nugget, known_variance=known).deviance

    theta = np.log([*LENGTH, 1e-2, variance or 1.0])
    slopes = at(kernel, nugget=1e-2, known_variance=variance).deviance_slopes
    # third derivatives are of order ten here: central differences err by 1e-8 times some two of it
    np.testing.assert_allclose(slopes, central(deviance, theta, 1e-4), atol=1e-6)


@kernels
def test_the_likeliest_variance_and_mean(kernel):
    process = at(kernel)
    inverse = np.linalg.inv(covariance(kernel))
    assert process.mean == pytest.approx(inverse.sum(axis=0) @ VALUES / inverse.sum(), rel=1e-10)
    for other in (
        at(kernel, known_mean=process.mean + 1e-2),
        at(kernel, known_variance=1.01 * process.variance),
        at(kernel, known_variance=0.99 * process.variance),
    ):
        assert other.deviance > process.deviance
    same = at(kernel, known_mean=process.mean, known_variance=process.variance)
    assert same.deviance == pytest.approx(process.deviance, rel=1e-12)


@kernels
def test_prediction_solves_the_kriging_system(kernel):
    """Cressie (1993), equations 3.2.12-3.2.16: weights that sum to one and their Lagrange multiplier."""
    across = PEERS[kernel](LENGTH)(POINTS, FRESH)
    bordered = np.block([[covariance(kernel), np.ones((18, 1))], [np.ones((1, 18)), 0.0]])
    solved = np.linalg.solve(bordered, np.vstack([across, np.ones(7)]))
    process = at(kernel)
    np.testing.assert_allclose(process.predict(FRESH), VALUES @ solved[:18], rtol=1e-10)
    variances = 1.0 - (solved[:18] * across).sum(axis=0) - solved[18]
    np.testing.assert_allclose(process.variances(FRESH), process.variance * variances, rtol=1e-7)


@kernels
def test_a_known_mean_is_as_in_scikit_learn(kernel):
    shape = 0.7 * PEERS[kernel](LENGTH)
    peer = GaussianProcessRegressor(shape, optimizer=None, alpha=0.7 * 1e-3 * NOISE)
    mean, expected = peer.fit(POINTS, VALUES - 5.5).predict(FRESH, return_cov=True)
    process = at(kernel, known_mean=5.5, known_variance=0.7)
    np.testing.assert_allclose(process.predict(FRESH), 5.5 + mean, rtol=1e-10)
    np.testing.assert_allclose(process.variances(FRESH), np.diag(expected), rtol=1e-7)
    # condition number of the covariance some 1e4, times the unit roundoff
    np.testing.assert_allclose(process.covariance(FRESH), expected, atol=1e-11)
    assert process.deviance == pytest.approx(-2 * peer.log_marginal_likelihood(shape.theta), rel=1e-10)


@kernels
@means
def test_slopes_of_mean_and_variance(kernel, mean):
    process = at(kernel, known_mean=mean)
    slopes, of_variance = process.gradient(FRESH), process.variance_gradient(FRESH)
    for i, point in enumerate(FRESH):
        # central differences: third derivatives of order 1e2, times the square of the step, and roundoff
        # (1e-13 in mean and variance) over the step
        numeric = central(lambda x: process.predict(x[None])[0], point, 1e-5)
        np.testing.assert_allclose(slopes[i], numeric, atol=1e-7)
        numeric = central(lambda x: process.variances(x[None])[0], point, 1e-5)
        np.testing.assert_allclose(of_variance[i], numeric, atol=1e-7)


@kernels
@means
def test_covariance_of_points_has_their_variances_and_bounds_the_samples(kernel, mean):
    process = at(kernel, known_mean=mean)
    found = process.covariance(FRESH)
    np.testing.assert_allclose(np.diag(found), process.variances(FRESH), rtol=1e-9)
    # of the sum of two points, conditioned on the one and then on the other
    first = process.extended(FRESH[:1], process.predict(FRESH[:1]), np.zeros(1))
    left = found[1, 1] - found[0, 1] ** 2 / found[0, 0]
    assert first.variances(FRESH[1:2])[0] == pytest.approx(left, rel=1e-6)


@kernels
def test_samples_have_the_conditional_mean_and_covariance(kernel):
    process, count = at(kernel), 20_000
    several = np.vstack([FRESH, FRESH[:1]])
    drawn = process.samples(several, count, np.random.default_rng(8))
    np.testing.assert_allclose(drawn[:, 0], drawn[:, 7], atol=1e-6)
    sd = np.sqrt(process.variances(several))
    # five standard errors: of a mean, and of a product of two normal variables (at most root two)
    np.testing.assert_allclose((drawn.mean(axis=0) - process.predict(several)) / sd, 0, atol=5 / count**0.5)
    scaled = process.covariance(several) / np.outer(sd, sd)
    np.testing.assert_allclose(np.cov(drawn.T) / np.outer(sd, sd), scaled, atol=5 * (2 / count) ** 0.5)


@kernels
@means
def test_extended_is_as_if_all_runs_were_there_from_the_start(kernel, mean):
    whole = at(kernel, known_mean=mean, known_variance=0.7)
    first = replace(whole, points=POINTS[:12], y=VALUES[:12], noise=NOISE[:12])
    longer = first.extended(POINTS[12:15], VALUES[12:15], NOISE[12:15])
    longer = longer.extended(POINTS[15:], VALUES[15:], NOISE[15:])
    np.testing.assert_allclose(longer.cholesky, whole.cholesky, atol=1e-12)
    np.testing.assert_allclose(longer.predict(FRESH), whole.predict(FRESH), rtol=1e-10)
    np.testing.assert_allclose(longer.variances(FRESH), whole.variances(FRESH), rtol=1e-7)


@means
def test_believing_a_prediction_changes_no_mean_and_lowers_the_variance(mean):
    process = at("matern52", known_mean=mean, noise=None)
    believed = process.extended(FRESH[:2], process.predict(FRESH[:2]))
    assert believed.noise is None
    np.testing.assert_allclose(believed.predict(FRESH), process.predict(FRESH), rtol=1e-10)
    assert (believed.variances(FRESH) < process.variances(FRESH)).all()
    assert believed.variance == process.variance


def refitted(kernel, mean, rest):
    """Predict from some of the runs, as if there were no others."""
    if mean is None:
        return at(kernel, points=POINTS[rest], y=VALUES[rest], noise=NOISE[rest]).predict
    peer = GaussianProcessRegressor(PEERS[kernel](LENGTH), optimizer=None, alpha=1e-3 * NOISE[rest])
    peer.fit(POINTS[rest], VALUES[rest] - mean)
    return lambda x: mean + peer.predict(x)


@kernels
@means
def test_leave_one_out_against_refits(kernel, mean):
    process = at(kernel, known_mean=mean)
    without = process.predictions_without(FRESH)
    for left in range(18):
        predict = refitted(kernel, mean, np.arange(18) != left)
        error = VALUES[left] - predict(POINTS[[left]])[0]
        assert process.loo_residuals[left] == pytest.approx(error, rel=1e-7, abs=1e-9)
        np.testing.assert_allclose(without[:, left], predict(FRESH), rtol=1e-9)
    # and their variances: those of the point given the others, and its own noise
    fewer = at(kernel, points=POINTS[1:], y=VALUES[1:], noise=NOISE[1:], known_mean=mean, known_variance=0.7)
    expected = fewer.variances(POINTS[:1]) + 0.7 * 1e-3 * NOISE[0]
    found = replace(process, known_variance=0.7).loo_variances[:1]
    np.testing.assert_allclose(found, expected, rtol=1e-7)


@kernels
@means
def test_bordered_cholesky_gives_the_variances(kernel, mean):
    """Forward substitution, row by row, as the explorer page does it."""
    process = at(kernel, known_mean=mean)
    left = np.append(PEERS[kernel](LENGTH)(FRESH[:1], POINTS)[0], 1.0)
    rows = process.bordered_cholesky
    for i, row in enumerate(rows):
        left[i] = (left[i] - row[:-1] @ left[:i]) / row[-1]
    relative = 1.0 - left[:18] @ left[:18] + (left[18] ** 2 if len(rows) == 19 else 0.0)
    assert process.variance * relative == pytest.approx(process.variances(FRESH[:1])[0], rel=1e-9)
    assert len(rows) == 18 + (mean is None)
