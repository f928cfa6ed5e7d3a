"""Runs made by hand: ``rsmkit sheet`` writes the run sheet, ``rsmkit record`` reads the results."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rsmkit.errors import StageError
from rsmkit.language.space import Floats
from rsmkit.runs.agenda import read_runs
from rsmkit.runs.run_sheet import SheetRecord, record_sheet, write_sheet
from rsmkit.stages.verify import replicates_of
from rsmkit.study.folder import StudyFolder

__all__ = ["record_results", "write_run_sheet"]


def write_run_sheet(folder: StudyFolder, path: Path) -> int:
    """Write the design, and the optima once there are some, as a table to be filled in; say how many rows.

    Raises
    ------
    RsmkitError
        If the file exists, for it may hold results.
    """
    points, kinds = _planned(folder)
    study = folder.study
    runs = read_runs(folder.simulator, points, study.space, folder.journal, responses=study.responses)
    write_sheet(path, runs, kinds)
    return len(points)


def record_results(folder: StudyFolder, path: Path) -> SheetRecord:
    """Record the filled-in rows of a sheet in the journal; what is recorded already is not repeated."""
    study = folder.study
    return record_sheet(path, study.space, _planned(folder)[0], folder.journal, responses=study.responses)


def _planned(folder: StudyFolder) -> tuple[Floats, tuple[str, ...]]:
    design = folder.plan().design
    try:
        optima = folder.fitted().optima
    except StageError:
        return design.points, design.kinds
    extra = [candidate.point for optimum in optima for candidate in optimum.candidates]
    extra = [point for point in extra for _ in range(replicates_of(folder.study))]
    return np.vstack([design.points, *extra]), (*design.kinds, *["optimum"] * len(extra))
