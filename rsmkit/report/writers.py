"""The register of reports: what is written of a study's findings, one row a kind.

A new kind of report is one file with a function of the findings and the folder, and one row here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rsmkit.report.findings import Findings

__all__ = ["WRITERS", "Writer"]


@dataclass(frozen=True)
class Writer:
    """One kind of report.

    Parameters
    ----------
    word : str
        By which it is asked for.
    title : str
        What it is called in messages.
    file : str
        Name of the file in the study's folder.
    write : callable
        Writes the findings to the path; whatever it raises becomes a note, never the end of a stage.
    """

    word: str
    title: str
    file: str
    write: Callable[[Findings, Path], None]


def _explorer(findings: Findings, path: Path) -> None:
    from rsmkit.report.explorer.explorer_page import write_explorer

    write_explorer(path, findings)


WRITERS: dict[str, Writer] = {
    "explorer": Writer("explorer", "explorer page", "explorer.html", _explorer),
}
