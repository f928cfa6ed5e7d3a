"""scikit-learn's own behavioural suite, and agreement with the surfaces themselves."""

import numpy as np
import pytest
from sklearn.model_selection import cross_val_score
from sklearn.utils.estimator_checks import parametrize_with_checks

from rsmkit.language.space import Space
from rsmkit.scikit_learn import SurfaceRegressor
from rsmkit.surfaces.polynomial_fit import fit_surface

X = np.random.default_rng(0).uniform([0, 10], [1, 20], (30, 2))
Y = X[:, 0] ** 2 + 0.1 * X[:, 1] + 0.01 * np.random.default_rng(1).normal(size=30)


@parametrize_with_checks([SurfaceRegressor()])
def test_scikit_learn_checks(estimator, check):
    check(estimator)


@pytest.mark.slow
@parametrize_with_checks(
    [
        SurfaceRegressor("stretched", order=1),
        SurfaceRegressor("box-cox", order=1),
        SurfaceRegressor("gaussian process"),
    ]
)
def test_scikit_learn_checks_of_a_model_that_chooses(estimator, check):
    """The other models pass as well: in minutes, `auto` in half an hour (docs/surfaces.md)."""
    if estimator.model == "stretched" and stores_otherwise(check):
        pytest.skip("a minute for what the other models show: that data may be kept in any way")
    check(estimator)


def stores_otherwise(check):
    """Whether a check fits what another one fits, from other arrays."""
    kept = {"check_regressor_data_not_an_array", "check_regressors_int", "check_dtype_object"}
    return check.func.__name__ in kept or "readonly_memmap" in check.keywords


def test_predictions_are_those_of_the_surface():
    regressor = SurfaceRegressor().fit(X, Y)
    surface = fit_surface(Space(a=(0.0, 1.0), b=(10.0, 20.0)), X, Y)
    np.testing.assert_allclose(regressor.predict(X), surface.predict(X), rtol=1e-10)
    mean, low, high = regressor.predict_interval(X, 0.9)
    np.testing.assert_allclose((mean, low, high), surface.predict(X, interval=0.9), rtol=1e-9)
    assert cross_val_score(SurfaceRegressor(), X, Y).mean() > 0.95


def test_too_few_points_lower_the_order_and_constant_columns_are_ignored():
    assert SurfaceRegressor(order=3).fit(X[:7], Y[:7]).order_ == 2
    assert SurfaceRegressor().fit(X[:2], Y[:2]).order_ == 0
    wide = np.column_stack([X, np.ones(30)])
    np.testing.assert_allclose(
        SurfaceRegressor().fit(wide, Y).predict(wide), SurfaceRegressor().fit(X, Y).predict(X)
    )


def test_whole_weights_are_repetitions_for_models_that_choose():
    positive = np.exp(Y)
    weights = np.arange(30) % 3
    repeated = np.repeat(X, weights, axis=0), np.repeat(positive, weights)
    weighted = SurfaceRegressor("box-cox").fit(X, positive, sample_weight=weights)
    np.testing.assert_array_equal(weighted.predict(X), SurfaceRegressor("box-cox").fit(*repeated).predict(X))


def test_wrong_parameters_are_refused():
    with pytest.raises(ValueError, match="order must be"):
        SurfaceRegressor(order=7).fit(X, Y)
    with pytest.raises(
        ValueError, match=r"model must be polynomial, .* or auto; got 'polynomal', did you mean 'polynomial'"
    ):
        SurfaceRegressor("polynomal").fit(X, Y)
    with pytest.raises(ValueError, match="stretch 'spline' is no family"):
        SurfaceRegressor("stretched", stretch="spline").fit(X, Y)
    with pytest.raises(ValueError, match=r"one weight per row, shape \(30,\)"):
        SurfaceRegressor().fit(X, Y, sample_weight=np.ones(29))
    with pytest.raises(ValueError, match="must not be negative; the least is -1"):
        SurfaceRegressor().fit(X, Y, sample_weight=np.r_[-1.0, np.ones(29)])
    with pytest.raises(ValueError, match="weights are zero"):
        SurfaceRegressor().fit(X, Y, sample_weight=np.zeros(30))
