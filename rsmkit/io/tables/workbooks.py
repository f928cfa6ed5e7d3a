"""Sheets of workbooks (.xlsx) as rows of texts."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from datetime import date, datetime
from io import BytesIO
from typing import Any
from zipfile import BadZipFile

from rsmkit.errors import RsmkitError, one_of

__all__ = ["is_workbook", "sheet_rows"]

_ZIP, _OLE = b"PK\x03\x04", b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"

Rows = list[tuple[int, list[str]]]


def is_workbook(data: bytes) -> bool:
    """Whether the bytes of a file are those of a workbook of any sort."""
    return data.startswith((_ZIP, _OLE))


def sheet_rows(data: bytes, source: str, wanted: Sequence[str] = (), sheet: str | None = None) -> Rows:
    """Rows of a sheet from its line of names on, each with its number; empty rows left out.

    The line of names is the first that holds every wanted one, so that titles may stand above it.

    Parameters
    ----------
    data : bytes
    source : str
        The file, for messages.
    wanted : sequence of str
        Columns that the sheet should have; they tell which sheet is meant where nothing says it.
    sheet : str, optional

    Raises
    ------
    RsmkitError
        If it is not an .xlsx workbook, there is no such sheet, more than one may be meant, or a wanted
        column holds formulas whose values were never computed.
    """
    if data.startswith(_OLE):
        raise RsmkitError(f"{source}: is an old or encrypted workbook; save it as .xlsx without a password")
    with _workbook(data, source, values=True) as book:
        names = [page.title for page in book.worksheets]
        if sheet is None:
            found = {name: _table(_rows(book[name]), wanted) for name in names}
            sheet = _meant(found, source, wanted)
            rows = found[sheet]
        else:
            sheet = one_of("sheet", sheet, tuple(names))
            rows = _table(_rows(book[sheet]), wanted)
    used = [j for j, name in enumerate(rows[0][1]) if name in wanted] if rows else []
    if any(not row[j] for _, row in rows for j in used):
        _check_formulas(data, source, sheet, dict(rows), used)
    return rows


def _meant(found: dict[str, Rows], source: str, wanted: Sequence[str]) -> str:
    """Name the one sheet that may be meant."""
    filled = [name for name, rows in found.items() if rows]
    fitting = [name for name in filled if wanted and set(wanted) <= set(found[name][0][1])]
    if len(fitting) == 1:
        return fitting[0]
    if fitting or len(filled) > 1:
        which = "several sheets with these columns" if fitting else "no sheet with all of these columns"
        asked = f" ({', '.join(wanted)})" if wanted else ""
        raise RsmkitError(
            f"{source}: has {which}{asked}; say which one with --sheet: {', '.join(fitting or filled)}"
        )
    return (filled or list(found))[0]


def _table(rows: Rows, wanted: Sequence[str]) -> Rows:
    """From the line of names on, all rows of one length."""
    heads = (i for i, (_, row) in enumerate(rows) if wanted and set(wanted) <= set(map(_name, row)))
    rows = rows[next(heads, 0) :]
    width = max((len(row) for _, row in rows), default=0)
    filled = [(number, row + [""] * (width - len(row))) for number, row in rows]
    return [(filled[0][0], list(map(_name, filled[0][1]))), *filled[1:]] if filled else []


def _name(text: str) -> str:
    return re.sub(r"\s*\n\s*", " ", text)


def _rows(page: Any) -> Rows:
    page.reset_dimensions()  # what the file says about its size may be wrong
    rows = ((i, list(map(_text, row))) for i, row in enumerate(page.iter_rows(values_only=True), start=1))
    return [(i, row) for i, row in rows if any(row)]


def _text(value: Any) -> str:
    """Give what a cell holds as a table of texts would hold it."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(value).upper()
    if isinstance(value, datetime) and (value.hour, value.minute, value.second) == (0, 0, 0):
        return value.date().isoformat()
    if isinstance(value, date):
        return value.isoformat()
    return repr(value) if isinstance(value, float) else str(value).strip()


def _check_formulas(
    data: bytes, source: str, sheet: str, rows: dict[int, list[str]], used: list[int]
) -> None:
    """Refuse cells that hold a formula but no value: they are not empty."""
    with _workbook(data, source, values=False) as book:
        page = book[sheet]
        page.reset_dimensions()
        for number, row in enumerate(page.iter_rows(values_only=True), start=1):
            for j in used if number in rows else ():
                if not rows[number][j] and j < len(row) and str(row[j] or "").startswith("="):
                    raise RsmkitError(
                        f"{source}: sheet {sheet}, row {number} holds a formula without its value; "
                        "open the workbook in a spreadsheet program and save it"
                    )


@contextmanager
def _workbook(data: bytes, source: str, *, values: bool) -> Iterator[Any]:
    """Open a workbook for reading: values of formulas, or the formulas."""
    from openpyxl import load_workbook

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about what the sheet looks like
        try:
            book = load_workbook(BytesIO(data), read_only=True, data_only=values)
            try:
                yield book
            finally:
                book.close()
        except (BadZipFile, KeyError, ValueError, TypeError, OSError) as error:
            raise RsmkitError(
                f"{source}: cannot be read as an .xlsx workbook ({error}); save it as .xlsx or CSV"
            ) from None
