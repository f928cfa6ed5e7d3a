"""Coding is a bijection; expressions agree with Python's own arithmetic."""

import contextlib

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from rsmkit.errors import RsmkitError
from rsmkit.language.expression import parse_expression
from rsmkit.language.space import Factor, Space

bounds = st.tuples(st.floats(-1e6, 1e6, allow_nan=False), st.floats(1e-3, 1e6, allow_nan=False)).map(
    lambda pair: (pair[0], pair[0] + pair[1])
)


@given(st.lists(bounds, min_size=1, max_size=6), st.integers(0, 2**32 - 1))
def test_coding_round_trip(ranges, seed):
    space = Space(Factor(f"x{i}", low, high) for i, (low, high) in enumerate(ranges))
    coded = np.random.default_rng(seed).uniform(-2, 2, (5, len(space)))
    natural = space.decode(coded)
    scale = np.abs(natural).max(axis=0) + (space.highs - space.lows)
    np.testing.assert_allclose(space.decode(space.encode(natural)) / scale, natural / scale, atol=1e-14)
    np.testing.assert_array_equal(
        space.encode(np.array([space.lows, space.highs])), [[-1] * len(space), [1] * len(space)]
    )
    np.testing.assert_array_equal(space.decode(-np.ones(len(space))), space.lows)
    np.testing.assert_array_equal(space.decode(np.ones(len(space))), space.highs)


numbers = st.floats(-100, 100, allow_nan=False).map(lambda x: f"({x!r})")
names = st.sampled_from(["a", "b"])
arithmetic = st.recursive(
    numbers | names,
    lambda inner: st.tuples(inner, st.sampled_from(["+", "-", "*"]), inner).map(
        lambda t: f"({t[0]} {t[1]} {t[2]})"
    ),
    max_leaves=12,
)


@given(arithmetic, st.floats(-10, 10), st.floats(-10, 10))
def test_expressions_agree_with_python(text, a, b):
    expected = eval(text, {"__builtins__": {}}, {"a": a, "b": b})
    assert float(parse_expression(text)({"a": a, "b": b})) == expected


@given(st.text(max_size=80))
def test_any_text_is_an_expression_or_a_clear_refusal(text):
    with contextlib.suppress(RsmkitError):
        assert parse_expression(text).text == text
