"""Two-level factorials and fractions in blocks, and the effects that go with the blocks.

Blocks are told apart by the signs of chosen effects; these, and all their products, cannot be told from
differences between blocks (Box & Hunter 1961, Technometrics 3(3), 311-351; Montgomery, *Design and Analysis
of Experiments*, 8th ed. (2013), chapter 7).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations, product

import numpy as np

from rsmkit.design.design import Design
from rsmkit.design.families.two_level.factorial import LETTERS, STANDARD, standard_generators
from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked

__all__ = ["confounded_effects", "in_blocks", "standard_blocks"]


@checked
def in_blocks(design: Design, effects: Sequence[str]) -> Design:
    """Put the runs of a two-level design into blocks by the signs of some effects.

    Parameters
    ----------
    design : Design
        Factors at two levels, perhaps with centre points; the first factor is A, the second B, ... (without
        I). Centre points are dealt out to the blocks in turn.
    effects : sequence of str
        ``["ABC", "CDE"]`` makes four blocks. :func:`standard_blocks` has a choice that loses little,
        :func:`confounded_effects` all that is lost.

    Raises
    ------
    RsmkitError
        For a design with other levels, or effects that do not make blocks of equal size.

    Examples
    --------
    >>> import rsmkit as rk
    >>> in_blocks(rk.full_factorial(rk.Space(a=(0, 1), b=(0, 1), c=(0, 1))), ["ABC"]).blocks
    (1, 2, 2, 1, 2, 1, 1, 2)
    """
    words = _words(effects, len(design.space))
    low, high = design.points.min(axis=0), design.points.max(axis=0)
    scaled = (2.0 * design.points - low - high) / np.where(high > low, high - low, 1.0)
    signs = np.round(scaled)
    center = np.array([kind == "center" for kind in design.kinds])
    if (np.abs(np.abs(signs[~center]) - 1.0) > 0).any() or (np.abs(scaled - signs) > 1e-6).any():
        raise RsmkitError("blocks by effects are for designs with every factor at two levels")
    contrasts = [signs[~center][:, [LETTERS.index(x) for x in word]].prod(axis=1) > 0 for word in words]
    number = sum(2**i * np.asarray(contrast, int) for i, contrast in enumerate(contrasts))
    counts = np.bincount(number, minlength=2 ** len(words))
    if np.ptp(counts):
        raise RsmkitError(
            f"effects {', '.join(words)} make blocks of {', '.join(map(str, counts))} runs: one of them is "
            "aliased with a product of the others"
        )
    blocks = np.empty(len(design), int)
    blocks[~center] = 1 + number
    blocks[center] = 1 + np.arange(center.sum()) % len(counts)
    return replace(design, blocks=tuple(blocks.tolist()))


@checked
def standard_blocks(k: int, blocks: int) -> tuple[str, ...]:
    """Choose effects that put the full two-level factorial of `k` factors into blocks and lose little.

    Each block is a regular fraction, and the effects that are lost are its defining relation: the standard
    fraction of minimum aberration where there is one, else factors share the columns of a block evenly.

    Raises
    ------
    RsmkitError
        If the blocks are not a power of two that leaves two runs in each.

    Examples
    --------
    >>> standard_blocks(4, 2), standard_blocks(6, 4)
    (('ABCD',), ('ABCE', 'BCDF'))
    """
    generated = round(math.log2(blocks)) if blocks > 0 else 0
    if 2**generated != blocks or not 0 <= generated < k or k > len(LETTERS):
        raise RsmkitError(
            f"a factorial of {k} factors at two levels has blocks by powers of two, up to {2 ** (k - 1)}, "
            f"got {blocks}"
        )
    if (k, generated) in STANDARD:
        texts = standard_generators(k, generated)
        return tuple("".join(sorted(text.replace("=", "").replace("-", ""))) for text in texts)
    basic = k - generated
    columns = [set(s) for size in range(1, basic + 1) for s in combinations(range(basic), size)]
    columns = columns[basic:] + columns[:basic]
    found = []
    for i in range(generated):
        letters = {LETTERS[j] for j in columns[i % len(columns)]} | {LETTERS[basic + i]}
        found.append("".join(sorted(letters)))
    return tuple(found)


@checked
def confounded_effects(effects: Sequence[str], relation: Sequence[str] = ()) -> tuple[tuple[str, ...], ...]:
    """List all effects that cannot be told from blocks: those that make them, products, and their aliases.

    Parameters
    ----------
    effects : sequence of str
        That make the blocks.
    relation : sequence of str
        Words of the defining relation of a fraction (:attr:`Fraction.words`).

    Returns
    -------
    tuple of tuple of str
        One chain of aliases for each difference between blocks, the shortest effect first; ``I`` is the mean.

    Examples
    --------
    >>> confounded_effects(["ABC", "CDE"])
    (('ABC',), ('CDE',), ('ABDE',))
    """
    words = [""] + [word.lstrip("-") for word in relation]
    chains = []
    for chosen in product((False, True), repeat=len(effects)):
        if any(chosen):
            effect = _product(*(word for word, used in zip(effects, chosen, strict=True) if used))
            chain = {_product(effect, word) or "I" for word in words}
            chains.append(tuple(sorted(chain, key=_reading)))
    return tuple(sorted(chains, key=lambda chain: _reading(chain[0])))


def _words(effects: Sequence[str], k: int) -> list[str]:
    words = ["".join(sorted(str(effect).upper().replace("*", ""))) for effect in effects]
    for word in words:
        if not word or set(word) - set(LETTERS[:k]) or len(set(word)) < len(word):
            raise RsmkitError(
                f"effect '{word}' of blocks must be a product of {', '.join(LETTERS[:k])}, as in "
                f"'{LETTERS[: min(k, 3)]}'"
            )
    return words


def _product(*words: str) -> str:
    letters: set[str] = set()
    for word in words:
        letters ^= set(word)
    return "".join(sorted(letters))


def _reading(effect: str) -> tuple[int, str]:
    return (len(effect), effect)
