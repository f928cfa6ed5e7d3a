"""A memory in front of an expensive evaluator: no point is run twice, and every run is counted."""

from __future__ import annotations

import math

import numpy as np

from rsmkit.language.space import Floats, Space
from rsmkit.optimum.problem import Evaluator

__all__ = ["CachedEvaluator"]

DIGITS = 12
"""Points that agree to so many decimals of the range are the same run."""


class CachedEvaluator:
    """An evaluator that remembers.

    Parameters
    ----------
    evaluator : Evaluator
        The simulator: responses at natural points, nan where a run failed.
    space : Space
        The factors.
    """

    def __init__(self, evaluator: Evaluator, space: Space) -> None:
        self._evaluator = evaluator
        self._space = space
        self._rows: dict[bytes, int] = {}
        self._points: list[Floats] = []
        self._responses: dict[str, list[float]] = {}
        self.batches: list[int] = []
        """Number of new runs in each call that needed any."""

    def __call__(self, points: Floats) -> dict[str, Floats]:
        """Responses at natural points, shape (n, k), running only those not seen before."""
        keys = [self._key(point) for point in points]
        fresh = {key: row for row, key in enumerate(keys) if key not in self._rows}
        if fresh:
            new = points[list(fresh.values())]
            for name, column in self._evaluator(new).items():
                self._responses.setdefault(name, []).extend(np.asarray(column, float).tolist())
            for key, point in zip(fresh, new, strict=True):
                self._rows[key] = len(self._points)
                self._points.append(point)
            self.batches.append(len(fresh))
        rows = [self._rows[key] for key in keys]
        return {name: np.array(column)[rows] for name, column in self._responses.items()}

    @property
    def runs(self) -> int:
        """Different points run so far."""
        return len(self._points)

    def history(self) -> tuple[Floats, dict[str, Floats]]:
        """All runs in order: points, shape (n, k), and responses."""
        points = np.array(self._points).reshape(-1, len(self._space))
        return points, {name: np.array(column) for name, column in self._responses.items()}

    def waves(self, processors: int) -> int:
        """Rounds of parallel runs needed with so many processors."""
        return sum(math.ceil(size / processors) for size in self.batches)

    def _key(self, point: Floats) -> bytes:
        unit = (point - self._space.lows) / (self._space.highs - self._space.lows)
        return bytes((np.round(unit, DIGITS) + 0.0).tobytes())
