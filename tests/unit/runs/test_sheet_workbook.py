"""The run sheet as a workbook, and texts that must not become formulas."""

import csv

import numpy as np
import pytest
from openpyxl import load_workbook

from rsmkit.io.tables.csv_tables import csv_text, parse_table, read_table, write_table
from rsmkit.language.space import Factor, Space
from rsmkit.runs.agenda import read_runs
from rsmkit.runs.record.journal import Journal
from rsmkit.runs.sheets.hand_runs import laboratory
from rsmkit.runs.sheets.run_sheet import record_sheet, write_sheet

EVIL = "=cmd|' /C calc'!A0"
SPACE = Space([Factor("T", 150, 170, "Temperature", "°C"), Factor("cat", levels=("Pd", EVIL))])
DESIGN = np.array([[150.0, 0], [150 + 20 / 3, 1], [170.0, 1]])


@pytest.fixture
def journal(tmp_path):
    return Journal(tmp_path / "runs.jsonl")


def write(path, journal):
    runs = read_runs(laboratory(path.parent), DESIGN, SPACE, journal, responses=["y"])
    write_sheet(path, runs, ["given"] * 3, order=[2, 0, 1], titles={"y": "Yield [%]"})
    return runs


def test_a_workbook_goes_out_and_comes_back(journal, tmp_path):
    path = tmp_path / "sheet.xlsx"
    write(path, journal)
    book = load_workbook(path)
    sheet = book["runs"]
    heads = [cell.value for cell in sheet[1]]
    column = {name: heads.index(name) + 1 for name in heads}
    assert (sheet.freeze_panes, sheet.protection.sheet) == ("A2", True)
    locked = {name: sheet.cell(2, column[name]).protection.locked for name in ("run", "T", "T actual", "y")}
    assert locked == {"run": True, "T": True, "T actual": False, "y": False}
    # what is not there yet may be added: columns to the right, rows below
    columns = sheet.column_dimensions
    assert not any(dimension.protection.locked for dimension in columns.values())
    assert max(dimension.max for dimension in columns.values()) == 16_384
    assert "Yield [%]" in sheet.cell(1, column["y"]).comment.text
    assert "Temperature [°C], as planned (150 to 170)" in sheet.cell(1, column["T"]).comment.text
    rules = {str(rule.sqref): rule.type for rule in sheet.data_validations.dataValidation}
    assert "decimal" in rules.values()
    assert not [cell for row in sheet for cell in row if cell.data_type == "f"]
    assert sheet.cell(2, column["cat"]).value == EVIL
    for row, y in ((2, 71.5), (3, 68), (4, None)):
        sheet.cell(row, column["y"]).value = y
    sheet.cell(4, column["comment"]).value = "@home"
    sheet.cell(4, column["comment"]).data_type = "s"
    sheet.cell(3, column["T actual"]).value = 151
    book.save(path)
    recorded = record_sheet(path, SPACE, DESIGN, journal, responses=["y"])
    assert (recorded.new, recorded.blank, recorded.drifts) == (
        2,
        1,
        ("run 1 was made at T = 151 instead of 150",),
    )
    again = tmp_path / "again.xlsx"
    runs = write(again, journal)
    assert runs.runs[2].responses == {"y": 71.5}
    for path in (again, again):
        assert record_sheet(path, SPACE, DESIGN, journal, responses=["y"]).unchanged == 2
    assert read_table(again, ["comment"]).texts("comment")[2] == "@home"


def test_a_cell_offers_no_more_than_a_spreadsheet_program_takes(tmp_path):
    """Excel holds a workbook with a list of over 255 characters, or such a message, for damaged."""
    names = tuple(f"a level whose name is long {i}" for i in range(12))
    for few in (7, 12):  # 195 and 336 characters
        space = Space([Factor("cat", levels=names[:few])])
        runs = read_runs(laboratory(tmp_path), [[0.0]], space, Journal(tmp_path / "no"), responses=["y"])
        write_sheet(tmp_path / f"{few}.xlsx", runs)
        rules = load_workbook(tmp_path / f"{few}.xlsx")["runs"].data_validations.dataValidation
        assert [rule.type for rule in rules] == (["list"] if few == 7 else []) + ["decimal"]
        assert all(len(rule.error) <= 255 and len(rule.formula1) <= 257 for rule in rules)


TEXTS = [
    EVIL,
    "+1+1",
    "-x",
    "@SUM(A1)",
    "'=x",
    "''-y",
    "a;=1+1",
    "-5",
    "1e5",
    "plain",
    "it's",
    "-1.5e-3",
    "a\n=b",
]


def test_no_text_becomes_a_formula_and_all_come_back(tmp_path):
    text = csv_text([["name", "other"], *([value, 1] for value in TEXTS)])
    for row in csv.reader(text.splitlines(keepends=True)):
        for part in row[0].replace("\n", ";").split(";"):
            assert part[:1] not in "=@+" or part[:1] == ""
            assert not part.startswith("-") or float(part) <= 0
    assert parse_table(text, "t", ["name"]).texts("name") == tuple(TEXTS)
    for file in ("t.csv", "t.xlsx"):
        write_table(tmp_path / file, [["name", "other"], *([value, 1] for value in TEXTS)])
        assert read_table(tmp_path / file, ["name"]).texts("name") == tuple(TEXTS)
