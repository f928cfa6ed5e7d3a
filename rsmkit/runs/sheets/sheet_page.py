"""The run sheet as a workbook: planned cells locked, result cells checked, units in the heads' notes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rsmkit.io.tables.workbook_pages import Page
from rsmkit.language.space import Space
from rsmkit.runs.record.run import ACTUAL
from rsmkit.runs.sheets.sheet_rows import own_heads

__all__ = ["sheet_page"]

NOTES = {
    "run_order": "When to make the run.",
    "run": "Number of the run in the design. It tells which run a row is: leave it as it is.",
    "kind": "What the run is: of the design, at a predicted optimum, a confirmation, or added.",
    "excluded": "Why this run must not be used. Leave it empty for a run that counts.",
    "comment": "Anything worth knowing. More columns may be added to the right.",
}


def sheet_page(rows: Sequence[Sequence[object]], space: Space, titles: Mapping[str, str]) -> Page:
    """Make a page of the run sheet's rows.

    Parameters
    ----------
    rows : sequence of sequence of object
        As :func:`~rsmkit.runs.sheets.run_sheet.sheet_rows` gives them.
    space : Space
    titles : mapping of str to str
        Responses with their labels and units.
    """
    heads = own_heads(space, tuple(titles))
    actual = {f"{factor.name}{ACTUAL}": factor for factor in space}
    excluded = list(rows[0]).index(heads["excluded"])
    fixed = {*space.names, heads["run_order"], heads["run"], heads["kind"], heads["block"]}
    notes = {heads[name]: text for name, text in NOTES.items()}
    notes |= {factor.name: f"{factor.title}, as planned ({factor.domain.text})." for factor in space}
    notes |= {
        head: f"{factor.title}, as it really was. Leave it empty where it was as planned."
        for head, factor in actual.items()
    }
    notes |= {
        name: f"{title}: what was measured. Empty where nothing was; 'withdrawn' takes a value back."
        for name, title in titles.items()
    }
    numeric = {head for head, factor in actual.items() if factor.domain.is_numeric}
    return Page(
        "runs",
        rows,
        open_columns=frozenset(str(head) for head in rows[0] if head not in fixed),
        numbers=frozenset({*titles, *numeric}),
        choices={head: list(map(str, f.levels)) for head, f in actual.items() if not f.domain.is_numeric},
        notes=notes,
        greyed=frozenset(i for i, row in enumerate(rows) if i and row[excluded]),
    )
