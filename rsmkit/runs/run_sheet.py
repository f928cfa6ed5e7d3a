"""Runs made by hand: a run sheet for the laboratory, and its results back into the journal.

The sheet is a CSV table that any spreadsheet opens: one row per run, a column per factor, an empty column per
response. Rows may be filled in over weeks and recorded as often as one likes; other columns (operator,
remarks) are kept with the run. Semicolons with decimal commas, as some spreadsheets write them, are
understood.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rsmkit.errors import RsmkitError
from rsmkit.io.csv_tables import Table, read_table, write_table
from rsmkit.language.space import Floats, Space
from rsmkit.runs.agenda import make_task
from rsmkit.runs.one_run.simulator import OutputError, Simulator, read_output
from rsmkit.runs.options import SimulatorOptions
from rsmkit.runs.record.journal import Journal
from rsmkit.runs.record.run import Run
from rsmkit.runs.record.run_table import Runs

__all__ = ["SheetRecord", "laboratory", "record_sheet", "write_sheet"]

MATCH_FRACTION = 1e-3  # of a factor's range: what is lost when a person types 92.07 for 92.0710678
_OWN_COLUMNS = ("run", "kind")


@dataclass(frozen=True)
class SheetRecord:
    """What a sheet held.

    Parameters
    ----------
    new, changed, unchanged : int
        Runs recorded for the first time, recorded anew because the sheet now says something else, and known.
    blank : int
        Rows not filled in yet.
    unplanned : int
        Recorded runs at points that the design does not have.
    """

    new: int
    changed: int
    unchanged: int
    blank: int
    unplanned: int


def laboratory(folder: Path) -> Simulator:
    """Give the stand-in for a simulator by which laboratory runs are found in the journal."""
    return Simulator(SimulatorOptions(deterministic=False), folder)


def write_sheet(path: Path, runs: Runs, kinds: Sequence[str] = ()) -> None:
    """Write the run sheet, with what has been recorded already filled in.

    Parameters
    ----------
    path : path
        File to write; it must not exist, since it might hold results.
    runs : Runs
        The design's points, with the runs recorded so far.
    kinds : sequence of str, optional
        What each point is in the design.

    Raises
    ------
    RsmkitError
        If the file exists or cannot be written.
    """
    if path.exists():
        raise RsmkitError(f"{path} exists and may hold results; record them first, then move it away")
    rows: list[list[object]] = [[*_OWN_COLUMNS, *runs.space.names, *runs.responses]]
    for index, (point, run) in enumerate(zip(runs.points, runs.runs, strict=True)):
        known = [run.responses.get(name, "") if run else "" for name in runs.responses]
        kind = kinds[index] if kinds else ""
        rows.append([index + 1, kind, *runs.space.values(point).values(), *known])
    write_table(path, rows)


def record_sheet(
    path: Path, space: Space, planned: ArrayLike, journal: Journal, *, responses: Sequence[str]
) -> SheetRecord:
    """Record what a filled-in sheet says.

    A row belongs to the planned point whose factors it gives to within a thousandth of their ranges; any
    other row is a run of its own. Rows of the same point are replicates, in the order of the sheet.

    Parameters
    ----------
    path : path
        The sheet; needs a column for every factor and every response.
    space : Space
        The factors.
    planned : array, shape (n, k)
        The design's points, natural units.
    journal : Journal
        Where runs are recorded.
    responses : sequence of str
        Columns that are responses.

    Raises
    ------
    RsmkitError
        Naming every cell that cannot be read; nothing is recorded then.
    """
    table = _read_sheet(path, (*space.names, *responses))
    points, problems = _points(table, space, path)
    results = [_results(table, row, space) for row in range(len(table))]
    problems += [
        f"{path.name} line {line}: {name} = {result[name]!r} is not a number"
        for line, result in zip(table.lines, results, strict=True)
        for name in responses
        if not isinstance(result.get(name, 0.0), float)
    ]
    if problems:
        raise RsmkitError("\n".join(problems))
    with journal:
        known = journal.load()
        fresh: list[Run] = []
        count: Counter[str] = Counter()
        seen: Counter[tuple[float, ...]] = Counter()
        design = np.atleast_2d(np.asarray(planned, float))
        for measured, result in zip(points, results, strict=True):
            point, is_planned = _match(measured, design, space)
            replicate = seen[tuple(point)]
            seen[tuple(point)] += 1
            if not any(result.get(name) is not None for name in responses):
                count["blank"] += 1
                continue
            run = _run(space, point, replicate, result, responses, known)
            old = known.get(run.key)
            if old and (old.responses, old.extras) == (run.responses, run.extras):
                count["unchanged"] += 1
                continue
            count["changed" if old else "new"] += 1
            count["unplanned"] += not is_planned
            fresh.append(run)
        journal.append(fresh)
    return SheetRecord(count["new"], count["changed"], count["unchanged"], count["blank"], count["unplanned"])


def _read_sheet(path: Path, needed: Sequence[str]) -> Table:
    table = read_table(path, needed, fill=True)
    missing = [name for name in needed if table.names.count(name) != 1]
    if missing:
        raise RsmkitError(
            f"{path}: needs exactly one column {', '.join(missing)} (its head is {', '.join(table.names)})"
        )
    return table


def _points(table: Table, space: Space, path: Path) -> tuple[list[Floats], list[str]]:
    points, problems = [], []
    for row, line in enumerate(table.lines):
        try:
            point = np.array([table.value(table.texts(f.name)[row], f.coordinate) for f in space])
            if not np.isfinite(point).all():
                raise RsmkitError("a factor is not a finite number")
            points.append(point)
        except RsmkitError as error:
            problems.append(f"{path.name} line {line}: {error}")
    return points, problems


def _results(table: Table, row: int, space: Space) -> dict[str, Any]:
    """Everything in a row that came back from the laboratory, numbers as numbers, empty cells left out."""
    skipped = {*space.names, *_OWN_COLUMNS, ""}
    cells = {name: column[row] for name, column in zip(table.names, table.cells, strict=True)}
    return {name: _number(table, cell) for name, cell in cells.items() if name not in skipped and cell}


def _number(table: Table, cell: str) -> float | str:
    try:
        return table.value(cell, float)
    except (ValueError, RsmkitError):
        return cell


def _match(measured: Floats, design: Floats, space: Space) -> tuple[Floats, bool]:
    scale = np.where(space.numeric, space.highs - space.lows, 1.0)
    distance = (np.abs(design - measured) / scale).max(axis=1)
    nearest = int(distance.argmin())
    return (design[nearest], True) if distance[nearest] <= MATCH_FRACTION else (measured, False)


def _run(
    space: Space,
    point: Floats,
    replicate: int,
    result: dict[str, Any],
    responses: Sequence[str],
    known: Mapping[str, Run],
) -> Run:
    task = make_task(laboratory(Path()), space.values(point), replicate)
    old = known.get(task.key)
    error = ""
    try:
        found, extras = read_output(result, responses)
    except OutputError as reason:
        found, extras, error = (
            {},
            reason.extras,
            f"not measured: {', '.join(n for n in responses if n not in result)}",
        )
    return Run(
        key=task.key,
        simulator=laboratory(Path()).identity,
        settings={},
        factors=task.factors,
        replicate=replicate,
        status="failed" if error else "done",
        responses=found,
        extras=extras,
        seconds=0.0,
        attempt=old.attempt + 1 if old else 1,
        error=error,
    )
