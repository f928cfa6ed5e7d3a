"""Evaluation on a real dask cluster, and the death of its workers."""

import os
import signal
import subprocess
import sys

import pytest
from runs_driver import DRIVER, Driver, settings

from rsmkit.errors import RsmkitError
from rsmkit.runs.agenda import make_agenda
from rsmkit.runs.evaluate import evaluate_points
from rsmkit.runs.journal import Journal
from rsmkit.runs.options import SimulatorOptions
from rsmkit.runs.simulator import Simulator
from rsmkit.space import Space

pytest.importorskip("distributed")
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def cluster():
    """Address of a cluster, and the processes of its two workers."""
    process = subprocess.Popen(
        [sys.executable, str(DRIVER.parent / "cluster.py")],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env={**os.environ, "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "1"},
    )
    address, *pids = process.stdout.readline().split()
    yield address, [int(pid) for pid in pids]
    process.stdin.close()
    process.wait(timeout=30)
    process.stdout.close()


def test_a_killed_dask_worker_costs_no_run(cluster, tmp_path):
    address, workers = cluster
    driver = Driver(tmp_path, f"scheduler={address}", *settings(tmp_path, seconds=0.3))
    driver.wait_for("finished", 3)
    os.kill(workers[0], signal.SIGKILL)
    last, code, _ = driver.end()
    assert (last, code) == ("end: 12 done, 0 failed", 0)
    assert len((tmp_path / "runs.jsonl").read_text().splitlines()) == 12


def test_only_the_run_that_kills_dask_workers_is_blamed(cluster, tmp_path):
    driver = Driver(
        tmp_path,
        f"scheduler={cluster[0]}",
        "settings.trouble=segfault",
        simulator="simulators:moody",
        count=2,
    )
    last, code, _ = driver.end()
    assert (last, code) == ("end: 1 done, 1 failed", 0)
    bad = [run for run in Journal(tmp_path / "runs.jsonl").load().values() if not run.done]
    assert [(run.status, run.factors["a"]) for run in bad] == [("crashed", 0.5)]


def test_a_run_that_hangs_on_dask_is_ended(cluster, tmp_path):
    driver = Driver(
        tmp_path,
        f"scheduler={cluster[0]}",
        "settings.trouble=hang",
        "timeout_s=0.5",
        "patience_s=8",
        simulator="simulators:moody",
        count=2,
    )
    last, code, _ = driver.end()
    assert (last, code) == ("end: 1 done, 1 failed", 0)
    assert sorted(run.status for run in Journal(tmp_path / "runs.jsonl").load().values()) == [
        "done",
        "timeout",
    ]


def test_an_address_where_nobody_answers_is_one_message(tmp_path, monkeypatch):
    monkeypatch.setattr("rsmkit.runs.dask_pool.CONNECT_S", 0.5)
    simulator = Simulator(SimulatorOptions(run="simulators:plane"), DRIVER.parent)
    space, journal = Space(a=(0, 1), b=(0, 1)), Journal(tmp_path / "runs.jsonl")
    with pytest.raises(RsmkitError, match="no dask scheduler answers at tcp"):
        evaluate_points(simulator, [[0, 0]], space, journal, backend="dask", scheduler="tcp://127.0.0.1:9")
    with pytest.raises(RsmkitError, match="needs the address of a scheduler"):
        evaluate_points(simulator, [[0, 0]], space, journal, backend="dask")
    assert len(make_agenda(simulator, [[0, 0]], space, journal).todo) == 1
