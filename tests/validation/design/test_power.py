"""Power of the tests of categories, against R."""

from __future__ import annotations

import numpy as np
import pytest

from rsmkit.design.design import Design
from rsmkit.design.families.two_level.factorial import full_factorial
from rsmkit.design.quality.assessment import assess
from rsmkit.design.quality.power import power_of_terms
from rsmkit.language.space import Space
from rsmkit.language.terms import full_terms, parse_terms


def repeated(space: Space, times: int) -> Design:
    cells = full_factorial(space).points
    return Design(space, np.tile(cells, (times, 1)), ("factorial",) * (times * len(cells)))


def test_two_categories_are_like_two_levels_of_a_number():
    """The same eight runs and model in both, so every test is the same."""
    numbers = Space(a=(0.0, 1.0), b=(0.0, 1.0), c=(0.0, 1.0))
    mixed = Space(a=(0.0, 1.0), b=["low", "high"], c=["low", "high"])
    words = ["FO", "a*b", "b*c"]
    first, second = (
        power_of_terms(repeated(space, 1), terms=parse_terms(space, words)) for space in (numbers, mixed)
    )
    assert list(second) == ["1", "a", "b[high]", "c[high]", "a*b[high]", "b[high]*c[high]"]
    assert list(second.values()) == pytest.approx(list(first.values()), rel=1e-12)


def test_two_samples():
    """R: power.t.test(n = 6, delta = 2, sd = 1, strict = TRUE)."""
    space = Space(tool=["A", "B"])
    assert power_of_terms(repeated(space, 6), order=1)["tool[B]"] == pytest.approx(0.8764177714, rel=1e-8)


@pytest.mark.parametrize(("levels", "times", "power"), [(3, 4, 0.5596310291), (4, 3, 0.3390583652)])
def test_one_way_analysis_of_variance(levels, times, power):
    """R: power.anova.test(groups, n, between.var = var(c(1, 0, ..., -1)), within.var = 1)."""
    space = Space(tool=[f"L{i}" for i in range(levels)])
    design = repeated(space, times)
    found = power_of_terms(design, order=1)
    assert found["tool"] == pytest.approx(power, rel=1e-8)
    assert assess(design, order=1).power == found


def test_unbalanced_cells_with_their_interaction():
    """R: model.matrix(~ a * b, contrasts = contr.sum), noncentrality b' V^-1 b, the least over pairs."""
    space = Space(a=["1", "2"], b=["1", "2", "3"])
    cells = [(i % 2, i // 2) for i in (0, 1, 2, 3, 4, 5, 0, 1, 2, 5, 0, 3, 4)]
    design = Design(space, np.array(cells, float), ("given",) * len(cells))
    found = power_of_terms(design, terms=full_terms(space, 2))
    assert (found["a[2]"], found["b"], found["a*b"]) == pytest.approx(
        (0.8618680775, 0.5165385586, 0.5165385586), rel=1e-8
    )


def test_a_model_without_margins_takes_its_columns_as_they_are():
    space = Space(x=(0.0, 1.0), tool=["A", "B", "C"])
    found = power_of_terms(repeated(space, 3), terms=parse_terms(space, ["exact", "x*tool"]))
    assert list(found) == ["1", "x*tool[B]", "x*tool[C]"]
    assert all(0.05 < power < 1.0 for power in found.values())
