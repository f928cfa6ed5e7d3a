"""Runs made by hand: a run sheet for the laboratory, and its results back into the journal.

The sheet is a table that any spreadsheet opens: one row per run, the planned settings, a column for what
each factor really was, a column per response, and room for remarks. Rows may be filled in over weeks, cell by
cell, and recorded as often as one likes: an empty cell leaves what is known, another value is a correction.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rsmkit.errors import RsmkitError
from rsmkit.io.json_codec import to_json
from rsmkit.io.tables.csv_tables import write_table
from rsmkit.io.tables.workbook_pages import Page, write_workbook
from rsmkit.language.space import Space
from rsmkit.runs.record.journal import Journal
from rsmkit.runs.record.run import ACTUAL, EXCLUDED, KIND, LABORATORY, Run
from rsmkit.runs.record.run_table import Runs
from rsmkit.runs.sheets.hand_runs import (
    ADDED,
    OPTIMUM,
    UNPLANNED,
    Correction,
    differences,
    place_words,
    value_words,
)
from rsmkit.runs.sheets.matching import Match, match_rows
from rsmkit.runs.sheets.sheet_page import sheet_page
from rsmkit.runs.sheets.sheet_rows import SheetRow, own_heads, read_rows

__all__ = ["SheetRecord", "record_sheet", "sheet_rows", "write_sheet"]


@dataclass(frozen=True)
class SheetRecord:
    """What a sheet held.

    Parameters
    ----------
    new, changed, unchanged : int
        Runs recorded for the first time, runs of which the sheet says more or something else than was known,
        and runs of which it says nothing new.
    blank : int
        Rows without a measurement so far.
    unplanned : int
        Recorded runs that the design does not have.
    corrections : tuple of Correction
        Values that were replaced.
    drifts : tuple of str
        Runs that were not made as planned, in words.
    notes : tuple of str
        What was not as it should be.
    kept_only : int
        Runs that the design does not have and that are kept without being fitted.
    """

    new: int
    changed: int
    unchanged: int
    blank: int
    unplanned: int
    corrections: tuple[Correction, ...] = ()
    drifts: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    kept_only: int = 0

    def overview(self) -> dict[str, Any]:
        """What ``--json`` prints."""
        document: dict[str, Any] = to_json(self)
        return document


def sheet_rows(
    runs: Runs,
    kinds: Sequence[str] = (),
    *,
    order: Sequence[int] = (),
    blocks: Sequence[int] = (),
    columns: Sequence[str] = (),
    outside: Sequence[Run] = (),
) -> list[list[object]]:
    """Give the run sheet as rows of cells, the heads first, with what has been recorded already.

    Parameters
    ----------
    runs : Runs
        The plan's points, with the runs recorded so far.
    kinds : sequence of str, optional
        What each point is in the design.
    order : sequence of int, optional
        The design's rows, from 0, in the order they are made in; the others follow without a number.
    blocks : sequence of int, optional
        Of the design's rows.
    columns : sequence of str, optional
        Further columns to fill in: groups that are a sample, such as days.
    outside : sequence of Run
        Recorded runs that the plan does not have.
    """
    space, size = runs.space, len(order) or len(runs)
    hand_made = [run for run in (*runs.runs, *outside) if run is not None and run.by_hand]
    heads = own_heads(space, runs.responses)
    actual = [f"{name}{ACTUAL}" for name in space.names]
    own = {KIND, EXCLUDED, *runs.responses, *actual}
    found = (name for run in hand_made for name in run.extras if name not in own)
    extras = list(dict.fromkeys([*columns, *found]))
    extras += [heads["comment"]] if heads["comment"] not in extras else []
    block = [heads["block"]] if blocks else []
    kept = [*actual, *runs.responses, EXCLUDED, *extras]
    numbered = [heads["run_order"], heads["run"], heads["kind"], *block]
    rows: list[list[object]] = [
        [*numbered, *space.names, *actual, *runs.responses, heads["excluded"], *extras]
    ]
    for place, row in enumerate([*order, *range(size, len(runs))] if order else range(len(runs))):
        numbers = [place + 1, row + 1] if row < size else ["", ""]
        here = [blocks[row] if row < len(blocks) else ""] if blocks else []
        known = _known(runs.runs[row], [*actual, EXCLUDED, *extras], runs.responses)
        planned = space.values(runs.points[row]).values()
        cells = [*planned, *(known.get(name, "") for name in kept)]
        rows.append([*numbers, kinds[row] if kinds else "", *here, *cells])
    for run in outside:
        known = _known(run, [*actual, EXCLUDED, *extras], runs.responses)
        cells = [*(run.factors[name] for name in space.names), *(known.get(name, "") for name in kept)]
        rows.append(["", "", run.extras.get(KIND, UNPLANNED), *[""] * len(block), *cells])
    return rows


def _known(run: Run | None, extras: Sequence[str], responses: Sequence[str]) -> dict[str, object]:
    """What cells of a run's row hold already."""
    if run is None:
        return {}
    known: dict[str, object] = {name: value for name in responses if (value := run.value(name)) == value}
    if run.by_hand:
        kept = {name: run.extras[name] for name in extras if name in run.extras}
        known |= {
            name: int(x) if isinstance(x, float) and x.is_integer() and abs(x) < 2**53 else x
            for name, x in kept.items()
        }
    return known


def write_sheet(
    path: Path,
    runs: Runs,
    kinds: Sequence[str] = (),
    *,
    order: Sequence[int] = (),
    blocks: Sequence[int] = (),
    columns: Sequence[str] = (),
    outside: Sequence[Run] = (),
    titles: Mapping[str, str] | None = None,
    corrections: Sequence[Correction] = (),
) -> None:
    """Write the run sheet, a workbook where the name ends in .xlsx, else CSV; see :func:`sheet_rows`.

    In a workbook planned cells are locked (there is no password), heads tell the units (`titles` of the
    responses), and a second page has the corrections.

    Raises
    ------
    RsmkitError
        If the file exists, since it might hold results, or cannot be written.
    """
    if path.exists():
        raise RsmkitError(f"{path} exists and may hold results; record them first, then move it away")
    rows = sheet_rows(runs, kinds, order=order, blocks=blocks, columns=columns, outside=outside)
    if path.suffix.lower() != ".xlsx":
        write_table(path, rows)
        return
    named = {name: (titles or {}).get(name, name) for name in runs.responses}
    pages = [sheet_page(rows, runs.space, named)]
    if corrections:
        told: list[list[object]] = [[item.run, item.name, item.old, item.new] for item in corrections]
        pages.append(Page("corrections", [["which", "what", "old", "new"], *told]))
    write_workbook(path, pages)


def record_sheet(
    path: Path,
    space: Space,
    planned: ArrayLike,
    journal: Journal,
    *,
    responses: Sequence[str],
    kinds: Sequence[str] = (),
    take: bool = False,
) -> SheetRecord:
    """Record what a filled-in sheet says.

    Rows find their runs as :func:`~rsmkit.runs.sheets.matching.match_rows` says. What a row says is merged
    with what is known of its run: empty cells change nothing, and a value that is replaced stays in the
    journal.

    Parameters
    ----------
    path : path
        The sheet; needs a column for every factor and every response.
    space : Space
        The factors.
    planned : array, shape (n, k)
        The planned points, natural units.
    journal : Journal
        Where runs are recorded.
    responses : sequence of str
        Columns that are responses.
    kinds : sequence of str, optional
        Of the planned points: ``optimum`` for those that are not of the design.
    take : bool
        Whether runs that were not planned are to be fitted too.

    Raises
    ------
    RsmkitError
        Naming every cell that cannot be read; nothing is recorded then.
    """
    rows = read_rows(path, space, responses)
    with journal:
        known = journal.load()
        design = np.atleast_2d(np.asarray(planned, float))
        matches = match_rows(path, rows, space, design, kinds, known)
        entries = [_entry(match, known.get(match.key), responses, take) for match in matches]
        journal.append(entries[index].run for index in _in_time(rows) if entries[index].is_news)
    measured = [entry for entry in entries if entry.run.state(responses) != "missing"]
    news = [entry for entry in measured if entry.is_news]
    outside = [str(e.run.extras.get(KIND)) for e in news if e.match.kind in (ADDED, UNPLANNED)]
    return SheetRecord(
        new=sum(entry.is_first for entry in news),
        changed=sum(not entry.is_first for entry in news),
        unchanged=len(measured) - len(news),
        blank=len(entries) - len(measured),
        unplanned=len(outside),
        corrections=tuple(item for entry in entries for item in entry.corrections),
        drifts=tuple(entry.drift for entry in news if entry.drift),
        notes=tuple(match.note for match in matches if match.note),
        kept_only=outside.count(UNPLANNED),
    )


@dataclass(frozen=True)
class _Entry:
    """A row, and what is known of its run with it.

    Parameters
    ----------
    match : Match
    run : Run
        Everything that is known now.
    is_first : bool
        Whether nothing had been measured before.
    is_news : bool
        Whether the row says anything that was not known.
    corrections : tuple of Correction
    """

    match: Match
    run: Run
    is_first: bool
    is_news: bool
    corrections: tuple[Correction, ...]

    @property
    def drift(self) -> str:
        """How the run was not made as planned, in words; empty where it was."""
        planned, made = self.run.factors, self.run.made_at
        away = {name: value for name, value in made.items() if value != planned[name]}
        if not away:
            return ""
        return f"{self.match.label} was made at {place_words(away)} instead of " + ", ".join(
            value_words(planned[name]) for name in away
        )


def _in_time(rows: Sequence[SheetRow]) -> list[int]:
    """Rows in the order in which their runs were made; one that does not say it follows those above it.

    So the journal has the runs in that order, in whatever order the rows of the sheet come back.
    """
    places, last = [], -math.inf
    for row in rows:
        last = last if row.place is None else max(last, row.place)
        places.append(last if row.place is None else row.place)
    return sorted(range(len(rows)), key=places.__getitem__)


def _entry(match: Match, old: Run | None, responses: Sequence[str], take: bool) -> _Entry:
    """Merge a row with what is known of its run."""
    asked = (*(old.responses if old else ()), *responses)
    measured = {name: x for name in asked if old and math.isfinite(x := old.value(name))}
    extras = {name: x for name, x in old.extras.items() if name not in asked} if old else {}
    drift = {
        f"{name}{ACTUAL}": value
        for name, value in {**match.drift, **match.row.actual}.items()
        if f"{name}{ACTUAL}" in extras or value != match.factors[name]
    }
    now = _overlaid(measured, match.row.responses)
    kept = _overlaid(extras, {**drift, **match.row.extras})
    if match.kind and (now or kept):
        kept[KIND] = ADDED if take and match.kind == UNPLANNED else match.kind
    run = Run(
        key=match.key,
        simulator=LABORATORY,
        settings={},
        factors=match.factors,
        replicate=match.replicate,
        status="done",
        responses=now,
        extras=kept,
        seconds=0.0,
        attempt=old.attempt + 1 if old else 1,
        started=datetime.now(UTC).isoformat(timespec="seconds"),
    )
    if old and kept.get(KIND) in (UNPLANNED, OPTIMUM):
        extras.setdefault(KIND, kept[KIND])  # which journals of the first versions leave unsaid
    is_news = (now, kept) != (measured, extras)
    gone = differences(old, run, responses) if old and is_news else []
    corrections = tuple(Correction(match.label, *item) for item in gone)
    return _Entry(match, run, not measured, is_news, corrections)


def _overlaid(known: Mapping[str, Any], said: Mapping[str, Any]) -> dict[str, Any]:
    """What is known, with what is said now on top; None takes back."""
    merged = dict(known)
    for name, value in said.items():
        if value is None:
            merged.pop(name, None)
        elif not _same(merged.get(name), value):
            merged[name] = value
    return merged


def _same(old: Any, new: Any) -> bool:
    """Whether a value is the one that was known, or the text of that number."""
    if isinstance(old, float) and isinstance(new, str):
        with suppress(ValueError):
            return float(new) == old
    return bool(old == new)
