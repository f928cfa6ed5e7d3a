"""Expected mean squares of balanced layouts with random and nested factors, and which errors test what."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from numbers import Integral
from typing import Any

from rsmkit.errors import RsmkitError, one_of
from rsmkit.io.arguments import checked
from rsmkit.io.shown import Shown

__all__ = ["ExpectedMeanSquare", "expected_mean_squares"]

ERROR = "error"
"""Name of the runs' own row and variance."""
NAMING = (
    f"'{ERROR}' is the row of the runs, and spaces, colons, commas and brackets are for products and nests"
)


@dataclass(frozen=True)
class ExpectedMeanSquare(Shown):
    """A row of the analysis of variance of a balanced layout.

    Parameters
    ----------
    source : str
        ``a``, ``a:b``, ``b(a)`` for b nested in a, or ``error``.
    df : int
    random : bool
        Whether its effects are a sample, with a variance of their own.
    coefficients : dict
        What the mean square expects: ``{component: times}``. For a random source the component is its
        variance; for a fixed one the sum of its squared effects over its degrees of freedom.
    quadratic : tuple of str
        Other fixed sources that add to the same quadratic form; unrestricted models only.
    error_term : str or None
        The source whose mean square expects the same but for this one's own effect: the denominator of the
        F test. None when no single source does, and for the error.
    """

    source: str
    df: int
    random: bool
    coefficients: dict[str, int]
    quadratic: tuple[str, ...] = ()
    error_term: str | None = None

    @property
    def of_squared_effects(self) -> float:
        """What multiplies the sum of squared effects of a fixed source."""
        return self.coefficients[self.source] / self.df

    def __str__(self) -> str:
        own = [f"{n} {name}" if n > 1 else name for name, n in self.coefficients.items()]
        return " + ".join([*own, *([f"Q({', '.join(self.quadratic)})"] if self.quadratic else [])])


@dataclass(frozen=True)
class _Term:
    """A source: factors that are crossed (live), and those they are nested in."""

    live: tuple[str, ...]
    within: tuple[str, ...]

    @property
    def factors(self) -> frozenset[str]:
        return frozenset(self.live + self.within)

    @property
    def name(self) -> str:
        return ":".join(self.live) + (f"({','.join(self.within)})" if self.within else "")


@checked
def expected_mean_squares(
    levels: Mapping[str, int],
    *,
    random: Sequence[str] = (),
    nested: Mapping[str, str] | None = None,
    replicates: int = 1,
    restricted: bool = True,
) -> tuple[ExpectedMeanSquare, ...]:
    """Expected mean squares of all sources of a balanced layout.

    Montgomery, *Design and Analysis of Experiments*, 8th ed. (2013), chapters 13 and 14.

    Parameters
    ----------
    levels : mapping
        Levels of each factor; of a nested factor, within each level of the one it is nested in.
    random : sequence of str
        Factors whose levels are a sample.
    nested : mapping, optional
        ``{"batch": "supplier"}``: batches are other ones with every supplier.
    replicates : int
        Runs in each cell.
    restricted : bool
        Whether the effects of a mixed interaction add to zero over the fixed factor, as in most textbooks, or
        not, as in SAS and JMP.

    Returns
    -------
    tuple of ExpectedMeanSquare
        Factors in the given order, then products, then the error.

    Raises
    ------
    RsmkitError
        For names that are no factors, a nesting without end, or counts that make no layout.

    Examples
    --------
    >>> import rsmkit as rk
    >>> for row in rk.expected_mean_squares({"part": 20, "operator": 3}, random=["part"], replicates=2):
    ...     print(f"{row.source}: {row}; tested by {row.error_term}")
    part: error + 6 part; tested by error
    operator: error + 2 part:operator + 40 operator; tested by part:operator
    part:operator: error + 2 part:operator; tested by error
    error: error; tested by None
    """
    above = _ancestors(levels, nested or {})
    _refuse(levels, random, replicates)
    terms = _terms(list(levels), above)
    chance = {term: any(name in random for name in term.factors) for term in terms}
    rows = []
    for term in terms:
        parts: dict[str, int] = {ERROR: 1}
        forms = []
        for other in reversed(terms):
            added = set(other.live) - term.factors
            if not term.factors <= other.factors or (restricted and added - set(random)):
                continue
            if chance[other] or other == term:
                parts[other.name] = replicates * math.prod(
                    count for name, count in levels.items() if name not in other.factors
                )
            else:
                forms.append(other.name)
        df = math.prod(levels[name] - 1 for name in term.live) * math.prod(levels[n] for n in term.within)
        rows.append(ExpectedMeanSquare(term.name, df, chance[term], parts, tuple(forms)))
    cells = math.prod(levels.values())
    rows.append(ExpectedMeanSquare(ERROR, cells * (replicates - 1), True, {ERROR: 1}))
    return tuple(_with_error_term(row, rows) for row in rows)


def _with_error_term(row: ExpectedMeanSquare, rows: list[ExpectedMeanSquare]) -> ExpectedMeanSquare:
    rest = {name: times for name, times in row.coefficients.items() if name != row.source}
    for other in rows:
        same = other.coefficients == rest and not other.quadratic and other.random and other.df > 0
        if same and row.source != ERROR and other is not row:
            own = (row.source, row.df, row.random, row.coefficients, row.quadratic)
            return ExpectedMeanSquare(*own, other.source)
    return row


def _ancestors(levels: Mapping[str, int], nested: Mapping[str, str]) -> dict[str, tuple[str, ...]]:
    """The factors that each is nested in, the outermost first."""
    for name in (*nested, *nested.values()):
        one_of("nested factors", name, list(levels))
    found = {}
    for name in levels:
        chain, at = [], name
        while at in nested:
            at = nested[at]
            if at == name or at in chain:
                raise RsmkitError(f"nested: {name} would be nested in itself")
            chain.append(at)
        found[name] = tuple(reversed(chain))
    return found


def _refuse(levels: Mapping[str, int], random: Sequence[str], replicates: int) -> None:
    for name in random:
        one_of("random factors", name, list(levels))
    given: Mapping[str, Any] = levels
    for name, count in given.items():
        if not isinstance(count, Integral) or count < 2:
            raise RsmkitError(f"levels: {name} needs a whole number of at least 2, got {count!r}")
        if name == ERROR or not re.fullmatch(r"[^:(),\s]+", name):
            raise RsmkitError(f"levels: a factor of a layout cannot be called '{name}'; {NAMING}")
    if not levels or replicates < 1:
        raise RsmkitError(f"a layout needs factors and at least one run per cell, got {replicates}")


def _terms(names: list[str], above: Mapping[str, tuple[str, ...]]) -> list[_Term]:
    """All sources of the layout; a factor and what it is nested in are not crossed."""
    found = []
    for size in range(1, len(names) + 1):
        for live in combinations(names, size):
            outer = {parent for name in live for parent in above[name]}
            if not outer & set(live):
                found.append(_Term(live, tuple(name for name in names if name in outer)))
    return found
