"""The index beside a large journal: it saves time, and nothing depends on it."""

import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from smallest_study import SMALLEST

from rsmkit.cli.commands import main
from rsmkit.runs.agenda import caller_of
from rsmkit.runs.how_to_run import HowToRun
from rsmkit.runs.record import journal as journal_module
from rsmkit.runs.record import row_states
from rsmkit.runs.record.journal import Journal
from rsmkit.runs.record.meaning import Meaning
from rsmkit.runs.record.run import Run, run_from_json, run_key
from rsmkit.stages.evaluate import evaluate_design, evaluation_agenda
from rsmkit.stages.fit import fit_study
from rsmkit.stages.looks.status import study_status
from rsmkit.stages.planning.plan import plan_design
from rsmkit.study import run_counts
from rsmkit.study.folder import open_study

STUDY = f"""{SMALLEST}[design]
kind = "sobol"
runs = 16
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A study with 12 of 16 runs, one of them failed, which counts as large."""
    monkeypatch.setattr(run_counts, "WORTH_BYTES", 1)
    (tmp_path / "study.toml").write_text(STUDY)
    (tmp_path / "s.py").write_text("def f(a, b):\n    return {'y': a + b}\n")
    plan_design(open_study(tmp_path))
    make(tmp_path, 12, failed=1)
    return tmp_path


def make(folder, count, failed=0):
    """Write runs into the journal."""
    todo = evaluation_agenda(open_study(folder)).todo[:count]
    with Journal(folder / "runs.jsonl") as journal:
        for i, task in enumerate(todo):
            status, values = ("failed", {}) if i < failed else ("done", {"y": float(i)})
            journal.append(Run(task.key, "s:f", {}, task.factors, 0, status, values, {}, 0.1))


def told(folder):
    return study_status(open_study(folder)).overview()


def counted(folder):
    """The status without an index."""
    (folder / "runs.jsonl.index").unlink(missing_ok=True)
    return told(folder)


def test_the_journal_is_not_read_again_while_nothing_has_changed(folder, monkeypatch):
    first = told(folder)
    assert first["stages"][1]["reason"] == "11 of 16 runs done, 1 failed"
    monkeypatch.setattr(Journal, "load", lambda self: pytest.fail("read the journal"))
    assert told(folder) == first


def more_runs(folder):
    make(folder, 2)


def another_line(folder):
    lines = (folder / "runs.jsonl").read_text().splitlines(keepends=True)
    (folder / "runs.jsonl").write_text("".join(lines[:5]))


def another_response(folder):
    (folder / "study.toml").write_text(STUDY.replace("y = {}", "z = {}"))


def another_setting(folder):
    (folder / "study.toml").write_text(STUDY + "[simulator.settings]\nc = 1\n")


def another_version(folder):
    (folder / "study.toml").write_text(STUDY.replace('"s:f"', '"s:f"\nversion = 2'))


def another_design(folder):
    (folder / "study.toml").write_text(STUDY.replace("runs = 16", "runs = 18"))
    plan_design(open_study(folder))


def damage(folder):
    (folder / "runs.jsonl.index").write_text('{"counted_from": {}, "standing": 5}')


def an_answer_in_the_middle(folder):
    """As many bytes as before, and one line more."""
    text = (folder / "runs.jsonl").read_text()
    (folder / "runs.jsonl").write_text(
        text.replace('"status":"done"', '"status":"late"', 1).replace("late", "failed")
    )
    make(folder, 1)


def the_same_size(folder):
    text = (folder / "runs.jsonl").read_text()
    (folder / "runs.jsonl").write_text(text.replace('"seconds":0.1', '"seconds":0.2', 1))
    make(folder, 1)


def another_answer_of_the_same_size(folder):
    text = (folder / "runs.jsonl").read_text()
    (folder / "runs.jsonl").write_text(text.replace('{"y":', '{"z":', 1))
    make(folder, 1)


def runs_of_another_study(folder):
    with Journal(folder / "runs.jsonl") as journal:
        journal.append(
            Run("0123456789abcdef", "s:g", {}, {"a": 0.5, "b": 0.5}, 0, "done", {"y": 1.0}, {}, 0.1)
        )


def a_run_called_otherwise(folder):
    """The first missing run, made when b was a setting."""
    (task, *_) = evaluation_agenda(open_study(folder)).todo
    settings, factors = {"b": task.factors["b"]}, {"a": task.factors["a"]}
    key = run_key("s:f", settings, factors)
    with Journal(folder / "runs.jsonl") as journal:
        journal.append(Run(key, "s:f", settings, factors, 0, "done", {"y": 1.0}, {}, 0.1))


def a_failed_run_again(folder):
    runs = Journal(folder / "runs.jsonl").load().values()
    (failed,) = [run for run in runs if not run.done]
    with Journal(folder / "runs.jsonl") as journal:
        journal.append(replace(failed, status="done", responses={"y": 1.0}, attempt=2))


def a_run_without_the_answer(folder):
    (task, *_) = evaluation_agenda(open_study(folder)).todo
    with Journal(folder / "runs.jsonl") as journal:
        journal.append(Run(task.key, "s:f", {}, task.factors, 0, "done", {"z": 1.0}, {}, 0.1))


def a_torn_line(folder):
    make(folder, 1)
    with open(folder / "runs.jsonl", "ab") as file:
        file.write(b'{"schema":1,"key":"01')


def lies_about_rows(folder):
    index = json.loads((folder / "runs.jsonl.index").read_text())
    index["rows"]["states"] = index["rows"]["states"][:-4]
    (folder / "runs.jsonl.index").write_text(json.dumps(index))
    make(folder, 1)


def lies_about_types(folder):
    index = json.loads((folder / "runs.jsonl.index").read_text())
    index["standing"]["done"] = "many"
    (folder / "runs.jsonl.index").write_text(json.dumps(index))


@pytest.mark.parametrize(
    "change",
    [
        more_runs,
        another_line,
        another_response,
        another_setting,
        another_version,
        another_design,
        damage,
        an_answer_in_the_middle,
        the_same_size,
        another_answer_of_the_same_size,
        runs_of_another_study,
        a_run_called_otherwise,
        a_failed_run_again,
        a_run_without_the_answer,
        a_torn_line,
        lies_about_rows,
        lies_about_types,
    ],
)
def test_whatever_changes_the_counts_are_right(folder, change):
    told(folder)
    change(folder)
    assert told(folder) == counted(folder)


@pytest.fixture
def decoded(monkeypatch):
    """Counts the lines of journals that are read."""
    lines = []

    def read(line, *known):
        lines.append(line)
        return run_from_json(line, *known)

    monkeypatch.setattr(journal_module, "run_from_json", read)
    return lines


def test_only_what_was_appended_is_read(folder, decoded):
    told(folder)
    for _ in range(2):
        make(folder, 2)
        decoded.clear()
        again = told(folder)
        assert len(decoded) == 2
    decoded.clear()
    assert counted(folder) == again
    assert len(decoded) == 16


def test_a_missing_index_is_made_without_keeping_the_runs_in_memory(folder, decoded, monkeypatch):
    monkeypatch.setattr(row_states, "AT_ONCE", 5)
    runs_of_another_study(folder)
    a_failed_run_again(folder)
    with monkeypatch.context() as patch:
        patch.setattr(run_counts.RunIndex, "_read_once", lambda self: None)
        without = counted(folder), json.loads((folder / "runs.jsonl.index").read_text())
    decoded.clear()
    with monkeypatch.context() as patch:
        patch.setattr(Journal, "load", lambda self: pytest.fail("read the journal"))
        assert (counted(folder), json.loads((folder / "runs.jsonl.index").read_text())) == without
    assert len(decoded) == 14
    assert without[1]["standing"]["measured"]["runs"]


def test_rows_that_share_a_run_have_what_it_measured(folder):
    runs = [run for run in Journal(folder / "runs.jsonl").load().values() if run.done][:2]
    keys = np.array([int(runs[i].key, 16) for i in (1, 0, 1)], np.uint64)
    study, simulator = open_study(folder).study, open_study(folder).simulator
    rows = row_states.RowStates.of_nothing(keys, 1).followed(
        Journal(folder / "runs.jsonl"), Meaning(caller_of(simulator, study.space)), ["y"]
    )
    assert rows.counts == (0, 2, 0)
    assert rows.others == 10
    assert rows.values[:, 0].tolist() == [runs[i].responses["y"] for i in (1, 0, 1)]


def test_whole_numbers_in_an_old_journal_are_left_to_the_whole_of_it(folder):
    (folder / "runs.jsonl").write_text((folder / "runs.jsonl").read_text().replace('{"y":3.0}', '{"y":3}'))
    counted(folder)
    index = json.loads((folder / "runs.jsonl.index").read_text())
    assert (index["standing"]["done"], index["standing"]["measured"]) == (11, {})


def test_after_an_evaluation_a_fit_is_looked_at_without_reading_the_runs(folder, decoded):
    told(folder)
    make(folder, 4)
    evaluate_design(open_study(folder), HowToRun(retry_failed=True))
    fit_study(open_study(folder))
    decoded.clear()
    assert told(folder)["stages"][2]["state"] == "fresh"
    assert not decoded
    more = json.loads((folder / "runs.jsonl.index").read_text())
    more["standing"]["measured"] = {}  # as one that was read on
    (folder / "runs.jsonl.index").write_text(json.dumps(more))
    assert told(folder)["stages"][2]["state"] == "fresh"
    decoded.clear()
    assert told(folder)["stages"][2]["state"] == "fresh"
    assert not decoded


def test_a_plan_that_stands_is_looked_at_without_reading_the_runs(folder, decoded):
    told(folder)
    decoded.clear()
    without = plan_design(open_study(folder)).overview()
    assert without["kept"] == {"kept": 11, "outside": 0, "failed": 1, "new": 4, "left_out": []}
    assert not decoded
    runs_of_another_study(folder)
    assert plan_design(open_study(folder)).overview()["kept"]["left_out"] == [
        "1 finished run is left out: made by s:g (now s:f)"
    ]


def test_an_evaluation_goes_on_without_reading_the_runs_that_are_there(folder, decoded):
    told(folder)
    make(folder, 2)
    decoded.clear()
    before = []

    def watch(event):
        if event.kind == "started":
            before.append((len(decoded), event.progress.recorded, event.progress.todo))

    found = evaluate_design(open_study(folder), on_event=watch).overview()
    assert before[0] == (2, 14, 2)
    assert (found["made"], found["done"], found["failed"], found["missing"]) == (2, 15, 1, 0)
    runs = [json.loads(line) for line in (folder / "runs.jsonl").read_text().splitlines()]
    assert len({run["key"] for run in runs}) == len(runs) == 16
    assert [line.split(",")[0] for line in (folder / "responses.csv").read_text().split()[1:]] == [
        str(row) for row in range(1, 17)
    ]


def test_no_more_runs_are_made_than_are_allowed_though_an_index_is_there(folder):
    told(folder)
    found = evaluate_design(open_study(folder), HowToRun(limit=1)).overview()
    assert (found["made"], found["missing"]) == (1, 3)


def test_failed_runs_are_repeated_though_an_index_is_there(folder):
    told(folder)
    found = evaluate_design(open_study(folder), HowToRun(retry_failed=True)).overview()
    assert (found["made"], found["done"]) == (5, 16)


def test_a_complete_study_is_not_read_to_see_that_nothing_is_to_be_done(folder, monkeypatch):
    (folder / "runs.jsonl").unlink()
    make(folder, 16)
    assert evaluate_design(open_study(folder)).overview()["done"] == 16
    table = (folder / "responses.csv").read_bytes()
    with monkeypatch.context() as patch:
        patch.setattr(Journal, "load", lambda self: pytest.fail("read the journal"))
        again = evaluate_design(open_study(folder)).overview()
        assert (again["skipped"], again["done"], again["missing"]) == (True, 16, 0)
    (folder / "responses.csv").unlink()
    evaluate_design(open_study(folder))
    assert (folder / "responses.csv").read_bytes() == table


def test_a_folder_that_cannot_be_written_can_be_looked_at(folder, monkeypatch):
    (folder / "runs.jsonl.index").unlink(missing_ok=True)
    (folder / "runs.jsonl.index").mkdir()
    assert told(folder)["stages"][1]["reason"] == "11 of 16 runs done, 1 failed"


def test_what_was_counted_while_somebody_wrote_is_not_kept(tmp_path):
    states = iter([{"journal": [1]}, {"journal": [2]}])
    found = run_counts.Counted(run_counts.Standing(1, 1, 1, 0, 0, 1, "", {}))
    assert run_counts.kept_counts(tmp_path / "index", lambda: next(states), lambda: found) is found
    assert not (tmp_path / "index").exists()


def test_small_studies_have_none(tmp_path, monkeypatch):
    (tmp_path / "study.toml").write_text(STUDY)
    (tmp_path / "s.py").write_text("")
    plan_design(open_study(tmp_path))
    make(tmp_path, 3)
    assert CliRunner().invoke(main, ["status", str(tmp_path)]).exit_code == 0
    assert not (tmp_path / "runs.jsonl.index").exists()
