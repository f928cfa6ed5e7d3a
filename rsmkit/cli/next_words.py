"""What to type next, in words."""

from __future__ import annotations

from pathlib import Path

from rich.markup import escape

from rsmkit.cli.session import Session
from rsmkit.study.file import Study

__all__ = ["next_command", "next_stage", "where_words"]


def where_words(study: Study) -> str:
    """Name the study's folder for a command, unless it is the one we are in."""
    return "" if study.folder == Path() else f" {study.folder}"


def next_command(session: Session, command: str) -> None:
    """Say what to type next, unless another stage follows by itself."""
    if session.next_commands:
        session.people.print(f"[dim]Next:[/] {escape(command)}")


def next_stage(session: Session, study: Study, stage: str) -> None:
    """Say which stage is next; of runs made by hand what `status` says, for it may be their sheet."""
    if not session.next_commands:
        return
    if study.file.simulator is not None:
        next_command(session, f"rsmkit {stage}{where_words(study)}")
        return
    from rsmkit.stages.looks.status import study_status
    from rsmkit.study.folder import StudyFolder

    found = study_status(StudyFolder(study))
    if found.stage or stage == "verify":
        next_command(session, found.command(where_words(study)))
    else:  # nothing is out of date: what was recorded last is something to look at
        next_command(session, f"rsmkit {stage}{where_words(study)}")
