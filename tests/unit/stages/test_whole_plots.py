"""A laboratory study with a hard-to-change factor, from its plan to its optimum."""

import json

import numpy as np
import pytest

from rsmkit.cli import main
from rsmkit.errors import StudyError
from rsmkit.io.tables.csv_tables import read_table
from rsmkit.stages.fit import fit_study
from rsmkit.stages.planning.plan import plan_design
from rsmkit.study.file import load_study
from rsmkit.study.folder import open_study

STUDY = """
[factors]
oven = { low = 150, high = 200, change = "hard" }
t = { low = 1, high = 5 }
[responses]
y = {}
[design]
kind = "optimal"
runs = 24
whole_plots = 6
starts = 3
[surface]
order = 1
[[search]]
minimize = "y"
"""


def rsmkit(capsys, *words):
    with pytest.raises(SystemExit) as end:
        main(list(words))
    out = capsys.readouterr()
    return end.value.code, out.out or out.err


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "study.toml").write_text(STUDY)
    return tmp_path


def fill(folder, order=None, day=None):
    """Write a sheet by the command, fill it in with plots that differ, and give its path."""
    rng = np.random.default_rng(8)
    table = read_table(folder / "sheet.csv", ["oven", "t", "y"])
    rows = [dict(zip(table.names, row, strict=True)) for row in zip(*table.cells, strict=True)]
    blocks = open_study(folder).plan().design.blocks
    shifts = rng.normal(size=max(blocks)) * 3.0
    for row in rows:
        plot = blocks[int(row["run"]) - 1]
        row["y"] = 20 + 0.1 * (float(row["oven"]) - 175) + float(row["t"]) + shifts[plot - 1] + rng.normal()
        if day:
            row["day"] = day(plot)
    rows = [rows[i] for i in order] if order is not None else rows
    names = list(rows[0])
    lines = [",".join(names), *(",".join(str(row[name]) for name in names) for row in rows)]
    (folder / "filled.csv").write_text("\n".join(lines) + "\n")


def test_a_study_in_whole_plots_goes_through(folder, capsys):
    code, out = rsmkit(capsys, "plan", ".")
    assert code == 0, out
    assert "6 plots of 4, 4, 4, 4, 4, 4 runs" in out
    assert "degrees of freedom of each test: 1 4, oven 4, t 17" in out
    quality = json.loads((folder / "plan.json").read_text())["quality"]
    assert [at["ratio"] for at in quality["plots"]] == [0.1, 1.0, 10.0]
    assert quality["denominator_df"] == {"1": 4.0, "oven": 4.0, "t": 17.0}
    assert rsmkit(capsys, "sheet", "sheet.csv", ".")[0] == 0
    fill(folder)
    assert rsmkit(capsys, "record", "filled.csv", ".")[0] == 0
    code, out = rsmkit(capsys, "fit", ".", "--json")
    assert code == 0, out
    report = json.loads(out)["surfaces"]["y"]
    assert report["model"] == "mixed"
    assert [c["name"] for c in report["variance_components"]] == ["whole_plot", "residual"]
    assert report["anova_terms"][0]["denominator_df"] == pytest.approx(4.0)
    assert report["anova_terms"][1]["denominator_df"] == pytest.approx(17.0)
    study = open_study(folder)
    assert study.fit_problem() is None
    assert fit_study(study).optima[0].point[1] == pytest.approx(1.0)
    assert rsmkit(capsys, "status", ".")[0] == 0
    assert rsmkit(capsys, "plan", ".", "--compare", "design.csv")[0] == 0


def test_groups_named_in_the_sheet_are_random(folder, capsys):
    text = STUDY.replace("whole_plots = 6", 'whole_plots = 6\nrandom = ["day"]')
    (folder / "study.toml").write_text(text)
    plan_design(open_study(folder))
    rsmkit(capsys, "sheet", "sheet.csv", ".")
    assert "day" in read_table(folder / "sheet.csv", ["oven"]).names
    fill(folder)
    rsmkit(capsys, "record", "filled.csv", ".")
    code, out = rsmkit(capsys, "fit", ".")
    assert code == 2
    assert "fill the column day of the run sheet" in " ".join(out.split())
    fill(folder, day=lambda plot: "mon" if plot < 3 else "tue" if plot < 5 else "wed")
    rsmkit(capsys, "record", "filled.csv", ".")
    found = fit_study(open_study(folder))
    assert set(found.responses["y"].report()["random"]) == {"whole_plot", "day"}


def test_auto_and_blocks_of_days(folder, capsys):
    text = STUDY.replace(', change = "hard"', "").replace("whole_plots = 6", "blocks = [8, 8, 8]")
    text = text.replace("starts = 3", 'starts = 3\nreplicates = true\nrandom = ["day"]')
    (folder / "study.toml").write_text(text.replace("order = 1", 'model = "auto"\norder = 1'))
    plan = plan_design(open_study(folder))
    assert plan.quality.plots
    assert plan.design.blocks == (1,) * 8 + (2,) * 8 + (3,) * 8
    rsmkit(capsys, "sheet", "sheet.csv", ".")
    fill(folder)
    rsmkit(capsys, "record", "filled.csv", ".")
    choice = fit_study(open_study(folder)).responses["y"]
    assert set(choice.report()["random"]) == {"day"}
    refused = {row.model: row.remark for row in choice.table}
    assert "these share random day" in refused["gaussian process"]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("t = {", 't = { change = "hard",', "every factor has change = 'hard'"),
        ("[surface]", '[surface]\nmodel = "stretched"', "takes runs as independent"),
        ("starts = 3", 'random = ["t"]', "'t' is the name of something else"),
        ("whole_plots = 6", "whole_plots = 0", "must be at least 1"),
        ("whole_plots = 6", "whole_plots = 6\nblocks = [9, 9]", "says what blocks says"),
        ('change = "hard"', 'change = "slow"', "change must be"),
        ("[design]", '[simulator]\nrun = "m:f"\n[design]', "simulator.deterministic = false"),
    ],
)
def test_study_files_that_contradict_themselves_are_refused(folder, old, new, message):
    (folder / "study.toml").write_text(STUDY.replace(old, new))
    with pytest.raises(StudyError, match=message):
        load_study(folder)


def test_the_sheet_keeps_plots_together_and_draws_their_order(folder, capsys):
    blocks = plan_design(open_study(folder)).design.blocks
    rsmkit(capsys, "sheet", "sheet.csv", ".", "--seed", "5")
    table = read_table(folder / "sheet.csv", ["run"])
    plots = [blocks[int(run) - 1] for run in table.texts("run")]
    assert sorted(dict.fromkeys(plots)) == [1, 2, 3, 4, 5, 6]
    assert len([i for i in range(1, 24) if plots[i] != plots[i - 1]]) == 5
    assert list(dict.fromkeys(plots)) != [1, 2, 3, 4, 5, 6]
    assert [table.texts("block")[i] for i in range(24)] == [str(plot) for plot in plots]
