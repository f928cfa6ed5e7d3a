"""Every notebook under ``studies/`` runs, and is what its source would make."""

import csv
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

jupytext = pytest.importorskip("jupytext")
nbformat = pytest.importorskip("nbformat")

STUDIES = Path(__file__).parents[3] / "studies"
PAIRS = sorted(path for path in STUDIES.rglob("*.ipynb") if ".ipynb_checkpoints" not in path.parts)
NAMES = [path.stem for path in PAIRS]
LONGEST_FIRST = sorted(PAIRS, key=lambda path: path.parent == STUDIES)
SHORT = """
[verify.refine]
max_runs = 3
"""
"""That the notebooks run is tested here. Where refinement ends is tested elsewhere, and takes a minute."""


def test_there_are_notebooks():
    stories = {"first_study", "your_own_simulator", "external_program", "laboratory_data", "robust_design"}
    assert {"paper", "choosing_a_design", *stories} <= set(NAMES)


@pytest.mark.parametrize("path", PAIRS, ids=NAMES)
def test_notebook_belongs_to_its_source(path):
    kept = nbformat.read(path, as_version=4)
    made = jupytext.read(path.with_suffix(".py"))
    assert [(cell.cell_type, cell.source) for cell in kept.cells] == [
        (cell.cell_type, cell.source) for cell in made.cells
    ]


@pytest.mark.parametrize("path", PAIRS, ids=NAMES)
def test_kept_notebook_ran_without_error(path):
    cells = [cell for cell in nbformat.read(path, as_version=4).cells if cell.cell_type == "code"]
    assert [cell.execution_count for cell in cells] == list(range(1, len(cells) + 1))
    assert not [out for cell in cells for out in cell.outputs if out.output_type == "error"]
    assert path.stat().st_size < 2_000_000


@pytest.mark.slow
@pytest.mark.parametrize("path", LONGEST_FIRST, ids=lambda path: path.stem)
def test_notebook_runs(path, tmp_path):
    copy = tmp_path / "studies"
    keep_out = shutil.ignore_patterns("*.ipynb", "runs.jsonl", "*.log", "explorer.html", "__pycache__")
    shutil.copytree(STUDIES, copy, ignore=keep_out)
    study = copy / "reentry" / "study.toml"
    study.write_text(study.read_text() + SHORT)
    source = copy / path.relative_to(STUDIES).with_suffix(".py")
    command = [sys.executable, copy / "reentry" / "reproduce.py", source]
    done = subprocess.run(command, capture_output=True, text=True, timeout=900)
    assert done.returncode == 0, done.stderr[-5000:]
    assert source.with_suffix(".ipynb").is_file()
    if path.stem == "paper":
        page = (copy / "reentry" / "RESULTS.md").read_text(encoding="utf-8")
        kept = (STUDIES / "reentry" / "RESULTS.md").read_text(encoding="utf-8")
        headings = [line for line in page.splitlines() if line.startswith("#")]
        assert headings == [line for line in kept.splitlines() if line.startswith("#")]


def test_kept_flights_are_those_of_the_present_simulator():
    """To the three digits the study quotes. After a change of the simulator run reproduce.py --fly."""
    from sim.reentry import evaluate

    study = STUDIES / "reentry"
    settings = tomllib.loads((study / "study.toml").read_text(encoding="utf-8"))["simulator"]["settings"]
    with (study / "flights" / "holdout.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))[:3]
    for row in rows:
        kept = {name: float(value) for name, value in row.items()}
        design = {name: kept.pop(name) for name in ("theta_c1_deg", "theta_c2_deg", "nose_radius_m")}
        flown = evaluate(**design, **settings)
        assert {name: flown[name] for name in kept} == pytest.approx(kept, rel=1e-3)
