"""G-optimality: exchange coordinates for a smaller largest prediction variance.

The largest variance has kinks in which an exchange of single coordinates gets stuck. So the average of a
power of the variance is lowered first, then of a higher power (Hernandez & Nachtsheim 2018, Technometrics
60(3), 356-367, do so with one power). At the end all coordinates move at once, by a sequence of linear
programmes (Madsen 1975, J. Inst. Maths Applics 16, 321-328, on minimising the largest of several functions).
"""

from __future__ import annotations

import math

import numpy as np

from rsmkit.design.moves import moves
from rsmkit.design.optimal.criteria import lattice, variance_points
from rsmkit.design.optimal.encoding import Lines, Model, model_rows
from rsmkit.design.region import Region
from rsmkit.language.space import Floats

__all__ = ["largest_variance", "lower_largest_variance", "probe_points", "sharpen"]

POWERS = (4.0, 16.0, math.inf)
PASSES = 8
PROGRAMMES = 60
ACTIVE = 120
VALUES = np.array([-1.0, -0.8, -0.6, -0.4, -0.2, 0.0, 0.2, 0.4, 0.6, 0.8, 1.0])
SCALES = (1.0, 0.25, 0.0625, 0.015)
"""How far trial values lie from the present one, relative to the first."""
PROBES = 200


def probe_points(region: Region) -> Floats:
    """Points at which the variance is looked at in every step: few, where its maxima tend to be."""
    return np.vstack([variance_points(region, PROBES), lattice(region, 5**4, 5)])


def lower_largest_variance(
    model: Model, region: Region, lines: Lines, precision: Floats, points: Floats, given: int, probes: Floats
) -> Floats:
    """Improve a design for the G criterion, one coordinate of one point at a time.

    For every trial value the variance at all probe points follows from a rank-two update.

    Parameters
    ----------
    lines : Lines
        Bounds, levels and minimum distance.
    precision : array, shape (n, n) or (0, 0)
        Inverse covariance of the runs.
    points : array, shape (n, k)
        Coded points of a sound design; the first `given` of them stay.
    probes : array, shape (m, k)

    Returns
    -------
    array, shape (n, k)
    """
    points, rows = points.copy(), model_rows(model, probes)
    weights = precision if len(precision) else np.eye(len(points))
    for power in POWERS:
        step, before = 0, math.inf
        for _ in range(PASSES):
            for i in range(given, len(points)):
                value = _improve(model, region, lines, weights, points, rows, i, SCALES[step], power)
            if value > before * (1.0 - 1e-3):
                step += 1
            before = value
            if step == len(SCALES):
                break
    return points


def sharpen(
    model: Model, region: Region, lines: Lines, precision: Floats, points: Floats, given: int, probes: Floats
) -> Floats:
    """Move all continuous coordinates of the free points at once for a smaller largest variance.

    Arguments as for :func:`lower_largest_variance`; on boxes, also under linear constraints.
    """
    from scipy.optimize import linprog

    weights = precision if len(precision) else np.eye(len(points))
    moving = np.array([not len(levels) for levels in region.levels])
    variables = [(i, int(j)) for i in range(given, len(points)) for j in np.flatnonzero(moving)]
    rows_of, columns_of = np.array(variables, dtype=int).reshape(-1, 2).T
    best, trust = largest_variance(model, region, weights, points, probes)[0], 0.1
    for _ in range(PROGRAMMES):
        _, peaks = largest_variance(model, region, weights, points, probes)
        values, slopes = _linearised(model, weights, points, model_rows(model, peaks), variables)
        normals, offsets = lines.normals, lines.offsets
        edges = [
            (np.where(rows_of == i, normals[c][columns_of], 0.0), offsets[c] - normals[c] @ points[i])
            for i in range(given, len(points))
            for c in range(len(offsets))
        ]
        left = np.vstack(
            [np.hstack([slopes, -np.ones((len(values), 1))]), *([[*edge, 0.0]] for edge, _ in edges)]
        )
        right = np.concatenate([-values, [room for _, room in edges]])
        x = points[rows_of, columns_of]
        bounds = np.stack(
            [np.maximum(-trust, lines.lows[columns_of] - x), np.minimum(trust, lines.highs[columns_of] - x)],
            axis=1,
        )
        step = linprog(
            np.append(np.zeros(len(x)), 1.0), left, right, bounds=[*map(tuple, bounds), (None, None)]
        )
        if step.x is None:
            break
        trial = points.copy()
        trial[rows_of, columns_of] = np.clip(x + step.x[:-1], lines.lows[columns_of], lines.highs[columns_of])
        reached = largest_variance(model, region, weights, trial, probes)[0]
        if reached < best * (1.0 - 1e-9) and _apart(trial, lines.distance, model):
            gain, best, points = 1.0 - reached / best, reached, trial
            trust = min(2.0 * trust, 0.3)
            if gain < 1e-7:
                break
        else:
            trust /= 4.0
            if trust < 1e-6:
                break
    return points


def largest_variance(
    model: Model, region: Region, precision: Floats, points: Floats, probes: Floats
) -> tuple[float, Floats]:
    """Give the largest prediction variance over the region, and the places where it is (nearly) reached."""
    rows = model_rows(model, points)
    weights = precision if len(precision) else np.eye(len(points))
    V = np.linalg.inv(rows.T @ weights @ rows)

    def variance(x: Floats) -> Floats:
        f = model_rows(model, x)
        return np.asarray(((f @ V) * f).sum(axis=1))

    peaks = probes[np.argsort(-variance(probes), kind="stable")[:ACTIVE]]
    if region.candidates is None and region.flat:
        for width in 0.1 * 0.4 ** np.arange(8):
            for q, peak in enumerate(peaks):
                near = moves(region, peak, np.array([width]))
                peaks[q] = near[variance(near).argmax()]
        peaks = np.unique(np.round(peaks, 9), axis=0)
    elif region.candidates is None:
        moving = np.flatnonzero([not len(levels) for levels in region.levels])
        for width in 0.1 * 0.4 ** np.arange(8):
            for j in moving:
                trials = np.repeat(peaks[None], 3, axis=0)
                trials[1:, :, j] += np.array([[-width], [width]])
                trials[:, :, j] = np.clip(trials[:, :, j], region.lows[j], region.highs[j])
                flat = trials.reshape(-1, trials.shape[2])
                values = np.where(region.contains(flat), variance(flat), -np.inf).reshape(3, -1)
                peaks = trials[values.argmax(axis=0), np.arange(len(peaks))]
        peaks = np.unique(np.round(peaks, 9), axis=0)
    return float(variance(peaks).max()), peaks


def _linearised(
    model: Model, weights: Floats, points: Floats, peaks: Floats, variables: list[tuple[int, int]]
) -> tuple[Floats, Floats]:
    """Variance at the peaks, and its derivatives by the given coordinates of the points."""
    rows = model_rows(model, points)
    V = np.linalg.inv(rows.T @ weights @ rows)
    products = peaks @ V
    along = products @ (rows.T @ weights)
    slopes = np.empty((len(peaks), len(variables)))
    ends = []
    for j in range(points.shape[1]):
        low, high = points.copy(), points.copy()
        low[:, j], high[:, j] = low[:, j] - 1e-5, high[:, j] + 1e-5
        ends.append(
            (model_rows(model, high) - model_rows(model, low)) / 2e-5 if not model.categorical[j] else rows
        )
    for v, (i, j) in enumerate(variables):
        slopes[:, v] = -2.0 * along[:, i] * (products @ ends[j][i])
    return np.asarray((products * peaks).sum(axis=1)), slopes


def _apart(points: Floats, distance: float, model: Model) -> bool:
    """Whether no two points are closer than allowed."""
    if distance <= 0.0:
        return True
    gaps = points[:, None, :] - points[None, :, :]
    gaps[:, :, model.categorical] = 2.0 * (gaps[:, :, model.categorical] != 0.0)
    squares = (gaps**2).sum(axis=2) + np.diag(np.full(len(points), np.inf))
    return bool((squares >= distance**2 * (1.0 - 1e-9)).all())


def _improve(
    model: Model,
    region: Region,
    lines: Lines,
    weights: Floats,
    points: Floats,
    probes: Floats,
    i: int,
    scale: float,
    power: float,
) -> float:
    """Move point i to the best of its trial places; return the power mean of the variance."""
    rows = model_rows(model, points)
    V = np.linalg.inv(rows.T @ weights @ rows)
    products = probes @ V
    variances = (products * probes).sum(axis=1)
    trials = _trials(region, lines, points, i, scale)
    present = _power_mean(variances[:, None], power)[0]
    if len(trials) == 0:
        return float(present)
    g, pii = weights[i] @ rows, weights[i, i]
    d = model_rows(model, trials) - rows[i]
    dV, Vg = d @ V, V @ g
    dd, gd, gg = (dV * d).sum(axis=1), d @ Vg, float(g @ Vg)
    ratio = np.maximum((1.0 + gd) ** 2 + (pii - gg) * dd, 1e-10)
    along, own = products @ d.T, (products @ g)[:, None]
    change = (pii - gg) * along**2 + 2.0 * (1.0 + gd) * along * own - dd * own**2
    means = _power_mean(np.maximum(variances[:, None] - change / ratio, 0.0), power)
    best = int(means.argmin())
    if means[best] < present * (1.0 - 1e-9):
        points[i] = trials[best]
        return float(means[best])
    return float(present)


def _power_mean(values: Floats, power: float) -> Floats:
    """Power mean of every column; the maximum for an infinite power."""
    largest = values.max(axis=0)
    if math.isinf(power):
        return np.asarray(largest)
    return np.asarray(largest * ((values / largest) ** power).mean(axis=0) ** (1.0 / power))


def _trials(region: Region, lines: Lines, points: Floats, i: int, scale: float) -> Floats:
    """Other allowed values of each coordinate of point i, or other candidates of a list."""
    if region.candidates is not None:
        trials = region.candidates
    elif region.flat:
        trials = moves(region, points[i], scale * 0.5 * (1.0 + VALUES[VALUES > -1.0]))[1:]
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
