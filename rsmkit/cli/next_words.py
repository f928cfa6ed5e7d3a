"""What to type next, in words."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

from rich.markup import escape

from rsmkit.cli.session import Session
from rsmkit.study.file import Study
from rsmkit.verification.next_steps import NOTHING

__all__ = ["next_command", "next_stage", "where_words"]


def where_words(study: Study) -> str:
    """Name the study's folder for a command, unless it is the one we are in."""
    return "" if study.folder == Path() else f" {study.folder}"


def next_command(session: Session, command: str) -> None:
    """Say what to type next, unless another stage follows by itself."""
    if session.next_commands:
        session.people.print(f"[dim]Next:[/] {escape(command)}")


def next_stage(
    session: Session, study: Study, stage: str, words: Mapping[str, str] = MappingProxyType({})
) -> None:
    """Say what `status` says is next; where that is nothing, `stage` looks at what was made last.

    Parameters
    ----------
    session, study : Session, Study
    stage : str
        The stage that follows the one that was typed.
    words : mapping of str to str
        What to say instead where the stage of that name is to do.
    """
    if not session.next_commands:
        return
    from rsmkit.stages.looks.status import study_status
    from rsmkit.study.folder import StudyFolder

    found = study_status(StudyFolder(study))
    if found.stage in words:
        next_command(session, words[found.stage])
    elif found.next == NOTHING and stage == "fit":  # as after a confirmation run, which no surface takes
        next_command(session, f"rsmkit fit{where_words(study)}")
    else:
        next_command(session, found.command(where_words(study)))
