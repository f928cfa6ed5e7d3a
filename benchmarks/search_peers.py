"""Simulations to the optimum of six smooth functions: refinement against SMT's EGO and scikit-optimize.

    python benchmarks/search_peers.py [instances]

Boxes with edges moved by up to 8 %, up to four per function, as in
``tests/validation/verification/test_refine_benchmark.py``. Every method gets the same 15-point composite
design and then makes its runs one at a time, rsmkit also four at a time; counted are all runs until one is
within 0.1 % of the distance from the median over the box to the optimum, 60 at most. A peer that is not
installed is left out (``pip install smt scikit-optimize``).
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from scipy.optimize import minimize
from scipy.stats import qmc

from rsmkit import RefineOptions, build_problem, refine_problem
from rsmkit.design.build import build_design
from rsmkit.design.families.registry import design_options
from rsmkit.language.space import Floats
from rsmkit.verification.direct_search import runs_to_reach

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "validation" / "verification"))
from test_refine_benchmark import FUNCTIONS, SPACE

BUDGET = 60
Simulator = Callable[[Floats], Floats]


def rsmkit_refine(simulator: Simulator, start: Floats, seed: int, batch: int) -> None:
    """``rsmkit verify --refine`` from the design."""
    problem = build_problem(SPACE, "f", lambda p: {"f": simulator(p)}, responses=["f"])
    options = RefineOptions(batch=batch, max_runs=BUDGET - len(start), seed=1 + seed)
    refine_problem(problem, problem.evaluate(start), options)


def smt_ego(simulator: Simulator, start: Floats, seed: int) -> None:
    """SMT's efficient global optimisation: Kriging with its defaults, expected improvement."""
    from smt.applications import EGO
    from smt.design_space import DesignSpace
    from smt.surrogate_models import KRG

    space = DesignSpace([(0.0, 1.0)] * 3, seed=seed)
    kriging = KRG(design_space=space, print_global=False)
    ego = EGO(
        xdoe=start, n_iter=BUDGET - len(start), criterion="EI", surrogate=kriging, n_start=20, seed=seed
    )
    ego.optimize(fun=lambda points: simulator(np.atleast_2d(points))[:, None])


def skopt_gp(simulator: Simulator, start: Floats, seed: int) -> None:
    """scikit-optimize's Bayesian optimisation with its defaults."""
    from skopt import gp_minimize

    gp_minimize(
        lambda x: float(simulator(np.array([x]))[0]),
        [(0.0, 1.0)] * 3,
        n_calls=BUDGET,
        n_initial_points=0,
        x0=start.tolist(),
        random_state=seed,
    )


METHODS: dict[str, Callable[[Simulator, Floats, int], None]] = {
    "rsmkit, 1 at a time": lambda f, x, s: rsmkit_refine(f, x, s, 1),
    "rsmkit, 4 at a time": lambda f, x, s: rsmkit_refine(f, x, s, 4),
}
if find_spec("smt"):
    METHODS["SMT EGO"] = smt_ego
if find_spec("skopt"):
    METHODS["scikit-optimize"] = skopt_gp


class Reached(Exception):
    """The target has been seen: no further run is of interest."""


def count(function: Simulator, instance: int, method: Callable[..., None], start: Floats) -> int | None:
    """Runs of one method until the target; None when it is not reached."""
    rng = np.random.default_rng(1000 + instance)
    low, high = rng.uniform(-0.08, 0.08, 3), 1 + rng.uniform(-0.08, 0.08, 3)

    def response(points: Floats) -> Floats:
        return function(low + np.asarray(points, float) * (high - low))

    cloud = qmc.Sobol(3, rng=0).random(2**13)
    values = response(cloud)
    best = min(
        minimize(lambda u: response(u[None])[0], cloud[row], bounds=[(0, 1)] * 3, tol=1e-13).fun
        for row in np.argsort(values)[:8]
    )
    target = best + 1e-3 * (np.median(values) - best)
    seen = list(response(start))

    def simulator(points: Floats) -> Floats:
        found = response(points)
        if not all((start == point).all(axis=1).any() for point in np.atleast_2d(points)):
            seen.extend(found)
        if min(seen) <= target:
            raise Reached
        return found

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            method(simulator, start, instance)
    except Reached:
        pass
    return runs_to_reach(np.array(seen), target)


def main() -> None:
    instances = int(sys.argv[1]) if len(sys.argv) > 1 else 4
    start = build_design(SPACE, design_options(star="inscribed", center=1)).points
    names = [function.__name__.replace("_", " ") for function in FUNCTIONS]
    print(f"| method | {' | '.join(names)} | reached | geometric mean |")
    print("|---|" + "---|" * (len(names) + 2))
    for label, method in METHODS.items():
        counts = [[count(f, i, method, start) for i in range(instances)] for f in FUNCTIONS]
        every = [BUDGET if n is None else n for row in counts for n in row]
        missed = sum(n is None for row in counts for n in row)
        medians = [float(np.median([BUDGET if n is None else n for n in row])) for row in counts]
        cells = [f"{m:g}" if m < BUDGET else f"> {BUDGET}" for m in medians]
        mean = np.exp(np.mean(np.log(every)))
        print(
            f"| {label} | {' | '.join(cells)} | {len(every) - missed}/{len(every)} | {mean:.0f} |", flush=True
        )


if __name__ == "__main__":
    main()
