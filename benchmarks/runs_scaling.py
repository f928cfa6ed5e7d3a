"""A hundred thousand runs: how the cost of the journal, of resuming, of the status and of a fit grows.

Run with ``python benchmarks/runs_scaling.py``; no simulator is run. Times are processor seconds; those of
commands are of whole processes.
"""

import resource
import subprocess
import sys
import tempfile
import time
import tracemalloc
from functools import partial
from pathlib import Path

import numpy as np

from rsmkit import Space
from rsmkit.runs.agenda import make_agenda
from rsmkit.runs.one_run.simulator import Simulator
from rsmkit.runs.options import SimulatorOptions
from rsmkit.runs.record.journal import Journal
from rsmkit.runs.record.run import Run

SPACE = Space(a=(0.0, 1.0), b=(0.0, 1.0), c=(0.0, 1.0))
SETTINGS = {"speed_m_s": 4300.0, "altitude_m": 82000.0, "preset": "paper"}
BATCH = 100
COUNTS = (1_000, 10_000, 100_000)
STUDY = """
[simulator]
run = "m:f"
[factors]
a = { low = 0, high = 1 }
b = { low = 0, high = 1 }
c = { low = 0, high = 1 }
[responses]
y = {}
[design]
kind = "file"
file = "points.csv"
[[search]]
minimize = "y"
"""


def main():
    simulator = Simulator(SimulatorOptions(run="m:f", settings=SETTINGS), Path.cwd())
    print("     runs  append/run  load  agenda, none made  agenda, all made  memory/run  file/run")
    for count in COUNTS:
        print(measure(simulator, np.random.default_rng(0).random((count, 3))))
    print("\n     runs  evaluate, nothing to do  status   fit  status  largest process")
    for count in COUNTS:
        print(measure_commands(np.random.default_rng(0).random((count, 3))))


def measure_commands(points):
    """Commands on a study whose runs are all in the journal."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "study.toml").write_text(STUDY)
        np.savetxt(folder / "points.csv", points, fmt="%.17g", delimiter=",", header="a,b,c", comments="")
        command("plan", folder)
        space, simulator = SPACE, Simulator(SimulatorOptions(run="m:f"), folder)
        journal = Journal(folder / "runs.jsonl")
        values = 1.0 + points[:, 0] + np.exp(points[:, 1]) * points[:, 2]
        with journal:
            tasks = make_agenda(simulator, points, space, journal).todo
            done = [
                Run(task.key, "m:f", {}, task.factors, 0, "done", {"y": float(y)}, {}, 0.5)
                for task, y in zip(tasks, values, strict=True)
            ]
            append_all(journal, done)
        times = [command(stage, folder) for stage in ("evaluate", "status", "fit", "status")]
    largest = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    columns = "  ".join(f"{seconds:4.1f} s" for seconds in times)
    return f"{len(points):9,}                   {columns}  {largest:9.0f} MB"


def command(stage, folder):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, "-m", "rsmkit", stage, "-q", str(folder)], check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def measure(simulator, points):
    count = len(points)
    with tempfile.TemporaryDirectory() as folder:
        journal = Journal(Path(folder) / "runs.jsonl")
        planning, agenda = timed(lambda: make_agenda(simulator, points, SPACE, journal, responses=("y",)))
        runs = [
            Run(
                task.key,
                "m:f",
                SETTINGS,
                task.factors,
                0,
                "done",
                {"y": 0.1, "z": 0.2},
                {"n": 1},
                0.5,
                host="h",
            )
            for task in agenda.todo
        ]
        with journal:
            appending, _ = timed(partial(append_all, journal, runs))
        del runs, agenda
        loading, _ = timed(journal.load)
        resuming, agenda = timed(lambda: make_agenda(simulator, points, SPACE, journal, responses=("y",)))
        assert not agenda.todo
        del agenda
        tracemalloc.start()
        kept = journal.load()
        memory = tracemalloc.get_traced_memory()[0] / len(kept)
        tracemalloc.stop()
        size = journal.path.stat().st_size / count
    return (
        f"{count:9,}  {1e6 * appending / count:7.0f} us  {loading:4.2f} s  {planning:15.2f} s  "
        f"{resuming:14.2f} s  {memory:8.0f} B  {size:6.0f} B"
    )


def append_all(journal, runs):
    for start in range(0, len(runs), BATCH):
        journal.append(runs[start : start + BATCH])


def timed(work):
    begin = time.process_time()
    result = work()
    return time.process_time() - begin, result


if __name__ == "__main__":
    main()
