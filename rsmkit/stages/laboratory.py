"""Runs made by hand: ``rsmkit sheet`` writes the run sheet, ``rsmkit record`` reads the results."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rsmkit.errors import StageError
from rsmkit.language.space import Floats
from rsmkit.runs.agenda import read_runs
from rsmkit.runs.record.journal import Journal
from rsmkit.runs.run_sheet import SheetRecord, record_sheet, write_sheet
from rsmkit.stages.evaluate import JOURNAL_FILE, study_simulator
from rsmkit.stages.fit import load_fit
from rsmkit.stages.plan import load_plan
from rsmkit.study.file import Study

__all__ = ["record_results", "write_run_sheet"]


def write_run_sheet(study: Study, path: Path) -> int:
    """Write the design, and the optima once there are some, as a table to be filled in; say how many rows.

    Raises
    ------
    RsmkitError
        If the file exists, for it may hold results.
    """
    points, kinds = _planned(study)
    journal = Journal(study.folder / JOURNAL_FILE)
    runs = read_runs(study_simulator(study), points, study.space, journal, responses=study.responses)
    write_sheet(path, runs, kinds)
    return len(points)


def record_results(study: Study, path: Path) -> SheetRecord:
    """Record the filled-in rows of a sheet in the journal; what is recorded already is not repeated."""
    journal = Journal(study.folder / JOURNAL_FILE)
    return record_sheet(path, study.space, _planned(study)[0], journal, responses=study.responses)


def _planned(study: Study) -> tuple[Floats, tuple[str, ...]]:
    design = load_plan(study).design
    try:
        optima = load_fit(study).optima
    except StageError:
        return design.points, design.kinds
    extra = [candidate.point for optimum in optima for candidate in optimum.candidates]
    return np.vstack([design.points, *extra]), (*design.kinds, *["optimum"] * len(extra))
