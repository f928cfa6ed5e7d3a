"""A study without a simulator, as a laboratory lives it: half-filled rows, drifts, exclusions."""

import csv
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from openpyxl import load_workbook

from rsmkit.cli.commands import main
from rsmkit.report.explorer.page_document import page_document
from rsmkit.report.figures.diagnostic_plots import leverage, residuals
from rsmkit.stages.by_hand.laboratory import all_corrections
from rsmkit.stages.fit import fit_study
from rsmkit.study.exploring import gather_findings
from rsmkit.study.folder import open_study

DATA = Path(__file__).parents[2] / "data"
STUDY = """
[factors]
T_C = { low = 150, high = 170 }
cat = { levels = ["Pd", "Ni"] }
[responses]
yield_pct = {}
visc = {}
[design]
kind = "file"
file = "own.csv"
[surface]
model = "polynomial"
"""
POINTS = [(T, cat) for cat in ("Pd", "Ni") for T in (150.0, 160.0, 160.0, 170.0)]


def true_yield(T, cat):
    return 70 + (T - 150) / 10 - (T - 160) ** 2 / 50 - (cat == "Ni")


class Desk:
    """Someone who types commands and fills in sheets."""

    def __init__(self, folder):
        self.folder = folder
        (folder / "study.toml").write_text(STUDY)
        rows = "".join(f"{T},{cat}\n" for T, cat in POINTS)
        (folder / "own.csv").write_text(f"T_C,cat\n{rows}")
        self("plan")

    def __call__(self, command, *arguments, expect=0):
        done = CliRunner().invoke(main, [command, *map(str, arguments), str(self.folder)])
        assert done.exit_code == expect, done.output
        return done.output

    def sheet(self, *options):
        path = self.folder / "sheet.csv"
        path.unlink(missing_ok=True)
        self("sheet", *options, path)
        with open(path, newline="") as file:
            return list(csv.DictReader(file))

    def record(self, rows, *options, expect=0):
        path = self.folder / "filled.csv"
        with open(path, "w", newline="") as file:
            writer = csv.DictWriter(file, rows[0].keys())
            writer.writeheader()
            writer.writerows(rows)
        return self("record", *options, path, expect=expect)

    def fit(self):
        return fit_study(open_study(self.folder))

    def surface(self, name):
        return self.fit().surfaces[name]


def fill(row):
    at = float(row["T_C actual"] or row["T_C"])
    row["yield_pct"] = f"{true_yield(at, row['cat']):.17g}"
    row["visc"] = f"{50 - (at - 160) / 4:.17g}"


@pytest.fixture
def desk(tmp_path):
    return Desk(tmp_path)


def test_a_row_filled_in_twice_has_both_measurements(desk):
    rows = desk.sheet()
    for row in rows:
        fill(row)
    half = rows[3]
    known, half["visc"] = half["visc"], ""
    desk.record(rows)
    assert [len(desk.surface(name).data) for name in ("yield_pct", "visc")] == [8, 7]
    assert "visc was measured in 7 of 8 runs" in desk.fit().warnings()[0]
    rows[0]["yield_pct"], rows[0]["visc"] = "", "77"
    half["yield_pct"], half["visc"] = "", known
    said = desk.record(rows)
    assert "2 changed, 6 known already" in said
    assert f"run {rows[0]['run']}: visc" in said
    assert "was corrected to 77" in said
    again = {row["run"]: row for row in desk.sheet()}
    assert float(again[half["run"]]["visc"]) == float(known)
    assert float(again[half["run"]]["yield_pct"]) == true_yield(float(half["T_C"]), half["cat"])
    assert [len(desk.surface(name).data) for name in ("yield_pct", "visc")] == [8, 8]
    steps = []
    fit_study(open_study(desk.folder), force=True, on_step=steps.append)
    assert steps[:2] == ["fitting yield_pct (1 of 2)", "fitting visc (2 of 2)"]
    (told,) = all_corrections(open_study(desk.folder))
    assert (told.run, told.name, told.new) == (f"run {rows[0]['run']}", "visc", "77")


def test_the_run_order_is_drawn_once(desk):
    first = [row["run"] for row in desk.sheet()]
    assert first != sorted(first, key=int)
    assert [row["run"] for row in desk.sheet()] == first
    rows = desk.sheet("--seed", 5)
    assert [row["run"] for row in rows] != first
    assert [row["run_order"] for row in rows] == [str(place + 1) for place in range(8)]
    fill(rows[0])
    desk.record(rows)
    assert [row["run"] for row in desk.sheet()] == [row["run"] for row in rows]
    (desk.folder / "sheet.csv").unlink()
    for options in (["--seed", 6], ["--standard-order"]):
        refused = desk("sheet", *options, desk.folder / "sheet.csv", expect=2)
        assert "1 runs have results, so the order stays" in " ".join(refused.split())


def test_residuals_are_judged_in_the_order_in_which_runs_were_made(desk):
    """The sheet comes back sorted by `run`, in two goes, with a run in between that was not planned."""
    rows = desk.sheet()
    for row in rows:
        fill(row)
    late = [row for row in rows if row["run_order"] in "12"]
    early = [row for row in rows if row not in late]
    extra = dict.fromkeys(rows[0], "") | {"T_C": "164.0", "cat": "Ni", "run_order": "5.5", "kind": "added"}
    fill(extra)
    desk.record([*sorted(early, key=lambda row: int(row["run"])), extra])
    desk.record(sorted(late, key=lambda row: int(row["run"])))
    made = sorted([*early, extra], key=lambda row: float(row["run_order"])) + late
    place = {(row["run"] or "added 1"): number for number, row in enumerate(made, start=1)}
    folder = open_study(desk.folder)
    desk("fit")
    fitted = folder.fitted()
    surface = fitted.surfaces["visc"]
    assert surface.data.order == tuple(place[label] for label in [*map(str, range(1, 9)), "added 1"])
    scene = page_document(gather_findings(folder))["fits"]["visc"]["columns"]
    assert dict(zip(scene["labels"], scene["order"], strict=True)) == place
    axes = residuals(surface.surface, "run")
    assert axes.get_xlabel() == "run order"
    assert axes.lines[-1].get_xdata().tolist() == list(surface.data.order)
    assert leverage(surface.surface).get_xlabel() == "run order"


def test_settings_that_drifted_are_fitted_where_they_were(desk):
    rows = desk.sheet()
    rows[0]["T_C actual"] = "163"
    for row in rows:
        fill(row)
    numbered = next(row for row in rows[1:] if row["T_C"] == "150.0")
    numbered["T_C"] = "152.5"  # typed over what was planned
    fill(numbered)
    said = desk.record(rows)
    assert f"run {rows[0]['run']} was made at T_C = 163 instead of {float(rows[0]['T_C']):g}" in said
    assert f"run {numbered['run']} was made at T_C = 152.5 instead of 150" in said
    surface = desk.surface("yield_pct")  # a parabola without noise: right only if fitted at the true settings
    assert surface.predict([[157.0, 0]])[0] == pytest.approx(true_yield(157, "Pd"), rel=1e-9)
    assert {163.0, 152.5} <= set(surface.data.points[:, 0])
    assert "not made as planned, and fitted where they were made: 2 of the runs: D-eff" in desk(
        "fit", "--force"
    )


def test_runs_that_were_not_planned_are_taken_on_request(desk):
    rows = desk.sheet()
    extra = dict.fromkeys(rows[0], "") | {"T_C": "164.0", "cat": "Ni"}
    for row in (*rows, extra):
        fill(row)
    said = desk.record([*rows, extra])
    assert "1 not in the design" in said
    assert "add --take-unplanned" in " ".join(said.split())
    assert len(desk.surface("visc").data) == 8
    assert "1 not in the design" in desk.record([*rows, extra], "--take-unplanned")
    assert len(desk.surface("visc").data) == 9
    assert [row["kind"] for row in desk.sheet()][-1] == "added"


def test_runs_made_by_hand_stay_when_the_design_changes(desk):
    rows = desk.sheet()
    for row in rows:
        fill(row)
    desk.record(rows)
    study = desk.folder / "study.toml"
    study.write_text(
        study.read_text().replace('kind = "file"\nfile = "own.csv"', 'kind = "optimal"\nruns = 12')
    )
    desk("plan")
    new = desk.sheet()
    assert (len(new), sum(bool(row["yield_pct"]) for row in new)) == (12, len(POINTS))


def test_an_excluded_run_is_kept_and_named(desk):
    rows = desk.sheet()
    for row in rows:
        fill(row)
    rows[2]["excluded"], rows[2]["batch"] = "stirrer stopped", "007"
    for row in rows:
        row.setdefault("batch", "12E3")
    rows[4]["yield_pct"] = rows[4]["visc"] = ""
    rows[4]["excluded"] = "flask broke"
    desk.record(rows)
    assert len(desk.surface("yield_pct").data) == 6
    (said,) = desk.fit().warnings()
    assert f"run {rows[2]['run']} (stirrer stopped)" in said
    assert f"run {rows[4]['run']} (flask broke)" in said
    assert "6 of 8 runs done, 2 excluded" in desk("status")
    again = desk.sheet()
    assert (float(again[2]["yield_pct"]), again[2]["batch"], again[0]["batch"]) == (
        float(rows[2]["yield_pct"]),
        "007",
        "12E3",
    )
    again[2]["excluded"] = "no"
    assert "excluded stirrer stopped was corrected to no" in desk.record(again)
    assert len(desk.surface("yield_pct").data) == 7


def test_what_is_next_is_a_sheet_where_people_make_the_runs(desk):
    """`plan`, `record`, `fit` and `status` say the same, and what they say does not fail."""

    def told(text):
        return text.split("Next: ")[1].replace(f" {desk.folder}", "").strip()

    (desk.folder / "study.toml").write_text(
        STUDY + '[[search]]\nname = "best"\nminimize = "-yield_pct"\n[verify]\nreplicates = 2\n'
    )
    assert "its runs are made by hand" in desk("check")
    assert told(desk("plan")) == told(desk("status")) == "rsmkit sheet FILE.csv"
    assert "0 of 8 runs done" in desk("status")  # a point that is repeated needs as many runs
    rows = desk.sheet()
    for row in rows[1:]:
        fill(row)
    assert told(desk.record(rows)) == told(desk("status")) == "rsmkit record FILE.csv"
    fill(rows[0])
    assert told(desk.record(rows)) == told(desk("status")) == "rsmkit fit"
    assert told(desk("fit")) == told(desk("status")) == "rsmkit sheet FILE.csv"
    desk("verify", expect=4)
    rows = desk.sheet()
    optima = [row for row in rows if row["kind"] == "optimum"]
    assert len(optima) == 2
    fill(optima[0])
    assert told(desk.record(rows)) == told(desk("status")) == told(desk("fit")) == "rsmkit verify"
    assert "CONFIRMED" in desk("verify")
    assert told(desk("fit")) == told(desk("check")) == told(desk("status"))
    # each of the runs at the optimum has a name of its own, the same in the terminal and in reports
    fill(optima[1])
    desk.record(rows)
    for row, value in zip(optima, ("1", "2"), strict=True):
        row["visc"] = value
    said = " ".join(desk.record(rows).split())
    first, second = all_corrections(open_study(desk.folder))
    assert (first.new, second.new) == ("1", "2")
    assert second.run == f"{first.run} (repetition 2)" or first.run == f"{second.run} (repetition 2)"
    assert first.sentence in said
    assert second.sentence in said


def test_the_report_has_what_was_noted_beside_the_runs(desk):
    rows = desk.sheet()
    for number, row in enumerate(rows):
        fill(row)
        row["batch"], row["comment"] = f"lot {number % 2}", ""
    rows[3]["visc"], rows[2]["comment"] = "", "=spilt"
    desk.record(rows)
    desk("fit")
    desk("report", "--output", desk.folder / "r.xlsx")
    book = load_workbook(desk.folder / "r.xlsx")
    heads, *runs = [[cell.value for cell in row] for row in book["Runs"]]
    assert heads == ["run", "made as", "T_C", "cat", "yield_pct", "visc", "state", "why", "batch", "comment"]
    for row, made in ((row, next(r for r in rows if int(r["run"]) == row[0])) for row in runs):
        assert row[1] == int(made["run_order"])
        assert row[8:] == [made["batch"], made["comment"] or None]
        assert (row[5] is None) == (made["visc"] == "")
    hashes = {row[0].value: row[1].value for row in book["Files and their hashes"]}
    for name in ("study.toml", "own.csv", "run-order.json", "runs.jsonl"):
        assert hashes[name] == sha256((desk.folder / name).read_bytes()).hexdigest(), name
    sizes = book["report"].column_dimensions["A"].width, book["report"].row_dimensions
    assert sizes[0] < 100  # sentences are broken, and have room
    longest = max(book["report"], key=lambda row: len(row[0].value))[0]
    assert sizes[1][longest.row].height >= 15 * len(longest.value) / sizes[0]


def test_a_value_is_taken_back_only_by_a_word(desk):
    rows = desk.sheet()
    fill(rows[0])
    desk.record(rows)
    rows[0]["yield_pct"], rows[0]["visc"] = "withdrawn", "n/a"
    assert "was corrected to withdrawn" in desk.record(rows)
    again = desk.sheet()[0]
    assert (again["yield_pct"], bool(again["visc"])) == ("", True)
    assert f"another row is run {rows[0]['run']} as well" in desk.record([*rows, rows[0]], expect=2)


def test_confirmation_runs_are_judged_and_never_fitted(desk):
    rows = desk.sheet()
    good, bad = (
        dict.fromkeys(rows[0], "") | {"kind": "confirmation", "T_C": "164", "cat": c} for c in ("Pd", "Ni")
    )
    for row in (*rows, good, bad):
        fill(row)
    for row, noise in zip(rows, (0.3, -0.2, 0.1, -0.3, 0.2, 0.25, -0.1, -0.25), strict=True):
        row["yield_pct"] = str(float(row["yield_pct"]) + noise)
    bad["yield_pct"] = "60"
    good["visc"] = bad["visc"] = ""
    desk.record([*rows, good, bad])
    result = desk.fit()
    assert len(result.surfaces["yield_pct"].data) == 8
    assert [run.verdict for run in result.confirmations] == ["CONFIRMED", "NOT CONFIRMED"]
    compared = result.confirmations[1].responses["yield_pct"]
    mean, low, high = result.surfaces["yield_pct"].predict([[164.0, 1]], 0.95)
    assert (compared.predicted, compared.low, compared.high) == (mean[0], low[0], high[0])
    assert "at T_C = 164, cat = Ni: yield_pct is 60, predicted" in result.confirmations[1].sentence


@pytest.mark.parametrize("format_", ["as written", "of a spreadsheet in Germany"])
def test_a_study_of_the_first_version_loads(tmp_path, format_):
    """Journal, design and sheet of then: all is known, nothing is recorded twice, a correction is one."""
    for path in (DATA / "runs" / "first_laboratory").iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    sheet = tmp_path / "sheet.csv"
    rows = list(csv.DictReader(sheet.read_text().splitlines()))
    text = sheet.read_text()
    if format_ != "as written":
        text = "\ufeff" + text.replace(",", ";").replace(".", ",")
    sheet.write_text(text)

    def typed(*command):
        done = CliRunner().invoke(main, [*map(str, command), str(tmp_path)])
        assert done.exit_code == 0, done.output
        return " ".join(done.output.split())

    assert "10 of 10 runs done" in typed("status")
    said = typed("record", sheet)
    assert "0 runs recorded, 0 changed, 11 known already" in said
    assert "corrected" not in said
    sheet.write_text(text.replace("59.60", "59.50", 1).replace("59,60", "59,50", 1))
    assert "run 1: yield_pct 59.6 was corrected to 59.5" in typed("record", sheet)
    typed("sheet", tmp_path / "new.csv")
    again = list(csv.DictReader((tmp_path / "new.csv").read_text().splitlines()))
    assert len(again) == len(rows) == 11
    for new in again:
        (old,) = [row for row in rows if row["run"] == new["run"]]
        values = (float(new["yield_pct"]), float(new["visc"]), new["Bemerkung"])
        said = 59.5 if new["run"] == "1" else float(old["yield_pct"])
        assert values == (said, float(old["visc"]), "ok")
    typed("fit")
    surface = open_study(tmp_path).fitted().surfaces["visc"]
    measured = {(float(row["T_C"]), float(row["t_min"])): float(row["visc"]) for row in rows if row["run"]}
    points = np.array([point for point in measured if point != (160, 15)])
    # a surface of six coefficients: at the nine points it is what least squares give by normal equations
    u, v = (surface.data.points.T - [[160], [15]]) / [[10], [5]]
    X = np.column_stack([u**0, u, v, u * u, u * v, v * v])
    b = np.linalg.solve(X.T @ X, X.T @ surface.data.y)
    U, V = (points.T - [[160], [15]]) / [[10], [5]]
    expected = np.column_stack([U**0, U, V, U * U, U * V, V * V]) @ b
    assert surface.predict(points) == pytest.approx(expected, rel=1e-9)
    assert sorted(surface.data.y) == sorted(float(row["visc"]) for row in rows if row["run"])


def test_a_study_of_the_second_version_loads(tmp_path):
    """Its journal has drifts, an exclusion, a correction, blanks and runs beside the plan."""
    for path in (DATA / "runs" / "second_laboratory").iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())

    def typed(*command):
        done = CliRunner().invoke(main, [*map(str, command), str(tmp_path)])
        assert done.exit_code == 0, done.output
        return " ".join(done.output.split())

    sheet, new = tmp_path / "sheet.csv", tmp_path / "new.csv"
    assert "0 runs recorded, 0 changed, 13 known already" in typed("record", sheet)
    typed("sheet", new)
    old, again = (list(csv.DictReader(path.read_text().splitlines())) for path in (sheet, new))
    places = ("T_C", "t_min", "T_C actual", "t_min actual", "yield_pct", "visc")

    def said(row):
        return row | {name: float(row[name]) for name in places if row[name]}

    assert [said(row) for row in again] == [said(row) for row in old]
    (correction,) = all_corrections(open_study(tmp_path))
    assert correction.sentence == "run 9: visc 51 was corrected to 41.5"
    fitted = fit_study(open_study(tmp_path))
    assert len(fitted.confirmations) == 1
    assert [len(fitted.surfaces[name].data) for name in ("yield_pct", "visc")] == [10, 9]
    taken = [row for row in old if not row["excluded"] and row["kind"] not in ("confirmation", "unplanned")]
    for name in ("yield_pct", "visc"):
        wanted = {
            (float(r["T_C actual"] or r["T_C"]), float(r["t_min"]), float(r[name])) for r in taken if r[name]
        }
        data = fitted.surfaces[name].data
        assert {(*point, y) for point, y in zip(data.points.tolist(), data.y.tolist(), strict=True)} == wanted
