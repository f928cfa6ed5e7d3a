"""Runs made by hand: a run sheet for the laboratory, and its results back into the journal.

The sheet is a CSV table that any spreadsheet opens: one row per run, a column per factor, an empty column per
response. Rows may be filled in over weeks and recorded as often as one likes; other columns (operator,
remarks) are kept with the run. Semicolons with decimal commas, as some spreadsheets write them, are
understood.
"""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rsmkit.errors import RsmkitError
from rsmkit.io.atomic_files import write_text
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
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([*_OWN_COLUMNS, *runs.space.names, *runs.responses])
    for index, (point, run) in enumerate(zip(runs.points, runs.runs, strict=True)):
        known = [run.responses.get(name, "") if run else "" for name in runs.responses]
        kind = kinds[index] if kinds else ""
        writer.writerow([index + 1, kind, *runs.space.values(point).values(), *known])
    write_text(path, text.getvalue())


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
    rows = _read_rows(path, (*space.names, *responses))
    points, problems = _points(rows, space, path)
    results = [_results(row, space, responses) for row in rows]
    problems += [
        f"{path.name} line {number}: {name} = {row[name]!r} is not a number"
        for number, row in enumerate(rows, start=2)
        for name in responses
        if row[name] and not isinstance(_number(row[name]), float)
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


def _read_rows(path: Path, needed: Sequence[str]) -> list[dict[str, str]]:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise RsmkitError(f"{path}: is not UTF-8 text; save it as CSV UTF-8") from None
    except OSError as error:
        raise RsmkitError(f"{path}: cannot be read: {error.strerror}") from None
    head = text.partition("\n")[0]
    delimiter = ";" if head.count(";") > head.count(",") else ","
    lines = [[cell.strip() for cell in row] for row in csv.reader(io.StringIO(text), delimiter=delimiter)]
    names = lines[0] if lines else []
    missing = [name for name in needed if names.count(name) != 1]
    if missing:
        raise RsmkitError(
            f"{path}: needs exactly one column {', '.join(missing)} (its head is {', '.join(names)})"
        )
    wide = [row + [""] * (len(names) - len(row)) for row in lines[1:] if any(row)]
    comma = "," if delimiter == ";" else "."
    return [
        {
            name: cell.replace(comma, ".") if _looks_numeric(cell) else cell
            for name, cell in zip(names, row, strict=False)
        }
        for row in wide
    ]


def _looks_numeric(cell: str) -> bool:
    return bool(cell) and not cell.strip("+-0123456789.,eE")


def _points(rows: Sequence[dict[str, str]], space: Space, path: Path) -> tuple[list[Floats], list[str]]:
    points, problems = [], []
    for number, row in enumerate(rows, start=2):
        try:
            point = space.point({name: row[name] for name in space.names})
            if not np.isfinite(point).all():
                raise RsmkitError("a factor is not a finite number")
            points.append(point)
        except RsmkitError as error:
            problems.append(f"{path.name} line {number}: {error}")
    return points, problems


def _results(row: dict[str, str], space: Space, responses: Sequence[str]) -> dict[str, Any]:
    """Everything in a row that came back from the laboratory, numbers as numbers, empty cells left out."""
    skipped = {*space.names, *_OWN_COLUMNS, ""}
    return {name: _number(cell) for name, cell in row.items() if name not in skipped and cell}


def _number(cell: str) -> float | str:
    try:
        return float(cell)
    except ValueError:
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
