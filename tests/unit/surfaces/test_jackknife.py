"""Jackknife+ intervals against their definition: fit again without each run."""

from dataclasses import replace

import numpy as np
import pytest

from rsmkit.errors import RsmkitError
from rsmkit.language.space import Space
from rsmkit.surfaces.estimation.fit_data import checked_data
from rsmkit.surfaces.models.box_cox import BoxCoxSurface, power_transform
from rsmkit.surfaces.models.gaussian_process import fit_gaussian_process
from rsmkit.surfaces.models.polynomial import fit_polynomial
from rsmkit.surfaces.polynomial_fit import fit_surface

SPACE = Space(a=(0.0, 1.0), b=(5.0, 10.0))
RNG = np.random.default_rng(0)
X = RNG.uniform([0, 5], [1, 10], (25, 2))
Y = np.exp(X[:, 0]) + X[:, 1] + 0.1 * RNG.normal(size=25)
WEIGHTS = RNG.uniform(0.5, 2, 25)
FRESH = RNG.uniform([0, 5], [1, 10], (7, 2))


def by_definition(refit, fresh, confidence):
    """Sorted predictions without run i, minus and plus the size of the error at run i."""
    without = [refit(i) for i in range(25)]
    errors = [abs(Y[i] - without[i](X[i : i + 1])[0]) for i in range(25)]
    low = np.sort([w(fresh) - e for w, e in zip(without, errors, strict=True)], axis=0)
    high = np.sort([w(fresh) + e for w, e in zip(without, errors, strict=True)], axis=0)
    rank = int((1 - confidence) * 26 + 1e-9)
    return low[rank - 1], high[25 - rank]


@pytest.mark.parametrize("weights", [None, WEIGHTS])
def test_polynomial(weights):
    surface = fit_surface(SPACE, X, Y, weights=weights)
    terms = surface.terms

    def refit(i):
        return fit_polynomial(SPACE, "y", surface.data.without(i), terms).predict

    mean, low, high = surface.predict(FRESH, interval=0.9, kind="jackknife+")
    np.testing.assert_array_equal(mean, surface.predict(FRESH))
    np.testing.assert_allclose((low, high), by_definition(refit, FRESH, 0.9), rtol=1e-10)


def test_box_cox_in_the_units_of_the_response():
    inner = fit_polynomial(
        SPACE, "y", checked_data(SPACE, X, power_transform(Y, 0.5)), fit_surface(SPACE, X, Y).terms
    )
    surface = BoxCoxSurface(inner, 0.5, 0.0)

    def refit(i):
        fewer = fit_polynomial(SPACE, "y", inner.data.without(i), inner.terms)
        return BoxCoxSurface(fewer, 0.5, 0.0).predict

    _, low, high = surface.predict(FRESH, interval=0.9, kind="jackknife+")
    np.testing.assert_allclose((low, high), by_definition(refit, FRESH, 0.9), rtol=1e-10)


def test_gaussian_process_with_its_hyper_parameters_kept():
    surface = fit_gaussian_process(SPACE, "y", checked_data(SPACE, X, Y))

    def refit(i):
        return replace(surface, data=surface.data.without(i)).predict

    _, low, high = surface.predict(FRESH, interval=0.9, kind="jackknife+")
    np.testing.assert_allclose((low, high), by_definition(refit, FRESH, 0.9), rtol=1e-7)


def test_few_runs_give_no_limits():
    surface = fit_surface(SPACE, X[:15], Y[:15])
    _, low, high = surface.predict(FRESH, interval=0.95, kind="jackknife+")
    assert np.isneginf(low).all()
    assert np.isposinf(high).all()
    with pytest.raises(RsmkitError, match="between 0 and 1"):
        surface.predict(FRESH, interval=1.5, kind="jackknife+")


def test_new_runs_are_covered():
    """Nominal 90 %, guaranteed 80 %; runs and new run drawn alike."""
    covered = []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        x = rng.uniform([0, 5], [1, 10], (41, 2))
        y = np.exp(2 * x[:, 0]) + rng.standard_t(3, 41)
        surface = fit_surface(SPACE, x[:40], y[:40])
        _, low, high = surface.predict(x[40:], interval=0.9, kind="jackknife+")
        covered.append(low[0] <= y[40] <= high[0])
    assert 0.84 <= np.mean(covered) <= 0.98
