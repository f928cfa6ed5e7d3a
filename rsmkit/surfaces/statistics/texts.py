"""Numbers and tables of a report as text."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

__all__ = ["columns_of", "pairs", "short", "text_table"]


def short(value: float | None) -> str:
    """Five digits, a hyphen for what is not defined."""
    return "-" if value is None else f"{value:.5g}"


def pairs(values: Mapping[str, float | None]) -> str:
    """Numbers by name: ``x1 = 2.5, x2 = 0.1``."""
    return ", ".join(f"{name} = {short(x)}" for name, x in values.items())


def text_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Lines with aligned columns, the first to the left and the others to the right."""
    widths = [max(len(row[i]) for row in [head, *rows]) for i in range(len(head))]
    return [
        "  ".join([row[0].ljust(widths[0]), *(x.rjust(w) for x, w in zip(row[1:], widths[1:], strict=True))])
        for row in [head, *rows]
    ]


def columns_of(rows: Iterable[Mapping[str, Any]], keys: Mapping[str, str]) -> list[str]:
    """Lines of a table of JSON rows; `keys` maps heads to keys, the first of which holds texts."""
    name, *numbers = keys.values()
    return text_table(list(keys), [[str(row[name]), *(short(row[key]) for key in numbers)] for row in rows])
