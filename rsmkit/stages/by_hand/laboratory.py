"""Runs made by hand: ``rsmkit sheet`` writes the run sheet, ``rsmkit record`` reads the results."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rsmkit.errors import RsmkitError, StageError
from rsmkit.language.space import Floats
from rsmkit.runs.agenda import read_runs
from rsmkit.runs.record.run import KIND, Run
from rsmkit.runs.sheets.hand_runs import (
    OPTIMUM,
    UNPLANNED,
    Correction,
    corrections,
    off_plan,
    outside_words,
    planned_keys,
)
from rsmkit.runs.sheets.run_sheet import SheetRecord, record_sheet, write_sheet
from rsmkit.stages.by_hand.kept_order import run_order
from rsmkit.stages.verify import replicates_of
from rsmkit.study.counts import sizes_named
from rsmkit.study.folder import StudyFolder

__all__ = ["SheetPlan", "all_corrections", "record_results", "write_run_sheet"]


@dataclass(frozen=True)
class SheetPlan:
    """What was written.

    Parameters
    ----------
    rows : int
        Runs in the sheet.
    seed : int or None
        Of the run order; None for the standard order.
    """

    rows: int
    seed: int | None


def write_run_sheet(
    folder: StudyFolder, path: Path, *, seed: int | None = None, standard_order: bool = False
) -> SheetPlan:
    """Write the design, and the optima once there are some, as a table to be filled in.

    Parameters
    ----------
    folder : StudyFolder
    path : path
        File to write.
    seed : int, optional
        Draw the run order anew with this seed; by default that of the design, or the order drawn before.
    standard_order : bool
        Leave the runs in the order of the design.

    Raises
    ------
    RsmkitError
        If the file exists, for it may hold results; or if another run order is asked for when there are
        results.
    """
    points, kinds = _planned(folder)
    study, design = folder.study, folder.plan().design
    runs = read_runs(folder.simulator, points, study.space, folder.journal, responses=study.responses)
    order = run_order(folder, seed, standard=standard_order)
    keys = planned_keys(study.space, points)
    outside = [] if study.file.simulator else off_plan(study.space, folder.journal.load(), set(keys))
    random = study.file.design.random
    columns = random[1:] if design.blocks and not study.hard else random  # the first is the block itself
    known = (*study.space.names, *study.responses)
    columns += tuple(name for name in sizes_named(study) if name not in known)
    write_sheet(
        path,
        runs,
        kinds,
        order=order.rows,
        blocks=design.blocks,
        columns=columns,
        outside=outside,
        titles={name: options.title(name) for name, options in study.file.responses.items()},
        corrections=[] if study.file.simulator else all_corrections(folder),
    )
    return SheetPlan(len(points) + len(outside), order.seed)


def record_results(folder: StudyFolder, path: Path, *, take: bool = False) -> SheetRecord:
    """Record the filled-in rows of a sheet in the journal; what is recorded already is not repeated.

    Parameters
    ----------
    folder : StudyFolder
    path : path
        The sheet.
    take : bool
        Whether runs that were not planned are to be fitted too.
    """
    study = folder.study
    if study.file.simulator is not None:
        raise RsmkitError(
            "this study has a simulator, which makes its runs; to record runs made by hand, take the "
            "[simulator] table out of study.toml"
        )
    points, kinds = _planned(folder)
    return record_sheet(
        path, study.space, points, folder.journal, responses=study.responses, kinds=kinds, take=take
    )


def all_corrections(folder: StudyFolder) -> list[Correction]:
    """Every recorded value that a later one has replaced."""
    design, known = folder.plan().design, folder.journal.load()
    keys = planned_keys(folder.study.space, design.points)
    labels: dict[str, Run] = {f"run {row + 1}": known[key] for row, key in enumerate(keys) if key in known}
    for run in off_plan(folder.study.space, known, set(keys)):
        kind = str(run.extras.get(KIND, UNPLANNED))
        labels[outside_words(kind, run.factors, run.replicate)] = run
    return corrections(folder.journal, labels, folder.study.responses)


def _planned(folder: StudyFolder) -> tuple[Floats, tuple[str, ...]]:
    design = folder.plan().design
    try:
        optima = folder.fitted().optima
    except StageError:
        return design.points, design.kinds
    extra = [candidate.point for optimum in optima for candidate in optimum.candidates]
    extra = [point for point in extra for _ in range(replicates_of(folder.study))]
    return np.vstack([design.points, *extra]), (*design.kinds, *[OPTIMUM] * len(extra))
