"""Structure of designs and power of screening studies as the papers on them print them."""

from __future__ import annotations

import numpy as np
import pytest

import rsmkit as rk
from rsmkit.design.families.two_level.factorial import fraction


def numbers(k: int) -> rk.Space:
    return rk.Space([rk.Factor(f"x{i}", -1.0, 1.0) for i in range(k)])


@pytest.fixture(scope="module")
def screening() -> rk.Design:
    return rk.definitive_screening(numbers(6), center=1)


@pytest.fixture(scope="module")
def plackett_burman() -> rk.Design:
    """Six columns of the twelve runs, and a centre run."""
    twelve = rk.plackett_burman(numbers(11), center=1)
    return rk.Design(numbers(6), twelve.points[:, :6], twelve.kinds)


@pytest.mark.parametrize(
    ("size", "printed"),
    [(1, (0.821, 0.236, 0.623, 0.774, None, 0.681)), (2, (None, 0.683, 0.993, None, 0.734, 0.998))],
)
def test_power_of_the_definitive_screening_design(screening: rk.Design, size: int, printed: tuple) -> None:
    """Jones & Nachtsheim (2011), Table 7, six factors; without three that the table rounds otherwise."""
    found = rk.screening_power(screening, signal_to_noise=2.0 * size)
    for row, value in zip(found, printed, strict=True):
        assert row.status == "estimable"
        if value is not None:
            assert row.average == pytest.approx(value, abs=5e-4)


def test_power_of_a_plackett_burman_design(plackett_burman: rk.Design) -> None:
    """The same table: 0.883 and 0.548; squares aliased, full quadratics not estimable."""
    found = rk.screening_power(plackett_burman)
    assert found[0].average == pytest.approx(0.883, abs=5e-4)
    assert found[2].average == pytest.approx(0.548, abs=5e-4)
    assert [row.status for row in found[1::2]] == ["aliased", "not estimable", "not estimable"]
    assert found[1].aliased == found[1].tests == 6


def test_blocks_take_degrees_of_freedom_from_screening(screening: rk.Design) -> None:
    halves = rk.Design(screening.space, screening.points, screening.kinds, (1,) * 7 + (2,) * 6)
    assert rk.screening_power(halves)[0].average < rk.screening_power(screening)[0].average


def test_categories_have_no_squares() -> None:
    design = rk.full_factorial(rk.Space(a=(0, 1), b=["x", "y"]))
    with pytest.raises(rk.RsmkitError, match="categories have no squares"):
        rk.screening_power(design)
    with pytest.raises(rk.RsmkitError, match="between 0 and 1"):
        rk.screening_power(design, significance=1.5)
    with pytest.raises(rk.RsmkitError, match="finite"):
        rk.power_of_terms(design, order=1, signal_to_noise=float("inf"))
    with pytest.raises(rk.RsmkitError, match="no runs"):
        rk.design_structure(design.select([]))


@pytest.mark.parametrize("k", [4, 6, 7])
def test_a_definitive_screening_design_is_minimally_aliased(k: int) -> None:
    """Nunez Ares & Goos (2020), Table 1: twice at the middle, products four times zero.

    With an odd number of factors main effects are correlated with each other (Jones & Nachtsheim 2011).
    """
    found = rk.design_structure(rk.definitive_screening(numbers(k), center=1))
    assert set(found.zeros.values()) == {2}
    assert set(found.product_zeros.values()) == {4}
    assert found.folded_over
    assert found.minimally_aliased is (k % 2 == 0)
    assert (found.center_runs, found.mirror_pairs, found.replicates) == (1, k, ())


def test_the_twelve_runs_hold_every_factorial_of_three() -> None:
    """Box & Tyssedal (1996): projectivity 3, though an orthogonal array of strength 2 alone."""
    found = rk.design_structure(rk.plackett_burman(numbers(11), center=0))
    assert (found.projectivity, found.strength, found.resolution) == (3, 2, 3)
    assert not found.minimally_aliased


@pytest.mark.parametrize(
    ("k", "generators", "resolution", "projectivity"),
    [  # Box & Draper (2007), chapter 5
        (3, ["C=AB"], 3, 2),
        (7, ["D=AB", "E=AC", "F=BC", "G=ABC"], 3, 2),
        (8, ["E=ABC", "F=ABD", "G=ACD", "H=BCD"], 4, 3),
        (8, ["G=ABCD", "H=ABEF"], 5, 4),
    ],
)
def test_resolution_is_read_off_the_runs(
    k: int, generators: list, resolution: int, projectivity: int
) -> None:
    made = fraction(k, generators)
    found = rk.design_structure(rk.Design(numbers(k), made.coded, ("factorial",) * len(made.coded)))
    assert (found.resolution, found.projectivity) == (resolution, projectivity)
    assert made.resolution == resolution


def test_words_and_clear_effects_of_a_fraction() -> None:
    """Montgomery (2013), 8.4: 2^(7-2) has words of 4, 5, 5; all main effects clear, 15 interactions too."""
    made = fraction(7, ["F=ABCD", "G=ABDE"])
    assert made.word_lengths == {4: 1, 5: 2}
    assert sum(len(effect) == 1 for effect in made.clear_effects) == 7
    assert sum(len(effect) == 2 for effect in made.clear_effects) == 15


def test_levels_blocks_replicates_and_categories() -> None:
    """Counts of a small table, by hand."""
    space = rk.Space(a=(0.0, 10.0), b=["x", "y"], c=["p", "q", "r"])
    points = np.array([[0, 0, 0], [10, 1, 0], [5, 0, 1], [5, 1, 1], [0, 0, 2], [10, 1, 2], [0, 0, 0]], float)
    found = rk.design_structure(rk.Design(space, points, ("given",) * 7, (1, 1, 2, 2, 3, 3, 3)))
    assert found.level_counts["a"] == {-1.0: 3, 0.0: 2, 1.0: 2}
    assert found.level_counts["b"] == {"x": 4, "y": 3}
    assert found.level_counts["c"] == {"p": 3, "q": 2, "r": 2}
    assert (found.distinct, found.replicates, found.center_runs) == (6, ((1, 7),), 2)
    assert found.mirror_pairs == 2  # runs 1 and 2, runs 5 and 6; category c is kept
    assert not found.folded_over
    assert found.block_sizes == {1: 2, 2: 2, 3: 3}
    assert found.balanced_blocks is False
    assert (found.two_level, found.three_level) == (("b",), ("a", "c"))
    with pytest.raises(rk.RsmkitError, match="three or more categories"):
        _ = found.minimally_aliased


def test_blocks_by_an_effect_are_balanced() -> None:
    eight = rk.in_blocks(rk.full_factorial(numbers(3)), ["ABC"])
    assert rk.design_structure(eight).balanced_blocks is True
    assert rk.design_structure(rk.full_factorial(numbers(3))).balanced_blocks is None


def test_a_design_too_large_for_its_strength_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rsmkit.design.quality.structure.MOST", 100)
    with pytest.raises(rk.RsmkitError, match="too many"):
        _ = rk.design_structure(rk.full_factorial(numbers(5))).strength
