"""Expected mean squares of balanced layouts as textbooks print them."""

from __future__ import annotations

import pytest

import rsmkit as rk


def of(rows: tuple, source: str):
    return next(row for row in rows if row.source == source)


def test_a_gauge_study_with_both_factors_random() -> None:
    """Montgomery (2013), example 13.1: 20 parts, 3 operators, 2 readings each."""
    rows = rk.expected_mean_squares({"part": 20, "operator": 3}, random=["part", "operator"], replicates=2)
    assert [row.source for row in rows] == ["part", "operator", "part:operator", "error"]
    assert of(rows, "part").coefficients == {"error": 1, "part:operator": 2, "part": 6}
    assert of(rows, "operator").coefficients == {"error": 1, "part:operator": 2, "operator": 40}
    assert [row.df for row in rows] == [19, 2, 38, 60]
    assert [row.error_term for row in rows] == ["part:operator", "part:operator", "error", None]


def test_a_mixed_model_restricted_or_not() -> None:
    """Montgomery (2013), section 13.3: parts random, operators fixed."""
    levels, own = {"part": 20, "operator": 3}, {"random": ["part"], "replicates": 2}
    held = rk.expected_mean_squares(levels, **own)
    free = rk.expected_mean_squares(levels, **own, restricted=False)
    assert of(held, "part").coefficients == {"error": 1, "part": 6}
    assert of(held, "part").error_term == "error"
    assert of(free, "part").coefficients == {"error": 1, "part:operator": 2, "part": 6}
    assert of(free, "part").error_term == "part:operator"
    assert of(held, "operator").error_term == of(free, "operator").error_term == "part:operator"
    assert of(held, "operator").of_squared_effects == 20.0  # times the sum of squares over a - 1 = 2


def test_a_nested_factorial() -> None:
    """Montgomery (2013), example 14.2: operators within layouts, fixtures crossed with both."""
    rows = rk.expected_mean_squares(
        {"layout": 2, "operator": 4, "fixture": 3},
        random=["operator"], nested={"operator": "layout"}, replicates=2,
    )  # fmt: skip
    assert of(rows, "layout").coefficients == {"error": 1, "operator(layout)": 6, "layout": 24}
    assert of(rows, "fixture").coefficients == {"error": 1, "operator:fixture(layout)": 2, "fixture": 16}
    assert of(rows, "operator(layout)").coefficients == {"error": 1, "operator(layout)": 6}
    assert of(rows, "layout:fixture").error_term == "operator:fixture(layout)"
    assert of(rows, "operator:fixture(layout)").df == 12
    assert sum(row.df for row in rows) == 2 * 4 * 3 * 2 - 1


def test_no_single_error_term_and_quadratic_forms() -> None:
    """Three random factors: main effects have no exact test (Montgomery 2013, section 13.6)."""
    three = rk.expected_mean_squares({"a": 3, "b": 4, "c": 2}, random=["a", "b", "c"], replicates=2)
    assert [row.error_term for row in three[:3]] == [None, None, None]
    assert [row.error_term for row in three[3:6]] == ["a:b:c"] * 3
    fixed = rk.expected_mean_squares({"a": 3, "b": 4}, replicates=2, restricted=False)
    assert fixed[0].quadratic == ("a:b",)
    assert str(fixed[0]) == "error + 8 a + Q(a:b)"
    once = rk.expected_mean_squares({"a": 3, "b": 4})
    assert [row.error_term for row in once] == [None] * 4  # one run per cell leaves no error


@pytest.mark.parametrize(
    ("levels", "words", "message"),
    [
        ({"a": 2}, {"random": ["b"]}, "random factors"),
        ({"a": 2, "b": 2}, {"nested": {"a": "b", "b": "a"}}, "nested in itself"),
        ({"a": 1}, {}, "at least 2"),
        ({"a": 2.5}, {}, "whole number"),
        ({"error": 2}, {}, "cannot be called"),
        ({"a:b": 2}, {}, "cannot be called"),
        ({"a": 2}, {"replicates": 0}, "at least one run"),
        ({}, {}, "needs factors"),
    ],
)
def test_what_is_no_layout_is_refused(levels: dict, words: dict, message: str) -> None:
    with pytest.raises(rk.RsmkitError, match=message):
        rk.expected_mean_squares(levels, **words)
