"""Two-level designs in blocks: what is lost, and what every choice of blocks should lose."""

from math import comb

import numpy as np
import pytest

from rsmkit.design.families.two_level.factorial import fraction, fractional_factorial, full_factorial
from rsmkit.design.families.two_level.factorial_blocks import confounded_effects, in_blocks, standard_blocks
from rsmkit.errors import RsmkitError
from rsmkit.language.space import Factor, Space

SPACE = Space([Factor(name, 0.0, 2.0) for name in "abcdef"])


def test_montgomerys_four_blocks_of_a_2_to_the_5_lose_ce_too():
    """Montgomery (2013), section 7.6: ADE and BCE lose their product ABCD as well."""
    assert confounded_effects(["ADE", "BCE"]) == (("ADE",), ("BCE",), ("ABCD",))


def test_the_chains_of_a_fraction_hold_the_aliases():
    """Montgomery (2013), example 8.5: 2^(6-2) with E=ABC, F=BCD in two blocks by ABD = CDE = ACF = BEF."""
    words = fraction(6, ["E=ABC", "F=BCD"]).words
    assert confounded_effects(["ABD"], words) == (("ABD", "ACF", "BEF", "CDE"),)


@pytest.mark.parametrize(("k", "blocks", "lengths"), [
    (3, 2, [3]), (3, 4, [2, 2, 2]), (4, 4, [2, 3, 3]), (5, 4, [3, 3, 4]), (6, 4, [4, 4, 4]), (7, 8, [4] * 7),
])  # fmt: skip
def test_the_standard_blocks_are_those_of_the_tables(k, blocks, lengths):
    """Montgomery (2013), table 7.9: the lengths of the effects lost."""
    chains = confounded_effects(standard_blocks(k, blocks))
    assert sorted(len(effect) for (effect,) in chains) == lengths


def test_every_factor_is_in_balance_within_every_block():
    """Effects that are not lost add to zero in each block."""
    words = standard_blocks(6, 8)
    design = in_blocks(full_factorial(SPACE), words)
    lost = {effect for (effect,) in confounded_effects(words)}
    blocks = np.array(design.blocks)
    for block in range(1, 9):
        part = design.coded[blocks == block]
        assert len(part) == 8
        for j, letter in enumerate("ABCDEF"):
            assert part[:, j].sum() == pytest.approx(0.0, abs=1e-12)
            for i in range(j):
                both = (part[:, i] * part[:, j]).sum()
                assert (abs(both) > 1e-9) == ("ABCDEF"[i] + letter in lost)


def test_seven_factors_in_blocks_of_four_lose_as_few_pairs_as_can_be():
    """Seven factors on three columns: at best 3, 2 and 2 of them on one."""
    pairs = [e for (e,) in confounded_effects(standard_blocks(7, 32)) if len(e) == 2]
    assert len(pairs) == comb(3, 2) + 2


def test_a_fraction_with_centre_points_takes_blocks():
    design = in_blocks(fractional_factorial(SPACE, ["E=ABC", "F=BCD"], center=4), ["ABD"])
    assert [design.blocks.count(b) for b in (1, 2)] == [10, 10]


@pytest.mark.parametrize(("effects", "message"), [
    (["ABX"], "must be a product of A, B, C, D, E, F"), (["AAB"], "must be a product"),
    (["ABC", "BCD", "AD"], "aliased with a product"), ([""], "must be a product"),
])  # fmt: skip
def test_effects_that_make_no_blocks_are_refused(effects, message):
    with pytest.raises(RsmkitError, match=message):
        in_blocks(full_factorial(SPACE), effects)


def test_three_levels_are_refused():
    with pytest.raises(RsmkitError, match="two levels"):
        in_blocks(full_factorial(SPACE, 3), ["AB"])
    with pytest.raises(RsmkitError, match="powers of two"):
        standard_blocks(4, 3)
