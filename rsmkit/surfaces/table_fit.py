"""Finished experiments: surfaces from a CSV file of factors and responses, without a study or a simulator."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from rsmkit.errors import FitError, RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.io.csv_tables import Table, read_table
from rsmkit.language.space import Factor, Floats, Space, Value
from rsmkit.language.terms import Terms, full_terms, parse_terms
from rsmkit.surfaces.coding import holds_coded_values
from rsmkit.surfaces.estimation.coordinates import bounds
from rsmkit.surfaces.estimation.kenward_roger import DfMethod
from rsmkit.surfaces.estimation.robust_regression import RobustMethod
from rsmkit.surfaces.fitted_response import FittedResponse
from rsmkit.surfaces.models.polynomial import PolynomialSurface
from rsmkit.surfaces.polynomial_fit import fit_surface
from rsmkit.surfaces.statistics.questions import Questions, answer_words, answers
from rsmkit.surfaces.statistics.ridge import Goal, optimum_in_box

__all__ = ["TableFit", "fit_table"]

MISSING = ("", "na", "nan", "n/a", "#n/a", "null", "none", ".", "*")
EXTREME = 1e70
"""Products of a few numbers up to this size, or down to its reciprocal, can be computed."""
SMALLER = (("SO",), ("FO", "TWI"), ("FO",), ("0", "FO", "TWI"), ("0", "FO"))
"""Models to offer when a larger one cannot be estimated; the last two for mixtures."""
MOST_CATEGORIES = 200
"""Combinations of categories of which each is searched for the optimum."""


@dataclass(frozen=True)
class TableFit:
    """Surfaces of the responses of one table.

    Parameters
    ----------
    source : str
        The file.
    space : Space
        Its factors; one coded unit is what the coding says, or one unit of the column without a coding.
    surfaces : dict of str to FittedResponse
    left_out : dict of str to int
        Rows that lack a value or weigh nothing, per response.
    coded : frozenset of str
        Factors with a coding.
    held_coded_values : bool
        Whether the columns of those factors held coded values.
    asked : Questions
        What the report adds for each response.
    rows : dict of str to tuple of int
        Row of each run, counted from 1 below the line of names, per response.
    """

    source: str
    space: Space
    surfaces: dict[str, FittedResponse[PolynomialSurface]]
    left_out: dict[str, int]
    coded: frozenset[str] = frozenset()
    held_coded_values: bool = False
    asked: Questions = Questions()
    rows: dict[str, tuple[int, ...]] = field(default_factory=dict)

    def report(self) -> dict[str, Any]:
        """All statistics as JSON values: what ``rsmkit fit --data FILE --json`` prints."""
        return {
            "data": self.source,
            "factors": list(self.space.names),
            "columns_hold": "coded values" if self.held_coded_values else "natural values",
            "responses": {
                name: {
                    **surface.report(),
                    **self.answers[name],
                    "optimum": self.optimum(name),
                    "rows": self._rows(name),
                    "rows_without_value": self.left_out[name],
                }
                for name, surface in self.surfaces.items()
            },
        }

    def optimum(self, response: str) -> dict[str, Any]:
        """Highest and lowest point of a surface between bounds, as JSON values.

        The bounds of a factor are those of its coding, or the ends of its runs where it has none.
        """
        surface = self.surfaces[response].surface
        categories = math.prod(len(f.levels) for f in self.space if f.levels)
        if categories > MOST_CATEGORIES:
            return {"reason": f"there are {categories} combinations of categories, too many to search"}
        ends = zip(self.space, surface.coordinates.low, surface.coordinates.high, strict=True)
        within = Space(
            f if f.name in self.coded or not f.domain.is_numeric else replace(f, low=low, high=high)
            for f, low, high in ends
        )
        found: dict[str, Any] = {
            "bounds": {f.name: list(f.levels) if f.levels else [f.low, f.high] for f in within}
        }
        goals: dict[str, Goal] = {"maximum": "maximize", "minimum": "minimize"}
        for name, goal in goals.items():
            point, value = optimum_in_box(surface, goal, within=within)
            found[name] = {"natural": self.space.values(point), "predicted": value}
        return found

    @cached_property
    def answers(self) -> dict[str, dict[str, Any]]:
        """What the report holds beyond that of each surface: influence, and what was asked."""
        return {
            name: answers(fitted.surface, self.asked, self._rows(name))
            for name, fitted in self.surfaces.items()
        }

    def _rows(self, response: str) -> list[int] | None:
        return list(self.rows.get(response, ())) or None

    def summary(self) -> str:
        """All statistics as text."""
        parts = []
        for response, surface in self.surfaces.items():
            best, missing = self.optimum(response), self.left_out[response]
            lines = [
                f"{goal.capitalize()} between the bounds: {_words(best[goal]['natural'])}; "
                f"predicted {best[goal]['predicted']:.5g}"
                for goal in ("maximum", "minimum")
                if goal in best
            ]
            if missing:
                lines.append(f"Rows left out because they lack a value or weigh nothing: {missing}")
            found, rows = self.answers[response], self._rows(response)
            answered = answer_words(surface.surface, found, rows)
            parts.append("\n".join([surface.summary(), *answered, "", *lines]))
        if self.held_coded_values:
            parts.insert(0, f"The columns {', '.join(sorted(self.coded))} hold coded values.")
        return "\n\n\n".join(parts)


@checked
def fit_table(
    path: str | Path,
    factors: Sequence[str],
    responses: Sequence[str],
    *,
    coding: Mapping[str, tuple[float, float]] | None = None,
    blocks: str | None = None,
    weights: str | None = None,
    random: Sequence[str] = (),
    degrees: DfMethod = "kenward-roger",
    order: int = 2,
    terms: Sequence[str] = (),
    means: Sequence[str] = (),
    compare: Sequence[str] = (),
    near_replicates: float | None = None,
    robust: RobustMethod | None = None,
    exclude: Sequence[int] = (),
) -> TableFit:
    """Fit one surface per response of a table of finished runs.

    Repeated rows are real replicates here and every one counts.

    Parameters
    ----------
    path : path
        CSV file with a header; comma, semicolon, tab or blanks between values; lines that start with ``#``
        are comments. With another separator than the comma, decimals may have a comma.
    factors, responses : sequence of str
        Column names. A factor column of texts is categorical. Rows that lack the response or another value
        in use (empty, NA, nan, null, ``.``, ``*``; in a column of texts only empty and NA) are left out.
    coding : mapping of str to (center, half range), optional
        Coded units of a factor: ``(x - center) / half_range``. Columns that already hold coded values are
        recognised (:func:`rsmkit.surfaces.coding.holds_coded_values`). Without a coding a column is used as
        it is.
    blocks, weights : str, optional
        Column with the block of each run, and with weights inversely proportional to its variance; rows of
        weight zero are left out.
    random : sequence of str, optional
        Columns with the groups of each run that are a sample of all groups: plots of hard-to-change factors,
        days. Their variances are estimated by restricted maximum likelihood.
    degrees : {"kenward-roger", "satterthwaite"}
        With `random`, how degrees of freedom are found.
    order : int
        Degree of the surface.
    terms : sequence of str, optional
        Instead of all terms of that order: groups and single terms, see
        :func:`rsmkit.language.terms.parse_terms`.
    means : sequence of str, optional
        Factors whose levels' means are estimated and compared, see :func:`estimated_means`.
    compare : sequence of str, optional
        Contrasts of such means: ``tool: A=1, B=-0.5, C=-0.5``.
    near_replicates : float, optional
        Share of the range of each number within which runs count as repeated, for a second test of lack of
        fit.
    robust : {"huber", "mm"}, optional
        Robust estimates beside those of least squares, see :func:`robust_estimates`.
    exclude : sequence of int, optional
        Rows to leave out, counted from 1 below the line of names.

    Raises
    ------
    RsmkitError
        For a file that cannot be read, unknown columns, values that are not numbers, with the row.
    FitError
        For terms that cannot be estimated.
    """
    others = [name for name in (blocks, weights, *random) if name]
    codes = dict(coding or {})
    _check_names(factors, responses, others, codes)
    table = _read(Path(path), [*factors, *responses, *others])
    count, places = len(table), {line: i + 1 for i, line in enumerate(table.lines)}
    table = without_rows(table, exclude)
    table = _usable(table, path, factors, responses, [*random, *filter(None, [blocks])], weights)
    space, points, held = _factors(table, factors, codes)
    model = parse_terms(space, terms) if terms else full_terms(space, order)
    surfaces, left_out, numbers = {}, {}, {}
    for name in responses:
        kept = table.rows(_given(table, name))
        left_out[name] = count - len(kept) - len(set(exclude))
        numbers[name] = tuple(places[line] for line in kept.lines)
        surfaces[name] = _fit(
            space,
            points[_given(table, name)],
            _numbers(kept, name),
            model,
            response=name,
            weights=_weights(kept, weights) if weights else None,
            blocks=_labels(kept, blocks) if blocks else None,
            random={column: _labels(kept, column) for column in random},
            degrees=degrees,
        )
    asked = Questions(tuple(means), tuple(compare), near_replicates, robust)
    return TableFit(str(path), space, surfaces, left_out, frozenset(codes), held, asked, numbers)


def _check_names(
    factors: Sequence[str], responses: Sequence[str], others: Sequence[str], codes: Mapping[str, object]
) -> None:
    """Refuse columns that are asked for in a way that means nothing."""
    if not factors or not responses:
        raise RsmkitError("name at least one factor column and one response column")
    columns = [*factors, *responses, *others]
    for name in columns:
        if columns.count(name) > 1:
            raise RsmkitError(
                f"column {name} is named twice among factors, responses, blocks, weights and random groups"
            )
    unknown = [name for name in codes if name not in factors]
    if unknown:
        raise RsmkitError(
            f"the coding names {', '.join(unknown)}, not one of the factors {', '.join(factors)}"
        )


def _usable(
    table: Table,
    path: str | Path,
    factors: Sequence[str],
    responses: Sequence[str],
    groups: Sequence[str],
    weights: str | None,
) -> Table:
    """Rows with a response and all else that is in use, and a weight above zero."""
    table = table.rows(_where(any, table, responses))
    table = table.rows(_where(all, table, (*factors, *groups, *filter(None, [weights]))))
    if weights:
        table = table.rows((_weights(table, weights) > 0).tolist())
    for name in responses:
        if not any(_given(table, name)):
            needed = ", ".join([name, *factors, *groups])
            weighing = " and a weight above zero" if weights else ""
            raise RsmkitError(f"{path}: no row has a value of {needed}{weighing}")
    return table


def _factors(
    table: Table, factors: Sequence[str], codes: Mapping[str, tuple[float, float]]
) -> tuple[Space, Floats, bool]:
    """The space, the points in natural units, shape (n, k), and whether the columns held coded values."""
    found = {name: _column(table, name) for name in factors}
    for name in codes:
        if found[name][0]:
            raise RsmkitError(f"column {name} holds texts, so it has no coding")
    held = holds_coded_values({name: values for name, (_, values) in found.items()}, codes)
    space = Space(
        Factor(name, levels=levels) if levels else _coded_factor(name, *codes.get(name, (0.0, 1.0)))
        for name, (levels, _) in found.items()
    )
    points = np.column_stack([values for _, values in found.values()])
    return space, bounds(space).backward(points) if held else points, held


def _read(path: Path, wanted: Sequence[str]) -> Table:
    table = read_table(path, wanted)
    if not len(table):
        raise RsmkitError(f"{path}: needs a line of column names and at least one run")
    return table


def without_rows(table: Table, exclude: Sequence[int]) -> Table:
    """Leave rows out by their number, from 1 below the line of names.

    Raises
    ------
    RsmkitError
        For a number that no row has.
    """
    wrong = [row for row in exclude if not 1 <= row <= len(table)]
    if wrong:
        raise RsmkitError(
            f"{table.source}: has no row {wrong[0]} to exclude; its rows are 1 to {len(table)}, counted "
            "below the line of names"
        )
    left_out = set(exclude)
    return table.rows([i + 1 not in left_out for i in range(len(table))])


def _given(table: Table, name: str) -> list[bool]:
    """Whether there is a value in each row of a column; other words than NA may be categories."""
    texts = table.texts(name)
    if any(table.number(text) is not None for text in texts):
        return [text.lower() not in MISSING for text in texts]
    return [text not in ("", "NA") for text in texts]


def _where(some: Callable[[Iterable[bool]], bool], table: Table, names: Sequence[str]) -> list[bool]:
    """Rows in which any, or all, of the columns have a value."""
    return [some(row) for row in zip(*(_given(table, name) for name in names), strict=True)]


def _numbers(table: Table, name: str) -> Floats:
    """One column as numbers."""
    values = []
    for line, text in zip(table.lines, table.texts(name), strict=True):
        value = table.number(text)
        if value is None:
            raise RsmkitError(f"column {name}, line {line}: '{text}' is not a finite number")
        if value and not 1 / EXTREME < abs(value) < EXTREME:
            size, unit = ("large", "larger") if abs(value) > 1 else ("small", "smaller")
            raise RsmkitError(
                f"column {name}, line {line}: {text} is too {size} to be squared; take a {unit} unit"
            )
        values.append(value)
    return np.array(values)


def _labels(table: Table, name: str) -> list[str]:
    """One column as texts; 1, 1.0 and 01 are the same."""
    numbers = [table.number(text) for text in table.texts(name)]
    if any(number is None for number in numbers):
        return list(table.texts(name))
    return [format(number, ".15g") for number in numbers]


def _words(values: Mapping[str, Value]) -> str:
    texts = (f"{x:.5g}" if isinstance(x, float) else str(x) for x in values.values())
    return ", ".join(f"{name} = {text}" for name, text in zip(values, texts, strict=True))


def _weights(table: Table, name: str) -> Floats:
    """Weights, of which some may be zero."""
    values = _numbers(table, name)
    for line, value in zip(table.lines, values.tolist(), strict=True):
        if value < 0:
            raise RsmkitError(f"column {name}, line {line}: a weight of {value:g} is negative")
    return values


def _fit(
    space: Space, points: Floats, y: Floats, terms: Terms, **request: Any
) -> FittedResponse[PolynomialSurface]:
    """Fit given terms; if these runs cannot estimate them, say which smaller model they can."""
    try:
        return fit_surface(space, points, y, terms=terms, deterministic=False, **request)
    except FitError as error:
        for words in SMALLER if np.ptp(points, axis=0).all() else SMALLER[:3]:
            fewer = parse_terms(space, words)
            if set(fewer.exponents) < set(terms.exponents):
                try:
                    fit_surface(space, points, y, terms=fewer, deterministic=False, **request)
                except FitError:
                    continue
                raise FitError(f"{error}; these runs can estimate --terms {','.join(words)}") from None
        raise


def _column(table: Table, name: str) -> tuple[tuple[str, ...], Floats]:
    """Levels of a column of texts (none for numbers), and its values; for texts the index of the level."""
    texts = table.texts(name)
    if any(table.number(text) is not None for text in texts):
        return (), _numbers(table, name)
    levels = tuple(sorted(set(texts)))
    if len(levels) < 2:
        raise RsmkitError(f"column {name} holds '{levels[0]}' only: it is no factor of these runs")
    return levels, np.array([levels.index(text) for text in texts], float)


def _coded_factor(name: str, center: float, half: float) -> Factor:
    return Factor(name, center - half, center + half)
