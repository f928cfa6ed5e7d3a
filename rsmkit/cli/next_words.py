"""What to type next, in words."""

from __future__ import annotations

from pathlib import Path

from rich.markup import escape

from rsmkit.cli.session import Session
from rsmkit.study.file import Study

__all__ = ["next_command", "where_words"]


def where_words(study: Study) -> str:
    """Name the study's folder for a command, unless it is the one we are in."""
    return "" if study.folder == Path() else f" {study.folder}"


def next_command(session: Session, command: str) -> None:
    """Say what to type next, unless another stage follows by itself."""
    if session.next_commands:
        session.people.print(f"[dim]Next:[/] {escape(command)}")
