"""Components of three-level interactions, against Montgomery, Design and Analysis of Experiments (2013)."""

from __future__ import annotations

import numpy as np
import pytest

import rsmkit as rk

# Example 9.1 as table 5.20: life of a tool by angle (rows) and speed (columns), two readings each.
TOOL_LIFE = [[-2, -1, -3, 0, 2, 3], [0, 2, 1, 3, 4, 6], [-1, 0, 5, 6, 0, -1]]


def space(k: int) -> rk.Space:
    return rk.Space([rk.Factor(name, 0.0, 2.0) for name in "abcdefg"[:k]])


@pytest.fixture(scope="module")
def tool_life() -> dict:
    points = np.array([(a, s) for a in range(3) for s in range(3) for _ in range(2)], float)
    design = rk.Design(space(2), points, ("factorial",) * 18)
    return {row.word: row for row in rk.interaction_components(design, np.ravel(TOOL_LIFE))}


def test_the_components_of_tool_life(tool_life: dict) -> None:
    """Section 9.1.2: totals 18, -2, 8 and 0, 6, 18; sums of squares 33.34 and 28.00 (exactly 100/3, 28)."""
    assert sorted(tool_life["AB"].totals) == [-2, 8, 18]
    assert sorted(tool_life["AB2"].totals) == [0, 6, 18]
    assert tool_life["AB"].ss == pytest.approx(392 / 6 - 24**2 / 18, rel=1e-12)
    assert tool_life["AB2"].ss == pytest.approx(360 / 6 - 24**2 / 18, rel=1e-12)


def test_components_add_up_to_the_interaction(tool_life: dict) -> None:
    """The analysis of variance of table 5.21: 61.33 for the interaction, 24.33 and 25.33 for the factors."""
    points = np.array([(a, s) for a in range(3) for s in range(3) for _ in range(2)], float)
    crossed = rk.Space(angle=["15", "20", "25"], speed=["125", "150", "175"])
    fit = rk.fit_surface(
        crossed,
        points,
        np.ravel(TOOL_LIFE),
        terms=rk.parse_terms(crossed, ["FO", "TWI"]),
        deterministic=False,
    )
    ss = {row["term"]: row["type2"]["ss"] for row in fit.report()["anova_terms"]}
    assert tool_life["AB"].ss + tool_life["AB2"].ss == pytest.approx(ss["angle*speed"], rel=1e-10)
    assert ss["angle*speed"] == pytest.approx(61.33, abs=5e-3)
    assert tool_life["A"].ss == pytest.approx(24.33, abs=5e-3)
    assert tool_life["B"].ss == pytest.approx(25.33, abs=5e-3)


@pytest.mark.parametrize(
    ("words", "relation"),
    [  # sections 9.2.2 and 9.3.2
        (["ABC", "AB2D2"], "ABC AB2D2 AC2D BC2D2"),
        (["AB2C", "BCD"], "AB2C BCD AC2D ABD2"),
        (["A2BC2D2"], "AB2CD"),
    ],
)
def test_what_goes_with_components(words: list, relation: str) -> None:
    assert set(rk.component_relation(words)) == set(relation.split())


def test_three_blocks_of_nine_runs() -> None:
    """Figure 9.6: AB2 puts 00, 11, 22 into one block; 10, 21, 02; 01, 12, 20."""
    nine = rk.three_level_blocks(rk.full_factorial(space(2), levels=3), ["AB2"])
    runs: dict = {}
    for block, point in zip(nine.blocks, nine.points.astype(int).tolist(), strict=True):
        runs.setdefault(block, set()).add(tuple(point))
    assert {frozenset(own) for own in runs.values()} == {
        frozenset({(0, 0), (1, 1), (2, 2)}),
        frozenset({(1, 0), (2, 1), (0, 2)}),
        frozenset({(0, 1), (1, 2), (2, 0)}),
    }


def test_fractions_of_one_third() -> None:
    """3^(4-1) with I = AB2CD: 27 runs in which any three factors are complete (resolution IV)."""
    third = rk.three_level_fraction(space(4), ["AB2CD"])
    found = rk.design_structure(third)
    assert (len(third), found.strength, found.resolution) == (27, 3, 4)
    parts = [rk.three_level_fraction(space(3), ["AB2C2"], [u]).points for u in (0, 1, 2)]
    assert len(np.unique(np.vstack(parts), axis=0)) == 27


@pytest.mark.parametrize(
    ("question", "message"),
    [
        (lambda: rk.component_relation(["AB2", "A2B"]), "product of the others"),
        (lambda: rk.component_relation(["A3"]), "must be a product"),
        (lambda: rk.component_relation(["AAB"]), "must be a product"),
        (lambda: rk.component_relation([""]), "must be a product"),
        (lambda: rk.three_level_blocks(rk.full_factorial(space(2), levels=3), []), "at least one"),
        (lambda: rk.three_level_blocks(rk.full_factorial(space(2)), ["AB"]), "at three levels"),
        (lambda: rk.three_level_fraction(space(2), ["AB"], [3]), "0, 1 or 2"),
        (lambda: rk.three_level_blocks(rk.full_factorial(space(2), levels=3), ["AC"]), "must be a product"),
        (lambda: rk.interaction_components(rk.full_factorial(space(2), levels=3), [1.0]), "9 runs"),
        (
            lambda: rk.three_level_blocks(rk.three_level_fraction(space(3), ["ABC"]), ["ABC"]),
            "aliased in this design",
        ),
    ],
)
def test_what_is_no_component_is_refused(question, message: str) -> None:
    with pytest.raises(rk.RsmkitError, match=message):
        question()
