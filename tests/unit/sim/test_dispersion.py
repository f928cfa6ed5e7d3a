"""GRAM-like dispersions: their statistics, their reproducibility, and Monte Carlo over the seed."""

import numpy as np
import pytest

from sim.air.dispersion import SLOW_SHARE, dispersed, two_scale_profile
from sim.air.standards import us1962
from sim.air.wind import wind_ned
from sim.core.errors import InputError
from sim.reentry import evaluate

HEIGHTS = np.arange(0.0, 100_001.0, 250.0)


@pytest.fixture(scope="module")
def profiles():
    random = np.random.default_rng(20260101)
    return np.array([two_scale_profile(HEIGHTS, random) for _ in range(4000)])


def test_profiles_are_standard_normal_at_every_height(profiles):
    # 4000 samples: the standard error of a standard deviation is 1.1 %, of a mean 1.6 %
    assert np.abs(profiles.std(axis=0) - 1.0).max() < 0.05
    assert np.abs(profiles.mean(axis=0)).max() < 0.075


@pytest.mark.parametrize("height_m", [10_000.0, 40_000.0, 80_000.0])
def test_autocorrelation_is_that_of_two_markov_processes(profiles, height_m):
    i = int(height_m / 250)
    for lag_m in (500.0, 1000.0, 4000.0):
        j = i + int(lag_m / 250)
        middle = 0.5 * (height_m + HEIGHTS[j]) / 120e3
        slow, fast = 6e3 + 9e3 * middle, 600.0 + 2400.0 * middle
        expected = SLOW_SHARE * np.exp(-lag_m / slow) + (1 - SLOW_SHARE) * np.exp(-lag_m / fast)
        measured = np.mean(profiles[:, i] * profiles[:, j])
        assert measured == pytest.approx(expected, abs=0.06)


def test_density_spreads_as_earth_gram_says_around_the_mean():
    mean = us1962()
    heights = np.array([30e3, 60e3, 90e3])
    draws = np.array([dispersed(mean, seed).atmosphere(heights).density_kg_m3 for seed in range(600)])
    ratio = draws / mean(heights).density_kg_m3
    # 600 samples: 3 % standard error of the deviation
    np.testing.assert_allclose(100 * ratio.std(axis=0), [1.15, 5.4, 9.8], rtol=0.12)
    np.testing.assert_allclose(ratio.mean(axis=0), 1.0, atol=0.015)


def test_winds_spread_as_earth_gram_says():
    draws = np.array([wind_ned(dispersed(us1962(), seed).wind, 70e3) for seed in range(600)])
    np.testing.assert_allclose(draws.std(axis=0), [15.2, 24.2, 1.91], rtol=0.12)
    assert np.abs(draws.mean(axis=0)).max() < 4.0
    blowing = np.array([wind_ned(dispersed(us1962(), s, mean_wind=True).wind, 70e3) for s in range(50)])
    np.testing.assert_allclose(blowing - draws[:50], np.tile([-1.04, 12.26, 0.0], (50, 1)), atol=1e-9)


def test_same_seed_same_air_and_scale_zero_is_the_mean():
    first, again, other = (dispersed(us1962(), seed).atmosphere(HEIGHTS) for seed in (7, 7, 8))
    assert np.array_equal(first.density_kg_m3, again.density_kg_m3)
    assert not np.array_equal(first.density_kg_m3, other.density_kg_m3)
    undisturbed = dispersed(us1962(), 7, scale=0.0).atmosphere(HEIGHTS)
    np.testing.assert_allclose(undisturbed.density_kg_m3, us1962()(HEIGHTS).density_kg_m3, rtol=1e-12)
    np.testing.assert_allclose(undisturbed.pressure_Pa, us1962()(HEIGHTS).pressure_Pa, rtol=2e-4)
    np.testing.assert_allclose(undisturbed.temperature_K, us1962()(HEIGHTS).temperature_K, rtol=2e-4)


def test_dispersed_air_is_in_hydrostatic_balance():
    air = dispersed(us1962(), 3).atmosphere
    z = np.arange(1000.0, 79_000.0, 250.0)
    weight = 9.80665 * (6_356_766.0 / (6_356_766.0 + z)) ** 2 * air(z).density_kg_m3
    drop = air(z[:-1]).pressure_Pa - air(z[1:]).pressure_Pa
    np.testing.assert_allclose(drop, 250.0 * 0.5 * (weight[:-1] + weight[1:]), rtol=3e-3)


@pytest.mark.parametrize(("seed", "scale"), [(-1, 1.0), (1.5, 1.0), (1, -0.1)])
def test_bad_requests_are_refused(seed, scale):
    with pytest.raises(InputError):
        dispersed(us1962(), seed, scale=scale)


def test_monte_carlo_is_an_ordinary_function_of_the_seed():
    design = (7.5, 12.5, 0.225)
    flights = [evaluate(*design, seed=seed, rtol=1e-6) for seed in (1, 2, 1)]
    assert flights[0] == flights[2]
    assert flights[0]["axial_integral"] != flights[1]["axial_integral"]
    undisturbed = evaluate(*design, rtol=1e-6)
    assert flights[0]["axial_integral"] == pytest.approx(undisturbed["axial_integral"], rel=0.2)
