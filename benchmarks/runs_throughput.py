"""Short runs: what rsmkit costs per run, and how much two workers gain over one and against plain joblib.

Run with ``python benchmarks/runs_throughput.py``. Each run burns a given processor time. "own" is the
processor time of driver and workers together that did not go into the simulator; start-up of the workers is
left out of it by the difference of two sizes. "gain" is the wall time with one worker over that with two: it
needs two idle cores.
"""

import resource
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from joblib import Parallel, delayed

from rsmkit import Space
from rsmkit.runs.evaluation import evaluate_points
from rsmkit.runs.how_to_run import HowToRun
from rsmkit.runs.one_run.simulator import Simulator
from rsmkit.runs.options import SimulatorOptions
from rsmkit.runs.record.journal import Journal

SPACE = Space(a=(0.0, 1.0), b=(0.0, 1.0), c=(0.0, 1.0))
CASES = ((0.001, 4000), (0.005, 800), (0.05, 80))  # seconds of a run, number of runs


def burn(a, b, c, *, seconds):
    """Simulator: spend processor time."""
    end = time.process_time() + seconds
    while time.process_time() < end:
        pass
    return {"y": a + b + c}


def main():
    print("  run     runs   own/run   gain   gain of joblib")
    for seconds, count in CASES:
        own = (own_cpu(seconds, 2 * count) - own_cpu(seconds, count)) / count
        gain = wall(seconds, count, 1) / wall(seconds, count, 2)
        peer = joblib_wall(seconds, count, 1) / joblib_wall(seconds, count, 2)
        print(f"{1e3 * seconds:3.0f} ms  {count:6,}  {1e6 * own:5.0f} us  {gain:5.2f}  {peer:12.2f}")


def evaluate(seconds, count, jobs):
    """Evaluate `count` points; return the wall time from the first run on, worker start-up left out."""
    options = SimulatorOptions(run="runs_throughput:burn", settings={"seconds": seconds})
    simulator = Simulator(options, Path(__file__).parent)
    times = []

    def watch(event):
        if event.kind in ("finished", "failed"):
            times.append(time.perf_counter())

    with tempfile.TemporaryDirectory() as folder:
        journal = Journal(Path(folder) / "runs.jsonl")
        points = np.random.default_rng(0).random((count, 3))
        evaluate_points(simulator, points, SPACE, journal, HowToRun(jobs), responses=("y",), on_event=watch)
    return times[-1] - times[0]


def wall(seconds, count, jobs):
    return min(evaluate(seconds, count, jobs) for _ in range(3))


def own_cpu(seconds, count):
    before = cpu()
    evaluate(seconds, count, 2)
    return cpu() - before - count * seconds


def cpu():
    kinds = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    return sum(usage.ru_utime + usage.ru_stime for usage in map(resource.getrusage, kinds))


def joblib_wall(seconds, count, jobs):
    points = np.random.default_rng(0).random((count, 3)).tolist()
    times = []
    for _ in range(3):
        pool = Parallel(n_jobs=jobs, return_as="generator_unordered")
        ends = [time.perf_counter() for _ in pool(delayed(burn)(*point, seconds=seconds) for point in points)]
        times.append(ends[-1] - ends[0])
    return min(times)


if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parent))
    main()
