"""Drivers and workers killed at random moments, again and again: no finished run is lost, none is doubled.

``RSMKIT_KILLS`` sets the number of kills (200 for the full test, see docs/reliability.md).
"""

import os
import random
import signal
import threading
import time
from contextlib import suppress

import pytest
from runs_driver import PATIENCE_S, Driver, settings, wait_until, workers_of

from rsmkit.runs.record.journal import Journal

KILLS = int(os.environ.get("RSMKIT_KILLS", "6"))
RUNS = 20


@pytest.mark.slow
def test_kills_at_random_moments_lose_and_double_nothing(tmp_path):
    rng = random.Random(20260101)
    kills = {"driver": 0, "worker": 0}
    studies = 0
    while sum(kills.values()) < KILLS or not all(kills.values()):
        studies += 1
        folder = tmp_path / str(studies)
        folder.mkdir()
        while not evaluate_under_fire(folder, rng, kills):
            pass
        journal = Journal(folder / "runs.jsonl")
        runs = journal.load()
        assert len(journal.path.read_text().splitlines()) == len(runs) == RUNS
        assert all(run.done for run in runs.values())
        ends = [line for line in (folder / "log").read_text().splitlines() if line.startswith("end")]
        assert len(set(ends)) == RUNS
    print(f"\nkilled {kills} in {studies} studies of {RUNS} runs")


def evaluate_under_fire(folder, rng, kills):
    """Drive an evaluation and kill its driver or a worker; whether it came to its end all the same."""
    driver = Driver(folder, *settings(folder, seconds=0.03), count=RUNS)
    lines = []
    reader = threading.Thread(target=lambda: lines.extend(driver.process.stdout))
    reader.start()
    # now and then while the workers start, mostly while they work
    first = "planned" if rng.random() < 0.2 else "finished"
    wait_until(lambda: has(lines, first) or driver.process.poll() is not None)
    time.sleep(rng.uniform(0.0, 0.5))
    if rng.random() < 0.6:
        victim, kind = driver.process.pid, "driver"
    else:
        victim, kind = rng.choice(workers_of(driver) or [0]), "worker"
    with suppress(ProcessLookupError):
        if victim and driver.process.poll() is None:
            os.kill(victim, signal.SIGKILL)
            kills[kind] += 1
    driver.process.wait(timeout=PATIENCE_S)
    reader.join(timeout=PATIENCE_S)
    driver.process.stdout.close()
    driver.process.stderr.close()
    assert driver.is_gone()
    told = {line.split()[1] for line in lines if line.startswith("finished") and line.endswith("\n")}
    assert told <= set(Journal(folder / "runs.jsonl").load()), "a finished run was lost"
    return driver.process.returncode == 0


def has(lines, kind):
    return any(line.startswith(kind) for line in lines)
