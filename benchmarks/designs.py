"""Optimal designs: efficiency and time beside other packages.

    python benchmarks/designs.py           # our designs, the peers that are installed, the recorded peers
    python benchmarks/designs.py seeds 10  # spread over ten seeds, k = 2 to 10, n = p, p + 1, p + 4, 2 p

Efficiency is relative to the best design known (``BEST``, from ``tests/data/design/best_known.csv``); time is
CPU seconds of the call, compilation and imports excluded. Recorded rows come from
``tests/data/design/peers.csv``: one thread of a similar machine. Beside every peer stands what we need for
the efficiency it reaches: the call with the fewest starts that does (median of the seeds).

pyoptex and process-improve run when they can be imported; they are no dependencies of the project.
"""

import contextlib
import csv
import importlib.util
import io
import math
import sys
import time
import warnings
from pathlib import Path

import numpy as np

from rsmkit import Factor, Space, assess, augment, box, ccd, full_terms, optimal_design

DATA = Path(__file__).parents[1] / "tests/data/design"
SEEDS = (1, 2, 3)
REACH = 8**0.25
BEST = {  # log det X'X, or the average prediction variance over the box
    "augA": 46.116542340969076,
    "augA_I": 0.1125188828780357,
    "augB": 34.42673550520148,
    "k3n50D": 31.644179,
    "k5D": 56.348739,
    "k5I": 0.3266571,
    "k10D": 264.884879,
    "k10I": 0.2511819,
}


def space(k):
    return Space(Factor(f"x{j + 1}", -1.0, 1.0) for j in range(k))


def tasks():
    """Name -> a search from (seed, most starts)."""
    stars = ccd(space(3))
    wide = {"region": box(stars.space, REACH)}
    return {
        "augA": lambda **how: augment(stars, 50, **wide, **how),
        "augA_I": lambda **how: augment(stars, 50, criterion="I", **wide, **how),
        "augB": lambda **how: augment(stars, 50, **how),
        "k3n50D": lambda **how: optimal_design(space(3), 50, **how),
        "k5D": lambda **how: optimal_design(space(5), 30, **how),
        "k5I": lambda **how: optimal_design(space(5), 30, criterion="I", **how),
        "k10D": lambda **how: optimal_design(space(10), 100, **how),
        "k10I": lambda **how: optimal_design(space(10), 100, criterion="I", **how),
    }


def efficiency(points, task):
    """Percent of the best known."""
    reach = REACH if task.startswith("aug") else 1.0
    return relative(points, "I" if task.endswith("I") else "D", BEST[task], reach)


def relative(points, criterion, best, reach=1.0):
    """Efficiency in percent of a known value, recomputed from the points alone."""
    terms = full_terms(points.shape[1])
    X = terms.matrix(points)
    if criterion == "D":
        return 100 * math.exp((np.linalg.slogdet(X.T @ X)[1] - best) / terms.p)
    if criterion == "A":
        return 100 * best / float(np.trace(np.linalg.inv(X.T @ X)))
    powers = np.array(terms.exponents)[:, None, :] + np.array(terms.exponents)[None, :, :]
    moments = np.where(powers % 2 == 0, reach**powers / (powers + 1.0), 0.0).prod(axis=2)
    return 100 * best / float((np.linalg.inv(X.T @ X) * moments).sum())


def recorded():
    with open(DATA / "peers.csv", newline="") as stream:
        rows = [row for row in csv.DictReader(stream) if row["eff_vs_best_pct_median"]]
    return {task: [row for row in rows if row["task"] == task] for task in BEST}


def pydoe3(k, runs, criterion, seed):
    """The one peer that is always installed, with its defaults."""
    from pyDOE3.doe_optimal import optimal_design as peer

    levels = np.stack(np.meshgrid(*[[-1.0, 0.0, 1.0]] * k, indexing="ij"), axis=-1).reshape(-1, k)
    with warnings.catch_warnings(action="ignore"):
        design, _ = peer(candidates=levels, n_points=runs, degree=2, criterion=criterion)
    return np.asarray(design)


def pyoptex(k, runs, criterion, seed):
    """Ten tries, its three default levels."""
    from pyoptex.doe.fixed_structure import (
        Factor,
        create_fixed_structure_design,
        create_parameters,
        default_fn,
    )
    from pyoptex.doe.fixed_structure.metric import Dopt, Iopt
    from pyoptex.utils.model import model2Y2X, partial_rsm_names

    factors = [Factor(f"x{j + 1}", type="continuous") for j in range(k)]
    model = model2Y2X(partial_rsm_names({factor.name: "quad" for factor in factors}), factors)
    goal = default_fn(factors, (Iopt if criterion == "I" else Dopt)(), model)
    np.random.seed(seed)  # noqa: NPY002 - its generator is the global one
    tries = 10 if k < 10 else 2
    with contextlib.redirect_stderr(io.StringIO()):
        design, _ = create_fixed_structure_design(create_parameters(factors, goal, nruns=runs), n_tries=tries)
    return design.to_numpy(float)


def process_improve(k, runs, criterion, seed):
    """Its defaults for a quadratic model."""
    from process_improve.experiments.designs import generate_design
    from process_improve.experiments.factor import Factor

    factors = [Factor(name=f"x{j + 1}", low=-1.0, high=1.0) for j in range(k)]
    found = generate_design(
        factors,
        f"{criterion.lower()}_optimal",
        budget=runs,
        model_type="quadratic",
        n_center_points=0,
        random_state=seed,
    )
    return np.asarray(found.design[[factor.name for factor in factors]], float)


PEERS = {"pyDOE3": pydoe3, "pyoptex": pyoptex, "process_improve": process_improve}
FROM_SCRATCH = {"k3n50D": (3, 50), "k5D": (5, 30), "k5I": (5, 30), "k10D": (10, 100)}


def timed(make):
    start = time.process_time()
    design = make()
    return design, time.process_time() - start


def median(values):
    ordered = sorted(values)
    return ordered[len(ordered) // 2]


def time_to_reach(make, task, target):
    """CPU seconds of the call with the fewest starts that is as efficient (median of the seeds), or None."""
    spent = []
    for seed in SEEDS:
        for starts in range(1, 101):
            design, seconds = timed(lambda: make(seed=seed, starts=starts))  # noqa: B023 - called at once
            if efficiency(design.coded, task) >= target - 5e-4:  # recorded to three decimals
                spent.append(seconds)
                break
    return median(spent) if len(spent) == len(SEEDS) else None


def live(task):
    """(peer, efficiency, seconds) of the peers that are installed."""
    if task not in FROM_SCRATCH:
        return
    k, runs = FROM_SCRATCH[task]
    for name, run in PEERS.items():
        if importlib.util.find_spec(name) is None or (name == "pyDOE3" and task != "k5D"):
            continue
        if name == "process_improve" and k == 10:
            continue  # minutes
        run(2, 8, task[-1], 0)  # compile
        found = [timed(lambda: run(k, runs, task[-1], seed)) for seed in SEEDS]  # noqa: B023
        yield (
            f"{name} (now)",
            median(efficiency(points, task) for points, _ in found),
            median(seconds for _, seconds in found),
        )


def seeds(count):
    """Worst and median of so many seeds against the best of all searches known."""
    optimal_design(space(2), 8, criterion="I")  # compile
    print("criterion k n: worst and median efficiency %, hits of the best start (median), CPU s (median)")
    with open(DATA / "best_found.csv", newline="") as stream:
        rows = list(csv.DictReader(stream))
    for row in rows:
        k, runs, criterion = int(row["k"]), int(row["n"]), row["criterion"]
        found = [
            timed(lambda: optimal_design(space(k), runs, criterion=criterion, seed=seed))  # noqa: B023
            for seed in range(1, count + 1)
        ]
        reached = [relative(design.coded, criterion, float(row["value"])) for design, _ in found]
        hits = median(design.found.hits for design, _ in found)
        starts = median(design.found.starts for design, _ in found)
        spent = median(seconds for _, seconds in found)
        efficiencies = f"{min(reached):7.3f} {median(reached):7.3f}"
        print(f"{criterion} {k:2d} {runs:3d}: {efficiencies} {hits}/{starts} {spent:.2f}", flush=True)


def main():
    optimal_design(space(2), 8, criterion="I")  # compile
    peers = recorded()
    print(f"{'task':8s} {'program':28s} {'efficiency %':>12s} {'CPU s':>8s} {'we need':>8s}")
    for task, make in tasks().items():
        results = [timed(lambda: make(seed=seed)) for seed in SEEDS]  # noqa: B023
        worst, *_ = sorted(efficiency(design.coded, task) for design, _ in results)
        hits = ", ".join(f"{design.found.hits}/{design.found.starts}" for design, _ in results)
        middle = median(efficiency(design.coded, task) for design, _ in results)
        spent = median(seconds for _, seconds in results)
        print(f"{task:8s} {'rsmkit':28s} {middle:12.3f} {spent:8.3f}    least {worst:.3f}; hits {hits}")
        others = list(live(task)) + [
            (f"{row['peer']} (recorded)", float(row["eff_vs_best_pct_median"]), float(row["seconds_median"]))
            for row in peers.get(task, [])
        ]
        for name, reached, seconds in others:
            if reached > 1.0:
                needed = time_to_reach(make, task, reached)
                ours = "never" if needed is None else f"{needed:.3f}"
                print(f"{'':8s} {name:28s} {reached:12.3f} {seconds:8.3f} {ours:>8s}", flush=True)
            else:
                print(f"{'':8s} {name:28s} {'singular':>12s} {seconds:8.3f}", flush=True)
    design, spent = timed(lambda: optimal_design(space(20), 300))
    print(f"k = 20, n = 300: {assess(design).d_bound_efficiency:.2f} % of the bound in {spent:.1f} s")


if __name__ == "__main__":
    if sys.argv[1:2] == ["seeds"]:
        seeds(int(sys.argv[2]))
    else:
        main()
