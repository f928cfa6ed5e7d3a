"""Surrogate against direct search: the paper's Tables 8 and 9, and what each way costs in simulations."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.io.shown import Shown
from rsmkit.language.space import Floats, Space
from rsmkit.optimum.evaluation_cache import CachedEvaluator
from rsmkit.optimum.local.local_search import SIMULATOR, LocalSearch
from rsmkit.optimum.optimum import Optimum, missed_words
from rsmkit.optimum.options import SearchOptions
from rsmkit.optimum.problem import Problem
from rsmkit.optimum.search import search_problem

__all__ = [
    "DirectSearch",
    "PointDifference",
    "compare_points",
    "runs_to_reach",
    "search_directly",
    "summarise_runs",
    "wilson_interval",
]


@dataclass(frozen=True)
class PointDifference(Shown):
    """One factor of two optima (the paper's Table 8).

    Parameters
    ----------
    factor : str
        Name.
    reference, surrogate : float
        Its value at the direct search's and at the surrogate's optimum, natural units.
    difference_pct : float
        ``100 |surrogate - reference| / |reference|``, the paper's "Diff%"; nan for a reference of zero.
    range_pct : float
        The same distance in percent of the factor's range, which does not depend on where zero lies.
    """

    factor: str
    reference: float
    surrogate: float
    difference_pct: float
    range_pct: float


@checked
def compare_points(space: Space, reference: Floats, surrogate: Floats) -> tuple[PointDifference, ...]:
    """Compare two natural points, shape (k,), factor by factor; categorical factors are left out."""
    rows = []
    for factor, a, b in zip(space, reference.tolist(), surrogate.tolist(), strict=True):
        if factor.domain.is_numeric:
            away = abs(b - a)
            relative = 100.0 * away / abs(a) if a else math.nan
            rows.append(
                PointDifference(factor.name, a, b, relative, 100.0 * away / (factor.high - factor.low))
            )
    return tuple(rows)


@dataclass(frozen=True)
class DirectSearch(Shown):
    """One genetic search on the true simulator.

    Parameters
    ----------
    seed : int
        Of the search.
    optimum : Optimum
        What it found.
    objectives : ndarray, shape (n,)
        True objective of every design in order; inf where it failed or violates a constraint.
    batches : tuple of int
        Designs that could be asked side by side.
    runs_each : int
        Runs that tell what one design is worth: more than one where the objective is over what varies.
    """

    seed: int
    optimum: Optimum
    objectives: Floats
    batches: tuple[int, ...]
    runs_each: int = 1

    @property
    def runs(self) -> int:
        """Different simulator runs."""
        return self.runs_each * len(self.objectives)

    def waves(self, processors: int) -> int:
        """Rounds of parallel runs on so many processors."""
        return sum(math.ceil(size * self.runs_each / processors) for size in self.batches)

    def overview(self) -> dict[str, Any]:
        """What it found, as JSON values."""
        return {
            "seed": self.seed,
            "factors": self.optimum.factors,
            "objective": self.optimum.best.objectives[0],
            "runs": self.runs,
            "waves_16": self.waves(16),
        }


@checked
def search_directly(
    problem: Problem,
    options: SearchOptions,
    seeds: Sequence[int],
    *,
    local: LocalSearch = SIMULATOR,
    runs_each: int = 1,
    on_search: Callable[[DirectSearch], None] | None = None,
) -> tuple[DirectSearch, ...]:
    """Run the genetic algorithm on the true simulator, once per seed.

    Parameters
    ----------
    problem : Problem
        One objective; its evaluator is the true simulator (through the journal, so that it is resumable).
    options : SearchOptions
        Preset and size; the seed is replaced.
    seeds : sequence of int
        One search each. Every search pays for all its runs, also for those another seed has made.
    local : LocalSearch
        The polish.
    runs_each : int
        Simulator runs that the evaluator makes for each design.
    on_search : callable, optional
        Called after each.

    Raises
    ------
    RsmkitError
        When no run satisfies every constraint.
    """
    found = []
    for seed in seeds:
        cached = CachedEvaluator(problem.evaluator, problem.space)
        about = replace(problem, evaluator=cached)
        optimum = search_problem(about, replace(options, seed=seed), local)
        if optimum.missed:
            raise RsmkitError(
                f"search {options.name}: no run of the direct search satisfies every constraint; the nearest "
                f"misses {missed_words(optimum.missed)}. Relax the constraint or widen the bounds"
            )
        history = about.evaluation(*cached.history())
        good = np.isfinite(history.objectives[:, 0]) & (history.margins >= 0).all(axis=1)
        objectives = np.where(good, history.objectives[:, 0], np.inf)
        found.append(DirectSearch(seed, optimum, objectives, tuple(cached.batches), runs_each))
        if on_search:
            on_search(found[-1])
    return tuple(found)


def runs_to_reach(objectives: Floats, target: float) -> int | None:
    """Number of runs until an objective of at most `target` was seen; None if it never was."""
    hits = np.flatnonzero(objectives <= target)
    return int(hits[0]) + 1 if len(hits) else None


def wilson_interval(successes: int, trials: int, confidence: float = 0.95) -> tuple[float, float]:
    """Confidence interval of a success rate (Wilson, J. American Statistical Association 22, 1927)."""
    from scipy.stats import norm

    z = float(norm.ppf(0.5 + 0.5 * confidence))
    rate = successes / trials
    middle = (rate + z * z / (2 * trials)) / (1 + z * z / trials)
    half = z * math.sqrt(rate * (1 - rate) / trials + z * z / (4 * trials**2)) / (1 + z * z / trials)
    return max(0.0, middle - half), min(1.0, middle + half)


def summarise_runs(counts: Mapping[int, int | None]) -> dict[str, Any]:
    """Median, 90th percentile and success rate of runs to a target over seeds."""
    reached = [count for count in counts.values() if count is not None]
    low, high = wilson_interval(len(reached), len(counts))
    return {
        "seeds": len(counts),
        "successes": len(reached),
        "success_low": low,
        "success_high": high,
        "median": float(np.median(reached)) if reached else None,
        "p90": float(np.quantile(reached, 0.9)) if reached else None,
    }
