"""A report as a Word file, a PDF or a workbook."""

from __future__ import annotations

import re
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any

from rsmkit.errors import RsmkitError
from rsmkit.io.files.atomic_files import write_bytes
from rsmkit.io.tables.workbook_pages import Page, write_workbook
from rsmkit.report.paper.blocks import Grid, Heading, Paper, Picture, Text, cell_text
from rsmkit.report.paper.html_paper import html_text, write_html

__all__ = ["PAPERS", "write_paper"]

FIRST_SHEET = "report"
_CONTROLS = re.compile("[\\x00-\\x08\\x0b\\x0c\\x0e-\\x1f\\ud800-\\udfff\\ufffe\\uffff]")


def write_paper(paper: Paper, path: Path) -> None:
    """Write a report as what the name ends in: .html, .docx, .pdf or .xlsx.

    Raises
    ------
    RsmkitError
        For another ending, a library that is not installed, or a file that cannot be written.
    """
    word = path.suffix.lower().removeprefix(".")
    if word not in PAPERS:
        raise RsmkitError(f"{path}: a report is one of {', '.join(f'.{name}' for name in PAPERS)}")
    PAPERS[word](paper, path)


def write_pdf(paper: Paper, path: Path) -> None:
    """Write the page as PDF."""
    try:
        from weasyprint import HTML
    except (ImportError, OSError) as error:  # it loads libraries of the system
        raise _missing("PDF", "weasyprint", error) from None
    data: bytes = HTML(string=_clean(html_text(paper))).write_pdf()
    write_bytes(path, data)


def write_docx(paper: Paper, path: Path) -> None:
    """Write a Word file with real headings and tables, to be gone on with."""
    try:
        from docx import Document
    except ImportError as error:
        raise _missing("Word", "python-docx", error) from None
    from docx.shared import Inches, RGBColor

    document: Any = Document()
    document.add_heading(_clean(paper.title), 0)
    for block in paper.blocks:
        if isinstance(block, Heading):
            document.add_heading(_clean(block.text), block.level)
        elif isinstance(block, Text):
            document.add_paragraph().add_run(_clean(block.text)).bold = block.strong
        elif isinstance(block, Picture):
            document.add_picture(BytesIO(block.png), width=Inches(6))
            document.add_paragraph(_clean(block.caption), style="Caption")
        elif isinstance(block, Grid):
            _docx_table(document, block, RGBColor(0x99, 0x99, 0x99))
        else:
            document.add_page_break()
    stream = BytesIO()
    document.save(stream)
    write_bytes(path, stream.getvalue())


def _docx_table(document: Any, grid: Grid, grey: Any) -> None:
    from docx.shared import Pt

    if grid.title:
        caption = document.add_paragraph(_clean(grid.title), style="Caption")
        caption.paragraph_format.keep_with_next = True
    table = document.add_table(rows=0, cols=len(grid.heads), style="Light Grid Accent 1")
    for i, row in enumerate([grid.heads, *grid.rows], start=-1):
        for cell, value in zip(table.add_row().cells, row, strict=True):
            run = cell.paragraphs[0].add_run(_clean(cell_text(value)))
            run.font.size, run.font.bold = Pt(8), i < 0
            if i in grid.greyed:
                run.font.color.rgb = grey
    document.add_paragraph()


def write_tables(paper: Paper, path: Path) -> None:
    """Write a workbook: the words on the first sheet, each table on one of its own, numbers as numbers.

    Raises
    ------
    RsmkitError
        If there is a workbook that is no report: it may hold results.
    """
    _refuse_others(path)
    words: list[list[object]] = [[paper.title]]
    pages: list[Page] = []
    used: set[str] = set()
    for block in paper.blocks:
        if isinstance(block, Grid):
            title = base = re.sub(r"[\\/*?:\[\]]", " ", block.title or "table")[:28]
            number = 2
            while title.lower() in used:
                title, number = f"{base} {number}", number + 1
            used.add(title.lower())
            greyed = frozenset(row + 1 for row in block.greyed)
            pages.append(Page(title, [list(block.heads), *map(list, block.rows)], greyed=greyed))
            words.append([f"{block.title}: see the sheet {title}"])
        elif isinstance(block, Heading | Text):
            words.append([block.text])
    write_workbook(path, [Page(FIRST_SHEET, words, is_prose=True), *pages])


def _refuse_others(path: Path) -> None:
    """Keep a run sheet, or the table that was fitted, from being written over."""
    if not path.exists():
        return
    from openpyxl import load_workbook

    try:
        book = load_workbook(path, read_only=True)
        names = book.sheetnames
        book.close()
    except Exception:  # no workbook, or a damaged one
        names = []
    if names[:1] != [FIRST_SHEET]:
        raise RsmkitError(
            f"{path} exists and is no report; it may hold results. Give the report another name"
        )


def _clean(text: str) -> str:
    return _CONTROLS.sub("\ufffd", text)


def _missing(what: str, package: str, error: Exception) -> RsmkitError:
    return RsmkitError(
        f"a {what} report needs {package} ({error}): pip install 'rsmkit[report]', or take --html"
    )


PAPERS: dict[str, Callable[[Paper, Path], None]] = {
    "html": write_html,
    "docx": write_docx,
    "pdf": write_pdf,
    "xlsx": write_tables,
}
"""What a report can be written as, by the ending of its name."""
