"""Evaluation with real worker processes."""

import json
import os
import signal
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest

from rsmkit.errors import RsmkitError, RunsFailedError
from rsmkit.language.space import Space
from rsmkit.runs.agenda import make_agenda, read_runs
from rsmkit.runs.evaluation import check_once, evaluate_points
from rsmkit.runs.how_to_run import HowToRun
from rsmkit.runs.one_run.execute import Task, run_tasks
from rsmkit.runs.one_run.simulator import Simulator, SimulatorError
from rsmkit.runs.options import SimulatorOptions
from rsmkit.runs.record.journal import Journal
from rsmkit.testing import check_simulator

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


def test_each_different_point_is_run_once_and_never_again(journal, tmp_path):
    log = tmp_path / "log"
    simulator = named("logged", settings={"log": str(log)})
    events = []
    runs = evaluate_points(
        simulator, POINTS, SPACE, journal, HowToRun(2), responses=["y"], on_event=events.append
    )
    np.testing.assert_array_equal(runs.y("y"), [0.0, 0.75, 2.0, 0.75])
    assert starts(log) == 3
    kinds = [event.kind for event in events]
    assert kinds[0] == "planned"
    assert sorted(kinds[1:]) == ["finished"] * 3 + ["started"] * 3
    assert (events[-1].progress.distinct, events[-1].progress.done) == (3, 3)
    assert all(kinds.index("started") < index for index, kind in enumerate(kinds) if kind == "finished")

    wider = np.vstack([POINTS[::-1], [[0.5, 0.5]]])
    again = evaluate_points(simulator, wider, SPACE, journal, HowToRun(1), responses=["y"])
    np.testing.assert_array_equal(again.y("y"), [0.75, 2.0, 0.75, 0.0, 1.0])
    assert starts(log) == 4
    assert len(journal.path.read_text().splitlines()) == 4


@pytest.mark.slow
def test_a_noisy_simulator_runs_every_repetition(journal):
    runs = evaluate_points(
        named("noisy", deterministic=False), POINTS, SPACE, journal, HowToRun(2), responses=["y"]
    )
    assert len({run.key for run in runs.runs}) == 4
    assert [run.replicate for run in runs.runs] == [0, 0, 0, 1]


def test_a_failing_run_is_recorded_and_the_others_are_finished(journal):
    simulator = named("moody", settings={"trouble": "raise"})
    points = [[0.1, 0], [0.9, 0], [0.2, 0], [0.8, 0], [0.3, 0]]
    runs = evaluate_points(simulator, points, SPACE, journal, HowToRun(2), responses=["y"])
    assert runs.done.tolist() == [True, False, True, False, True]
    bad = runs.runs[1]
    assert (bad.status, bad.error) == ("failed", "ValueError: step size underflow")
    trace = (journal.folder / bad.key / "traceback.txt").read_text()
    assert "simulators.py" in trace
    assert "_raise" in trace
    assert "rsmkit" not in trace

    assert len(make_agenda(simulator, points, SPACE, journal, responses=["y"]).todo) == 0
    todo = make_agenda(simulator, points, SPACE, journal, HowToRun(retry_failed=True), responses=["y"]).todo
    assert [(task.factors["a"], task.attempt) for task in todo] == [(0.9, 2), (0.8, 2)]


def test_signals_that_a_run_took_are_the_drivers_again_in_the_next(journal):
    simulator = named("moody", settings={"trouble": "wants_signals"}, batch=3)
    runs = evaluate_points(simulator, TROUBLED, SPACE, journal, HowToRun(1), responses=["y"])
    assert runs.done.all()
    assert len({run.extras["pid"] for run in runs.runs}) == 1  # none died and was repeated elsewhere


def test_when_a_batch_cannot_be_returned_only_the_guilty_is_blamed(journal):
    simulator = named("moody", settings={"trouble": "sabotage"}, batch=3)
    points = [[0.1, 0.0], [0.9, 0.0], [0.2, 0.0]]
    runs = evaluate_points(simulator, points, SPACE, journal, HowToRun(1), responses=["y"])
    assert runs.done.tolist() == [True, False, True]
    assert runs.runs[1].error == "the worker could not return the result: OSError: no name"


def test_half_a_character_among_the_extras_does_no_harm(journal, tmp_path):
    simulator = named("moody", settings={"trouble": "half_character"})
    runs = evaluate_points(simulator, TROUBLED[:1], SPACE, journal, HowToRun(1), responses=["y"])
    runs.to_csv(tmp_path / "responses.csv")
    assert r"\ud800" in (tmp_path / "responses.csv").read_text(encoding="utf-8")


def test_a_folder_that_is_renamed_under_way_does_no_harm(tmp_path, monkeypatch):
    (tmp_path / "before").mkdir()
    monkeypatch.chdir(tmp_path / "before")

    def rename(event):
        if event.kind == "finished" and event.progress.ended == 1:
            (tmp_path / "before").rename(tmp_path / "after")

    simulator = named("moody", settings={"trouble": "raise"})
    journal = Journal("runs.jsonl")
    runs = evaluate_points(
        simulator, POINTS * 0.4, SPACE, journal, HowToRun(1), responses=["y"], on_event=rename
    )
    assert runs.done.all()
    assert len(Journal(tmp_path / "after" / "runs.jsonl").load()) == 3
    assert not (tmp_path / "before").exists()


@pytest.mark.parametrize(
    ("trouble", "status", "error"),
    [
        ("segfault", "crashed", "the simulator's process died (SIGSEGV)"),
        pytest.param(
            "os_exit", "crashed", "the simulator's process died (exit code 3)", marks=pytest.mark.slow
        ),
        pytest.param(
            "hang_on", "timeout", "its process was ended after timeout_s = 3 s", marks=pytest.mark.slow
        ),
        pytest.param(
            "killed",
            "crashed",
            "the simulator's process died (SIGKILL; was it out of memory?)",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_only_the_guilty_run_is_blamed_when_a_process_dies(journal, tmp_path, trouble, status, error):
    log = tmp_path / "log"
    settings = {"trouble": trouble, "log": str(log)}
    simulator = named("moody", timeout_s=3.0 if trouble == "hang_on" else 120.0, settings=settings)
    points = [[0.1, 0.0], [0.2, 0.0], [0.9, 0.0], [0.3, 0.0], [0.4, 0.0]]
    runs = evaluate_points(simulator, points, SPACE, journal, HowToRun(2), responses=["y"])
    assert runs.done.tolist() == [True, True, False, True, True]
    assert (runs.runs[2].status, runs.runs[2].error) == (status, error)
    assert len(journal.path.read_text().splitlines()) == 5
    if trouble == "segfault":
        output = (journal.folder / runs.runs[2].key / "output.txt").read_text()
        assert "in _segfault" in output


@pytest.mark.slow
@pytest.mark.parametrize(
    ("trouble", "timeout_s", "status"),
    [
        ("leaves_children", 120.0, "done"),
        ("patches", 120.0, "done"),
        ("never_ends", 120.0, "done"),
        ("swallow", 3.0, "timeout"),
        ("stopped", 3.0, "timeout"),
    ],
)
def test_what_a_run_leaves_behind_does_not_harm_the_others(journal, monkeypatch, trouble, timeout_s, status):
    killed = []
    kill = os.kill
    monkeypatch.setattr("os.kill", lambda pid, number: killed.append((pid, number)) or kill(pid, number))
    monkeypatch.setattr("rsmkit.runs.backends.loky_pool.STOPPED_S", 2.0)
    monkeypatch.setattr("rsmkit.runs.backends.loky_pool.FAREWELL_S", 2.0)
    simulator = named("moody", timeout_s=timeout_s, settings={"trouble": trouble})
    points = [[0.1, 0.0], [0.9, 0.0], [0.2, 0.0], [0.3, 0.0]]
    runs = evaluate_points(simulator, points, SPACE, journal, HowToRun(2), responses=["y"])
    assert [run.status for run in runs.runs] == ["done", status, "done", "done"]
    assert len(journal.path.read_text().splitlines()) == 4
    extras = runs.runs[1].extras
    if trouble == "leaves_children":
        for pid in extras["left"]:
            kill(pid, signal.SIGKILL)  # fails if it is not there any more: it was not waited for
    if trouble == "never_ends":
        assert (extras["pid"], signal.SIGKILL) in killed


@pytest.mark.slow
def test_results_do_not_depend_on_workers_or_order(tmp_path):
    points = np.random.default_rng(0).random((12, 2))
    settings = {"slope": 0.1}
    tables = []
    for jobs, order in ((1, slice(None)), (2, slice(None, None, -1)), (3, slice(None))):
        journal = Journal(tmp_path / f"{jobs}.jsonl")
        evaluate_points(
            named("plane", settings=settings), points[order], SPACE, journal, HowToRun(jobs), responses=["y"]
        )
        tables.append(
            read_runs(named("plane", settings=settings), points, SPACE, journal, responses=["y"]).y("y")
        )
    np.testing.assert_array_equal(tables[0], 0.1 * (points[:, 0] + 2.0 * points[:, 1]))
    np.testing.assert_array_equal(tables[1], tables[0])
    np.testing.assert_array_equal(tables[2], tables[0])


def test_a_simulator_that_cannot_be_loaded_stops_the_evaluation_with_one_message(journal):
    simulator = Simulator(SimulatorOptions(run="no_such_module:f"), DATA)
    with pytest.raises(SimulatorError, match="module no_such_module cannot be imported"):
        evaluate_points(simulator, POINTS, SPACE, journal, HowToRun(2))
    assert journal.load() == {}


@pytest.mark.parametrize(
    ("text", "limit_s", "message"),
    [
        ("import time\ntime.sleep(3600)", 0.2, "cannot be imported .*: TimeLimit: more than 0.2 s"),
        ("def __getattr__(name):\n    raise ValueError('what?')", 120.0, "has no 'f' .ValueError: what."),
    ],
)
def test_a_module_that_cannot_be_used_is_one_message(tmp_path, monkeypatch, text, limit_s, message):
    monkeypatch.setattr("rsmkit.runs.one_run.execute.LOADING_S", limit_s)
    name = f"unusable_{len(text)}"
    (tmp_path / f"{name}.py").write_text(text)
    simulator = Simulator(SimulatorOptions(run=f"{name}:f"), tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(SimulatorError, match=message):
        run_tasks(simulator, [Task("0" * 16, {"a": 0.0, "b": 0.0})], ())


def test_only_and_limit_choose_what_is_run(journal):
    simulator = named("plane")
    runs = evaluate_points(simulator, POINTS, SPACE, journal, HowToRun(1, only=(3,)), responses=["y"])
    assert runs.missing.tolist() == [True, True, False, True]
    agenda = make_agenda(simulator, POINTS, SPACE, journal, HowToRun(limit=1), responses=["y"])
    assert [task.factors["a"] for task in agenda.todo] == [0.0]
    assert (agenda.distinct, len(agenda.rows), len(agenda.recorded)) == (3, 4, 1)
    with pytest.raises(RsmkitError, match="the design has runs 1 to 4; there is no run 5"):
        make_agenda(simulator, POINTS, SPACE, journal, HowToRun(only=(5,)))


def test_a_response_named_later_is_found_in_what_was_kept(journal):
    simulator = named("plane")
    evaluate_points(simulator, POINTS, SPACE, journal, HowToRun(1), responses=["y"])
    runs = evaluate_points(simulator, POINTS, SPACE, journal, HowToRun(1), responses=["product"])
    np.testing.assert_array_equal(runs.y("product"), [0.0, 0.125, 1.0, 0.125])
    assert len(journal.path.read_text().splitlines()) == 3


def test_points_must_fit_the_space(journal):
    with pytest.raises(RsmkitError, match=r"shape \(n, 2\), got shape \(1, 3\)"):
        make_agenda(named("plane"), [[1.0, 2.0, 3.0]], SPACE, journal)
    with pytest.raises(RsmkitError, match="finite"):
        make_agenda(named("plane"), [[1.0, np.nan]], SPACE, journal)


def test_a_check_makes_one_run_and_records_nothing(journal):
    outcome = check_once(named("plane"), {"a": 1.0, "b": 0.5}, responses=["y"])
    assert outcome.run.responses == {"y": 2.0}
    assert not journal.path.exists()


POINT = {"a": 0.9, "b": 0.5}


def test_the_contract_for_other_peoples_simulators():
    run = check_simulator("simulators:plane", POINT, responses=["y"], folder=DATA)
    assert run.responses == {"y": 1.9}
    with pytest.raises(AssertionError, match="did not return z"):
        check_simulator("simulators:plane", POINT, responses=["z"], folder=DATA)
    with pytest.raises(AssertionError, match="must look like 'module:function'"):
        check_simulator("simulators.plane", POINT)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"run": "simulators:columns", "settings": {"log": os.devnull}, "vectorized": True}, ""),
        ({"run": "simulators:columns_alone", "vectorized": True}, "fails with arrays of length 3"),
        ({"run": "simulators:columns_normalised", "vectorized": True}, "batches differ from single calls"),
        ({"run": "simulators:columns_in_order", "vectorized": True}, "batches differ from single calls"),
        ({"run": "simulators:remembering"}, "not deterministic: .* in another order"),
        ({"run": "simulators:stateful"}, "not deterministic: .* in another process"),
        (
            {"run": "simulators:moody", "settings": {"trouble": "nan"}},
            r"failed at {'a': 0.75.*returned y = nan",
        ),
        ({"run": "simulators:moody", "settings": {"trouble": "unpicklable"}}, "which is not a number"),
    ],
)
def test_every_part_of_the_contract_is_checked(options, message):
    points = [{"a": 0.25, "b": 0.5}, {"a": 0.75, "b": 0.5}, {"a": 0.5, "b": 0.25}]
    if not message:
        check_simulator(SimulatorOptions(**options), points, responses=["y"], folder=DATA)
        return
    with pytest.raises(AssertionError, match=message):
        check_simulator(SimulatorOptions(**options), points, responses=["y"], folder=DATA)


def test_a_flaky_simulator_is_tried_again(journal, tmp_path):
    settings = {"log": str(tmp_path / "log"), "successes_from": 3}
    events = []
    runs = evaluate_points(
        named("flaky", retries=2, settings=settings),
        [[0.5, 0.5]],
        SPACE,
        journal,
        HowToRun(1),
        responses=["y"],
        on_event=events.append,
    )
    assert runs.y("y").tolist() == [3.0]
    assert [event.kind for event in events if event.run] == ["retried", "retried", "finished"]
    attempts = [json.loads(line)["attempt"] for line in journal.path.read_text().splitlines()]
    assert attempts == [1, 2, 3]
    assert runs.runs[0].attempt == 3
    assert events[-1].progress.failed == 0


def test_retries_end(journal, tmp_path):
    settings = {"log": str(tmp_path / "log"), "successes_from": 99}
    simulator = named("flaky", retries=2, settings=settings)
    runs = evaluate_points(simulator, [[0.5, 0.5]], SPACE, journal, HowToRun(1), responses=["y"])
    assert runs.failed.tolist() == [True]
    assert starts(tmp_path / "log") == 3


def test_too_many_failures_stop_the_evaluation(journal):
    simulator = named("moody", settings={"trouble": "raise"})
    points = np.column_stack([np.linspace(0.6, 1.0, 20), np.zeros(20)])
    with pytest.raises(
        RunsFailedError, match=r"stopped with \d+ of 20 runs made.* failed, as many as allowed"
    ):
        evaluate_points(simulator, points, SPACE, journal, HowToRun(1, max_failures=3), responses=["y"])
    made = len(journal.load())
    assert 3 <= made < 20


def test_each_replicate_has_its_own_seed_and_keeps_it(journal, tmp_path):
    simulator = named("seeded", deterministic=False, replicates=3, seed="seed")
    runs = evaluate_points(simulator, POINTS[:2], SPACE, journal, HowToRun(2), responses=["y"])
    assert runs.X.tolist() == [POINTS[0].tolist()] * 3 + [POINTS[1].tolist()] * 3
    seeds = runs.y("y")
    assert len(set(seeds)) == 6
    assert all(0 <= seed < 2**31 for seed in seeds)
    assert seeds.tolist() == [float(int(run.key[:8], 16) // 2) for run in runs.runs]
    other = Journal(tmp_path / "other.jsonl")
    again = evaluate_points(simulator, POINTS[:2], SPACE, other, HowToRun(1), responses=["y"])
    np.testing.assert_array_equal(again.y("y"), seeds)


def test_a_vectorised_simulator_gets_arrays(journal, tmp_path):
    log = tmp_path / "log"
    simulator = named("columns", vectorized=True, batch=8, seed="seed", settings={"log": str(log)})
    points = np.column_stack([np.linspace(0.0, 0.9, 16), np.linspace(0.0, 1.0, 16)])
    runs = evaluate_points(simulator, points, SPACE, journal, HowToRun(1), responses=["y"])
    np.testing.assert_array_equal(runs.y("y"), points[:, 0] + 2.0 * points[:, 1])
    assert log.read_text().splitlines() == ["call 8", "call 8"]
    assert [run.extras["seed"] for run in runs.runs] == [int(run.key[:8], 16) // 2 for run in runs.runs]


def test_in_a_vectorised_batch_only_the_guilty_fail(journal, tmp_path):
    settings = {"log": str(tmp_path / "log"), "bad": 0.5}
    simulator = named("columns", vectorized=True, batch=8, settings=settings)
    points = [[0.25, 0.0], [0.5, 0.0], [0.75, 0.0], [1.0, 0.0]]
    runs = evaluate_points(simulator, points, SPACE, journal, HowToRun(1), responses=["y"])
    assert runs.done.tolist() == [True, False, True, False]
    assert runs.runs[1].error == "ValueError: bad point"
    assert runs.runs[3].error == "returned y = nan"


@pytest.mark.slow
def test_batches_of_short_runs_give_the_same_results(tmp_path):
    points = np.random.default_rng(1).random((300, 2))
    tables = []
    for batch in (None, 1, 7):
        journal = Journal(tmp_path / f"{batch}.jsonl")
        runs = evaluate_points(
            named("plane", batch=batch), points, SPACE, journal, HowToRun(2), responses=["y"]
        )
        tables.append(runs.y("y"))
        assert len(journal.path.read_text().splitlines()) == 300
    np.testing.assert_array_equal(tables[0], points[:, 0] + 2.0 * points[:, 1])
    np.testing.assert_array_equal(tables[1], tables[0])
    np.testing.assert_array_equal(tables[2], tables[0])


@pytest.mark.parametrize("jump_s", [-3.15e7, 3.15e7, -0.05])
def test_a_clock_that_jumps_changes_nothing(journal, monkeypatch, jump_s):
    """The calendar jumps at every look, in the worker that times the run and in the driver that waits."""
    year_s = 3.15e7
    looks = [0]

    def jumping():
        looks[0] += 1
        return 1.7e9 + jump_s * looks[0]

    class Calendar(datetime):
        @classmethod
        def now(cls, tz=None):
            return datetime.fromtimestamp(jumping() % 4e9, tz)

    for module in ("one_run.execute", "record.journal_lock"):
        monkeypatch.setattr(f"rsmkit.runs.{module}.datetime", Calendar)
    monkeypatch.setattr("time.time", jumping)
    slow = named("moody", timeout_s=0.2, settings={"trouble": "hang"})
    (outcome,) = run_tasks(slow, [Task("0" * 16, {"a": 0.9, "b": 0.0})], ("y",))  # timed in this process
    assert outcome.run.status == "timeout"
    assert 0.2 <= outcome.run.seconds < year_s
    events = []
    runs = evaluate_points(
        named("timed", timeout_s=120.0),
        [[0.1, 0.0], [0.2, 0.0]],
        SPACE,
        journal,
        HowToRun(1),
        responses=["y"],
        on_event=events.append,
    )
    assert runs.done.all()
    assert all(0.1 <= run.seconds < year_s for run in runs.runs)
    assert 0.2 <= events[-1].progress.elapsed_seconds < year_s
    assert looks[0] > 0


@pytest.mark.slow
def test_a_worker_whose_memory_keeps_growing_is_replaced(journal, tmp_path):
    simulator = named("hoarding", settings={"log": str(tmp_path / "log")})
    points = np.column_stack([np.linspace(0.0, 1.0, 10), np.zeros(10)])
    runs = evaluate_points(simulator, points, SPACE, journal, HowToRun(1), responses=["y"])
    np.testing.assert_array_equal(runs.y("y"), points[:, 0])
    workers = (tmp_path / "log").read_text().split()
    assert len(workers) == 10
    assert len(set(workers)) > 1
