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
from typing import TYPE_CHECKING

import numpy as np

from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.io.atomic_files import write_text
from rsmkit.io.csv_tables import csv_text
from rsmkit.io.regular_files import inside, read_regular
from rsmkit.report.writers import WRITERS
from rsmkit.runs.one_run.simulator import Simulator
from rsmkit.runs.options import SimulatorOptions
from rsmkit.runs.record.run import run_key
from rsmkit.study.file import Study
from rsmkit.study.folder import StudyFolder
from rsmkit.study.user_functions import cheap_functions
from rsmkit.verification.verification import Confirmation, Verification

if TYPE_CHECKING:
    from rsmkit.report.findings import Findings
    from rsmkit.report.replay import Replay

__all__ = ["Reports", "gather_findings", "save_histories", "write_reports"]

LOG = logging.getLogger("rsmkit")
LARGEST_SCENE = 16 << 20


@dataclass(frozen=True)
class Reports:
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


def gather_findings(folder: StudyFolder) -> Findings:
    """Collect what the stages have found, with the verification if it is up to date."""
    from rsmkit.report.findings import Findings

    study, fitted = folder.study, folder.fitted()
    verification = None if folder.verify_problem() else folder.verification()
    responses = study.file.responses
    return Findings(
        study_name=study.name,
        runs=fitted.runs,
        surfaces=fitted.surfaces,
        objective_surfaces=fitted.objective_surfaces,
        titles={name: options.title(name) for name, options in responses.items()},
        design=folder.plan().design,
        optima=fitted.optima,
        verification=verification,
        functions=cheap_functions(study),
        failed=fitted.failed,
        settings=study.file.simulator.settings if study.file.simulator else {},
        scene=_scene(study),
        refinements=folder.refinements(),
        uncertainty=folder.uncertainty(),
        replays=_replays(study, verification) if verification else [],
    )


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
    for confirmation in _all_points(verification):
        path = _history_file(study, confirmation)
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


def _replays(study: Study, verification: Verification) -> list[Replay]:
    from rsmkit.report.replay import read_replay

    if not study.file.explorer.history:
        return []
    return [
        read_replay(_history_file(study, point), f"{point.name}, {point.point}", point.factors)
        for point in _all_points(verification)
        if _history_file(study, point).exists() and not _history_file(study, point).is_symlink()
    ]


def _all_points(verification: Verification) -> list[Confirmation]:
    return [point for search in verification.searches for point in (search, *search.extremes)]


def _history_file(study: Study, point: Confirmation) -> Path:
    settings = study.file.simulator.settings if study.file.simulator else {}
    return study.folder / f"history-{run_key(study.file.explorer.history, settings, point.factors)}.csv"


def _scene(study: Study) -> str:
    name = study.file.explorer.scene
    if not name:
        return ""
    path = inside(study.folder, name, "explorer.scene")
    try:
        return read_regular(path, LARGEST_SCENE).decode("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise RsmkitError(f"explorer.scene: {study.folder / name} cannot be read: {error}") from None
