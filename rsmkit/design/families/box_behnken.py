"""Box-Behnken designs, three levels without corners, as published (Technometrics 2(4), 1960, 455-475)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from rsmkit.design.design import Design, classical
from rsmkit.design.families import pydoe
from rsmkit.design.families.site import Site
from rsmkit.design.options import MOST_RUNS, DesignOptions, Problems, counts
from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.io.option_fields import doc
from rsmkit.language.space import Floats, Space

__all__ = ["BoxBehnkenOptions", "box_behnken", "make_box_behnken"]

# Table 4 of the paper: the sets of factors that vary together while the others stay at the centre.
SETS: dict[int, tuple[tuple[int, ...], ...]] = {
    6: ((1, 2, 4), (2, 3, 5), (3, 4, 6), (1, 4, 5), (2, 5, 6), (1, 3, 6)),
    7: ((4, 5, 6), (1, 6, 7), (2, 5, 7), (1, 2, 4), (3, 4, 7), (1, 3, 5), (2, 3, 6)),
    9: (
        (1, 4, 7), (2, 5, 8), (3, 6, 9), (1, 2, 3), (4, 5, 6), (7, 8, 9), (1, 5, 9), (3, 4, 8),
        (2, 6, 7), (1, 6, 8), (2, 4, 9), (3, 5, 7), (1, 4, 7), (2, 5, 8), (3, 6, 9),
    ),
    10: (
        (2, 6, 7, 10), (1, 2, 5, 10), (2, 3, 7, 8), (2, 4, 6, 9), (1, 8, 9, 10),
        (3, 4, 5, 10), (1, 4, 7, 8), (3, 5, 7, 9), (1, 3, 6, 9), (4, 5, 6, 8),
    ),
    11: (
        (3, 7, 8, 9, 11), (1, 4, 8, 9, 10), (2, 5, 9, 10, 11), (1, 3, 6, 10, 11), (1, 2, 4, 7, 11),
        (1, 2, 3, 5, 8), (2, 3, 4, 6, 9), (3, 4, 5, 7, 10), (4, 5, 6, 8, 11), (1, 5, 6, 7, 9),
        (2, 6, 7, 8, 10),
    ),
    12: tuple(tuple((factor + turn - 1) % 12 + 1 for factor in (1, 2, 5, 7)) for turn in range(12)),
    16: (
        (1, 2, 6, 9), (3, 4, 8, 11), (5, 10, 13, 14), (7, 12, 15, 16), (2, 3, 7, 10), (1, 4, 5, 12),
        (6, 11, 14, 15), (8, 9, 13, 16), (2, 5, 6, 13), (4, 7, 8, 15), (1, 9, 10, 14), (3, 11, 12, 16),
        (3, 6, 7, 14), (1, 5, 8, 16), (2, 10, 11, 15), (4, 9, 12, 13), (1, 3, 13, 15), (2, 4, 14, 16),
        (5, 7, 9, 11), (6, 8, 10, 12), (4, 6, 10, 16), (3, 5, 9, 15), (1, 7, 11, 13), (2, 8, 12, 14),
    ),
}  # fmt: skip
PAIRS = {
    4: ({(1, 2), (3, 4)}, {(1, 3), (2, 4)}, {(1, 4), (2, 3)}),
    5: ({(1, 2), (2, 3), (3, 4), (4, 5), (1, 5)}, {(1, 3), (2, 4), (3, 5), (1, 4), (2, 5)}),
}
PUBLISHED = (3, 4, 5, *SETS)


@dataclass(frozen=True, kw_only=True)
class BoxBehnkenOptions(DesignOptions):
    """Box-Behnken design: three levels, no run at a corner of the bounds."""

    center: int = doc("centre points", 3)
    blocked: bool = doc("run it in its published blocks", False)

    def problems(self) -> Problems:
        """Report what is wrong beyond types."""
        return super().problems() + counts(self, 0, MOST_RUNS, "center")


def make_box_behnken(space: Space, options: BoxBehnkenOptions, site: Site) -> Design:
    """The design of the study file."""
    return box_behnken(space, center=options.center, blocked=options.blocked)


@checked
def box_behnken(space: Space, *, center: int = 3, blocked: bool = False) -> Design:
    """Box-Behnken design: every factor at three levels, no run at a corner of the bounds.

    Parameters
    ----------
    space : Space
        3 to 7, 9 to 12 or 16 numeric factors, the published sizes.
    center : int
        Centre points.
    blocked : bool
        In the published orthogonal blocks: 3 for 4 factors, 2 for 5, 6, 7, 10 and 12, 5 for 9, 6 for 16. The
        centre points are shared out evenly.

    Returns
    -------
    Design
        Kinds ``edge`` and ``center``; 12, 24, 40, 48, 56 edge runs for 3 to 7 factors, then 120, 160, 176,
        192, 384.
    """
    k = int(space.numeric.sum())
    if k not in PUBLISHED:
        sizes = ", ".join(map(str, PUBLISHED))
        raise RsmkitError(
            f"Box-Behnken designs exist for {sizes} factors, not {k}: use a composite or optimal one"
        )
    edges = pydoe.pairwise_edges(k) if k <= 5 else _edges(k)
    block = np.zeros(len(edges), dtype=int)
    if blocked:
        block = _blocks(k, edges)
        count = int(block.max()) + 1
        if count == 1:
            raise RsmkitError(
                f"the Box-Behnken design of {k} factors has no orthogonal blocks: set blocked = false"
            )
        if center % count:
            raise RsmkitError(
                f"the Box-Behnken design of {k} factors has {count} blocks: set center to a multiple of "
                f"{count}, not {center}"
            )
        order = np.argsort(block, kind="stable")
        edges, block = edges[order], block[order]
    parts, kinds, blocks = [], list[str](), list[int]()
    for b in range(int(block.max()) + 1):
        mine = edges[block == b]
        share = center // (int(block.max()) + 1)
        parts += [mine, np.zeros((share, k))]
        kinds += ["edge"] * len(mine) + ["center"] * share
        blocks += [b + 1] * (len(mine) + share)
    design = classical(space, np.vstack(parts), kinds, "a Box-Behnken design")
    return replace(design, blocks=tuple(np.resize(blocks, len(design)).tolist())) if blocked else design


def _edges(k: int) -> Floats:
    sets = SETS[k]
    signs = np.array(list(product((-1.0, 1.0), repeat=len(sets[0]))))
    if len(sets[0]) == 5:  # eleven factors: the half fraction whose product of all five is +1
        signs = signs[signs.prod(axis=1) > 0]
    edges = np.zeros((len(sets), len(signs), k))
    for block, members in zip(edges, sets, strict=True):
        block[:, np.array(members) - 1] = signs
    return edges.reshape(-1, k)


def _blocks(k: int, edges: Floats) -> NDArray[np.int64]:
    """Published orthogonal block of every edge run, from 0."""
    varied = [tuple((np.flatnonzero(row) + 1).tolist()) for row in edges]
    if k in (4, 5):  # pairs that together vary every factor equally often
        return np.array([next(b for b, pairs in enumerate(PAIRS[k]) if pair in pairs) for pair in varied])
    if k in (9, 16):  # consecutive sets that together vary every factor once
        return np.arange(len(edges)) // (len(edges) // (5 if k == 9 else 6))
    if k in (6, 7, 10, 12):  # the two half fractions of every set
        return np.array([int(np.prod(row[row != 0]) > 0) for row in edges])
    return np.zeros(len(edges), dtype=np.int64)
