"""Runs to the optimum of problems with several optima, constraints, failures, levels and categories.

    python benchmarks/search_unseen.py [--methods rsmkit4 rsmkit1 ...] [--seeds 1 2] [--problems branin ...]

Every method starts from the same Latin hypercube and may make 60 further runs; counted are the runs, in the
order asked for, until a feasible one lies within 0.1 % of the distance from the median over the box to the
least value known. A miss counts as 61. Methods: ``rsmkitN`` makes N runs at a time; ``cobyqa`` is the one of
scipy with restarts; ``ga`` a direct genetic algorithm; ``optuna`` its Gaussian-process sampler, where it is
installed.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from scipy.stats import qmc

from rsmkit import RefineOptions, build_problem, refine_problem
from rsmkit.language.space import Floats
from rsmkit.optimum.problem import Problem

sys.path.insert(0, str(Path(__file__).parent))
from unseen_problems import CASES, Case

BUDGET = 60
SHARE = 1e-3


class Done(Exception):
    """The target is reached, or the budget spent."""


class Counter:
    """A problem that counts its runs and knows when its optimum is reached."""

    def __init__(self, case: Case, seed: int) -> None:
        self.case, self.seed = case, seed
        self.problem = self._pose(case.simulator)
        cloud = self._points(qmc.Sobol(len(case.space), rng=3).random(2**13))
        known = self.problem.evaluate(cloud)
        feasible = known.succeeded & (known.margins >= 0).all(axis=1)
        self.target = case.best + SHARE * (float(np.median(known.objectives[feasible, 0])) - case.best)
        self.runs = 0
        self.reached: int | None = None
        self.counted = self._pose(self._simulate)
        self.design = self._points(qmc.LatinHypercube(len(case.space), rng=seed).random(case.start))

    def _pose(self, simulator: Callable[[Floats], dict[str, Floats]]) -> Problem:
        case = self.case
        return build_problem(
            case.space, case.minimize, simulator, responses=case.responses, subject_to=case.subject_to
        )

    def _points(self, unit: Floats) -> Floats:
        return np.column_stack([f.domain.from_unit(u) for f, u in zip(self.case.space, unit.T, strict=True)])

    def _simulate(self, points: Floats) -> dict[str, Floats]:
        known = self.problem.evaluate(points)
        good = (
            known.succeeded & (known.margins >= -1e-6).all(axis=1) & (known.objectives[:, 0] <= self.target)
        )
        if self.reached is None and good.any():
            self.reached = self.runs + int(good.argmax()) + 1
        self.runs += len(points)
        return known.responses

    def stop(self) -> None:
        """End a method that has nothing more to show."""
        if self.reached is not None or self.runs >= self.case.start + BUDGET:
            raise Done


def rsmkit_refine(counter: Counter, batch: int) -> None:
    start = counter.counted.evaluate(counter.design)
    counter.stop()
    options = RefineOptions(batch=batch, max_runs=BUDGET, seed=1)
    refine_problem(counter.counted, start, options, on_wave=lambda wave: counter.stop())


def penalised(counter: Counter, points: Floats) -> Floats:
    """One number for methods that take neither constraints nor failures."""
    known = counter.counted.evaluate(points)
    values = known.objectives[:, 0]
    top = float(np.nanmax(np.abs(values))) if np.isfinite(values).any() else 1.0
    missed = np.maximum(0.0, -np.nan_to_num(known.margins, nan=-1.0))
    found = np.nan_to_num(values, nan=2 * top) + 10 * top * missed.sum(axis=1)
    counter.stop()
    return found


def cobyqa(counter: Counter) -> None:
    """From the best design points in turn."""
    from scipy.optimize import minimize

    space, numeric = counter.case.space, counter.case.space.numeric
    values = penalised(counter, counter.design)
    bounds = list(zip(space.lows, space.highs, strict=True))
    for row in np.argsort(values):
        minimize(
            lambda x: float(penalised(counter, space.snap(space.clip(x[None])))[0]),
            counter.design[row],
            bounds=bounds,
            method="COBYQA",
            options={
                "maxfev": 200,
                "initial_tr_radius": 0.1 * float((space.highs - space.lows)[numeric].min()),
            },
        )


def ga(counter: Counter) -> None:
    """Pymoo's genetic algorithm, the design as its first generation."""
    from pymoo.algorithms.soo.nonconvex.ga import GA
    from pymoo.core.problem import Problem as PymooProblem
    from pymoo.optimize import minimize

    space = counter.case.space

    class Direct(PymooProblem):
        def __init__(self) -> None:
            super().__init__(n_var=len(space), n_obj=1, xl=space.lows, xu=space.highs)

        def _evaluate(self, x: Floats, out: dict[str, Floats], *args: object, **kwargs: object) -> None:
            out["F"] = penalised(counter, space.snap(x))[:, None]

    minimize(
        Direct(), GA(pop_size=len(counter.design), sampling=counter.design), ("n_gen", 50), seed=counter.seed
    )


def optuna(counter: Counter) -> None:
    """Its Gaussian-process sampler, one at a time, constraints given."""
    import optuna as peer

    peer.logging.set_verbosity(peer.logging.ERROR)
    space = counter.case.space
    sampler = peer.samplers.GPSampler(
        seed=counter.seed,
        n_startup_trials=1,
        constraints_func=(lambda trial: trial.user_attrs["missed"]) if counter.case.subject_to else None,
    )
    study = peer.create_study(sampler=sampler)
    for point in counter.design:
        study.enqueue_trial({f.name: f.value(float(x)) for f, x in zip(space, point, strict=True)})

    def objective(trial: peer.Trial) -> float:
        values = {}
        for factor in space:
            if factor.levels:
                values[factor.name] = trial.suggest_categorical(factor.name, list(factor.levels))
            elif factor.integer:
                values[factor.name] = trial.suggest_int(factor.name, int(factor.low), int(factor.high))
            else:
                values[factor.name] = trial.suggest_float(factor.name, factor.low, factor.high)
        known = counter.counted.evaluate(space.point(values)[None])
        counter.stop()
        if not known.succeeded[0]:
            raise peer.TrialPruned
        trial.set_user_attr("missed", (-known.margins[0]).tolist())
        return float(known.objectives[0, 0])

    study.optimize(objective, n_trials=counter.case.start + BUDGET)


METHODS: dict[str, Callable[[Counter], None]] = {
    "rsmkit1": lambda counter: rsmkit_refine(counter, 1),
    "rsmkit4": lambda counter: rsmkit_refine(counter, 4),
    "rsmkit16": lambda counter: rsmkit_refine(counter, 16),
    "cobyqa": cobyqa,
    "ga": ga,
}
if find_spec("optuna"):
    METHODS["optuna"] = optuna


def runs_of(method: str, name: str, seed: int) -> tuple[int | None, float, int]:
    """Further runs to the target or None, CPU seconds a run, runs made."""
    counter = Counter(CASES[name], seed)
    began = time.process_time()
    with suppress(Done):
        METHODS[method](counter)
    spent = time.process_time() - began
    case = CASES[name]
    allowed = counter.reached is not None and counter.reached <= case.start + BUDGET
    further = max(1, counter.reached - case.start) if allowed and counter.reached else None
    return further, spent / max(1, counter.runs - case.start), counter.runs


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--methods", nargs="+", default=list(METHODS))
    parser.add_argument("--seeds", nargs="+", type=int, default=[1, 2, 3, 4, 5])
    parser.add_argument("--problems", nargs="+", default=list(CASES))
    wanted = parser.parse_args()
    for method in wanted.methods:
        counts, cost = [], []
        print(f"{method}: further runs to 0.1 % for seeds {' '.join(map(str, wanted.seeds))}")
        for name in wanted.problems:
            found = [runs_of(method, name, seed) for seed in wanted.seeds]
            counts += [further for further, _, _ in found]
            cost += [seconds for _, seconds, _ in found]
            print(f"  {name:16} {' '.join('-' if c is None else str(c) for c, _, _ in found)}", flush=True)
        reached = sum(count is not None for count in counts)
        mean = np.exp(np.mean(np.log([61 if count is None else count for count in counts])))
        print(
            f"  reached {reached} of {len(counts)}; geometric mean {mean:.1f}, a miss counting as 61; "
            f"{np.mean(cost):.2f} CPU s a run\n",
            flush=True,
        )


if __name__ == "__main__":
    main()
