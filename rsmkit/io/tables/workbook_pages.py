"""Workbooks (.xlsx) that we write: tables with frozen heads, and cells that are locked or checked."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any

from rsmkit.io.files.atomic_files import write_bytes

__all__ = ["Page", "write_workbook"]

LONGEST_TITLE = 31
"""Characters that a spreadsheet program allows for the name of a sheet."""
LONGEST_LIST = 255
"""Characters that the choices of a cell may have together, and what is said of a wrong one."""
MOST_COLUMNS = 16_384
MOST_MORE_ROWS = 200
"""Rows below a table whose cells are checked as well."""
WIDEST, PAGE = 60, 85
"""Characters of a column, and of one of sentences."""
LINE = 15.0
"""Height of a line of text in points, with the space about it."""
_CONTROLS = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")


@dataclass(frozen=True)
class Page:
    """One sheet of a workbook.

    Parameters
    ----------
    title : str
    rows : sequence of sequence of object
        Cells, the heads first.
    open_columns : frozenset of str
        Heads of the columns that may be written in; when any is named, the cells of all others are locked.
        Beside and below the table there is room for more.
    numbers : frozenset of str
        Heads of columns that take numbers only.
    choices : mapping of str to sequence of str
        Heads of columns that take only these texts.
    notes : mapping of str to str
        What a head says when one points at it.
    greyed : frozenset of int
        Rows, from 1 below the heads, that are shown in grey.
    is_prose : bool
        Whether the cells are sentences: broken into lines, as wide as a page.
    """

    title: str
    rows: Sequence[Sequence[object]]
    open_columns: frozenset[str] = frozenset()
    numbers: frozenset[str] = frozenset()
    choices: Mapping[str, Sequence[str]] = field(default_factory=dict)
    notes: Mapping[str, str] = field(default_factory=dict)
    greyed: frozenset[int] = frozenset()
    is_prose: bool = False


def write_workbook(path: Path, pages: Sequence[Page]) -> None:
    """Write a workbook in one step.

    Texts are texts, whatever they begin with: none becomes a formula.
    """
    from openpyxl import Workbook

    book = Workbook()
    book.remove(book.active)
    for page in pages:
        title = re.sub(r"[\\/*?:\[\]]", " ", page.title)[:LONGEST_TITLE] or "table"
        _fill(book.create_sheet(title), page)
    stream = BytesIO()
    book.save(stream)
    write_bytes(path, stream.getvalue())


def _fill(sheet: Any, page: Page) -> None:
    from openpyxl.comments import Comment
    from openpyxl.styles import Alignment, Font, PatternFill, Protection
    from openpyxl.utils import get_column_letter

    heads = [str(head) for head in page.rows[0]]
    for i, row in enumerate(page.rows, start=1):
        for j, value in enumerate(row, start=1):
            cell = sheet.cell(i, j)
            _put(cell, value)
            if i == 1:
                cell.font, cell.alignment = Font(bold=True), Alignment(wrap_text=True, vertical="top")
                cell.fill = PatternFill("solid", fgColor="DDE6F0")
                if heads[j - 1] in page.notes:
                    cell.comment = Comment(page.notes[heads[j - 1]], "rsmkit", width=320, height=110)
            elif i - 1 in page.greyed:
                cell.font = Font(color="999999")
            elif page.is_prose:
                cell.alignment = Alignment(wrap_text=True, vertical="top")
                sheet.row_dimensions[i].height = LINE * math.ceil(len(str(value)) / (0.9 * PAGE))
            if i > 1 and heads[j - 1] in page.open_columns:
                cell.protection = Protection(locked=False)
                cell.fill = PatternFill("solid", fgColor="FFFBE6")
    for j, head in enumerate(heads, start=1):
        longest = max((len(_shown(row[j - 1])) for row in page.rows[1:]), default=0)
        width = PAGE if page.is_prose else min(WIDEST, max(9, longest + 2, len(head) + 2))
        sheet.column_dimensions[get_column_letter(j)].width = width
    sheet.freeze_panes = "A2"
    sheet.page_setup.orientation = "portrait" if page.is_prose else "landscape"
    sheet.page_setup.fitToHeight = 0
    sheet.sheet_properties.pageSetUpPr.fitToPage = True
    sheet.print_title_rows = "1:1"
    if page.open_columns:
        _open_outside(sheet, len(heads))
        sheet.protection.sheet = True  # without a password: a seat belt, not a lock
        sheet.protection.formatColumns = sheet.protection.sort = sheet.protection.autoFilter = False
    _validate(sheet, page, heads)


def _open_outside(sheet: Any, columns: int) -> None:
    """Let people add columns and rows: a cell that is not there yet is as its column is."""
    from openpyxl.styles import Protection
    from openpyxl.utils import get_column_letter
    from openpyxl.worksheet.dimensions import ColumnDimension

    rest = get_column_letter(columns + 1)
    sheet.column_dimensions[rest] = ColumnDimension(
        sheet, index=rest, min=columns + 1, max=MOST_COLUMNS, width=13
    )
    for dimension in sheet.column_dimensions.values():
        dimension.protection = Protection(locked=False)


def _validate(sheet: Any, page: Page, heads: Sequence[str]) -> None:
    """Let cells take only what can be read again."""
    from openpyxl.utils import get_column_letter
    from openpyxl.worksheet.datavalidation import DataValidation

    last = len(page.rows) + MOST_MORE_ROWS
    for j, head in enumerate(heads, start=1):
        rule = None
        if head in page.numbers:
            rule = DataValidation("decimal", "-1E+300", "1E+300", allow_blank=True, operator="between")
            rule.error = f"{head} takes a number; leave it empty where nothing was measured."
        elif head in page.choices and _can_be_listed(page.choices[head]):
            rule = DataValidation("list", formula1=f'"{",".join(page.choices[head])}"', allow_blank=True)
            rule.error = f"{head} takes one of {', '.join(page.choices[head])}."
        if rule is not None:
            # a warning, not a wall: 'withdrawn' is a right answer as well
            rule.error = rule.error[:LONGEST_LIST]
            rule.errorTitle, rule.errorStyle, rule.showErrorMessage = "rsmkit", "warning", True
            column = get_column_letter(j)
            rule.add(f"{column}2:{column}{last}")
            sheet.add_data_validation(rule)


def _can_be_listed(choices: Sequence[str]) -> bool:
    """Whether a cell can offer these texts: spreadsheet programs split at commas and stop at a length."""
    is_plain = not any(re.search('[",]', text) for text in choices)
    return is_plain and len(",".join(choices)) <= LONGEST_LIST


def _put(cell: Any, value: object) -> None:
    if value is None or value == "":
        return
    if isinstance(value, bool) or not isinstance(value, int | float):
        cell.value = _CONTROLS.sub("\ufffd", str(value))
        cell.data_type = "s"  # also what begins with =
        cell.quotePrefix = cell.value[:1] in "=+-@"
    elif math.isfinite(value):
        cell.value = value
    elif value == value:  # what is not a number is not there
        cell.value = str(value)
        cell.data_type = "s"


def _shown(value: object) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
