"""The report to hand in: what it says, in every form; what a user writes stays text."""

import re
import shutil
import subprocess
import sys
import zlib
from zipfile import ZipFile

import pytest
from click.testing import CliRunner
from openpyxl import load_workbook

from rsmkit.cli.commands import main
from rsmkit.errors import RsmkitError
from rsmkit.io.tables.csv_tables import write_table
from rsmkit.report.paper.blocks import Grid, Heading, NewPage, Paper, Picture, Text
from rsmkit.report.paper.html_paper import html_text
from rsmkit.report.paper.other_papers import write_paper
from rsmkit.report.paper.surface_chapter import picture

EVIL = "<script>alert(1)</script>"
PAPER = Paper(
    "Title " + EVIL,
    [
        Heading("Summary"),
        Text("All is well\x0b.", strong=True),
        NewPage(),
        Grid("Runs", ["run", "=head"], [["=1+1", 1.5], ["second", None]], frozenset({1})),
        Picture(picture(lambda figure: figure.subplots().plot([0, 1]), (2, 1)), "A line"),
    ],
)


def test_a_page_escapes_what_it_is_given():
    page = html_text(PAPER)
    assert "<script" not in page
    assert "&lt;script&gt;" in page
    assert 'class="new"' in page
    assert "<tr class=grey><td>second</td><td>–</td></tr>" in page


def test_it_is_a_word_file_and_a_workbook(tmp_path):
    pytest.importorskip("docx")
    write_paper(PAPER, tmp_path / "a.docx")
    with ZipFile(tmp_path / "a.docx") as file:
        text = file.read("word/document.xml").decode()
        assert any(name.startswith("word/media/") for name in file.namelist())
    assert "All is well" in re.sub("<[^>]*>", "", text)
    write_paper(PAPER, tmp_path / "a.xlsx")
    book = load_workbook(tmp_path / "a.xlsx")
    assert book.sheetnames == ["report", "Runs"]
    assert [[cell.value for cell in row] for row in book["Runs"]] == [
        ["run", "=head"],
        ["=1+1", 1.5],
        ["second", None],
    ]
    assert not [cell for page in book for row in page for cell in row if cell.data_type == "f"]


def inflated(stream):
    try:
        return zlib.decompressobj().decompress(stream)
    except zlib.error:  # a picture is packed otherwise
        return b""


def test_it_is_a_pdf_of_full_pages(tmp_path):
    """What follows a new page stands on the second one; picture, title and every text of a user are in it."""
    pytest.importorskip("weasyprint")
    write_paper(PAPER, tmp_path / "a.pdf")
    data = (tmp_path / "a.pdf").read_bytes()
    assert data.startswith(b"%PDF-")
    assert data.rstrip().endswith(b"%%EOF")
    parts = [data, *map(inflated, re.findall(rb"stream\r?\n(.*?)endstream", data, re.DOTALL))]
    whole = b"\n".join(parts)
    assert len(re.findall(rb"/Type\s*/Page\b", whole)) == 2
    assert re.search(rb"/Subtype\s*/Image", whole)
    assert re.search(rb"/Title\s*\(Title <script>", whole)
    if shutil.which("pdftotext"):
        pages = subprocess.run(["pdftotext", tmp_path / "a.pdf", "-"], capture_output=True, check=True)
        first, second, *_ = pages.stdout.decode().split("\f")
        assert EVIL in first
        assert "All is well" in first
        assert "=1+1" in second
        assert "A line" in second


def test_a_missing_library_is_named(tmp_path, monkeypatch):
    for library, ending in (("weasyprint", "pdf"), ("docx", "docx")):
        monkeypatch.setitem(sys.modules, library, None)
        with pytest.raises(RsmkitError, match=r"pip install 'rsmkit\[report\]', or take --html"):
            write_paper(PAPER, tmp_path / f"a.{ending}")
    assert not list(tmp_path.iterdir())


def test_another_ending_is_refused(tmp_path):
    with pytest.raises(RsmkitError, match=r"a report is one of \.html, \.docx, \.pdf, \.xlsx"):
        write_paper(PAPER, tmp_path / "a.odt")


def test_the_report_of_a_table(tmp_path):
    rows = [(x, z, 3 + 2 * x - z + x * z + x * x + z * z) for x in (-1, 0, 1) for z in (-1, 0, 1)]
    text = "x,z,y\n" + "".join(f"{x},{z},{y + 0.01 * (i % 3)}\n" for i, (x, z, y) in enumerate(rows))
    (tmp_path / "runs.csv").write_text(text)
    arguments = ["--factors", "x,z", "--response", "y", "--report", str(tmp_path / "r.html")]
    done = CliRunner().invoke(main, ["fit", "--data", str(tmp_path / "runs.csv"), *arguments])
    assert done.exit_code == 0, done.output
    page = (tmp_path / "r.html").read_text()
    # 3 + 2x - z + xz + x^2 + z^2 is largest at x = z = 1 (7) and at x = 1, z = -1 (7); least inside
    for words in ("y: excellent", "maximum 7.0", "analysis of variance", "data:image/png", "runs.csv"):
        assert words in page, words


def test_a_workbook_with_results_is_not_written_over(tmp_path):
    """The table that is fitted, a run sheet, a text called .xlsx; a report of before is."""
    write_table(tmp_path / "runs.xlsx", [["x", "Yield (%)"], *([x, x * x + x] for x in range(-2, 3))])
    (tmp_path / "notes.xlsx").write_text("notes")
    arguments = ["--data", str(tmp_path / "runs.xlsx"), "--factors", "x", "--response", "Yield (%)"]
    for name in ("runs.xlsx", "notes.xlsx"):
        before = (tmp_path / name).read_bytes()
        done = CliRunner().invoke(main, ["fit", *arguments, "--report", str(tmp_path / name)])
        assert done.exit_code == 2, done.output
        assert "is no report; it may hold results" in " ".join(done.output.split())
        assert (tmp_path / name).read_bytes() == before
    for _ in range(2):
        done = CliRunner().invoke(main, ["fit", *arguments, "--report", str(tmp_path / "r.xlsx")])
        assert done.exit_code == 0, done.output


def test_a_page_of_responses_with_any_name(tmp_path):
    write_table(tmp_path / "runs.xlsx", [["x", "=Yield (%)"], *([x, x * x + x] for x in range(-2, 3))])
    arguments = ["--data", str(tmp_path / "runs.xlsx"), "--factors", "x", "--response", "=Yield (%)"]
    done = CliRunner().invoke(main, ["fit", *arguments, "--page", str(tmp_path / "page.html")])
    assert done.exit_code == 0, done.output
    assert "=Yield (%)" in (tmp_path / "page.html").read_text()
