"""Tables as programs, spreadsheets and people write them: one reader for all of them, and one writer.

Understood are comma, semicolon, tab or blanks between values, a comma as decimal sign where values are not
separated by one, ``1.5d-3`` and typographic minus signs, quoted cells, comments, empty lines, ``sep=`` lines,
byte-order marks, texts in UTF-8, UTF-16 or a Windows code page, and workbooks (.xlsx).
"""

from __future__ import annotations

import csv
import io
import math
import re
import stat
from collections.abc import Callable, Collection, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from difflib import get_close_matches
from itertools import compress
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from rsmkit.errors import RsmkitError
from rsmkit.io.files.atomic_files import write_text
from rsmkit.io.tables.code_pages import USUAL, decoded, readings
from rsmkit.io.tables.workbook_pages import Page, write_workbook
from rsmkit.io.tables.workbooks import is_workbook, sheet_rows

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = [
    "LARGEST_FILE_BYTES",
    "Table",
    "csv_text",
    "free_name",
    "parse_table",
    "read_matrix",
    "read_table",
    "read_table_text",
    "split_line",
    "write_table",
]

T = TypeVar("T")

LARGEST_FILE_BYTES = 256 << 20
"""Tables up to this size are read."""
_FORMULA = re.compile(r"(^|[;\t\r\n])('*[=+\-@])")
_DISARMED = re.compile(r"(^|[;\t\r\n])'('*[=+\-@])")
_MINUS = str.maketrans({"\u2212": "-", "\u2013": "-"})
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?", re.IGNORECASE)


@dataclass(frozen=True)
class Table:
    """The texts of a table, column by column.

    Parameters
    ----------
    source : str
        The file, as messages name it.
    names : tuple of str
        Of the columns; empty for an empty file.
    cells : tuple of tuple of str
        The texts of each column, without blanks around them.
    lines : tuple of int
        Line of the file on which each row ends, or its row in a sheet.
    decimal_comma : bool
        Whether a comma in a number is its decimal sign; it is not where commas separate the values.
    note : str
        What was assumed about the file, for its reader.
    """

    source: str
    names: tuple[str, ...]
    cells: tuple[tuple[str, ...], ...]
    lines: tuple[int, ...]
    decimal_comma: bool
    note: str = ""

    def __len__(self) -> int:
        return len(self.lines)

    def texts(self, name: str) -> tuple[str, ...]:
        """One column.

        Raises
        ------
        RsmkitError
            If there is none of that name, or more than one.
        """
        if name not in self.names:
            known = {other.lower(): other for other in self.names}
            close = get_close_matches(name.lower(), known, n=1)
            hint = f"did you mean {known[close[0]]}?" if close else f"its columns are {', '.join(self.names)}"
            raise RsmkitError(f"{self.source}: has no column {name}; {hint}")
        if self.names.count(name) > 1:
            raise RsmkitError(f"{self.source}: two columns are named {name}")
        return self.cells[self.names.index(name)]

    def rows(self, keep: Sequence[bool]) -> Table:
        """Only some rows."""
        cells = tuple(tuple(compress(column, keep)) for column in self.cells)
        return replace(self, cells=cells, lines=tuple(compress(self.lines, keep)))

    def plain(self, text: str) -> str:
        """Give a number as ``float`` reads it, any other text as it is.

        Raises
        ------
        RsmkitError
            If a comma in it may mean thousands or decimals.
        """
        plain = text.translate(_MINUS).replace(",", ".").lower().replace("d", "e")
        if not _NUMBER.fullmatch(plain):
            return text
        if "," in text and not self.decimal_comma:
            raise RsmkitError(
                f"{self.source}: '{text}' in a comma-separated file may mean thousands or decimals; "
                "write numbers with a decimal point"
            )
        return plain

    def number(self, text: str) -> float | None:
        """Read a finite number, None for anything else; see :meth:`plain`."""
        plain = self.plain(text)
        value = float(plain) if _NUMBER.fullmatch(plain) else math.inf
        return value if math.isfinite(value) else None

    def value(self, text: str, read: Callable[[str], T]) -> T:
        """Read a text by a function: as it stands, or if that is refused as the number that it may be."""
        try:
            return read(text)
        except (ValueError, RsmkitError):
            return read(self.plain(text))


def read_table(
    path: Path, wanted: Sequence[str] = (), *, fill: bool = False, sheet: str | None = None
) -> Table:
    """Read a table from a file of text or from a sheet of a workbook.

    Parameters
    ----------
    path : path
        A regular file of at most 256 MB.
    wanted : sequence of str
        Columns that it should have. They tell a line of names that begins with ``#`` from a comment, which
        separator is meant, which code page, and which sheet.
    fill : bool
        Whether short rows are filled with empty cells and long ones cut; otherwise they are refused.
    sheet : str, optional
        Of a workbook; needed only where several have the columns.

    Raises
    ------
    RsmkitError
        If it cannot be read, with the line that is wrong.
    """
    data = _read_bytes(path)
    if is_workbook(data):
        return _made(sheet_rows(data, str(path), wanted, sheet), str(path), decimal_comma=True, fill=True)
    if sheet is not None:
        raise RsmkitError(f"{path}: is no workbook, so it has no sheet {sheet}")
    if not all(map(str.isascii, wanted)):
        for encoding, text in readings(data):  # the page in which the wanted names are there is the right one
            with suppress(RsmkitError):
                table = parse_table(text, str(path), wanted, fill=fill)
                if set(wanted) <= set(table.names):
                    note = "" if encoding in USUAL else f"{path} is read in the code page {encoding}"
                    return replace(table, note=note)
    return parse_table(decoded(data, str(path)), str(path), wanted, fill=fill)


def read_table_text(path: Path) -> str:
    """Read the text of a table whatever its encoding; pipes and devices, which may never end, are refused."""
    return decoded(_read_bytes(path), str(path))


def _read_bytes(path: Path) -> bytes:
    try:
        found = path.stat()
        if not stat.S_ISREG(found.st_mode) and not stat.S_ISDIR(found.st_mode):
            raise RsmkitError(f"{path}: is not a file")
        if found.st_size > LARGEST_FILE_BYTES:
            size, most = found.st_size >> 20, LARGEST_FILE_BYTES >> 20
            raise RsmkitError(f"{path}: has {size} MB; tables are read up to {most} MB")
        return path.read_bytes()
    except OSError as error:
        raise RsmkitError(f"{path}: cannot be read: {error.strerror}") from None


def parse_table(
    text: str, source: str, wanted: Sequence[str] = (), *, fill: bool = False, by_program: bool = False
) -> Table:
    """Make a table of a text; see :func:`read_table`.

    With `by_program`, what a program printed is read: ``#`` starts no comment, blanks separate nothing, and a
    quote that does not close is one of the texts.
    """
    lines = [line.strip(" ") for line in re.split("\r\n|\r|\n", text.removeprefix("\ufeff"))]
    first = next((i for i, line in enumerate(lines) if line), 0)
    told = re.fullmatch("sep=(.)", lines[first])
    if not by_program:
        if lines[first].startswith("#") and set(wanted) <= set(re.split(r"[#,;\t ]+", lines[first])):
            lines[first] = lines[first].lstrip("# ")
        lines = ["" if line.startswith("#") else line for line in lines]
    if told:
        lines[first] = ""
    delimiter = told[1] if told else _delimiter(lines, wanted, "," if by_program else " ")
    rows = _cells(lines, delimiter, source, strict=not by_program)
    return _made(rows, source, decimal_comma=delimiter != ",", fill=fill)


def _made(rows: list[tuple[int, list[str]]], source: str, *, decimal_comma: bool, fill: bool) -> Table:
    """Make a table of its rows, the names first."""
    names = tuple(re.sub(r"\s*\n\s*", " ", name) for name in rows[0][1]) if rows else ()
    body = rows[1:]
    if fill:
        body = [(line, (row + [""] * len(names))[: len(names)]) for line, row in body]
    elif body and all(len(row) == len(names) + 1 for _, row in body):
        names = ("", *names)  # R writes row names without a column name
    for line, row in body:
        if len(row) != len(names):
            raise RsmkitError(f"{source}: line {line} has {len(row)} values for {len(names)} columns")
    cells = tuple(zip(*(row for _, row in body), strict=True)) or ((),) * len(names)
    return Table(source, names, cells, tuple(line for line, _ in body), decimal_comma)


def read_matrix(path: Path) -> NDArray[np.float64]:
    """Read a table of numbers without a line of names, shape (rows, columns).

    Raises
    ------
    RsmkitError
        If it cannot be read, with the line that is wrong.
    """
    import numpy as np

    data = _read_bytes(path)
    if is_workbook(data):
        delimiter, rows = "", sheet_rows(data, str(path))
    else:
        text = re.sub("#.*", "", decoded(data, str(path)))
        lines = [line.strip(" ") for line in re.split("\r\n|\r|\n", text)]
        delimiter = next((mark for mark in "\t;," if mark in text), " ")  # a number holds no tab or semicolon
        rows = _cells(lines, delimiter, str(path), strict=True)
    reader = Table(str(path), (), (), (), decimal_comma=delimiter != ",")
    numbers = []
    for line, row in rows:
        values = [reader.number(text) for text in row]
        if None in values:
            raise RsmkitError(f"{path}: line {line}: '{row[values.index(None)]}' is not a number")
        if len(row) != len(rows[0][1]):
            raise RsmkitError(f"{path}: line {line} has {len(row)} values, the first line {len(rows[0][1])}")
        numbers.append(values)
    if not numbers:
        raise RsmkitError(f"{path}: is empty")
    return np.array(numbers, float)


def split_line(text: str) -> list[str]:
    """Split one line at its commas, those in double quotes excepted."""
    return next(csv.reader([text], skipinitialspace=True), [])


def csv_text(rows: Iterable[Iterable[object]]) -> str:
    """Make the text of a table, the names first; numbers keep every digit.

    No text becomes a formula in a spreadsheet program: one that could gets an apostrophe, which is taken away
    again when the table is read.
    """
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([_harmless(cell) for cell in row] for row in rows)
    # JSON can hold half a character (a lone surrogate), a file of text cannot.
    return text.getvalue().encode(errors="backslashreplace").decode()


def free_name(name: str, taken: Collection[str]) -> str:
    """Name a column of our own beside those of the user: ``kind_`` where ``kind`` is taken."""
    while name in taken:
        name += "_"
    return name


def write_table(path: Path, rows: Iterable[Iterable[object]]) -> None:
    """Write a table in one step: a workbook where the name ends in .xlsx, else CSV; see :func:`csv_text`."""
    if path.suffix.lower() == ".xlsx":
        write_workbook(path, [Page("table", [list(row) for row in rows])])
    else:
        write_text(path, csv_text(rows))


def _harmless(cell: object) -> object:
    """Keep a text from being a formula, also where a spreadsheet splits at semicolons."""
    if not isinstance(cell, str) or _NUMBER.fullmatch(cell):
        return cell
    return _FORMULA.sub(r"\1'\2", cell)


def _as_written(cell: str) -> str:
    """Take away the apostrophe of :func:`_harmless`; most cells have none."""
    return _DISARMED.sub(r"\1\2", cell) if "'" in cell else cell


def _delimiter(lines: Sequence[str], wanted: Sequence[str], otherwise: str) -> str:
    """What separates the names: the mark that gives the wanted ones, else the one met most."""
    head = re.sub('"[^"]*"', '""', "\n".join(lines)).lstrip("\n").partition("\n")[0]
    marks = sorted((mark for mark in ",;\t" if mark in head), key=head.count, reverse=True)
    whole = next((line for line in lines if line), "")
    for mark in marks if wanted else ():
        if set(wanted) <= {cell.strip() for cell in next(csv.reader([whole], delimiter=mark), [])}:
            return mark
    return marks[0] if marks else otherwise


def _cells(lines: Sequence[str], delimiter: str, source: str, *, strict: bool) -> list[tuple[int, list[str]]]:
    """Split lines into cells; each row with the line it ends on, empty rows left out."""
    reader = csv.reader(
        (f"{line}\n" for line in lines), delimiter=delimiter, skipinitialspace=True, strict=strict
    )
    rows: list[tuple[int, list[str]]] = []
    try:
        for row in reader:
            rows.append((reader.line_num, [_as_written(cell.strip()) for cell in row]))
    except csv.Error as error:
        if strict and "end of data" not in str(error):  # blanks after a quoted cell, say: read them as well
            return _cells(lines, delimiter, source, strict=False)
        line = rows[-1][0] + 1 if rows else 1
        raise RsmkitError(f"{source}: line {line}: not a CSV table ({error})") from None
    return [(line, row) for line, row in rows if any(row)]
