"""Laboratory runs: the sheet that goes out and the results that come back."""

import csv
from pathlib import Path

import numpy as np
import pytest

from rsmkit.errors import RsmkitError
from rsmkit.language.space import Space
from rsmkit.runs.agenda import read_runs
from rsmkit.runs.one_run.simulator import SimulatorError
from rsmkit.runs.record.journal import Journal
from rsmkit.runs.sheets.hand_runs import laboratory
from rsmkit.runs.sheets.run_sheet import record_sheet, write_sheet

STUDY = Path(__file__).parents[3] / "studies" / "laboratory"
SPACE = Space(time_min=(80.0, 90.0), temperature_F=(170.0, 180.0))
NAMES = ("yield_pct", "viscosity_cSt", "molecular_weight")
STAR = 2.0**0.5
DESIGN = np.array(
    [[-1, -1], [-1, 1], [1, -1], [1, 1], *[[0, 0]] * 5, [-STAR, 0], [STAR, 0], [0, -STAR], [0, STAR]]
) * 5.0 + [85.0, 175.0]


@pytest.fixture
def journal(tmp_path):
    return Journal(tmp_path / "runs.jsonl")


def runs_of(journal):
    return read_runs(laboratory(journal.path.parent), DESIGN, SPACE, journal, responses=NAMES)


def test_the_published_results_find_their_points(journal):
    record = record_sheet(STUDY / "results.csv", SPACE, DESIGN, journal, responses=NAMES)
    assert (record.new, record.changed, record.unchanged, record.blank, record.unplanned) == (13, 0, 0, 0, 0)
    runs = runs_of(journal)
    assert runs.done.all()
    x1, x2 = SPACE.encode(runs.X).T
    matrix = np.column_stack([np.ones(13), x1, x2, x1 * x2, x1**2, x2**2])
    coefficients = np.linalg.lstsq(matrix, runs.y("yield_pct"), rcond=None)[0]
    # the second-order model of the yield as published with the data
    np.testing.assert_allclose(coefficients, [79.94, 0.99, 0.52, 0.25, -1.38, -1.00], atol=0.006)


def test_recording_again_changes_nothing_and_corrections_are_taken(journal, tmp_path):
    sheet = tmp_path / "sheet.csv"
    text = (STUDY / "results.csv").read_text()
    sheet.write_text(text)
    record_sheet(sheet, SPACE, DESIGN, journal, responses=NAMES)
    assert record_sheet(sheet, SPACE, DESIGN, journal, responses=NAMES).unchanged == 13
    assert len(journal.path.read_text().splitlines()) == 13
    sheet.write_text(text.replace("79.5,59,3890", "79.6,59,3890"))
    record = record_sheet(sheet, SPACE, DESIGN, journal, responses=NAMES)
    assert (record.changed, record.unchanged) == (1, 12)
    run = runs_of(journal).runs[3]
    assert (run.responses["yield_pct"], run.attempt) == (79.6, 2)


def test_the_sheet_goes_out_empty_and_comes_back_in_parts(journal, tmp_path):
    sheet = tmp_path / "sheet.csv"
    write_sheet(sheet, runs_of(journal), ["factorial"] * 4 + ["center"] * 5 + ["axial"] * 4)
    rows = list(csv.DictReader(sheet.read_text().splitlines()))
    assert len(rows) == 13
    assert rows[4]["kind"] == "center"
    assert rows[0]["yield_pct"] == ""
    with pytest.raises(RsmkitError, match=r"exists and may hold results"):
        write_sheet(sheet, runs_of(journal))
    rows[0] |= {"yield_pct": "76.5", "viscosity_cSt": "62", "molecular_weight": "2940"}
    rows[5] |= {"yield_pct": "80.3"}
    with open(sheet, "w", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys())
        writer.writeheader()
        writer.writerows(rows)
    record = record_sheet(sheet, SPACE, DESIGN, journal, responses=NAMES)
    assert (record.new, record.blank) == (2, 11)
    runs = runs_of(journal)
    assert runs.done.tolist() == [True] + [False] * 12
    assert (runs.partial.nonzero()[0].tolist(), runs.runs[5].responses) == ([5], {"yield_pct": 80.3})
    assert runs.runs[5].replicate == 1
    again = tmp_path / "again.csv"
    write_sheet(again, runs)
    assert "76.5,62.0,2940.0" in again.read_text()


def test_a_spreadsheet_with_semicolons_commas_and_remarks_is_understood(journal, tmp_path):
    sheet = tmp_path / "sheet.csv"
    sheet.write_bytes(
        "\ufefftime_min;temperature_F;yield_pct;viscosity_cSt;molecular_weight;operator;pH\r\n"
        "92,07;175;78,4;68;3360;M. Čapek, jr.;6,9\r\n;;;;;;\r\n".encode()
    )
    record_sheet(sheet, SPACE, DESIGN, journal, responses=NAMES)
    run = runs_of(journal).runs[10]
    assert run.responses == {"yield_pct": 78.4, "viscosity_cSt": 68.0, "molecular_weight": 3360.0}
    assert run.extras == {"operator": "M. Čapek, jr.", "pH": 6.9}


def test_a_point_the_design_does_not_have_is_kept_as_it_was_measured(journal, tmp_path):
    sheet = tmp_path / "sheet.csv"
    sheet.write_text("time_min,temperature_F,yield_pct,viscosity_cSt,molecular_weight\n84,176,79,68,3300\n")
    assert record_sheet(sheet, SPACE, DESIGN, journal, responses=NAMES).unplanned == 1
    (run,) = journal.load().values()
    assert run.factors == {"time_min": 84.0, "temperature_F": 176.0}


def test_every_cell_that_cannot_be_read_is_named_and_nothing_is_recorded(journal, tmp_path):
    sheet = tmp_path / "sheet.csv"
    sheet.write_text(
        "time_min,temperature_F,yield_pct,viscosity_cSt,molecular_weight\n"
        "85,175,79.9,72,3480\nhot,175,1,2,3\n85,175,about 80,72,3480\n85,inf,1,2,3\n"
    )
    with pytest.raises(RsmkitError) as caught:
        record_sheet(sheet, SPACE, DESIGN, journal, responses=NAMES)
    lines = str(caught.value).splitlines()
    assert lines == [
        "sheet.csv line 3: factor time_min: 'hot' is not a number",
        "sheet.csv line 4: yield_pct = 'about 80' is not a number",
        "sheet.csv line 5: factor temperature_F: 'inf' is not a finite number",
    ]
    assert journal.load() == {}


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "needs exactly one column time_min"),
        (b"time_min,temperature_F\n", "needs exactly one column yield_pct, viscosity_cSt, molecular_weight"),
        (b"\xff\xfe\x00", "is not UTF-8 text"),
    ],
)
def test_a_file_that_is_no_sheet_is_refused(journal, tmp_path, content, message):
    sheet = tmp_path / "sheet.csv"
    sheet.write_bytes(content)
    with pytest.raises(RsmkitError, match=message):
        record_sheet(sheet, SPACE, DESIGN, journal, responses=NAMES)


def test_a_laboratory_cannot_be_called(tmp_path):
    assert laboratory(tmp_path).identity == "laboratory"
    with pytest.raises(SimulatorError, match="made by hand"):
        laboratory(tmp_path).load()


def test_factors_and_responses_may_be_called_as_columns_of_the_sheet(tmp_path):
    space, design = Space(run=(1.0, 3.0), kind=["a", "b"]), np.array([[1.0, 0], [3.0, 1]])
    journal, names = Journal(tmp_path / "runs.jsonl"), ("excluded", "comment")
    path = tmp_path / "sheet.csv"
    runs = read_runs(laboratory(tmp_path), design, space, journal, responses=names)
    write_sheet(path, runs, ["factorial", "factorial"], order=[1, 0])
    with open(path, newline="") as file:
        rows = list(csv.DictReader(file))
    assert [(row["run_"], row["run"], row["kind_"], row["kind"]) for row in rows] == [
        ("2", "3.0", "factorial", "b"),
        ("1", "1.0", "factorial", "a"),
    ]
    rows[0] |= {"excluded": "7", "comment": "8", "excluded_": "too hot", "comment_": "hm"}
    with open(path, "w", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys())
        writer.writeheader()
        writer.writerows(rows)
    for _ in range(2):
        record_sheet(path, space, design, journal, responses=names)
    (run,) = journal.load().values()
    assert (run.responses, run.excluded) == ({"excluded": 7.0, "comment": 8.0}, "too hot")
    assert run.extras["comment_"] == "hm"


@pytest.mark.parametrize(("away_F", "unplanned"), [(0.009, 0), (0.011, 1)])
def test_a_row_is_a_planned_point_to_within_a_thousandth_of_the_range(journal, tmp_path, away_F, unplanned):
    """The range is 10 F, so a point 0.01 F away is the planned one."""
    sheet = tmp_path / "sheet.csv"
    head = "time_min,temperature_F,yield_pct,viscosity_cSt,molecular_weight"
    sheet.write_text(f"{head}\n85,{175 + away_F},80,60,3000\n")
    assert record_sheet(sheet, SPACE, DESIGN, journal, responses=NAMES).unplanned == unplanned
