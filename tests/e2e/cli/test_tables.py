"""``rsmkit fit --data``: finished experiments in, published statistics out, without a study."""

import shutil
from pathlib import Path

import pytest

pytestmark = [pytest.mark.slow, pytest.mark.e2e]

DATA = Path(__file__).parents[2] / "data" / "surfaces"


def test_the_textbook_chemical_process(rsmkit):
    """Myers & Montgomery, the chemical-process CCD: yield, in coded units, as printed there."""
    shutil.copy(DATA / "montgomery_ccd.csv", rsmkit.folder / "runs.csv")
    document = rsmkit.json("fit", "--data", "runs.csv", "--factors", "x1,x2", "--response", "y1")
    report = document["responses"]["y1"]
    printed = {"1": 79.94, "x1": 0.995, "x2": 0.515, "x1*x2": 0.25, "x1^2": -1.376, "x2^2": -1.001}
    estimates = {term["name"]: term["estimate"] for term in report["terms"]}
    assert estimates == pytest.approx(printed, abs=6e-4)
    assert report["sigma"] == pytest.approx(0.2663, abs=5e-5)
    assert [report["stationary_point"]["coded"][x] for x in ("x1", "x2")] == pytest.approx(
        [0.389, 0.306], abs=5e-4
    )
    assert sorted(report["eigenvalues"]) == pytest.approx([-1.4143, -0.9635], abs=5e-5)
    assert report["lack_of_fit"]["df"] == [3, 4]


@pytest.mark.parametrize(
    ("name", "model", "term", "estimate", "std_error", "digits"),
    [
        ("Filip", ["--order", "10"], "x^10", -0.402962525080404e-4, 0.896632837373868e-5, 1e-10),
        ("NoInt1", ["--terms", "0,FO"], "x", 2.07438016528926, 0.165289256198347e-1, 1e-13),
    ],
)
def test_certified_regressions_of_nist(rsmkit, name, model, term, estimate, std_error, digits):
    """Degree ten in one factor, and a line through the origin; values as NIST prints them."""
    shutil.copy(DATA / f"strd_{name}.csv", rsmkit.folder / "runs.csv")
    document = rsmkit.json("fit", "--data", "runs.csv", "--factors", "x", "--response", "y", *model)
    found = {row["name"]: row for row in document["responses"]["y"]["terms_natural"]}[term]
    assert found["estimate"] == pytest.approx(estimate, rel=digits)
    assert found["std_error"] == pytest.approx(std_error, rel=1e-13)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--factors", "x1,x2"], "--factors and --response"),
        (["--factors", "x1,x9", "--response", "y1"], "x9"),
        (["--factors", "x1,x2", "--response", "y1", "--coding", "x1=5"], "coding"),
        (["--factors", "x1,x2", "--response", "y1", "--force"], "leave --force out"),
    ],
)
def test_wrong_use_is_explained(rsmkit, arguments, message):
    shutil.copy(DATA / "montgomery_ccd.csv", rsmkit.folder / "runs.csv")
    assert message in rsmkit("fit", "--data", "runs.csv", *arguments, expect=2).stderr


def test_columns_without_a_table_are_refused(rsmkit):
    found = rsmkit("fit", "--factors", "x1", "--response", "y", "--robust", "mm", "--details", expect=2)
    assert "--factors and --response and --robust and --details need --data" in found.stderr


def test_a_missing_file_is_explained(rsmkit):
    assert (
        "nowhere.csv"
        in rsmkit("fit", "--data", "nowhere.csv", "--factors", "x", "--response", "y", expect=2).stderr
    )


def test_names_a_terminal_cannot_print(rsmkit):
    """JSON stays JSON, and text stays readable, where output is plain ASCII."""
    rsmkit.environment["PYTHONIOENCODING"] = "ascii"
    (rsmkit.folder / "runs.csv").write_text("T °C,y\n1,2\n2,5\n3,4\n", encoding="utf-8")
    request = ("fit", "--data", "runs.csv", "--factors", "T °C", "--response", "y", "--order", "1")
    assert rsmkit.json(*request)["factors"] == ["T °C"]
    assert r"T \xb0C" in rsmkit(*request).stdout


def test_a_mixture_on_the_command_line(rsmkit):
    """Cornell's yarn: 11.7, 9.4, 16.4, 19.0, 11.4, -9.6."""
    shutil.copy(DATA.parent / "mixtures" / "yarn.csv", rsmkit.folder / "yarn.csv")
    asked = ("fit", "--data", "yarn.csv", "--mixture", "a,b,c", "--response", "elongation")
    report = rsmkit.json(*asked, "--model", "scheffe-quadratic")["responses"]["elongation"]
    assert report["mixture"] == {"components": ["a", "b", "c"], "total": 1.0, "pseudo": None}
    assert [round(row["estimate"], 9) for row in report["terms"]] == [11.7, 9.4, 16.4, 19.0, 11.4, -9.6]
