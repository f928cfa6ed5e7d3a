"""Simulators that prepare themselves before their first run."""

from pathlib import Path

import numpy as np
import pytest

from rsmkit.language.space import Space
from rsmkit.runs.evaluation import evaluate_points
from rsmkit.runs.how_to_run import HowToRun
from rsmkit.runs.one_run.execute import Task, run_tasks
from rsmkit.runs.one_run.simulator import Simulator, SimulatorError
from rsmkit.runs.options import SimulatorOptions
from rsmkit.runs.record.journal import Journal

DATA = Path(__file__).parents[2] / "data" / "runs"
SPACE = Space(a=(0.0, 1.0), b=(0.0, 1.0))
TROUBLED = [[0.7, 0.0], [0.8, 0.0], [0.9, 0.0]]
POINTS = np.array([[0.0, 0.0], [0.25, 0.5], [1.0, 1.0], [0.25, 0.5]])


def named(function, **options):
    return Simulator(SimulatorOptions(run=f"simulators:{function}", **options), DATA)


def starts(log):
    return sum(line.startswith("start") for line in log.read_text().splitlines()) if log.exists() else 0


@pytest.fixture
def journal(tmp_path):
    return Journal(tmp_path / "runs.jsonl")


def warming(folder, **options):
    settings = {"folder": str(folder), **options.pop("settings", {})}
    return Simulator(SimulatorOptions(run="warming:moody", settings=settings, **options), DATA)


@pytest.mark.slow
def test_warming_up_is_done_once_in_each_worker_and_costs_no_run_its_time(journal, tmp_path):
    times = {"first_s": 4.0, "second_s": 4.0}  # longer than a run may take, the last resort included
    points = np.column_stack([np.linspace(0.0, 0.4, 8), np.zeros(8)])
    simulator = warming(tmp_path, timeout_s=1.0, settings=times)
    runs = evaluate_points(simulator, points, SPACE, journal, HowToRun(2), responses=["y"])
    assert runs.done.all()
    assert max(run.seconds for run in runs.runs) < 1.0
    warmed = (tmp_path / "warm").read_text().split()
    assert len(set(warmed)) == len(warmed) <= 2


@pytest.mark.slow
def test_a_worker_that_warms_up_is_not_blamed_when_another_dies(journal, tmp_path):
    settings = {"second_s": 12.0, "seconds": 0.4, "trouble": "segfault"}
    points = np.column_stack([np.linspace(0.0, 0.4, 12), np.zeros(12)])
    points[10, 0] = 0.9  # some 4 s later, when the run that waits for its worker is 3 s overdue
    simulator = warming(tmp_path, timeout_s=1.0, settings=settings)
    runs = evaluate_points(simulator, points, SPACE, journal, HowToRun(2), responses=["y"])
    assert [run.status for run in runs.runs] == ["done"] * 10 + ["crashed", "done"]
    assert runs.runs[10].error == "the simulator's process died (SIGSEGV)"
    assert len(journal.path.read_text().splitlines()) == 12


def test_a_simulator_that_cannot_be_warmed_up_stops_the_evaluation_with_one_message(journal, tmp_path):
    simulator = warming(tmp_path, settings={"trouble": "cold"})
    with pytest.raises(SimulatorError, match=r"warm_up of module warming, .* failed: ValueError: no fuel"):
        evaluate_points(simulator, POINTS, SPACE, journal, HowToRun(2))
    assert journal.load() == {}


def test_warming_up_has_an_end(tmp_path, monkeypatch):
    monkeypatch.setattr("rsmkit.runs.one_run.execute.WARM_UP_S", 0.2)
    monkeypatch.syspath_prepend(DATA)
    with pytest.raises(SimulatorError, match=r"failed: TimeLimit: more than 0\.2 s"):
        run_tasks(warming(tmp_path, settings={"first_s": 60.0}), [Task("0" * 16, {"a": 0.0, "b": 0.0})], ())


def test_what_merely_has_the_name_is_not_called(tmp_path, monkeypatch):
    (tmp_path / "burned_in.py").write_text(
        "warm_up = 1000\n\ndef f(a, b):\n    return {'y': a + b + warm_up}\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    simulator = Simulator(SimulatorOptions(run="burned_in:f"), tmp_path)
    (outcome,) = run_tasks(simulator, [Task("0" * 16, {"a": 1.0, "b": 0.5})], ())
    assert outcome.run.responses == {"y": 1001.5}


@pytest.mark.slow
def test_workers_that_warm_up_together_compile_once(journal, tmp_path):
    (tmp_path / "compiles.py").write_text(
        "from pathlib import Path\nfrom rsmkit.machine_code import MachineCode\n\n"
        "HOME = Path(__file__).parent\nCODE = MachineCode(HOME, 'toy', 'TOY_CACHE_DIR')\n\n"
        "def twice(x):\n    return 2.0 * x\n\ntwice = CODE.compile(twice)\n\n"
        "def warm_up():\n    twice(1.0)\n"
        "    with open(HOME / 'log', 'a') as log:\n"
        "        log.write(f'{sum(twice.stats.cache_misses.values())}\\n')\n\n"
        "def f(a, b):\n    return {'y': twice(a)}\n"
    )
    simulator = Simulator(SimulatorOptions(run="compiles:f"), tmp_path)
    runs = evaluate_points(simulator, POINTS, SPACE, journal, HowToRun(2), responses=["y"])
    assert runs.done.all()
    assert sum(int(line) for line in (tmp_path / "log").read_text().split()) == 1
