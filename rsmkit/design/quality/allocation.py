"""How to divide a budget of runs between two settings that differ in noise or in cost."""

from __future__ import annotations

import math
from dataclasses import dataclass

from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.io.shown import Shown

__all__ = ["Allocation", "allocate_runs"]


@dataclass(frozen=True)
class Allocation(Shown):
    """So many runs at each of two settings.

    Parameters
    ----------
    runs : tuple of int
        At the first and at the second setting.
    variance : float
        Of the difference between the settings.
    efficiency : float
        The smallest such variance for the budget over this one, in percent.
    """

    runs: tuple[int, int]
    variance: float
    efficiency: float


@checked
def allocate_runs(
    budget: float,
    variances: tuple[float, float] = (1.0, 1.0),
    costs: tuple[float, float] = (1.0, 1.0),
) -> tuple[Allocation, ...]:
    """Compare all ways to divide a budget between two settings whose difference is to be estimated.

    The best is near ``n1/n2 = (s1/s2) sqrt(c2/c1)`` (Neyman 1934; Cochran, *Sampling Techniques*, 3rd ed.,
    section 5.5).

    Parameters
    ----------
    budget : float
        What all runs together may cost: their number where each costs one.
    variances, costs : tuple of float
        Of a run at the first and at the second setting.

    Returns
    -------
    tuple of Allocation
        By the runs at the first setting; the second has as many as the rest of the budget pays for.

    Raises
    ------
    RsmkitError
        For numbers that are not positive, or a budget that does not pay for one run at each setting.

    Examples
    --------
    >>> max(allocate_runs(12, variances=(1.0, 9.0)), key=lambda split: split.efficiency).runs
    (3, 9)
    """
    if not all(0.0 < x < math.inf for x in (*variances, *costs)):
        raise RsmkitError("allocation: variances and costs must be positive numbers")
    (s1, s2), (c1, c2) = variances, costs
    if not c1 + c2 <= budget < math.inf:
        raise RsmkitError(f"allocation: a budget of {budget:g} does not pay for one run at each setting")
    slack = 1.0 + 1e-12  # budgets and costs in decimals add up to a rounding less
    splits = []
    for first in range(1, int((budget * slack - c2) / c1) + 1):
        second = int((budget * slack - c1 * first) / c2)
        splits.append(((first, second), s1 / first + s2 / second))
    least = min(variance for _, variance in splits)
    return tuple(Allocation(runs, variance, 100.0 * (least / variance)) for runs, variance in splits)
