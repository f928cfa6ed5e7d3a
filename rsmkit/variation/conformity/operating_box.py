"""Tolerances that may be given away: the largest box of all factors in which specifications are kept.

In every design of the box, with the laws about it, the probability that every specification is kept is high
(the *proven acceptable ranges* of ICH Q8, of all factors at once). A box is grown from one design: of the
designs in it that are not good each is cut off, nearest first, on the side that leaves the most. What is left
is asked at new designs, its corners among them, and shrunk until none is found that is not good.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from rsmkit.language.joint_law import Laws
from rsmkit.language.space import Floats

__all__ = ["operating_box"]

FIRST = 512
"""Designs over the whole space that are asked first."""
MORE = 96
"""Designs inside a box, beside its corners, that must all be good; four times as many at last."""
CORNERS = 64
"""Corners that are asked at most."""
HALVINGS = 8
ROUNDS = 50
STARTS = 24
"""Orders in which what is not good is cut off."""
MARGIN = 0.03
"""Part of the way to a design that is not good which the box leaves free."""

Kept = Callable[[Floats], Floats]
Box = tuple[Floats, Floats]


def operating_box(
    kept: Kept, laws: Laws, point: Floats, *, level: float, seed: int
) -> dict[str, tuple[float, float]] | None:
    """Find a large box of the continuous factors in which `kept` is at least `level`.

    Parameters
    ----------
    kept : callable
        Designs, natural units, shape (n, k), to the probability that every specification is kept, (n,).
    laws : Laws
        Whose space has the factors; those of a sum cannot move alone and stay at `point`, as categories do.
    point : array, shape (k,)
        The design; the box holds it if it is good itself, else the best of those asked.
    level : float
    seed : int

    Returns
    -------
    dict of str to pair of float, or None
        By factor; None where no design is good, or where fewer than three factors can move.
    """
    space = laws.space
    bound = {name for equality in space.equalities for name in equality.names}
    columns = [j for j, f in enumerate(space) if f.domain.is_continuous and f.name not in bound]
    if len(columns) < 3:
        return None
    low, high = (np.array([getattr(space.factors[j], end) for j in columns]) for end in ("low", "high"))

    def designs(unit: Floats) -> Floats:
        points = np.tile(point, (len(unit), 1))
        points[:, columns] = low + unit * (high - low)
        return points

    rng = np.random.default_rng([seed, 43])
    own = np.clip((point[columns] - low) / (high - low), 0.0, 1.0)
    unit = np.vstack([own, qmc.Sobol(len(columns), rng=rng).random(FIRST)])
    chance = kept(designs(unit))
    start = unit[0] if chance[0] >= level else unit[int(chance.argmax())]
    if chance.max() < level:
        return None
    grown = _largest(start, unit[chance < level], rng)
    box = _proven(grown, start, lambda asked: kept(designs(asked)) >= level, rng)
    ends = low + np.array(box) * (high - low)
    names = [space.names[j] for j in columns]
    return {name: (float(a), float(b)) for name, a, b in zip(names, *ends, strict=True)}


def _proven(
    grown: Box, start: Floats, good: Callable[[Floats], NDArray[np.bool_]], rng: np.random.Generator
) -> Box:
    """Shrink a box about `start` until nothing in it is found wrong, then move its sides out one by one."""

    def holds(low: Floats, high: Floats, count: int = MORE) -> bool:
        return bool(good(_inside((low, high), rng, count)).all())

    def scaled(box: Box, factor: float) -> Box:
        return start + factor * (box[0] - start), start + factor * (box[1] - start)

    least, most = 0.0, 1.0
    if holds(*grown):
        least = most
    for _ in range(HALVINGS if least < most else 0):
        middle = 0.5 * (least + most)
        least, most = (middle, most) if holds(*scaled(grown, middle)) else (least, middle)
    low, high = scaled(grown, least)
    for side in rng.permutation(2 * len(start)).tolist():
        j, up = side // 2, side % 2
        for part in (1.0, 0.5, 0.25):
            wider = low.copy(), high.copy()
            wider[up][j] += part * (up - wider[up][j])
            if holds(*wider):
                low, high = wider
                break
    for _ in range(ROUNDS):
        if holds(low, high, 4 * MORE):
            return low, high
        low, high = scaled((low, high), 1.0 - MARGIN)
    return start, start


def _inside(box: Box, rng: np.random.Generator, count: int) -> Floats:
    """Corners of a box, its faces and its inside, shape (n, m)."""
    low, high = box
    m = len(low)
    if 1 << m <= CORNERS:
        corners = (np.arange(1 << m)[:, None] >> np.arange(m)) & 1
    else:
        corners = rng.integers(0, 2, (CORNERS, m))
    points = rng.random((count, m))
    faces = points[: count // 2]
    side = rng.integers(0, m, len(faces))
    faces[np.arange(len(faces)), side] = rng.integers(0, 2, len(faces))
    return np.asarray(low + np.vstack([corners, points]) * (high - low))


def _largest(start: Floats, bad: Floats, rng: np.random.Generator) -> Box:
    """The largest of several boxes about `start`, none of which holds a bad point."""
    distance = np.abs(bad - start).max(axis=1)
    best, found = -1.0, (start, start)
    for attempt in range(STARTS):
        jitter = rng.uniform(0.6, 1.0, len(bad)) if attempt else 1.0
        whole = np.zeros(len(start)), np.ones(len(start))
        low, high = _box(start, bad[np.argsort(distance * jitter)], whole)
        volume = float(np.prod(high - low))
        if volume > best:
            best, found = volume, (low, high)
    return found


def _box(start: Floats, bad: Floats, box: Box) -> Box:
    """Cut bad points off a box in their order."""
    low, high = box[0].copy(), box[1].copy()
    while len(bad):
        bad = bad[((bad >= low) & (bad <= high)).all(axis=1)]
        if not len(bad):
            break
        away = bad[0] - start
        cut = bad[0] - MARGIN * away
        with np.errstate(divide="ignore", invalid="ignore"):
            left = np.where(away > 0, cut - low, high - cut) / (high - low)
        side = int(np.argmax(np.where(away == 0.0, -1.0, left)))
        if away[side] > 0:
            high[side] = cut[side]
        else:
            low[side] = cut[side]
    return low, high
