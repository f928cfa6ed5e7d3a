"""G-optimality: exchange coordinates for a smaller largest prediction variance."""

from __future__ import annotations

import numpy as np

from rsmkit.design.criteria import variance_points
from rsmkit.design.encoding import Lines, Model, model_rows
from rsmkit.design.region import Region
from rsmkit.space import Floats

__all__ = ["lower_largest_variance"]

PASSES = 20
VALUES = np.array([-1.0, -0.8, -0.6, -0.4, -0.2, 0.0, 0.2, 0.4, 0.6, 0.8, 1.0])
SHRINKS = 5
"""Times the trial values close in on the present one, by a factor of four each."""


def lower_largest_variance(
    model: Model, region: Region, lines: Lines, precision: Floats, points: Floats, given: int
) -> tuple[Floats, float]:
    """Improve a design for the G criterion, one coordinate of one point at a time.

    For every trial value the variance at all probe points follows from a rank-two update, and the value with
    the smallest maximum is kept.

    Parameters
    ----------
    lines : Lines
        Bounds, levels and minimum distance.
    precision : array, shape (n, n) or (0, 0)
        Inverse covariance of the runs.
    points : array, shape (n, k)
        Coded points of a good design for another criterion; the first `given` of them stay.

    Returns
    -------
    array, shape (n, k)
        The improved points.
    float
        Their largest variance over :func:`rsmkit.design.criteria.variance_points`.
    """
    points, probes = points.copy(), model_rows(model, variance_points(region))
    weights = precision if len(precision) else np.eye(len(points))
    largest = np.inf
    scale = 1.0
    for _ in range(PASSES * SHRINKS):
        before = largest
        for i in range(given, len(points)):
            largest = _improve(model, region, lines, weights, points, probes, i, scale)
        if largest > before * (1.0 - 1e-4):
            scale /= 4.0
        if scale < 4.0**-SHRINKS:
            break
    return points, largest


def _improve(
    model: Model,
    region: Region,
    lines: Lines,
    weights: Floats,
    points: Floats,
    probes: Floats,
    i: int,
    scale: float,
) -> float:
    """Move point i to the best of its trial places; return the largest variance."""
    rows = model_rows(model, points)
    V = np.linalg.inv(rows.T @ weights @ rows)
    products = probes @ V
    variances = (products * probes).sum(axis=1)
    trials = _trials(region, lines, points, i, scale)
    if len(trials) == 0:
        return float(variances.max())
    g, pii = weights[i] @ rows, weights[i, i]
    d = model_rows(model, trials) - rows[i]
    dV, Vg = d @ V, V @ g
    dd, gd, gg = (dV * d).sum(axis=1), d @ Vg, float(g @ Vg)
    ratio = np.maximum((1.0 + gd) ** 2 + (pii - gg) * dd, 1e-10)
    along, own = products @ d.T, (products @ g)[:, None]
    change = (pii - gg) * along**2 + 2.0 * (1.0 + gd) * along * own - dd * own**2
    maxima = (variances[:, None] - change / ratio).max(axis=0)
    best = int(maxima.argmin())
    if maxima[best] < variances.max() * (1.0 - 1e-9):
        points[i] = trials[best]
        return float(maxima[best])
    return float(variances.max())


def _trials(region: Region, lines: Lines, points: Floats, i: int, scale: float) -> Floats:
    """Other allowed values of each coordinate of point i, or other candidates of a list."""
    if region.candidates is not None:
        trials = region.candidates
    else:
        moved = []
        for j, levels in enumerate(region.levels):
            middle, half = 0.5 * (lines.highs[j] + lines.lows[j]), 0.5 * (lines.highs[j] - lines.lows[j])
            values = levels
            if len(levels) == 0:
                values = middle + half * VALUES if scale == 1.0 else points[i, j] + half * scale * VALUES
            others = np.tile(points[i], (len(values), 1))
            others[:, j] = np.clip(values, lines.lows[j], lines.highs[j])
            moved.append(others)
        trials = np.vstack(moved)
        trials = trials[region.contains(trials)]
    if lines.distance > 0.0:
        gaps = np.linalg.norm(trials[:, None, :] - np.delete(points, i, axis=0)[None, :, :], axis=2)
        trials = trials[(gaps >= lines.distance * (1.0 - 1e-9)).all(axis=1)]
    return trials
