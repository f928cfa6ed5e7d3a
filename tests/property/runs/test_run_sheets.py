"""Run sheets filled at random, with blanks, corrections and drifts: no measurement is ever lost."""

import csv
import tempfile
from itertools import pairwise
from pathlib import Path

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from rsmkit.language.space import Factor, Space
from rsmkit.runs.agenda import read_runs
from rsmkit.runs.record.journal import Journal
from rsmkit.runs.record.run import EXCLUDED
from rsmkit.runs.record.run_table import Runs
from rsmkit.runs.sheets.hand_runs import (
    added_runs,
    corrections,
    laboratory,
    off_plan,
    planned_keys,
)
from rsmkit.runs.sheets.run_order import randomised_order
from rsmkit.runs.sheets.run_sheet import record_sheet, write_sheet

SPACE = Space([Factor("T", 150, 170), Factor("cat", levels=("Pd", "=Ni")), Factor("n", 1, 5, integer=True)])
DESIGN = np.array(
    [[150, 0, 1], [170, 1, 5], [160, 0, 3], [160, 0, 3], [160, 0, 3], [160 + 10 * 2**0.5, 1, 3]], float
)
NAMES = ("y", "z")
MINE = ("y", "z", "comment", "T actual", "excluded")
CELLS = {
    "y": ["1.5", "2", "-3e-7", "1e12"],
    "z": ["4.25", "0"],
    "comment": ["spilt; twice", "=cmd|' /C calc'!A0", "007", "12E3"],
    "T actual": ["151", "158.25"],
    "excluded": ["flask broke"],
}


class Laboratory:
    """A journal, and beside it all that was ever written into a sheet."""

    def __init__(self, folder):
        self.folder, self.journal = Path(folder), Journal(Path(folder, "runs.jsonl"))
        self.latest, self.ever, self.files = {}, set(), []

    def runs(self):
        return read_runs(laboratory(self.folder), DESIGN, SPACE, self.journal, responses=NAMES)

    def sheet(self):
        """The rows of the sheet that is written now, by the number of the run."""
        path = self.folder / f"{len(self.files)}.csv"
        write_sheet(path, self.runs(), order=randomised_order(len(DESIGN), len(self.files)))
        self.files.append(path)
        with open(path, newline="") as file:
            return list(csv.DictReader(file))

    def record(self, rows):
        """Record rows, and note what each says."""
        path = self.folder / f"filled {len(self.files)}.csv"
        self.files.append(path)
        with open(path, "w", newline="") as file:
            writer = csv.DictWriter(file, rows[0].keys())
            writer.writeheader()
            writer.writerows(rows)
        record_sheet(path, SPACE, DESIGN, self.journal, responses=NAMES)
        for row in rows:
            for name in MINE:
                if row[name]:
                    text = row[name].removeprefix("'")  # which keeps a text from being a formula
                    self.latest[row["run"], name] = text
                    self.ever.add((row["run"], name, text))


fillings = st.lists(
    st.tuples(st.integers(1, len(DESIGN)), st.sampled_from(MINE), st.integers(0, 3)), max_size=8
)


@given(st.lists(st.tuples(fillings, st.booleans(), st.booleans()), min_size=1, max_size=4), st.randoms())
@settings(max_examples=25, deadline=None)
def test_no_measurement_is_ever_lost(days, chance):
    with tempfile.TemporaryDirectory() as folder:
        lab = Laboratory(folder)
        yesterday = None
        for cells, is_old_sheet, is_drifting in days:
            rows = yesterday if is_old_sheet and yesterday else lab.sheet()
            for number, name, which in cells:
                (row,) = [row for row in rows if row["run"] == str(number)]
                row[name] = CELLS[name][which % len(CELLS[name])]
            for row in rows:
                if is_drifting and not row["T actual"] and row["run"] == "1" and row["y"]:
                    row["T"], lab.latest["1", "T actual"] = "151.5", "151.5"
            for row in rows:  # a cell that comes back empty says nothing, whatever was known
                row.update({name: "" for name in MINE if chance.random() < 0.2})
            chance.shuffle(rows)
            lab.record(rows)
            yesterday = rows
        check(lab)


def check(lab):
    """The next sheet has the latest of everything, the journal all that ever was, the fit what it may use."""
    rows = {row["run"]: row for row in lab.sheet()}
    for (run, name), text in lab.latest.items():
        found = rows[run][name]
        assert (
            (float(found) == float(text)) if name in ("y", "z", "T actual") else (found.lstrip("'") == text)
        )
    keys, labels = planned_keys(SPACE, DESIGN), {}
    runs = lab.runs()
    for index, key in enumerate(keys):
        kept = [*lab.journal.earlier(key), *([runs.runs[index]] if runs.runs[index] else [])]
        labels |= {str(index + 1): kept[-1]} if kept else {}
        for run, name, text in lab.ever:
            if run == str(index + 1):
                inside = EXCLUDED if name == "excluded" else name
                values = [record.responses.get(name, record.extras.get(inside)) for record in kept]
                assert text in values or float(text) in values
    told = corrections(lab.journal, labels, NAMES)
    assert {(c.run, c.name) for c in told} <= {(run, name) for run, name, _ in lab.ever}
    replaced = {(run, name, float(text)) for run, name, text in lab.ever if name in NAMES}
    replaced -= {(run, name, float(text)) for (run, name), text in lab.latest.items() if name in NAMES}
    assert replaced <= {(c.run, c.name, float(c.old)) for c in told if c.name in NAMES}
    for row, run in enumerate(runs.runs):
        for name in NAMES:
            text = lab.latest.get((str(row + 1), name))
            counts = text is not None and (str(row + 1), "excluded") not in lab.latest
            value = runs.finished().y(name) if counts else None
            assert value is None or float(text) in value
        if run is not None:
            actual = lab.latest.get((str(row + 1), "T actual"))
            assert runs.as_made().points[row, 0] == (float(actual) if actual else DESIGN[row, 0])


rows_outside = st.lists(
    st.tuples(
        st.sampled_from([152.5, 160.0, 199.0]),
        st.sampled_from(["", "added", "confirmation"]),
        st.integers(0, 9),
    ),
    min_size=1,
    max_size=5,
)


@given(rows_outside, st.randoms())
@settings(max_examples=15, deadline=None)
def test_runs_outside_the_plan_are_kept_once_each(rows, chance):
    with tempfile.TemporaryDirectory() as folder:
        lab = Laboratory(folder)
        planned = lab.sheet()
        for row in planned:
            row["y"] = "1"
        own = [
            dict.fromkeys(planned[0], "") | {"kind": kind, "T": str(T), "cat": "Pd", "n": "3", "y": str(y)}
            for T, kind, y in rows
        ]
        own += [own[0] | {"y": "10"}]
        for _ in range(3):
            together = [*planned, *own]
            chance.shuffle(together)
            lab.record(together)
        known = lab.journal.load()
        outside = off_plan(SPACE, known, set(planned_keys(SPACE, DESIGN)))
        assert sorted(run.responses["y"] for run in outside) == sorted(float(row["y"]) for row in own)
        fitted = added_runs(lab.runs(), known)
        wanted = sorted(float(row["y"]) for row in own if row["kind"] == "added")
        assert (sorted(fitted.finished().y("y")) if isinstance(fitted, Runs) else []) == wanted
        assert not any(lab.journal.earlier(key) for key in known)


def test_the_order_is_random_within_blocks_and_whole_plots():
    blocks, plots = [1] * 6 + [2] * 6, [3, 3, 1, 1, 2, 2] * 2
    order = randomised_order(12, 7, blocks=blocks, whole_plots=plots)
    assert order == randomised_order(12, 7, blocks=blocks, whole_plots=plots)
    assert sorted(order) == list(range(12))
    assert [blocks[row] for row in order] == blocks
    changes = sum(plots[a] != plots[b] for a, b in pairwise(order[:6]))
    assert changes == 2  # three whole plots, each together
    # every run is equally likely to be the first: 600 draws of 3, a binomial with sd 11.5
    first = [randomised_order(3, seed)[0] for seed in range(600)]
    assert all(abs(first.count(row) - 200) < 5 * 11.5 for row in range(3))
    assert randomised_order(4, 1, first=[2, 0])[:2] == (2, 0)
