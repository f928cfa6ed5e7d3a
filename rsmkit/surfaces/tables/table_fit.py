"""Finished experiments: surfaces from a file of factors and responses, without a study or a simulator."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from rsmkit.errors import FitError, RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.io.tables.csv_tables import Table, read_table
from rsmkit.language.scheffe import Process
from rsmkit.language.space import Factor, Floats, Space, Value
from rsmkit.language.terms import Contrasts, full_terms, parse_terms
from rsmkit.surfaces.estimation.coordinates import bounds, hull
from rsmkit.surfaces.estimation.counts.scoring import DistributionName
from rsmkit.surfaces.estimation.mixed.kenward_roger import DfMethod
from rsmkit.surfaces.estimation.robust_regression import RobustMethod
from rsmkit.surfaces.fitted_response import FittedResponse
from rsmkit.surfaces.kinds import form_of
from rsmkit.surfaces.models.polynomial import PolynomialSurface
from rsmkit.surfaces.models.reduction.term_chooser import Method
from rsmkit.surfaces.statistics.mixtures.best_blend import best_blend
from rsmkit.surfaces.statistics.optima.ridge import Goal, optimum_in_box
from rsmkit.surfaces.statistics.reports.report_words import wrapped
from rsmkit.surfaces.statistics.terms.questions import Questions, answer_words, answers
from rsmkit.surfaces.tables.coding import ColumnUnits, Reading, read_columns
from rsmkit.surfaces.tables.table_columns import (
    Columns,
    category_column,
    is_numeric,
    numbers,
    outcomes,
    run_weights,
    sort_out,
    texts_of,
    without_rows,
)
from rsmkit.surfaces.tables.table_counts import check_counts, counted
from rsmkit.surfaces.tables.table_mixture import (
    MixtureAsked,
    mixture_space,
    mixture_terms,
    sum_note,
    unused_note,
)
from rsmkit.surfaces.tables.table_terms import fit_terms, reduced

__all__ = ["TableFit", "fit_table"]

MOST_CATEGORIES = 200
"""Combinations of categories of which each is searched for the optimum."""
MOST_ROWS = 10
"""Rows left out that a short text names."""


@dataclass(frozen=True)
class TableFit:
    """Surfaces of the responses of one table.

    Parameters
    ----------
    source : str
        The file.
    space : Space
        Its factors; one coded unit is half the range of the column, unless a coding or the values of the
        columns say otherwise.
    surfaces : dict of str to FittedResponse
    left_out : dict of str to int
        Rows that lack a value or weigh nothing, per response.
    coded : frozenset of str
        Factors with a coding that was given.
    held_coded_values : bool
        Whether the columns held coded values.
    rows : dict of str to tuple of int
        Row of each run, counted from 1 below the line of names, per response.
    reasons : dict of str to dict of int to str
        Per response, each row left out, counted likewise, and why.
    notes : tuple of str
        What was assumed because nothing said it.
    asked : Questions
        What the report adds for each response.
    not_fitted : dict of str to str
        Responses that have no surface, and why: they do not stop the others.
    """

    source: str
    space: Space
    surfaces: dict[str, FittedResponse[PolynomialSurface]]
    left_out: dict[str, int]
    coded: frozenset[str] = frozenset()
    held_coded_values: bool = False
    asked: Questions = Questions()
    rows: dict[str, tuple[int, ...]] = field(default_factory=dict)
    reasons: dict[str, dict[int, str]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    not_fitted: dict[str, str] = field(default_factory=dict)

    def report(self) -> dict[str, Any]:
        """All statistics as JSON values: what ``rsmkit fit --data FILE --json`` prints."""
        return {
            "data": self.source,
            "factors": list(self.space.names),
            "columns_hold": "coded values" if self.held_coded_values else "natural values",
            "notes": list(self.notes),
            "not_fitted": self.not_fitted,
            "responses": {
                name: {
                    **surface.report(),
                    **self.answers[name],
                    "optimum": self.optimum(name),
                    "rows": self._rows(name),
                    "rows_without_value": self.left_out[name],
                    "rows_left_out": [
                        {"row": row, "reason": reason} for row, reason in self.reasons.get(name, {}).items()
                    ],
                }
                for name, surface in self.surfaces.items()
            },
        }

    def optimum(self, response: str) -> dict[str, Any]:
        """Highest and lowest point of a surface between bounds, as JSON values; of a mixture the best blend.

        The bounds of a factor are those of the coding given for it, or the ends of its runs where there is
        none.
        """
        return self._optima[response]

    @cached_property
    def _optima(self) -> dict[str, dict[str, Any]]:
        return {name: self._optimum(fitted.surface) for name, fitted in self.surfaces.items()}

    def _optimum(self, surface: PolynomialSurface) -> dict[str, Any]:
        categories = math.prod(len(f.levels) for f in self.space if f.levels)
        if categories > MOST_CATEGORIES:
            return {"reason": f"there are {categories} combinations of categories, too many to search"}
        runs = hull(self.space, surface.data.points)
        within = self.space.with_factors(
            f if f.name in self.coded or not f.domain.is_numeric else replace(f, low=low, high=high)
            for f, low, high in zip(self.space, runs.low, runs.high, strict=True)
        )
        found: dict[str, Any] = {
            "bounds": {f.name: list(f.levels) if f.levels else [f.low, f.high] for f in within}
        }
        goals: dict[str, Goal] = {"maximum": "maximize", "minimum": "minimize"}
        for name, goal in goals.items():
            search = best_blend if within.mixtures else optimum_in_box
            point, value = search(surface, goal, within=within)
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

    def summary(self, *, details: bool = False) -> str:
        """All statistics as text.

        Parameters
        ----------
        details : bool
            Whether nothing is left out where there are many terms, factors or rows.
        """
        parts = [f"Note: {note}." for note in self.notes]
        parts = ["\n".join(line for part in parts for line in wrapped(part))] if parts else []
        for response, fitted in self.surfaces.items():
            report = {**fitted.report(), "details": details}
            lines = [form_of(fitted.surface).summary(fitted.surface, report)]
            lines += [*answer_words(fitted.surface, self.answers[response], self._rows(response)), ""]
            best = self.optimum(response)
            found = [
                f"{goal.capitalize()} between the bounds: {_words(best[goal]['natural'])}; "
                f"predicted {best[goal]['predicted']:.5g}"
                for goal in ("maximum", "minimum")
                if goal in best
            ]
            if self.left_out[response]:
                found.append(self._left_out_words(response, details=details))
            parts.append("\n".join([*lines, *(part for line in found for part in wrapped(line, lists=True))]))
        return "\n\n\n".join(parts)

    def _repr_html_(self) -> str:
        return "".join(f"<h4>{escape(name)}</h4>{each._repr_html_()}" for name, each in self.surfaces.items())

    def _left_out_words(self, response: str, *, details: bool) -> str:
        """Name the rows that were not used, and why."""
        named = [f"{row} ({reason})" for row, reason in self.reasons[response].items()]
        shown = named if details else named[:MOST_ROWS]
        more = [f"and {len(named) - len(shown)} more"] if len(shown) < len(named) else []
        return f"Rows left out, counted from 1 below the line of names: {', '.join([*shown, *more])}"


@checked
def fit_table(
    path: str | Path,
    factors: Sequence[str],
    responses: Sequence[str],
    *,
    coding: Mapping[str, tuple[float, float]] | None = None,
    columns: ColumnUnits | None = None,
    mixture: Sequence[str] = (),
    model: str | None = None,
    process: Process = "combined",
    categorical: Sequence[str] = (),
    contrasts: Contrasts = "treatment",
    blocks: str | None = None,
    weights: str | None = None,
    random: Sequence[str] = (),
    degrees: DfMethod = "kenward-roger",
    distribution: DistributionName | None = None,
    trials: str | None = None,
    exposure: str | None = None,
    bias_reduced: bool = False,
    order: int = 2,
    terms: Sequence[str] = (),
    means: Sequence[str] = (),
    compare: Sequence[str] = (),
    near_replicates: float | None = None,
    robust: RobustMethod | None = None,
    together: Sequence[str] = (),
    exclude: Sequence[int] = (),
    sheet: str | None = None,
    reduction: Method | None = None,
) -> TableFit:
    """Fit one surface per response of a table of finished runs.

    Repeated rows are real replicates here and every one counts. Numeric factors are coded, natural units are
    reported beside: see :class:`TableFit` and :func:`rsmkit.surfaces.tables.coding.read_columns`.

    Parameters
    ----------
    path : path
        Workbook (.xlsx), or CSV file with a header; comma, semicolon, tab or blanks between values; lines
        that start with ``#`` are comments. With another separator than the comma, decimals may have a comma.
    factors, responses : sequence of str
        Column names. A factor column of texts is categorical. Rows that lack the response or another value
        in use (empty, NA, nan, null, ``.``, ``*``; in a column of texts only empty and NA) are left out.
    coding : mapping of str to (center, half range), optional
        Coded units of a factor: ``(x - center) / half_range``. Without one a numeric factor is coded by its
        range; not in a model without a constant, which a shift of the origin would change.
    columns : {"natural", "coded"}, optional
        What numeric factor columns hold. If nothing says it, columns that all look coded do where there is no
        coding, or where natural values would contradict it; a note says so.
    mixture : sequence of str, optional
        Columns with the amounts of the components of a mixture, which add up to the same total in every row.
        They are factors whether `factors` names them or not; its others are process factors.
    model : str, optional
        Of a mixture: ``scheffe-linear``, ``scheffe-quadratic``, ``scheffe-special-cubic``, ``scheffe-cubic``;
        that of the `order` by default.
    process : {"combined", "main", "crossed"}
        How process factors join it, see :func:`rsmkit.language.scheffe.scheffe_terms`.
    categorical : sequence of str, optional
        Factors whose numbers are names.
    contrasts : {"treatment", "sum"}
        Coefficients of a category: differences of the levels after the first from the first, ``tool[b]``, or
        of the levels before the last from the average, ``tool[a]``.
    blocks, weights : str, optional
        Column with the block of each run, and with weights inversely proportional to its variance; rows of
        weight zero are left out.
    random : sequence of str, optional
        Columns with the groups of each run that are a sample of all groups: plots of hard-to-change factors,
        days. Their variances are estimated by restricted maximum likelihood.
    degrees : {"kenward-roger", "kenward-roger-observed", "satterthwaite"}
        With `random`, how degrees of freedom are found.
    distribution : {"binomial", "poisson"}, optional
        Responses are counts: of successes among `trials` (one each when left out: 1 and 0, or yes and no), or
        of events over an `exposure` (area, time; one when left out). The surface is then a generalised linear
        model.
    trials, exposure : str, optional
        Columns that say how many trials a run had, or how much exposure.
    bias_reduced : bool
        Whether counts get the estimates of Firth's penalised likelihood, which are finite also where runs are
        separated.
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
    together : sequence of str, optional
        Terms, or groups of them, to test all at once, see :func:`extra_sum_of_squares`.
    exclude : sequence of int, optional
        Rows to leave out, counted from 1 below the line of names.
    sheet : str, optional
        Of a workbook; needed only where several sheets have the columns.
    reduction : {"aicc", "aic", "bic", "backward", "forward", "all"}, optional
        Leave terms out as :func:`rsmkit.surfaces.models.reduction.reduced.reduce_surface` does; a note
        says which.

    Raises
    ------
    RsmkitError
        For a file that cannot be read, unknown columns, values that are not numbers, with the row.
    FitError
        When no response can be fitted: terms that these runs cannot tell apart, separated yes and no.
    """
    blended, codes = MixtureAsked(tuple(mixture), model, process), dict(coding or {})
    chosen = Columns(
        blended.check(factors), tuple(responses), blocks, weights, tuple(random), trials or exposure
    )
    chosen.check()
    blended.refuse(codes, categorical, blocks)
    check_counts(distribution, trials, exposure, weights, random, bias_reduced=bias_reduced)
    _check_factors(chosen.factors, codes, categorical)
    table = _read(Path(path), chosen, sheet)
    places = {line: row for row, line in enumerate(table.lines, start=1)}
    table = without_rows(table, exclude)
    reasons = sort_out(table, chosen)
    usable = table.rows([any(line not in left for left in reasons.values()) for line in table.lines])
    shifted = "0" not in terms
    space, points, reading = _factors(
        usable, chosen.factors, codes, columns, categorical, shifted=shifted, components=blended.components
    )
    if blended.components:
        space, notes = mixture_space(usable, places, space, points, blended)
        model_terms, note = mixture_terms(space, points, blended, order, terms)
        notes += [note] + [unused_note(table, [*chosen.factors, *chosen.responses, *chosen.others])] * (
            not factors
        )
    else:
        model_terms = parse_terms(space, terms) if terms else full_terms(space, order)
        notes = [sum_note({f.name: x for f, x in zip(space, points.T, strict=True) if f.domain.is_numeric})]
    model_terms = model_terms.with_contrasts(contrasts)
    surfaces, rows = {}, {}
    not_fitted: dict[str, str] = {}
    read = outcomes if distribution == "binomial" and not trials else numbers
    for name in chosen.responses:
        given = [line not in reasons[name] for line in usable.lines]
        kept = usable.rows(given)
        rows[name] = tuple(places[line] for line in kept.lines)
        try:
            surfaces[name] = fit_terms(
                space,
                points[given],
                read(kept, name),
                model_terms,
                response=name,
                weights=run_weights(kept, weights) if weights else None,
                blocks=texts_of(kept, blocks) if blocks else None,
                random={column: texts_of(kept, column) for column in random},
                degrees=degrees,
            )
            if distribution:
                size = numbers(kept, chosen.size) if chosen.size else None
                surfaces[name] = counted(
                    surfaces[name].surface, distribution, size, rows[name], bias_reduced=bias_reduced
                )
            if reduction:
                surfaces[name], told = reduced(surfaces[name], reduction)
                notes.append(told)
        except FitError as error:
            surfaces.pop(name, None)
            not_fitted[name] = str(error)
    if not surfaces:
        raise FitError(not_fitted[chosen.responses[0]])
    notes += [f"not fitted: {reason}" for reason in not_fitted.values()]
    return TableFit(
        str(path),
        space,
        surfaces,
        {name: len(left) for name, left in reasons.items()},
        frozenset(codes),
        reading.hold == "coded",
        Questions(tuple(means), tuple(compare), near_replicates, robust, tuple(together)),
        rows,
        {name: {places[line]: reason for line, reason in left.items()} for name, left in reasons.items()},
        tuple(filter(None, [table.note, *reading.notes, *notes])),
        not_fitted,
    )


def _check_factors(factors: Sequence[str], codes: Mapping[str, object], categorical: Sequence[str]) -> None:
    """Refuse a coding, or categories, of what is no factor or cannot have them."""
    for what, named in (("coding names", codes), ("categorical factors include", categorical)):
        unknown = [name for name in named if name not in factors]
        if unknown:
            raise RsmkitError(f"the {what} {', '.join(unknown)}, not one of the factors {', '.join(factors)}")
    for name in categorical:
        if name in codes:
            raise RsmkitError(f"factor {name} is categorical, so it has no coding")


def _read(path: Path, columns: Columns, sheet: str | None) -> Table:
    table = read_table(path, [*columns.factors, *columns.responses, *columns.others], sheet=sheet)
    if not len(table):
        raise RsmkitError(f"{path}: needs a line of column names and at least one run")
    return table


def _factors(
    table: Table,
    factors: Sequence[str],
    codes: Mapping[str, tuple[float, float]],
    hold: ColumnUnits | None,
    categorical: Sequence[str],
    *,
    shifted: bool,
    components: Sequence[str] = (),
) -> tuple[Space, Floats, Reading]:
    """The space, the points in natural units, shape (n, k), and how the columns were read.

    Components of a mixture are amounts whatever the other columns hold.
    """
    numeric = {
        name: numbers(table, name) for name in factors if name not in categorical and is_numeric(table, name)
    }
    for name in codes:
        if name not in numeric:
            raise RsmkitError(f"column {name} holds texts, so it has no coding")
    for name in components:
        numeric[name] = numbers(table, name)  # in words where one is no number
    others = {name: values for name, values in numeric.items() if name not in components}
    reading = read_columns(others, codes, hold, shifted=shifted)
    found, values = [], []
    for name in factors:
        if name in components:
            found.append(Factor(name, *_span(numeric[name])))
            values.append(numeric[name])
        elif name in numeric:
            found.append(Factor(name, *reading.ends[name]))
            values.append(numeric[name])
        else:
            levels, indices = category_column(table, name)
            found.append(Factor(name, levels=levels))
            values.append(indices)
    space, points = Space(found), np.column_stack(values)
    if reading.hold == "coded":
        amounts = [j for j, name in enumerate(factors) if name in components]
        points, given = bounds(space).backward(points), points
        points[:, amounts] = given[:, amounts]
    return space, points, reading


def _span(values: Floats) -> tuple[float, float]:
    low, high = float(values.min()), float(values.max())
    return (low, high) if low < high else (low, low + 1.0)  # one that never varies is refused by name


def _words(values: Mapping[str, Value]) -> str:
    texts = (f"{x:.5g}" if isinstance(x, float) else str(x) for x in values.values())
    return ", ".join(f"{name} = {text}" for name, text in zip(values, texts, strict=True))
