"""Classical families against their published sizes and their defining properties."""

from __future__ import annotations

import csv
import math
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from rsmkit.design.families.box_behnken import box_behnken
from rsmkit.design.families.composite import ccd
from rsmkit.design.families.two_level.factorial import (
    fraction,
    fractional_factorial,
    full_factorial,
    standard_generators,
)
from rsmkit.design.families.two_level.screening import definitive_screening, plackett_burman
from rsmkit.design.quality.assessment import assess
from rsmkit.errors import RsmkitError
from rsmkit.language.space import Factor, Space
from rsmkit.language.terms import full_terms

CATALOGUE = Path(__file__).parents[2] / "data/design/catalogue.csv"


def space(k: int) -> Space:
    return Space(Factor(f"x{j + 1}", -1.0, 1.0) for j in range(k))


def published_runs(family: str) -> list[tuple[int, int]]:
    with open(CATALOGUE, newline="") as stream:
        return [(int(r["k"]), int(r["n"])) for r in csv.DictReader(stream) if r["design"] == family]


@pytest.mark.parametrize(("k", "runs"), published_runs("bbd"))
def test_box_behnken_runs(k, runs):
    assert len(box_behnken(space(k), center=3)) == runs


@pytest.mark.parametrize(("k", "edges"), [(9, 120), (10, 160), (11, 176), (12, 192), (16, 384)])
def test_box_behnken_runs_of_the_larger_published_sizes(k, edges):
    """130, 170, 188, 204 and 396 runs with the paper's 10, 10, 12, 12 and 12 centre points."""
    design = box_behnken(space(k), center=0)
    assert len(design) == edges
    assert set(np.unique(design.coded)) == {-1.0, 0.0, 1.0}
    assert len(np.unique((design.coded != 0).sum(axis=0))) == 1  # every factor varies equally often


@pytest.mark.parametrize("k", [4, 7])
def test_box_behnken_of_four_and_seven_factors_is_rotatable(k):
    """Box & Behnken (1960): exactly rotatable for k = 4 and 7, so sum x^4 = 3 sum x_i^2 x_j^2."""
    x = box_behnken(space(k), center=0).coded
    for i, j in combinations(range(k), 2):
        assert (x[:, i] ** 4).sum() == 3 * (x[:, i] ** 2 * x[:, j] ** 2).sum()


@pytest.mark.parametrize(
    "k", [3, 5, 6, pytest.param(9, marks=pytest.mark.slow), pytest.param(12, marks=pytest.mark.slow)]
)
def test_box_behnken_estimates_the_full_quadratic(k):
    assert assess(box_behnken(space(k))).rank == (k + 1) * (k + 2) // 2


def test_box_behnken_of_eight_factors_does_not_exist():
    with pytest.raises(RsmkitError, match="not 8"):
        box_behnken(space(8))


@pytest.mark.parametrize("runs", [*range(4, 101, 4), 112])
def test_plackett_burman_columns_are_orthogonal(runs):
    x = plackett_burman(space(runs - 1)).coded
    assert x.shape == (runs, runs - 1)
    assert set(np.unique(x)) == {-1.0, 1.0}
    np.testing.assert_array_equal(x.T @ x, runs * np.eye(runs - 1))
    np.testing.assert_array_equal(x.sum(axis=0), 0.0)


# Largest sums over the runs of the products of three columns: of the tables of Plackett & Burman (1946) as
# listed in R's FrF2 2.3 (pb.list and its doubling; its 32 runs replaced by the paper's own first row).
LARGEST_SUMS = {
    8: 8, 12: 4, 16: 16, 20: 12, 24: 8, 28: 12, 32: 32, 36: 12, 40: 40, 44: 12, 48: 16, 52: 44, 56: 56,
    60: 12, 64: 64, 68: 20, 72: 16, 76: 68, 80: 16, 84: 20, 88: 88, 92: 84, 96: 96, 100: 92,
}  # fmt: skip


def largest_sum(x):
    """Largest absolute sum of the products of three different columns."""
    pairs = ((a, b) for a in range(x.shape[1]) for b in range(a))
    return max(np.abs((x[:, a] * x[:, b]) @ x[:, :b]).max(initial=0) for a, b in pairs)


@pytest.mark.parametrize(("runs", "published"), LARGEST_SUMS.items())
def test_plackett_burman_confuses_three_columns_as_published(runs, published):
    x = plackett_burman(space(runs - 1)).coded
    assert largest_sum(x) == published
    if runs in (40, 56, 64, 88, 96):  # doubled: only the last column is ever a product of two others
        assert largest_sum(x[:, :-1]) < 2 * runs / 3


@pytest.mark.parametrize(
    ("runs", "row"),
    [
        (12, "++-+++---+-"),
        (20, "++--++++-+-+----++-"),
        (24, "+++++-+-++--++--+-+----"),
        (36, "-+-+++---+++++-+++--+----+-+-++--+-"),
    ],
)
def test_plackett_burman_shifts_the_published_row(runs, row):
    """Plackett & Burman (1946), table: the row, its cyclic shifts, and a row of minus signs."""
    x = plackett_burman(space(runs - 1)).coded
    first = np.where(np.array(list(row)) == "+", 1.0, -1.0)
    np.testing.assert_array_equal(x[:-1], [np.roll(first, turn) for turn in range(runs - 1)])
    np.testing.assert_array_equal(x[-1], -1.0)


def test_an_unknown_plackett_burman_size_is_refused_with_the_next_one():
    with pytest.raises(RsmkitError, match="set runs = 120"):
        plackett_burman(space(20), runs=116)


def test_plackett_burman_takes_the_smallest_size_that_holds_all_factors():
    assert [len(plackett_burman(space(k))) for k in (3, 4, 11, 12, 23, 24, 27, 28)] == [
        4,
        8,
        12,
        16,
        24,
        28,
        28,
        32,
    ]


@pytest.mark.parametrize(("k", "runs"), published_runs("dsd"))
def test_definitive_screening(k, runs):
    design = definitive_screening(space(k))
    x = design.coded
    assert len(design) == runs == 2 * k + 1
    np.testing.assert_array_equal(x[0:-1:2], -x[1:-1:2])  # fold-over pairs
    np.testing.assert_array_equal((x[:-1] == 0).sum(axis=1), 1)  # one factor at its centre in every run
    np.testing.assert_array_equal((x == 0).sum(axis=0), 3)
    for a, b in combinations(range(k), 2):  # main effects clear of interactions and of squares
        np.testing.assert_array_equal(x.T @ (x[:, a] * x[:, b]), 0.0)
    np.testing.assert_array_equal(x.T @ x**2, 0.0)


@pytest.mark.parametrize("k", [4, 6, 8, 10, 12, 14, 16, 18, 26])
def test_definitive_screening_from_a_conference_matrix_is_orthogonal(k):
    x = definitive_screening(space(k)).coded
    np.testing.assert_array_equal(x.T @ x, 2 * (k - 1) * np.eye(k))


def test_definitive_screening_of_five_factors_is_as_good_as_published():
    """Jones & Nachtsheim (2011): largest |correlation| of main effects 0.25 for the 11-run design."""
    x = definitive_screening(space(5)).coded
    gram = x.T @ x
    assert np.abs(gram / gram[0, 0] - np.eye(5)).max() <= 0.25


# shortest words of the minimum-aberration fractions: Wu & Hamada (2009), appendix 5A; those of 12 to 15
# factors in 32 to 256 runs: R FrF2 2.3 (catlg, after Chen, Sun & Wu 1993 and Xu 2009)
@pytest.mark.parametrize(
    ("k", "generated", "resolution", "shortest"),
    [
        (5, 1, 5, 1),
        (5, 2, 3, 2),
        (6, 2, 4, 3),
        (7, 2, 4, 1),
        (7, 3, 4, 7),
        (7, 4, 3, 7),
        (8, 2, 5, 2),
        (8, 3, 4, 3),
        (8, 4, 4, 14),
        (9, 2, 6, 3),
        (9, 3, 4, 1),
        (9, 4, 4, 6),
        (9, 5, 3, 4),
        (10, 3, 5, 3),
        (10, 4, 4, 2),
        (10, 5, 4, 10),
        (10, 6, 3, 8),
        (11, 4, 5, 6),
        (11, 5, 4, 4),
        (11, 6, 4, 25),
        (11, 7, 3, 12),
        (12, 7, 4, 38),
        (12, 6, 4, 6),
        (12, 5, 4, 1),
        (12, 4, 6, 12),
        (12, 8, 3, 16),
        (13, 8, 4, 55),
        (13, 7, 4, 14),
        (13, 6, 4, 2),
        (13, 5, 5, 3),
        (14, 9, 4, 77),
        (14, 8, 4, 22),
        (14, 7, 4, 3),
        (14, 6, 5, 9),
        (15, 10, 4, 105),
        (15, 9, 4, 30),
        (15, 8, 4, 7),
        (15, 7, 5, 15),
        (13, 9, 3, 22),
        (14, 10, 3, 28),
        (15, 11, 3, 35),
    ],
)
def test_standard_fractions_have_minimum_aberration(k, generated, resolution, shortest):
    found = fraction(k, standard_generators(k, generated))
    assert found.resolution == resolution
    assert sum(len(word) == resolution for word in found.words) == shortest
    assert len(found.words) == 2**generated - 1
    design = fractional_factorial(space(k), runs=2 ** (k - generated))
    assert len(design) == design.distinct == 2 ** (k - generated)
    letters = "ABCDEFGHJKLMNOP"
    for word in found.words:  # every word's product of columns is +1 in every run
        columns = [letters.index(letter) for letter in word.lstrip("-")]
        np.testing.assert_array_equal(design.coded[:, columns].prod(axis=1), 1.0)


def test_aliases_of_the_half_fraction():
    """2^(5-2) with D = AB, E = AC: I = ABD = ACE = BCDE (Montgomery, Design and Analysis of Experiments)."""
    found = fraction(5, ["D=AB", "E=AC"])
    assert set(found.words) == {"ABD", "ACE", "BCDE"}
    table = found.aliases(2)
    assert set(table["A"]) == {"BD", "CE"}
    assert table["B"] == ("AD",)
    assert set(table["BC"]) == {"DE"}
    assert table["I"] == ()


def test_negative_generator():
    x = fractional_factorial(space(3), ["C=-AB"]).coded
    np.testing.assert_array_equal(x.prod(axis=1), -1.0)
    assert fraction(3, ["C=-AB"]).aliases(2)["A"] == ("-BC",)


@pytest.mark.parametrize(
    ("generators", "message"),
    [
        (["E=ABCZ"], "as a product of"),
        (["A=BC"], "must define one of"),
        (["D=AB", "D=AC"], "once"),
        (["E="], "E=ABCD"),
    ],
)
def test_wrong_generators_are_explained(generators, message):
    with pytest.raises(RsmkitError, match=message):
        fraction(5, generators)


def test_full_factorial_of_mixed_levels():
    mixed = Space(speed=(0.0, 10.0), size=[1.0, 2.0, 5.0], tool=["A", "B"])
    design = full_factorial(mixed, {"speed": 4})
    assert len(design) == design.distinct == 4 * 3 * 2
    np.testing.assert_allclose(np.unique(design.points[:, 0]), [0, 10 / 3, 20 / 3, 10], rtol=1e-14)
    assert set(design.points[:, 1]) == {1.0, 2.0, 5.0}
    with pytest.raises(RsmkitError, match="has no centre"):
        full_factorial(mixed, center=1)


def test_half_fraction_composite_with_orthogonal_blocks():
    """rsm's ccd(4, generators = x5 ~ x1*x2*x3*x4) with 6 + 1 centre points: alpha 2, 33 runs."""
    design = ccd(space(5), alpha="orthogonal", generators=["E=ABCD"], center=6, center_axial=1, blocked=True)
    assert len(design) == 33
    np.testing.assert_allclose(np.abs(design.coded).max(), 2.0, rtol=1e-14)
    assert assess(design).rank == 21


@pytest.mark.parametrize(("k", "center", "center_axial"), [(2, 3, 3), (3, 4, 2), (4, 6, 2)])
def test_orthogonal_blocks_do_not_touch_the_model(k, center, center_axial):
    """Box & Hunter (1957): block means of every model column agree, up to the constant."""
    design = ccd(space(k), alpha="orthogonal", center=center, center_axial=center_axial, blocked=True)
    X = full_terms(k).matrix(design.coded)
    blocks = np.array(design.blocks)
    np.testing.assert_allclose(X[blocks == 1].mean(axis=0), X[blocks == 2].mean(axis=0), atol=1e-14)


def test_replicated_star_points():
    """Rotatable: sum x^4 = 3 sum x_i^2 x_j^2, so F + 2 r alpha^4 = 3 F; Myers et al., section 8.3."""
    design = ccd(space(3), star_replicates=2, center=4)
    x = design.coded
    assert len(design) == 8 + 2 * 6 + 4
    assert len(np.unique(x[np.array(design.kinds) == "axial"], axis=0)) == 6
    assert x.max() == pytest.approx(4**0.25, rel=1e-14)
    assert (x[:, 0] ** 4).sum() == pytest.approx(3 * (x[:, 0] ** 2 * x[:, 1] ** 2).sum(), rel=1e-14)
    # the estimates of the squares are uncorrelated
    even = ccd(space(3), star_replicates=2, alpha="uncorrelated")
    X = full_terms(3).matrix(even.coded)
    assert np.linalg.inv(X.T @ X)[7, 8] == pytest.approx(0.0, abs=1e-15)
    # blocks of cube and star leave the model alone
    blocked = ccd(space(3), star_replicates=2, alpha="orthogonal", center=4, center_axial=2, blocked=True)
    X, blocks = full_terms(3).matrix(blocked.coded), np.array(blocked.blocks)
    np.testing.assert_allclose(X[blocks == 1].mean(axis=0), X[blocks == 2].mean(axis=0), atol=1e-14)
    with pytest.raises(RsmkitError, match="star_replicates"):
        ccd(space(3), star_replicates=0)


def test_a_coarse_fraction_cannot_carry_a_composite_design():
    with pytest.raises(RsmkitError, match="resolution 4"):
        ccd(space(4), generators=["D=ABC"])


def test_runs_of_a_fraction_must_be_a_power_of_two():
    with pytest.raises(RsmkitError, match="power of two"):
        fractional_factorial(space(5), runs=12)
    assert math.log2(len(fractional_factorial(space(5), runs=16))) == 4


@pytest.mark.parametrize(
    ("k", "runs"), [(4, 27), (5, 46), (6, 54), (7, 62), (9, 130), (10, 170), (12, 204), (16, 396)]
)
def test_box_behnken_in_its_published_blocks(k, runs):
    """Box & Behnken (1960), table 4: blocks that leave every column of the quadratic alone."""
    count = {4: 3, 9: 5, 16: 6}.get(k, 2)
    center = {4: 3, 5: 6, 6: 6, 7: 6, 9: 10, 10: 10, 12: 12, 16: 12}[k]
    design = box_behnken(space(k), center=center, blocked=True)
    blocks = np.array(design.blocks)
    assert len(design) == runs
    assert np.bincount(blocks)[1:].tolist() == [runs // count] * count
    X = full_terms(k).matrix(design.coded)
    for block in range(2, count + 1):
        np.testing.assert_allclose(X[blocks == block].mean(axis=0), X[blocks == 1].mean(axis=0), atol=1e-14)


def test_box_behnken_without_blocks_and_uneven_centres_are_explained():
    with pytest.raises(RsmkitError, match="set blocked = false"):
        box_behnken(space(3), blocked=True)
    with pytest.raises(RsmkitError, match="multiple of 2"):
        box_behnken(space(5), blocked=True)


@pytest.mark.parametrize(
    ("k", "corners"), [(5, 16), (6, 32), (7, 64), (8, 64), (9, 128), (10, 128), (11, 128)]
)
def test_composite_design_on_a_fractional_cube(k, corners):
    """Smallest fractions of resolution five: Myers, Montgomery & Anderson-Cook, section 7.4."""
    design = ccd(space(k), cube="fraction")
    assert design.kinds.count("factorial") == corners
    assert assess(design).rank == (k + 1) * (k + 2) // 2
    np.testing.assert_allclose(design.coded.max(), corners**0.25, rtol=1e-14)


def test_composite_design_is_run_at_every_category():
    mixed = Space(x=(0.0, 1.0), tool=["A", "B", "C"], y=(0.0, 1.0))
    design = ccd(mixed, center=1, alpha="orthogonal", blocked=True)
    assert len(design) == 27
    for level in range(3):
        part = design.points[:, 1] == level
        alone = ccd(space(2), center=1, alpha="orthogonal").coded
        np.testing.assert_allclose(design.coded[part][:, [0, 2]], alone, rtol=1e-14)
    assert set(design.blocks) == {1, 2}
    assert assess(design).rank == 12


@pytest.mark.parametrize(
    ("numeric", "categorical", "runs"), [(4, 2, 14), (4, 1, 14), (3, 3, 14), (10, 2, 26)]
)
def test_definitive_screening_with_categories(numeric, categorical, runs):
    """Jones & Nachtsheim (2013): 2 m + 2 runs for m columns, m even; fold-over clears main effects."""
    mixed = Space(
        [Factor(f"x{j}", -1.0, 1.0) for j in range(numeric)]
        + [Factor(f"c{j}", levels=("low", "high")) for j in range(categorical)]
    )
    design = definitive_screening(mixed, center=2)
    x = design.coded.copy()
    x[:, numeric:] = 2.0 * x[:, numeric:] - 1.0
    assert len(design) == runs
    np.testing.assert_array_equal(x[::2], -x[1::2])
    assert set(np.unique(x[:, numeric:])) == {-1.0, 1.0}
    np.testing.assert_array_equal(x.T @ x**2, 0.0)
    for a, b in combinations(range(numeric + categorical), 2):
        np.testing.assert_array_equal(x.T @ (x[:, a] * x[:, b]), 0.0)
    assert assess(design, order=1).rank == numeric + categorical + 1


@pytest.mark.parametrize("k", [3, 5, 7, 9, 11])
def test_definitive_screening_of_an_odd_number_is_orthogonal_with_two_runs_more(k):
    """Xiao, Lin & Bai (2012): drop a column of the next conference matrix."""
    x = definitive_screening(space(k), runs=2 * k + 3).coded
    np.testing.assert_array_equal(x.T @ x, 2 * k * np.eye(k))
    with pytest.raises(RsmkitError, match=f"has {2 * k + 1} runs, or an even number more"):
        definitive_screening(space(k), runs=2 * k + 2)


def test_a_third_of_three_levels_is_a_latin_square():
    design = full_factorial(space(3), 3, reduction=3)
    assert len(design) == design.distinct == 9
    for a, b in combinations(range(3), 2):  # every pair of levels once
        assert len(np.unique(design.coded[:, [a, b]], axis=0)) == 9
    with pytest.raises(RsmkitError, match="second largest"):
        full_factorial(space(3), 3, reduction=4)


@pytest.mark.parametrize(("k", "runs"), [(3, 10), (4, 16), (6, 28), (7, 46), (9, 82)])
def test_small_composite_designs_have_the_published_sizes_and_estimate_everything(k, runs):
    """Hartley (1959); Box & Draper (2007), table 15.7: cube and star without centre points."""
    assert len(ccd(space(k), cube="small", center=0)) == runs
    columns = full_terms(k).matrix(ccd(space(k), cube="small", center=1).coded)
    assert np.linalg.matrix_rank(columns) == columns.shape[1]
