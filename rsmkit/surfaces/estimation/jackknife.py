"""Jackknife+ intervals: from errors at runs that were left out, without an assumption on how they are spread.

Barber, Candes, Ramdas & Tibshirani, Annals of Statistics 49 (2021): an interval of nominal confidence
``1 - a`` covers a new run that is exchangeable with the others with probability ``1 - 2a`` at least. Points
of a design are not exchangeable with points anywhere in the box, so this is no guarantee here either.
"""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np

from rsmkit.language.space import Floats

__all__ = ["LeftOut", "jackknife_plus"]

CHUNK = 4_000_000
"""Predictions held at a time, points times runs."""


class LeftOut(Protocol):
    """A surface that knows what it would be without each of its runs."""

    def predict(self, points: Floats) -> Floats:
        """Predict the response, shape (m,)."""
        ...

    @property
    def loo_residuals(self) -> Floats:
        """Error of predicting each run from the others, shape (n,)."""
        ...

    def predictions_without(self, points: Floats) -> Floats:
        """Predict the response without each of the runs, shape (m, n)."""
        ...


def jackknife_plus(surface: LeftOut, points: Floats, confidence: float) -> tuple[Floats, Floats, Floats]:
    """Interval for a new run at each point.

    Returns
    -------
    mean, low, high : array, shape (m,)
        Infinite when there are too few runs for the confidence, ``n < 1 / (1 - confidence) - 1``.
    """
    sizes = np.abs(surface.loo_residuals)
    rank = math.floor((1.0 - confidence) * (len(sizes) + 1) + 1e-9)
    mean = surface.predict(points)
    low, high = np.full_like(mean, -np.inf), np.full_like(mean, np.inf)
    step = max(1, CHUNK // len(sizes))
    for start in range(0, len(points) if rank else 0, step):
        part = slice(start, start + step)
        without = surface.predictions_without(points[part])
        low[part] = np.partition(without - sizes, rank - 1, axis=1)[:, rank - 1]
        high[part] = np.partition(without + sizes, -rank, axis=1)[:, -rank]
    return mean, low, high
