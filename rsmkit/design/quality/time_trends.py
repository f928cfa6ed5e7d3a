"""How far a drift over time would be taken for effects, in the order in which runs are made."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rsmkit.design.design import Design
from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.io.shown import Shown
from rsmkit.language.space import Floats
from rsmkit.language.terms import Terms, full_terms

__all__ = ["RunOrder", "run_order_trends"]


@dataclass(frozen=True, eq=False)
class RunOrder(Shown):
    """Terms against trends over the order of the runs.

    Parameters
    ----------
    names : tuple of str
        Columns of the model, the constant left out.
    groups : tuple of str
        ``FO``, ``TWI``, ``PQ``, ... of each.
    cosines : array, shape (p, degree)
        Of the angle between each column and the linear, quadratic, ... trend: 0 where the trend does not
        touch the effect, 1 where they are the same.
    time_count : array, shape (p,)
        Products of the columns with the run's number, counted from the middle.
    level_changes : dict
        How often each factor is changed from one run to the next.
    """

    names: tuple[str, ...]
    groups: tuple[str, ...]
    cosines: Floats
    time_count: Floats
    level_changes: dict[str, int]

    def of_group(self, group: str) -> Floats:
        """Sizes of the cosines of a group's columns, shape (m, degree)."""
        found: Floats = np.abs(self.cosines[[g == group for g in self.groups]])
        return found


@checked
def run_order_trends(
    design: Design, *, order: int = 2, terms: Terms | None = None, degree: int = 3
) -> RunOrder:
    """Compare the columns of a model with smooth trends over the order of the runs.

    The trends are polynomials orthogonal to each other and to a constant; columns are taken as they are, not
    centred (Nunez Ares & Goos 2019, Journal of Quality Technology 51(1), 37-48).

    Parameters
    ----------
    design : Design
        Its order is that in which the runs are made.
    order, terms
        The model.
    degree : int
        Highest degree of a trend, below the number of runs.

    Examples
    --------
    >>> import rsmkit as rk
    >>> found = rk.run_order_trends(rk.full_factorial(rk.Space(a=(0, 1), b=(0, 1))), order=1, degree=1)
    >>> found.names, found.time_count.tolist(), found.level_changes
    (('a', 'b'), [2.0, 4.0], {'a': 3, 'b': 1})
    """
    n = len(design)
    if not 1 <= degree < n:
        raise RsmkitError(f"degree of a trend over {n} runs must be 1 to {n - 1}, got {degree}")
    terms = full_terms(design.space, order) if terms is None else terms
    columns, groups = terms.matrix(design.coded), np.array(terms.groups)
    kept = np.flatnonzero(groups != "")
    time = np.arange(n) - (n - 1) / 2.0
    trends = np.linalg.qr(np.vander(time / (n - 1), degree + 1, increasing=True))[0][:, 1:]
    trends = trends * np.sign(trends[-1])
    lengths = np.linalg.norm(columns, axis=0)
    cosines = (columns / np.where(lengths > 0, lengths, 1.0)).T @ trends
    changes = (np.diff(design.points, axis=0) != 0).sum(axis=0).tolist()
    names = terms.names(design.space)
    return RunOrder(
        tuple(names[i] for i in kept),
        tuple(groups[kept].tolist()),
        cosines[kept],
        columns[:, kept].T @ time,
        dict(zip(design.space.names, changes, strict=True)),
    )
