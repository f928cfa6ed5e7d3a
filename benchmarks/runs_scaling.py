"""A hundred thousand runs: how the cost of the journal and of resuming grows with their number.

Run with ``python benchmarks/runs_scaling.py``; no simulator is run. Times are processor seconds.
"""

import tempfile
import time
import tracemalloc
from functools import partial
from pathlib import Path

import numpy as np

from rsmkit.runs.agenda import make_agenda
from rsmkit.runs.journal import Journal
from rsmkit.runs.options import SimulatorOptions
from rsmkit.runs.run import Run
from rsmkit.runs.simulator import Simulator
from rsmkit.space import Space

SPACE = Space(a=(0.0, 1.0), b=(0.0, 1.0), c=(0.0, 1.0))
SETTINGS = {"speed_m_s": 4300.0, "altitude_m": 82000.0, "preset": "paper"}
BATCH = 100


def main():
    simulator = Simulator(SimulatorOptions(run="m:f", settings=SETTINGS), Path.cwd())
    print("     runs  append/run  load  agenda, none made  agenda, all made  memory/run  file/run")
    for count in (1_000, 10_000, 100_000):
        print(measure(simulator, np.random.default_rng(0).random((count, 3))))


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
