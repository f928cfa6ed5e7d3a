"""Polynomials of runs in random groups: boundary, refusals, predictions, files, tables."""

import json
import math

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from rsmkit.errors import FitError, RsmkitError
from rsmkit.language.space import Factor, Space
from rsmkit.language.terms import full_terms
from rsmkit.surfaces.estimation.mixed.error_contrasts import error_contrasts, indicators
from rsmkit.surfaces.estimation.mixed.kenward_roger import Inference
from rsmkit.surfaces.estimation.mixed.reml import random_groups, reml
from rsmkit.surfaces.fitted_response import surface_from_json
from rsmkit.surfaces.polynomial_fit import fit_surface
from rsmkit.surfaces.statistics.terms.mixed_tests import mixed_term_tests
from rsmkit.surfaces.tables.table_fit import fit_table

SPACE = Space([Factor("oven", -1.0, 1.0), Factor("t", -1.0, 1.0)])


def split_plot(levels, runs=4, plot_sd=2.0, run_sd=1.0, seed=3):
    """One oven setting per plot, `runs` times in each; points, responses, labels."""
    rng = np.random.default_rng(seed)
    plots = np.repeat(np.arange(len(levels)), runs)
    points = np.column_stack([np.array(levels, float)[plots], np.tile(np.linspace(-1, 1, runs), len(levels))])
    shifts = plot_sd * rng.normal(size=len(levels))
    y = 50 + 5 * points[:, 0] + 2 * points[:, 1] + shifts[plots] + run_sd * rng.normal(size=len(plots))
    return points, y, [f"p{i}" for i in plots]


def fitted(levels, order=1, degrees="kenward-roger", **request):
    points, y, plots = split_plot(levels, **request)
    return fit_surface(
        SPACE, points, y, order=order, random={"plot": plots}, degrees=degrees, deterministic=False
    )


def test_a_balanced_split_plot_is_that_of_the_analysis_of_variance():
    """Mean squares by hand: within plots for t, between plots for oven."""
    levels = [-1, 1, -1, 1, -1, 1]
    points, y, _ = split_plot(levels)
    surface = fitted(levels).surface
    means = y.reshape(6, 4).mean(axis=1)
    fit = np.polyfit(levels, means, 1)
    between = 4 * float(((means - np.polyval(fit, levels)) ** 2).sum()) / 4
    slope = float((points[:, 1] * y).sum() / (points[:, 1] ** 2).sum())
    within = y.reshape(6, 4) - means[:, None] - slope * points[:4, 1]
    own = float((within**2).sum()) / (24 - 6 - 1)
    assert surface.mixed.variances == pytest.approx([(between - own) / 4, own], rel=1e-9)
    assert surface.coefficients == pytest.approx([fit[1], fit[0], slope], rel=1e-10)
    assert surface.degrees_of_freedom == pytest.approx([4, 4, 17], rel=1e-9)
    oven, t = mixed_term_tests(surface)
    assert oven.type3.f == pytest.approx(fit[0] ** 2 * 24 / between, rel=1e-9)
    assert t.type3.f == pytest.approx(slope**2 * float((points[:, 1] ** 2).sum()) / own, rel=1e-9)
    assert oven.type2.f == pytest.approx(oven.type3.f)


def test_four_degrees_of_freedom_are_found_although_rho_is_infinite_there():
    """Six whole plots: the plot factor is tested by the means of the plots, on exactly four."""
    plots = np.repeat(np.arange(6), 4)
    points = np.column_stack([np.where(plots % 2, 1.0, -1.0), np.tile([-1.0, 1.0, 0.0, 1.0], 6)])
    rng = np.random.default_rng(0)
    y = rng.normal(size=6)[plots] + rng.normal(size=24)
    space = Space([Factor("a", -1.0, 1.0), Factor("b", -1.0, 1.0)])
    labels = {"plot": [str(i) for i in plots]}
    found = fit_surface(space, points, y, order=1, random=labels, deterministic=False).report()
    means = y.reshape(6, 4).mean(axis=1)
    low, high = means[::2], means[1::2]
    noise = (((low - low.mean()) ** 2).sum() + ((high - high.mean()) ** 2).sum()) / 4
    test = found["anova_terms"][0]
    assert test["denominator_df"] == pytest.approx(4.0, abs=1e-9)
    assert test["F"] == pytest.approx(1.5 * (high.mean() - low.mean()) ** 2 / noise, rel=1e-8)


def test_a_variance_of_zero_is_zero_and_said():
    """Plots whose means are the same but for the oven: the derivative at zero is positive."""
    points, y, plots = split_plot([-1, 1, -1, 1, -1, 1], plot_sd=0.0)
    y = y.reshape(6, 4)
    y -= (y.mean(axis=1) - 50 - 5 * points[::4, 0])[:, None]
    found = fit_surface(SPACE, points, y.ravel(), order=1, random={"plot": plots}, deterministic=False)
    assert found.surface.mixed.variances[0] == 0
    plain = fit_surface(SPACE, points, y.ravel(), order=1, deterministic=False)
    np.testing.assert_allclose(found.coefficients, plain.coefficients, rtol=1e-12)
    np.testing.assert_allclose(found.std_errors, plain.std_errors, rtol=1e-12)
    assert "variance of plot is zero" in found.report()["note"]
    assert "ordinary least squares" in found.summary()
    assert found.report()["variance_components"][0]["low"] == 0


def test_a_test_without_whole_plots_left_is_refused_in_words():
    found = fitted([-1, 1])
    oven, t = found.report()["anova_terms"]
    assert oven["p"] is oven["F"] is oven["denominator_df"] is None
    assert "no degrees of freedom are left between the groups of plot" in oven["reason"]
    assert t["denominator_df"] == pytest.approx(8 - 3)
    constant, slope, within = found.report()["terms"]
    assert constant["std_error"] is slope["p"] is slope["high"] is None
    assert within["p"] < 0.05
    assert "no test of oven" in found.summary()
    assert np.isinf(found.predict(SPACE.decode([[0.0, 0.0]]), 0.95)[1]).all()
    plot, run = found.report()["variance_components"]
    assert plot.pop("name") == "plot"
    assert set(plot.values()) == {None}
    assert run["share"] is None  # of a total that nobody knows
    assert run["std_error"] > 0
    assert fitted([-1, 1], degrees="satterthwaite").report()["anova_terms"][0]["p"] is None


@pytest.mark.parametrize(
    ("labels", "message"),
    [
        ({"plot": ["a"] * 8}, "one group only"),
        ({"plot": list("abcdefgh")}, "every run is a group of its own"),
        ({"plot": list("aabbccdd"), "day": list("wwxxyyzz")}, "day and plot are the same groups"),
        ({"plot": list("aab")}, "3 labels for 8 runs"),
    ],
)
def test_groups_that_tell_nothing_are_refused(labels, message):
    points, y, _ = split_plot([-1, 1])
    with pytest.raises(FitError, match=message):
        fit_surface(SPACE, points, y, order=1, random=labels, deterministic=False)


def test_exact_runs_are_refused():
    points, _, plots = split_plot([-1, 1, 0])
    with pytest.raises(FitError, match="describe the runs exactly"):
        fit_surface(SPACE, points, 3 + points[:, 0], order=1, random={"plot": plots}, deterministic=False)
    shifted = 3 + points[:, 0] + np.repeat([0.0, 0.5, -0.7], 4)
    with pytest.raises(FitError, match="agree with the terms exactly"):
        fit_surface(SPACE, points, shifted, order=1, random={"plot": plots}, deterministic=False)


def test_profile_intervals_end_where_the_deviance_has_risen_by_the_quantile():
    surface = fitted([-1, 1, -1, 1, -1, 1]).surface
    contrasts, best = surface.mixed.contrasts, surface.mixed.variances
    lowest = contrasts.deviance(best)[0]
    for which, other in ((0, 1), (1, 0)):
        for limit in surface.variance_intervals(0.9)[which]:
            full = best.copy()

            def deviance(log, full=full, which=which, other=other, limit=limit):
                full[which], full[other] = limit, math.exp(log)
                return contrasts.deviance(full)[0]

            risen = minimize_scalar(deviance, bracket=(-3.0, 3.0), tol=1e-12).fun - lowest
            assert risen == pytest.approx(2.705543454095404, rel=1e-6)  # chi2(1) at 0.9, tables


def test_predictions_in_old_plots_follow_hendersons_equations():
    surface = fitted([-1, 1, -1, 1, -1, 1]).surface
    x, z, (plot, own) = surface.matrix, surface.mixed.columns[0], surface.mixed.variances
    both = np.hstack([x, z])
    inverse = np.linalg.inv(both.T @ both / own + np.diag([0.0] * 3 + [1 / plot] * 6))
    solution = inverse @ both.T @ surface.data.y / own
    point = np.array([[-1.0, 0.3]])
    row = np.r_[1.0, -1.0, 0.3, np.eye(6)[2]]
    mean, low, high = surface.predict_in(point, {"plot": "p2"}, 0.95)
    assert mean == pytest.approx(row @ solution, rel=1e-10)
    half = 0.5 * float((high - low)[0])
    error = math.sqrt(row @ inverse @ row + own)
    assert 2.05 < half / error < 2.2  # quantiles of t with more than 10 and fewer than 60 df
    _, new_low, new_high = surface.predict(point, 0.95)
    assert float((new_high - new_low)[0]) > 2 * half
    with pytest.raises(RsmkitError, match="plot must be"):
        surface.predict_in(point, {"plot": "p9"}, 0.95)


def test_several_effects_follow_from_dense_matrices():
    """Gradient and information of the small matrices are those of the large ones."""
    rng = np.random.default_rng(7)
    x = np.column_stack([np.ones(12), rng.normal(size=12)])
    z = [indicators(np.array([0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2])), indicators(np.arange(12) % 4)]
    y = rng.normal(size=12)
    theta = np.array([0.7, 0.3, 1.1])
    contrasts = error_contrasts(x, y, z)
    parts = [*(a @ a.T for a in z), np.eye(12)]
    v = sum(t * part for t, part in zip(theta, parts, strict=True))
    inverse = np.linalg.inv(v)
    p = inverse - inverse @ x @ np.linalg.solve(x.T @ inverse @ x, x.T @ inverse)
    _, gradient = contrasts.deviance(theta)
    dense = [np.trace(p @ part) - y @ p @ part @ p @ y for part in parts]
    np.testing.assert_allclose(gradient, dense, rtol=1e-10)
    expected = [[np.trace(p @ a @ p @ b) for a in parts] for b in parts]
    np.testing.assert_allclose(contrasts.information(theta), expected, rtol=1e-10)
    observed = [[2 * y @ p @ a @ p @ b @ p @ y - np.trace(p @ a @ p @ b) for a in parts] for b in parts]
    np.testing.assert_allclose(contrasts.observed_information(theta), observed, rtol=1e-9, atol=1e-12)


def test_runs_left_out_are_left_out():
    points, y, plots = split_plot([-1, 1, -1, 1, -1, 1])
    surface = fitted([-1, 1, -1, 1, -1, 1]).surface
    rest = np.arange(1, 24)
    labels = random_groups({"plot": [plots[i] for i in rest]})
    without = reml(surface.matrix[rest], y[rest], labels, variances=surface.mixed.variances)
    expected = y[0] - float(surface.matrix[0] @ without.coefficients)
    assert surface.loo_residuals[0] == pytest.approx(expected, rel=1e-10)
    assert surface.predictions_without(points[:1])[0, 0] == pytest.approx(y[0] - expected, rel=1e-10)
    errors, about = surface.loo_residuals, y - y.mean()
    share = fitted([-1, 1, -1, 1, -1, 1]).report()["r2_predicted"]
    assert share == pytest.approx(1.0 - float(errors @ errors) / float(about @ about))


def test_it_is_the_same_again_from_its_file():
    found = fitted([-1, 1, -1, 0, 0, 1], order=2, degrees="satterthwaite")
    document = json.loads(json.dumps(found.to_json(), allow_nan=False))
    again = surface_from_json(document)
    assert again.report() == found.report()
    for key, value in (("variances", [1.0]), ("variances", [-1.0, 1.0]), ("variances", [90.0, 1.0])):
        with pytest.raises(RsmkitError, match="surface model"):
            surface_from_json({**document, key: value})


def test_many_runs_do_not_take_long_and_keep_their_numbers():
    """Four hundred plots: variances near those they were made with, 3 standard errors either way."""
    surface = fitted([-1, 1, 0, 1] * 40, order=2, seed=11).surface
    plot, own = surface.mixed.variances
    assert abs(plot - 4.0) < 3 * 4.25 * math.sqrt(2 / 157)
    assert abs(own - 1.0) < 3 * math.sqrt(2 / 476)


def test_inference_needs_full_rows_only():
    surface = fitted([-1, 1, -1, 1, -1, 1]).surface
    inference = Inference(surface.mixed)
    single = inference.test(np.eye(3)[1:2])
    assert single.f == pytest.approx(float(surface.t_values[1]) ** 2, rel=1e-9)
    assert single.p == pytest.approx(float(surface.p_values[1]), rel=1e-9)
    assert len(full_terms(SPACE, 1)) == 3


# ---------------------------------------------------------------- tables


@pytest.fixture
def table(tmp_path):
    points, y, plots = split_plot([-1, 1, -1, 1, -1, 1])
    days = ["mon" if plot in ("p0", "p1") else "tue" if plot in ("p2", "p3") else "wed" for plot in plots]
    rows = zip(points.tolist(), y.tolist(), plots, days, strict=True)
    lines = [f"{a},{b},{value!r},{plot},{day}" for (a, b), value, plot, day in rows]
    path = tmp_path / "runs.csv"
    path.write_text("\n".join(["oven,t,y,plot,day", *lines]) + "\n")
    return path


def test_a_table_with_random_groups(table):
    found = fit_table(table, ["oven", "t"], ["y"], order=1, random=["plot"])
    report = found.report()["responses"]["y"]
    assert [row["name"] for row in report["variance_components"]] == ["plot", "residual"]
    assert report["anova_terms"][0]["numerator_df"] == 1
    assert report["anova_terms"][0]["denominator_df"] == pytest.approx(4)
    assert "6 random groups of plot" in found.summary()
    both = fit_table(table, ["oven", "t"], ["y"], order=1, random=["plot", "day"]).report()
    assert len(both["responses"]["y"]["variance_components"]) == 3


def test_a_random_column_is_one_thing_only(table):
    with pytest.raises(RsmkitError, match=r"column day is named twice; .*random groups"):
        fit_table(table, ["oven", "t"], ["y"], blocks="day", random=["day"])


def test_the_command_line_takes_random_groups(table, capsys):
    from rsmkit.cli import main

    words = ["fit", "--data", str(table), "--factors", "oven,t", "--response", "y", "--order", "1"]
    with pytest.raises(SystemExit) as end:
        main([*words, "--random", "plot", "--random", "day", "--degrees", "satterthwaite", "--json"])
    assert end.value.code == 0
    report = json.loads(capsys.readouterr().out)["responses"]["y"]
    assert report["degrees_of_freedom"] == "satterthwaite"
    assert set(report["random"]) == {"plot", "day"}
