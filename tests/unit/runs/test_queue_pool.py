"""An evaluation on the queue of a batch system, whatever becomes of its jobs.

The stand-in answers as Slurm 22.05 does (``man sbatch``, ``man squeue``; a real one was watched); its nodes
make runs in this process, whenever the queue is asked.
"""

from pathlib import Path

import pytest
from smallest_study import SMALLEST

from rsmkit.errors import RsmkitError
from rsmkit.language.space import Space
from rsmkit.runs.array_task import make_runs
from rsmkit.runs.backends.queues import queue_pool, systems
from rsmkit.runs.backends.queues.array_jobs import read_wave, write_wave
from rsmkit.runs.backends.queues.systems import SilentError
from rsmkit.runs.evaluation import evaluate_points
from rsmkit.runs.how_to_run import HowToRun
from rsmkit.runs.one_run.execute import Task, run_tasks
from rsmkit.runs.one_run.interrupts import Interrupted
from rsmkit.runs.one_run.simulator import Simulator
from rsmkit.runs.options import SimulatorOptions
from rsmkit.runs.record.journal import Journal
from rsmkit.runs.record.run import Run, run_key
from rsmkit.stages.evaluate import evaluate_design
from rsmkit.stages.fit import fit_study
from rsmkit.stages.planning.plan import plan_design
from rsmkit.study.folder import open_study

SPACE = Space(a=(0.0, 1.0), b=(0.0, 1.0))
POINTS = [(i / 16, 0.5) for i in range(6)]


class Cluster:
    """Slurm, as far as its commands show it."""

    def __init__(self):
        self.jobs, self.tasks, self.calls, self.cancelled = {}, {}, [], []
        self.fates = []
        """What becomes of the next tasks: how many runs they make, and how they end."""
        self.deadly = {}
        """How jobs end that begin with a run at this a."""
        self.silent = []
        """What the next calls say instead of an answer."""

    def __call__(self, words):
        self.calls.append(words)
        if self.silent and words[0] == self.silent[0][0]:
            return 1, "", self.silent.pop(0)[1]
        return 0, getattr(self, words[0])(dict(word.partition("=")[::2] for word in words[1:]), words), ""

    def sbatch(self, options, words):
        job = str(len(self.jobs) + 1)
        self.jobs[job] = options["--job-name"], Path(words[-1]).parent
        first, last = options["--array"].split("-")
        self.tasks |= {(job, index): "PENDING" for index in range(int(first), int(last) + 1)}
        return f"{job}\n"

    def squeue(self, options, words):
        if "--name" in options:
            return "".join(f"{job}\n" for job, (name, _) in self.jobs.items() if name == options["--name"])
        shown = []
        for (job, index), state in self.tasks.items():
            if job in options["--jobs"].split(","):
                if state == "PENDING":
                    self.tasks[job, index] = self.work(job, index)
                shown.append(f"{job}|{index}|{state}|n1\n")  # as it was when it was asked
        return "".join(shown)

    def sacct(self, options, words):
        return ""

    def scancel(self, options, words):
        self.cancelled += words[1:]
        return ""

    def work(self, job, index):
        """Let a node work on one task; give its state from then on."""
        wave = read_wave(self.jobs[job][1])
        tasks, file = wave.tasks(index), wave.task_file(index)
        count, state = self.fates.pop(0) if self.fates else (None, "COMPLETED")
        if count == "wait":
            return "PENDING"
        if tasks[0].factors["a"] in self.deadly:
            count, state = 0, self.deadly[tasks[0].factors["a"]]
        file.open()
        for task in tasks[:count]:
            file.begin(task)
            file.end(run_tasks(wave.simulator, [task], wave.form.names))
        if count is not None and count < len(tasks) and state != "CANCELLED":
            file.begin(tasks[count])
        return state


@pytest.fixture
def cluster(monkeypatch):
    for name in ("LOOK_S", "ASK_S", "LAG_S"):
        monkeypatch.setattr(queue_pool, name, 0.0)
    cluster = Cluster()
    monkeypatch.setattr(systems, "_ask", cluster)
    return cluster


@pytest.fixture
def simulator(tmp_path):
    (tmp_path / "s.py").write_text(
        "from pathlib import Path\n"
        "def f(a, b):\n"
        f"    with open({str(tmp_path / 'made')!r}, 'a') as file:\n"
        "        file.write(f'{a}\\n')\n"
        "    return {'y': a + b}\n"
    )
    return Simulator(SimulatorOptions(run="s:f"), tmp_path)


@pytest.fixture(autouse=True)
def forgotten_modules(monkeypatch):
    """Every folder has a module s of its own."""
    import sys

    from rsmkit.runs.one_run import execute

    monkeypatch.setattr(execute, "_loaded", {})
    monkeypatch.setattr(sys, "path", [*sys.path])
    yield
    sys.modules.pop("s", None)


def evaluate(simulator, jobs=2, points=POINTS, watch=None, **how):
    journal = Journal(simulator.folder / "runs.jsonl")
    how = HowToRun(jobs, "slurm", **how)
    return evaluate_points(simulator, points, SPACE, journal, how, responses=["y"], on_event=watch)


def made(simulator):
    path = simulator.folder / "made"
    return sorted(path.read_text().split()) if path.exists() else []


def lines(simulator):
    return (simulator.folder / "runs.jsonl").read_text().splitlines()


def waves(simulator):
    return list((simulator.folder / "runs" / "queue").glob("*"))


def test_an_evaluation_is_one_array_of_shares(cluster, simulator):
    runs = evaluate(simulator)
    assert runs.y("y").tolist() == [a + b for a, b in POINTS]
    (submitted,) = [words for words in cluster.calls if words[0] == "sbatch"]
    assert "--array=1-2" in submitted
    assert len(lines(simulator)) == len(made(simulator)) == 6
    assert waves(simulator) == []


def test_what_is_asked_of_the_system_is_passed_on(cluster, simulator):
    options = {"queue": "long", "account": "me", "time": "1:00:00", "memory": "2G", "cpus": 3}
    evaluate(simulator, backend_options={**options, "extra": "--qos=low --comment 'a b'"})
    words = next(words for words in cluster.calls if words[0] == "sbatch")
    assert {"--partition=long", "--account=me", "--time=1:00:00", "--mem=2G", "--cpus-per-task=3"} < {*words}
    assert words[-4:-1] == ["--qos=low", "--comment", "a b"]


@pytest.mark.parametrize("word", ["NODE_FAIL", "PREEMPTED", "BOOT_FAIL", "FAILED"])
def test_what_a_lost_job_has_made_counts_and_the_rest_is_made_by_another(cluster, simulator, word):
    cluster.fates = [(1, word)]
    runs = evaluate(simulator)
    assert runs.done.all()
    assert len(made(simulator)) == len(lines(simulator)) == 6


def test_a_run_that_loses_every_job_is_blamed_and_no_other(cluster, simulator):
    cluster.deadly = {0.0: "NODE_FAIL"}
    runs = evaluate(simulator)
    assert [run.status for run in runs.runs] == ["crashed", *["done"] * 5]
    assert runs.runs[0].error.startswith("its job was lost 3 times (slurm job ")
    assert len(made(simulator)) == 5


def test_runs_of_a_cancelled_job_are_failed_with_the_reason(cluster, simulator):
    cluster.fates = [(1, "CANCELLED by 1000")]
    runs = evaluate(simulator)
    assert [run.status for run in runs.runs] == ["done", "failed", "failed", "done", "done", "done"]
    assert runs.runs[1].error == "cancelled (slurm job 1, task 1 on n1: CANCELLED by 1000)"
    runs = evaluate(simulator, retry_failed=True)
    assert runs.done.all()
    assert (runs.runs[1].attempt, len(made(simulator))) == (2, 6)


def test_a_run_that_needs_too_much_memory_is_crashed(cluster, simulator):
    cluster.fates = [(1, "OUT_OF_MEMORY")]
    runs = evaluate(simulator)
    assert [run.status for run in runs.runs] == ["done", "crashed", *["done"] * 4]
    assert "out of memory" in runs.runs[1].error


def test_without_a_time_jobs_get_what_past_runs_took_with_room_to_spare(cluster, simulator):
    """Two rounds of three runs at twice the 99 % quantile, and ten minutes: 10 min + 2 x 2 x 50 min."""
    with Journal(simulator.folder / "runs.jsonl") as journal:
        for i in range(100):
            factors = {"a": i / 100, "b": 1.0}
            seconds = 3000.0 if i >= 98 else 1.0  # the 99th and the last of a hundred
            run = Run(run_key("s:f", {}, factors), "s:f", {}, factors, 0, "done", {"y": 1.0}, {}, seconds)
            journal.append(run)
    points = [*POINTS[:4], *((i / 100, 1.0) for i in range(100))]
    evaluate(simulator, points=points)
    words = next(words for words in cluster.calls if words[0] == "sbatch")
    assert "--time=03:30:00" in words
    evaluate(simulator, points=[*points, (0.9, 0.9)], backend_options={"time": "0:30"})
    assert any("--time=0:30" in words for words in cluster.calls)


def test_a_time_that_was_only_taken_from_past_runs_is_doubled_before_a_run_is_given_up(cluster, simulator):
    evaluate(simulator)
    cluster.calls, cluster.deadly = [], {0.9: "TIMEOUT"}
    runs = evaluate(simulator, points=[*POINTS, (0.9, 0.5)])
    assert [run.status for run in runs.runs] == [*["done"] * 6, "timeout"]
    assert len([words for words in cluster.calls if words[0] == "sbatch"]) == 3


def test_a_script_of_the_user_s_own_is_what_nodes_are_given(cluster, simulator, monkeypatch):
    (simulator.folder / "job.sh").write_text("#!/bin/bash\n#SBATCH --gres=gpu:1\ntime {command}\n")
    scripts = []
    sbatch = cluster.sbatch

    def keep(options, words):
        scripts.append(Path(words[-1]).read_text())
        return sbatch(options, words)

    monkeypatch.setattr(cluster, "sbatch", keep)
    evaluate(simulator, backend_options={"template": "job.sh"})
    head, gpu, command = scripts[0].splitlines()
    assert (head, gpu) == ("#!/bin/bash", "#SBATCH --gres=gpu:1")
    assert command.startswith("time env OMP_NUM_THREADS=1 ")
    assert command.endswith(' "$SLURM_ARRAY_TASK_ID"')
    assert " -m rsmkit.runs.array_task " in command


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("job.sh", b"#!/bin/sh\n", r"must have \{command\} once, .* it has it 0 times"),
        ("job.sh", b"{command}\n{command}\n", "it has it 2 times"),
        ("job.sh", b"\xff{command}", "is no text in UTF-8"),
        ("other.sh", b"", "other.sh cannot be read: No such file"),
        ("../job.sh", b"", "lies outside the study's folder"),
    ],
)
def test_a_script_that_could_not_be_used_is_refused_before_anything_is_submitted(
    cluster, simulator, name, text, message
):
    (simulator.folder / "job.sh").write_bytes(text)
    with pytest.raises(RsmkitError, match=message):
        evaluate(simulator, backend_options={"template": name})
    assert cluster.calls == []


def test_a_job_whose_time_is_over_is_followed_by_another_unless_one_run_has_had_all_of_it(cluster, simulator):
    cluster.fates, cluster.deadly = [(1, "TIMEOUT")], {POINTS[1][0]: "TIMEOUT"}
    runs = evaluate(simulator)
    assert [run.status for run in runs.runs] == ["done", "timeout", *["done"] * 4]


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_job_that_cannot_begin_ends_the_evaluation(cluster, simulator, monkeypatch, jobs):
    def broken(job, index):
        (cluster.jobs[job][1] / f"{index}.log").write_text("job.sh: python9: not found\n")
        return "FAILED"

    monkeypatch.setattr(cluster, "work", broken)
    with pytest.raises(RsmkitError, match=r"ended before it began a run .*python9: not found"):
        evaluate(simulator, jobs)
    monkeypatch.undo()
    for name in ("LOOK_S", "ASK_S", "LAG_S"):
        monkeypatch.setattr(queue_pool, name, 0.0)
    monkeypatch.setattr(systems, "_ask", Cluster())
    assert evaluate(simulator, jobs).done.all()


class Killed(BaseException):
    """Stands for the death of a driver, which takes nothing back."""


def killed(cluster, simulator, monkeypatch, at):
    """Evaluate until an event, and die there."""

    def watch(event):
        if event.kind == at:
            raise Killed

    with monkeypatch.context() as patch:
        patch.setattr(queue_pool.QueuePool, "close", lambda self, *, kill: None)
        with pytest.raises(Killed):
            evaluate(simulator, watch=watch)


def test_jobs_of_a_dead_driver_are_taken_up_and_not_submitted_twice(cluster, simulator, monkeypatch):
    cluster.fates = [("wait", ""), (1, "RUNNING"), ("wait", ""), ("wait", "")]
    killed(cluster, simulator, monkeypatch, "finished")
    (wave,) = waves(simulator)
    cluster.tasks["1", 2] = "PENDING"
    assert len(made(simulator)) == 1
    evaluate(simulator)
    assert len([words for words in cluster.calls if words[0] == "sbatch"]) == 1
    assert len(lines(simulator)) == 6
    assert not wave.exists()


def test_outcomes_that_the_dead_driver_never_saw_count(cluster, simulator, monkeypatch):
    killed(cluster, simulator, monkeypatch, "finished")  # after the first batch is in the journal
    assert len(made(simulator)) == 6
    assert evaluate(simulator).done.all()
    assert len(made(simulator)) == len(lines(simulator)) == 6
    assert waves(simulator) == []


def test_what_a_driver_that_died_at_the_very_end_has_left_is_removed(cluster, simulator, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(queue_pool.WaveFolder, "remove", lambda self: None)
        evaluate(simulator)
    assert len(waves(simulator)) == 1
    other = Task("0" * 16, {"a": 0.9, "b": 0.9})
    kept = write_wave(simulator.folder / "runs" / "queue", "slurm", simulator, ("y",), [[other]], 1)
    assert evaluate(simulator).done.all()
    assert waves(simulator) == [kept.path]


def test_a_job_whose_number_was_not_noted_is_found_by_its_name(cluster, simulator, monkeypatch):
    def note(self, job):
        raise Killed

    with monkeypatch.context() as patch:
        patch.setattr(queue_pool.WaveFolder, "note_job", note)
        patch.setattr(queue_pool.WaveFolder, "remove", lambda self: None)
        patch.setattr(queue_pool.QueuePool, "close", lambda self, *, kill: None)
        with pytest.raises(Killed):
            evaluate(simulator)
    assert evaluate(simulator).done.all()
    assert len([words for words in cluster.calls if words[0] == "sbatch"]) == 1


def test_a_wave_that_was_never_submitted_is_made_anew(cluster, simulator):
    task = Task("0" * 16, {"a": 0.1, "b": 0.2})
    write_wave(simulator.folder / "runs" / "queue", "slurm", simulator, ("y",), [[task]], 1)
    assert evaluate(simulator).done.all()


def test_asked_to_stop_once_the_jobs_stay_in_the_queue(cluster, simulator):
    import signal

    cluster.fates, heard = [("wait", "")] * 2, []

    def watch(event):
        if event.kind == "started" and not heard:
            heard.append(event)
            signal.raise_signal(signal.SIGINT)

    with pytest.raises(Interrupted):
        evaluate(simulator, jobs=1, watch=watch)
    assert cluster.cancelled == []
    assert evaluate(simulator).done.all()


def test_a_silent_system_is_asked_again(cluster, simulator):
    cluster.silent = [
        ("squeue", "slurm_load_jobs error: Unable to contact slurm controller"),
        ("squeue", "slurm_load_jobs error: Socket timed out"),
    ]
    assert evaluate(simulator).done.all()


def test_a_refusal_is_said_in_its_own_words(cluster, simulator):
    cluster.silent = [("sbatch", "sbatch: error: invalid partition specified: lang")]
    with pytest.raises(RsmkitError, match="refuses the job: sbatch: error: invalid partition"):
        evaluate(simulator, backend_options={"queue": "lang"})
    assert waves(simulator) == []


def test_a_submission_whose_answer_was_lost_is_not_made_twice(cluster, simulator, monkeypatch):
    def sbatch(options, words):
        Cluster.sbatch(cluster, options, words)
        raise SilentError("sbatch timed out after 60 s")

    monkeypatch.setattr(cluster, "sbatch", sbatch)
    assert evaluate(simulator).done.all()
    assert len(cluster.jobs) == 1


def test_a_task_of_an_array_goes_on_after_what_it_has_made(tmp_path, simulator):
    tasks = [Task(f"{i:016x}", {"a": i / 8, "b": 0.0}) for i in range(3)]
    wave = write_wave(tmp_path / "queue", "slurm", simulator, ("y",), [tasks], 1)
    file = wave.task_file(1)
    file.open()
    file.end(run_tasks(simulator, tasks[:1], ("y",)))
    with open(file.path, "ab") as stream:
        stream.write(b'{"run": {"schema": 1, "ke')  # torn as the node died
    assert make_runs(wave.path, 1) == 0
    outcomes = list(wave.task_file(1).read_on())
    assert [outcome.run.key for outcome in outcomes] == [task.key for task in tasks]
    assert made(simulator) == ["0.0", "0.125", "0.25"]
    assert make_runs(wave.path, 2) == 0  # an array may have one task too many


def test_a_task_that_opens_its_file_anew_has_begun_nothing_even_behind_a_torn_line(tmp_path, simulator):
    tasks = [Task(f"{i:016x}", {"a": i / 8, "b": 0.0}) for i in range(2)]
    wave = write_wave(tmp_path / "queue", "slurm", simulator, ("y",), [tasks], 1)
    file = wave.task_file(1)
    file.open()
    file.begin(tasks[0])
    with open(file.path, "ab") as stream:
        stream.write(b'{"beg')  # torn as the node died
    told = wave.task_file(1)
    assert (list(told.read_on()), told.begun) == ([], {tasks[0].key})
    file.open()
    file.begin(tasks[1])
    assert (list(told.read_on()), told.begun) == ([], {tasks[1].key})


def test_a_line_that_is_seen_before_it_is_whole_is_read_once_it_is(tmp_path, simulator):
    tasks = [Task(f"{i:016x}", {"a": i / 8, "b": 0.0}) for i in range(2)]
    wave = write_wave(tmp_path / "queue", "slurm", simulator, ("y",), [tasks], 1)
    file = wave.task_file(1)
    file.open()
    file.end(run_tasks(simulator, tasks, ("y",)))
    written, told = file.path.read_bytes(), wave.task_file(1)
    file.path.write_bytes(written[:-30])
    assert [outcome.run.key for outcome in told.read_on()] == [tasks[0].key]
    file.path.write_bytes(written)
    assert [outcome.run.key for outcome in told.read_on()] == [tasks[1].key]


def test_without_the_commands_it_is_said_where_to_run(simulator, monkeypatch):
    monkeypatch.setenv("PATH", "/nowhere")
    with pytest.raises(RsmkitError, match=r"sbatch cannot be called .*where jobs are submitted"):
        evaluate(simulator)


def test_a_study_that_wanders_from_place_to_place_ends_as_one_that_stays(cluster, tmp_path):
    distributed = pytest.importorskip("distributed")

    def study(name):
        folder = tmp_path / name
        folder.mkdir()
        (folder / "study.toml").write_text(f'{SMALLEST}[design]\nkind = "sobol"\nruns = 12\n')
        (folder / "s.py").write_text("def f(a, b):\n    return {'y': a * a + b}\n")
        plan_design(open_study(folder))
        return folder

    stays, wanders = study("stays"), study("wanders")
    evaluate_design(open_study(stays), HowToRun(1))
    evaluate_design(open_study(wanders), HowToRun(1, limit=4))
    evaluate_design(open_study(wanders), HowToRun(2, "slurm", limit=4))
    with distributed.LocalCluster(1, threads_per_worker=1, processes=False, dashboard_address=None) as local:
        how = HowToRun(backend="dask", backend_options={"scheduler": local.scheduler_address})
        found = evaluate_design(open_study(wanders), how).overview()
    assert (found["made"], found["done"]) == (4, 12)
    for folder in (stays, wanders):
        fit_study(open_study(folder))
    assert (wanders / "model.json").read_bytes() == (stays / "model.json").read_bytes()
