import numpy as np
import pytest

from rsmkit.language.terms import full_terms
from rsmkit.verification.refinement.local_models import fit_polynomial, fit_process

RNG = np.random.default_rng(3)
POINTS = RNG.random((18, 2))
VALUES = np.sin(4 * POINTS[:, 0]) + POINTS[:, 1] ** 2
FRESH = RNG.random((7, 2))


@pytest.mark.parametrize(("kernel", "name"), [("rbf", "Gaussian process"), ("matern52", "Matern process")])
def test_process_of_exact_values(kernel, name):
    model = fit_process(POINTS, VALUES, kernel)
    assert model.name == name
    np.testing.assert_allclose(model.predict(POINTS), VALUES, atol=1e-4)
    np.testing.assert_allclose(model.predict(FRESH), np.sin(4 * FRESH[:, 0]) + FRESH[:, 1] ** 2, atol=0.05)


def test_process_of_noisy_values_smooths_them():
    noise = 0.3 * np.random.default_rng(4).normal(size=18)
    model = fit_process(POINTS, VALUES + noise, "rbf", noisy=True)
    assert np.abs(model.predict(POINTS) - VALUES).mean() < 0.8 * np.abs(noise).mean()


def test_nothing_to_fit():
    assert fit_process(POINTS[:3], VALUES[:3], "matern52") is None
    assert fit_process(POINTS, np.ones(18), "matern52") is None


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
