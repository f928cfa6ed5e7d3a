"""The region that all constraints of a search leave together: what overlaid contour plots show."""

from __future__ import annotations

from dataclasses import dataclass

from rsmkit.language.space import Floats
from rsmkit.optimum.problem import Problem

__all__ = ["FeasibleRegion", "feasible_region"]

SAMPLES = 4096


@dataclass(frozen=True)
class FeasibleRegion:
    """Where every constraint holds.

    Parameters
    ----------
    share : float
        Fraction of the box, or of the part of it that keeps the equalities.
    low, high : tuple of float
        Least and largest value of each factor among the sampled points that are feasible, natural units;
        empty when none is.
    """

    share: float
    low: tuple[float, ...]
    high: tuple[float, ...]


def feasible_region(problem: Problem) -> FeasibleRegion:
    """Sample the space evenly and see where all constraints hold; meant for surfaces, where that is free."""
    from scipy.stats import qmc

    unit: Floats = qmc.Sobol(len(problem.space), rng=0).random(SAMPLES)
    points = problem.space.spread(unit)
    inside = points[(problem.evaluate(points).margins >= 0.0).all(axis=1)]
    if not len(inside):
        return FeasibleRegion(0.0, (), ())
    low, high = inside.min(axis=0).tolist(), inside.max(axis=0).tolist()
    return FeasibleRegion(len(inside) / SAMPLES, tuple(low), tuple(high))
