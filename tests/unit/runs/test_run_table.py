"""The table of runs."""

import csv

import numpy as np
import pytest

from rsmkit.errors import RsmkitError
from rsmkit.language.space import Space
from rsmkit.runs.record.run import Run
from rsmkit.runs.record.run_table import Runs

SPACE = Space(a=(0.0, 1.0), shape=["cone", "ogive"])


def make(key, status="done", responses=None, **changes):
    return Run(
        key * 16, "m:f", {}, {}, 0, status, responses or {}, {"extra": 7, "note": "<b>"}, 0.5, **changes
    )


@pytest.fixture
def runs():
    done = make("a", responses={"y": 0.1 + 0.2})
    failed = make("b", "failed", error="returned y = nan")
    points = np.array([[0.25, 1], [0.5, 0], [0.25, 1], [0.75, 0]])
    return Runs(SPACE, points, (done, failed, done, None), ("y",))


def test_masks_and_columns(runs):
    assert runs.done.tolist() == [True, False, True, False]
    assert runs.failed.tolist() == [False, True, False, False]
    assert runs.missing.tolist() == [False, False, False, True]
    assert runs.X.shape == (4, 2)
    np.testing.assert_array_equal(runs.y("y"), [0.1 + 0.2, np.nan, 0.1 + 0.2, np.nan])
    np.testing.assert_array_equal(runs.y("extra"), [7.0, np.nan, 7.0, np.nan])
    with pytest.raises(RsmkitError, match="no run has a number named z"):
        runs.y("z")


def test_finished_keeps_the_good_rows_only(runs):
    kept = runs.finished()
    assert len(kept) == 2
    assert kept.done.all()
    assert [run.key[0] for run in runs.failures()] == ["b"]


def test_asking_for_another_response_changes_what_is_done(runs):
    other = Runs(SPACE, runs.points, runs.runs, ("extra",))
    assert other.done.tolist() == [True, True, True, False]


def test_responses_default_to_those_of_the_first_good_run(runs):
    assert Runs(SPACE, runs.points, runs.runs).responses == ("y",)


def test_csv_is_for_spreadsheets(runs, tmp_path):
    path = tmp_path / "responses.csv"
    runs.to_csv(path, kinds=["factorial", "axial", "center", "center"])
    rows = list(csv.DictReader(path.read_text().splitlines()))
    assert [row["run"] for row in rows] == ["1", "2", "3", "4"]
    assert [row["status"] for row in rows] == ["done", "failed", "done", "missing"]
    assert float(rows[0]["y"]) == 0.1 + 0.2
    assert rows[1]["y"] == rows[3]["y"] == ""
    assert rows[1]["error"] == "returned y = nan"
    assert rows[0]["kind"] == "factorial"
    assert rows[0]["shape"] == "ogive"
    assert rows[0]["extra"] == "7"
    assert None not in rows[3]


def test_html_is_escaped(runs):
    bad = make("c", "failed", error="<script>alert(1)</script>")
    html = Runs(SPACE, runs.points[:1], (bad,), ("y",))._repr_html_()
    assert "<script>" not in html
    assert "&lt;script&gt;" in html


def test_a_frame_for_pandas(runs):
    frame = runs.to_frame()
    assert list(frame.columns) == ["a", "shape", "y", "status"]
    assert frame.index.tolist() == [1, 2, 3, 4]
    assert frame.index.name == "run"
    assert frame["a"].tolist() == [0.25, 0.5, 0.25, 0.75]
    assert frame["shape"].tolist() == ["ogive", "cone", "ogive", "cone"]
    np.testing.assert_array_equal(frame["y"], [0.1 + 0.2, np.nan, 0.1 + 0.2, np.nan])
    assert frame["y"].dtype == np.float64
    assert frame["status"].tolist() == ["done", "failed", "done", "missing"]


def test_the_text_counts_and_names_the_first_failure(runs):
    bad = Run("b" * 16, "m:f", {}, {"a": 0.5}, 0, "failed", {}, {}, 0.5, error="ValueError: no\x1bfuel")
    table = Runs(SPACE, runs.points, (runs.runs[0], bad, runs.runs[2], None), ("y",))
    text = "4 runs of y: 2 done, 1 failed, 1 missing; first failure at a 0.5: failed, ValueError: no"
    assert repr(table) == f"<Runs: {text}\\x1bfuel>"
    assert f"<caption>{text}" in table._repr_html_()
    assert repr(Runs(SPACE, runs.points[:0], ())) == "<Runs: 0 runs>"
