"""Model terms against hand-written matrices and finite differences."""

import numpy as np
import pytest

from rsmkit.errors import RsmkitError
from rsmkit.language.space import Factor, Space
from rsmkit.language.terms import Terms, full_terms, group_of, hierarchical_closure, parse_terms


def test_second_order_columns_written_out_by_hand():
    terms = full_terms(3, 2)
    a, b, c = np.random.default_rng(1).normal(size=(3, 7))
    expected = np.column_stack([np.ones(7), a, b, c, a * b, a * c, b * c, a * a, b * b, c * c])
    np.testing.assert_allclose(terms.matrix(np.column_stack([a, b, c])), expected, rtol=1e-15)
    assert terms.names(["a", "b", "c"]) == (
        "1", "a", "b", "c", "a*b", "a*c", "b*c", "a^2", "b^2", "c^2",
    )  # fmt: skip
    assert terms.groups == ("", "FO", "FO", "FO", "TWI", "TWI", "TWI", "PQ", "PQ", "PQ")


@pytest.mark.parametrize(
    ("k", "order", "count"), [(3, 1, 4), (3, 2, 10), (3, 3, 20), (20, 2, 231), (1, 10, 11)]
)
def test_number_of_terms_is_the_binomial_coefficient(k, order, count):
    assert full_terms(k, order).p == count


def test_categorical_factor_uses_treatment_contrasts():
    space = Space([Factor("x", 0, 2), Factor("tool", levels=("A", "B", "C"))])
    terms = full_terms(space, 2)
    assert terms.names(space) == (
        "1", "x", "tool[B]", "tool[C]", "x*tool[B]", "x*tool[C]", "x^2",
    )  # fmt: skip
    row = terms.matrix([[0.5, 2.0]])[0]
    np.testing.assert_array_equal(row, [1, 0.5, 0, 1, 0, 0.5, 0.25])
    assert terms.column_terms == (0, 1, 2, 2, 3, 3, 4)
    with pytest.raises(RsmkitError, match="level indices run from 0 to 2"):
        terms.matrix([[0.0, 3.0]])


@pytest.mark.parametrize("order", [1, 2, 3])
def test_gradient_and_hessian_agree_with_complex_step(order):
    terms = full_terms(3, order)
    rng = np.random.default_rng(order)
    x, beta = rng.normal(size=(5, 3)), rng.normal(size=terms.p)

    def polynomial(z):
        return sum(b * np.prod(z ** np.array(e), axis=1) for b, e in zip(beta, terms.exponents, strict=True))

    step = 1e-30j * np.eye(3)
    slopes = np.stack([polynomial(x + step[j]).imag / 1e-30 for j in range(3)], axis=1)
    np.testing.assert_allclose(terms.slopes(x, beta), slopes, rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(
        np.einsum("npk,p->nk", terms.gradient(x), beta), slopes, rtol=1e-13, atol=1e-13
    )
    hessian = np.array(
        [terms.slopes(x[:1] + 1e-6 * np.eye(3)[j], beta) - terms.slopes(x[:1], beta) for j in range(3)]
    )
    np.testing.assert_allclose(terms.hessian(x[0], beta), hessian[:, 0] / 1e-6, rtol=1e-4, atol=1e-4)


def test_non_hierarchical_terms_still_evaluate_and_differentiate():
    terms = Terms(((1, 0), (0, 3)), (0, 0))
    assert not terms.hierarchical
    assert not terms.has_constant
    np.testing.assert_array_equal(terms.matrix([[2.0, 3.0]]), [[2.0, 27.0]])
    np.testing.assert_array_equal(terms.slopes([[2.0, 3.0]], [1.0, 1.0]), [[1.0, 27.0]])


def test_evaluate_in_chunks_equals_the_matrix_product():
    terms = full_terms(3, 2)
    x = np.random.default_rng(0).uniform(-1, 1, (20_001, 3))
    beta = np.arange(1.0, 11.0)
    np.testing.assert_allclose(terms.evaluate(x, beta), terms.matrix(x) @ beta, rtol=1e-12)


def test_closure_and_groups():
    assert hierarchical_closure([(1, 2)]) == ((0, 0), (1, 0), (0, 1), (1, 1), (0, 2), (1, 2))
    assert [group_of(e) for e in [(0, 0), (1, 0), (1, 1), (2, 0), (2, 1), (0, 4)]] == [
        "", "FO", "TWI", "PQ", "cubic", "order 4",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("exponents", "levels", "message"),
    [
        (((0,), (0,)), (0,), "given twice"),
        (((2,),), (3,), "no squares"),
        (((-1,),), (0,), "negative"),
        (((1, 1),), (0,), "1 exponents"),
        ((), (0,), "at least one"),
    ],
)
def test_wrong_terms_are_refused(exponents, levels, message):
    with pytest.raises(RsmkitError, match=message):
        Terms(exponents, levels)


def test_models_written_by_hand():
    space = Space(a=(0, 1), b=(0, 1))
    assert parse_terms(space, ["SO"]) == full_terms(space, 2)
    assert parse_terms(space, ["cubic"]) == full_terms(space, 3)
    assert parse_terms(space, ["a*b^2"]).names(space) == ("1", "a", "b", "a*b", "b^2", "a*b^2")
    assert parse_terms(space, ["0", "a:b"]).names(space) == ("a", "b", "a*b")
    for wrong in ("c", "a^b", "a^-1", "a^1000000000"):
        with pytest.raises(RsmkitError, match="model terms"):
            parse_terms(space, [wrong])
