"""Simulations to the true optimum of the re-entry vehicle: refinement against the direct genetic algorithm.

    python benchmarks/search_reentry.py [--seeds 10] [--keep FOLDER]

The true optimum comes from an exhaustive search: flights on a grid over the whole box, then local searches
from its best places far from each other. Every method is judged by the number of different flights until one
inside the bounds lies within 0.1 % of it, once per seed. Flights are kept in FOLDER as they are made, so an
interrupted benchmark goes on where it stopped. Writes ``studies/reentry/flights/simulations.json``, from
which the study's RESULTS.md takes its table.
"""

from __future__ import annotations

import argparse
import hashlib
import itertools
import json
import math
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from rsmkit import RefineOptions, SearchOptions, Study, load_study, refine_problem, search_directly
from rsmkit.design.build import build_design
from rsmkit.io.json_codec import write_json
from rsmkit.language.space import Floats
from rsmkit.optimum.evaluation_cache import CachedEvaluator
from rsmkit.optimum.local.local_search import LocalSearch
from rsmkit.optimum.local.polish import polish
from rsmkit.optimum.problem import Archive
from rsmkit.study.posing import pose
from rsmkit.verification.direct_search import runs_to_reach
from sim import evaluate
from sim.core.compiled import MACHINE_CODE

STUDY = Path(__file__).parents[1] / "studies" / "reentry"
RESULTS = STUDY / "flights" / "simulations.json"
OBJECTIVES = ("table1", "table9")
GRID = 9
STARTS = 6
TARGET = 1e-3
PROCESSORS = 16


class Flights:
    """Responses at natural points, shape (n, k); every flight is made once and appended to a file."""

    def __init__(self, study: Study, folder: Path) -> None:
        self._space, self._names = study.space, study.responses
        self._settings = study.file.simulator.settings if study.file.simulator else {}
        made_from = json.dumps(self._settings, sort_keys=True) + MACHINE_CODE.folder.name
        self._path = folder / f"flights-{hashlib.sha256(made_from.encode()).hexdigest()[:12]}.jsonl"
        lines = self._path.read_text().splitlines() if self._path.exists() else []
        self._known = {tuple(point): values for point, values in map(json.loads, lines)}

    def __call__(self, points: Floats) -> dict[str, Floats]:
        """Responses by name, each shape (n,)."""
        rows = [self._fly(tuple(point)) for point in points.tolist()]
        return dict(zip(self._names, np.array(rows).T, strict=True))

    def _fly(self, point: tuple[float, ...]) -> list[float]:
        if point not in self._known:
            flown = evaluate(**self._space.values(np.array(point)), **self._settings)
            self._known[point] = [flown[name] for name in self._names]
            with self._path.open("a") as file:
                file.write(json.dumps([point, self._known[point]]) + "\n")
        return self._known[point]


def exhaustive(study: Study, name: str, flights: Flights) -> dict[str, Any]:
    """The true optimum: the best of a full grid, and of local searches from its best places far apart."""
    about = pose(study, name, flights)
    axes = [np.linspace(factor.low, factor.high, GRID) for factor in study.space]
    grid = np.array(list(itertools.product(*axes)))
    archive = Archive(about)
    known = archive.evaluate(grid)
    found = polish(archive, LocalSearch(starts=STARTS, distance=0.2, method="cobyqa", tolerance=1e-5))
    feasible = archive.violation(known) == 0.0
    return {
        "factors": study.space.values(found.points[0]),
        "objective": float(found.objectives[0, 0]),
        "grid_points": len(grid),
        "grid_best": float(known.objectives[feasible, 0].min()),
        "local_searches": STARTS,
        "flights": archive.count,
    }


def refined(
    study: Study, name: str, flights: Flights, seed: int, target: float, *, runs: int, star: Any
) -> tuple[Floats, list[int]]:
    """True objectives in the order they were flown (inf outside the bounds), and the sizes of the batches."""
    design = build_design(study.space, replace(study.file.design, star=star, augment_to=runs, seed=seed))
    points = np.unique(design.points, axis=0)
    cached = CachedEvaluator(flights, study.space)
    about = pose(study, name, cached)
    refine_problem(about, about.evaluate(points), RefineOptions(max_runs=120 - len(points), seed=seed))
    history = about.evaluation(*cached.history())
    inside = study.space.contains(history.points) & (history.margins >= 0).all(axis=1)
    return np.where(inside, history.objectives[:, 0], np.inf), cached.batches


def direct(study: Study, name: str, flights: Flights, seed: int, target: float) -> tuple[Floats, list[int]]:
    """The same of the genetic algorithm of 24 x 45 flights and its polish, cut off once it is there.

    Its first generations are the same however many follow.
    """
    for generations in (6, 12, 24, 45):
        options = SearchOptions(name, generations=generations, polish=generations == 45)
        (found,) = search_directly(pose(study, name, flights), options, [seed])
        if found.objectives.min() <= target:
            break
    return found.objectives, list(found.batches)


def waves_until(batches: list[int], run: int) -> int:
    """Rounds of parallel flights until flight number `run` (from 1) has been made."""
    waves = 0
    for size in batches:
        if run <= size:
            return waves + math.ceil(run / PROCESSORS)
        run -= size
        waves += math.ceil(size / PROCESSORS)
    raise ValueError("more flights than were made")


METHODS: dict[str, Callable[..., tuple[Floats, list[int]]]] = {
    "50 points, then refinement": lambda *a: refined(*a, runs=50, star="circumscribed"),
    "the CCD alone, then refinement": lambda *a: refined(*a, runs=15, star="circumscribed"),
    "the CCD inside the bounds, then refinement": lambda *a: refined(*a, runs=15, star="inscribed"),
    "direct GA, 24 x 45, and polish": direct,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--keep", type=Path, default=Path(tempfile.gettempdir()))
    arguments = parser.parse_args()
    study = load_study(STUDY)
    flights = Flights(study, arguments.keep)
    optima = {name: exhaustive(study, name, flights) for name in OBJECTIVES}
    print(json.dumps(optima, indent=1), flush=True)
    rows = []
    for (method, search), name in itertools.product(METHODS.items(), OBJECTIVES):
        for seed in range(1, arguments.seeds + 1):
            best = optima[name]["objective"]
            target = best + TARGET * abs(best)
            objectives, batches = search(study, name, flights, seed, target)
            hit = runs_to_reach(objectives, target)
            rows.append(
                {
                    "objective": name,
                    "method": method,
                    "seed": seed,
                    "flights_to_target": hit,
                    "waves_to_target": None if hit is None else waves_until(batches, hit),
                }
            )
            print(json.dumps(rows[-1]), flush=True)
            write_json(RESULTS, {"optima": optima, "processors": PROCESSORS, "searches": rows})


if __name__ == "__main__":
    main()
