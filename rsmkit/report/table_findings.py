"""A fitted table of finished experiments as findings, so that it has the same page as a study."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rsmkit.language.space import Floats
from rsmkit.report.findings import Findings
from rsmkit.runs.record.run import LABORATORY, Run
from rsmkit.runs.record.run_table import Runs
from rsmkit.surfaces.tables.table_fit import TableFit

__all__ = ["table_findings"]


def table_findings(fitted: TableFit) -> Findings:
    """Collect what a page shows of a table; its runs are called by their rows."""
    points: dict[int, Floats] = {}
    values: dict[int, dict[str, float]] = {}
    for name, surface in fitted.surfaces.items():
        data = surface.data
        rows = fitted.rows.get(name) or tuple(range(1, len(data) + 1))
        for row, point, y in zip(rows, data.points, data.y.tolist(), strict=True):
            points[row] = point
            values.setdefault(row, {})[name] = y
    order = sorted(points)
    made = tuple(
        Run(
            key=str(row),
            simulator=LABORATORY,
            settings={},
            factors=fitted.space.values(points[row]),
            replicate=0,
            status="done",
            responses=values[row],
            extras={},
            seconds=0.0,
        )
        for row in order
    )
    return Findings(
        study_name=Path(fitted.source).name,
        runs=Runs(fitted.space, np.array([points[row] for row in order]), made, tuple(fitted.surfaces)),
        surfaces=dict(fitted.surfaces),
        labels=[str(row) for row in order],
    )
