"""Sheets of workbooks, and Windows code pages, as tables."""

import datetime
import json
import zipfile

import pytest
from click.testing import CliRunner
from command_line import runner
from openpyxl import Workbook

from rsmkit.cli.commands import main
from rsmkit.errors import RsmkitError
from rsmkit.io.tables.csv_tables import read_matrix, read_table
from rsmkit.surfaces.tables.table_fit import fit_table

ROWS = [("T", "tool", "y"), (150, "a", 1.5), (175, "b", 2), (200, "a", 4.25), (160, "b", 2.5)]


def save(path, **sheets):
    book = Workbook()
    book.remove(book.active)
    for name, rows in sheets.items():
        sheet = book.create_sheet(name)
        for row in rows:
            sheet.append(row)
    book.save(path)
    return path


def test_a_sheet_is_read_as_a_table(tmp_path):
    rows = [*ROWS, (None, None, None), (1e-7, True, datetime.datetime(2024, 5, 1)), ("1,5", "#N/A", "−2")]
    table = read_table(save(tmp_path / "runs.xlsx", May=rows))
    assert table.names == ("T", "tool", "y")
    assert table.lines == (2, 3, 4, 5, 7, 8)
    assert table.cells[1] == ("a", "b", "a", "b", "TRUE", "#N/A")
    assert table.cells[2][4] == "2024-05-01"
    assert [table.number(text) for text in table.cells[0]] == [150, 175, 200, 160, 1e-7, 1.5]
    assert table.number(table.cells[2][5]) == -2


def test_a_sheet_of_numbers_is_a_matrix(tmp_path):
    path = save(tmp_path / "candidates.xlsx", points=[(1, 2.5), (), ("3,5", -4)])
    assert read_matrix(path).tolist() == [[1, 2.5], [3.5, -4]]
    with pytest.raises(RsmkitError, match="line 2: 'x' is not a number"):
        read_matrix(save(tmp_path / "bad.xlsx", points=[(1, 2), (3, "x")]))


def test_titles_above_and_notes_beside_and_below_are_no_harm(tmp_path):
    rows = [("Trials of May",), (), ("No.", *ROWS[0]), *((i, *row) for i, row in enumerate(ROWS[1:], 1))]
    rows[3] += (None, "checked by Ann")
    rows += [(), ("mean", None, None, 2.5)]
    path = save(tmp_path / "runs.xlsx", Sheet1=rows)
    fitted = fit_table(path, ["T", "tool"], ["y"], order=1)
    assert fitted.surfaces["y"].data.y.tolist() == [1.5, 2, 4.25, 2.5]
    assert fitted.reasons == {"y": {5: "no T, no tool"}}


def test_the_sheet_with_the_columns_is_meant(tmp_path):
    other = [("T", "z"), (1, 2), (3, 4)]
    path = save(tmp_path / "runs.xlsx", notes=[("hello",)], Runs=ROWS, more=other, empty=[])
    assert len(read_table(path, ["T", "y"])) == 4
    assert len(read_table(path, ["z"])) == 2
    assert read_table(path, ["T"], sheet="more").names == ("T", "z")
    with pytest.raises(RsmkitError, match=r"several sheets with these columns \(T\).*--sheet: Runs, more"):
        read_table(path, ["T"])
    with pytest.raises(RsmkitError, match=r"no sheet with all of these columns \(T, w\).*notes, Runs, more"):
        read_table(path, ["T", "w"])
    with pytest.raises(RsmkitError, match=r"sheet must be .* did you mean 'Runs'"):
        read_table(path, ["T"], sheet="Run")
    with pytest.raises(RsmkitError, match="no column y; its columns are T, z"):
        read_table(path, ["T", "y"], sheet="more").texts("y")


def test_a_formula_without_its_value_is_not_an_empty_cell(tmp_path):
    rows = [*ROWS, (165, "a", "=C2+C3")]
    path = save(tmp_path / "runs.xlsx", Runs=rows)
    with pytest.raises(RsmkitError, match="sheet Runs, row 6 holds a formula without its value"):
        read_table(path, ["T", "y"])
    assert len(read_table(path, ["T", "tool"])) == 5


def test_other_workbooks_are_refused_with_what_to_do(tmp_path):
    old, damaged, foreign = (tmp_path / name for name in ("old.xls", "damaged.xlsx", "open.ods"))
    old.write_bytes(b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(600))
    damaged.write_bytes(save(tmp_path / "runs.xlsx", Runs=ROWS).read_bytes()[:900])
    with zipfile.ZipFile(foreign, "w") as archive:
        archive.writestr("mimetype", "application/vnd.oasis.opendocument.spreadsheet")
    for path in (old, damaged, foreign):
        with pytest.raises(RsmkitError, match=rf"{path.name}: .*save it as \.xlsx"):
            read_table(path, ["T"])
    plain = tmp_path / "runs.csv"
    plain.write_text("T,y\n1,2\n")
    with pytest.raises(RsmkitError, match="is no workbook, so it has no sheet May"):
        read_table(plain, sheet="May")


@pytest.mark.parametrize(
    ("encoding", "name", "level", "noted"),
    [
        ("cp1252", "größe", "é", False),
        ("cp1250", "teplota_°č", "Ť", True),
        ("cp1251", "Темп", "да", True),
        ("cp1253", "Θερμ", "ναι", True),
        ("cp932", "温度", "高", True),
        ("utf-16-le", "Темп", "да", False),
        ("utf-8", "Темп", "да", False),
    ],
)
def test_the_code_page_is_the_one_with_the_columns_asked_for(tmp_path, encoding, name, level, noted):
    path = tmp_path / "runs.csv"
    text = f"{name};art;y\n" + "".join(f"{i};{level if i % 2 else 'x'};{i * i}\n" for i in range(6))
    path.write_bytes(text.encode(encoding))
    fitted = fit_table(path, [name, "art"], ["y"], order=1)
    assert level in fitted.space["art"].levels
    assert bool(fitted.notes) == noted
    assert all(encoding in note for note in fitted.notes)


def test_the_options_of_tables_reach_the_fit(tmp_path):
    cells = [(t, tool, n) for t in (150, 200) for tool in "ab" for n in (1, 2, 10)]
    rows = [("T", "tool", "nozzle", "y"), *((*c, i * i % 7 + 0.5 * c[0]) for i, c in enumerate(cells))]
    path = save(tmp_path / "runs.xlsx", old=rows[:4], new=rows)
    request = ["fit", "--data", str(path), "--sheet", "new", "--factors", "T,tool,nozzle", "--response", "y"]
    request += ["--terms", "FO", "--categorical", "nozzle", "--categorical", "tool", "--contrasts", "sum"]
    result = runner().invoke(main, [*request, "--columns", "coded", "--json"])
    assert result.exit_code == 0, result.output
    document = json.loads(result.stdout)
    assert document["columns_hold"] == "coded values"
    report = document["responses"]["y"]
    assert [term["name"] for term in report["terms"]] == ["1", "T", "tool[a]", "nozzle[1]", "nozzle[2]"]
    assert report["coding"]["T"] == {"center": 0, "half_range": 1}
    assert report["coding"]["nozzle"] == ["1", "2", "10"]
    text = CliRunner().invoke(main, [*request, "--details"])
    assert "coded units: (T - 175)/25" in text.stdout
    assert "tool = b, nozzle = 10" in text.stdout
