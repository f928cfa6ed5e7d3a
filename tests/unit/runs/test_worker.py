"""What one worker process makes of a run, whatever the simulator does to it."""

import os
from pathlib import Path

import pytest

from rsmkit.runs.backends.loky_pool import LokyPool
from rsmkit.runs.one_run.execute import Task
from rsmkit.runs.one_run.simulator import Simulator
from rsmkit.runs.options import SimulatorOptions
from rsmkit.runs.record.run import run_from_json, run_to_json

DATA = Path(__file__).parents[2] / "data" / "runs"


def named(function, **options):
    return Simulator(SimulatorOptions(run=f"simulators:{function}", **options), DATA)


@pytest.fixture(scope="module")
def in_worker():
    """Makes runs in one long-lived worker process."""
    pool = LokyPool(1)

    def make(simulator, factors):
        (outcome,) = pool.submit(simulator, [Task("0" * 16, factors)], ("y",)).result(timeout=240)
        return outcome

    yield make
    pool.close(kill=True)


@pytest.mark.parametrize(
    ("trouble", "status", "error"),
    [
        ("nan", "failed", "returned y = nan"),
        ("inf", "failed", "returned y = -inf"),
        ("huge", "failed", "returned y = inf"),
        ("text", "failed", "returned y = '12.5', which is not a number"),
        ("none", "failed", "returned NoneType instead of a mapping of names to numbers: None"),
        ("missing", "failed", "did not return y (it returned z)"),
        ("complex", "failed", "returned y = (1+2j), which is not a number"),
        ("path", "failed", "returned y = PosixPath('somewhere'), which is not a number"),
        ("exit", "failed", "SystemExit: goodbye"),
        ("interrupt", "failed", "KeyboardInterrupt"),
        ("vandalise", "failed", "ValueError: left a mess"),
        ("bad_str", "failed", "OddError"),
        ("memory", "failed", "MemoryError"),
        ("recursion", "failed", "RecursionError: maximum recursion depth exceeded"),
        ("thread", "done", ""),
        ("base", "failed", "BaseException: mine"),
        ("odd_error", "failed", "_OddError: cannot be pickled"),
        ("treacherous", "failed", "RuntimeError: never"),
        ("nested", "done", ""),
        ("nested_less", "done", ""),
        ("wide", "done", ""),
        ("long_texts", "done", ""),
        ("odd_text", "done", ""),
        ("bool", "failed", "returned y = True, which is not a number"),
        ("list", "failed", "returned y = [1.0], which is not a number"),
        ("inner_dict", "failed", "returned y = {'y': 1.0}, which is not a number"),
        ("lone_surrogate", "done", ""),
        ("any_keys", "done", ""),
        ("array", "done", ""),
        ("signals_itself", "done", ""),
        ("floods", "done", ""),
    ],
)
def test_outcomes_inside_one_worker(trouble, status, error, in_worker):
    run = in_worker(named("moody", settings={"trouble": trouble}), {"a": 0.9, "b": 0.0}).run
    assert run_from_json(run_to_json(run)) == run, "it can be read back"
    assert len(run_to_json(run)) < 500_000
    # how a RecursionError ends depends on the version of Python
    assert (run.status, run.error.removesuffix(" in comparison")) == (status, error)


def test_a_value_that_cannot_be_sent_back_fails_its_run_only(in_worker):
    outcome = in_worker(named("moody", settings={"trouble": "unpicklable"}), {"a": 0.9, "b": 0.0})
    assert outcome.run.status == "failed"
    assert "which is not a number" in outcome.run.error


def test_a_copy_of_the_worker_that_comes_back_is_ended(in_worker):
    outcome = in_worker(named("moody", settings={"trouble": "forks"}), {"a": 0.9, "b": 0.0})
    assert outcome.run.responses == {"y": 0.0}  # as which the copy ended


def test_a_run_may_use_processes_of_its_own(in_worker):
    outcome = in_worker(named("moody", timeout_s=120.0, settings={"trouble": "spawns"}), {"a": 0.9, "b": 0.0})
    assert outcome.run.responses == {"y": 1.0}


def test_streams_that_a_run_broke_are_whole_in_the_next(in_worker):
    broken = in_worker(named("moody", settings={"trouble": "breaks_streams"}), {"a": 0.9, "b": 0.0})
    assert broken.run.error == "ValueError: cannot speak"
    loud = in_worker(named("loud", timeout_s=120.0), {"a": 0.1, "b": 0.0})
    assert "this goes to standard output" in loud.output


def test_a_run_begins_where_the_worker_began(in_worker):
    in_worker(named("moody", settings={"trouble": "vandalise"}), {"a": 0.9, "b": 0.0})
    assert in_worker(named("where"), {"a": 0.1, "b": 0.0}).run.extras["folder"] == os.getcwd()


def test_what_a_failing_run_prints_is_kept(in_worker):
    outcome = in_worker(named("loud"), {"a": 0.1, "b": 0.0})
    assert sorted(outcome.output.splitlines()) == [
        "and this to standard error",
        "this goes to standard output",
    ]
    assert in_worker(named("plane"), {"a": 0.1, "b": 0.0}).output == ""


def test_what_a_run_prints_does_not_fill_the_disk(in_worker):
    outcome = in_worker(named("moody", settings={"trouble": "floods_the_disk"}), {"a": 0.9, "b": 0.0})
    assert outcome.run.error == "ValueError: False True", "never all of it, and in the end little"
    assert outcome.output == "y" * 20_000, "the end of it"
    assert in_worker(named("loud", timeout_s=120.0), {"a": 0.1, "b": 0.0}).output.count("standard") == 2


def test_a_simulator_that_waits_for_typing_fails_at_once(in_worker):
    assert in_worker(named("reads"), {"a": 0.1, "b": 0.0}).run.error.startswith("EOFError")


def test_linear_algebra_has_one_thread(in_worker):
    run = in_worker(named("threads"), {"a": 0.1, "b": 0.0}).run
    assert run.responses == {"y": 1.0}
    assert run.extras == {"blas": "1"}


def test_a_slow_run_is_stopped_at_its_time_limit(in_worker):
    outcome = in_worker(named("moody", timeout_s=0.5, settings={"trouble": "hang"}), {"a": 0.9, "b": 0.0})
    assert outcome.run.status == "timeout"
    assert outcome.run.error == "stopped after timeout_s = 0.5 s"
    assert outcome.run.seconds >= 0.5
    assert "in _hang" in outcome.traceback


def test_a_vectorised_simulator_must_return_arrays(in_worker):
    run = in_worker(named("scalar_for_arrays", vectorized=True), {"a": 0.1, "b": 0.0}).run
    assert run.error == "returned y = 1.0, which is not an array of length 1"
