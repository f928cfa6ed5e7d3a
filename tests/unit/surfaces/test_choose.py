"""Reduced, Box-Cox and Gaussian-process surfaces, intervals, and the choice among models."""

import itertools
import json
from dataclasses import replace

import numpy as np
import pytest
import statsmodels.api as sm
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, Matern, WhiteKernel

from rsmkit.errors import FitError, RsmkitError
from rsmkit.language.space import Factor, Space
from rsmkit.language.terms import full_terms
from rsmkit.surfaces.choose import Choice, ModelScore, choose_surface
from rsmkit.surfaces.estimation.fit_data import checked_data
from rsmkit.surfaces.fitted_response import FittedResponse, surface_from_json
from rsmkit.surfaces.models.box_cox import fit_box_cox
from rsmkit.surfaces.models.gaussian_process import fit_gaussian_process
from rsmkit.surfaces.models.reduction.reduced import reduce_surface
from rsmkit.surfaces.models.reduction.reduced_errors import nested_errors
from rsmkit.surfaces.models.stretched import StretchedSurface, fit_stretched
from rsmkit.surfaces.options import SurfaceOptions
from rsmkit.surfaces.polynomial_fit import fit_surface
from rsmkit.surfaces.statistics.intervals import simultaneous_band, tolerance_interval

SPACE = Space(a=(0.0, 2.0), b=(-1.0, 5.0))
CODED = np.random.default_rng(7).uniform(-1, 1, (24, 2))
POINTS = SPACE.decode(CODED)
NOISE = 0.2 * np.random.default_rng(8).normal(size=24)
SPARSE = 5 + 2 * CODED[:, 0] + 1.5 * CODED[:, 0] ** 2 + NOISE  # b does nothing
X = SPACE.decode(np.random.default_rng(9).uniform(-1.2, 1.2, (40, 2)))


def round_trip(model):
    surface = FittedResponse(model)
    again = surface_from_json(json.loads(json.dumps(surface.to_json(), allow_nan=False)))
    for ours, theirs in zip(again.predict(X, interval=0.9), surface.predict(X, interval=0.9), strict=True):
        np.testing.assert_array_equal(ours, theirs)
    assert again.to_json() == surface.to_json()
    json.dumps(surface.report(), allow_nan=False)
    return again


def numeric_gradient(surface, points):
    slopes = np.empty_like(points)
    for j, size in enumerate(SPACE.highs - SPACE.lows):
        step = 1e-6 * size * np.eye(len(SPACE))[j]
        slopes[:, j] = (surface.predict(points + step) - surface.predict(points - step)) / (2e-6 * size)
    return slopes


# ---------------------------------------------------------------- reduction


def hierarchical_subsets(terms):
    for size in range(1, len(terms) + 1):
        for subset in itertools.combinations(terms.exponents, size):
            chosen = terms.subset(subset)
            if chosen.hierarchical:
                yield chosen


@pytest.mark.parametrize("method", ["backward", "forward", "aicc", "all"])
def test_reduction_keeps_what_is_there_and_the_hierarchy(method):
    found = reduce_surface(fit_surface(SPACE, POINTS, SPARSE), method)
    assert found.surface.terms.hierarchical
    assert {"1", "a", "a^2"} <= set(found.surface.names)
    assert set(found.dropped) | set(found.surface.names) == {"1", "a", "b", "a*b", "a^2", "b^2"}
    assert "b^2" in found.dropped
    assert found.steps
    assert "optimistic" in FittedResponse(found.surface).report()["note"]
    assert round_trip(found.surface).note == found.surface.note


@pytest.mark.parametrize("weights", [None, np.resize([1.0, 3.0], 24)])
def test_all_subsets_finds_the_least_aicc_of_statsmodels(weights):
    full = fit_surface(SPACE, POINTS, SPARSE, weights=weights)
    w = np.ones(24) if weights is None else weights
    scores = {}
    for terms in hierarchical_subsets(full.terms):
        fit = sm.WLS(SPARSE, terms.matrix(CODED), weights=w).fit()
        q = terms.p + 1
        scores[terms.exponents] = -2 * fit.llf + 2 * q + 2 * q * (q + 1) / (24 - q - 1)
    best = min(scores, key=scores.get)
    found = reduce_surface(full, "all")
    assert set(found.surface.terms.exponents) == set(best)
    assert found.surface.fit.aicc == pytest.approx(scores[best], rel=1e-9)
    assert str(len(scores)) in found.steps[0]


def test_backward_elimination_stops_where_every_removable_term_is_significant():
    found = reduce_surface(fit_surface(SPACE, POINTS, SPARSE), "backward", alpha=0.05)
    p = dict(zip(found.surface.names, found.surface.p_values, strict=True))
    assert p["a^2"] < 0.05
    kept_all = reduce_surface(fit_surface(SPACE, POINTS, SPARSE), "backward", alpha=1.0)
    assert kept_all.dropped == ()


def test_reduction_with_blocks_keeps_the_blocks():
    labels = ["1", "2"] * 12
    y = SPARSE + np.array([3.0 * (label == "2") for label in labels])
    found = reduce_surface(fit_surface(SPACE, POINTS, y, blocks=labels))
    assert found.surface.names[:2] == ("1", "block[2]")
    assert found.surface.coefficients[1] == pytest.approx(3, abs=0.3)


def test_nested_error_of_a_reduction_is_not_smaller_than_its_own_press():
    full = fit_surface(SPACE, POINTS, SPARSE)
    errors = nested_errors(full)
    assert errors @ errors >= 0.99 * reduce_surface(full).surface.fit.press


def reduced_without(run, full, method, y):
    """Error of the terms chosen and fitted without a run, each fit from nothing."""
    rest = np.delete(np.arange(len(y)), run)
    blocks = full.data.blocks
    weights = None if full.data.weights is None else full.data.weights[rest]
    labels = None if blocks is None else [blocks[i] for i in rest]
    points = full.data.points
    again = fit_surface(full.space, points[rest], y[rest], weights=weights, blocks=labels)
    terms = reduce_surface(again, method).surface.terms
    coded = full.space.encode(points)
    matrix = np.column_stack([terms.matrix(coded), full.data.block_columns()])
    root = np.ones(len(rest)) if weights is None else np.sqrt(weights)
    beta = np.linalg.lstsq(matrix[rest] * root[:, None], y[rest] * root, rcond=None)[0]
    return y[run] - matrix[run] @ beta


@pytest.mark.parametrize(
    ("method", "weights", "blocks", "noise"),
    [
        ("aicc", None, None, 1.0),
        ("aicc", np.resize([1.0, 3.0, 0.5], 24), None, 0.1),
        ("aicc", None, ["1", "2"] * 12, 1.0),
        ("backward", None, ["1", "2"] * 12, 1.0),
    ],
)
def test_nested_errors_choose_the_terms_again_without_each_run(method, weights, blocks, noise):
    rng = np.random.default_rng(4)
    space = Space([Factor("a", -1, 1), Factor("b", 0, 10), Factor("tool", levels=["x", "y", "z"])])
    points = np.column_stack([rng.uniform(-1, 1, 24), rng.uniform(0, 10, 24), np.arange(24) % 3])
    y = 5 + points[:, 0] - 2 * points[:, 0] ** 2 + (points[:, 2] == 1) + noise * rng.normal(size=24)
    y += 100.0 * (np.array(blocks) == "2") if blocks else 0.0
    full = fit_surface(space, points, y, weights=weights, blocks=blocks).surface
    brute = [reduced_without(run, full, method, y) for run in range(24)]
    np.testing.assert_allclose(nested_errors(full, method), brute, rtol=1e-9, atol=1e-11)


# ---------------------------------------------------------------- Box-Cox


def test_box_cox_surface_is_the_transformed_polynomial_read_back():
    y = np.exp(0.4 * SPARSE)
    found = fit_box_cox(SPACE, "y", checked_data(SPACE, POINTS, y), full_terms(2, 2))
    assert found.power == 0.0  # the interval holds the logarithm
    log = fit_surface(SPACE, POINTS, np.log(y))
    (median, low, high), theirs = found.predict(X, interval=0.9), np.exp(log.predict(X, interval=0.9))
    np.testing.assert_allclose(median, theirs[0], rtol=1e-9)
    assert (low < theirs[1]).all()  # the power was estimated too
    assert (high > theirs[2]).all()
    np.testing.assert_allclose(found.gradient(X), numeric_gradient(found, X), rtol=1e-4, atol=1e-4)
    round_trip(found)
    assert "Box-Cox power 0" in FittedResponse(found).summary()
    assert FittedResponse(found).report()["press"] == found.nested_press


def test_box_cox_power_that_is_not_zero():
    y = (3 + 0.2 * SPARSE) ** 2
    found = fit_box_cox(SPACE, "y", checked_data(SPACE, POINTS, y), full_terms(2, 2))
    np.testing.assert_allclose(found.y, y, rtol=1e-10)
    np.testing.assert_allclose(found.gradient(X), numeric_gradient(found, X), rtol=1e-4, atol=1e-4)
    data = found.to_json()
    with pytest.raises(RsmkitError, match="between -5 and 5"):
        surface_from_json({**data, "power": 50.0})


def test_box_cox_and_stretch_together():
    """The exponential of a quadratic in a stretched factor: either alone leaves an error, both do not."""
    y = np.exp(0.3 * np.exp(1.5 * CODED[:, 0]) + CODED[:, 1])
    data, terms = checked_data(SPACE, POINTS, y), full_terms(2, 2)
    found = fit_box_cox(SPACE, "y", data, terms, "exp")
    assert isinstance(found.inner, StretchedSurface)
    assert found.inner.adopted
    alone = [fit_box_cox(SPACE, "y", data, terms), fit_stretched(SPACE, "y", data, terms)]
    assert found.nested_press < 0.01 * min(other.nested_press for other in alone)
    np.testing.assert_allclose(found.gradient(X), numeric_gradient(found, X), rtol=1e-4, atol=1e-3)
    round_trip(found)
    with pytest.raises(RsmkitError, match="inner should be"):
        surface_from_json({**found.to_json(), "inner": found.to_json()})


# ---------------------------------------------------------------- Gaussian process


@pytest.mark.parametrize("kernel", ["matern52", "rbf"])
def test_gaussian_process_predicts_as_scikit_learn_with_the_same_kernel(kernel):
    data = checked_data(SPACE, POINTS, np.sin(3 * CODED[:, 0]) + CODED[:, 1] + 0.1 * NOISE)
    fitted = fit_gaussian_process(SPACE, "y", data, kernel)
    found = replace(fitted, kriging="simple")  # the mean taken as known, as there
    shape = Matern(found.lengths, "fixed", nu=2.5) if kernel == "matern52" else RBF(found.lengths, "fixed")
    white = WhiteKernel(found.nugget * found.variance, "fixed")
    center, scale = data.y.mean(), data.y.std()
    z = found.coordinates.forward(POINTS)
    model = GaussianProcessRegressor(
        ConstantKernel(found.variance, "fixed") * shape + white, alpha=0, optimizer=None
    )
    model.fit(z, (data.y - center) / scale)
    mean, sd = model.predict(found.coordinates.forward(X), return_std=True)
    ours, low, high = found.predict(X, interval=0.95)
    np.testing.assert_allclose(ours, center + scale * mean, rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(high - low, 2 * 1.959963984540054 * scale * sd * found.calibration, rtol=1e-5)
    assert found.log_likelihood == pytest.approx(model.log_marginal_likelihood_value_, rel=1e-8)
    for i in (0, 11):
        keep = np.delete(np.arange(24), i)
        model.fit(z[keep], (data.y[keep] - center) / scale)
        left_out = data.y[i] - (center + scale * model.predict(z[i : i + 1])[0])
        assert found.loo_residuals[i] == pytest.approx(left_out, rel=1e-6, abs=1e-8)
    for surface in (fitted, found):
        round_trip(surface)
        np.testing.assert_allclose(surface.gradient(X), numeric_gradient(surface, X), rtol=1e-4, atol=1e-4)
        assert "nugget" in FittedResponse(surface).summary()


def test_files_that_say_nothing_of_the_mean_hold_a_process_about_the_average():
    found = fit_gaussian_process(SPACE, "y", checked_data(SPACE, POINTS, SPARSE))
    document = found.to_json()
    assert document.pop("kriging") == "ordinary"
    about_the_average = replace(found, kriging="simple")
    np.testing.assert_array_equal(
        surface_from_json(document).predict(X, interval=0.9), about_the_average.predict(X, interval=0.9)
    )


def test_gaussian_process_with_categories_and_what_it_refuses():
    space = Space([Factor("x", 0.0, 1.0), Factor("tool", levels=("A", "B"))])
    points = np.column_stack([np.tile(np.linspace(0, 1, 8), 2), np.repeat([0.0, 1.0], 8)])
    y = np.sin(4 * points[:, 0]) + 2 * points[:, 1]
    found = fit_gaussian_process(space, "y", checked_data(space, points, y))
    np.testing.assert_allclose(found.predict(points), y, atol=1e-2)
    assert (found.gradient(points)[:, 1] == 0).all()
    with pytest.raises(FitError, match="does not model blocks"):
        fit_gaussian_process(space, "y", checked_data(space, points, y, blocks=["1"] * 16))
    with pytest.raises(FitError, match="at least three different runs"):
        fit_gaussian_process(space, "y", checked_data(space, points[[0, 0, 1]], y[[0, 0, 1]]))
    data = found.to_json()
    for key, value in [
        ("kernel", "cubic"),
        ("lengths", [1.0]),
        ("variance", -1.0),
        ("nugget", None),
        ("kriging", "universal"),
        ("low", [2, 2]),
    ]:
        with pytest.raises(RsmkitError):
            surface_from_json({**data, key: value})


# ---------------------------------------------------------------- intervals


@pytest.mark.parametrize(("n", "factor"), [(10, 3.393429), (20, 2.760346), (50, 2.381560)])
def test_tolerance_factor_of_a_plain_sample(n, factor):
    """Two-sided 95 %/95 % exact normal factors: R tolerance, K.factor(n, 0.05, 0.95, 2, "EXACT").

    That of n = 20 by scipy.integrate.quad: R stops 3e-5 short of it.
    """
    space = Space(x=(0.0, 1.0))
    y = np.random.default_rng(n).normal(size=n)
    sample = fit_surface(space, np.linspace(0, 1, n)[:, None], y, terms=full_terms(1, 0))
    _, low, high = tolerance_interval(sample, [[0.5]])
    assert (high - low)[0] / 2 / y.std(ddof=1) == pytest.approx(factor, rel=2e-6)


def test_simultaneous_bands():
    """F(0.95; 2, 8) = 4.459 and t(1 - 0.05/6; 8) = 3.016 from the tables."""
    space = Space(x=(0.0, 1.0))
    x = np.linspace(0, 1, 10)[:, None]
    line = fit_surface(space, x, x[:, 0] + 0.1 * np.random.default_rng(0).normal(size=10), order=1)
    at = np.array([[0.0], [0.4], [1.0]])
    spread = line.fit.sigma * np.sqrt(line.leverage(at))
    for method, width in (("scheffe", np.sqrt(2 * 4.459)), ("bonferroni", 3.016)):
        _, low, high = simultaneous_band(line, at, method=method)
        np.testing.assert_allclose((high - low) / 2 / spread, width, rtol=1e-3)
    with pytest.raises(RsmkitError, match="between 0 and 1"):
        simultaneous_band(line, at, confidence=95)
    saturated = fit_surface(space, x[:2], x[:2, 0], order=1)
    with pytest.raises(RsmkitError, match="no degrees of freedom"):
        tolerance_interval(saturated, at)


# ---------------------------------------------------------------- choice


@pytest.mark.parametrize(
    ("model", "response", "chosen"),
    [
        ("polynomial", SPARSE, "polynomial"),
        ("reduced", SPARSE, "reduced"),
        ("box-cox", np.exp(SPARSE), "box-cox"),
        ("box-cox", -SPARSE, "polynomial"),
        ("stretched box-cox", np.exp(0.3 * np.exp(1.5 * CODED[:, 0]) + CODED[:, 1]), "stretched box-cox"),
        ("stretched", SPARSE, "polynomial"),
        ("stretched", np.exp(2 * CODED[:, 0]) + CODED[:, 1], "stretched"),
    ],
)
def test_a_model_asked_for_is_fitted_or_refused_with_a_reason(model, response, chosen):
    choice = choose_surface(SPACE, POINTS, response, response="heat", options=SurfaceOptions(model=model))
    assert choice.sentence.startswith(f"heat: {chosen}")
    assert (choice.surface is choice.polynomial) == (chosen == "polynomial")
    report = choice.report()
    json.dumps(report, allow_nan=False)
    assert (report["chosen"] is None) == (chosen == "polynomial")
    assert choice.sentence in choice.summary()
    again = Choice.from_json(json.loads(json.dumps(choice.to_json(), allow_nan=False)))
    np.testing.assert_array_equal(again.surface.predict(X), choice.surface.predict(X))
    assert again.sentence == choice.sentence
    with pytest.raises(RsmkitError):
        Choice.from_json({**choice.to_json(), "table": [["x", "y"]]})


def test_options_are_checked():
    assert SurfaceOptions().problems() == []
    assert SurfaceOptions("stretched", stretch="1/sqrt(x)", stretch_factors={"a": "power"}).problems() == []
    assert [key for key, _ in SurfaceOptions(stretch="1/sqrt(x)").problems()] == ["stretch"]
    problems = SurfaceOptions("stretched", stretch="spline", stretch_factors={"a": "tanh2"}).problems()
    assert [key for key, _ in problems] == ["stretch", "stretch_factors.a"]
    terms = choose_surface(SPACE, POINTS, SPARSE, options=SurfaceOptions(terms=("FO", "a^2"))).polynomial
    assert terms.names == ("1", "a", "b", "a^2")


def test_the_model_chosen_is_called_by_its_word():
    polynomial = fit_surface(SPACE, POINTS, SPARSE)
    words = ("box-cox", "stretched box-cox", "stretched", "stretched (power)", "polynomial")
    table = tuple(ModelScore(word, 1.0) for word in words)
    for word in words:
        told = Choice(polynomial, polynomial, table, f"y: {word}, with a leave-one-out error of 1.")
        assert told.model == word
        again = Choice.from_form(told.to_form())
        assert again.model == word
    reduced = choose_surface(SPACE, POINTS, SPARSE, options=SurfaceOptions(model="reduced"))
    assert reduced.model == "reduced"
    assert reduced.surface.report()["model"] == "polynomial"


def test_runs_count_by_their_weights_in_the_comparison():
    """Weights of 2 are what running twice would be; a run of next to no weight says next to nothing."""
    weights = np.where(np.arange(24) < 3, 1e-6, 2.0)
    wild = SPARSE + np.where(np.arange(24) < 3, 40.0, 0.0)
    options = SurfaceOptions(model="reduced", order=2)
    choice = choose_surface(SPACE, POINTS, wild, options=options, weights=weights)
    plain = next(row for row in choice.table if row.model == "polynomial")
    errors = choice.polynomial.fit.loo_residuals
    assert plain.rmse_loo == pytest.approx(np.sqrt(weights @ errors**2 / weights.sum()), rel=1e-12)
    assert plain.rmse_loo < 1.0 < np.sqrt((errors**2).mean())


def test_a_process_in_many_factors_needs_no_quadratic():
    """28 terms and 20 runs: the process is fitted, a straight polynomial stands beside it, and it is said."""
    space = Space([Factor(f"x{i}", -1.0, 1.0) for i in range(6)])
    points = np.random.default_rng(3).uniform(-1.0, 1.0, (20, 6))
    y = points[:, 0] + np.sin(3 * points[:, 1])
    choice = choose_surface(space, points, y, options=SurfaceOptions(model="gaussian process"))
    assert choice.surface.predict(points) == pytest.approx(y, abs=0.2)
    assert choice.polynomial.surface.terms.order == 1
    assert "order 1: 20 runs cannot tell the 28 terms of order 2 apart" in choice.sentence
    with pytest.raises(FitError, match="28 terms"):
        choose_surface(space, points, y, options=SurfaceOptions(model="reduced"))


def test_terms_that_failed_runs_leave_alike_are_left_out_and_named():
    corners = np.array(list(itertools.product([0.0, 2.0], [-1.0, 5.0])))
    points = np.vstack([corners, [[1.0, 2.0], [1.5, 3.5]]])  # coded, a^2 = b^2 at each
    line = 1 + points[:, 0] - points[:, 1]
    with pytest.raises(FitError, match="tell apart"):
        choose_surface(SPACE, points, line)
    choice = choose_surface(SPACE, points, line, failed_runs=3)
    assert choice.left_out == "Left out: b^2; 3 runs failed, and the other 6 cannot tell it from other terms."
    np.testing.assert_allclose(choice.surface.predict(points), line, atol=1e-12)
    assert choose_surface(SPACE, POINTS, SPARSE, failed_runs=3).left_out == ""
    with pytest.raises(FitError):  # these were asked for by name
        choose_surface(SPACE, points[:3], line[:3], options=SurfaceOptions(terms=("SO",)), failed_runs=3)
