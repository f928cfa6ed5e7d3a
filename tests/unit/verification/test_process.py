import numpy as np
import pytest
from scipy.optimize import approx_fprime
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, Matern, WhiteKernel

from rsmkit.language.terms import full_terms
from rsmkit.verification.refinement.local_models import fit_polynomial
from rsmkit.verification.refinement.process import _likelihood, fit_process

RNG = np.random.default_rng(3)
POINTS = RNG.random((18, 2))
VALUES = np.sin(4 * POINTS[:, 0]) + POINTS[:, 1] ** 2
FRESH = RNG.random((7, 2))


@pytest.mark.parametrize("correlation", ["gaussian", "matern"])
def test_gradient_of_the_likelihood(correlation):
    squares = (POINTS[:, None] - POINTS[None]) ** 2
    theta = np.log([0.4, 0.9, 1e-2])
    _, gradient = _likelihood(theta, squares, VALUES, correlation)
    numeric = approx_fprime(theta, lambda t: _likelihood(t, squares, VALUES, correlation)[0], 1e-6)
    np.testing.assert_allclose(gradient, numeric, rtol=1e-4)


@pytest.mark.parametrize(
    ("correlation", "kernel"), [("gaussian", RBF), ("matern", lambda s: Matern(s, nu=2.5))]
)
def test_prediction_agrees_with_scikit_learn_at_the_same_length_scales(correlation, kernel):
    ours = fit_process(POINTS, VALUES, correlation, largest_nugget=1e-10)
    peer = GaussianProcessRegressor(kernel(ours.lengths) + WhiteKernel(1e-11), optimizer=None, alpha=1e-10)
    peer.fit(POINTS, VALUES - ours.mean)
    np.testing.assert_allclose(ours.predict(FRESH), ours.mean + peer.predict(FRESH), atol=1e-4)
    truth = np.sin(4 * FRESH[:, 0]) + FRESH[:, 1] ** 2
    np.testing.assert_allclose(ours.predict(FRESH), truth, atol=0.05)


def test_leave_one_out_of_the_process_against_refits():
    ours = fit_process(POINTS, VALUES, "matern", largest_nugget=1e-6)
    kernel = Matern(ours.lengths, nu=2.5)(POINTS) + 1e-11 * np.eye(len(POINTS))
    for left in range(0, len(POINTS), 5):
        rest = np.arange(len(POINTS)) != left
        inverse = np.linalg.inv(kernel[np.ix_(rest, rest)])
        mean = inverse.sum(axis=0) @ VALUES[rest] / inverse.sum()
        predicted = mean + kernel[left, rest] @ inverse @ (VALUES[rest] - mean)
        assert ours.residuals[left] == pytest.approx(VALUES[left] - predicted, rel=1e-2, abs=1e-5)


def test_nothing_to_fit():
    assert fit_process(POINTS[:3], VALUES[:3], "matern") is None
    assert fit_process(POINTS, np.ones(18), "matern") is None


def test_polynomial_is_exact_on_a_polynomial_and_needs_a_point_to_spare():
    matrix = full_terms(2, 3).matrix(POINTS)
    y = matrix @ np.arange(1.0, 11.0)
    model = fit_polynomial(POINTS, y, np.array([0.3, 0.4]), np.ones(18), order=3)
    np.testing.assert_allclose(model.predict(FRESH), full_terms(2, 3).matrix(FRESH) @ np.arange(1.0, 11.0))
    assert np.abs(model.residuals).max() < 1e-9
    assert fit_polynomial(POINTS[:10], y[:10], np.zeros(2), np.ones(10), order=3) is None
    assert fit_polynomial(POINTS * [1, 0], y, np.zeros(2), np.ones(18)) is None


def test_leave_one_out_of_the_weighted_polynomial_against_refits():
    weights = np.linspace(0.2, 1.0, 18)
    model = fit_polynomial(POINTS, VALUES, np.zeros(2), weights)
    for left in range(18):
        rest = np.arange(18) != left
        root = np.sqrt(weights[rest])
        matrix = full_terms(2, 2).matrix(POINTS)
        refit = np.linalg.lstsq(matrix[rest] * root[:, None], VALUES[rest] * root, rcond=None)[0]
        assert model.residuals[left] == pytest.approx(VALUES[left] - matrix[left] @ refit, rel=1e-8)
