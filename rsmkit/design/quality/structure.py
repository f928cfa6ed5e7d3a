"""What the runs of a design are made of: levels, centre runs, mirror images, strength, projectivity."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np

from rsmkit.design.design import Design
from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.io.shown import Shown
from rsmkit.language.space import Floats

__all__ = ["DesignStructure", "design_structure"]

DIGITS = 9
"""Decimals to which coded settings are compared."""
MOST = 50_000_000
"""Settings, over all choices of factors, up to which strength and projectivity are looked for."""


@dataclass(frozen=True, eq=False)
class DesignStructure(Shown):
    """Counts that describe a design, as papers on screening designs print them.

    A *centre run* has every numeric factor that takes its middle level at that level; factors that never do,
    those of two levels, may have any value in it.

    Parameters
    ----------
    names : tuple of str
        Factors.
    runs : int
    distinct : int
        Runs with different settings.
    levels : dict
        Levels of each factor: coded numbers, or names of categories.
    level_counts : dict
        ``level_counts[factor][level]``: how many runs have it.
    center_runs : int
    zeros : dict
        Runs at the middle level of each numeric factor that has one, centre runs not counted (n0ME of Nunez
        Ares & Goos 2020, Technometrics 62(1), 21-36).
    product_zeros : dict
        The same for the product of two such factors, by ``(factor, factor)`` (their n0IE).
    mirror_pairs : int
        Pairs of runs, centre runs not counted, in which every factor changes to its opposite.
    replicates : tuple of tuple of int
        Groups of runs, counted from 1, that have the same settings.
    block_sizes : dict
        Runs of each block; empty without blocks.
    balanced_blocks : bool or None
        Whether every factor has the same average in all blocks, so that blocks do not touch main effects.
    coded : array, shape (n, k)
        Settings; two categories count as -1 and 1.
    """

    names: tuple[str, ...]
    runs: int
    distinct: int
    levels: dict[str, tuple[float | str, ...]]
    level_counts: dict[str, dict[float | str, int]]
    center_runs: int
    zeros: dict[str, int]
    product_zeros: dict[tuple[str, str], int]
    mirror_pairs: int
    replicates: tuple[tuple[int, ...], ...]
    block_sizes: dict[int, int]
    balanced_blocks: bool | None
    coded: Floats

    @property
    def two_level(self) -> tuple[str, ...]:
        """Factors with two levels."""
        return tuple(name for name in self.names if len(self.levels[name]) == 2)

    @property
    def three_level(self) -> tuple[str, ...]:
        """Factors with three levels."""
        return tuple(name for name in self.names if len(self.levels[name]) == 3)

    @property
    def folded_over(self) -> bool:
        """Whether every run but the centre runs has its mirror image."""
        return 2 * self.mirror_pairs == self.runs - self.center_runs

    @cached_property
    def strength(self) -> int:
        """Largest t for which any t factors take all combinations of their levels equally often.

        Raises
        ------
        RsmkitError
            When the design is too large to look at every choice of factors.
        """
        return self._largest(lambda cells, counts: len(counts) == cells and len(set(counts)) == 1)

    @cached_property
    def resolution(self) -> int:
        """Fewest factors whose product, or whose joint counts, are not balanced: the strength plus one.

        For a regular fraction of two levels this is its resolution (Deng & Tang 1999, Statistica Sinica 9,
        1071-1082, for the others).
        """
        return self.strength + 1

    @cached_property
    def projectivity(self) -> int:
        """Largest p for which any p factors take all combinations of their levels at least once.

        Box & Tyssedal (1996), Biometrika 83(4), 950-955. Errors are those of :attr:`strength`.
        """
        return self._largest(lambda cells, counts: len(counts) == cells)

    @cached_property
    def minimally_aliased(self) -> bool:
        """Whether main effects are orthogonal to the mean, to each other and to all second-order terms.

        With three levels such designs are known as OMARS (Nunez Ares & Goos 2020).
        """
        x = self.coded
        if any(len(own) > 2 and isinstance(own[0], str) for own in self.levels.values()):
            raise RsmkitError("aliasing of main effects: a factor of three or more categories has no square")
        second = [x[:, i] * x[:, j] for i in range(x.shape[1]) for j in range(i, x.shape[1])]
        others = np.column_stack([np.ones(len(x)), *second])
        off = x.T @ x - np.diag(np.square(x).sum(axis=0))
        # rounding of sums of n products of coded settings, each kept to DIGITS decimals
        room = 10.0 * len(x) * 10.0**-DIGITS * max(1.0, float(np.abs(x).max())) ** 3
        return bool(np.abs(off).max(initial=0.0) < room and np.abs(x.T @ others).max() < room)

    def _largest(self, holds: Callable[[int, list[int]], bool]) -> int:
        """Largest number of factors for which every choice of so many passes."""
        codes = [np.unique(self.coded[:, j], return_inverse=True)[1] for j in range(len(self.names))]
        counts = [int(code.max()) + 1 for code in codes]
        work, found = 0, 0
        for size in range(1, len(codes) + 1):
            if math.prod(sorted(counts)[:size]) > self.runs:
                return found  # not even the factors with the fewest levels have runs enough
            for some in combinations(range(len(codes)), size):
                work += size * self.runs
                if work > MOST:
                    raise RsmkitError(
                        f"strength of a design of {self.runs} runs and {len(codes)} factors: every choice of "
                        f"{size - 1} factors passes, and there are too many of {size} to look at"
                    )
                cells = np.zeros(self.runs, int)
                for j in some:
                    cells = cells * counts[j] + codes[j]
                seen = np.bincount(cells)
                if not holds(math.prod(counts[j] for j in some), seen[seen > 0].tolist()):
                    return found
            found = size
        return found


@checked
def design_structure(design: Design) -> DesignStructure:
    """Count levels, middle levels, centre runs, mirror images and replicates of a design.

    Parameters
    ----------
    design : Design

    Returns
    -------
    DesignStructure
        With ``strength``, ``resolution``, ``projectivity`` and ``minimally_aliased``, found when asked for.

    Examples
    --------
    >>> import rsmkit as rk
    >>> design = rk.definitive_screening(rk.Space(a=(0, 1), b=(0, 1), c=(0, 1), d=(0, 1)), center=1)
    >>> found = rk.design_structure(design)
    >>> found.zeros["a"], found.center_runs, found.folded_over, found.minimally_aliased
    (2, 1, True, True)
    """
    if not len(design):
        raise RsmkitError("structure of a design: it has no runs")
    names, kinds = design.space.names, [factor.domain.categories for factor in design.space.factors]
    coded = _settings(design)
    levels = {name: _levels(coded[:, j], design, j) for j, name in enumerate(names)}
    middle = [j for j, kind in enumerate(kinds) if not kind and (coded[:, j] == 0).any()]
    center = (coded[:, middle] == 0).all(axis=1) if middle else np.zeros(len(design), bool)
    rest = coded[~center]
    return DesignStructure(
        names=names,
        runs=len(design),
        distinct=len(np.unique(coded, axis=0)),
        levels={name: tuple(own) for name, own in levels.items()},
        level_counts=levels,
        center_runs=int(center.sum()),
        zeros={names[j]: int((rest[:, j] == 0).sum()) for j in middle},
        product_zeros={
            (names[a], names[b]): int((rest[:, a] * rest[:, b] == 0).sum())
            for a, b in combinations(middle, 2)
        },
        mirror_pairs=_mirror_pairs(rest, _several(design)),
        replicates=_replicates(coded),
        block_sizes=dict(sorted(Counter(design.blocks).items())),
        balanced_blocks=_balanced(coded, _several(design), design.blocks),
        coded=coded,
    )


def _settings(design: Design) -> Floats:
    """Coded settings without rounding noise; two categories are -1 and 1, more stay indices."""
    coded = design.coded.copy()
    for j, factor in enumerate(design.space.factors):
        if factor.domain.categories and len(factor.levels) == 2:
            coded[:, j] = 2.0 * coded[:, j] - 1.0
    return np.asarray(np.round(coded, DIGITS) + 0.0)


def _several(design: Design) -> list[int]:
    """Places of the factors with three or more categories."""
    return [j for j, f in enumerate(design.space.factors) if f.domain.categories and len(f.levels) > 2]


def _levels(column: Floats, design: Design, place: int) -> dict[float | str, int]:
    """Runs at each level, ascending; categories by their names."""
    factor = design.space.factors[place]
    if factor.domain.categories:
        counts = Counter(design.points[:, place].astype(int).tolist())
        return {str(factor.levels[i]): counts[i] for i in sorted(counts)}
    return dict(sorted(Counter(column.tolist()).items()))


def _mirror_pairs(rest: Floats, several: list[int]) -> int:
    """Pairs of opposite runs; what has three or more categories keeps its category."""
    sign = np.ones(rest.shape[1])
    sign[several] = -1.0
    left, pairs = Counter(map(tuple, rest.tolist())), 0
    for run in list(left):
        other = tuple((-sign * np.array(run) + 0.0).tolist())
        if other != run:
            found = min(left[run], left[other])
            pairs += found
            left[run] -= found
            left[other] -= found
    return pairs


def _replicates(coded: Floats) -> tuple[tuple[int, ...], ...]:
    groups: dict[tuple[float, ...], list[int]] = {}
    for number, run in enumerate(map(tuple, coded.tolist()), start=1):
        groups.setdefault(run, []).append(number)
    return tuple(tuple(group) for group in groups.values() if len(group) > 1)


def _balanced(coded: Floats, several: list[int], blocks: tuple[int, ...]) -> bool | None:
    if not blocks:
        return None
    kept = [j for j in range(coded.shape[1]) if j not in several]
    columns = [coded[:, j] for j in kept]
    columns += [coded[:, j] == level for j in several for level in np.unique(coded[:, j])]
    of_blocks = np.array(blocks)
    means = [np.column_stack(columns)[of_blocks == b].mean(axis=0) for b in sorted(set(blocks))]
    return bool(np.ptp(means, axis=0).max() < 10.0**-DIGITS * max(1.0, float(np.abs(coded).max())))
