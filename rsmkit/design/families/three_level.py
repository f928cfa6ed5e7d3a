"""Three-level factorials: components of interactions, blocks, and fractions.

An interaction of two factors at three levels has four degrees of freedom: two of the sums x1 + x2 modulo 3,
the component AB, and two of x1 + 2 x2, AB2, where levels count 0, 1, 2 (Montgomery, *Design and Analysis of
Experiments*, 8th ed. (2013), chapter 9; Yates 1937 called them J and I). Words have the exponent of their
first letter equal to one: A2B is AB2.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rsmkit.design.design import Design
from rsmkit.design.families.two_level.factorial import LETTERS, full_factorial
from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.io.shown import Shown
from rsmkit.language.space import Space

__all__ = [
    "InteractionComponent",
    "component_relation",
    "interaction_components",
    "three_level_blocks",
    "three_level_fraction",
]

Exponents = tuple[int, ...]


@dataclass(frozen=True)
class InteractionComponent(Shown):
    """Two degrees of freedom of a main effect or an interaction.

    Parameters
    ----------
    word : str
        ``A``, ``AB``, ``AB2``, ...
    ss : float
        Sum of squares between its three groups of runs.
    totals : tuple of float
        Sums of the response where the component is 0, 1, 2.
    df : int
    """

    word: str
    ss: float
    totals: tuple[float, float, float]
    df: int = 2


@checked
def component_relation(words: Sequence[str]) -> tuple[str, ...]:
    """List all components that go with some: what blocks by these words take, or the relation of a fraction.

    Parameters
    ----------
    words : sequence of str
        Independent components, such as ``["ABC", "AB2D2"]``; letters are the factors in order, without I.

    Returns
    -------
    tuple of str
        The words and all their products, the shortest first.

    Examples
    --------
    >>> component_relation(["ABC", "AB2D2"])
    ('ABC', 'AB2D2', 'AC2D', 'BC2D2')
    """
    if not words:
        raise RsmkitError("components: name at least one, such as 'AB2'")
    read = [_read(word, len(LETTERS)) for word in words]
    found = set()
    for powers in product(range(3), repeat=len(read)):
        total = _normal(np.array(powers, int) @ np.array(read, int) % 3)
        if any(powers):
            if not any(total):
                raise RsmkitError(f"components {', '.join(words)}: one is a product of the others")
            found.add(total)
    named = [(sum(map(bool, e)), _written(tuple(map(bool, e))), _written(e)) for e in found]
    return tuple(word for _, _, word in sorted(named))


@checked
def three_level_blocks(design: Design, words: Sequence[str]) -> Design:
    """Put the runs of a three-level design into blocks by components of interactions.

    Parameters
    ----------
    design : Design
        Every factor at three levels; the first is A, the second B, ... (without I).
    words : sequence of str
        ``["AB2"]`` makes three blocks, two words nine. :func:`component_relation` has all that is lost.

    Examples
    --------
    >>> import rsmkit as rk
    >>> nine = rk.full_factorial(rk.Space(a=(0, 2), b=(0, 2)), levels=3)
    >>> three_level_blocks(nine, ["AB2"]).blocks
    (1, 2, 3, 3, 1, 2, 2, 3, 1)
    """
    component_relation(words)  # refuses words that depend on each other
    levels = _levels(design)
    number = sum(3**i * _values(levels, word) for i, word in enumerate(words))
    counts = np.bincount(np.asarray(number), minlength=3 ** len(words))
    if np.ptp(counts):
        raise RsmkitError(
            f"components {', '.join(words)} make blocks of {', '.join(map(str, counts))} runs: some of them "
            "are aliased in this design"
        )
    return replace(design, blocks=tuple((1 + np.asarray(number)).tolist()))


@checked
def three_level_fraction(space: Space, words: Sequence[str], values: Sequence[int] | None = None) -> Design:
    """Runs of the three-level factorial at which components have given values: a 3^(k-p) fraction.

    Parameters
    ----------
    space : Space
    words : sequence of str
        The defining relation, p independent components: ``["AB2CD"]``.
    values : sequence of int, optional
        0, 1 or 2 for each word; 0 by default.

    Examples
    --------
    >>> import rsmkit as rk
    >>> space = rk.Space(a=(0, 1), b=(0, 1), c=(0, 1), d=(0, 1))
    >>> len(three_level_fraction(space, ["AB2CD"]))
    27
    """
    wanted = [0] * len(words) if values is None else list(values)
    if len(wanted) != len(words) or any(value not in (0, 1, 2) for value in wanted):
        raise RsmkitError(f"a fraction needs a value 0, 1 or 2 for each of {', '.join(words)}")
    component_relation(words)
    whole = full_factorial(space, levels=3)
    levels = _levels(whole)
    kept = np.ones(len(whole), bool)
    for word, value in zip(words, wanted, strict=True):
        kept &= _values(levels, word) == value
    return whole.select(kept)


@checked
def interaction_components(
    design: Design, y: ArrayLike, *, order: int = 2
) -> tuple[InteractionComponent, ...]:
    """Divide main effects and interactions of a three-level design into components of two degrees of freedom.

    In a full factorial with equally many runs everywhere the components are orthogonal, and those of an
    interaction add up to its sum of squares.

    Parameters
    ----------
    design : Design
        Every factor at three levels.
    y : array, shape (n,)
    order : int
        Most factors in an interaction.

    Examples
    --------
    >>> import rsmkit as rk
    >>> nine = rk.full_factorial(rk.Space(a=(0, 2), b=(0, 2)), levels=3)
    >>> [row.word for row in interaction_components(nine, [1, 2, 3, 2, 4, 6, 3, 6, 9])]
    ['A', 'B', 'AB', 'AB2']
    """
    try:
        response = np.asarray(y, float)
    except (TypeError, ValueError):
        raise RsmkitError("components need numbers as responses") from None
    if response.shape != (len(design),) or not np.isfinite(response).all():
        raise RsmkitError(
            f"components need a finite number for each of {len(design)} runs, got shape {response.shape}"
        )
    levels, found = _levels(design), []
    centre = response.sum() ** 2 / len(response)
    for size in range(1, order + 1):
        for some in combinations(range(len(design.space)), size):
            for powers in product((1, 2), repeat=size - 1):
                exponents = [0] * len(design.space)
                for place, power in zip(some, (1, *powers), strict=True):
                    exponents[place] = power
                value = levels @ exponents % 3
                counts = np.bincount(value, minlength=3)
                totals = np.bincount(value, response, minlength=3)
                ss = float((totals[counts > 0] ** 2 / counts[counts > 0]).sum() - centre)
                found.append(InteractionComponent(_written(tuple(exponents)), ss, tuple(totals.tolist())))
    return tuple(found)


def _read(word: str, k: int) -> Exponents:
    """Exponents of a word, that of its first letter one."""
    text = str(word).upper().translate(str.maketrans("\N{SUPERSCRIPT TWO}\N{SUPERSCRIPT THREE}", "23"))
    text = re.sub(r"[\s*^]", "", text)
    parts = re.findall(rf"([{LETTERS[:k]}])([12]?)", text)
    letters = [letter for letter, _ in parts]
    if "".join(a + b for a, b in parts) != text or not text or len(set(letters)) < len(letters):
        raise RsmkitError(
            f"component '{word}' must be a product of {', '.join(LETTERS[: min(k, 4)])}, ..., each once, "
            "with a 2 for a square: 'AB2C'"
        )
    powers = {letter: int(power or 1) for letter, power in parts}
    return _normal(np.array([powers.get(letter, 0) for letter in LETTERS[:k]]))


def _normal(exponents: NDArray[np.int_]) -> Exponents:
    """The same component with the first exponent one: squared if it is two."""
    used = exponents[np.flatnonzero(exponents)]
    squared = bool(used.size) and used[0] == 2
    return tuple(int(x) for x in (2 * exponents % 3 if squared else exponents))


def _written(exponents: Exponents) -> str:
    pairs = zip(LETTERS, exponents, strict=False)
    return "".join(letter + ("2" if power == 2 else "") for letter, power in pairs if power)


def _levels(design: Design) -> NDArray[np.int_]:
    """Levels 0, 1, 2 of every factor, shape (n, k)."""
    found = np.empty(design.points.shape, int)
    for j, name in enumerate(design.space.names):
        values, found[:, j] = np.unique(np.round(design.coded[:, j], 9), return_inverse=True)
        if len(values) != 3:
            raise RsmkitError(f"components are for factors at three levels; {name} has {len(values)}")
    return found


def _values(levels: NDArray[np.int_], word: str) -> NDArray[np.int_]:
    """Value 0, 1 or 2 of a component at each run."""
    found: NDArray[np.int_] = levels @ np.array(_read(word, levels.shape[1])) % 3
    return found
