"""What people see of runs made by hand."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rich.markup import escape

from rsmkit.cli.next_words import next_command, next_stage, where_words
from rsmkit.cli.session import Session
from rsmkit.study.file import Study

if TYPE_CHECKING:
    from rsmkit.runs.sheets.run_sheet import SheetRecord
    from rsmkit.stages.by_hand.laboratory import SheetPlan
    from rsmkit.stages.confirmations import ConfirmationRun

__all__ = ["confirmation_runs", "record", "sheet"]


def sheet(session: Session, study: Study, file: Path, written: SheetPlan) -> None:
    """Show what was written."""
    order = "standard order" if written.seed is None else f"random order, seed {written.seed}"
    session.people.print(f"Wrote {file}: {written.rows} rows to fill in ({order})", markup=False)
    next_command(session, f"rsmkit record {file}{where_words(study)}")


def record(session: Session, study: Study, recorded: SheetRecord) -> None:
    """Show what a run sheet held."""
    session.people.print(
        f"{recorded.new} runs recorded, {recorded.changed} changed, {recorded.unchanged} known already, "
        f"{recorded.blank} rows still empty, {recorded.unplanned} not in the design"
    )
    for correction in recorded.corrections:
        session.people.print(f"  correction: {escape(correction.sentence)} (the old value is kept)")
    for text in (*recorded.drifts, *recorded.notes):
        session.people.print(f"  [yellow]note:[/] {escape(text)}")
    if recorded.kept_only:
        session.people.print(
            f"  [yellow]note:[/] {recorded.kept_only} of them are kept without being fitted; to fit them, "
            "add --take-unplanned"
        )
    next_stage(session, study, "fit")


def confirmation_runs(session: Session, runs: Sequence[ConfirmationRun]) -> None:
    """Show what confirmation runs say of the surfaces."""
    for run in runs:
        color = "green" if run.verdict == "CONFIRMED" else "red"
        session.people.print(f"  confirmation run, [bold {color}]{run.verdict}[/]: {escape(run.sentence)}")
