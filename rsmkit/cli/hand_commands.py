"""Commands for runs made by hand, and for what is handed in."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from rsmkit.cli.decorators import common, study_argument

if TYPE_CHECKING:
    from rsmkit.cli.session import Session
    from rsmkit.study.folder import StudyFolder

__all__ = ["record", "report", "sheet"]


@click.command()
@click.option("--html", is_flag=True, help="A page for the browser (also when nothing is asked for).")
@click.option("--docx", is_flag=True, help="A Word file.")
@click.option("--pdf", is_flag=True, help="A PDF file.")
@click.option("--xlsx", is_flag=True, help="A workbook with every table.")
@click.option(
    "--output",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Where to; its ending says what (.html, .docx, .pdf, .xlsx). By default report.* in the study.",
)
@common
@study_argument
def report(session: Session, folder: StudyFolder, output: Path | None, **kinds: bool) -> None:
    """Write the study as one document to hand in, a page of summary first."""
    from rsmkit.stages.hand_in import REPORT_FILE, report_study

    words = [word for word, is_wanted in kinds.items() if is_wanted]
    paths = [output] if output else []
    paths += [folder.path / f"{REPORT_FILE}.{word}" for word in words or ([] if output else ["html"])]
    made = report_study(folder, paths)
    session.document["files"] = [str(path) for path in made]
    session.people.print(f"Wrote {', '.join(map(str, made))}", markup=False)


@click.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--seed", type=click.IntRange(min=0), help="Draw the run order anew with this seed.")
@click.option("--standard-order", is_flag=True, help="Leave the runs in the order of the design.")
@common
@study_argument
def sheet(session: Session, folder: StudyFolder, file: Path, seed: int | None, standard_order: bool) -> None:
    """Write a run sheet for runs made by hand: FILE is a table (.csv, .xlsx) to fill in.

    The runs are in random order (seed of the design, within its blocks); once there are results the order
    stays as it is.
    """
    from rsmkit.cli import show_sheets
    from rsmkit.stages.by_hand.laboratory import write_run_sheet

    written = write_run_sheet(folder, file, seed=seed, standard_order=standard_order)
    session.document.update({"file": str(file), **vars(written)})
    show_sheets.sheet(session, folder.study, file, written)


@click.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--take-unplanned", is_flag=True, help="Fit runs too that the design does not have.")
@common
@study_argument
def record(session: Session, folder: StudyFolder, file: Path, take_unplanned: bool) -> None:
    """Record the results of runs made by hand from a filled-in run sheet.

    Fill in what is known and record it as often as you like: an empty cell leaves what was recorded before,
    another value is a correction, and the old one is kept.
    """
    from rsmkit.cli import show_sheets
    from rsmkit.stages.by_hand.laboratory import record_results

    recorded = record_results(folder, file, take=take_unplanned)
    session.document.update(recorded.overview())
    show_sheets.record(session, folder.study, recorded)
