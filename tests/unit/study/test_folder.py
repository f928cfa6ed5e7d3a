"""The folder of a study: each file is read once, and what is out of date is said."""

import os
import sys
from collections import Counter

import pytest
from click.testing import CliRunner

from rsmkit.cli.commands import main
from rsmkit.errors import RsmkitError, StageError
from rsmkit.report import writers
from rsmkit.stages.evaluate import evaluate_design
from rsmkit.stages.fit import fit_study
from rsmkit.stages.new import create_study
from rsmkit.stages.planning.plan import plan_design
from rsmkit.study.folder import StudyFolder, open_study

OPENED = Counter()
WATCHED = []


def _watch(event, arguments):
    if event == "open" and WATCHED and isinstance(arguments[0], str):
        path, mode, flags = arguments
        reads = "r" in mode if isinstance(mode, str) else flags & os.O_ACCMODE == os.O_RDONLY
        if path.startswith(WATCHED[0]) and reads and not os.path.isdir(path):
            OPENED[path.removeprefix(WATCHED[0] + "/")] += 1


sys.addaudithook(_watch)


def reads(folder, *command):
    """How often this process opens each of the folder's files for reading during one command."""
    OPENED.clear()
    WATCHED[:] = [str(folder)]
    try:
        done = CliRunner().invoke(main, [*command, str(folder), "-q"])
    finally:
        WATCHED.clear()
    assert done.exit_code == 0, done.output
    return {name: count for name, count in OPENED.items() if not name.startswith(".")}


def test_a_run_reads_each_file_once(tmp_path):
    folder = tmp_path / "study"
    create_study(folder)
    first = reads(folder, "run", "-j", "1")
    assert first["study.toml"] == 1
    assert set(first.values()) == {1}, first
    again = reads(folder, "run", "-j", "1")
    assert {"design.csv", "plan.json", "runs.jsonl", "model.json", "optimum.json"} <= set(again)
    assert set(again.values()) == {1}, again
    assert set(reads(folder, "status").values()) == {1}


@pytest.fixture
def folder(tmp_path):
    """The example with a cheap function, on polynomial surfaces."""
    create_study(tmp_path)
    (tmp_path / "cheap.py").write_text(
        "def area(width_mm, height_mm, **settings):\n    return width_mm * height_mm\n"
    )
    return tmp_path


def with_function(folder, target):
    text = (folder / "study.toml").read_text()
    (folder / "study.toml").write_text(text + f'\n[functions]\narea = "{target}"\n')
    return open_study(folder)


@pytest.mark.parametrize("stage", [plan_design, evaluate_design])
@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("def area(width_mm):\n    return width_mm\n", "every factor and every simulator setting"),
        ("def other():\n    pass\n", "area"),
        ("def area(**all):\n    return 'wide'\n", "must give one number"),
    ],
)
def test_a_broken_function_is_found_before_runs_are_paid_for(folder, stage, source, words):
    plan_design(open_study(folder))
    (folder / "cheap.py").write_text(source)
    study = with_function(folder, "cheap:area")
    with pytest.raises(RsmkitError, match=words):
        stage(study)
    assert not (folder / "runs.jsonl").exists()
    sys.modules.pop("cheap", None)


def test_what_was_found_is_there_in_the_next_process(folder):
    kept = open_study(folder)
    with pytest.raises(StageError, match="no design yet"):
        kept.plan()
    plan_design(kept)
    evaluate_design(kept)
    found = fit_study(kept)
    again = open_study(folder)
    assert [o.best.objectives for o in again.fitted().optima] == [o.best.objectives for o in found.optima]
    assert fit_study(again).fresh


def test_a_writer_that_fails_is_a_note_and_ends_no_stage(folder, monkeypatch):
    def fails(findings, path):
        raise ZeroDivisionError("no picture today")

    monkeypatch.setitem(writers.WRITERS, "toy", writers.Writer("toy", "toy report", "toy.txt", fails))
    done = CliRunner().invoke(main, ["run", str(folder), "-j", "1"])
    assert done.exit_code == 0, done.output
    assert "the toy report was not written: ZeroDivisionError: no picture today" in done.output
    assert "no picture today" in (folder / "rsmkit.log").read_text()
    assert (folder / "explorer.html").exists()
    assert "  CONFIRMED" in done.output


def test_lost_runs_are_judged_by_the_model_of_the_study(tmp_path):
    """Three of eight corners and a centre lost: what is left is worth what assess() says of this model."""
    (tmp_path / "s.py").write_text(
        "def f(a, b, c):\n    return {'y': a + b * c if a + b + c < 2.5 else 1 / 0}\n"
    )
    (tmp_path / "study.toml").write_text(
        '[simulator]\nrun = "s:f"\n[factors]\n'
        + "".join(f"{name} = {{low = -1, high = 1}}\n" for name in "abc")
        + '[responses]\ny = {}\n[design]\nkind = "factorial"\ncenter = 1\n[surface]\nterms = ["FO", "TWI"]\n'
    )
    kept = open_study(tmp_path)
    plan_design(kept)
    evaluate_design(kept)
    (cost,) = fit_study(kept).cost
    # X'X of nine runs is diag(9, 8, .., 8); what it loses with the corner x = (1, 1, 1, ..):
    # det(X'X - x x') = det(X'X) (1 - x'(X'X)^-1 x) and x'(X'X)^-1 x = 1/9 + 6/8
    left = (9 * 8**6 * (1 - 1 / 9 - 6 / 8)) ** (1 / 7) / 8
    assert f"D-efficiency {100 * left:.1f} % instead of {100 * (9 * 8**6) ** (1 / 7) / 9:.1f} %" in cost


def test_an_artefact_written_elsewhere_is_read_again_by_a_new_folder(folder):
    kept = open_study(folder)
    plan_design(kept)
    (folder / "design.csv").write_text("edited")
    assert "edited since" in StudyFolder(kept.study).plan_problem()
