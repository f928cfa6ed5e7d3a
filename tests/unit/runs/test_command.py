"""Simulators that are external programs."""

import math
import os
import shutil
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest
from runs_driver import all_gone

from rsmkit.runs.one_run.command import end_command, refuse_unused
from rsmkit.runs.one_run.command_template import fill
from rsmkit.runs.one_run.execute import Task, run_tasks
from rsmkit.runs.one_run.picking import pick_outputs
from rsmkit.runs.one_run.simulator import Simulator, SimulatorError
from rsmkit.runs.options import PickOptions, SimulatorOptions

DATA = Path(__file__).parents[2] / "data" / "runs"
KEY = "0123456789abcdef"


@pytest.fixture
def study(tmp_path):
    shutil.copy(DATA / "program.py", tmp_path)
    return tmp_path


def simulator(study, *words, program=("{python}", "{study}/program.py"), **options):
    return Simulator(SimulatorOptions(command=(*program, *words), **options), study)


def make(made, names=("y",), **factors):
    """One run, in this process."""
    (outcome,) = run_tasks(made, [Task(KEY, {"a": 0.1, "b": 2.0, **factors})], names)
    return outcome.run


def test_values_reach_the_command_with_every_digit_and_without_a_shell(study):
    made = simulator(study, "json", "{a}", "{b:.1f}", "{extra}", settings={"extra": 3})
    run = make(made, a=0.1 + 0.2)
    assert run.extras["words"] == ["0.30000000000000004", "2.0", "3"]
    assert run.responses == {"y": 0.30000000000000004 + 2.0 + 3.0}
    nasty = "; touch hacked $(touch hacked) `touch hacked` | touch hacked"
    run = make(simulator(study, "json", "1", "{text}", settings={"text": nasty}))
    assert (
        run.error
        == f"{{python}} ended with exit code 1: ValueError: could not convert string to float: {nasty!r}"
    )
    assert not list(study.rglob("hacked"))


def test_a_command_may_be_one_text(study):
    options = SimulatorOptions(command="{python} '{study}/program.py' json {a} \"{b}\"")
    assert options.words == ("{python}", "{study}/program.py", "json", "{a}", "{b}")
    assert make(Simulator(options, study)).responses == {"y": 2.1}


def test_input_files_are_filled_in_and_outputs_picked_by_rule(study):
    (study / "deck.template").write_text('{"a": {a}, "b": {b:.3e}, "comment": {"kept": "{{a}}"}}')
    outputs = {
        "y": PickOptions(file="sub/out.json", key="y"),
        "z": PickOptions(file="sub/out.json", key="list.0.z"),
        "drag": PickOptions(pattern=r"drag = (\S+)"),
        "last": PickOptions(file="table.csv", column="v"),
        "first": PickOptions(file="table.csv", column="v", row=0),
    }
    made = simulator(study, "files", inputs={"in.json": "deck.template"}, outputs=outputs)
    run = make(made, names=("y", "z", "drag", "last", "first"))
    assert run.responses == {"y": 0.2, "z": 2.0, "drag": -0.25, "last": 2.5, "first": 1.5}
    folder = study / "runs" / KEY
    assert (folder / "in.json").read_text() == '{"a": 0.1, "b": 2.000e+00, "comment": {"kept": "{a}"}}'
    assert (folder / "stdout.txt").read_text().startswith("a line of chatter")


def test_a_json_file_may_hold_the_results(study):
    (study / "deck").write_text('{"a": {a}, "b": {b}}')
    made = simulator(study, "files", inputs={"in.json": "deck"}, output_file="sub/out.json")
    assert make(made).responses == {"y": 0.2}


def test_folder_and_environment(study):
    run = make(simulator(study, "environment", environment={"MINE": "x"}))
    assert run.extras["cwd"] == str(study / "runs" / KEY)
    assert run.extras["MINE"] == "x"
    assert run.extras["PATH"] == os.environ["PATH"]


def test_folders_of_successes_go_when_they_are_not_kept(study):
    make(simulator(study, "json", "{a}", keep_folders=False))
    assert not (study / "runs" / KEY).exists()
    make(simulator(study, "fail", keep_folders=False))
    assert (study / "runs" / KEY / "stderr.txt").read_text() == "first\nmesh is tangled\n\n"


def test_a_folder_begins_empty(study):
    folder = study / "runs" / KEY
    folder.mkdir(parents=True)
    (folder / "leftover").touch()
    make(simulator(study, "json", "{a}"))
    assert not (folder / "leftover").exists()


@pytest.mark.parametrize(
    ("words", "options", "status", "error"),
    [
        (["fail"], {}, "failed", "{python} ended with exit code 3: mesh is tangled"),
        (["die"], {}, "crashed", "{python} died (SIGABRT)"),
        (["realtime"], {}, "crashed", f"{{python}} died (signal {signal.SIGRTMIN + 3})"),
        (["pipes"], {}, "failed", "stdout.txt is not a file"),
        (["pipes", "2"], {}, "failed", "{python} ended with exit code 2"),
        (["say", "no", "json"], {}, "failed", "the last line it printed is not JSON: 'no json'"),
        (
            ["say", "[1]"],
            {},
            "failed",
            "the last line it printed is not a JSON object of names and numbers: '[1]'",
        ),
        (["say", '{"y":NaN}'], {}, "failed", "returned y = nan"),
        (["say", '{"z":1}'], {}, "failed", "did not return y (it returned z)"),
        (
            ["nothing"],
            {},
            "failed",
            "printed nothing; its last line must be a JSON object of names and numbers",
        ),
        (
            ["say"],
            {"output_file": "out.json"},
            "failed",
            "out.json cannot be read: No such file or directory",
        ),
        (
            ["say", "hello"],
            {"outputs": {"y": PickOptions(pattern="drag = (.*)")}},
            "failed",
            "y: nothing in stdout.txt matches the pattern drag = (.*)",
        ),
        (
            ["say", "drag = lots"],
            {"outputs": {"y": PickOptions(pattern="drag = (.*)")}},
            "failed",
            "returned y = 'lots', which is not a number",
        ),
        (
            ["say", "a,b"],
            {"outputs": {"y": PickOptions(column="b")}},
            "failed",
            "y: stdout.txt has no column b (its head is a line of chatter)",
        ),
        (["say", '{"y":1}'], {"success_codes": (1,)}, "failed", "{python} ended with exit code 0"),
        (
            ["fail"],
            {"success_codes": (3,), "outputs": {"y": PickOptions(key="y", file="x")}},
            "failed",
            "x cannot",
        ),
    ],
)
def test_what_can_go_wrong_is_said(study, words, options, status, error):
    run = make(simulator(study, *words, **options))
    assert run.status == status
    assert run.error.startswith(error)


@pytest.mark.parametrize("kind", ["family", pytest.param("stubborn", marks=pytest.mark.slow)])
def test_a_time_limit_ends_the_whole_family(study, kind):
    pids = []
    for limit_s in (1.0, 10.0, 100.0):  # on a busy machine the family is late
        run = make(simulator(study, kind, timeout_s=limit_s))
        assert (run.status, run.error) == ("timeout", f"stopped after timeout_s = {limit_s:g} s")
        assert limit_s <= run.seconds < 3600.0  # it would have ended by itself after an hour
        with suppress(FileNotFoundError):
            pids = (study / "runs" / KEY / "pids").read_text().split()
        if len(pids) == 2:
            break
    assert len(pids) == 2
    assert all_gone([int(pid) for pid in pids])  # killed, but perhaps not quite dead yet


def test_bytes_that_are_no_text_do_no_harm(study):
    outputs = {"y": PickOptions(pattern=r"C = (\S+)")}
    assert make(simulator(study, "bytes", outputs=outputs)).responses == {"y": 7.0}
    run = make(simulator(study, "bytes", outputs={"y": PickOptions(pattern=r" = (\d,\d)")}))
    assert run.error == "returned y = '2,5', which is not a number"


def test_a_byte_order_mark_is_understood(study):
    assert make(simulator(study, "mark", output_file="out.json")).responses == {"y": 7.0}


def test_a_file_too_large_to_read_is_refused(study):
    run = make(simulator(study, "flood", outputs={"y": PickOptions(file="big.txt", pattern="(.)")}))
    assert run.error == "big.txt has 1048576 MB; results are read from at most 256 MB"


def test_a_pattern_that_takes_for_ever_is_stopped(study, monkeypatch):
    monkeypatch.setattr("rsmkit.runs.one_run.command.PICKING_S", 0.3)
    run = make(simulator(study, "say", "a" * 40 + "!", outputs={"y": PickOptions(pattern=r"((?:a+)+)$")}))
    assert (run.status, run.error) == ("failed", "its outputs could not be picked within 0.3 s")


@pytest.mark.parametrize(
    ("program", "message"),
    [
        (("no-such-program-anywhere",), r"no program no-such-program-anywhere .*looked in the search path"),
        (("./solver",), r"no program \./solver that can be executed \(looked in .*solver\)"),
    ],
)
def test_a_program_that_is_not_there_stops_everything(study, program, message):
    with pytest.raises(SimulatorError, match=message):
        make(simulator(study, program=program))


def test_a_program_beside_the_study_is_found(study):
    script = study / "solver"
    script.write_text(f"#!{sys.executable}\nprint('{{\"y\": 4}}')\n")
    script.chmod(0o755)
    assert make(simulator(study, program=("./solver",))).responses == {"y": 4.0}


def test_a_placeholder_without_a_value_stops_everything(study):
    with pytest.raises(
        SimulatorError, match=r"command: \{radius\} has no value; there are a, b, .* Write \{\{radius\}\}"
    ):
        make(simulator(study, "json", "{radius}"))


def test_a_template_that_is_not_there_stops_everything(study):
    with pytest.raises(SimulatorError, match=r"simulator\.inputs: .*deck: No such file"):
        make(simulator(study, "json", inputs={"in": "deck"}))


def test_what_shapes_the_results_is_part_of_the_identity(study):
    (study / "deck").write_text("one")
    before = simulator(study, "json", inputs={"in": "deck"}).identity
    assert before.startswith("'{python}' '{study}/program.py' json #")
    assert simulator(study, "json", inputs={"in": "deck"}).identity == before
    assert simulator(study, "json", inputs={"in": "deck"}, timeout_s=5.0).identity == before
    (study / "deck").write_text("two")
    assert simulator(study, "json", inputs={"in": "deck"}).identity != before
    rule = {"y": PickOptions(key="y")}
    assert simulator(study, "json", outputs=rule).identity != simulator(study, "json").identity


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("{a}", "0.1"),
        ("{a:.3f} {n} {flag} {word}", "0.100 3 true x y"),
        ("{{a}} { a } {} {'a': 1} {a: 1} {1a}", "{a} { a } {} {'a': 1} {a: 1} {1a}"),
        ("{tiny}", "5e-324"),
    ],
)
def test_templates(text, expected):
    values = {"a": 0.1, "n": 3, "flag": True, "word": "x y", "tiny": math.ulp(0.0)}
    assert fill(text, values, "here") == expected


@pytest.mark.parametrize("text", ["{a.__class__}", "{a[0]}", "{a!r}", "{0}"])
def test_templates_do_not_look_inside_values(text):
    assert fill(text, {"a": 1.0}, "here") == text


def test_a_format_that_does_not_fit_is_explained():
    with pytest.raises(SimulatorError, match=r"here: \{word:\.3f\} does not fit 'x'"):
        fill("{word:.3f}", {"word": "x"}, "here")


@pytest.mark.parametrize(
    ("options", "key", "message"),
    [
        ({}, "run", "is missing"),
        ({"run": "m:f", "command": "x"}, "run", "exclude each other"),
        ({"run": "m.f"}, "run", "must look like"),
        ({"run": "m:f; import os"}, "run", "must look like"),
        ({"command": "say 'hello"}, "command", "cannot be split"),
        ({"command": ("a", "")}, "command", "has an empty word"),
        ({"run": "m:f", "inputs": {"a": "b"}}, "inputs", "belongs to a command"),
        ({"command": "x", "vectorized": True}, "vectorized", "belongs to a Python callable"),
        ({"command": "x", "seed": "seed"}, "seed", "a command has {seed}"),
        ({"command": "x", "inputs": {"../../etc/passwd": "t"}}, "inputs", "must lie in the run's own folder"),
        ({"command": "x", "inputs": {"/etc/passwd": "t"}}, "inputs", "must lie in the run's own folder"),
        ({"command": "x", "output_file": ".."}, "output_file", "must lie in the run's own folder"),
        ({"run": "m:f", "timeout_s": 0.0}, "timeout_s", "must be positive"),
        ({"run": "m:f", "retries": -1}, "retries", "must be at least 0"),
        ({"run": "m:f", "replicates": 3}, "replicates", "deterministic = false"),
        ({"run": "m:f", "seed": "s", "settings": {"s": 1}}, "seed", "other than the settings"),
    ],
)
def test_mistakes_in_the_table_are_named(options, key, message):
    problems = SimulatorOptions(**options).problems()
    assert [found for found, text in problems if message in text] == [key], problems


@pytest.mark.parametrize(
    ("rule", "message"),
    [
        ({}, "exactly one of key, pattern and column, got none"),
        ({"key": "a", "column": "b"}, "got key and column"),
        ({"pattern": "("}, "is not a regular expression"),
        ({"pattern": "a"}, "it has 0"),
        ({"key": "a", "file": "../x"}, "own folder"),
    ],
)
def test_mistakes_in_a_rule_are_named(rule, message):
    assert any(message in text for _, text in PickOptions(**rule).problems())


def test_a_factor_that_the_program_never_receives_is_named(study):
    (study / "deck").write_text("length {length:.3f}, literally {{width}}")
    made = simulator(study, "{height}", inputs={"in": "deck"})
    refuse_unused(made, ["length", "height"])
    with pytest.raises(
        SimulatorError, match=r"never receives width, mass: neither command nor inputs have \{wid"
    ):
        refuse_unused(made, ["length", "width", "height", "mass"])
    refuse_unused(Simulator(SimulatorOptions(run="m:f"), study), ["width"])


def test_a_program_is_asked_to_end_before_it_is_killed(study):
    waits = "trap 'echo asked > asked; exit' TERM; while :; do sleep 0.05; done"
    run = make(simulator(study, program=("sh", "-c", waits), timeout_s=0.5))
    assert run.status == "timeout"
    assert (study / "runs" / KEY / "asked").read_text() == "asked\n"


@pytest.mark.skipif(not Path("/proc").exists(), reason="nothing tells when a process began")
def test_another_process_with_the_number_of_a_lost_program_is_let_live(tmp_path):
    with subprocess.Popen(["sleep", "60"], start_new_session=True) as process:
        birth = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()[19]
        (tmp_path / "process.txt").write_text(f"{process.pid} {int(birth) + 1}")
        end_command(tmp_path)
        assert process.poll() is None
        (tmp_path / "process.txt").write_text(f"{process.pid} {birth}")
        end_command(tmp_path)
        assert process.wait(10) == -signal.SIGKILL


@pytest.mark.parametrize(("row", "found"), [(0, 1.5e-3), (1, 20.0), (2, 3.0), (-1, 3.0), (-3, 1.5e-3)])
def test_rows_count_from_the_head_or_from_the_end(tmp_path, row, found):
    (tmp_path / "t.csv").write_text("x,y\n0,1.5d-3\n1,2.0D+1\n2,3\n")
    rule = PickOptions(file="t.csv", column="y", row=row)
    assert pick_outputs(SimulatorOptions(command="x", outputs={"y": rule}), tmp_path) == {"y": found}


@pytest.mark.parametrize(
    ("text", "number"), [("1.5d-3", 1.5e-3), ("-2.D+04", -2e4), ("7.d2", 700.0), (".5d0", 0.5)]
)
def test_numbers_as_fortran_prints_them(tmp_path, text, number):
    (tmp_path / "stdout.txt").write_text(f"drag = {text}\n")
    rule = PickOptions(pattern=r"drag = (\S+)")
    assert pick_outputs(SimulatorOptions(command="x", outputs={"y": rule}), tmp_path) == {"y": number}
