"""Drives an evaluation: ``python driver.py FOLDER SIMULATOR RUNS JOBS [NAME=VALUE...]``.

Settings of the simulator are given as ``settings.NAME=VALUE``, constants of the package in capitals.
Prints one line for every event; exits as the command line would.
"""

import resource
import signal
import sys
from pathlib import Path

import numpy as np

from rsmkit.errors import RsmkitError
from rsmkit.language.space import Space
from rsmkit.runs import dispatch
from rsmkit.runs.backends import dask_pool
from rsmkit.runs.backends.loky_pool import LokyPool
from rsmkit.runs.backends.queues import queue_pool
from rsmkit.runs.evaluation import evaluate_points
from rsmkit.runs.how_to_run import HowToRun
from rsmkit.runs.one_run.simulator import Simulator
from rsmkit.runs.options import SimulatorOptions
from rsmkit.runs.record.journal import Journal

SPACE = Space(a=(0.0, 1.0), b=(0.0, 1.0))


def points(count):
    """The same points every time: a runs from 0 up to, and not including, 1."""
    return np.column_stack([np.arange(count) / count, np.full(count, 0.25)])


def main(folder, simulator, count, jobs, *pairs):
    named = dict(pair.split("=", 1) for pair in pairs)
    settings = {
        name.removeprefix("settings."): _number(text)
        for name, text in named.items()
        if name.startswith("settings.")
    }
    timeout = float(named["timeout_s"]) if "timeout_s" in named else None
    if "largest_file" in named:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (int(named["largest_file"]),) * 2)
    kind = {"command": simulator} if simulator.startswith("{python}") else {"run": simulator}
    options = SimulatorOptions(**kind, timeout_s=timeout, settings=settings)
    home = Path(folder) if options.command else Path(__file__).parent
    if "patience_s" in named:
        dask_pool.DaskPool.patience_s = LokyPool.patience_s = float(named["patience_s"])
    for name in filter(str.isupper, named):
        module = next(module for module in (dispatch, dask_pool, queue_pool) if hasattr(module, name))
        setattr(module, name, float(named[name]))
    backend = named.get("backend", "dask" if "scheduler" in named else "loky")
    try:
        runs = evaluate_points(
            Simulator(options, home),
            points(int(count)),
            SPACE,
            Journal(Path(folder) / "runs.jsonl"),
            HowToRun(
                int(jobs),
                backend,
                {name: named[name] for name in ("scheduler", "job_folder") if name in named},
                retry_failed="retry_failed" in named,
            ),
            responses=["y"],
            on_event=lambda event: print(event.kind, event.key, flush=True),
        )
    except RsmkitError as error:
        print(f"error: {error}", flush=True)
        return error.exit_code
    print(f"end: {runs.done.sum()} done, {runs.failed.sum()} failed", flush=True)
    return 0


def _number(text):
    try:
        return float(text)
    except ValueError:
        return text


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
