"""Comparisons: the design against other designs, and the surrogate against a direct search."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from rsmkit.design.build import region_of_interest
from rsmkit.design.design import Design
from rsmkit.design.quality.design_comparison import (
    DesignComparison,
    compare_designs,
    plot_design_space_fraction,
)
from rsmkit.errors import StageError
from rsmkit.language.space import Floats
from rsmkit.optimum.pareto_front import hypervolume, igd_plus, nondominated
from rsmkit.optimum.problem import Problem
from rsmkit.optimum.service.robust import pinned
from rsmkit.runs.how_to_run import HowToRun
from rsmkit.runs.record.run_progress import Watcher
from rsmkit.stages.planning.plan import model_terms
from rsmkit.stages.planning.plot_outlook import in_groups, with_plots
from rsmkit.stages.refine import simulator_problem
from rsmkit.study.counts import as_rates
from rsmkit.study.folder import DESIGN_FILE, StudyFolder
from rsmkit.study.posing import noise_means, runs_each, search_options
from rsmkit.study.user_functions import design_constraints
from rsmkit.verification.direct_search import DirectSearch, PointDifference, compare_points, search_directly
from rsmkit.verification.judge import best_known
from rsmkit.verification.verification import Confirmation

__all__ = ["DirectComparison", "FrontComparison", "compare_with_direct", "compare_with_others"]

FIGURE_FILE = "design-comparison.png"


def compare_with_others(folder: StudyFolder, others: Sequence[Path]) -> tuple[DesignComparison, Path]:
    """Put the study's design beside other ``design.csv`` files; also draws how variance is spread.

    Returns
    -------
    comparison : DesignComparison
    figure : Path
        The fraction-of-design-space plot.
    """
    study = folder.study
    designs = {"this design": folder.plan().design}
    for other in others:
        path = other / DESIGN_FILE if other.is_dir() else other
        designs[str(other)] = Design.from_csv(path, study.space)
    if study.random:
        designs = {name: in_groups(study, design) for name, design in designs.items()}
    terms = model_terms(study)
    region = region_of_interest(study.space, study.file.design, design_constraints(study), folder.path)
    comparison = compare_designs(designs, terms=terms, region=region, deterministic=study.deterministic)
    if study.random:
        pairs = zip(comparison.qualities, designs.values(), strict=True)
        judged = (
            with_plots(quality, design, terms, region, study.hard) if design.block_ratio else quality
            for quality, design in pairs
        )
        comparison = replace(comparison, qualities=tuple(judged))
    figure = folder.path / FIGURE_FILE
    plot_design_space_fraction(designs, terms=terms, region=region).savefig(figure, dpi=150)
    return comparison, figure


@dataclass(frozen=True)
class DirectComparison:
    """One search: its verified surrogate optimum against direct searches of the simulator.

    Parameters
    ----------
    search : str
    surrogate_factors, surrogate_objective, surrogate_runs
        The verified optimum, its true objective, and the runs it took.
    direct : tuple of DirectSearch
        One per seed.
    """

    search: str
    surrogate_factors: Mapping[str, Any]
    surrogate_objective: float
    surrogate_runs: int
    direct: tuple[DirectSearch, ...]

    @property
    def best(self) -> DirectSearch:
        """The best direct search of all seeds."""
        return min(self.direct, key=lambda item: item.optimum.best.objectives[0])

    @property
    def differences(self) -> tuple[PointDifference, ...]:
        """Factor by factor, surrogate against the best direct search (the paper's Table 8)."""
        space = self.best.optimum.space
        surrogate = space.point({name: self.surrogate_factors[name] for name in space.names})
        return compare_points(space, self.best.optimum.point, surrogate)

    @property
    def worse_pct(self) -> float:
        """How much higher the surrogate's true objective is than the best direct one, in percent of it."""
        best = self.best.optimum.best.objectives[0]
        return 100.0 * (self.surrogate_objective - best) / abs(best) if best else float("nan")

    def overview(self) -> dict[str, Any]:
        """What ``--json`` prints, and an entry of ``comparison.json``."""
        return {
            "search": self.search,
            "surrogate": {
                "factors": dict(self.surrogate_factors),
                "objective": self.surrogate_objective,
                "runs": self.surrogate_runs,
            },
            "direct": [item.overview() for item in self.direct],
            "differences": [
                {key: value if value == value else None for key, value in asdict(row).items()}
                for row in self.differences
            ],
            "objective_worse_pct": self.worse_pct if np.isfinite(self.worse_pct) else None,
        }


@dataclass(frozen=True)
class FrontComparison:
    """One search for a front: what the surrogate's runs know of it against direct searches of the simulator.

    Parameters
    ----------
    search : str
    surrogate : ndarray, shape (n, m)
        True objectives of the feasible design runs and verified points that no other dominates.
    surrogate_runs : int
        Runs made for them.
    direct : tuple of DirectSearch
        One per seed.
    """

    search: str
    surrogate: Floats
    surrogate_runs: int
    direct: tuple[DirectSearch, ...]

    @property
    def rows(self) -> list[dict[str, Any]]:
        """Who, runs, hypervolume in percent of that of all fronts together, and IGD+ against these."""
        fronts = {"surrogate": (self.surrogate, self.surrogate_runs)}
        for item in self.direct:
            values = np.array([candidate.objectives for candidate in item.optimum.front])
            fronts[f"direct, seed {item.seed}"] = (values, item.runs)
        everything = np.vstack([values for values, _ in fronts.values()])
        reference = everything[nondominated(everything)]
        ideal, nadir = reference.min(axis=0), reference.max(axis=0)
        whole = hypervolume(reference, ideal, nadir)
        return [
            {
                "who": who,
                "runs": runs,
                "points": len(values),
                "hypervolume_pct": 100.0 * hypervolume(values, ideal, nadir) / whole,
                "igd_plus": igd_plus(values, reference),
            }
            for who, (values, runs) in fronts.items()
        ]

    def overview(self) -> dict[str, Any]:
        """What ``--json`` prints, and an entry of ``comparison.json``."""
        return {"search": self.search, "fronts": self.rows}


def compare_with_direct(
    folder: StudyFolder,
    how: HowToRun | None = None,
    *,
    seeds: int = 1,
    on_event: Watcher | None = None,
    on_search: Callable[[DirectSearch], None] | None = None,
) -> list[DirectComparison | FrontComparison]:
    """Run the genetic algorithm of every search on the simulator itself, and compare.

    Every run goes through the journal, so an interrupted comparison goes on where it stopped. Writes
    ``comparison.json``.

    Raises
    ------
    StageError
        If nothing is verified yet, or only failed runs are.
    """
    study, verification = folder.study, folder.verification()
    comparisons: list[DirectComparison | FrontComparison] = []
    for verified in verification.searches:
        if verified.objective.actual is None:
            continue
        problem = simulator_problem(folder, verified.name, how, on_event=on_event)
        cost = runs_each(study, verified.name)
        direct = search_directly(
            pinned(problem, means) if (means := noise_means(study, verified.name)) else problem,
            search_options(study, verified.name),
            range(1, seeds + 1),
            runs_each=cost,
            on_search=on_search,
        )
        runs = verified.simulator_runs.design + cost * verified.simulator_runs.verification
        if len(verified.objectives) > 1:
            comparisons.append(
                FrontComparison(verified.name, _known_front(folder, problem, verified), runs, direct)
            )
            continue
        comparisons.append(
            DirectComparison(verified.name, verified.factors, verified.objective.actual, runs, direct)
        )
    if not comparisons:
        raise StageError("no search has a verified optimum, so there is nothing to compare")
    folder.keep_comparison([item.overview() for item in comparisons])
    return comparisons


def _known_front(folder: StudyFolder, problem: Problem, verified: Confirmation) -> Floats:
    """True objectives, shape (n, m), of the non-dominated design runs and verified points.

    Where objectives are over what varies, no single run of the design tells them.
    """
    flown = np.array(
        [
            [comparison.actual for comparison in point.objectives.values()]
            for point in verified.points
            if point.verdict != "FAILED"
        ]
    )
    values = flown
    if runs_each(folder.study, verified.name) == 1:
        runs = as_rates(folder.study, folder.fit_runs().usable)
        design = problem.evaluation(runs.points, {name: runs.y(name) for name in folder.study.responses})
        values = np.vstack([best_known(problem, design).objectives, flown])
    return values[nondominated(values)]
