"""Conditions: inequalities and categories as margins, equalities as what points lie on."""

import numpy as np
import pytest

from rsmkit.errors import RsmkitError
from rsmkit.language.conditions import parse_conditions, parse_constraint, parse_equality

CELLS = {"cell": ("L1", "L2", "L3"), "monitor": ("M1", "M2")}
KNOWN = ["cell", "monitor", "t", "u"]


def allowed(text, **values):
    margins = [c.margin(values) for c in parse_constraint(text, KNOWN, CELLS)]
    return (np.array(margins) >= 0).all(axis=0).tolist()


def test_a_combination_of_categories_is_forbidden():
    cell, monitor = (x.ravel() for x in np.meshgrid([0.0, 1.0, 2.0], [0.0, 1.0]))
    found = allowed("not (cell == 'L3' and monitor == 'M1')", cell=cell, monitor=monitor)
    assert found == [not (c == 2 and m == 0) for c, m in zip(cell, monitor, strict=True)]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("cell == 'L2'", [False, True, False]),
        ("'L2' != cell", [True, False, True]),
        ("cell in ('L1', 'L3')", [True, False, True]),
        ("cell not in ['L1']", [False, True, True]),
        ("cell == 'L1' or t >= 15", [True, False, True]),
        ("not (cell == 'L3' and t > 25)", [True, True, False]),
        ("not (cell == 'L3') and t <= 15", [True, True, False]),
        ("not 5 <= t <= 12", [False, False, True]),
    ],
)
def test_logic(text, expected):
    t = np.array([10.0, 11.0, 30.0]) if "12" in text else np.array([10.0, 10.0, 30.0])
    assert allowed(text, cell=np.array([0.0, 1.0, 2.0]), t=t) == expected


@pytest.mark.parametrize(
    ("text", "terms", "value"),
    [
        ("a + 2*b == 3", (("a", 1.0), ("b", 2.0)), 3.0),
        ("a == b", (("a", 1.0), ("b", -1.0)), 0.0),
        ("1 - (a - b/4)*2 == -b + sqrt(4)*c", (("a", -2.0), ("b", 1.5), ("c", -2.0)), -1.0),
        ("pi*a + 0*b == 2*pi", (("a", np.pi),), 2 * np.pi),
    ],
)
def test_equalities(text, terms, value):
    found = parse_equality(text, ["a", "b", "c"])
    assert dict(found.terms) == pytest.approx(dict(terms))
    assert found.value == pytest.approx(value, rel=1e-15)


def test_conditions_are_sorted_by_what_they_are():
    found = parse_conditions(["t <= 3", "t + u == 4", "cell != 'L1'"], KNOWN, CELLS, ["t", "u"])
    assert [c.text for c in found.constraints] == ["t <= 3", "cell != 'L1'"]
    assert [e.text for e in found.equalities] == ["t + u == 4"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("cell == 'L9'", r"cell has no level 'L9'.*'L1', 'L2', 'L3'"),
        ("cell == l1", "cell has no level l1"),
        ("cell <= 'L2'", "a category, which has no order"),
        ("cell + t <= 3", "cell is a category and no number; compare it with a text: cell == 'L1'"),
        ("t == 'L1'", "no categorical factor"),
        ("cell == ('L1', 'L2')", "cell in "),
        ("cell in 'L1'", "cell in "),
        ("t in (1, 2)", "'in' tests a category"),
        ("not (t == 3)", "stands alone"),
        ("t != 3", "compared by <= and >="),
        ("t", "is not a constraint"),
        ("not t", "is not a constraint"),
        ("t*u == 3", "must be linear"),
        ("y == 3", "kept in factors only, and y is none"),
        ("t - t == 0", "no factor is left"),
        ("t + u == 1/0", "not finite"),
        ("t == u == 3", "write one equality"),
    ],
)
def test_what_means_nothing_is_refused_in_words(text, words):
    with pytest.raises(RsmkitError, match=words):
        parse_conditions([text], KNOWN, CELLS, ["t", "u"])
