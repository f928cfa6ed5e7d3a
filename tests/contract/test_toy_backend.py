"""A new backend is one class and one row: this one takes a study from its plan to a verified optimum."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import pytest
from click.testing import CliRunner

import rsmkit as rk
from rsmkit.cli import main
from rsmkit.cli.all_stages import run_stages
from rsmkit.cli.session import Session
from rsmkit.runs.backends.options import BackendOptions, flag
from rsmkit.runs.backends.pool import Pool
from rsmkit.runs.backends.registry import BACKENDS, Backend
from rsmkit.runs.how_to_run import HowToRun
from rsmkit.runs.one_run.execute import run_tasks
from rsmkit.study.folder import open_study
from rsmkit.testing import check_backend


@dataclass(frozen=True)
class ThreadOptions(BackendOptions):
    """Threads of this process, a toy: a run that crashes takes everything along."""

    prefix: str = flag("beginning of the threads' names", "TEXT", "toy")


class ThreadPool(Pool):
    """Threads that make runs."""

    made = 0

    def __init__(self, options, simulator, jobs, runs):
        self.jobs = min(jobs or 2, runs)
        self._threads = ThreadPoolExecutor(self.jobs, thread_name_prefix=options.prefix)

    def submit(self, simulator, tasks, names):
        """Hand a batch to the next free thread."""
        ThreadPool.made += len(tasks)
        return self._threads.submit(run_tasks, simulator, tasks, names)

    def close(self, *, kill):
        """Wait for the threads."""
        self._threads.shutdown(wait=True, cancel_futures=kill)


@pytest.fixture(autouse=True)
def threads(monkeypatch):
    """The one row."""
    monkeypatch.setitem(BACKENDS, "threads", Backend("threads", "this process", ThreadOptions, ThreadPool))
    monkeypatch.setattr(ThreadPool, "made", 0)


@pytest.mark.slow
def test_it_keeps_the_contract(tmp_path):
    check_backend("threads", {"prefix": "x"}, folder=tmp_path, processes=False)


def test_its_options_are_checked():
    with pytest.raises(rk.RsmkitError, match="must be prefix; got 'prefx', did you mean 'prefix'"):
        HowToRun(backend="threads", backend_options={"prefx": "x"})


@pytest.mark.slow
def test_it_leads_to_a_verified_optimum(tmp_path, capsys):
    study = tmp_path / "beam"
    assert CliRunner().invoke(main, ["new", str(study)]).exit_code == 0
    session = Session(as_json=False, quiet=False, color=False)
    run_stages(session, open_study(study), HowToRun(2, "threads"), force=False)
    assert "  CONFIRMED" in capsys.readouterr().out
    assert ThreadPool.made == len((study / "runs.jsonl").read_text().splitlines()) > 14


def test_it_makes_the_runs_of_the_python_functions(tmp_path):
    simulator, settings = "rsmkit.example.simulator:cantilever", {"length_m": 1.5, "load_N": 4000.0}
    design = rk.full_factorial(rk.Space(width_mm=(30, 60), height_mm=(90, 120)), levels=3)
    journal = tmp_path / "runs.jsonl"
    runs = rk.evaluate(simulator, design, settings=settings, save=journal, jobs=2, backend="threads")
    assert runs.done.all()
    assert ThreadPool.made == 9
    with pytest.raises(rk.RsmkitError, match=r"backend must be .*; got 'thread', did you mean 'threads'"):
        rk.evaluate(simulator, design, save=journal, backend="thread")
