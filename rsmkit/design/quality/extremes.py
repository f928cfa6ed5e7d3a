"""Smallest and largest prediction variance over a region: searched for, not the extremes of a sample."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from rsmkit.design.moves import moves
from rsmkit.design.region import Region
from rsmkit.language.space import Floats
from rsmkit.language.terms import Terms

__all__ = ["extreme_variances"]

CLIMBERS = 16
"""Points of the sample that climb."""
VALUES = 11
"""Values that a continuous coordinate tries while the others rest."""
SWEEPS = 30
POLISHED = 6
"""Peaks that a gradient method goes on from."""


def extreme_variances(
    terms: Terms, covariance: Floats, region: Region, sample: Floats
) -> tuple[float, float]:
    """Find the smallest and the largest prediction variance, error variance 1.

    Parameters
    ----------
    terms : Terms
    covariance : array, shape (p, p)
        Of the coefficients.
    region : Region
    sample : array, shape (m, k)
        Coded points of the region to begin from.

    Notes
    -----
    The best points of the sample move along one coordinate after the other while that helps (over all levels
    of a discrete factor), the best of these then along the gradient, within bounds and constraints. A list of
    candidates is looked through.
    """

    def variance(coded: Floats) -> Floats:
        rows = terms.matrix(coded)
        return np.asarray(((rows @ covariance) * rows).sum(axis=1))

    if region.candidates is not None:
        values = variance(region.candidates)
        return float(values.min()), float(values.max())
    ends = []
    for sign in (1.0, -1.0):
        peaks, values = _climb(lambda x, s=sign: s * variance(x), region, sample)  # type: ignore[misc]
        best = float(values.max())
        for peak in peaks[np.argsort(-values, kind="stable")[:POLISHED]]:
            polished = _polished(terms, sign * covariance, region, peak)
            if region.contains(polished)[0]:
                best = max(best, sign * float(variance(polished[None])[0]))
        ends.append(sign * best)
    return ends[1], ends[0]


def _climb(value: Callable[[Floats], Floats], region: Region, sample: Floats) -> tuple[Floats, Floats]:
    """Move each coordinate of the best points of the sample to its best value, in turn."""
    heights = value(sample)
    order = np.argsort(-heights, kind="stable")[:CLIMBERS]
    peaks, heights = sample[order].copy(), heights[order]
    if region.flat:
        return _climb_along(value, region, peaks)
    for _ in range(SWEEPS):
        before = heights.copy()
        for j, levels in enumerate(region.levels):
            places = levels if len(levels) else np.linspace(region.lows[j], region.highs[j], VALUES)
            trials = np.repeat(peaks[:, None, :], len(places), axis=1)
            trials[:, :, j] = places
            flat = trials.reshape(-1, peaks.shape[1])
            found = np.where(region.contains(flat), value(flat), -math.inf).reshape(len(peaks), -1)
            best = found.argmax(axis=1)
            better = found[np.arange(len(peaks)), best] > heights
            peaks[better, j] = places[best[better]]
            heights = np.where(better, found[np.arange(len(peaks)), best], heights)
        if (heights <= before * (1.0 + 1e-12 * np.sign(before))).all():
            break
    peaks, first = np.unique(peaks, axis=0, return_index=True)
    return peaks, heights[first]


def _climb_along(value: Callable[[Floats], Floats], region: Region, peaks: Floats) -> tuple[Floats, Floats]:
    """Move points of a flat region along its edges and others of its directions."""
    parts = np.linspace(0.0, 1.0, VALUES)[1:]
    for _ in range(SWEEPS):
        before = peaks.copy()
        for i, peak in enumerate(peaks):
            places = moves(region, peak, parts)
            heights = value(places)
            if heights.max() > heights[0] + 1e-12 * abs(heights[0]):
                peaks[i] = places[heights.argmax()]
        if (peaks == before).all():
            break
    peaks = np.unique(peaks, axis=0)
    return peaks, value(peaks)


def _polished(terms: Terms, form: Floats, region: Region, peak: Floats) -> Floats:
    """Go up from a peak along the gradient of ``f' form f`` in the continuous coordinates."""
    from scipy.optimize import minimize

    free = np.array([j for j, levels in enumerate(region.levels) if not len(levels)], dtype=int)
    if not len(free):
        return peak

    def whole(z: Floats) -> Floats:
        point = peak.copy()
        point[free] = z
        return point

    def depth(z: Floats) -> tuple[float, Floats]:
        point = whole(z)[None]
        along = form @ terms.matrix(point)[0]
        slope = terms.gradient(point)[0][:, free].T @ along
        return -float(terms.matrix(point)[0] @ along), -2.0 * slope

    options: dict[str, Any] = {"method": "L-BFGS-B", "options": {"ftol": 1e-15, "gtol": 1e-10}}
    held = _held(region, whole)
    if held:
        options = {"method": "SLSQP", "constraints": held, "options": {"ftol": 1e-14, "maxiter": 200}}
    bounds = list(zip(region.lows[free], region.highs[free], strict=True))
    return whole(np.asarray(minimize(depth, peak[free], jac=True, bounds=bounds, **options).x, float))


def _held(region: Region, whole: Callable[[Floats], Floats]) -> list[dict[str, Any]]:
    """The constraints of a region as scipy takes them."""
    normals, offsets = region.halfspaces
    held: list[Callable[[Floats], Any]] = []
    if len(normals):
        held.append(lambda z: offsets - normals @ whole(z))
    if math.isfinite(region.radius):
        numeric = region.space.numeric
        held.append(lambda z: region.radius**2 - (whole(z)[numeric] ** 2).sum())
    if region.nonlinear:
        held.append(lambda z: np.concatenate([region.margin(c, whole(z)[None]) for c in region.nonlinear]))
    matrix, values = region.equalities
    equal = [{"type": "eq", "fun": lambda z: matrix @ whole(z) - values}] if len(matrix) else []
    return equal + [{"type": "ineq", "fun": function} for function in held]
