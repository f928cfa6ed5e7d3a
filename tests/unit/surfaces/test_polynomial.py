"""Polynomial surfaces: against statsmodels, against closed forms, and what they refuse."""

import copy
import json

import numpy as np
import pytest
import statsmodels.api as sm
from statsmodels.stats.outliers_influence import OLSInfluence

from rsmkit.errors import FitError, RsmkitError
from rsmkit.language.space import Factor, Space
from rsmkit.language.terms import Terms, full_terms
from rsmkit.surfaces.fitted_response import surface_from_json
from rsmkit.surfaces.models.surface import Surface
from rsmkit.surfaces.polynomial_fit import fit_surface
from rsmkit.surfaces.statistics.statsmodels_results import statsmodels_results
from rsmkit.surfaces.statistics.terms.anova import lack_of_fit

SPACE = Space(theta_deg=(5.0, 10.0), radius_m=(0.15, 0.30))


def composite(star=1.4142, centers=1):
    """Central composite design in natural units, stars outside the bounds."""
    axis = [[-star, 0], [star, 0], [0, -star], [0, star]]
    cube = [[-1, -1], [1, -1], [-1, 1], [1, 1]]
    return SPACE.decode(np.array(cube + axis + [[0, 0]] * centers, float))


def noisy(points, seed=0, noise=0.3):
    c = SPACE.encode(points)
    clean = 10 + 2 * c[:, 0] - c[:, 1] + 0.5 * c[:, 0] * c[:, 1] + 1.5 * c[:, 0] ** 2 + c[:, 1] ** 2
    return clean + noise * np.random.default_rng(seed).normal(size=len(c))


@pytest.fixture(scope="module")
def surface():
    points = np.vstack([composite(centers=4), SPACE.decode(np.random.default_rng(5).uniform(-1, 1, (8, 2)))])
    return fit_surface(SPACE, points, noisy(points), response="heat")


def test_exact_polynomial_is_recovered_also_outside_the_bounds():
    points = composite()
    found = fit_surface(SPACE, points, noisy(points, noise=0))
    np.testing.assert_allclose(found.coefficients, [10, 2, -1, 0.5, 1.5, 1], rtol=1e-12)
    far = SPACE.decode([[1.9, -2.1]])
    np.testing.assert_allclose(found.predict(far), noisy(far, noise=0), rtol=1e-12)


def test_statistics_equal_statsmodels_in_coded_units(surface):
    fit = sm.OLS(surface.data.y, surface.coded_matrix).fit()
    influence = OLSInfluence(fit)
    pairs = [
        (surface.coefficients, fit.params),
        (surface.std_errors, fit.bse),
        (surface.t_values, fit.tvalues),
        (surface.p_values, fit.pvalues),
        (surface.covariance, fit.cov_params()),
        (surface.confidence_intervals(0.9), fit.conf_int(0.1)),
        (surface.fit.leverages, influence.hat_matrix_diag),
        (surface.fit.loo_residuals, influence.resid_press),
        (surface.fit.cooks_distances, influence.cooks_distance[0]),
        (surface.fit.dffits, influence.dffits[0]),
        (surface.fit.deleted, influence.resid_studentized_external),
        ([surface.fit.aic - 2, surface.fit.log_likelihood], [fit.aic, fit.llf]),  # sigma counts here, as in R
    ]
    for ours, theirs in pairs:
        np.testing.assert_allclose(ours, theirs, rtol=1e-9)
    np.testing.assert_allclose(statsmodels_results(surface).params, surface.coefficients, rtol=1e-10)


def test_press_equals_brute_force_refits(surface):
    total = 0.0
    for i in range(len(surface.data)):
        keep = np.arange(len(surface.data)) != i
        part = fit_surface(SPACE, surface.data.points[keep], surface.data.y[keep], deterministic=False)
        total += (surface.data.y[i] - part.predict(surface.data.points[i : i + 1])[0]) ** 2
    assert surface.fit.press == pytest.approx(total, rel=1e-10)


def test_gradient_in_natural_units(surface):
    x = SPACE.decode(np.random.default_rng(2).uniform(-1, 1, (4, 2)))
    for j, step in enumerate([1e-5, 1e-7]):
        up, down = x.copy(), x.copy()
        up[:, j] += step
        down[:, j] -= step
        slope = (surface.predict(up) - surface.predict(down)) / (2 * step)
        np.testing.assert_allclose(surface.gradient(x)[:, j], slope, rtol=1e-6, atol=1e-6)


def test_coefficients_do_not_depend_on_how_far_the_units_are_from_zero():
    """Absolute temperature, pressure and a length: condition number 1e20 without coding."""
    space = Space(T_K=(1272.65, 1273.65), p_Pa=(101315.0, 101335.0), d_m=(7.24e-3, 7.26e-3))
    coded = np.random.default_rng(0).uniform(-1, 1, (30, 3))
    terms, beta = full_terms(3, 2), np.arange(1.0, 11.0)
    found = fit_surface(space, space.decode(coded), terms.matrix(coded) @ beta)
    np.testing.assert_allclose(found.coefficients, beta, rtol=1e-9)


def test_repeated_runs_of_a_deterministic_simulator_count_once():
    points = composite(centers=5)
    y = noisy(points, noise=0) + 0.1 * np.sin(SPACE.encode(points)).sum(axis=1)
    once, many = fit_surface(SPACE, points[:-4], y[:-4]), fit_surface(SPACE, points, y)
    assert many.fit.df == once.fit.df == 3
    assert many.fit.sigma == once.fit.sigma
    assert many.report()["duplicates_left_out"] == 4
    assert "4 repeated runs agree exactly" in lack_of_fit(many).absent
    assert fit_surface(SPACE, points, y, deterministic=False).fit.df == 7
    y[-1] += 0.01
    assert fit_surface(SPACE, points, y).fit.df == 7
    assert "no run is repeated" in lack_of_fit(once).absent


def test_aliased_terms_are_refused_by_name():
    cube = SPACE.decode([[-1, -1], [1, -1], [-1, 1], [1, 1], [0, 0], [0, 0], [0, 0]])
    with pytest.raises(FitError, match=r"response heat: .*radius_m\^2 \(same as theta_deg\^2\)"):
        fit_surface(SPACE, cube, np.arange(7.0), response="heat", deterministic=False)


def test_a_factor_that_never_varies_is_refused_by_name():
    points = np.column_stack([np.linspace(5, 10, 8), np.full(8, 0.2)])
    with pytest.raises(FitError, match=r"radius_m \(same as 1\)"):
        fit_surface(SPACE, points, np.arange(8.0), order=1)


def test_too_few_runs_are_refused_with_the_number_needed():
    with pytest.raises(FitError, match=r"theta_deg\^2 \(same as 1\).* Add at least 2 more"):
        fit_surface(SPACE, composite()[:4], np.arange(4.0))


def test_failed_runs_must_be_left_out():
    y = np.arange(9.0)
    y[3] = np.nan
    with pytest.raises(FitError, match="run 4: the response value"):
        fit_surface(SPACE, composite(), y)
    with pytest.raises(FitError, match="shape"):
        fit_surface(SPACE, composite(), y[:5])
    with pytest.raises(FitError, match="weights must be positive"):
        fit_surface(SPACE, composite(), np.arange(9.0), weights=np.zeros(9))


def test_saturated_fit_has_no_statistics_but_predicts():
    points = composite()[[0, 1, 2, 4, 6, 8]]
    found = fit_surface(SPACE, points, noisy(points))
    mean, low, high = found.predict(points, interval=0.95)
    np.testing.assert_allclose(mean, noisy(points), rtol=1e-9)
    assert np.isneginf(low).all()
    assert np.isposinf(high).all()
    report = found.report()
    assert report["sigma"] is None
    assert report["terms"][0]["p"] is None
    json.dumps(report, allow_nan=False)


def test_wrong_points_and_confidence_are_refused(surface):
    with pytest.raises(RsmkitError, match=r"need shape \(n, 2\)"):
        surface.predict([1.0, 2.0])
    with pytest.raises(RsmkitError, match="between 0 and 1"):
        surface.predict(composite(), interval=95)


def test_categorical_factor_against_separate_fits_per_level():
    space = Space([Factor("x", 0.0, 4.0), Factor("tool", levels=("A", "B", "C"))])
    rng = np.random.default_rng(3)
    points = np.column_stack([rng.uniform(0, 4, 30), np.repeat([0, 1, 2], 10)])
    y = rng.normal(size=30)
    terms = Terms(((0, 0), (1, 0), (0, 1), (1, 1)), (0, 3))
    found = fit_surface(space, points, y, terms=terms)
    for level in range(3):
        mine = points[:, 1] == level
        line = np.polyfit(points[mine, 0], y[mine], 1)
        at = np.column_stack([np.linspace(0, 4, 5), np.full(5, level)])
        np.testing.assert_allclose(found.predict(at), np.polyval(line, at[:, 0]), rtol=1e-10, atol=1e-12)
    assert found.names == ("1", "x", "tool[B]", "tool[C]", "x*tool[B]", "x*tool[C]")
    assert (found.gradient(at)[:, 1] == 0).all()


def test_json_round_trip_is_exact(surface):
    again = surface_from_json(json.loads(json.dumps(surface.to_json(), allow_nan=False)))
    assert isinstance(again, Surface)
    x = SPACE.decode(np.random.default_rng(9).uniform(-2, 2, (50, 2)))
    for ours, theirs in zip(again.predict(x, interval=0.9), surface.predict(x, interval=0.9), strict=True):
        np.testing.assert_array_equal(ours, theirs)
    assert again.to_json() == surface.to_json()
    assert again.report() == surface.report()


def broken(data):
    """Every way of removing or replacing one top-level value, and some inside."""
    for key in data:
        for value in (None, "text", -7, [], {}, [1.0, "x"], [[1.0], [1.0, 2.0]], float("nan"), [[[[[1]]]]]):
            if value != data[key]:
                yield {**data, key: value}
        yield {k: v for k, v in data.items() if k != key}
    for part in ("y", "points"):
        changed = copy.deepcopy(data)
        changed["runs"][part] = changed["runs"][part][:-1]
        yield changed
    changed = copy.deepcopy(data)
    changed["coefficients"][0] *= 1.01
    yield changed
    changed = copy.deepcopy(data)
    changed["factor"][0][0] *= 1.5
    yield changed
    yield from ([], None, 3, "x", {})


def test_any_damage_to_the_json_gives_one_clear_error(surface):
    free_text = [{**surface.to_json(), key: "text"} for key in ("response", "note")]
    assert surface_from_json(free_text[0]).response == "text"
    for data in broken(surface.to_json()):
        if data in free_text:
            continue
        with pytest.raises(RsmkitError):
            surface_from_json(data)


def test_summary_and_notebook_table_name_every_term(surface):
    text, table = surface.summary(), surface._repr_html_()
    for name in surface.names:
        assert name in text
        assert name in table
    assert "Stationary point (minimum, inside the bounds)" in text
    assert "lack of fit" in text


@pytest.mark.parametrize("y", [np.full(9, 5.0), np.zeros(9), np.arange(9.0)])
@pytest.mark.parametrize("order", [1, 2])
def test_responses_without_noise_or_without_variation_have_a_report(y, order):
    found = fit_surface(SPACE, composite(), y, order=order)
    report = found.report()
    json.dumps(report, allow_nan=False)
    assert found.summary()
    assert surface_from_json(json.loads(json.dumps(found.to_json(), allow_nan=False))).report() == report


def test_report_leads_along_the_steepest_path_and_the_ridge(surface):
    report = surface.report()
    start, best = report["descent"]["points"][:2]
    assert report["descent"]["kind"] == "ridge"
    assert best["predicted"] < start["predicted"]
    assert list(best["natural"]) == ["theta_deg", "radius_m"]
    line = fit_surface(SPACE, surface.data.points, surface.data.y, order=1).report()["ascent"]
    assert line["kind"] == "straight"
    assert report["box_cox"]["low"] < report["box_cox"]["power"] < report["box_cox"]["high"]


def test_reports_of_very_many_runs_leave_out_what_grows_with_their_square():
    x = SPACE.decode(np.random.default_rng(0).uniform(-1, 1, (2_001, 2)))
    report = fit_surface(SPACE, x, noisy(x)).report()
    assert "more than 2,000 runs" in report["intervals"]["reason"]
