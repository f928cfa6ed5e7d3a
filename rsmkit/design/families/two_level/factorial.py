"""Full and fractional factorial designs, with their generators, words, resolution and aliases."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from string import ascii_uppercase

import numpy as np

from rsmkit.design.design import Design, classical
from rsmkit.design.families import pydoe
from rsmkit.design.families.site import Site
from rsmkit.design.options import MOST_RUNS, DesignOptions, Problems, counts
from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.io.option_fields import doc
from rsmkit.language.space import Floats, Space

__all__ = [
    "FactorialOptions",
    "Fraction",
    "FractionalFactorialOptions",
    "fraction",
    "fractional_factorial",
    "full_factorial",
    "make_factorial",
    "make_fractional_factorial",
    "standard_generators",
]

LETTERS = ascii_uppercase.replace("I", "")
"""Factor letters of generators; I stands for the identity."""
LARGEST = 100_000

# Minimum aberration generators (factors, generated factors): Box, Hunter & Hunter (2005), Statistics for
# Experimenters, table 6.22, and Wu & Hamada (2009), Experiments, appendix 5A.
STANDARD = {
    (3, 1): "C=AB",
    (4, 1): "D=ABC",
    (5, 1): "E=ABCD",
    (5, 2): "D=AB E=AC",
    (6, 1): "F=ABCDE",
    (6, 2): "E=ABC F=BCD",
    (6, 3): "D=AB E=AC F=BC",
    (7, 1): "G=ABCDEF",
    (7, 2): "F=ABCD G=ABDE",
    (7, 3): "E=ABC F=BCD G=ACD",
    (7, 4): "D=AB E=AC F=BC G=ABC",
    (8, 1): "H=ABCDEFG",
    (8, 2): "G=ABCD H=ABEF",
    (8, 3): "F=ABC G=ABD H=BCDE",
    (8, 4): "E=BCD F=ACD G=ABC H=ABD",
    (9, 1): "J=ABCDEFGH",
    (9, 2): "H=ACDFG J=BCEFG",
    (9, 3): "G=ABCD H=ACEF J=CDEF",
    (9, 4): "F=BCDE G=ACDE H=ABDE J=ABCE",
    (9, 5): "E=ABC F=BCD G=ACD H=ABD J=ABCD",
    (10, 1): "K=ABCDEFGHJ",
    (10, 2): "J=ABCDEF K=ABCDGH",
    (10, 3): "H=ABCG J=BCDE K=ACDF",
    (10, 4): "G=BCDF H=ACDF J=ABDE K=ABCE",
    (10, 5): "F=ABCD G=ABCE H=ABDE J=ACDE K=BCDE",
    (10, 6): "E=ABC F=BCD G=ACD H=ABD J=ABCD K=AB",
    (11, 4): "H=ABCG J=BCDE K=ACDF L=ABCDEFG",
    (11, 5): "G=CDE H=ABCD J=ABF K=BDEF L=ADEF",
    (11, 6): "F=ABC G=BCD H=CDE J=ACD K=ADE L=BDE",
    (11, 7): "E=ABC F=BCD G=ACD H=ABD J=ABCD K=AB L=AC",
    (12, 4): "J=ABCDEFG K=ABCDH L=ABEFH M=ACEGH",
    (12, 5): "H=ABCDE J=ABCFG K=ABDF L=ACEG M=ADEFG",
    (12, 6): "G=ABC H=ABD J=ACDE K=ACDF L=ABEF M=BCDEF",
    (12, 7): "F=ABC G=ABD H=ACD J=BCD K=ABE L=ACE M=ADE",
    (12, 8): "E=ABC F=ABD G=ACD H=BCD J=ABCD K=AB L=AC M=AD",
    (13, 5): "J=ABCDEFG K=ABCDH L=ABEFH M=ACEGH N=ADFG",
    (13, 6): "H=ABCDE J=ABCFG K=ABDF L=ACEG M=CDF N=BCEG",
    (13, 7): "G=ABC H=ABD J=ACE K=ADE L=BCF M=BDEF N=CDEF",
    (13, 8): "F=ABC G=ABD H=ACD J=BCD K=ABE L=ACE M=BCE N=ADE",
    (13, 9): "E=ABC F=ABD G=ACD H=BCD J=ABCD K=AB L=AC M=AD N=BC",
    (14, 6): "J=ABCDEFG K=ABCDH L=ABEFH M=ACEGH N=ADFG O=ABDE",
    (14, 7): "H=ABCDE J=ABCFG K=ABDF L=ACEG M=BCDF N=ACDEF O=BEFG",
    (14, 8): "G=ABC H=ABD J=ABE K=BCDE L=ACF M=ADF N=AEF O=CDEF",
    (14, 9): "F=ABC G=ABD H=ACD J=BCD K=ABE L=ACE M=BCE N=ADE O=BDE",
    (14, 10): "E=ABC F=ABD G=ACD H=BCD J=ABCD K=AB L=AC M=AD N=BC O=BD",
    (15, 7): "J=ABCDEFG K=ABCDH L=ABEFH M=ACEGH N=ADFG O=ABDE P=BCDF",
    (15, 8): "H=ABCDE J=ABCFG K=ABDF L=ACEG M=BCDF N=ACDEF O=BEFG P=ABG",
    (15, 9): "G=ABC H=ABD J=ABE K=BCDE L=ACF M=ADF N=AEF O=CDEF P=ABCDEF",
    (15, 10): "F=ABC G=ABD H=ACD J=BCD K=ABE L=ACE M=BCE N=ADE O=BDE P=CDE",
    (15, 11): "E=ABC F=ABD G=ACD H=BCD J=ABCD K=AB L=AC M=AD N=BC O=BD P=CD",
}


@dataclass(frozen=True)
class Fraction:
    """A regular two-level fraction.

    Parameters
    ----------
    k : int
        Number of factors; the first ones are basic, called A, B, C, ... (without I).
    generators : tuple of str
        ``"E=ABCD"`` (or ``"E=-ABCD"``), one per generated factor.
    words : tuple of str
        The defining relation without I, each with its sign: ``"ABCDE"``.
    """

    k: int
    generators: tuple[str, ...]
    words: tuple[str, ...]

    @property
    def resolution(self) -> int:
        """Length of the shortest word; 0 for the full factorial."""
        return min((len(word.lstrip("-")) for word in self.words), default=0)

    @property
    def word_lengths(self) -> dict[int, int]:
        """How many words have each length, ascending: the word length pattern."""
        return dict(sorted(Counter(len(word.lstrip("-")) for word in self.words).items()))

    @property
    def clear_effects(self) -> tuple[str, ...]:
        """Main effects and two-factor interactions that are aliased with no other such effect.

        Wu & Chen (1992), Technometrics 34(2), 162-175.
        """
        return tuple(effect for effect, others in self.aliases(2).items() if effect != "I" and not others)

    @property
    def coded(self) -> Floats:
        """The runs, levels -1 and 1, shape (2^(k - generated), k)."""
        basic = self.k - len(self.generators)
        columns = dict(zip(LETTERS, 2.0 * pydoe.full_factorial([2] * basic).T - 1.0, strict=False))
        for text in self.generators:
            left, right = text.split("=")
            sign = -1.0 if right.startswith("-") else 1.0
            columns[left] = sign * np.prod([columns[letter] for letter in right.lstrip("-")], axis=0)
        return np.stack([columns[letter] for letter in LETTERS[: self.k]], axis=1)

    def aliases(self, order: int = 2) -> dict[str, tuple[str, ...]]:
        """Effects up to `order` letters, and the effects up to `order` letters each cannot be told from.

        ``"I"`` is the mean. Signs are those of the aliased effect.
        """
        letters = LETTERS[: self.k]
        effects = [""] + ["".join(c) for size in range(1, order + 1) for c in combinations(letters, size)]
        table = {}
        for effect in effects:
            partners = [_product(effect, word) for word in self.words]
            near = [p for p in partners if len(p.lstrip("-")) <= order]
            table[effect or "I"] = tuple(sorted((p if p.strip("-") else p + "I" for p in near), key=_reading))
        return table


@dataclass(frozen=True, kw_only=True)
class FactorialOptions(DesignOptions):
    """Factorial design: all combinations of levels."""

    center: int = doc("centre points, when every factor is numeric", 3)
    levels: int | dict[str, int] = doc("levels of the continuous factors: of all, or by name", 2)
    reduction: int = doc("take one of so many balanced parts", 1)

    def problems(self) -> Problems:
        """Report what is wrong beyond types."""
        found, each = super().problems(), self.levels
        wanted = each.values() if isinstance(each, dict) else [each]
        found += [("levels", f"must be at least 2, got {count}") for count in wanted if count < 2]
        found += counts(self, 0, MOST_RUNS, "center")
        return found + counts(self, 1, MOST_RUNS, "reduction")


@dataclass(frozen=True, kw_only=True)
class FractionalFactorialOptions(DesignOptions):
    """Regular two-level fraction of a factorial design, by its generators or its number of runs."""

    center: int = doc("centre points, when every factor is numeric", 3)
    runs: int | None = doc("take the standard fraction with so many runs", None)
    generators: tuple[str, ...] = doc("generators, such as 'E=ABCD'", ())

    def problems(self) -> Problems:
        """Report what is wrong beyond types."""
        found = super().problems() + counts(self, 0, MOST_RUNS, "center")
        return found + counts(self, 1, MOST_RUNS, "runs")


def make_factorial(space: Space, options: FactorialOptions, site: Site) -> Design:
    """The design of the study file; a categorical factor has no centre."""
    center = options.center if space.numeric.all() else 0
    return full_factorial(space, options.levels, reduction=options.reduction, center=center)


def make_fractional_factorial(space: Space, options: FractionalFactorialOptions, site: Site) -> Design:
    """The design of the study file; a categorical factor has no centre."""
    center = options.center if space.numeric.all() else 0
    return fractional_factorial(space, options.generators or None, runs=options.runs, center=center)


@checked
def full_factorial(
    space: Space, levels: int | Mapping[str, int] = 2, *, reduction: int = 1, center: int = 0
) -> Design:
    """All combinations of the factors' levels, or a balanced part of them.

    Parameters
    ----------
    space : Space
        Categorical and discrete factors take all their levels.
    levels : int or mapping
        Number of equally spaced levels of every other factor, or of each by name.
    reduction : int
        Take one of so many complementary parts, in which all levels are about equally frequent: a generalised
        subset design (Surowiec et al. 2017, Analytical Chemistry 89(12), 6491-6497).
    center : int
        Centre points (numeric factors only).
    """
    sizes = []
    for factor in space:
        wanted = levels if isinstance(levels, int) else levels.get(factor.name, 2)
        if wanted < 2:
            raise RsmkitError(f"factorial design: {factor.name} needs at least 2 levels, got {wanted}")
        sizes.append(len(factor.levels) or wanted)
    if math.prod(sizes) > LARGEST:
        raise RsmkitError(
            f"factorial design: {math.prod(sizes)} runs; use fewer levels, a fraction or an optimal design"
        )
    if reduction > 1 and (len(sizes) < 2 or reduction > sorted(sizes)[-2]):
        raise RsmkitError(
            f"factorial design: levels {', '.join(map(str, sizes))} cannot be reduced {reduction}-fold: "
            "reduction must not exceed the second largest number of levels"
        )
    index = pydoe.full_factorial(sizes) if reduction == 1 else pydoe.subset_factorial(sizes, reduction)
    columns = []
    for j, factor in enumerate(space):
        columns.append(factor.domain.coded_levels(sizes[j])[index[:, j].astype(int)])
    coded = np.stack(columns, axis=1)
    if center and not space.numeric.all():
        raise RsmkitError("factorial design: a categorical factor has no centre; set center = 0")
    coded = np.vstack([coded, np.zeros((center, len(space)))])
    kinds = ["factorial"] * len(index) + ["center"] * center
    return classical(space, coded, kinds, "a factorial design", categorical=True)


@checked
def fractional_factorial(
    space: Space, generators: Sequence[str] | None = None, *, runs: int | None = None, center: int = 0
) -> Design:
    """Regular two-level fraction.

    Parameters
    ----------
    space : Space
        Numeric factors and categorical ones of two levels; the first is A, the second B, ... (without I).
    generators : sequence of str, optional
        ``"E=ABCD"``, one per generated factor.
    runs : int, optional
        Instead of generators: the standard fraction of minimum aberration with this many runs.
    center : int
        Centre points.
    """
    k = len(space)
    if generators is None:
        if runs is None or runs < 4 or 2 ** round(math.log2(runs)) != runs:
            raise RsmkitError(
                "fractional factorial: give generators, or runs as a power of two (4, 8, 16, ...)"
            )
        generators = standard_generators(k, k - round(math.log2(runs)))
    cells = fraction(k, generators).coded
    coded = cells.copy()
    for j, factor in enumerate(space):
        if not factor.domain.is_numeric:
            if len(factor.levels) != 2:
                raise RsmkitError(f"fractional factorial: {factor.name} must have two levels")
            coded[:, j] = (cells[:, j] + 1.0) / 2.0
    if center and not space.numeric.all():
        raise RsmkitError("fractional factorial: a categorical factor has no centre; set center = 0")
    coded = np.vstack([coded, np.zeros((center, k))])
    kinds = ["factorial"] * len(cells) + ["center"] * center
    return classical(space, coded, kinds, "a fractional factorial", categorical=True)


def fraction(k: int, generators: Sequence[str]) -> Fraction:
    """Check generators and work out the defining relation.

    Raises
    ------
    RsmkitError
        For a malformed generator, or generators that confound a factor with the mean or with another.
    """
    texts = tuple(generators)
    basic, generated = LETTERS[: k - len(texts)], LETTERS[k - len(texts) : k]
    clean = tuple(text.upper().replace(" ", "") for text in texts)
    words = []
    for text in clean:
        left, _, right = text.partition("=")
        letters = right.lstrip("-")
        if (
            left not in generated
            or not letters
            or set(letters) - set(basic)
            or len(set(letters)) != len(letters)
        ):
            raise RsmkitError(
                f"generator '{text}' must define one of {', '.join(generated)} as a product of "
                f"{', '.join(basic)}, as in '{generated[:1]}={basic}'"
            )
        words.append(_product(left, right))
    if sorted(text[0] for text in clean) != sorted(generated):
        raise RsmkitError(
            f"generators must define each of {', '.join(generated)} once, got {', '.join(clean)}"
        )
    relation = []
    for size in range(1, len(words) + 1):
        for chosen in combinations(words, size):
            word = ""
            for part in chosen:
                word = _product(word, part)
            relation.append(word)
    found = Fraction(k, clean, tuple(sorted(relation, key=_reading)))
    if found.words and found.resolution < 3:
        raise RsmkitError(f"generators {', '.join(clean)} confound two factors: word {found.words[0]}")
    return found


def standard_generators(k: int, generated: int) -> tuple[str, ...]:
    """Generators of minimum aberration for `k` factors, `generated` of them generated."""
    if generated <= 0:
        return ()
    if (k, generated) not in STANDARD:
        sizes = sorted(2 ** (k - p) for factors, p in STANDARD if factors == k)
        hint = f"in {', '.join(map(str, sizes))} runs" if sizes else "for 3 to 15 factors"
        raise RsmkitError(
            f"no standard fraction of {k} factors in {2 ** max(k - generated, 0)} runs; they exist {hint}: "
            "give generators"
        )
    return tuple(STANDARD[k, generated].split())


def _product(a: str, b: str) -> str:
    """Product of two signed words; every letter squared is one."""
    sign = "-" if (a.startswith("-")) != (b.startswith("-")) else ""
    return sign + "".join(sorted(set(a.lstrip("-")) ^ set(b.lstrip("-"))))


def _reading(word: str) -> tuple[int, str]:
    return (len(word.lstrip("-")), word.lstrip("-"))
