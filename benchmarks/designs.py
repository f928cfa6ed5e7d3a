"""Optimal designs: efficiency and time beside other packages.

    python benchmarks/designs.py           # our designs, the peers that are installed, the recorded peers

Efficiency is relative to the best design known (``BEST``, from ``tests/data/design/best_known.csv``); time is
CPU seconds of the call, compilation and imports excluded. Recorded rows come from
``tests/data/design/peers.csv``: one thread of a similar machine.
"""

import csv
import math
import time
import warnings
from pathlib import Path

import numpy as np

from rsmkit.design.composite import ccd
from rsmkit.design.optimal import augment, optimal_design
from rsmkit.design.region import box
from rsmkit.space import Factor, Space
from rsmkit.terms import full_terms

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
    stars = ccd(space(3))
    return {
        "augA": lambda seed: augment(stars, 50, region=box(stars.space, REACH), seed=seed),
        "augA_I": lambda seed: augment(stars, 50, region=box(stars.space, REACH), criterion="I", seed=seed),
        "augB": lambda seed: augment(stars, 50, seed=seed),
        "k3n50D": lambda seed: optimal_design(space(3), 50, seed=seed),
        "k5D": lambda seed: optimal_design(space(5), 30, seed=seed),
        "k5D, one start": lambda seed: optimal_design(space(5), 30, starts=1, seed=seed),
        "k5I": lambda seed: optimal_design(space(5), 30, criterion="I", seed=seed),
        "k10D": lambda seed: optimal_design(space(10), 100, seed=seed),
        "k10I": lambda seed: optimal_design(space(10), 100, criterion="I", seed=seed),
    }


def efficiency(points, task):
    """Percent of the best known, recomputed from the points alone."""
    name = task.split(",")[0]
    terms = full_terms(points.shape[1])
    X = terms.matrix(points)
    if not name.endswith("I"):
        return 100 * math.exp((np.linalg.slogdet(X.T @ X)[1] - BEST[name]) / terms.p)
    powers = np.array(terms.exponents)[:, None, :] + np.array(terms.exponents)[None, :, :]
    reach = REACH if name.startswith("aug") else 1.0
    moments = np.where(powers % 2 == 0, reach**powers / (powers + 1.0), 0.0).prod(axis=2)
    return 100 * BEST[name] / float((np.linalg.inv(X.T @ X) * moments).sum())


def recorded():
    with open(DATA / "peers.csv", newline="") as stream:
        rows = [row for row in csv.DictReader(stream) if row["eff_vs_best_pct_median"]]
    return {task: [row for row in rows if row["task"] == task] for task in BEST}


def pydoe3_design():
    """The one peer that is always installed: five factors, 30 runs, its defaults."""
    from pyDOE3.doe_optimal import optimal_design as peer

    levels = np.stack(np.meshgrid(*[[-1.0, 0.0, 1.0]] * 5, indexing="ij"), axis=-1).reshape(-1, 5)
    with warnings.catch_warnings(action="ignore"):
        design, _ = peer(candidates=levels, n_points=30, degree=2, criterion="D")
    return np.asarray(design)


def main():
    optimal_design(space(2), 8, criterion="I")  # compile
    peers = recorded()
    print(f"{'task':16s} {'program':22s} {'efficiency %':>24s} {'CPU s':>8s}  hits")
    for task, make in tasks().items():
        found, seconds = [], []
        for seed in SEEDS:
            start = time.process_time()
            found.append(make(seed))
            seconds.append(time.process_time() - start)
        reached = sorted(efficiency(design.coded, task) for design in found)
        hits = ", ".join(f"{d.found.hits}/{d.found.starts}" for d in found)
        span = f"{reached[1]:.3f} ({reached[0]:.3f}-{reached[-1]:.3f})"
        print(f"{task:16s} {'rsmkit':22s} {span:>24s} {sorted(seconds)[1]:8.3f}  {hits}")
        if task == "k5D":
            start = time.process_time()
            value = efficiency(pydoe3_design(), task)
            print(f"{'':16s} {'pyDOE3 (now)':22s} {value:24.3f} {time.process_time() - start:8.3f}")
        for row in peers.get(task, []):
            shown = f"{float(row['eff_vs_best_pct_median']):.3f}"
            print(
                f"{'':16s} {row['peer'] + ' (recorded)':22s} {shown:>24s} {float(row['seconds_median']):8.3f}"
            )
    start = time.process_time()
    design = optimal_design(space(20), 300)
    spent = time.process_time() - start
    print(
        f"{'k20 n300 D':16s} {'rsmkit':22s} {design.quality().d_bound_efficiency:16.2f} of bound {spent:8.1f}"
    )


if __name__ == "__main__":
    main()
