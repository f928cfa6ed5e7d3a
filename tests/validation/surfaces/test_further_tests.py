"""Several terms at once, means within levels, dispersion effects, the curve of Box and Cox, multipliers."""

import numpy as np
import pytest
from surfaces_data import DATA

import rsmkit as rk
from rsmkit.errors import RsmkitError
from rsmkit.surfaces.statistics.optima.canonical import quadratic_form

PUBLISHED = DATA / "published"
WITHIN = {
    "T1, A - T2, A": (19.57142857142859, 5.20946503559819, 0.0014917087849369),
    "T1, A - T3, A": (17.23809523809527, 5.75109367948741, 0.0124122811174966),
    "T2, A - T3, A": (-2.33333333333332, 5.4481889436399, 0.9040758074378670),
    "T1, B - T2, B": (-2.15277777777777, 5.02298201776196, 0.9039446974723762),
    "T1, B - T3, B": (9.44444444444444, 4.87300833289664, 0.1406501114516104),
    "T2, B - T3, B": (11.59722222222221, 5.02298201776196, 0.0655007424529718),
}
"""Of R's emmeans: difference, standard error, p by Tukey."""


@pytest.fixture(scope="module")
def cars():
    """R's mtcars: mpg ~ cyl * am + x + I(x^2), x = (wt - 3.5) / 1.5."""
    fitted = rk.fit_table(
        PUBLISHED / "mtcars.csv",
        ["cyl", "am", "wt"],
        ["mpg"],
        coding={"wt": (3.5, 1.5)},
        terms=["FO", "cyl*am", "wt^2"],
        together=["cyl*am", "PQ"],
    )
    return fitted.surfaces["mpg"], fitted


def test_terms_together_are_the_difference_of_two_models(cars):
    """R: anova(lm(mpg ~ am + cyl + x), lm(mpg ~ cyl * am + x + I(x^2)))."""
    _, fitted = cars
    found = fitted.answers["mpg"]["together"]
    assert found["terms"] == ["cyl*am", "wt^2"]
    assert found["df"] == [3, 24]
    assert found["ss"] == pytest.approx(32.05822506178, rel=1e-10)
    assert found["F"] == pytest.approx(1.6994607129175192, rel=1e-10)
    assert found["p"] == pytest.approx(0.1937957240604929, rel=1e-10)
    assert "cyl*am, wt^2 together: sum of squares" in fitted.summary()


def test_one_term_is_its_test_of_type_three(cars):
    surface, _ = cars
    for test in rk.term_tests(surface):
        row = rk.extra_sum_of_squares(surface, [test.term])
        assert (row.ss, row.f, row.p) == pytest.approx((test.type3.ss, test.type3.f, test.type3.p), rel=1e-12)


def test_the_error_of_another_model(cars):
    surface, _ = cars
    larger = rk.fit_table(
        PUBLISHED / "mtcars.csv", ["cyl", "am", "wt"], ["mpg"], coding={"wt": (3.5, 1.5)}, terms=["SO"]
    ).surfaces["mpg"]
    own, other = (rk.extra_sum_of_squares(surface, ["wt^2"], error=error) for error in (None, larger.surface))
    assert other.ss == own.ss
    assert other.f == pytest.approx(own.ss / larger.fit.sigma**2)


def test_blocks_and_groups():
    fitted = rk.fit_table(PUBLISHED / "npk.csv", ["N", "P", "K"], ["yield"], blocks="block", order=1)
    surface = fitted.surfaces["yield"]
    block = rk.extra_sum_of_squares(surface, ["block"])
    assert block.ss == pytest.approx(surface.report()["anova_partial"]["block"]["ss"], rel=1e-10)
    linear = rk.extra_sum_of_squares(surface, ["FO"])
    assert (linear.source, linear.df) == ("N, P, K", 3)
    with pytest.raises(RsmkitError, match=r"N\*P is not in the model, whose terms are block, N, P, K"):
        rk.extra_sum_of_squares(surface, ["N*P"])


def test_differences_within_the_levels_of_another_factor():
    """R: pairs(emmeans(lm(breaks ~ wool * tension, d), ~ tension | wool)), six rows left out."""
    path = PUBLISHED / "warpbreaks.csv"
    left_out = [1, 5, 20, 21, 22, 40]
    fitted = rk.fit_table(path, ["wool", "tension"], ["breaks"], exclude=left_out, means=["tension|wool"])
    found = fitted.answers["breaks"]["means"]["tension|wool"]["differences"]
    assert len(found) == 6
    rows = {row["pair"]: row for row in found}
    for pair, (difference, error, p) in WITHIN.items():
        assert rows[pair]["difference"] == pytest.approx(difference, rel=1e-8)
        assert rows[pair]["std_error"] == pytest.approx(error, rel=1e-8)
        assert rows[pair]["p"] == pytest.approx(p, abs=1e-7)  # what ptukey is good for


def test_a_contrast_of_combinations():
    """A simple effect: two tensions at one wool."""
    fitted = rk.fit_table(
        PUBLISHED / "warpbreaks.csv",
        ["wool", "tension"],
        ["breaks"],
        means=["tension|wool"],
        compare=['wool*tension: "A, T1=1", "A, T2=-1"'],
    )
    (contrast,) = fitted.answers["breaks"]["contrasts_of_means"]
    differences = fitted.answers["breaks"]["means"]["tension|wool"]["differences"]
    (pair,) = [row for row in differences if row["pair"] == "T1, A - T2, A"]
    assert contrast["estimate"] == pytest.approx(pair["difference"])
    assert contrast["t"] == pytest.approx(pair["t"])


def test_dispersion_effects_of_the_moulding_experiment():
    """Montgomery (2013), example 8.4 and table 8.12: shrinkage, spread of the residuals at both levels."""
    fitted = rk.fit_table(PUBLISHED / "injection_molding.csv", list("ABCDEF"), ["y"], terms=["A*B"])
    found = {effect.name: effect for effect in rk.dispersion_effects(fitted.surfaces["y"])}
    assert (round(found["C"].low, 2), round(found["C"].high, 2)) == (1.63, 5.70)
    assert round(found["C"].log_ratio, 2) == 2.50
    printed = {"B": -0.19, "B*D = C*F": -0.19, "A*C = B*E": -0.41}
    assert {name: round(found[name].log_ratio, 2) for name in printed} == printed
    report = fitted.report()["responses"]["y"]["dispersion"]["effects"]
    assert report[2]["std_dev_low"] == found["C"].low


def test_where_there_is_no_dispersion_to_compare():
    fitted = rk.fit_table(PUBLISHED / "battery.csv", ["material", "temperature"], ["life"])
    assert "more than two levels" in fitted.report()["responses"]["life"]["dispersion"]["reason"]


PEAK = [
    [0.34, 0.12, 1.23, 0.70, 1.75, 0.12],
    [0.91, 2.94, 2.14, 2.36, 2.86, 4.55],
    [6.31, 8.37, 9.75, 6.09, 9.82, 7.24],
    [17.15, 11.82, 10.95, 17.20, 14.35, 16.82],
]
"""Montgomery (2013), table 3.7: peak discharge by four methods."""


def test_the_curve_of_box_and_cox(tmp_path):
    """Montgomery (2013), table 15.1: error sum of squares after each power."""
    path = tmp_path / "peak.csv"
    path.write_text("method,y\n" + "\n".join(f"m{i},{y}" for i, row in enumerate(PEAK) for y in row) + "\n")
    curve = rk.fit_table(path, ["method"], ["y"], order=1).report()["responses"]["y"]["box_cox"]["curve"]
    found = dict(zip(curve["power"], curve["sse"], strict=True))
    printed = {
        -1.0: 7922.11,
        -0.5: 687.10,
        -0.25: 232.52,
        0.0: 91.96,
        0.25: 46.99,
        0.5: 35.42,
        0.75: 40.61,
        1.0: 62.08,
        1.25: 109.82,
        1.5: 208.12,
    }
    assert {power: round(found[power], 2) for power in printed} == printed


def test_the_multiplier_of_a_ridge_path():
    """Every point solves (B - mu I) x = -b/2, mu above the largest eigenvalue for a maximum."""
    table = rk.fit_table(DATA / "montgomery_ccd.csv", ["x1", "x2"], ["y1"], columns="coded")
    surface = table.surfaces["y1"].surface
    path = rk.ridge_path(surface, [0.0, 0.1, 0.3], "maximize")
    _, b, curvature = quadratic_form(surface)
    assert np.isnan(path.multipliers[0])
    for x, multiplier in zip(path.coded[1:], path.multipliers[1:], strict=True):
        np.testing.assert_allclose((curvature - multiplier * np.eye(2)) @ x, -0.5 * b, rtol=1e-9)
        assert multiplier > np.linalg.eigvalsh(curvature)[-1]
    points = table.report()["responses"]["y1"]["ascent"]["points"]
    assert points[0]["multiplier"] is None
    assert points[1]["multiplier"] > points[2]["multiplier"]
