"""Which stretch is found does not depend on how the criterion is rounded."""

import json

import numpy as np
import pytest

from rsmkit.errors import FitError
from rsmkit.language.space import Space
from rsmkit.language.terms import full_terms
from rsmkit.surfaces.estimation.fit_data import checked_data
from rsmkit.surfaces.estimation.stretch import theta_of
from rsmkit.surfaces.fitted_response import surface_from_json
from rsmkit.surfaces.models.polynomial import fit_polynomial
from rsmkit.surfaces.models.stretch_search import (
    DIGITS,
    LEVERAGE,
    StretchSearch,
    _identity_members,
    _limits,
)
from rsmkit.surfaces.models.stretched import box_to_stretch, fit_stretched

SPACE = Space(a=(0.0, 1.0), b=(-2.0, 3.0))
RUNS = np.random.default_rng(4).random((30, 2)) * [1.0, 5.0] + [0.0, -2.0]
Y = np.exp(2.5 * RUNS[:, 0]) + RUNS[:, 0] * RUNS[:, 1] + np.exp(-RUNS[:, 1]) + np.sin(9 * RUNS).sum(axis=1)
ROUNDING = 3e-15


@pytest.fixture
def rounded_otherwise(monkeypatch):
    """Give every value of the criterion a relative error of its own; none for seed 0."""
    exact, exact_with_slope = StretchSearch._criterion, StretchSearch._criterion_and_slope

    def use(seed):
        rng = np.random.default_rng(seed)

        def noise(size=None):
            return 1.0 + (ROUNDING * rng.uniform(-1.0, 1.0, size) if seed else 0.0)

        def criterion(self, *about):
            return exact(self, *about) * noise()

        def criterion_and_slope(self, *about, **how):
            value, slope = exact_with_slope(self, *about, **how)
            return value * noise(), slope * noise(len(slope))

        monkeypatch.setattr(StretchSearch, "_criterion", criterion)
        monkeypatch.setattr(StretchSearch, "_criterion_and_slope", criterion_and_slope)

    return use


@pytest.mark.parametrize("family", ["exp", "power", "twosided", "kumaraswamy"])
def test_rounding_changes_no_bit_of_a_stretch(family, rounded_otherwise):
    plain = fit_polynomial(SPACE, "y", checked_data(SPACE, RUNS, Y, None, None), full_terms(SPACE))
    found = set()
    for seed in range(4):
        rounded_otherwise(seed)
        theta = theta_of(StretchSearch(plain).find(family))
        found.add(theta.tobytes())
    assert len(found) == 1
    np.testing.assert_array_equal(theta, np.round(theta, DIGITS))


def test_a_stretch_that_the_greatest_leverage_holds_back_lies_at_it_whatever_rounding(rounded_otherwise):
    """The criterion falls until one run decides its own fitted value, and jumps there."""
    points = np.random.default_rng(7).uniform(-1, 1, (24, 2))
    y = np.exp(0.3 * np.exp(1.5 * points[:, 0]) + points[:, 1])
    plain = fit_polynomial(
        SPACE, "y", checked_data(SPACE, SPACE.decode(points), y, None, None), full_terms(SPACE)
    )
    found = set()
    for seed in range(4):
        rounded_otherwise(seed)
        search = StretchSearch(plain)
        stretches = search.find("exp")
        found.add(theta_of(stretches).tobytes())
    assert len(found) == 1
    q, _ = np.linalg.qr(search._matrix(stretches, search.rows))
    assert (q**2).sum(axis=1).max() == pytest.approx(LEVERAGE, abs=1e-6)


def test_the_settled_stretch_is_where_the_criterion_is_flat():
    """A central difference over 1e-3: the criterion of 30 runs is smooth, its rounding error 1e-12 / 1e-3."""
    plain = fit_polynomial(SPACE, "y", checked_data(SPACE, RUNS, Y, None, None), full_terms(SPACE))
    search = StretchSearch(plain)
    stretches = search.find("exp")
    theta = theta_of(stretches)
    for axis in 1e-3 * np.eye(len(theta)):
        ahead, behind = (search._criterion(theta + s * axis, stretches, search.rows) for s in (1.0, -1.0))
        assert abs(ahead - behind) / 2e-3 < 1e-4


@pytest.mark.parametrize("family", ["exp", "power", "natpower", "twosided", "roberts", "beta"])
def test_the_slope_is_that_of_the_criterion(family):
    rng = np.random.default_rng(1)
    space = Space(a=(1, 2), b=(3, 7), c=["x", "y", "z"])
    points = np.column_stack([rng.uniform(1, 2, 40), rng.uniform(3, 7, 40), rng.integers(0, 3, 40)])
    y = np.exp(points[:, 0]) * points[:, 1] ** 0.3 + 0.1 * rng.normal(size=40)
    data = checked_data(space, points, y, rng.uniform(0.5, 2.0, 40), [str(i % 3) for i in range(40)])
    search = StretchSearch(fit_polynomial(space, "y", data, full_terms(space, 2)))
    search.limit = 1.0
    identity = _identity_members(space, search.plain.coordinates, family)
    theta = theta_of(identity) + _limits(identity)[2]  # a typical departure
    value, slope = search._criterion_and_slope(theta, identity, search.rows)
    assert value == search._criterion(theta, identity, search.rows)
    step = 1e-3
    for found, axis in zip(slope, np.eye(len(theta)), strict=True):
        near, far = (
            search._criterion(theta + s * step * axis, identity, search.rows)
            - search._criterion(theta - s * step * axis, identity, search.rows)
            for s in (1.0, 2.0)
        )
        # right but for the fourth power of the step, and for rounding over each side's own step
        expected = (8.0 * near - far) / (12.0 * step)
        assert found == pytest.approx(expected, rel=1e-6, abs=1e-7 * abs(slope).max())


def test_a_stretch_that_overflows_is_refused_without_a_slope():
    plain = fit_polynomial(SPACE, "y", checked_data(SPACE, RUNS, Y, None, None), full_terms(SPACE))
    search = StretchSearch(plain)
    identity = _identity_members(search.plain.space, search.plain.coordinates, "exp")
    search.rows.u[0, 0] = np.nan
    value, slope = search._criterion_and_slope(theta_of(identity), identity, search.rows)
    assert value == search._criterion(theta_of(identity), identity, search.rows) == 1e6
    assert not slope.any()


def test_a_response_that_the_terms_fit_exactly_is_not_searched():
    terms = full_terms(SPACE)
    exact = terms.matrix(SPACE.encode(RUNS)) @ np.arange(1.0, 7.0)
    plain = fit_polynomial(SPACE, "y", checked_data(SPACE, RUNS, exact, None, None), terms)
    with pytest.raises(FitError, match="to rounding without a stretch"):
        StretchSearch(plain).find("exp")


def test_a_stretch_reaches_to_the_bounds_where_no_run_does():
    """Beyond its ends a stretch goes on straight, which no exponential or power does."""
    space = Space(a=(1.0, 3.0), b=(0.0, 10.0))
    inside = np.random.default_rng(6).uniform(0.1, 0.9, (24, 2)) * [2.0, 10.0] + [1.0, 0.0]
    corners = np.array([[1.0, 0.0], [1.0, 10.0], [3.0, 0.0], [3.0, 10.0]])

    def truth(x):
        return 2.0 + np.exp(0.9 * x[:, 0]) + 0.1 * x[:, 1] * np.exp(0.9 * x[:, 0])

    data = checked_data(space, inside, truth(inside), None, None)
    found = fit_stretched(space, "y", data, full_terms(space, 2), {"a": "exp"})
    np.testing.assert_allclose(found.predict(corners), truth(corners), rtol=1e-5)
    again = surface_from_json(json.loads(json.dumps(found.to_json())))
    np.testing.assert_array_equal(again.predict(corners), found.predict(corners))
    assert box_to_stretch(space, data, full_terms(space, 2), "natpower").low[0] == inside[:, 0].min()
