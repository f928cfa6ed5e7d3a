"""Intervals of models that were chosen, or transformed, by the runs they were fitted to."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm, t

from rsmkit.language.space import Space
from rsmkit.language.terms import full_terms
from rsmkit.surfaces.estimation.fit_data import checked_data
from rsmkit.surfaces.fitted_response import FittedResponse, surface_from_json
from rsmkit.surfaces.kinds import page_model
from rsmkit.surfaces.models.box_cox import BoxCoxSurface, power_inverse, power_transform
from rsmkit.surfaces.models.polynomial import fit_polynomial
from rsmkit.surfaces.models.reduction.reduced import reduce_surface
from rsmkit.surfaces.polynomial_fit import fit_surface
from rsmkit.surfaces.statistics.intervals import simultaneous_band, tolerance_factor, tolerance_interval

SPACE = Space(a=(0.0, 1.0), b=(0.0, 1.0))
RNG = np.random.default_rng(5)
POINTS, FRESH = RNG.random((16, 2)), RNG.random((6, 2))
NOISE = RNG.normal(size=16)


def test_intervals_of_a_reduced_model_take_error_and_leverage_of_all_terms():
    full = fit_surface(SPACE, POINTS, 3.0 * POINTS[:, 0] + NOISE).surface
    kept = reduce_surface(full).surface
    assert len(kept.names) < len(full.names)
    leverage, quantile = full.leverage(FRESH), t.ppf(0.975, full.fit.df)
    for kind, more in (("mean", 0.0), ("prediction", 1.0)):
        mean, low, high = kept.predict(FRESH, 0.95, kind)
        np.testing.assert_array_equal(mean, kept.predict(FRESH))
        half = quantile * full.fit.sigma * np.sqrt(leverage + more)
        np.testing.assert_allclose([mean - low, high - mean], [half, half], rtol=1e-10)
    _, low, high = tolerance_interval(kept, FRESH)
    factor = tolerance_factor(leverage, full.fit.df)
    np.testing.assert_allclose(high - low, 2 * factor * full.fit.sigma, rtol=1e-10)
    _, low, high = simultaneous_band(kept, FRESH)
    _, wide_low, wide_high = simultaneous_band(full, FRESH)
    np.testing.assert_allclose(high - low, wide_high - wide_low, rtol=1e-10)
    # the other words say so, coefficients get no limits, and the page draws the same
    report = FittedResponse(kept).report()
    assert "with all terms" in report["note"]
    assert all(term["low"] is term["high"] is None for term in report["terms"])
    page = page_model(kept)
    assert (page["sigma"], page["quantile"]) == pytest.approx((full.fit.sigma, quantile), rel=1e-12)
    assert len(page["coefficients"]) == page["factor"]["rows"] == len(full.names)


def test_a_reduced_model_remembers_what_it_was_chosen_from():
    kept = reduce_surface(fit_surface(SPACE, POINTS, 3.0 * POINTS[:, 0] + NOISE).surface).surface
    again = surface_from_json(json.loads(json.dumps(kept.to_json())))
    np.testing.assert_array_equal(again.predict(FRESH, 0.95), kept.predict(FRESH, 0.95))
    old = {key: value for key, value in kept.to_json().items() if key != "considered"}
    assert surface_from_json(old).surface.considered is None


def transformed(power, y):
    data = checked_data(SPACE, POINTS, y)
    inner = fit_polynomial(SPACE, "y", replace(data, y=power_transform(y, power)), full_terms(2, 1))
    return BoxCoxSurface(inner, power, 0.0)


@pytest.mark.parametrize("power", [0.0, 0.5, -0.4, 1.3])
def test_box_cox_intervals_allow_for_the_power(power):
    """How the prediction moves with the power: fitted again at powers a little larger and smaller."""
    y = power_inverse(2.0 * (power >= 0) + 0.3 * POINTS[:, 0] + 0.1 * NOISE, power)
    surface, step = transformed(power, y), 1e-4
    near = [transformed(power + d, y).predict(FRESH) for d in (step, -step)]
    median = surface.predict(FRESH)
    slope = (near[0] - near[1]) / (2 * step) * median ** (power - 1)
    low, high = np.nan_to_num(surface.estimated.low, nan=-5), np.nan_to_num(surface.estimated.high, nan=5)
    error = (high - low) / (2 * norm.ppf(0.975))
    inner, df = surface.inner, surface.inner.fit.df - 1
    variance = inner.fit.rss / df * (1 + inner.leverage(FRESH)) + (slope * error) ** 2
    half = t.ppf(0.95, df) * np.sqrt(variance)
    found = surface.predict(FRESH, 0.9)
    z = power_transform(median, power)
    expected = [median, power_inverse(z - half, power), power_inverse(z + half, power)]
    # central differences: step^2 times third derivatives of order one
    np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_mean_and_median_after_a_logarithm():
    """The lognormal mean is exp(z + sigma^2 / 2), that of u^2 with u = 1 + z/2 > 0 a normal moment."""
    y = np.exp(1.0 + POINTS[:, 0] + 0.4 * NOISE)
    surface = transformed(0.0, y)
    z = surface.inner.predict(FRESH)
    np.testing.assert_allclose(surface.predict(FRESH), np.exp(z), rtol=1e-12)
    np.testing.assert_allclose(surface.mean(FRESH), np.exp(z + surface.sigma**2 / 2), rtol=1e-12)
    root = transformed(0.5, y)
    u, spread = 1 + root.inner.predict(FRESH) / 2, root.sigma / 2
    expected = (u**2 + spread**2) * norm.cdf(u / spread) + u * spread * norm.pdf(u / spread)
    np.testing.assert_allclose(root.mean(FRESH), expected, rtol=1e-12)


def test_no_prediction_is_infinite():
    """With a negative power the polynomial leaves the range of the transformation not far from the runs."""
    y = power_inverse(0.5 + 1.2 * POINTS[:, 0] + 0.01 * NOISE, -0.5)
    surface = transformed(-0.5, y)
    far = np.array([[3.0, 0.5], [30.0, 0.5], [-30.0, 0.5]])
    assert not np.isfinite(power_inverse(surface.inner.predict(far), -0.5)).all()
    for found in (surface.predict(far), surface.mean(far), surface.gradient(far)):
        assert np.isfinite(found).all()
    assert surface.predict(far)[1] == 1000 * y.max()
