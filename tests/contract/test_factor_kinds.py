"""Every kind of factor keeps the contract that designs, searches, pages and tables rely on."""

import ast
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rsmkit.language import domains
from rsmkit.language.domains import FACTOR_KINDS, Categorical, Continuous, Integer
from rsmkit.language.space import Factor
from rsmkit.testing import check_factor_kind

EXAMPLES = {
    "continuous": [
        Factor("angle_deg", 5.0, 10.0, label="angle", unit="deg"),
        Factor("offset", -0.3, 1e-3),
        Factor("pressure_pa", 1e5, 1e7),
    ],
    "integer": [Factor("tubes", 12, 48, integer=True), Factor("sign", -1, 1, integer=True)],
    "discrete": [
        Factor("pitch", levels=(3.0, 1.0, 2.0)),
        Factor("gauge", levels=(0.1, 0.7, 12.5, 40.0)),
        Factor("passes", levels=(1, 2, 4), integer=True),
    ],
    "categorical": [Factor("alloy", levels=("steel", "copper", "brass")), Factor("fan", levels=("on", "1"))],
}


def compared_words(text):
    """Every text that is compared with something by ==, != or in."""
    compared = (node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Compare))
    return {c.value for node in compared for c in ast.walk(node) if isinstance(c, ast.Constant)}


def test_nobody_else_compares_the_words():
    package = Path(domains.__file__).parents[1]
    guilty = [path for path in package.rglob("*.py") if compared_words(path.read_text()) & set(FACTOR_KINDS)]
    assert not guilty, "ask factor.domain instead"
    assert compared_words('f.kind in ("integer", "discrete")') == {"integer", "discrete"}


def test_every_kind_has_an_example():
    assert set(EXAMPLES) == set(FACTOR_KINDS)


@pytest.mark.parametrize(
    ("word", "factor"),
    [(word, factor) for word, factors in EXAMPLES.items() for factor in factors],
    ids=lambda value: getattr(value, "name", value),
)
def test_kind_keeps_the_contract(word, factor):
    assert factor.kind == word
    check_factor_kind(factor)


class Backwards(Continuous):
    def from_unit(self, u):
        return super().from_unit(1.0 - u)


class Uncoded(Continuous):
    def encode(self, natural):
        return natural


class Floating(Integer):
    def nodes(self, count):
        return self.curve(count)


class Frozen(Integer):
    def narrowed(self, x, half_width):
        return type(self)(self.low, self.low + 1)


class Capital(Categorical):
    def write(self, x):
        return super().write(x).upper()


class Lonely(Categorical):
    def neighbours(self, index):
        return ()


class Biased(Integer):
    def from_unit(self, u):
        return np.round(self.low + u * (self.high - self.low))


class Rounded(Continuous):
    def cell(self, x):
        return f"{x:.6g}"


class Credulous(Continuous):
    def read(self, value):
        return 0.0 if value == "no such value" else super().read(value)


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        (Backwards, "misses an end"),
        (Uncoded, "decode does not undo encode"),
        (Floating, "nodes gives values that are not allowed"),
        (Frozen, "narrowed"),
        (Capital, "not one of its levels"),
        (Lonely, "no neighbour"),
        (Biased, "equal shares"),
        (Rounded, "is not read as"),
        (Credulous, "nonsense"),
    ],
)
def test_broken_kinds_are_found(kind, message, monkeypatch):
    """Each of these is one of the kinds with one answer wrong."""
    word = kind.word
    factor = EXAMPLES[word][0]
    broken = replace(factor)
    object.__setattr__(broken, "domain", kind(factor.low, factor.high, factor.levels))
    monkeypatch.setitem(FACTOR_KINDS, word, kind)
    monkeypatch.setattr(domains, kind.__bases__[0].__name__, kind)
    with pytest.raises(AssertionError, match=message):
        check_factor_kind(broken)
