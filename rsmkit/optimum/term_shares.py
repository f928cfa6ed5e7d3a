"""What each term of a weighted sum contributes, and whether one of them drowns the others."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rsmkit.language.expression import Expression
from rsmkit.language.space import Floats

__all__ = ["TermShare", "dominance_warning", "normalised", "term_shares"]

DOMINANT = 0.95
"""A term with more than this share of the sum leaves the others without influence."""


@dataclass(frozen=True)
class TermShare:
    """One summand of an objective.

    Parameters
    ----------
    term : str
        As written.
    share : float
        Mean of its absolute value over the points, as a part of the sum of all terms'.
    spread : float
        Its standard deviation over the points as a part of the sum of all terms': what it can do to the
        optimum.
    """

    term: str
    share: float
    spread: float


def term_shares(objective: Expression, values: Mapping[str, Floats]) -> tuple[TermShare, ...]:
    """Shares of the summands at given points (the design's runs, say), arrays of equal length by name."""
    terms = objective.terms()
    count = max((np.size(values[name]) for name in objective.names), default=1)
    columns = [np.broadcast_to(term(values), (count,)) for term in terms]
    sizes = np.array([np.abs(column).mean() for column in columns])
    spreads = np.array([column.std() for column in columns])
    return tuple(
        TermShare(term.text, float(size / (sizes.sum() or 1.0)), float(spread / (spreads.sum() or 1.0)))
        for term, size, spread in zip(terms, sizes, spreads, strict=True)
    )


def dominance_warning(shares: tuple[TermShare, ...]) -> str | None:
    """One sentence when a term carries nearly the whole sum, else None."""
    largest = max(shares, key=lambda item: item.share)
    if len(shares) < 2 or largest.share < DOMINANT:
        return None
    return (
        f"'{largest.term}' carries {100 * largest.share:.1f} % of the objective, the other "
        f"{len(shares) - 1} terms hardly count; scale each term by its range if all should act"
    )


def normalised(objective: Expression, values: Mapping[str, Floats], weights: Mapping[str, float]) -> str:
    """Text of a weighted sum in which every quantity is scaled to 0..1 over its range in `values`.

    `weights` says how much each quantity of the objective shall count.
    """
    parts = []
    for name in sorted(objective.names, key=list(weights).index):
        low, high = float(np.min(values[name])), float(np.max(values[name]))
        parts.append(f"{weights[name]!r}*({name} - {low!r})/{high - low!r}")
    return " + ".join(parts)
