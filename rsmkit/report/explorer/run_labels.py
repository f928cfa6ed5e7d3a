"""What people call the runs on the page, and which of them each surface was fitted to."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Iterable, Sequence

import numpy as np

from rsmkit.report.findings import Findings
from rsmkit.surfaces.fitted_response import FittedResponse
from rsmkit.surfaces.models.surface import Surface

__all__ = ["rows_of", "run_labels"]


def run_labels(findings: Findings) -> list[str]:
    """The number of each run: its row in the design, or in the table that was fitted.

    Runs that were not planned are numbered after those of the design.
    """
    runs = findings.runs
    if findings.labels:
        return list(findings.labels)
    if findings.design is None:
        return [str(i + 1) for i in range(len(runs))]
    rows = _queues(findings.design.points)
    labels, more = [], 0
    for run, point in zip(runs.runs, runs.points, strict=True):
        planned = point if run is None else runs.space.point(run.factors)
        queue = rows.get(_key(planned))
        if queue:
            labels.append(str(queue.popleft() + 1))
        else:
            more += 1
            labels.append(f"added {more}")
    return labels


def rows_of(surface: FittedResponse[Surface], points: np.ndarray, measured: Sequence[bool]) -> list[int]:
    """Which run, from 0, each row of a surface's data is; -1 where none of them was made there."""
    queues = _queues(points, [i for i, is_known in enumerate(measured) if is_known])
    found = []
    for point in surface.data.points:
        queue = queues.get(_key(point))
        found.append(queue.popleft() if queue else -1)
    return found


def _queues(points: np.ndarray, rows: Iterable[int] | None = None) -> dict[bytes, deque[int]]:
    """Rows by their point, in order."""
    queues: dict[bytes, deque[int]] = defaultdict(deque)
    for row in range(len(points)) if rows is None else rows:
        queues[_key(points[row])].append(row)
    return dict(queues)


def _key(point: np.ndarray) -> bytes:
    return (np.asarray(point, float) + 0.0).tobytes()  # minus zero is zero
