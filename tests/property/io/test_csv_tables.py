"""A table says the same numbers in every dialect and encoding, to everything in rsmkit that reads tables."""

import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rsmkit.design.design import Design
from rsmkit.errors import RsmkitError
from rsmkit.io.tables.csv_tables import read_matrix, read_table
from rsmkit.language.space import Space
from rsmkit.runs.one_run.picking import pick_outputs
from rsmkit.runs.options import PickOptions, SimulatorOptions
from rsmkit.runs.record.journal import Journal
from rsmkit.runs.sheets.run_sheet import record_sheet
from rsmkit.surfaces.tables.table_fit import fit_table

SPACE = Space(länge_m=(0.0, 1.0), gas=["air", "CO2, dry", "Öl"])
NAMES = ("länge_m", "gas", "y")
FIXED = [(0.0, "air", 1.0), (1.0, "CO2, dry", 2.0), (0.5, "Öl", 4.0), (0.25, "air", 3.0)]
"""Rows beside the drawn ones, so that a straight surface can be fitted."""


@dataclass(frozen=True)
class Dialect:
    mark: str
    comma: bool
    encoding: str
    end: str
    exponent: str
    minus: str
    quoted: bool
    told: bool
    blank_lines: bool

    def number(self, value: float) -> str:
        text = repr(value).replace("e", self.exponent).replace("-", self.minus)
        return text.replace(".", ",") if self.comma else text

    def cell(self, value) -> str:
        text = value if isinstance(value, str) else self.number(value)
        return f'"{text}"' if self.quoted or any(c in text for c in self.mark + " ,;") else text

    def text(self, rows) -> str:
        lines = [self.mark.join(map(self.cell, row)) for row in rows]
        between = self.end * 2 if self.blank_lines else self.end
        return (f"sep={self.mark}{self.end}" if self.told else "") + between.join(lines) + self.end

    def write(self, path: Path, rows) -> Path:
        with open(path, "w", encoding=self.encoding, newline="") as stream:
            stream.write(self.text(rows))
        return path


@st.composite
def dialects(draw):
    mark = draw(st.sampled_from(",;\t"))
    encoding = draw(st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "cp1252"]))
    return Dialect(
        mark,
        mark != "," and draw(st.booleans()),
        encoding,
        draw(st.sampled_from(["\n", "\r\n", "\r"])),
        draw(st.sampled_from("eEdD")),
        draw(st.sampled_from("-\u2013" if encoding == "cp1252" else "-\u2013\u2212")),
        draw(st.booleans()),
        draw(st.booleans()),
        draw(st.booleans()),
    )


lengths = st.floats(0.0, 1.0).filter(lambda x: x == 0.0 or x > 1e-30)
responses = st.floats(-1e30, 1e30).filter(lambda y: y == 0.0 or abs(y) > 1e-30)
tables = st.lists(
    st.tuples(lengths, st.sampled_from(["air", "CO2, dry", "Öl"]), responses), min_size=1, max_size=5
)


@given(dialects(), tables)
@settings(max_examples=60, deadline=None)
def test_tables_of_designs_and_of_experiments(dialect, rows):
    rows = [*FIXED, *rows]
    points = [[x, ["air", "CO2, dry", "Öl"].index(gas)] for x, gas, _ in rows]
    with tempfile.TemporaryDirectory() as folder:
        path = dialect.write(Path(folder, "t.csv"), [NAMES, *rows])
        table = read_table(path, NAMES)
        assert [table.number(text) for text in table.texts("y")] == [y for *_, y in rows]
        assert table.texts("gas") == tuple(gas for _, gas, _ in rows)
        np.testing.assert_array_equal(Design.from_csv(path, SPACE).points, points)
        fitted = fit_table(path, ["länge_m", "gas"], ["y"], order=1).surfaces["y"].data
        np.testing.assert_array_equal(fitted.y, [y for *_, y in rows])
        np.testing.assert_array_equal(fitted.points[:, 0], [x for x, *_ in rows])


@given(dialects(), tables)
@settings(max_examples=30, deadline=None)
def test_run_sheets(dialect, rows):
    with tempfile.TemporaryDirectory() as folder:
        path = dialect.write(Path(folder, "t.csv"), [NAMES, *rows])
        journal = Journal(Path(folder, "runs.jsonl"))
        record_sheet(path, SPACE, np.empty((1, 2)) * np.nan, journal, responses=["y"])
        found = [(*run.factors.values(), run.responses["y"]) for run in journal.load().values()]
        assert found == rows


@given(dialects(), st.lists(st.tuples(responses, responses), min_size=1, max_size=5))
@settings(max_examples=60, deadline=None)
def test_what_programs_print(dialect, rows):
    with tempfile.TemporaryDirectory() as folder:
        dialect.write(Path(folder, "out.csv"), [("time s", "drag"), *rows])
        outputs = {
            name: PickOptions(file="out.csv", column=column, row=row)
            for row in range(len(rows))
            for name, column in ((f"t{row}", "time s"), (f"d{row}", "drag"))
        }
        found = pick_outputs(SimulatorOptions(command=["x"], outputs=outputs), Path(folder))
        assert [(found[f"t{row}"], found[f"d{row}"]) for row in range(len(rows))] == rows


@given(dialects(), st.integers(1, 4), st.data())
@settings(max_examples=60, deadline=None)
def test_matrices(dialect, size, data):
    rows = data.draw(st.lists(st.tuples(*[responses] * size), min_size=1, max_size=4))
    if dialect.told or (size == 1 and dialect.comma):  # one number with a comma might be two without
        dialect = Dialect(**{**vars(dialect), "told": False, "comma": False})
    with tempfile.TemporaryDirectory() as folder:
        path = dialect.write(Path(folder, "m.csv"), rows)
        np.testing.assert_array_equal(read_matrix(path), rows)


@pytest.mark.parametrize("name", ["pipe", "folder"])
def test_what_is_no_file_keeps_nobody_waiting(tmp_path, name):
    import os

    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "folder").mkdir()
    for read in (lambda p: Design.from_csv(p, SPACE), lambda p: fit_table(p, ["a"], ["y"]), read_matrix):
        with pytest.raises(RsmkitError, match=r"is not a file|Is a directory"):
            read(tmp_path / name)
