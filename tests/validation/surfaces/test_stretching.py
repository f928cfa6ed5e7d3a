"""Stretching done honestly: recovery, adoption, size of the tests, gain on standard functions."""

import json
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.special import fdtrc
from scipy.stats import binom
from surfaces_functions import SPACES, borehole, composite_and_d_optimal, holdout, reciprocal, rosenbrock

from rsmkit.errors import FitError, RsmkitError
from rsmkit.language.space import Factor, Space
from rsmkit.language.terms import full_terms
from rsmkit.surfaces.choose import Choice, choose_surface
from rsmkit.surfaces.estimation.coordinates import Coordinates
from rsmkit.surfaces.estimation.fit_data import checked_data
from rsmkit.surfaces.estimation.least_squares import two_sided_p
from rsmkit.surfaces.estimation.score_test import score_statistic
from rsmkit.surfaces.estimation.stretch import Stretch, with_theta
from rsmkit.surfaces.fitted_response import FittedResponse, surface_from_json
from rsmkit.surfaces.models.polynomial import fit_polynomial
from rsmkit.surfaces.models.stretch_search import StretchSearch
from rsmkit.surfaces.models.stretched import fit_stretched, stretched_at
from rsmkit.surfaces.options import SurfaceOptions
from rsmkit.surfaces.polynomial_fit import fit_surface
from rsmkit.surfaces.statistics.optima.canonical import canonical_analysis
from rsmkit.surfaces.statistics.terms.anova import partial_anova

SPACE = Space(a=(0.0, 1.0), b=(5.0, 10.0), c=(1.0, 3.0))
TERMS = full_terms(3, 2)
TRUTH = (1.5, -1.0, 0.0)
REPETITIONS = 200
"""Of a test whose size is looked at: true hypotheses rejected at 5 % then lie between 4 and 18, with 98 %."""
BETA = np.array([5, 3, 2, -1, 0.5, 0, -0.2, 2, 1, 0.0])  # a*c and c^2 are not there


def runs(n=50, seed=0):
    """Corners and Sobol-like filling, natural units."""
    cube = 2.0 * ((np.arange(8)[:, None] >> np.arange(3)) & 1) - 1.0
    return SPACE.decode(np.vstack([cube, np.random.default_rng(seed).uniform(-1, 1, (n - 8, 3))]))


def true_stretches():
    return tuple(
        Stretch("exp", (a,), low, high) for a, low, high in zip(TRUTH, SPACE.lows, SPACE.highs, strict=True)
    )


def truth(points):
    """A response that is exactly quadratic in the stretched factors, sigma of its values about 3."""
    return (
        TERMS.matrix(Coordinates(tuple(SPACE.lows), tuple(SPACE.highs), true_stretches()).forward(points))
        @ BETA
    )


@cache
def fitted(noise=0.1):
    """Stretched surface of 50 runs."""
    points = runs()
    y = truth(points) + noise * np.random.default_rng(0).normal(size=len(points))
    return fit_stretched(SPACE, "y", checked_data(SPACE, points, y), TERMS)


def naive_p_values(surface):
    """As if the stretch had been known: what must not be reported."""
    t = surface.fit.coefficients / surface.fit.std_errors
    return two_sided_p(t, surface.fit.df)


def test_a_stretch_without_noise_is_recovered():
    found = fitted(noise=0.0)
    theta = [s.parameters[0] if s.parameters else 0.0 for s in found.coordinates.stretches]
    np.testing.assert_allclose(theta, TRUTH, atol=0.05)
    total = ((found.fit.y - found.fit.y.mean()) ** 2).sum()
    assert found.nested_press / total < 1e-6
    assert found.adopted
    assert found.plain_press == pytest.approx(
        fit_surface(SPACE, found.data.points, found.data.y).fit.press, rel=1e-9
    )


def test_nested_error_equals_refitting_by_hand():
    points = runs(24)
    y = truth(points) + 0.1 * np.random.default_rng(1).normal(size=24)
    data = checked_data(SPACE, points, y)
    found = fit_stretched(SPACE, "y", data, TERMS)
    total = 0.0
    for i in range(24):
        rest = data.without(i)
        hull = found.coordinates
        search = StretchSearch(fit_polynomial(SPACE, "y", rest, TERMS, Coordinates(hull.low, hull.high)))
        members, _ = search.best(hull.stretches)
        surface = stretched_at(SPACE, "y", rest, TERMS, Coordinates(hull.low, hull.high, members), 0.0, 0.0)
        total += (y[i] - surface.predict(points[i : i + 1])[0]) ** 2
    assert found.nested_press == pytest.approx(total, rel=1e-3)


def test_joint_inference_equals_statsmodels_on_the_constructed_variables():
    """Recipe of Gauss and Newton with statsmodels alone: same covariance, same degrees of freedom."""
    import statsmodels.api as sm

    found = fitted()
    members, coordinates = found.coordinates.stretches, found.coordinates
    z = TERMS.matrix(coordinates.forward(found.data.points))
    b = np.linalg.lstsq(z, found.data.y, rcond=None)[0]
    extra = []
    for j, member in enumerate(members):
        if member.family == "identity":
            continue
        ends = []
        for sign in (1, -1):
            moved = list(members)
            moved[j] = Stretch("exp", (member.parameters[0] + sign * 1e-6,), member.low, member.high)
            ends.append(
                TERMS.matrix(
                    Coordinates(coordinates.low, coordinates.high, tuple(moved)).forward(found.data.points)
                )
                @ b
            )
        extra.append((ends[0] - ends[1]) / 2e-6)
    joint = np.column_stack([z, *extra])
    theta = np.r_[b, found.theta]
    fit = sm.OLS(found.data.y - z @ b + joint @ theta, joint).fit()
    assert found.fit.df == fit.df_resid == 50 - 10 - len(found.theta)
    unscaled = fit.bse / np.sqrt(fit.scale)
    np.testing.assert_allclose(found.std_errors / found.fit.sigma, unscaled, rtol=1e-5)


def test_gradient_and_stationary_point_in_natural_units():
    found = fitted()
    x = np.random.default_rng(3).uniform(SPACE.lows, SPACE.highs, (6, 3))
    for j in range(3):
        step = 1e-6 * np.eye(3)[j] * (SPACE.highs - SPACE.lows)
        slope = (found.predict(x + step) - found.predict(x - step)) / (2 * step[j])
        np.testing.assert_allclose(found.gradient(x)[:, j], slope, rtol=1e-5, atol=1e-6)
    natural = found.from_units(canonical_analysis(found).stationary)
    np.testing.assert_allclose(found.gradient(natural[None]), 0, atol=1e-8)
    assert FittedResponse(found).report()["stationary_point"]["natural"] == pytest.approx(
        dict(zip("abc", natural, strict=True))
    )


def test_star_points_outside_the_bounds_are_never_clamped():
    points = np.vstack([runs(40), SPACE.decode([[1.6, 0, 0], [-1.6, 0, 0], [0, 1.6, 0], [0, 0, -1.6]])])
    y = np.exp(SPACE.encode(points).sum(axis=1) / 2)
    found = fit_stretched(SPACE, "y", checked_data(SPACE, points, y), TERMS)
    z = found.coordinates.forward(points)
    assert np.abs(z).max() == pytest.approx(1.0, abs=1e-12)
    assert len(np.unique(z[-4:].round(9), axis=0)) == 4
    np.testing.assert_allclose(found.fit.fitted, found.predict(points), rtol=1e-12)


def test_json_round_trip_and_damage():
    found = fitted()
    data = json.loads(json.dumps(found.to_json(), allow_nan=False))
    again = surface_from_json(data)
    x = np.random.default_rng(3).uniform(SPACE.lows - 1, SPACE.highs + 1, (50, 3))
    for ours, theirs in zip(again.predict(x, interval=0.9), found.predict(x, interval=0.9), strict=True):
        np.testing.assert_array_equal(ours, theirs)
    assert again.report() == FittedResponse(found).report()
    for key, value in [
        ("stretches", []),
        ("stretches", [{}, {}, {}]),
        ("stretches", [{"family": "exp", "parameters": ["x"], "expression": ""}] * 3),
        ("stretches", [{"family": "exp", "parameters": [1.0], "expression": ""}] * 3),
        ("nested_press", "x"),
        ("plain_press", None),
    ]:
        with pytest.raises(RsmkitError):
            surface_from_json({**data, key: value})


def test_report_tells_what_was_stretched_and_what_it_bought():
    found = fitted()
    report = FittedResponse(found).report()
    json.dumps(report, allow_nan=False)
    assert report["units"] == "stretched"
    assert report["df"] == 50 - 10 - len(found.theta)
    assert [term["name"] for term in report["terms"]] == list(TERMS.names("abc"))
    a = report["stretch"]["factors"]["a"]["parameters"]["a"]
    assert a["low"] < 1.5 < a["high"]
    assert a["identity_excluded"]
    assert "a (exp: a = 1." in FittedResponse(found).summary()
    assert "adopted" in FittedResponse(found).summary()
    assert {row.source for row in partial_anova(found)} == {"FO", "TWI", "PQ", "stretch", "residual"}


def test_a_users_formula_and_factors_left_alone():
    points = runs()
    y = 1 / points[:, 2] + 0.3 / points[:, 2] ** 2 + points[:, 0] + 0.01 * np.sin(40 * points[:, 1])
    data = checked_data(SPACE, points, y)
    found = fit_stretched(SPACE, "y", data, TERMS, {"c": "1/x"})
    assert [s.family for s in found.coordinates.stretches] == ["identity", "identity", "fixed"]
    assert found.fit.df == 40
    assert found.adopted
    with pytest.raises(RsmkitError, match="d not among"):
        fit_stretched(SPACE, "y", data, TERMS, {"d": "exp"})


def test_stretching_is_refused_when_it_cannot_work():
    points = runs(16)
    with pytest.raises(FitError, match="at least 17 runs, there are 16"):
        fit_stretched(SPACE, "y", checked_data(SPACE, points, truth(points)), TERMS)
    points = runs(40)
    quadratic = TERMS.matrix(SPACE.encode(points)) @ BETA
    noisy = quadratic + 0.1 * np.random.default_rng(0).normal(size=40)
    with pytest.raises(FitError, match="no factor gains"):
        fit_stretched(SPACE, "y", checked_data(SPACE, points, noisy), TERMS)
    space = Space([Factor("tool", levels=("A", "B")), Factor("speed", levels=(1.0, 2.0))])
    two = np.random.default_rng(0).integers(0, 2, (20, 2)) + np.array([0.0, 1.0])
    with pytest.raises(FitError, match="no factor can be stretched"):
        fit_stretched(space, "y", checked_data(space, two, np.arange(20.0)), full_terms(space, 1))


@pytest.mark.slow
def test_an_exactly_quadratic_response_is_left_alone():
    """A stretch is adopted in one of ten at most; in none of 50 when last counted."""
    points = composite_and_d_optimal(SPACE)
    clean = TERMS.matrix(SPACE.encode(points)) @ np.array([5, 3, 2, -1, 0.5, 1, -0.2, 2, 1, 1.0])
    adopted = 0
    for seed in range(20):
        y = clean + 0.02 * clean.std() * np.random.default_rng(seed).normal(size=len(clean))
        choice = choose_surface(SPACE, points, y, options=SurfaceOptions(model="stretched"))
        adopted += choice.surface is not choice.polynomial
    assert adopted <= 2


def test_score_tests_equal_a_regression_on_derivatives_at_the_restricted_fit():
    """Of b^2 and of the stretch of a: restricted fit by Levenberg-Marquardt, then statsmodels."""
    import statsmodels.api as sm
    from scipy.optimize import leastsq

    found = fitted(noise=0.5)
    y, count = found.data.y, 10
    assert found.names[count] == "stretch[a].a"
    identity = found.coordinates.stretches

    def matrix(theta):
        return TERMS.matrix(
            Coordinates(found.coordinates.low, found.coordinates.high, with_theta(identity, theta)).forward(
                found.data.points
            )
        )

    def at(values, terms, free):
        theta = np.zeros(len(found.theta))
        theta[free] = values[len(terms) :]
        return matrix(theta)[:, terms] @ values[: len(terms)], theta

    for tested in (8, count):
        terms = [c for c in range(count) if c != tested]
        free = [c for c in range(len(found.theta)) if count + c != tested]
        start = np.r_[found.coefficients[terms], found.theta[free]]
        best = leastsq(lambda v, t=terms, f=free: y - at(v, t, f)[0], start, xtol=1e-12, ftol=1e-12)[0]
        mean, theta = at(best, terms, free)
        beta = np.zeros(count)
        beta[terms] = best[: len(terms)]
        step = 1e-6 * np.eye(len(theta))
        slopes = [(matrix(theta + h) - matrix(theta - h)) @ beta / 2e-6 for h in step]
        regression = sm.OLS(y - mean, np.column_stack([matrix(theta), *slopes])).fit()
        assert regression.df_resid == found.fit.df
        assert abs(found.t_values[tested]) == pytest.approx(abs(regression.tvalues[tested]), rel=1e-4)
        assert found.p_values[tested] == pytest.approx(regression.pvalues[tested], rel=1e-3)


def test_a_score_does_not_depend_on_where_its_restricted_fit_begins():
    """To the bit: the stretch it ends at is rounded to digits that every descent agrees on."""
    found = fitted(noise=0.5)
    for column in range(found.fit.p):
        expected = score_statistic(found, [column])
        for shift in (-1e-3, 0.05):
            elsewhere = SimpleNamespace(
                coordinates=found.coordinates,
                fit=found.fit,
                theta=found.theta + shift,
                matrix_at=found.matrix_at,
                changes_at=found.changes_at,
            )
            assert score_statistic(elsewhere, [column]) == expected


@pytest.mark.slow
def test_tests_keep_their_size_and_conditional_ones_do_not():
    """Coefficients of a*c and c^2 are zero, all three factors stretched; noise 1.5 and 15 % of spread."""
    points = runs()
    beta = np.array([5, 3, 2, 3, 0.5, 0, 1.5, 2, 1, 0.0])
    ends = list(zip(points.min(axis=0), points.max(axis=0), strict=True))
    true = tuple(Stretch("exp", (a,), *end) for a, end in zip((1.5, -1.0, 1.0), ends, strict=True))
    start = tuple(Stretch("exp", (0.0,), *end) for end in ends)
    lows, highs = zip(*ends, strict=True)
    clean = TERMS.matrix(Coordinates(lows, highs, true).forward(points)) @ beta
    honest, naive = [], []
    for seed in range(REPETITIONS):
        noise = (0.05, 0.5)[seed % 2]
        y = clean + noise * np.random.default_rng(seed).normal(size=len(clean))
        plain = fit_polynomial(SPACE, "y", checked_data(SPACE, points, y), TERMS)
        members, _ = StretchSearch(plain, seed=seed).best(start)
        surface = stretched_at(SPACE, "y", plain.data, TERMS, Coordinates(lows, highs, members), 0.0, 0.0)
        honest.append([fdtrc(1, surface.fit.df, score_statistic(surface, [c])) for c in (5, 9)])
        naive.append(naive_p_values(fit_polynomial(SPACE, "y", plain.data, TERMS, surface.coordinates))[9])
    rejected = (np.array(honest) < 0.05).sum(axis=0)
    low, high = binom.ppf((0.01, 0.99), REPETITIONS, 0.05)
    assert (rejected >= low).all()
    assert (rejected <= high).all()
    assert (np.array(naive) < 0.05).sum() > binom.ppf(1 - 1e-6, REPETITIONS, 0.05)


def test_power_stretch_on_the_borehole_function():
    space = SPACES[borehole]
    points, fresh = composite_and_d_optimal(space), holdout(space)
    y = borehole(points)
    plain = fit_surface(space, points, y)
    found = fit_stretched(space, "flow", checked_data(space, points, y), TERMS, "power")
    errors = [np.sqrt(np.mean((s.predict(fresh) - borehole(fresh)) ** 2)) for s in (found, plain)]
    assert found.adopted
    assert errors[0] < 0.4 * errors[1]


@pytest.mark.slow
@pytest.mark.parametrize(("function", "gaussian"), [(reciprocal, False), (rosenbrock, True)])
def test_auto_takes_the_model_that_fresh_points_confirm(function, gaussian):
    space = SPACES[function]
    points, fresh = composite_and_d_optimal(space), holdout(space)
    choice = choose_surface(
        space, points, function(points), response="y", options=SurfaceOptions(model="auto")
    )
    assert ("gaussian" in choice.table[0].model) == gaussian
    assert ("gaussian" in choice.sentence.split(",")[0]) == gaussian
    errors = [
        np.sqrt(np.mean((s.predict(fresh) - function(fresh)) ** 2))
        for s in (choice.surface, choice.polynomial)
    ]
    assert errors[0] < 0.5 * errors[1]
    again = Choice.from_json(json.loads(json.dumps(choice.to_json(), allow_nan=False)))
    np.testing.assert_array_equal(again.surface.predict(fresh), choice.surface.predict(fresh))
    np.testing.assert_array_equal(again.polynomial.predict(fresh), choice.polynomial.predict(fresh))
    assert again.table == choice.table or any(np.isnan(c.rmse_loo) for c in choice.table)


def test_plain_surfaces_are_linear_in_the_response_and_stretched_ones_are_not():
    points = runs()
    one, two = truth(points), np.exp(SPACE.encode(points)[:, 0])
    parts = [fit_surface(SPACE, points, y) for y in (one, two, 0.2 * one + 0.7 * two)]
    x = np.random.default_rng(3).uniform(SPACE.lows, SPACE.highs, (20, 3))
    np.testing.assert_allclose(
        0.2 * parts[0].predict(x) + 0.7 * parts[1].predict(x), parts[2].predict(x), rtol=1e-9
    )
    bent = []
    for part in parts:
        search = StretchSearch(fit_polynomial(SPACE, "y", part.data, TERMS))
        coordinates = Coordinates(part.coordinates.low, part.coordinates.high, search.find("exp"))
        bent.append(stretched_at(SPACE, "y", part.data, TERMS, coordinates, 0.0, 0.0))
    difference = 0.2 * bent[0].predict(x) + 0.7 * bent[1].predict(x) - bent[2].predict(x)
    assert np.abs(difference).max() > 1e-6
