"""Factors and the design space."""

import numpy as np
import pytest

from rsmkit.errors import RsmkitError
from rsmkit.language.space import Factor, Space

SPACE = Space(
    (
        Factor("angle_deg", 5.0, 10.0, label="angle", unit="deg"),
        Factor("tubes", 12, 48, integer=True),
        Factor("pitch", levels=(3.0, 1.0, 2.0)),
        Factor("alloy", levels=("steel", "copper", "brass")),
    )
)


def test_kinds_and_titles():
    assert [f.kind for f in SPACE] == ["continuous", "integer", "discrete", "categorical"]
    assert SPACE["pitch"].levels == (1.0, 2.0, 3.0)
    assert SPACE["angle_deg"].title == "angle [deg]"
    assert SPACE["tubes"].title == "tubes"
    np.testing.assert_array_equal(SPACE.lows, [5, 12, 1, 0])
    np.testing.assert_array_equal(SPACE.highs, [10, 48, 3, 2])


def test_bounds_code_to_one_exactly():
    corners = np.array([SPACE.lows, SPACE.highs])
    np.testing.assert_array_equal(SPACE.encode(corners)[:, :3], [[-1] * 3, [1] * 3])
    np.testing.assert_array_equal(SPACE.decode(SPACE.encode(corners)), corners)


def test_values_are_what_a_simulator_receives():
    values = SPACE.values([7.25, 20.0, 2.0, 1.0])
    assert values == {"angle_deg": 7.25, "tubes": 20, "pitch": 2.0, "alloy": "copper"}
    assert type(values["tubes"]) is int
    np.testing.assert_array_equal(SPACE.point(values), [7.25, 20, 2, 1])


def test_snap_moves_to_allowed_values_only():
    np.testing.assert_array_equal(
        SPACE.snap([[7.3, 20.4, 2.6, 0.6], [11, 50.7, -9, 1]]), [[7.3, 20, 3, 1], [11, 51, 1, 1]]
    )


def test_contains_and_clip():
    np.testing.assert_array_equal(
        SPACE.contains([[5, 12, 1, 0], [4.99, 12, 1, 0], [5, 12, 3.1, 0]]), [True, False, False]
    )
    np.testing.assert_array_equal(SPACE.clip([[0, 99, 2, 1]]), [[5, 48, 2, 1]])


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: Factor("x", 2, 1), "low .* must be less than high"),
        (lambda: Factor("x", 1), "give low and high"),
        (lambda: Factor("x", 1, float("inf")), "give low and high"),
        (lambda: Factor(" ", 1, 2), "must not be empty"),
        (lambda: Factor("x", levels=("a",)), "at least two"),
        (lambda: Factor("x", levels=("a", "a")), "at least two different"),
        (lambda: Factor("x", levels=("a", 1.0)), "all numbers or all texts"),
        (lambda: Factor("x", 0.5, 2, integer=True), "whole numbers"),
        (lambda: Factor("x", "1", 3), "factor x: give low and high .finite numbers."),
        (lambda: Factor("x", levels=(1.0, float("nan"))), "factor x: levels must be finite numbers"),
        (lambda: Factor("x", levels=(None, True)), "factor x: levels must be finite numbers or texts"),
        (lambda: Factor("x", levels="abc"), "factor x: levels must be a list .* got the text 'abc'"),
        (lambda: Factor("x", levels=(0.5, 2), integer=True), "factor x: .* whole numbers for levels"),
        (lambda: Space(()), "at least one factor"),
        (lambda: Space(a="1-3"), r"factor a: '1-3' is neither .* write a=\(1, 3\)"),
        (lambda: Space(a=3), "factor a: 3 is neither a range nor levels"),
        (lambda: Space(a={"low": 1, "high": 2}), "factor a: .* is neither a range nor levels"),
        (lambda: Space(a=(1, 2, 3)), r"factor a: \(1, 2, 3\) is not a range; .* a=\[1, 2, 3\]"),
        (lambda: Space(a=("1", "3")), "factor a: .* is not a range"),
        (lambda: Space(a=(1, float("inf"))), "factor a: .* two finite numbers"),
        (lambda: Space(a=(float("nan"), 1)), "factor a: .* two finite numbers"),
        (lambda: Space(a=(3, 1)), "factor a: low .3. must be less than high .1."),
        (lambda: Space((Factor("x", 0, 1), Factor("x", 0, 2))), "must differ"),
        (
            lambda: SPACE.point({"angle_deg": 6, "tubes": 12, "pitch": 1, "aloy": "steel"}),
            "missing alloy; unknown aloy",
        ),
        (
            lambda: SPACE.point({"angle_deg": "wide", "tubes": 12, "pitch": 1, "alloy": "steel"}),
            "'wide' is not a number",
        ),
        (
            lambda: SPACE.point({"angle_deg": 6, "tubes": 12, "pitch": 1, "alloy": "gold"}),
            "not one of its levels",
        ),
    ],
)
def test_nonsense_is_refused(build, message):
    with pytest.raises(RsmkitError, match=message):
        build()


def test_texts_and_html_say_what_a_factor_is():
    for factor in SPACE:
        assert eval(repr(factor)) == factor
    assert repr(SPACE["tubes"]) == "Factor('tubes', 12, 48, integer=True)"
    assert repr(SPACE) == (
        "<Space: 4 factors (angle_deg 5 to 10 deg; tubes 12 to 48 in whole numbers; pitch 1, 2, 3; "
        "alloy steel, copper, brass)>"
    )
    many = Factor("x", levels=tuple(float(i) for i in range(100)))
    assert repr(Space((many,))) == "<Space: 1 factor (x 0, 1, ..., 99 (100 levels))>"
    table = Space((Factor("a<b", levels=("<i>", "&")),))._repr_html_()
    assert "<td>a&lt;b</td><td>categorical</td><td>&lt;i&gt;, &amp;</td>" in table
    assert SPACE["tubes"]._repr_html_().count("<tr>") == 2


def test_bounds_are_made_once_and_cannot_be_changed():
    assert SPACE.lows is SPACE.lows
    for array in (SPACE.lows, SPACE.highs, SPACE.numeric):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 7
