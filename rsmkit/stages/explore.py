"""The explorer page of a study (``explorer.html``) and the time tables it replays (``history-<key>.csv``)."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rsmkit.errors import RsmkitError
from rsmkit.io.atomic_files import write_text
from rsmkit.runs.one_run.simulator import Simulator
from rsmkit.runs.options import SimulatorOptions
from rsmkit.runs.record.run import run_key
from rsmkit.stages.fit import FitResult
from rsmkit.stages.plan import load_plan
from rsmkit.stages.refine import current_refinements
from rsmkit.stages.user_functions import cheap_functions
from rsmkit.stages.verify import load_verification, verify_problem
from rsmkit.study.file import Study
from rsmkit.verification.verification import Confirmation, Verification

if TYPE_CHECKING:
    from rsmkit.report.explorer.replay import Replay

__all__ = ["EXPLORER_FILE", "save_histories", "write_page"]

EXPLORER_FILE = "explorer.html"


def write_page(study: Study, fitted: FitResult) -> Path:
    """Write the explorer page from what the stages found, with the verification if it is up to date."""
    from rsmkit.report.explorer.explorer_page import write_explorer
    from rsmkit.report.explorer.page_document import Findings

    verification = None if verify_problem(study) else load_verification(study).verification
    path = study.folder / EXPLORER_FILE
    responses = study.file.responses
    write_explorer(
        path,
        Findings(
            study_name=study.name,
            runs=fitted.runs,
            surfaces=fitted.surfaces,
            objective_surfaces=fitted.objective_surfaces,
            titles={name: _title(name, options.label, options.unit) for name, options in responses.items()},
            design=load_plan(study).design,
            optima=fitted.optima,
            verification=verification,
            functions=cheap_functions(study),
            failed=fitted.failed,
            settings=study.file.simulator.settings if study.file.simulator else {},
            scene=_scene(study),
            refinements=current_refinements(study),
            replays=_replays(study, verification) if verification else [],
        ),
    )
    return path


def save_histories(study: Study, verification: Verification) -> list[Path]:
    """Save a time table of each verified design, if the study names a function that makes one.

    Raises
    ------
    RsmkitError
        If that function fails, or returns something that is not a table of numbers.
    """
    target = study.file.explorer.history
    if not target:
        return []
    call = Simulator(SimulatorOptions(target), study.folder).load()
    settings = study.file.simulator.settings if study.file.simulator else {}
    paths = []
    for confirmation in _all_points(verification):
        path = _history_file(study, confirmation)
        if not path.exists():
            try:
                columns = call(**confirmation.factors, **settings)
                text = _csv({str(name): np.asarray(column, float) for name, column in columns.items()})
            except Exception as error:
                raise RsmkitError(
                    f"explorer.history: {target} failed at {confirmation.factors}: "
                    f"{type(error).__name__}: {error}. It must return a mapping of names to equal columns"
                ) from None
            write_text(path, text)
        paths.append(path)
    return paths


def _csv(columns: dict[str, Any]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*(column.tolist() for column in columns.values()), strict=True))
    return text.getvalue()


def _replays(study: Study, verification: Verification) -> list[Replay]:
    from rsmkit.report.explorer.replay import read_replay

    if not study.file.explorer.history:
        return []
    return [
        read_replay(_history_file(study, point), f"{point.name}, {point.point}", point.factors)
        for point in _all_points(verification)
        if _history_file(study, point).exists()
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
    try:
        return (study.folder / name).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise RsmkitError(f"explorer.scene: {study.folder / name} cannot be read: {error}") from None


def _title(name: str, label: str, unit: str) -> str:
    return f"{label or name} [{unit}]" if unit else label or name
