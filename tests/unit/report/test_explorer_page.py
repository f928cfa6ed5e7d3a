"""The explorer page as a file: what it holds, what it refuses, how it words its verdict."""

import json
import re
from dataclasses import replace
from html import unescape
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from rsmkit.design.design import Design
from rsmkit.errors import RsmkitError
from rsmkit.language.browser_formula import browser_formula
from rsmkit.language.expression import parse_expression
from rsmkit.language.space import Factor, Space
from rsmkit.language.terms import full_terms
from rsmkit.optimum.optimum import Candidate, Optimum
from rsmkit.report.explorer.explorer_page import SCRIPTS, embedded_json, explorer_html, write_explorer
from rsmkit.report.explorer.inline_page import ExplorerPage
from rsmkit.report.explorer.page_document import page_document
from rsmkit.report.explorer.verdict import quality_words
from rsmkit.report.findings import Findings
from rsmkit.report.replay import read_replay
from rsmkit.runs.record.run import Run
from rsmkit.runs.record.run_table import Runs
from rsmkit.surfaces.estimation.coordinates import hull
from rsmkit.surfaces.estimation.fit_data import FitData
from rsmkit.surfaces.fitted_response import FittedResponse
from rsmkit.surfaces.kinds import page_model
from rsmkit.surfaces.models.box_cox import BoxCoxSurface
from rsmkit.surfaces.models.gaussian_process import GaussianProcessSurface
from rsmkit.surfaces.models.polynomial import fit_polynomial
from rsmkit.surfaces.polynomial_fit import fit_surface
from rsmkit.verification.verification import (
    BestKnown,
    Comparison,
    Confirmation,
    ConstraintCheck,
    SimulatorRuns,
    Verification,
)

HOSTILE = '</script><!--<script>{{DATA}}"&\u2028'


def run(number, space, point, value):
    return Run(str(number), "s", {}, space.values(point), 0, "done", {"y": float(value)}, {}, 0.1)


@pytest.fixture(scope="module")
def findings():
    space = Space([Factor("a", 0.0, 1.0, label=HOSTILE), Factor("n", 1, 4, integer=True)])
    points = np.array([[x, n] for x in (0.0, 0.5, 1.0) for n in (1.0, 2.0, 4.0)])
    y = 1 + points[:, 0] * points[:, 1] + np.sin(7 * points[:, 0])
    made = tuple(run(i, space, p, v) for i, (p, v) in enumerate(zip(points, y, strict=True)))
    surface = fit_surface(space, points, y, response="y")
    return Findings(
        HOSTILE,
        Runs(space, points, made),
        {"y": surface},
        functions={"twice": lambda x: 2 * x[:, 1]},
        failed=2,
    )


@pytest.fixture(scope="module")
def page(findings):
    return explorer_html(findings)


def test_texts_cannot_leave_their_place(page, findings):
    data = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)[1]
    document = json.loads(data)
    assert document["study"] == HOSTILE
    assert document["factors"][0]["label"] == HOSTILE
    assert document["points"] == findings.runs.points.tolist()
    # the page's own scripts and the data: nothing else may open or close one
    assert page.lower().count("</script>") == len(re.findall(r"<script[ >]", page.lower()))
    assert "<title>&lt;/script&gt;" in page


def test_the_page_asks_for_nothing(page):
    assert not re.search(r"""(src|href)=["'](?!data:|#)""", page)
    assert "default-src &#x27;none&#x27;" in page
    assert "unsafe-eval" not in page


def test_the_page_is_written_whole(findings, tmp_path, page):
    path = tmp_path / "explorer.html"
    path.write_text("old")
    write_explorer(path, findings)
    assert path.read_text(encoding="utf-8") == page
    assert [p.name for p in tmp_path.iterdir()] == ["explorer.html"]


def test_a_notebook_shows_the_page_itself(findings, tmp_path, page):
    path = ExplorerPage(tmp_path / "explorer.html")
    assert path._repr_html_() is None  # not written yet: a notebook shows the path
    write_explorer(path, findings)
    frame = path._repr_html_()
    assert re.fullmatch('<iframe title="explorer.html" [^<>]*></iframe>', frame)
    assert "allow-same-origin" not in frame
    text = unescape(re.search('srcdoc="([^"]*)"', frame)[1])
    assert text.replace('<base href="about:srcdoc">\n', "") == page
    assert path.parent._repr_html_() is None
    assert (path.name, isinstance(path, Path)) == ("explorer.html", True)


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_json_refuses_what_browsers_cannot_read(value):
    with pytest.raises(ValueError, match="JSON"):
        embedded_json({"x": value})


def test_the_page_knows_a_mixture_its_middle_and_what_the_sum_leaves_of_the_bounds():
    space = Space(a=(0.0, 1.0), b=(0.2, 1.0)).mixture("a", "b")
    points = np.array([[x, 1.0 - x] for x in (0.0, 0.25, 0.5, 0.8)])
    made = tuple(run(i, space, p, i) for i, p in enumerate(points))
    surface = fit_surface(space, points, points[:, 0] + 0.1 * points[:, 1] ** 2, response="y", order=1)
    document = page_document(Findings("m", Runs(space, points, made), {"y": surface}))
    assert document["mixtures"] == [{"components": [0, 1], "total": 1.0}]
    assert document["centre"] == pytest.approx([0.4, 0.6], abs=1e-15)
    assert [document["factors"][0][end] for end in ("low", "high")] == [0.0, 0.8]


def test_verdict_counts_failed_runs(page):
    told = (
        "9 for the design + 2 others (failed, excluded, confirming, refining, or of an earlier design) = 11."
    )
    assert told in page


@pytest.mark.parametrize(
    ("r2", "words"),
    [
        (0.999, "excellent"),
        (0.96, "very good"),
        (0.9, "good"),
        (0.6, "rough"),
        (-2.0, "poor: do not trust its optimum"),
    ],
)
def test_quality_in_words(r2, words):
    assert quality_words(r2) == words


def optimum(space, subject_to):
    best = Candidate(np.array([f.low for f in space]), (1.0,), {"y": 1.0}, (1.0,))
    return Optimum("best", space, ("y",), (subject_to,), {}, 1, 9, best)


def test_robust_objectives_are_told_but_not_drawn(findings):
    best = Candidate(np.array([0.0, 1.0]), (1.0,), {"y": 1.0}, ())
    settings = {"minimize": "y", "robust": {"noise": {"a": {}}, "deviations": 3.0}}
    robust = Optimum("sturdy", findings.space, ("robust_objective",), (), settings, 1, 9, best)
    told = replace(findings, optima=(robust,))
    assert page_document(told)["objectives"] == []
    assert "Minimise y; mean + 3 standard deviations over a." in explorer_html(told)


def test_cheap_functions_are_tabulated_at_values_factors_can_take(findings):
    functions = {"twice": lambda x: 2 * x[:, 1], "unused": lambda x: 1 / 0}
    used = replace(findings, functions=functions, optima=(optimum(findings.space, "twice <= 7"),))
    tables = page_document(used)["functions"]
    assert list(tables) == ["twice"]
    assert tables["twice"] == {  # over the factor it depends on
        "factors": [1],
        "axes": [[1.0, 2.0, 3.0, 4.0]],
        "values": [2.0, 4.0, 6.0, 8.0],
    }
    constant = replace(used, functions={"twice": lambda x: 0 * x[:, 0] + 5})
    assert set(page_document(constant)["functions"]["twice"]["values"]) == {5.0}


def test_a_function_that_no_factor_moves_is_tabulated_at_one_node(findings):
    functions = {"constant": lambda x: np.full(len(x), 1.6)}
    used = replace(findings, functions=functions, optima=(optimum(findings.space, "constant >= 0"),))
    assert page_document(used)["functions"] == {"constant": {"factors": [], "axes": [], "values": [1.6]}}


def test_constraints_are_told_as_limits(findings):
    told = [optimum(findings.space, text) for text in ("1 <= y <= 2 * 4", "a >= 0.1*n", "-3 < n")]
    limits = [c["limits"] for c in page_document(replace(findings, optima=told))["constraints"]]
    assert [[(part["subject"], part["side"], part["limit"]) for part in parts] for parts in limits] == [
        [("y", "low", 1.0), ("y", "high", 8.0)],
        [("a - (0.1 * n)", "low", 0.0)],
        [("n", "low", -3.0)],
    ]


def test_functions_of_many_factors_are_left_out():
    space = Space([Factor(f"x{j}", 0, 1) for j in range(20)])
    points = np.random.default_rng(0).uniform(size=(25, 20))
    surface = fit_surface(space, points, points.sum(axis=1) + np.arange(25) % 2, response="y", order=1)
    made = tuple(run(i, space, p, 1.0) for i, p in enumerate(points))
    findings = Findings(
        "many", Runs(space, points, made), {"y": surface}, functions={"f": lambda x: x.sum(axis=1)}
    )
    assert page_document(replace(findings, optima=(optimum(space, "f >= 0"),)))["functions"] == {"f": None}


def test_formulas_become_lists():
    assert browser_formula(parse_expression("2*a - max(b, 1)")) == [
        "+",
        ["*", 2.0, "a"],
        ["neg", ["max", "b", 1.0]],
    ]
    assert browser_formula(parse_expression("a")) == "a"


def test_a_surface_of_no_kind_is_refused():
    with pytest.raises(RsmkitError, match="no kind of surface makes a str"):
        page_model("surface")


def test_replays_are_read_and_thinned(findings, tmp_path):
    path = tmp_path / "history-1.csv"
    time = np.linspace(0.0, 9.0, 4001)
    rows = [f"{t!r},{'nan' if t == 0.0 else t * t}" for t in time.tolist()]
    path.write_text("\n".join(["time_s,x", *rows]))
    replay = read_replay(path, "best", {"a": 1.0, "n": 2})
    assert replay.columns["x"][:2] == [None, time[1] ** 2]
    kept = page_document(replace(findings, replays=(replay,)))["replays"][0]["columns"]
    assert 300 <= len(kept["time_s"]) <= 700
    assert (kept["time_s"][0], kept["time_s"][-1]) == (0.0, 9.0)
    path.write_text("time_s,x\n1,2\n3\n")
    with pytest.raises(RsmkitError, match="rsmkit verify"):
        read_replay(path, "best", {})


def test_of_very_many_runs_some_are_drawn(findings, monkeypatch):
    monkeypatch.setattr("rsmkit.report.explorer.page_document.SHOWN_RUNS", 4)
    document = page_document(findings)
    shown = [0, 3, 6]
    assert document["points"] == findings.runs.points[shown].tolist()
    assert document["responses"][0]["observed"] == findings.runs.y("y")[shown].tolist()
    columns = document["fits"]["y"]["columns"]
    assert columns["residual"] == findings.surfaces["y"].report()["diagnostics"]["residual"][::3]
    assert (columns["runs"], columns["labels"]) == ([0, 1, 2], ["1", "4", "7"])
    assert "One run in 3 is drawn below." in explorer_html(findings)


def test_notebooks_show_texts_of_the_user_as_texts():
    space = Space([Factor("a", 0.0, 1.0, label="<i>a</i>"), Factor("tool", levels=("<b>saw</b>", "file"))])
    points = np.array([[x, t] for x in (0.0, 0.3, 0.7, 1.0) for t in (0.0, 1.0)])
    y = 3 + points[:, 0] * (1 + points[:, 1]) + 0.1 * np.sin(9 * points[:, 0])
    data = FitData(points, y)
    transformed = fit_polynomial(space, "<u>y</u>", FitData(points, np.log(y)), full_terms(space, 1))
    lengths = np.ones(3)
    process = GaussianProcessSurface(
        space, "<u>y</u>", hull(space, points), data, "matern52", lengths, 1.0, 1e-3
    )
    best = Candidate(points[0], (1.0,), {"y": 1.0}, (1.0,))
    shown = (
        Design(space, points, ("run",) * 8),
        fit_surface(space, points, y, response="<u>y</u>", order=1),
        FittedResponse(BoxCoxSurface(transformed, 0.0, 1.0)),
        FittedResponse(process),
        Optimum("best", space, ("y",), (), {}, 1, 9, best),
    )
    for thing in shown:
        text = thing._repr_html_()
        assert "saw" in text or "&lt;u&gt;y" in text
        assert not re.search("<[ibu]>", text.removeprefix("<p><b>"))


@pytest.mark.parametrize(("objective", "says"), [(3.0, True), (0.5, False)])
def test_a_run_that_is_best_because_the_optimum_misses_a_limit_says_so(findings, objective, says):
    best = optimum(findings.space, "y >= 1")
    where = {"a": 0.0, "n": 1}
    at = Comparison(1.0, 0.95, 0.9, 1.1)
    confirmation = Confirmation(
        "best", "optimum", where, {"y": at}, {"y": at}, (ConstraintCheck("y >= 1", 0.0, -0.05),),
        "CONFIRMED", "as predicted", None, SimulatorRuns(4, 1), (),
        best_known=BestKnown("design run", where, objective),
    )  # fmt: skip
    told = replace(findings, optima=(best,), verification=Verification((confirmation,), SimulatorRuns(4, 1)))
    page = explorer_html(told)
    assert "(a run of the design" in page
    assert ("the best that keeps every limit: the optimum misses one" in page) == says


def test_no_text_of_the_scripts_runs_over_lines_whose_blanks_would_be_lost():
    for name in SCRIPTS:
        script = (files("rsmkit.report") / "page" / name).read_text(encoding="utf-8")
        assert not [line for line in script.splitlines() if line.count("`") % 2], name
