"""How a record shows itself in a notebook: as a table of its fields."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from html import escape
from typing import Any

__all__ = ["Shown", "html_table"]

MOST_VALUES = 12
"""Values of a list that are written out."""
MOST_ROWS = 30
"""Rows of a table inside a table."""
MOST_LETTERS = 200


class Shown:
    """Shows a dataclass in a notebook as a table of its fields; every text is escaped."""

    __slots__ = ()

    def _repr_html_(self) -> str:
        rows = [(f.name, getattr(self, f.name)) for f in fields(self) if f.repr]  # type: ignore[arg-type]
        return html_table(type(self).__name__, [(_words(name), _cell(value)) for name, value in rows])


def html_table(caption: str, rows: Sequence[tuple[str, str]], heads: Sequence[str] = ()) -> str:
    """Make a table; cells are HTML already, names and heads are text."""
    head = "<tr>" + "".join(f"<th>{escape(text)}</th>" for text in heads) + "</tr>" if heads else ""
    body = "".join(f"<tr><th>{escape(name)}</th>{cell}</tr>" for name, cell in rows)
    return f"<table>{f'<caption>{escape(caption)}</caption>' if caption else ''}{head}{body}</table>"


def _words(name: str) -> str:
    return name.replace("_", " ")


def _cell(value: Any) -> str:
    return f'<td style="text-align: left">{_html(value)}</td>'


def _html(value: Any) -> str:
    """A value, with one more table inside where it is a record or a list of records."""
    own = getattr(value, "_repr_html_", None)
    if own is not None and not isinstance(value, Shown):
        return str(own())
    if _is_record(value):
        return html_table("", [(_words(f.name), _plain_cell(getattr(value, f.name))) for f in fields(value)])
    if isinstance(value, Mapping) and value:
        return _mapping(value)
    if isinstance(value, Sequence) and value and all(map(_is_record, value)):
        return _records([str(i + 1) for i in range(len(value))], value)
    return escape(_text(value))


def _mapping(value: Mapping[Any, Any]) -> str:
    shown = list(value.items())[:MOST_ROWS]
    if all(_is_record(each) for _, each in shown):
        return _records([str(key) for key, _ in shown], [each for _, each in shown])
    more = [("…", f"<td>{len(value)} in all</td>")] if len(value) > len(shown) else []
    return html_table("", [*((str(key), _plain_cell(each)) for key, each in shown), *more])


def _records(names: Sequence[str], values: Sequence[Any]) -> str:
    """Alike records as one table, a row each; others one after the other."""
    columns = [f.name for f in fields(values[0])]
    rows = [
        (name, "".join(_plain_cell(getattr(value, column, None)) for column in columns))
        for name, value in list(zip(names, values, strict=True))[:MOST_ROWS]
    ]
    more = f"<p>{len(values)} in all</p>" if len(values) > len(rows) else ""
    return html_table("", rows, ["", *map(_words, columns)]) + more


def _is_record(value: Any) -> bool:
    return is_dataclass(value) and not isinstance(value, type)


def _plain_cell(value: Any) -> str:
    return f"<td>{escape(_text(value))}</td>"


def _text(value: Any) -> str:
    """A value in one line."""
    if value is None or (isinstance(value, float) and value != value):
        return "–"
    if isinstance(value, float):
        return f"{value:.6g}"
    if hasattr(value, "ndim") and hasattr(value, "tolist"):  # numpy is not loaded for this alone
        if value.ndim != 1 or len(value) > MOST_VALUES:
            return f"array of shape {value.shape}"
        return ", ".join(map(_text, value.tolist()))
    if isinstance(value, Mapping):
        return _several([f"{key} {_text(each)}" for key, each in value.items()])
    if isinstance(value, Sequence | frozenset | set) and not isinstance(value, str | bytes):
        return _several([_text(each) for each in value])
    text = str(value)
    return text if len(text) <= MOST_LETTERS else f"{text[:MOST_LETTERS]}…"


def _several(texts: list[str]) -> str:
    more = f", … ({len(texts)} in all)" if len(texts) > MOST_VALUES else ""
    return ", ".join(texts[:MOST_VALUES]) + more
