"""Terms of mixture models: what they hold, and that they are what they are called."""

from __future__ import annotations

from math import comb

import numpy as np
import pytest

from rsmkit.errors import RsmkitError
from rsmkit.language.scheffe import movable, on_simplex, parse_scheffe, scheffe_terms
from rsmkit.language.space import Space
from rsmkit.language.terms import Terms

SPACE = Space(a=(0, 1), b=(0, 1), c=(0, 1), z=(20, 80), tool=["u", "v", "w"])
ABC = ["a", "b", "c"]


def test_the_full_cubic_model_is_scheffes() -> None:
    terms = scheffe_terms(Space(a=(0, 1), b=(0, 1), c=(0, 1)), ABC, "cubic")
    assert terms.names(ABC) == (
        "a", "b", "c", "a*b", "a*c", "b*c", "a*b*c", "a*b*(a-b)", "a*c*(a-c)", "b*c*(b-c)",
    )  # fmt: skip
    x = np.array([[0.2, 0.3, 0.5]])
    expected = [0.2, 0.3, 0.5, 0.06, 0.1, 0.15, 0.03, 0.06 * -0.1, 0.1 * -0.3, 0.15 * -0.2]
    np.testing.assert_allclose(terms.matrix(x)[0], expected, rtol=1e-15, atol=1e-17)


@pytest.mark.parametrize("q", [2, 3, 4, 6])
def test_each_model_has_as_many_terms_as_the_polynomials_on_the_simplex(q: int) -> None:
    """Polynomials of degree m in the q - 1 proportions that are free: comb(q - 1 + m, m)."""
    names = [f"x{j}" for j in range(q)]
    space = Space(**dict.fromkeys(names, (0, 1)))
    for order in (1, 2, 3):
        assert scheffe_terms(space, names, order).p == comb(q - 1 + order, order)


@pytest.mark.parametrize(("process", "count"), [("combined", 15), ("main", 18), ("crossed", 24)])
def test_process_factors_join_in_three_ways(process: str, count: int) -> None:
    """combined: all of second degree in two free proportions and two factors; else 6 times 3, 6 times 4."""
    space = Space(a=(0, 1), b=(0, 1), c=(0, 1), z=(0, 1), t=(0, 1))
    assert scheffe_terms(space, ABC, "quadratic", process).p == count  # type: ignore[arg-type]


def test_groups_say_how_components_blend() -> None:
    terms = parse_scheffe(SPACE, ABC, ["a*b*c", "a*b*(a-b)", "a*z", "z^2"])
    groups = dict(zip(terms.names(SPACE), terms.groups, strict=True))
    assert groups["a"] == "linear blending"
    assert groups["a*b"] == "quadratic blending"
    assert groups["a*b*c"] == "special cubic blending"
    assert groups["a*b*(a-b)"] == "full cubic blending"
    assert groups["a*z"] == "linear blending x process"
    assert groups["z^2"] == "process"


def test_terms_by_hand_bring_what_they_contain() -> None:
    named = parse_scheffe(SPACE, ABC, ["a*b*(b-a)*z"]).names(SPACE)
    assert named == ("a", "b", "c", "a*b", "a*b*(a-b)", "a*z", "b*z", "a*b*z", "a*b*(a-b)*z")
    assert parse_scheffe(SPACE, ABC, ["exact", "a*b*c"]).names(SPACE) == ("a", "b", "c", "a*b*c")


@pytest.mark.parametrize("word", ["a^2", "PQ", "SO", "cubic", "a*b*(a-c)", "a*(a-b)"])
def test_squares_are_refused(word: str) -> None:
    with pytest.raises(RsmkitError, match=r"say nothing new|is written a\*b\*\(a-b\)"):
        parse_scheffe(SPACE, ABC, [word])


def test_components_are_numbers_and_more_than_one() -> None:
    with pytest.raises(RsmkitError, match="categorical"):
        scheffe_terms(SPACE, ["a", "tool"])
    with pytest.raises(RsmkitError, match="at least two"):
        scheffe_terms(SPACE, ["a", "a"])
    with pytest.raises(RsmkitError, match="component"):
        scheffe_terms(SPACE, ["a", "d"])


def test_slopes_and_plain_terms_agree_with_the_columns() -> None:
    terms = scheffe_terms(SPACE, ABC, "cubic", "main")
    beta = np.random.default_rng(1).normal(size=terms.p)
    x = np.array([[0.2, 0.3, 0.5, 0.4, 1.0]])
    plain, weights = terms.plain
    np.testing.assert_allclose(plain.evaluate(x, weights @ beta), terms.evaluate(x, beta), rtol=1e-13)
    step = 1e-5  # central differences of a cubic: third derivative times step^2 / 6, below 1e-9
    for j in range(4):
        d = step * np.eye(5)[j]
        slope = (terms.evaluate(x + d, beta) - terms.evaluate(x - d, beta)) / (2 * step)
        np.testing.assert_allclose(terms.slopes(x, beta)[0, j], slope[0], rtol=1e-7, atol=1e-8)


@pytest.mark.parametrize("monomial", [(0, 0, 0), (2, 0, 0), (0, 3, 0), (1, 2, 0), (0, 1, 2), (1, 1, 1)])
def test_every_cubic_is_a_sum_of_scheffes_terms(monomial: tuple[int, ...]) -> None:
    terms = scheffe_terms(Space(a=(0, 1), b=(0, 1), c=(0, 1)), ABC, "cubic")
    basis = dict(zip(terms.columns, terms.differences, strict=True))
    found = on_simplex(monomial, basis, range(3))
    assert found is not None
    x = np.random.default_rng(2).dirichlet(np.ones(3), 5)
    columns = dict(zip(terms.columns, terms.matrix(x).T, strict=True))
    total = sum(weight * columns[e] for e, weight in found.items())
    np.testing.assert_allclose(total, np.prod(x ** np.array(monomial), axis=1), atol=1e-15)


def test_a_model_with_gaps_depends_on_the_origin() -> None:
    assert all(movable(scheffe_terms(SPACE, ABC, "special cubic", "crossed")))
    gaps = parse_scheffe(SPACE, ABC, ["exact", "a*b*c", "b*z"])
    assert movable(gaps) == (False, False, False, True, True)
    assert movable(Terms(((0, 0), (1, 1)), (0, 0))) == (False, False)
