"""Columns of a table that are the components of a mixture: checked, and noticed where nobody said so."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.io.tables.csv_tables import Table
from rsmkit.language.scheffe import MODELS, Process, parse_scheffe, scheffe_terms
from rsmkit.language.space import Floats, Space
from rsmkit.language.terms import Terms
from rsmkit.surfaces.tables.table_columns import is_numeric, numbers

__all__ = ["MixtureAsked", "constant_sum", "mixture_space", "mixture_terms", "sum_note", "unused_note"]

PRINTED = 2e-2
"""Most that proportions printed with few digits may miss their total by, as a share of it."""
ROUNDED = 1e-6
"""Share of the total that sums of numbers printed with many digits may be off by."""
NOTICED = 1e-7
"""Share of the total by which a sum may be off before anybody is told."""
EXACT = 1e-12
MOST_ROWS = 5
MOST_COLUMNS = 10
"""Factors of which every subset is tried for a constant sum."""


@dataclass(frozen=True)
class MixtureAsked:
    """What is said of the mixture of a table.

    Parameters
    ----------
    components : tuple of str
        Columns; none for a table without a mixture.
    model : str, optional
        ``scheffe-linear``, ``scheffe-quadratic``, ``scheffe-special-cubic``, ``scheffe-cubic``.
    process : {"combined", "main", "crossed"}
        How other factors join, see :func:`rsmkit.language.scheffe.scheffe_terms`.
    """

    components: tuple[str, ...] = ()
    model: str | None = None
    process: Process = "combined"

    def check(self, factors: Sequence[str]) -> tuple[str, ...]:
        """Give all factors, components among them, or refuse what means nothing.

        Raises
        ------
        RsmkitError
            For a model without a mixture, one component alone, or an unknown model.
        """
        if not self.components:
            if self.model is not None or self.process != "combined":
                raise RsmkitError("a Scheffe model goes with a mixture; name its components: --mixture a,b,c")
            return tuple(factors)
        if len(set(self.components)) < len(self.components) or len(self.components) < 2:
            raise RsmkitError(
                f"a mixture needs two or more different components, not {', '.join(self.components)}"
            )
        if self.model is not None and self.model not in MODELS:
            raise RsmkitError(f"model {self.model} is no model of a mixture; choose {', '.join(MODELS)}")
        return (*self.components, *(name for name in factors if name not in self.components))

    def refuse(self, codes: Collection[str], categorical: Collection[str], blocks: str | None) -> None:
        """Refuse what does not go with a mixture: codings and categories of components, and blocks.

        Raises
        ------
        RsmkitError
            With what to do instead.
        """
        if blocks and self.components:
            raise RsmkitError(
                f"blocks stand beside a constant, which a model of a mixture has not; say --random {blocks} "
                f"where they are a sample of all, or make {blocks} a factor"
            )
        for name in self.components:
            if name in codes:
                raise RsmkitError(f"component {name} enters as its proportion, so it has no coding")
            if name in categorical:
                raise RsmkitError(f"component {name} is a proportion, so its numbers are no names")


def mixture_space(
    table: Table, rows: Mapping[int, int], space: Space, points: Floats, asked: MixtureAsked
) -> tuple[Space, list[str]]:
    """The space with its mixture, whose total is what the rows add up to, and what was noticed.

    Parameters
    ----------
    table : Table
        Rows in use.
    rows : mapping of int to int
        Number of each row, as people count, by its line.
    space : Space
    points : array, shape (n, k)
    asked : MixtureAsked

    Raises
    ------
    RsmkitError
        Naming rows that do not add up like the others, negative amounts, components that never vary or are
        no numbers; for a table of one run.
    """
    places = [space.names.index(name) for name in asked.components]
    amounts = points[:, places]
    listed = " + ".join(asked.components)
    if len(amounts) == 1:
        raise RsmkitError(
            f"{table.source}: one run tells nothing of how {listed} blend; add at least "
            f"{len(asked.components) - 1} runs with other proportions"
        )
    for j, name in enumerate(asked.components):
        if (amounts[:, j] < 0).any():
            row = rows[table.lines[int(np.argmin(amounts[:, j]))]]
            raise RsmkitError(f"component {name}, row {row}: {amounts[:, j].min():g} is less than nothing")
        if np.ptp(amounts[:, j]) == 0.0:
            raise RsmkitError(
                f"component {name} is {amounts[0, j]:.10g} in every run, so nothing is known of it: leave it "
                "out of the mixture, the others add up to a constant without it"
            )
    sums = amounts.sum(axis=1)
    total = float(np.median(sums))
    total = round(total, 12) if abs(round(total, 12) - total) <= EXACT * total else total
    apart = np.abs(sums - total)
    named = [f"{rows[line]} ({value:.6g})" for line, value in zip(table.lines, sums.tolist(), strict=True)]
    wrong = [text for text, miss in zip(named, apart, strict=True) if miss > _unprinted(table, asked, total)]
    if 2 * len(wrong) > len(sums):
        raise RsmkitError(
            f"{table.source}: {listed} is no constant, from {sums.min():.6g} to {sums.max():.6g}; name "
            "every component, or give proportions"
        )
    if wrong:
        raise RsmkitError(
            f"{table.source}: {listed} is {total:.6g} in most rows, but not in row{'s' * (len(wrong) > 1)} "
            f"{_few(wrong)}; correct them, name every component, or leave rows out with --exclude"
        )
    off = [text for text, miss in zip(named, apart, strict=True) if miss > NOTICED * total]
    notes = [
        f"{listed} is {total:.10g} but for digits that are not printed, in rows {_few(off)}; the proportions "
        "are used as they stand"
    ]
    return space.mixture(*asked.components, total=total), notes if off else []


def _few(texts: list[str]) -> str:
    more = [f"and {len(texts) - MOST_ROWS} more"] if len(texts) > MOST_ROWS else []
    return ", ".join([*texts[:MOST_ROWS], *more])


def _unprinted(table: Table, asked: MixtureAsked, total: float) -> float:
    """By how much sums may miss the total because each amount is rounded to the digits printed."""
    texts = [table.plain(text) for name in asked.components for text in table.texts(name)]
    digits = max((len(text.partition(".")[2]) for text in texts if "e" not in text), default=0)
    return max(min(len(asked.components) * 0.5 * 10.0**-digits, PRINTED * total), ROUNDED * total)


def mixture_terms(
    space: Space, points: Floats, asked: MixtureAsked, order: int, words: Sequence[str]
) -> tuple[Terms, str]:
    """Terms of the model that is asked for, and what was left out of it.

    Powers of a process factor need more values of it than their exponent; terms that are named are kept.

    Raises
    ------
    RsmkitError
        For both terms and a model, or an order above 3.
    """
    if words and asked.model:
        raise RsmkitError("give either a model or its terms, not both")
    if words:
        return parse_scheffe(space, asked.components, words), ""
    if asked.model is None and order > 3:
        raise RsmkitError(f"models of mixtures are of order 1 to 3, not {order}; name their terms instead")
    blending = MODELS[asked.model] if asked.model else order
    terms = scheffe_terms(space, asked.components, blending, asked.process)
    most = [
        3 if f.name in asked.components else len(set(x)) - 1 for f, x in zip(space, points.T, strict=True)
    ]
    few = sorted({j for e in terms.exponents for j, x in enumerate(e) if x > max(1, most[j])})
    if not few:
        return terms, ""
    kept = tuple(e for e in terms.exponents if all(e[j] <= max(1, most[j]) for j in few))
    names = " and ".join(space.names[j] for j in few)
    note = f"{names} {'takes' if len(few) == 1 else 'take'} too few values for the higher powers of the model"
    return replace(terms, exponents=kept), f"{note}, which goes without them"


@checked
def constant_sum(columns: Mapping[str, Floats]) -> tuple[tuple[str, ...], float] | None:
    """Columns that add up to a constant as the components of a mixture do, and what they add up to.

    All columns together first, then the largest subset; coded columns, which reach below zero, never do.
    """
    names = [name for name, values in columns.items() if values.min() >= 0.0 and np.ptp(values) > 0.0]
    if len(names) < 2 or any(len(values) < 3 for values in columns.values()):
        return None
    sizes = range(len(names), 1, -1) if len(names) <= MOST_COLUMNS else [len(names)]
    for size in sizes:
        for chosen in combinations(names, size):
            total = np.sum([columns[name] for name in chosen], axis=0)
            if np.ptp(total) <= 1e-9 * total.max():
                return chosen, float(round(np.median(total), 12))
    return None


def sum_note(columns: Mapping[str, Floats]) -> str:
    """What to say of a table whose factors add up to a constant although no mixture is named."""
    found = constant_sum(columns)
    if found is None:
        return ""
    names, total = found
    return (
        f"{' + '.join(names)} is {total:.10g} in every run: a mixture, whose components cannot be changed "
        f"one at a time; --mixture {','.join(names)} fits it as one"
    )


def unused_note(table: Table, used: Sequence[str]) -> str:
    """Numeric columns that might be process factors, where only the components were named."""
    free = [name for name in table.names if name not in used and is_numeric(table, name)]
    varying = []
    for name in free:
        try:
            values = numbers(table, name)
        except RsmkitError:
            continue
        if np.ptp(values) > 0.0:
            varying.append(name)
    if not varying:
        return ""
    return f"columns not used: {', '.join(varying)}; --factors names those that are process factors"
