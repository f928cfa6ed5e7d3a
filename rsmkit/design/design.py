"""The design table: which points to run and what each is for (``design.csv``)."""

from __future__ import annotations

import html
import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rsmkit.errors import RsmkitError
from rsmkit.io.tables.csv_tables import Table, free_name, parse_table, read_table, write_table
from rsmkit.language.space import Factor, Floats, Space

__all__ = ["Design", "Found", "classical"]

AGREE = 1e-6
"""Coded columns may differ by so much from what the natural ones say; people round them."""


@dataclass(frozen=True)
class Found:
    """How an optimal design was found, so that nobody has to take it on trust.

    Parameters
    ----------
    criterion : str
    value : float
        The criterion reached: log det of the information matrix (D), or the average (I), total (A) or largest
        (G) variance for unit error variance.
    starts : int
        Random starts made.
    hits : int
        Starts that ended at the best value; few hits mean that better designs may exist.
    unseen : float
        Estimated chance that one more start would end at a value that none has ended at.
    distance : float
        Smallest distance of an added point from any other that was asked for, coded.
    """

    criterion: str
    value: float
    starts: int
    hits: int
    unseen: float = 1.0
    distance: float = 0.0


@dataclass(frozen=True, eq=False, repr=False)
class Design:
    """Points to run, in order.

    Parameters
    ----------
    space : Space
    points : array, shape (n, k)
        Natural units; a categorical column holds level indices.
    kinds : tuple of str
        What each point is: ``factorial``, ``axial``, ``center``, ``edge``, ``augmented``, ``optimal``,
        ``space-filling``, ``given``.
    blocks : tuple of int
        Block number of each run from 1; empty when the design is not blocked.
    found : Found, optional
        For a searched design, how it was found. Not part of the file.
    block_ratio : float, optional
        Blocks are a sample of all blocks (whole plots, days) whose variance is so many times that of a run;
        fixed effects when left out. Not part of the file.
    """

    space: Space
    points: Floats
    kinds: tuple[str, ...]
    blocks: tuple[int, ...] = ()
    found: Found | None = field(default=None, compare=False)
    block_ratio: float | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        points = np.array(self.points, float)
        if points.ndim != 2 or points.shape[1] != len(self.space):
            raise RsmkitError(f"design: points must have shape (n, {len(self.space)}), got {points.shape}")
        if not np.isfinite(points).all():
            raise RsmkitError("design: every coordinate must be a finite number")
        if len(self.kinds) != len(points) or (self.blocks and len(self.blocks) != len(points)):
            raise RsmkitError(f"design: {len(points)} points need as many kinds (and blocks)")
        points.flags.writeable = False
        object.__setattr__(self, "points", points)

    def __len__(self) -> int:
        return len(self.points)

    @property
    def coded(self) -> Floats:
        """The points in coded units, shape (n, k)."""
        return self.space.encode(self.points)

    @property
    def distinct(self) -> int:
        """Number of different points: what a deterministic simulator has to run."""
        return len(np.unique(self.points, axis=0))

    @property
    def covariance(self) -> Floats | None:
        """Covariance of the runs over the variance of one, where blocks are a sample; shape (n, n)."""
        if self.block_ratio is None or not self.blocks:
            return None
        same = np.equal.outer(self.blocks, self.blocks)
        return np.asarray(np.eye(len(self)) + self.block_ratio * same)

    def select(self, rows: NDArray[Any] | list[int]) -> Design:
        """The given rows (indices or mask) as a design of their own."""
        index = np.arange(len(self))[np.asarray(rows) if len(rows) else slice(0)]
        return replace(
            self,
            points=self.points[index],
            kinds=tuple(self.kinds[i] for i in index),
            blocks=tuple(self.blocks[i] for i in index) if self.blocks else (),
            found=None,
        )

    def to_csv(self, path: Path | str) -> None:
        """Write the table in one step: run, kind, (block,) natural columns, coded columns.

        Numbers are written so that :meth:`from_csv` gives back exactly the same floats.
        """
        rows: list[list[object]] = [list(_head(self.space, blocked=bool(self.blocks)))]
        for i, (natural, coded) in enumerate(zip(self.points, self.coded, strict=True)):
            block = [self.blocks[i]] if self.blocks else []
            cells = [factor.domain.cell(x) for factor, x in zip(self.space, natural, strict=True)]
            rows.append([i + 1, self.kinds[i], *block, *cells, *map(_number, coded)])
        write_table(Path(path), rows)

    @classmethod
    def from_csv(cls, path: Path | str, space: Space) -> Design:
        """Read a table: one of ours, or any CSV with a column per factor (natural units).

        Columns ``kind`` and ``block`` are optional; coded columns, when present, must agree with the natural
        ones, which catches a table that was made for other bounds.

        Raises
        ------
        RsmkitError
            Naming file, line and column of what is wrong.
        """
        return _design(read_table(Path(path), space.names), space)

    @classmethod
    def from_text(cls, text: str, path: Path | str, space: Space) -> Design:
        """Read a table whose text has been read already; `path` is named in messages."""
        return _as_we_write(text, space) or _design(parse_table(text, str(path), space.names), space)

    def __repr__(self) -> str:
        kinds = ", ".join(f"{self.kinds.count(kind)} {kind}" for kind in dict.fromkeys(self.kinds))
        repeats = len(self) - self.distinct
        return (
            f"<Design: {len(self)} runs ({kinds}){f', {repeats} of them repeat others' if repeats else ''}>"
        )

    def _repr_html_(self) -> str:
        heads = ["run", "kind", *(factor.title for factor in self.space)]
        lines = ["<tr>" + "".join(f"<th>{html.escape(head)}</th>" for head in heads) + "</tr>"]
        for i, natural in enumerate(self.points):
            values = [factor.value(float(x)) for factor, x in zip(self.space, natural, strict=True)]
            shown = [v if isinstance(v, str) else f"{v:.6g}" for v in values]
            cells = [str(i + 1), self.kinds[i], *shown]
            lines.append("<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in cells) + "</tr>")
        caption = html.escape(repr(self)[len("<Design: ") : -1])
        return f"<table><caption>{caption}</caption>{''.join(lines)}</table>"


def classical(
    space: Space, coded: Floats, kinds: list[str], what: str, *, categorical: bool = False
) -> Design:
    """Make a design from coded points; integer and discrete factors go to the nearest value they can take.

    Unless `categorical` says that the points have a column for every factor, they are for the numeric ones
    only, and the design is run at every combination of the categorical ones' levels.
    """
    if space.equalities:
        raise RsmkitError(
            f"{what} varies every factor on its own and cannot keep '{space.equalities[0].text}'; take "
            "rk.simplex_lattice, rk.extreme_vertices or rk.optimal_design"
        )
    if not categorical and not space.numeric.all():
        if not space.numeric.any():
            raise RsmkitError(
                f"{what} is for numeric factors; there is none: use a factorial or optimal design"
            )
        levels = [range(f.domain.categories) for f in space if not f.domain.is_numeric]
        whole = [np.empty((len(coded), len(space))) for _ in product(*levels)]
        for part, combination in zip(whole, product(*levels), strict=True):
            part[:, space.numeric], part[:, ~space.numeric] = coded, combination
        coded, kinds = np.vstack(whole), kinds * len(whole)
    return Design(space, space.snap(space.decode(coded)), tuple(kinds))


def _number(x: float) -> str:
    return repr(float(x) + 0.0)


def _head(space: Space, *, blocked: bool) -> list[str]:
    """The names of the columns that we write."""
    names = space.names
    run, kind, block = (free_name(name, names) for name in ("run", "kind", "block"))
    return [run, kind, *[block] * blocked, *names, *(free_name(f"{name}_coded", names) for name in names)]


def _as_we_write(text: str, space: Space) -> Design | None:
    """Read a table of numbers exactly as we write it, in a tenth of the time; None where anything is odd."""
    head, _, _ = text.partition("\n")
    names = head.split(",")
    blocked = len(names) > 2 + 2 * len(space)
    odd = any(mark in text for mark in "\"'#\r\ufeff") or "\n\n" in text
    rows = text.rstrip("\n").count("\n")
    odd = odd or text.count(",") != (rows + 1) * (len(names) - 1)  # none may be longer if none is shorter
    if odd or names != _head(space, blocked=blocked) or not all(f.domain.is_continuous for f in space):
        return None
    kinds: list[str] = []
    known: dict[str, str] = {}  # a million rows share a few texts

    def lines() -> Iterator[str]:
        start = len(head) + 1
        while start < len(text):
            end = text.find("\n", start) % (len(text) + 1)  # -1, no newline at the end, becomes the end
            line = text[start:end]
            kind = line.split(",", 2)[1].strip()
            kinds.append(known.setdefault(kind, kind or "given"))
            yield line
            start = end + 1

    columns = range(2, len(names))
    try:
        table = np.loadtxt(lines(), delimiter=",", comments=None, usecols=columns, ndmin=2)
    except ValueError:
        return None
    blocks, points = table[:, :blocked].ravel(), table[:, blocked : blocked + len(space)]
    coded, expected = table[:, blocked + len(space) :], space.encode(points)
    agree = np.isfinite(table).all() and (np.abs(coded - expected) <= AGREE * (1.0 + np.abs(expected))).all()
    whole = (blocks == np.floor(blocks)).all()
    if not (len(points) and agree and whole):
        return None
    return Design(space, points, tuple(kinds), tuple(map(int, blocks)))


def _design(table: Table, space: Space) -> Design:
    source, names = table.source, table.names
    factors = ", ".join(space.names)
    if not names:
        raise RsmkitError(f"{source}: is empty; it needs the columns {factors}")
    repeated = sorted({name for name in names if name and names.count(name) > 1})
    missing = [name for name in space.names if name not in names]
    if repeated or missing:
        what = f"column {repeated[0]} appears twice" if repeated else f"no column for {', '.join(missing)}"
        raise RsmkitError(f"{source}: {what}; the factors of the study are {factors}")
    if not len(table):
        raise RsmkitError(f"{source}: has a head but no runs")
    points = np.column_stack([_coordinates(factor, table) for factor in space])
    for factor, expected in zip(space, space.encode(points).T, strict=True):
        coded = free_name(f"{factor.name}_coded", space.names)
        if coded in names:
            _check_coded(factor, table, coded, expected)
    kind, block = (free_name(name, space.names) for name in ("kind", "block"))
    kinds = table.texts(kind) if kind in names else [""] * len(points)
    blocks = _blocks(table, block) if block in names else ()
    return Design(space, points, tuple(kind or "given" for kind in kinds), blocks)


def _coordinates(factor: Factor, table: Table) -> Floats:
    values = np.empty(len(table))
    if factor.domain.is_continuous and not table.decimal_comma:
        try:
            values[:] = np.array(table.texts(factor.name), float)
        except ValueError:
            pass  # one by one, to name the one that is wrong
        else:
            if np.isfinite(values).all():
                return values
    for index, (line, text) in enumerate(zip(table.lines, table.texts(factor.name), strict=True)):
        at = f"{table.source}, line {line}, column {factor.name}"
        try:
            values[index] = table.value(text, factor.coordinate)
        except RsmkitError:
            raise RsmkitError(f"{at}: '{text:.60}' is not {factor.domain.wanted}") from None
        if not math.isfinite(values[index]):
            raise RsmkitError(f"{at}: '{text:.60}' is not a finite number")
    return values


def _blocks(table: Table, column: str) -> tuple[int, ...]:
    blocks = []
    for line, text in zip(table.lines, table.texts(column), strict=True):
        try:
            blocks.append(int(text))
        except ValueError:
            raise RsmkitError(
                f"{table.source}, line {line}, column {column}: '{text:.60}' is not a whole number"
            ) from None
    return tuple(blocks)


def _check_coded(factor: Factor, table: Table, column: str, expected: Floats) -> None:
    natural = table.texts(factor.name)
    try:
        coded = np.array(table.texts(f"{factor.name}_coded"), float)
    except ValueError:
        pass  # one by one, to name the one that is wrong
    else:
        if (np.abs(coded - expected) <= AGREE * (1.0 + np.abs(expected))).all():
            return
    for index, text in enumerate(table.texts(column)):
        try:
            away = abs(table.value(text, float) - expected[index]) if text else 0.0
        except (ValueError, RsmkitError):
            away = np.inf
        if not away <= AGREE * (1.0 + abs(expected[index])):
            raise RsmkitError(
                f"{table.source}, line {table.lines[index]}: {column} is {text:.60} but "
                f"{factor.name} = {natural[index]} is {expected[index]:.6g} coded for the range "
                f"{factor.low:g} to {factor.high:g}; plan again, or delete the coded columns"
            )
