"""The reports of a study, and the time tables that its page replays (``history-<key>.csv``).

One place calls every writer of the register. A report that cannot be written is a note with its reason and an
entry in the log: no stage depends on a picture.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.io.files.atomic_files import write_text
from rsmkit.io.shown import Shown
from rsmkit.io.tables.csv_tables import csv_text
from rsmkit.report.writers import WRITERS
from rsmkit.runs.one_run.simulator import Simulator
from rsmkit.runs.options import SimulatorOptions
from rsmkit.study.exploring import all_points, gather_findings, history_file
from rsmkit.study.file import Study
from rsmkit.study.folder import StudyFolder
from rsmkit.verification.verification import Verification

__all__ = ["Reports", "gather_findings", "save_histories", "write_reports"]

LOG = logging.getLogger("rsmkit")


@dataclass(frozen=True)
class Reports(Shown):
    """What was written, by the writer's word, and what could not be, in words."""

    paths: dict[str, Path]
    notes: tuple[str, ...]


@checked
def write_reports(folder: StudyFolder, *, replay: Verification | None = None) -> Reports:
    """Write every report of the register from what the stages have found so far.

    Parameters
    ----------
    folder : StudyFolder
        With an up-to-date fit.
    replay : Verification, optional
        Also make the time tables of its designs that are missing; each costs one call of the study's own
        function.
    """
    paths: dict[str, Path] = {}
    notes: list[str] = []
    findings = None
    if replay:
        with _noting(notes, "no time table of a verified design was made"):
            save_histories(folder.study, replay)
    with _noting(notes, "no report was written"):
        findings = gather_findings(folder)
    for writer in WRITERS.values() if findings else ():
        path = folder.path / writer.file
        with _noting(notes, f"the {writer.title} was not written"):
            writer.write(findings, path)
            paths[writer.word] = path
    return Reports(paths, tuple(notes))


@contextmanager
def _noting(notes: list[str], what: str) -> Iterator[None]:
    """Make a note of whatever goes wrong inside: the work of the stage is done."""
    try:
        yield
    except Exception as error:
        LOG.warning("%s", what, exc_info=True)
        reason = str(error) if isinstance(error, RsmkitError) else f"{type(error).__name__}: {error}"
        notes.append(f"{what}: {reason}")


def save_histories(study: Study, verification: Verification) -> None:
    """Save a time table of each verified design, if the study names a function that makes one.

    Raises
    ------
    RsmkitError
        If that function fails, or returns something that is not a table of numbers.
    """
    target = study.file.explorer.history
    if not target:
        return
    call = Simulator(SimulatorOptions(target), study.folder).load()
    settings = study.file.simulator.settings if study.file.simulator else {}
    for confirmation in all_points(verification):
        path = history_file(study, confirmation)
        if not path.exists():
            try:
                columns = call(**confirmation.factors, **settings)
                table = {str(name): np.asarray(column, float).tolist() for name, column in columns.items()}
                text = csv_text([[*table], *zip(*table.values(), strict=True)])
            except Exception as error:
                raise RsmkitError(
                    f"explorer.history: {target} failed at {confirmation.factors}: "
                    f"{type(error).__name__}: {error}. It must return a mapping of names to equal columns"
                ) from None
            write_text(path, text)
