"""Evaluation on a real dask cluster, and the death of its workers."""

import os
import signal
import socket
import subprocess
import sys

import pytest
from runs_driver import DRIVER, PATIENCE_S, Driver, gate, gated, settings

from rsmkit.errors import RsmkitError
from rsmkit.language.space import Space
from rsmkit.runs.agenda import make_agenda
from rsmkit.runs.evaluation import evaluate_points
from rsmkit.runs.how_to_run import HowToRun
from rsmkit.runs.one_run.simulator import Simulator
from rsmkit.runs.options import SimulatorOptions
from rsmkit.runs.record.journal import Journal

distributed = pytest.importorskip("distributed")
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
    process.wait(timeout=PATIENCE_S)
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


@pytest.mark.parametrize("trouble", ["hang", "hang_on"])
def test_a_run_that_hangs_on_dask_is_ended(cluster, tmp_path, trouble):
    driver = Driver(
        tmp_path,
        f"scheduler={cluster[0]}",
        f"settings.trouble={trouble}",
        "timeout_s=3",
        "patience_s=20",
        simulator="simulators:moody",
        count=2,
    )
    last, code, _ = driver.end()
    assert (last, code) == ("end: 1 done, 1 failed", 0)
    assert sorted(run.status for run in Journal(tmp_path / "runs.jsonl").load().values()) == [
        "done",
        "timeout",
    ]
    (tmp_path / "after").mkdir()  # the workers are there again
    after = Driver(tmp_path / "after", f"scheduler={cluster[0]}", *settings(tmp_path / "after"), count=4)
    assert after.end()[:2] == ("end: 4 done, 0 failed", 0)


def test_warming_up_costs_no_run_its_time_on_dask(cluster, tmp_path):
    times = (f"settings.{name}_s=6" for name in ("first", "second"))
    driver = Driver(
        tmp_path,
        f"scheduler={cluster[0]}",
        f"settings.folder={tmp_path}",
        *times,
        "timeout_s=0.5",
        "patience_s=1",
        simulator="warming:moody",
        count=4,
    )
    last, code, _ = driver.end()
    runs = Journal(tmp_path / "runs.jsonl").load().values()
    assert (last, code) == ("end: 2 done, 2 failed", 0)
    assert sorted((run.status, run.error) for run in runs if not run.done) == [("failed", "KeyError: ''")] * 2
    warmed = (tmp_path / "warm").read_text().split()
    assert len(set(warmed)) == len(warmed)
    assert sorted((tmp_path / "begun").read_text().split()) == sorted(warmed)  # none was ended meanwhile


class Cluster:
    """A scheduler and a worker, each a process of its own; started again they have the same address."""

    def __init__(self):
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self.address = f"tcp://127.0.0.1:{self.port}"

    def start(self):
        self.scheduler = self._start("scheduler", "--host", "127.0.0.1", "--port", str(self.port))
        self.worker = self._start("worker", self.address, "--no-nanny", "--nthreads", "2")
        with distributed.Client(self.address, timeout=PATIENCE_S) as client:
            client.wait_for_workers(1, timeout=PATIENCE_S)

    def _start(self, part, *arguments):
        command = [sys.executable, "-m", f"distributed.cli.dask_{part}", *arguments, "--no-dashboard"]
        return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def kill(self):
        for process in (self.worker, self.scheduler):
            process.kill()
            process.wait()


@pytest.fixture
def mortal():
    cluster = Cluster()
    cluster.start()
    yield cluster
    cluster.kill()


@pytest.mark.parametrize(
    ("victim", "number", "patience", "message"),
    [
        ("scheduler", signal.SIGKILL, (), "the dask scheduler at {} was lost ("),
        (
            "scheduler",
            signal.SIGSTOP,
            ("CHECK_EVERY_S=0.1", "SILENCE_S=5", "FAREWELL_S=0.5"),
            "the dask scheduler at {} was lost (no answer for 5 s)",
        ),
        (
            "worker",
            signal.SIGKILL,
            ("CHECK_EVERY_S=0.1", "WITHOUT_WORKERS_S=0.5"),
            "the dask cluster at {} has no workers any more",
        ),
    ],
)
def test_the_loss_of_a_dask_cluster_is_one_message(mortal, tmp_path, victim, number, patience, message):
    arguments = (f"scheduler={mortal.address}", *patience, *gated(tmp_path, free=0.1))
    driver = Driver(tmp_path, *arguments, simulator="simulators:gated", count=6)
    driver.wait_for("finished")
    getattr(mortal, victim).send_signal(number)
    last, code, err = driver.end()
    assert last.startswith(f"error: {message.format(mortal.address)}")
    assert last.endswith("the same command goes on.")
    assert (code, err) == (2, "")
    assert len(Journal(tmp_path / "runs.jsonl").load()) == 1
    if (victim, number) == ("scheduler", signal.SIGKILL):
        mortal.kill()
        mortal.start()
        gate(tmp_path).touch()
        resumed = Driver(tmp_path, *arguments, simulator="simulators:gated", count=6)
        assert resumed.end() == ("end: 6 done, 0 failed", 0, "")
        assert len((tmp_path / "runs.jsonl").read_text().splitlines()) == 6


def on(address):
    return HowToRun(backend="dask", backend_options={"scheduler": address})


def test_an_address_where_nobody_answers_is_one_message(tmp_path, monkeypatch):
    monkeypatch.setattr("rsmkit.runs.backends.dask_pool.CONNECT_S", 0.5)
    simulator = Simulator(SimulatorOptions(run="simulators:plane"), DRIVER.parent)
    space, journal = Space(a=(0, 1), b=(0, 1)), Journal(tmp_path / "runs.jsonl")
    with pytest.raises(RsmkitError, match="no dask scheduler answers at tcp"):
        evaluate_points(simulator, [[0, 0]], space, journal, on("tcp://127.0.0.1:9"))
    with socket.create_server(("127.0.0.1", 0)) as silent:
        address = f"tcp://127.0.0.1:{silent.getsockname()[1]}"
        with pytest.raises(RsmkitError, match=f"no dask scheduler answers at {address}: waited 0.5 s"):
            evaluate_points(simulator, [[0, 0]], space, journal, on(address))
    with pytest.raises(RsmkitError, match="needs the address of a scheduler"):
        evaluate_points(simulator, [[0, 0]], space, journal, on(""))
    assert len(make_agenda(simulator, [[0, 0]], space, journal).todo) == 1
