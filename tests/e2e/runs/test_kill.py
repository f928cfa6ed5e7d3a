"""Drivers, workers and jobs killed at random moments, again and again: no run is lost, none made twice.

``RSMKIT_KILLS`` sets the number of kills on each backend (200 for the full test, see docs/reliability.md):
this computer, a dask cluster, a Slurm that answers where there is one, and PBS, of which a stand-in runs
jobs as processes of this computer. Without it there are few, and none where a cluster would have to start.
"""

import os
import random
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from contextlib import contextmanager, suppress
from importlib.util import find_spec

import pytest
from runs_driver import (
    DRIVER,
    PATIENCE_S,
    Driver,
    children,
    command_line,
    settings,
    state,
    wait_until,
    workers_of,
)

from rsmkit.runs.record.journal import Journal

FEW = {"loky": 6, "pbs": 1}
RUNS = {"loky": 20, "dask": 20, "slurm": 12, "pbs": 12}
SECONDS = {"loky": 0.03, "dask": 0.03, "slurm": 0.3, "pbs": 0.3}
QUICK = ("LOOK_S=0.2", "ASK_S=0.5", "LAG_S=1")
MOST_JOBS = 2
"""Of one study that are killed: a run that loses three jobs is blamed, as it should be."""


@contextmanager
def this_computer(folder):
    yield (), lambda driver: workers_of(driver)


@contextmanager
def dask_cluster(folder):
    if find_spec("distributed") is None:
        pytest.skip("needs distributed")
    process = subprocess.Popen(
        [sys.executable, str(DRIVER.parent / "cluster.py")],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    address, *_ = process.stdout.readline().split()
    yield (
        (f"scheduler={address}",),
        lambda driver: [pid for pid in children(process.pid) if "spawn_main" in command_line(pid)],
    )
    process.stdin.close()
    process.wait(timeout=PATIENCE_S)
    process.stdout.close()


def jobs_of(driver):
    """Processes of its jobs, those of drivers before it included."""
    place = str(driver.folder / "queue")
    pids = [int(pid) for pid in os.listdir("/proc") if pid.isdigit()]
    return [pid for pid in pids if f"array_task\0{place}" in command_line(pid) and state(pid) != "Z"]


@contextmanager
def real_slurm(folder):
    answers = (
        shutil.which("sinfo") and not subprocess.run(["sinfo"], capture_output=True, check=False).returncode
    )
    if not answers:
        pytest.skip("needs a Slurm that answers")
    yield ("backend=slurm", *QUICK), jobs_of


@contextmanager
def pbs_stand_in(folder):
    commands = folder / "commands"
    commands.mkdir()
    for word in ("qsub", "qstat", "qdel"):
        script = commands / word
        call = f'exec {sys.executable} {DRIVER.parent / "pbs.py"} {folder / "pbs"} {word} "$@"'
        script.write_text(f"#!/bin/sh\n{call}\n")
        script.chmod(0o755)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PATH", str(commands), prepend=os.pathsep)
        yield ("backend=pbs", *QUICK), jobs_of


PLACES = {"loky": this_computer, "dask": dask_cluster, "slurm": real_slurm, "pbs": pbs_stand_in}


@pytest.mark.slow
@pytest.mark.parametrize("word", PLACES)
def test_kills_at_random_moments_lose_and_double_nothing(tmp_path, word):
    most = int(os.environ.get("RSMKIT_KILLS", FEW.get(word, 0)))
    if not most:
        pytest.skip("starts a cluster: set RSMKIT_KILLS")
    rng = random.Random(20260101)
    kills, studies, again = Counter(), 0, 0
    with PLACES[word](tmp_path) as (arguments, victims):
        while kills.total() < most or (most > 1 and len(kills) < 2):
            studies += 1
            folder = tmp_path / str(studies)
            folder.mkdir()
            before = kills.copy()
            while not evaluate_under_fire(folder, rng, kills, word, arguments, victims, before):
                pass
            journal = Journal(folder / "runs.jsonl")
            runs = journal.load()
            assert len(journal.path.read_text().splitlines()) == len(runs) == RUNS[word]
            assert all(run.done for run in runs.values())
            begun = noted(folder, "start")
            assert len(begun) == len(noted(folder, "end")) == RUNS[word]
            again += begun.total() - RUNS[word]
            if word in ("slurm", "pbs"):  # a driver's death costs no run, a job's the one that was under way
                assert begun.total() - RUNS[word] <= kills["worker"] - before["worker"]
                assert list((folder / "queue").iterdir()) == []
    print(f"\n{word}: killed {dict(kills)} in {studies} studies of {RUNS[word]} runs; begun again: {again}")


def evaluate_under_fire(folder, rng, kills, word, arguments, victims, before):
    """Drive an evaluation and kill its driver or a worker; whether it came to its end all the same."""
    recorded = known(folder)
    begun = {place: count for place, count in noted(folder, "start").items() if place in recorded}
    if word in ("slurm", "pbs"):
        arguments = (*arguments, f"job_folder={folder / 'queue'}")
    driver = Driver(folder, *arguments, *settings(folder, SECONDS[word]), count=RUNS[word])
    driver.folder = folder
    lines = []
    reader = threading.Thread(target=lambda: lines.extend(driver.process.stdout))
    reader.start()
    # now and then while the workers start, mostly while they work
    first = "planned" if rng.random() < 0.2 else "finished"
    wait_until(lambda: has(lines, first) or driver.process.poll() is not None)
    time.sleep(rng.uniform(0.0, 0.5 if word in ("loky", "dask") else 1.5))
    if rng.random() < 0.6:
        victim, kind = driver.process.pid, "driver"
    else:
        victim, kind = rng.choice(victims(driver) or [0]), "worker"
        if word in ("slurm", "pbs") and kills["worker"] - before["worker"] >= MOST_JOBS:
            victim = 0
    with suppress(ProcessLookupError):
        if victim and driver.process.poll() is None:
            os.kill(victim, signal.SIGKILL)
            kills[kind] += 1
    driver.process.wait(timeout=PATIENCE_S)
    reader.join(timeout=PATIENCE_S)
    driver.process.stdout.close()
    driver.process.stderr.close()
    if word == "loky":
        assert driver.is_gone()
    told = {line.split()[1] for line in lines if line.startswith("finished") and line.endswith("\n")}
    assert told <= set(Journal(folder / "runs.jsonl").load()), "a finished run was lost"
    now = noted(folder, "start")
    assert all(now[place] == count for place, count in begun.items()), "a recorded run was begun again"
    return driver.process.returncode == 0


def known(folder):
    """Where the recorded runs lie, as the simulator notes it."""
    runs = Journal(folder / "runs.jsonl").load().values()
    return {f"{run.factors['a']!r} {run.factors['b']!r}" for run in runs}


def noted(folder, word):
    """How often runs began or ended, by where they lie and the simulator's own account."""
    lines = (folder / "log").read_text().splitlines() if (folder / "log").exists() else []
    return Counter(line.removeprefix(f"{word} ") for line in lines if line.startswith(f"{word} "))


def has(lines, kind):
    return any(line.startswith(kind) for line in lines)
