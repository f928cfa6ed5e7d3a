"""Sums of mean squares, and the single figures beside R2."""

from __future__ import annotations

import numpy as np
import pytest

import rsmkit as rk

# Made up: two readings of each of 4 parts by 3 operators.
READINGS = np.array(
    [[20, 21, 19, 22, 20, 20], [24, 25, 23, 24, 25, 26], [19, 20, 20, 18, 19, 21], [22, 22, 24, 23, 21, 24]],
    float,
)


@pytest.fixture(scope="module")
def gauge() -> rk.FittedResponse:
    space = rk.Space(part=["1", "2", "3", "4"], operator=["1", "2", "3"])
    points = np.array([(p, o) for p in range(4) for o in range(3) for _ in range(2)], float)
    return rk.fit_surface(
        space, points, READINGS.ravel(), terms=rk.parse_terms(space, ["FO", "TWI"]), deterministic=False
    )


@pytest.fixture(scope="module")
def by_hand() -> dict[str, float]:
    """Mean squares of the balanced layout from its means."""
    cells = READINGS.reshape(4, 3, 2)
    grand, parts, operators = cells.mean(), cells.mean((1, 2)), cells.mean((0, 2))
    both = cells.mean(2) - parts[:, None] - operators[None] + grand
    return {
        "part": 6 * ((parts - grand) ** 2).sum() / 3,
        "operator": 8 * ((operators - grand) ** 2).sum() / 2,
        "part*operator": 2 * (both**2).sum() / 6,
        "residual": ((cells - cells.mean(2, keepdims=True)) ** 2).sum() / 12,
    }


def test_a_variance_from_two_mean_squares(gauge: rk.FittedResponse, by_hand: dict) -> None:
    """(MS_part - MS_part:operator) / 6, its error, Satterthwaite's degrees of freedom."""
    found = rk.mean_square_sum(gauge.surface, {"part": 1, "part*operator": -1}, divisor=6)
    a, b = by_hand["part"], by_hand["part*operator"]
    assert found.value == pytest.approx((a - b) / 6, rel=1e-12)
    assert found.std_error == pytest.approx(np.sqrt(2 * a**2 / 3 + 2 * b**2 / 6) / 6, rel=1e-12)
    assert found.df == pytest.approx((a - b) ** 2 / (a**2 / 3 + b**2 / 6), rel=1e-12)
    inside = rk.mean_square_sum(gauge.surface, {"part*operator": 1, "residual": -1}, divisor=2)
    assert found.covariance(inside) == pytest.approx(-2 * b**2 / 6 / 12, rel=1e-12)


def test_one_mean_square_has_its_own_degrees_of_freedom(gauge: rk.FittedResponse, by_hand: dict) -> None:
    """12 residual degrees of freedom: chi-squared 4.403789 and 23.33666 (R: qchisq(c(.025, .975), 12))."""
    error = rk.mean_square_sum(gauge.surface, {"residual": 1})
    assert error.df == pytest.approx(12, rel=1e-12)
    low, high = error.limits()
    assert low == pytest.approx(12 * by_hand["residual"] / 23.33666, rel=1e-6)
    assert high == pytest.approx(12 * by_hand["residual"] / 4.403789, rel=1e-6)


def test_f_against_an_interaction(gauge: rk.FittedResponse, by_hand: dict) -> None:
    parts = rk.mean_square_sum(gauge.surface, {"part": 1})
    both = rk.mean_square_sum(gauge.surface, {"part*operator": 1})
    test = parts.over(both)
    assert test.f == pytest.approx(by_hand["part"] / by_hand["part*operator"], rel=1e-12)
    assert (test.numerator_df, test.denominator_df) == pytest.approx((3, 6), rel=1e-12)


def test_pooled_terms_are_one_mean_square(gauge: rk.FittedResponse, by_hand: dict) -> None:
    """Operators as if nested in parts: 4 x 2 degrees of freedom."""
    found = rk.mean_square_sum(gauge.surface, {"operator + part*operator": 1})
    assert found.dfs == {"operator + part*operator": 8}
    pooled = (2 * by_hand["operator"] + 6 * by_hand["part*operator"]) / 8
    assert found.value == pytest.approx(pooled, rel=1e-12)


def test_what_cannot_be_added_is_refused(gauge: rk.FittedResponse) -> None:
    with pytest.raises(rk.RsmkitError, match="name at least one"):
        rk.mean_square_sum(gauge.surface, {})
    with pytest.raises(rk.RsmkitError, match="numbers but zero"):
        rk.mean_square_sum(gauge.surface, {"part": 0})
    with pytest.raises(rk.RsmkitError, match="neither a group"):
        rk.mean_square_sum(gauge.surface, {"day": 1})
    negative = rk.mean_square_sum(gauge.surface, {"residual": -1})
    with pytest.raises(rk.RsmkitError, match="above zero"):
        negative.limits()
    with pytest.raises(rk.RsmkitError, match="above zero"):
        negative.over(negative)


def test_single_figures_of_a_fit(gauge: rk.FittedResponse, by_hand: dict) -> None:
    """Sums of squares about zero add up; shares are those of the total about the mean."""
    report = gauge.report()
    zero, total = report["about_zero"], float(((READINGS - READINGS.mean()) ** 2).sum())
    assert zero["total"] == {"df": 24, "ss": pytest.approx(float((READINGS**2).sum()), rel=1e-12)}
    assert zero["mean"]["ss"] == pytest.approx(24 * READINGS.mean() ** 2, rel=1e-12)
    assert zero["model"]["ss"] + 12 * by_hand["residual"] == pytest.approx(zero["total"]["ss"], rel=1e-12)
    part = next(row for row in report["anova_terms"] if row["term"] == "part")
    assert part["type2"]["share"] == pytest.approx(3 * by_hand["part"] / total, rel=1e-12)
    means = READINGS.reshape(4, 3, 2).mean(2)
    spread = np.ptp(means) / np.sqrt(by_hand["residual"] * 12 / 24)
    assert report["adequate_precision"] == pytest.approx(spread, rel=1e-12)
    residuals = (READINGS.reshape(4, 3, 2) - means[..., None]).ravel()
    watson = (np.diff(residuals) ** 2).sum() / (residuals**2).sum()
    assert report["durbin_watson"] == pytest.approx(watson, rel=1e-9)


def test_an_effect_has_a_standard_error() -> None:
    """Twice that of the coefficient of a factor between -1 and 1; none without degrees of freedom."""
    space = rk.Space(a=(0.0, 1.0), b=(0.0, 1.0))
    points = np.array([(0, 0), (1, 0), (0, 1), (1, 1)] * 2, float)
    y = [1.0, 3.0, 2.0, 6.0, 1.5, 2.5, 2.25, 5.5]
    full = rk.fit_surface(space, points, y, order=1, deterministic=False).report()
    for row in full["terms"][1:]:
        assert row["effect"] == pytest.approx(2 * row["estimate"], rel=1e-12)
        assert row["effect_std_error"] == pytest.approx(2 * row["std_error"], rel=1e-12)
    assert full["terms"][0]["effect_std_error"] is None
    assert full["lack_of_fit"]["largest_r2"] > full["r2"]
    made = [5, 1, 8, 2, 7, 3, 6, 4]  # the same runs, told when they were made
    told = rk.fit_surface(space, points, y, order=1, deterministic=False, run_order=made)
    in_time = np.argsort(made)
    again = rk.fit_surface(space, points[in_time], np.array(y)[in_time], order=1, deterministic=False)
    assert told.report()["durbin_watson"] == pytest.approx(again.report()["durbin_watson"], rel=1e-12)
    assert told.report()["durbin_watson"] != pytest.approx(full["durbin_watson"], rel=0.01)
    assert rk.surface_from_json(told.to_json()).data.order == tuple(made)
    saturated = rk.fit_surface(
        space, points[:4], y[:4], terms=rk.parse_terms(space, ["FO", "TWI"]), deterministic=False
    ).report()
    assert [row["effect_std_error"] for row in saturated["terms"]] == [None] * 4
    assert saturated["adequate_precision"] is saturated["durbin_watson"] is None
