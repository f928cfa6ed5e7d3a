"""Processor time of plan, fit and verify for a study of some size, and of the choice among all models.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/stages_cost.py [study] [wide] [eight]

study   60 optimal points in 6 factors, one of them a category of three levels, 4 responses, model = "auto":
        plan, fit, and verify with one run of a simulator that takes no time.
wide    the choice for 200 runs in 10 factors.
eight   the choice for 90 runs in 8 factors.

Without words all three. Each line has processor seconds, all threads and children together, and their ratio
to one fit of the plain quadratic to the same runs, with its report, measured in the same process.
"""

import os
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import rsmkit as rk

SIMULATOR = '''"""Four smooth responses of five numbers and a category."""

import math


def work(a, b, c, d, e, tool):
    """Return them."""
    shift = {"x": 0.0, "y": 0.6, "z": -0.4}[tool]
    return {
        "heat": math.exp(0.4 * a) + b * b + 0.3 * c * d + shift,
        "drag": 1.0 / (1.5 + 0.5 * a - 0.3 * b) + 0.2 * e + shift * c,
        "mass": 3.0 + a + 0.5 * b - 0.2 * c + 0.1 * d + shift,
        "wave": math.sin(2.0 * a) + 0.5 * d * d + e + shift,
    }
'''
STUDY = """[simulator]
run           = "simulator:work"
deterministic = true

[factors]
a = { low = -1.0, high = 1.0 }
b = { low = -1.0, high = 1.0 }
c = { low = -1.0, high = 1.0 }
d = { low = -1.0, high = 1.0 }
e = { low = -1.0, high = 1.0 }
tool = { levels = ["x", "y", "z"] }

[responses]
heat = {}
drag = {}
mass = {}
wave = {}

[design]
kind = "optimal"
runs = 60
seed = 1

[surface]
model = "auto"

[[search]]
name     = "least"
minimize = "heat + drag"
seed     = 1
"""


def processor_seconds():
    now = os.times()
    return now.user + now.system + now.children_user + now.children_system


def measured(work):
    start, wall = processor_seconds(), time.perf_counter()
    found = work()
    return processor_seconds() - start, time.perf_counter() - wall, found


def plain(space, points, y):
    """Processor seconds of the quadratic with its report, the better of two."""

    def fit():
        return rk.fit_surface(space, points, y).report()

    return min(measured(fit)[0] for _ in range(2))


def tell(what, cost, unit, aim):
    seconds, wall, _ = cost
    print(
        f"{what:28s} {seconds:8.1f} s CPU {wall:8.1f} s  {seconds / unit:8.0f} quadratics  (aim {aim} s)",
        flush=True,
    )


def study():
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        (folder / "study.toml").write_text(STUDY, encoding="utf-8")
        (folder / "simulator.py").write_text(SIMULATOR, encoding="utf-8")
        opened = rk.open_study(folder)
        planned = measured(lambda: rk.plan_design(opened))
        rk.evaluate_design(opened)
        runs = np.random.default_rng(1).uniform(-1.0, 1.0, (60, 6))
        numbers = rk.Space([rk.Factor(f"x{i}", -1.0, 1.0) for i in range(6)])
        unit = plain(numbers, runs, runs.sum(axis=1) + 0.1 * runs[:, 0] ** 3)
        tell("study, plan", planned, unit, 3)
        tell("study, fit", measured(lambda: rk.fit_study(opened)), unit, 10)
        tell("study, verify", measured(lambda: rk.verify_study(opened)), unit, 1.5)


def choice(runs, factors, aim):
    rng = np.random.default_rng(factors)
    points = rng.uniform(-1.0, 1.0, (runs, factors))
    y = (
        np.exp(0.5 * points[:, 0])
        + points[:, 1] ** 2
        + points[:, 2] * points[:, 3]
        + 0.1 * rng.normal(size=runs)
    )
    space = rk.Space([rk.Factor(f"x{i}", -1.0, 1.0) for i in range(factors)])
    unit = plain(space, points, y)
    options = rk.SurfaceOptions(model="auto")
    cost = measured(lambda: rk.choose_surface(space, points, y, options=options, deterministic=False))
    tell(f"auto, {runs} runs x {factors} factors", cost, unit, aim)
    print(f"    {cost[2].sentence}")


WORDS = {"study": study, "wide": lambda: choice(200, 10, 30), "eight": lambda: choice(90, 8, 20)}


def main():
    for word in sys.argv[1:] or WORDS:
        WORDS[word]()


if __name__ == "__main__":
    main()
