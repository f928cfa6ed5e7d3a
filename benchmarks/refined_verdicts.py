"""Are refined verdicts right? The studies of ``verdicts.py``, refined with the default settings.

    python benchmarks/refined_verdicts.py [words of studies ...]

The optimum is *reached* when the best run, without its noise, satisfies every constraint and is within the
tolerance (2 % of the larger of value and spread) of the least value anywhere; with noise a standard deviation
of one run is allowed for. SETTLED is right when it is reached. What may still be gained *holds* when the
least value anywhere is no further below the best run than was said. A front is reached when it dominates 95 %
of the volume that the front without noise does.
"""

from __future__ import annotations

import logging
import sys
import tempfile
import time
from collections import defaultdict
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize
from scipy.stats import qmc
from verdict_studies import STUDIES, SmallStudy
from verdicts import TOLERANCE, evaluator, fitted_study

from rsmkit.language.space import Floats
from rsmkit.optimum.pareto_front import hypervolume
from rsmkit.optimum.problem import Problem, least_margins
from rsmkit.optimum.search import search_problem
from rsmkit.runs.how_to_run import HowToRun
from rsmkit.stages.refine import refine_study
from rsmkit.study.posing import noise_means, pose, search_options


@dataclass(frozen=True)
class Refined:
    """One refinement: what was said, and what is true; None where it was not said or cannot be."""

    family: str
    study: str
    verdict: str
    sentence: str
    runs: int
    reached: bool
    holds: bool | None


def refined(study: SmallStudy, seed: int) -> Refined:
    """Refine one study and compare what is said with what is true."""
    with tempfile.TemporaryDirectory() as place:
        how = HowToRun(jobs=1)
        folder = fitted_study(study, seed, place, how)
        result = refine_study(folder, how)
        found, told = result.refinements["s"], result.verdicts["s"]
        problem = pose(folder.study, "s", evaluator(folder, folder.simulator.load()))
        best = problem.evaluate(found.best.points)
        design = problem.evaluate(folder.fitted().runs.points)
        reached, holds = False, None
        feasible = bool(best.succeeded[0] and (best.margins[0] >= least_margins(design) - _room(study)).all())
        if len(problem.objectives) > 1:
            optimum = search_problem(problem, search_options(folder.study, "s"))
            true = np.array([c.objectives for c in optimum.candidates])
            front = problem.evaluate(found.result.front.points).objectives if found.result.front else true[:0]
            ideal, nadir = true.min(axis=0), true.max(axis=0)
            reached = bool(len(front)) and hypervolume(front, ideal, nadir) >= 0.95 * hypervolume(
                true, ideal, nadir
            )
        elif noise_means(folder.study, "s"):
            reached = told.verdict == "SETTLED"  # its truth is an integral over the noise factors
        else:
            least = _least(problem)
            value = float(best.objectives[0, 0])
            alive = design.objectives[design.succeeded, 0]
            scale = max(abs(value), float(np.median(alive) - alive.min()))
            noise = study.noise[0] if study.noise else 0.0
            worthless = "desirability" in study.search and value >= 0.0
            if least is not None:
                reached = feasible and not worthless and value <= least + TOLERANCE * scale + noise
                gain = found.result.remaining_gain
                if gain is not None and told.verdict == "SETTLED":
                    holds = value - least <= gain + 1e-9 * scale
        return Refined(study.family, study.name, told.verdict, told.sentence, found.runs, reached, holds)


def _room(study: SmallStudy) -> float:
    """Two standard deviations of the largest noise of a response in a constraint."""
    return 2.0 * max(study.noise[1:], default=0.0)


def _least(problem: Problem) -> float | None:
    """Least feasible objective without noise: a fine grid, and descents from its best places."""
    space = problem.space
    unit = qmc.Sobol(len(space), seed=1).random(2**13)
    corners = np.array(np.meshgrid(*[[0.0, 0.5, 1.0]] * len(space))).reshape(len(space), -1).T
    points = np.column_stack(
        [
            f.domain.from_unit(np.clip(u, 0, 1 - 1e-12))
            for f, u in zip(space, np.vstack([unit, corners]).T, strict=True)
        ]
    )
    known = problem.evaluate(points)
    allowed = known.succeeded & (known.margins >= -1e-9).all(axis=1)
    if not allowed.any():
        return None
    values = np.where(allowed, known.objectives[:, 0], np.inf)
    best = float(values.min())
    free = np.array([not f.levels for f in space])
    for row in np.argsort(values)[:6]:
        start = points[row]

        def penalised(z: Floats, start: Floats = start) -> float:
            x = start.copy()
            x[free] = np.clip(z, space.lows[free], space.highs[free])
            one = problem.evaluate(x[None])
            if not one.succeeded[0] or (one.margins[0] < -1e-9).any():
                return 1e9
            return float(one.objectives[0, 0])

        if free.any():
            best = min(
                best,
                float(
                    minimize(
                        penalised,
                        start[free],
                        method="Nelder-Mead",
                        options={"xatol": 1e-7, "fatol": 1e-12, "maxiter": 600},
                    ).fun
                ),
            )
    return best


def main() -> None:
    """Run all studies, or those whose name or family holds one of the words, and print the table."""
    logging.getLogger("rsmkit").setLevel(logging.ERROR)
    words = sys.argv[1:]
    results: list[Refined] = []
    for study in STUDIES:
        if words and not any(word in f"{study.family} {study.name}" for word in words):
            continue
        for seed in study.seeds:
            began = time.process_time()
            item = refined(study, seed)
            results.append(item)
            wrong = (item.verdict == "SETTLED") != item.reached or item.holds is False
            mark = "!!" if wrong and item.verdict == "SETTLED" else " ?" if wrong else "  "
            cost = time.process_time() - began
            print(
                f"{mark} {item.family}, {item.study}: {item.runs} runs, {cost:.1f} s: "
                f"{item.verdict}: {item.sentence}",
                flush=True,
            )
    families = defaultdict(list)
    for item in results:
        families[item.family].append(item)
    heads = ("studies", "SETTLED", "these right", "reached", "these said", "gains stated", "these hold")
    print(f"\n| | {' | '.join(heads)} |")
    print("|---|---|---|---|---|---|---|---|")
    for name, items in [*families.items(), ("all", results)]:
        said = [item for item in items if item.verdict == "SETTLED"]
        reached = [item for item in items if item.reached]
        stated = [item for item in items if item.holds is not None]
        row = (
            len(items),
            len(said),
            sum(item.reached for item in said),
            len(reached),
            sum(item.verdict == "SETTLED" for item in reached),
            len(stated),
            sum(bool(item.holds) for item in stated),
        )
        print(f"| {name} | {' | '.join(map(str, row))} |")


if __name__ == "__main__":
    main()
