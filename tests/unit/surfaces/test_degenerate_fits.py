"""Statistics where weights differ, where a run is fitted whatever it is, and where nothing is left over."""

import numpy as np
import pytest

from rsmkit.design.families.two_level.factorial import full_factorial
from rsmkit.language.space import Space
from rsmkit.language.terms import parse_terms
from rsmkit.surfaces.estimation.least_squares import least_squares
from rsmkit.surfaces.models.reduction.reduced import reduce_surface
from rsmkit.surfaces.polynomial_fit import fit_surface
from rsmkit.surfaces.statistics.intervals import tolerance_factor

SPACE = Space(a=(0.0, 1.0), b=(0.0, 1.0))


def test_press_counts_every_run_alike_and_is_given_weighted_too():
    """Every run left out in turn and predicted by numpy's least squares of the others."""
    rng = np.random.default_rng(3)
    x, weights = rng.random((12, 2)), rng.uniform(0.1, 5.0, 12)
    y = 1.0 + x @ [2.0, -1.0] + rng.normal(size=12) / np.sqrt(weights)
    matrix, root = np.column_stack([np.ones(12), x]), np.sqrt(weights)
    errors = []
    for i in range(12):
        kept = np.arange(12) != i
        beta = np.linalg.lstsq(matrix[kept] * root[kept, None], y[kept] * root[kept], rcond=None)[0]
        errors.append(y[i] - matrix[i] @ beta)
    squares, mean = np.array(errors) ** 2, np.average(y, weights=weights)
    fitted = fit_surface(SPACE, x, y, order=1, weights=weights)
    report = fitted.report()
    assert report["press_weighted"] == pytest.approx(weights @ squares, rel=1e-10)
    assert report["press"] == pytest.approx(squares.sum(), rel=1e-10)
    expected = 1 - weights @ squares / (weights @ (y - mean) ** 2)
    assert report["r2_predicted_weighted"] == pytest.approx(expected, rel=1e-10)
    expected = 1 - squares.sum() / ((y - y.mean()) ** 2).sum()
    assert report["r2_predicted"] == pytest.approx(expected, rel=1e-10)
    assert "weighted like the rest" in fitted.summary()


@pytest.mark.parametrize("seed", range(10))
def test_a_run_of_leverage_one_has_no_leave_one_out_figures(seed):
    """The last run alone tells the slope of b; its leverage is one up to rounding, above or below."""
    rng = np.random.default_rng(seed)
    scale, size = 10.0 ** rng.integers(-3, 5, 2)
    x = np.column_stack([rng.random(10), np.r_[np.full(9, 0.5), 0.9]]) * scale
    space = Space(a=(0.0, 1.0 * scale), b=(0.0, 1.0 * scale))
    report = fit_surface(space, x, size * rng.normal(size=10), order=1).report()
    for name in ("loo_residual", "studentised", "deleted", "cooks_distance", "dffits"):
        values = report["diagnostics"][name]
        assert values[-1] is None, name
        assert None not in values[:-1], name
    assert report["press"] is report["r2_predicted"] is None


def told(report, path=""):
    """Every t, F and p of a report that is a number."""
    if isinstance(report, dict):
        for key, value in report.items():
            if key in ("t", "F", "p") and value is not None:
                yield f"{path}/{key}"
            yield from told(value, f"{path}/{key}")
    elif isinstance(report, list):
        for index, value in enumerate(report):
            yield from told(value, f"{path}/{index}")


@pytest.mark.parametrize("weights", [None, np.arange(1.0, 13.0)])
def test_an_exact_fit_has_no_tests(weights):
    cube = Space(a=(0.0, 9.0), b=(-1.0, 1.0), c=(2.0, 3.0))
    x = full_factorial(cube, center=4).points
    y = 3.0 + 0.1 * x[:, 0] - 0.7 * x[:, 1] + x[:, 0] * x[:, 1]
    terms = parse_terms(cube, ["FO", "TWI"])
    fitted = fit_surface(cube, x, y, terms=terms, deterministic=False, weights=weights)
    report = fitted.report()
    assert "rounding errors" in report["note"]
    assert list(told(report)) == []
    noise = fit_surface(cube, x, y + 1e-9 * np.cos(np.arange(12)), terms=terms, deterministic=False)
    assert {"/model_test/p", "/terms/0/t"} <= set(told(noise.report()))


def test_a_response_that_varies_by_rounding_only():
    """0.1 + 0.2 is not 0.3, but nothing is explained."""
    x = np.random.default_rng(1).random((8, 2))
    report = fit_surface(SPACE, x, np.where(x[:, 0] > 0.5, 0.1 + 0.2, 0.3), order=1).report()
    assert report["r2"] is report["r2_adjusted"] is report["r2_predicted"] is None


def test_terms_are_not_chosen_by_rounding_errors():
    """A response that is exactly 3 + 2a leaves nothing for the other terms but rounding."""
    for seed in range(5):
        x = np.random.default_rng(seed).random((20, 2))
        full = fit_surface(SPACE, x, 3.0 + 2.0 * x[:, 0])
        for method in ("aicc", "backward", "forward", "all"):
            assert reduce_surface(full.surface, method).surface.names == ("1", "a"), (seed, method)


# R: source of package tolerance 3.0; K.factor(n, f, alpha, P, side = 2, method = "EXACT", m = 500)
@pytest.mark.parametrize(
    ("n", "df", "alpha", "share", "factor"),
    [
        (10, 9, 0.05, 0.95, 3.39342948),
        (2, 1, 0.05, 0.95, 36.51921461),
        (5, 4, 0.01, 0.99, 10.22009031),
        (50, 49, 0.05, 0.95, 2.38155974),
        (1000, 999, 0.05, 0.90, 1.70876152),
        (4, 40, 0.05, 0.95, 2.83426709),
        (1.2, 30, 0.05, 0.95, 3.68561472),
        (0.5, 12, 0.05, 0.90, 4.68289784),
        (2, 500, 0.05, 0.95, 3.04511651),
    ],
)
def test_exact_tolerance_factors(n, df, alpha, share, factor):
    """One leverage, and the same among so many that a polynomial through a few stands for all."""
    assert tolerance_factor([1 / n], df, share, 1 - alpha)[0] == pytest.approx(factor, rel=1e-8)
    many = np.r_[1 / n, np.linspace(0.01, 2.0, 99)]
    assert tolerance_factor(many, df, share, 1 - alpha)[0] == pytest.approx(factor, rel=1e-5)


@pytest.mark.parametrize(("n", "is_finite"), [(4, False), (5, False), (6, True)])
def test_the_corrected_criterion_is_infinite_until_a_run_more_than_parameters_is_there(n, is_finite):
    """Three coefficients and sigma; the correction divides by n - 5, which is negative before."""
    x = np.arange(n) / n
    fit = least_squares(np.column_stack([np.ones(n), x, x**3]), np.cos(7.0 * x), names="abc")
    assert fit.aicc == (pytest.approx(fit.aic + 2 * 4 * 5 / (n - 5)) if is_finite else np.inf)


def test_columns_that_add_up_to_one_are_a_constant():
    """Of mixtures; one of them alone is none, and its sum of squares is not about the mean."""
    rng = np.random.default_rng(5)
    matrix = rng.dirichlet([1.0, 1.0, 1.0], 9)
    y = matrix @ [3.0, 5.0, 9.0] + 0.1 * rng.normal(size=9)
    mixture = least_squares(matrix, y, names="abc", has_constant=False)
    assert mixture.tss == pytest.approx(((y - y.mean()) ** 2).sum(), rel=1e-12)
    alone = least_squares(matrix[:, :2], y, names="ab", has_constant=False)
    assert alone.tss == pytest.approx((y**2).sum(), rel=1e-12)
