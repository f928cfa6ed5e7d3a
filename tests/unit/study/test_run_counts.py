"""The index beside a large journal: it saves time, and nothing depends on it."""

import json

import pytest
from click.testing import CliRunner

from rsmkit.cli.commands import main
from rsmkit.runs.record.journal import Journal
from rsmkit.runs.record.run import Run
from rsmkit.stages.evaluate import evaluate_design, evaluation_agenda
from rsmkit.stages.looks.status import study_status
from rsmkit.stages.plan import plan_design
from rsmkit.study import run_counts
from rsmkit.study.folder import open_study

STUDY = """
[simulator]
run = "s:f"
[factors]
a = {low = 0.0, high = 1.0}
b = {low = 0.0, high = 1.0}
[responses]
y = {}
[design]
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
        lies_about_types,
    ],
)
def test_whatever_changes_the_counts_are_right(folder, change):
    told(folder)
    change(folder)
    assert told(folder) == counted(folder)


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
    found = run_counts.Standing(1, 1, 1, 0, 0, 1, "", {})
    assert run_counts.kept_standing(tmp_path / "index", lambda: next(states), lambda: found) is found
    assert not (tmp_path / "index").exists()


def test_small_studies_have_none(tmp_path, monkeypatch):
    (tmp_path / "study.toml").write_text(STUDY)
    (tmp_path / "s.py").write_text("")
    plan_design(open_study(tmp_path))
    make(tmp_path, 3)
    assert CliRunner().invoke(main, ["status", str(tmp_path)]).exit_code == 0
    assert not (tmp_path / "runs.jsonl.index").exists()
