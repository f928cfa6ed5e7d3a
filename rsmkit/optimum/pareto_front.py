"""Pareto fronts: non-dominated points, knee and extremes, hypervolume and IGD+. Everything is minimised."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from rsmkit.language.space import Floats

__all__ = [
    "REFERENCE",
    "extremes",
    "hypervolume",
    "igd_plus",
    "knee",
    "nondominated",
    "normalise",
    "plane_directions",
    "spread_rows",
]

REFERENCE = 1.1
"""Reference point of the hypervolume in every normalised objective."""


def nondominated(objectives: Floats) -> NDArray[np.intp]:
    """Rows of `objectives`, shape (n, m), that no other row dominates, ascending; of equal rows the first."""
    rows = np.lexsort(objectives.T[::-1])
    values = objectives[rows]
    at = 0
    while at < len(values):
        worse = (values >= values[at]).all(axis=1)
        worse[at] = False
        keep = ~worse
        at = int(keep[: at + 1].sum())
        rows, values = rows[keep], values[keep]
    return np.sort(rows)


def normalise(objectives: Floats, ideal: Floats, nadir: Floats) -> Floats:
    """Scale so that `ideal` becomes 0 and `nadir` 1; an objective without range becomes 0."""
    span = nadir - ideal
    scaled: Floats = (objectives - ideal) / np.where(span > 0, span, 1.0)
    return scaled


def knee(front: Floats) -> int:
    """Row of the front, shape (n, m), farthest below the plane through the ends of the scaled axes.

    With every objective scaled to 0..1 over the front that plane is ``sum = 1``, so the knee has the least
    sum (after Das, "On characterizing the 'knee' of the Pareto curve", Structural Optimization 18, 1999).
    """
    return int(normalise(front, front.min(axis=0), front.max(axis=0)).sum(axis=1).argmin())


def extremes(front: Floats) -> tuple[int, ...]:
    """For each objective the row of the front, shape (n, m), where it is least; ties go to the least sum."""
    total = normalise(front, front.min(axis=0), front.max(axis=0)).sum(axis=1)
    return tuple(int(np.lexsort((total, column))[0]) for column in front.T)


def spread_rows(front: Floats, count: int, first: Sequence[int] = ()) -> list[int]:
    """Rows of the front, shape (n, m), far from each other: `first` or the ends, then the farthest."""
    scaled = normalise(front, front.min(axis=0), front.max(axis=0))
    chosen = list(first) or list(dict.fromkeys(scaled.argmin(axis=0).tolist()))
    distance = np.linalg.norm(scaled[:, None] - scaled[chosen], axis=2).min(axis=1)
    while len(chosen) < count:
        chosen.append(int(distance.argmax()))
        distance = np.minimum(distance, np.linalg.norm(scaled - scaled[chosen[-1]], axis=1))
    return chosen[:count]


def plane_directions(m: int) -> Floats:
    """Evenly spread points of the plane ``sum = 1`` in `m` objectives, all >= 0 (Das and Dennis 1998)."""
    parts = {2: 40, 3: 12, 4: 6}.get(m, 3)
    bars = np.array(list(combinations(range(parts + m - 1), m - 1)))
    edges = np.column_stack([np.full(len(bars), -1), bars, np.full(len(bars), parts + m - 1)])
    directions: Floats = (np.diff(edges, axis=1) - 1) / parts
    return directions


def hypervolume(objectives: Floats, ideal: Floats, nadir: Floats) -> float:
    """Volume dominated by `objectives`, shape (n, m), after normalisation, up to 1.1 in each objective.

    At most ``1.1 ** m``, reached only by a point at the ideal.
    """
    from pymoo.indicators.hv import HV

    scaled = normalise(objectives, ideal, nadir)
    scaled = scaled[(scaled < REFERENCE).all(axis=1)]
    return float(HV(ref_point=np.full(len(ideal), REFERENCE))(scaled)) if len(scaled) else 0.0


def igd_plus(objectives: Floats, reference: Floats) -> float:
    """Mean distance from a reference front to the nearest of `objectives`, counting only what is worse.

    Both shape (., m), normalised by the reference front's range (Ishibuchi et al., EMO 2015).
    """
    ideal, nadir = reference.min(axis=0), reference.max(axis=0)
    found = normalise(objectives, ideal, nadir)
    target = normalise(reference, ideal, nadir)
    lacking = np.maximum(found[None, :, :] - target[:, None, :], 0.0)
    return float(np.linalg.norm(lacking, axis=2).min(axis=1).mean())
