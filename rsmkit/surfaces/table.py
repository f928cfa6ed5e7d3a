"""Finished experiments: surfaces from a CSV file of factors and responses, without a study or a simulator."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np

from rsmkit.errors import RsmkitError
from rsmkit.space import Factor, Floats, Space
from rsmkit.surfaces.fit import fit_surface
from rsmkit.surfaces.polynomial import PolynomialSurface
from rsmkit.terms import full_terms, parse_terms

__all__ = ["TableFit", "fit_table", "parse_coding"]

MISSING = ("", "na", "nan", "n/a", "null", "none")
CODED_REACH = 3.0
"""Largest size of a coded value in a design; used to see whether a column holds coded values already."""


@dataclass(frozen=True)
class TableFit:
    """Surfaces of the responses of one table.

    Parameters
    ----------
    source : str
        The file.
    space : Space
        Its factors; one coded unit is what the coding says, or one unit of the column without a coding.
    surfaces : dict of str to PolynomialSurface
    left_out : dict of str to int
        Rows without a value, per response.
    """

    source: str
    space: Space
    surfaces: dict[str, PolynomialSurface]
    left_out: dict[str, int]

    def report(self) -> dict[str, Any]:
        """All statistics as JSON values: what ``rsmkit fit --data FILE --json`` prints."""
        return {
            "data": self.source,
            "factors": list(self.space.names),
            "responses": {
                name: {**surface.report(), "rows_without_value": self.left_out[name]}
                for name, surface in self.surfaces.items()
            },
        }

    def summary(self) -> str:
        """All statistics as text."""
        return "\n\n\n".join(surface.summary() for surface in self.surfaces.values())


def fit_table(
    path: str | Path,
    factors: Sequence[str],
    responses: Sequence[str],
    *,
    coding: Mapping[str, tuple[float, float]] | None = None,
    blocks: str | None = None,
    weights: str | None = None,
    order: int = 2,
    terms: Sequence[str] = (),
) -> TableFit:
    """Fit one surface per response of a table of finished runs.

    Repeated rows are real replicates here and every one counts.

    Parameters
    ----------
    path : path
        CSV file with a header; comma, semicolon or tab between values.
    factors, responses : sequence of str
        Column names. A factor column of texts is categorical; characters that a name cannot have become
        ``_``. Rows whose response is empty or NA are left out.
    coding : mapping of str to (center, half range), optional
        Coded units of a factor: ``(x - center) / half_range``. A column that already holds coded values is
        recognised when, read as natural values, none of it would lie within three coded units. Without a
        coding the column is used as it is.
    blocks, weights : str, optional
        Column with the block of each run, and with weights inversely proportional to its variance.
    order : int
        Degree of the surface.
    terms : sequence of str, optional
        Instead of all terms of that order: groups and single terms, see :func:`rsmkit.terms.parse_terms`.

    Raises
    ------
    RsmkitError
        For a file that cannot be read, unknown columns, values that are not numbers, with the row.
    FitError
        For terms that cannot be estimated.
    """
    columns = _read(Path(path))
    _check_names(columns, [*factors, *responses, *filter(None, (blocks, weights))], Path(path))
    if not factors or not responses:
        raise RsmkitError("name at least one factor column and one response column")
    if len(set(factors)) != len(factors):
        raise RsmkitError(f"a factor is named twice in {', '.join(factors)}")
    unknown = [name for name in coding or {} if name not in factors]
    if unknown:
        raise RsmkitError(
            f"the coding names {', '.join(unknown)}, not one of the factors {', '.join(factors)}"
        )
    pairs = [_factor(name, columns[name], (coding or {}).get(name)) for name in factors]
    space = Space(factor for factor, _ in pairs)
    points = np.column_stack([values for _, values in pairs])
    model = parse_terms(space, terms) if terms else full_terms(space, order)
    surfaces, left_out = {}, {}
    for name in responses:
        y = _numbers(name, columns[name], missing=True)
        keep = ~np.isnan(y)
        left_out[name] = int((~keep).sum())
        labels = columns[blocks] if blocks else []
        surfaces[name] = fit_surface(
            space,
            points[keep],
            y[keep],
            response=name,
            terms=model,
            weights=_numbers(weights, columns[weights])[keep] if weights else None,
            blocks=[label for label, kept in zip(labels, keep, strict=True) if kept] if blocks else None,
            deterministic=False,
        )
    return TableFit(str(path), space, surfaces, left_out)


def parse_coding(text: str) -> dict[str, tuple[float, float]]:
    """Read ``x1=85:5,x2=175:5``: center and half range of each factor.

    Raises
    ------
    RsmkitError
        With the part that does not read so.
    """
    coding = {}
    for part in filter(None, (p.strip() for p in text.split(","))):
        name, _, numbers = part.partition("=")
        center, _, half = numbers.partition(":")
        try:
            pair = (float(center), float(half))
        except ValueError:
            raise RsmkitError(
                f"coding '{part}': write it as factor=center:half_range, e.g. x1=85:5"
            ) from None
        if not (math.isfinite(pair[0]) and math.isfinite(pair[1]) and pair[1] > 0):
            raise RsmkitError(f"coding '{part}': the half range must be a positive number")
        coding[name.strip()] = pair
    return coding


def _read(path: Path) -> dict[str, list[str]]:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise RsmkitError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise RsmkitError(f"{path}: is not UTF-8 text; save it as CSV in UTF-8") from None
    head = text.partition("\n")[0]
    delimiter = max(",;\t", key=head.count)
    try:
        rows = [
            row for row in csv.reader(text.splitlines(), delimiter=delimiter) if any(c.strip() for c in row)
        ]
    except csv.Error as error:
        raise RsmkitError(f"{path}: is not a CSV file: {error}") from None
    if len(rows) < 2:
        raise RsmkitError(f"{path}: needs a line of column names and at least one run")
    names = [name.strip() for name in rows[0]]
    if len(set(names)) != len(names):
        raise RsmkitError(f"{path}: two columns have the same name in {', '.join(names)}")
    for number, row in enumerate(rows[1:], 2):
        if len(row) != len(names):
            raise RsmkitError(f"{path}: row {number} has {len(row)} values for {len(names)} columns")
    return {name: [row[i].strip() for row in rows[1:]] for i, name in enumerate(names)}


def _check_names(columns: Mapping[str, list[str]], wanted: Sequence[str], path: Path) -> None:
    for name in wanted:
        if name not in columns:
            close = get_close_matches(name, columns, n=1)
            hint = f"did you mean {close[0]}?" if close else f"its columns are {', '.join(columns)}"
            raise RsmkitError(f"{path}: has no column {name}; {hint}")


def _factor(name: str, texts: list[str], coding: tuple[float, float] | None) -> tuple[Factor, Floats]:
    """Make the factor of one column, and its natural values."""
    label, name = name, re.sub(r"\W|^(?=\d)", "_", name)
    if not any(_is_number(text) for text in texts):
        if coding:
            raise RsmkitError(f"column {name} holds texts, so it has no coding")
        levels = tuple(sorted(set(texts)))
        return Factor(name, label=label, levels=levels), np.array(
            [levels.index(text) for text in texts], float
        )
    values = _numbers(name, texts)
    if coding is None:
        return Factor(name, -1.0, 1.0, label), values
    center, half = coding
    if np.abs(values).max() <= CODED_REACH and np.abs(values - center).min() > CODED_REACH * half:
        values = center + half * values
    return Factor(name, center - half, center + half, label), values


def _numbers(name: str, texts: list[str], *, missing: bool = False) -> Floats:
    values = []
    for row, text in enumerate(texts, 2):
        if missing and text.lower() in MISSING:
            values.append(math.nan)
            continue
        if not _is_number(text):
            raise RsmkitError(f"column {name}, row {row}: '{text}' is not a finite number")
        values.append(float(text))
    return np.array(values)


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False
