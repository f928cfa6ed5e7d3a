"""What Slurm, PBS and the options of a batch system say, each in its own words."""

import json

import pytest
from smallest_study import SMALLEST

from rsmkit.errors import RsmkitError
from rsmkit.runs.backends.options import SlurmOptions
from rsmkit.runs.backends.queues import systems
from rsmkit.runs.backends.queues.job_times import PastRuns
from rsmkit.runs.backends.queues.systems import SYSTEMS, JobState
from rsmkit.runs.backends.registry import backend_options, pool_maker
from rsmkit.runs.how_to_run import EvaluateOptions, HowToRun
from rsmkit.runs.one_run.simulator import Simulator
from rsmkit.runs.options import SimulatorOptions
from rsmkit.study.folder import open_study


@pytest.mark.parametrize(
    ("durations", "rounds", "timeout_s", "doubled", "time"),
    [
        ([1.0] * 4, 1, None, 0, ""),
        ([30.0] * 5, 1, None, 0, "00:11:00"),
        ([30.0] * 5, 60, None, 0, "01:10:00"),
        ([30.0] * 5, 60, 45.0, 0, "00:55:00"),
        ([30.0] * 5, 60, None, 2, "04:10:00"),
        ([*[30.0] * 99, 1e6], 1, None, 0, "00:11:00"),
        ([3600.0] * 5, 100, None, 0, "200:10:00"),
    ],
)
def test_the_time_of_a_job(durations, rounds, timeout_s, doubled, time):
    past = PastRuns()
    for seconds in durations:
        past.add(seconds)
    assert past.job_time(rounds, timeout_s, doubled) == time


def test_slurm_in_its_own_words(monkeypatch):
    answers = {
        "squeue": "7|1|RUNNING|n1\n7|2|PENDING|\n8|N/A|RUNNING|n2\n",
        "sacct": "9_1|CANCELLED by 0|n3\n9_2|OUT_OF_MEMORY|n4\n9_[3-5]|PENDING|None assigned\n",
    }
    monkeypatch.setattr(systems, "_ask", lambda words: (0, answers[words[0]], ""))
    assert SYSTEMS["slurm"].states(["7", "9"]) == {
        ("7", 1): JobState("running", "RUNNING", "n1"),
        ("7", 2): JobState("waiting", "PENDING", ""),
        ("9", 1): JobState("cancelled", "CANCELLED by 0", "n3"),
        ("9", 2): JobState("memory", "OUT_OF_MEMORY", "n4"),
    }


def test_pbs_in_its_own_words(monkeypatch, tmp_path):
    """As the OpenPBS reference guide shows ``qstat -f -F json``."""
    jobs = {
        "12[].head": {"Job_Name": "rsmkit-1", "job_state": "B"},
        "12[1].head": {"Job_Name": "rsmkit-1", "job_state": "R", "exec_host": "n1/0"},
        "12[2].head": {"job_state": "Q"},
        "12[3].head": {"job_state": "X", "Exit_status": 0},
        "12[4].head": {"job_state": "X", "Exit_status": -29},
        "12[5].head": {"job_state": "X", "Exit_status": 271},
        "12[6].head": {"job_state": "X", "Exit_status": 137},
    }
    called = []

    def ask(words):
        called.append(words)
        return 0, json.dumps({"Jobs": jobs}) if words[0] == "qstat" else "12[].head\n", ""

    monkeypatch.setattr(systems, "_ask", ask)
    system = SYSTEMS["pbs"]
    states = system.states(["12[].head"])
    assert {index: state.fate for (_, index), state in states.items()} == {
        1: "running",
        2: "waiting",
        3: "done",
        4: "overtime",
        5: "cancelled",
        6: "failed",
    }
    assert states["12[].head", 1].node == "n1"
    assert (system.find("rsmkit-1"), system.find("rsmkit-2")) == ("12[].head", "")
    options = backend_options("pbs", queue="long", time="1:00:00", cpus=2)
    assert system.submit(options, "rsmkit-1", 1, tmp_path / "job.sh") == "12[].head"
    words = called[-1]
    assert words[words.index("-J") + 1] == "1-2"  # it has no arrays of one
    assert {"select=1:ncpus=2", "walltime=1:00:00", "long"} < {*words}


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"time": "soon"}, "needs a time such as 12:00:00, got 'soon'"),
        ({"memory": "lots"}, "needs a memory such as 4G"),
        ({"extra": "--comment 'a"}, "cannot split extra into words"),
        ({"template": "job.sh", "setup": "module load x"}, "needs no setup beside a template"),
        ({"cpus": 0}, "needs cpus of at least 1"),
    ],
)
def test_options_no_system_would_take(options, message, tmp_path):
    simulator = Simulator(SimulatorOptions(run="s:f"), tmp_path)
    with pytest.raises(RsmkitError, match=message):
        pool_maker("slurm", SlurmOptions(**options), simulator, 1)


def test_a_study_says_where_its_runs_are_made(tmp_path):
    (tmp_path / "study.toml").write_text(
        f'{SMALLEST}[evaluate]\nbackend = "slurm"\njobs = 20\n[evaluate.options]\nqueue = "long"\n'
    )
    table = open_study(tmp_path).study.file.evaluate
    assert table.how() == HowToRun(20, "slurm", {"queue": "long"})
    assert table.how(None, None, {"time": "1:00:00"}).backend_options == {"queue": "long", "time": "1:00:00"}
    assert table.how(2, "loky") == HowToRun(2, "loky")


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"backend": "slurn"}, "did you mean 'slurm'"),
        ({"options": {"queue": "x"}}, "queue has no effect on the loky backend"),
        ({"backend": "slurm", "options": {"time": "soon"}}, "needs a time"),
        ({"jobs": 0}, "must be at least 1"),
    ],
)
def test_what_is_wrong_with_the_table_is_said(table, message):
    ((_, text),) = EvaluateOptions(**table).problems()
    assert message in text
