"""A study's folder as something to look at: what every report is written from, and the page in a notebook."""

from __future__ import annotations

from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from rsmkit.errors import RsmkitError
from rsmkit.io.files.regular_files import inside, read_regular
from rsmkit.study.file import Study

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rsmkit.language.space import Floats
    from rsmkit.report.explorer.inline_page import ExplorerPage
    from rsmkit.report.findings import Findings
    from rsmkit.report.replay import Replay
    from rsmkit.runs.record.design_runs import DesignRuns
    from rsmkit.runs.record.journal import Journal
    from rsmkit.study.keepings import Fitted, Plan
    from rsmkit.variation.findings_of_laws import Uncertainty
    from rsmkit.verification.refinement.refinement import RefinementRecord
    from rsmkit.verification.verification import Confirmation, Verification

__all__ = ["Explorable", "all_points", "gather_findings", "history_file"]

LARGEST_SCENE = 16 << 20
PAGE_FILE = "explorer.html"


class Kept(Protocol):
    """What a study's folder knows."""

    study: Study
    path: Path

    @property
    def journal(self) -> Journal: ...
    def plan(self) -> Plan: ...
    def design_runs(self) -> DesignRuns: ...
    def fitted(self) -> Fitted: ...
    def verify_problem(self) -> str | None: ...
    def verification(self) -> Verification: ...
    def refinements(self) -> Mapping[str, RefinementRecord]: ...
    def uncertainty(self) -> Uncertainty | None: ...


class Explorable:
    """Shows a study's folder in a notebook."""

    def explore(self: Kept) -> ExplorerPage:
        """Write the explorer page of what has been found so far; a notebook shows it at once.

        Returns
        -------
        ExplorerPage
            The path of ``explorer.html``; as the last line of a cell it is the page itself.

        Raises
        ------
        StageError
            If the study has no up-to-date fit.
        """
        from rsmkit.report.explorer.explorer_page import write_explorer
        from rsmkit.report.explorer.inline_page import ExplorerPage

        page = ExplorerPage(self.path / PAGE_FILE)
        write_explorer(page, gather_findings(self))
        return page

    def __repr__(self: Kept) -> str:
        return f"<StudyFolder: {self.study.name}, in {self.path}>"

    def _repr_html_(self: Kept) -> str:
        study = self.study
        there = sorted(path.name for path in self.path.iterdir() if path.is_file())
        rows = {
            "folder": str(self.path),
            "factors": ", ".join(f"{factor.title} ({factor.domain.text})" for factor in study.space),
            "responses": ", ".join(study.responses),
            "files": ", ".join(there),
        }
        body = "".join(f"<tr><th>{name}</th><td>{escape(text)}</td></tr>" for name, text in rows.items())
        return f"<table><caption>{escape(study.name)}</caption>{body}</table>"


def gather_findings(folder: Kept) -> Findings:
    """Collect what the stages have found, with the verification if it is up to date."""
    from rsmkit.report.findings import Findings
    from rsmkit.study.user_functions import cheap_functions
    from rsmkit.verification.verification import SpentRuns

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
        tolerance_pct=study.file.verify.tolerance_pct,
        functions=cheap_functions(study),
        failed=fitted.failed,
        failed_points=_failed(folder),
        spent=SpentRuns(
            len(fitted.runs),
            verification.simulator_runs.verification if verification else 0,
            len(folder.journal.load()),
        ),
        settings=study.file.simulator.settings if study.file.simulator else {},
        scene=_scene(study),
        choices={**fitted.responses, **fitted.objectives},
        refinements=folder.refinements(),
        uncertainty=folder.uncertainty(),
        replays=_replays(study, verification) if verification else [],
    )


def _failed(folder: Kept) -> Floats:
    """Where runs of the design failed, shape (m, k)."""
    runs = folder.design_runs().runs
    points: Floats = runs.points[runs.failed]
    return points


def all_points(verification: Verification) -> list[Confirmation]:
    """Every point that was run, the extremes of fronts among them."""
    return [point for search in verification.searches for point in (search, *search.extremes)]


def history_file(study: Study, point: Confirmation) -> Path:
    """Where the time table of a verified point is kept."""
    from rsmkit.runs.record.run import run_key

    settings = study.file.simulator.settings if study.file.simulator else {}
    return study.folder / f"history-{run_key(study.file.explorer.history, settings, point.factors)}.csv"


def _replays(study: Study, verification: Verification) -> list[Replay]:
    from rsmkit.report.replay import read_replay

    if not study.file.explorer.history:
        return []
    return [
        read_replay(history_file(study, point), f"{point.name}, {point.point}", point.factors)
        for point in all_points(verification)
        if history_file(study, point).exists() and not history_file(study, point).is_symlink()
    ]


def _scene(study: Study) -> str:
    name = study.file.explorer.scene
    if not name:
        return ""
    path = inside(study.folder, name, "explorer.scene")
    try:
        return read_regular(path, LARGEST_SCENE).decode("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise RsmkitError(f"explorer.scene: {study.folder / name} cannot be read: {error}") from None
