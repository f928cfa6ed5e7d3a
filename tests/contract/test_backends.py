"""Every row of the register of backends keeps its contract; a new row needs an example here."""

import os
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from rsmkit.errors import RsmkitError
from rsmkit.runs.backends.options import DEFAULT_BACKEND, DaskOptions, LokyOptions
from rsmkit.runs.backends.queues import queue_pool
from rsmkit.runs.backends.registry import BACKENDS, backend_options, pool_maker
from rsmkit.runs.how_to_run import HowToRun
from rsmkit.runs.one_run.simulator import Simulator
from rsmkit.runs.options import SimulatorOptions
from rsmkit.testing import check_backend

CLUSTER = Path(__file__).parents[1] / "data" / "runs" / "cluster.py"


@pytest.fixture
def dask_options():
    """A cluster of two processes on this computer."""
    process = subprocess.Popen(
        [sys.executable, str(CLUSTER)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env={**os.environ, "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "1"},
    )
    yield {"scheduler": process.stdout.readline().split()[0]}
    process.stdin.close()
    process.wait(timeout=30)
    process.stdout.close()


@pytest.fixture
def loky_options():
    return {}


@pytest.fixture
def slurm_options(tmp_path, monkeypatch):
    """A Slurm that stands already, on whatever computer; its commands answer where jobs are submitted."""
    if (
        shutil.which("sinfo") is None
        or subprocess.run(["sinfo"], capture_output=True, check=False).returncode
    ):
        pytest.skip("needs a Slurm that answers")
    for name, seconds in (("LOOK_S", 0.3), ("ASK_S", 1.0), ("LAG_S", 3.0)):
        monkeypatch.setattr(queue_pool, name, seconds)
    return {"job_folder": str(tmp_path / "jobs" / "queue")}


@pytest.fixture
def pbs_options(tmp_path):
    """A PBS that stands already."""
    if shutil.which("qstat") is None:
        pytest.skip("needs a PBS that answers")
    return {"job_folder": str(tmp_path / "jobs" / "queue")}


NEEDS = {"dask": "distributed"}
LASTING = ("slurm", "pbs")


@pytest.mark.slow
@pytest.mark.parametrize("word", BACKENDS)
def test_every_backend_keeps_the_contract(word, request, tmp_path):
    if word in NEEDS and find_spec(NEEDS[word]) is None:
        pytest.skip(f"needs {NEEDS[word]}")
    check_backend(word, request.getfixturevalue(f"{word}_options"), folder=tmp_path, lasting=word in LASTING)


def test_the_default_is_the_first():
    assert next(iter(BACKENDS)) == DEFAULT_BACKEND == HowToRun().backend


def test_options_by_word():
    assert backend_options("loky") == LokyOptions()
    assert backend_options("dask", scheduler="tcp://host:8786") == DaskOptions("tcp://host:8786")


@pytest.mark.parametrize(
    ("word", "keys", "message"),
    [
        ("lokey", {}, "backend must be loky, dask, slurm or pbs; got 'lokey', did you mean 'loky'?"),
        ("loky", {"threads": 2}, "the loky backend has no options; got 'threads'"),
        (
            "loky",
            {"scheduler": "tcp://host:8786"},
            "scheduler has no effect on the loky backend; leave it out, or take the dask backend",
        ),
        (
            "dask",
            {"sheduler": "tcp://host:8786"},
            "an option of the dask backend must be scheduler or wait_s; got 'sheduler', "
            "did you mean 'scheduler'?",
        ),
    ],
)
def test_wrong_words_are_refused_when_they_are_said(word, keys, message):
    with pytest.raises(RsmkitError) as refusal:
        HowToRun(backend=word, backend_options=keys)
    assert str(refusal.value) == message


def test_dask_needs_an_address():
    simulator = Simulator(SimulatorOptions(run="m:f"), Path())
    with pytest.raises(RsmkitError, match="the dask backend needs the address of a scheduler, such as tcp:"):
        pool_maker("dask", backend_options("dask"), simulator, 1)
