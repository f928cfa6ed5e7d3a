"""What the Fit view shows: limits, quantiles, equations as numbers, and the names of the runs."""

import json
import re

import numpy as np
import pytest
from click.testing import CliRunner
from command_line import runner

from rsmkit.cli.commands import main
from rsmkit.design.design import Design
from rsmkit.language.scheffe import scheffe_terms
from rsmkit.language.space import Factor, Space
from rsmkit.report.explorer.fit_scene import fit_scene
from rsmkit.report.explorer.run_labels import rows_of, run_labels
from rsmkit.report.findings import Findings
from rsmkit.runs.record.run import Run
from rsmkit.runs.record.run_table import Runs
from rsmkit.surfaces.models.box_cox import box_cox_curve
from rsmkit.surfaces.polynomial_fit import fit_surface
from rsmkit.surfaces.statistics.equations.equation_terms import equation_terms

SPACE = Space([Factor("T", 140.0, 180.0), Factor("t", 10.0, 30.0), Factor("cat", levels=("A", "B", "C"))])
POINTS = np.array([[T, t, c] for T in (140, 160, 180) for t in (10.0, 20.0, 30.0) for c in range(3)])


def values(points):
    a, b, c = (points[:, 0] - 160) / 20, (points[:, 1] - 20) / 10, points[:, 2]
    wiggle = 0.3 * np.sin(np.arange(len(points)) ** 2)
    return 70 + 4 * a + 3 * b - 2 * a * a + a * b + 2 * c + 1.5 * a * (c == 1) + wiggle


@pytest.fixture(scope="module")
def surface():
    return fit_surface(SPACE, POINTS, values(POINTS), response="y", deterministic=False)


def evaluated(equation, points):
    """An equation's value, worked out term by term."""
    return sum(b * np.prod([points[:, j] ** p for j, p in powers], axis=0) for b, powers in equation["terms"])


def test_equations_as_numbers_are_the_surface(surface):
    found = equation_terms(surface.surface)
    assert [(e["units"], e["category"]["cat"]) for e in found] == [
        (units, level) for level in "ABC" for units in ("natural", "coded")
    ]
    for equation in found:
        points = POINTS[POINTS[:, 2] == "ABC".index(equation["category"]["cat"])]
        given = points if equation["units"] == "natural" else SPACE.encode(points)
        np.testing.assert_allclose(evaluated(equation, given), surface.predict(points), rtol=1e-12)


@pytest.mark.parametrize("total", [1.0, 100.0])
@pytest.mark.parametrize("blending", ["quadratic", "cubic"])
def test_equations_of_a_mixture_beside_other_factors_are_the_surface(total, blending):
    """In percent, too: only proportions add up to one, which moving the origin of `heat` relies on."""
    space = Space(
        [Factor(name, 0.0, total) for name in "abc"]
        + [Factor("heat", 40.0, 80.0), Factor("cure", levels=("fast", "slow"))]
    ).mixture("a", "b", "c", total=total)
    points = space.snap(space.spread(np.random.default_rng(1).random((70, 5))))
    a, b, c, heat, cure = (points / [total, total, total, 1.0, 1.0]).T
    y = 3 * a + b * c + a * b * (a - b) + 0.01 * heat * a + 1e-4 * heat**2 + 0.5 * cure + 0.1 * np.sin(heat)
    terms = scheffe_terms(space, ("a", "b", "c"), blending)
    fitted = fit_surface(space, points, y, response="y", terms=terms, deterministic=False)
    found = equation_terms(fitted.surface)
    assert len(found) == 4
    for equation in found:
        own = points[points[:, 4] == ["fast", "slow"].index(equation["category"]["cure"])]
        coding = np.array(equation["coding"] or [[0.0, 1.0]] * 5)
        given = (own - coding[:, 0]) / coding[:, 1]
        np.testing.assert_allclose(evaluated(equation, given), fitted.predict(own), rtol=1e-11)


def test_limits_are_those_of_the_field(surface):
    """Cook (1977): median of F(12, 15) by R's qf(0.5, 12, 15); three mean leverages.

    Bonferroni: R's qt(1 - 0.05 / 54, 14). The power's interval ends where the sum of squares is the
    limit (Box & Cox 1964).
    """
    scene = fit_scene(surface)
    assert scene["parameters"] == 12
    assert scene["limits"]["leverage"] == pytest.approx(36 / 27)
    assert scene["limits"]["cooks_distance"] == pytest.approx(0.9886284867, rel=1e-9)
    assert scene["limits"]["deleted"] == pytest.approx(3.826375152, rel=1e-9)
    low = surface.report()["box_cox"]["low"]
    assert box_cox_curve(surface.surface, np.array([low]))[0] == pytest.approx(
        scene["box_cox_limit"], rel=1e-6
    )
    shown = scene["columns"]
    assert shown["residual"] == surface.report()["diagnostics"]["residual"]
    rank = np.argsort(shown["studentised"])
    assert (np.diff(np.array(shown["quantiles"])[rank]) > 0).all()
    assert json.dumps(scene, allow_nan=False)


def test_a_spoiled_run_is_flagged_by_its_label():
    y = values(POINTS)
    y[4] += 9.0
    spoiled = fit_surface(SPACE, POINTS, y, response="y", deterministic=False)
    scene = fit_scene(spoiled, None, [f"r{i}" for i in range(27)], [-1] * 27)
    (only,) = scene["flagged"]  # of runs that are not drawn only flagged ones stay
    assert (scene["columns"]["labels"], only["run"]) == (
        ["r4"],
        0,
    )
    assert "outlier" in only["reasons"]


def test_runs_are_called_by_their_rows_in_the_design(surface):
    rows = [0, 2, 3]  # the second run of the design failed
    made = tuple(
        Run(str(i), "s", {}, SPACE.values(POINTS[i]), 0, "done", {"y": 1.0}, {}, 0.1) for i in (*rows, 9)
    )
    design = Design(SPACE, POINTS[:5], ("given",) * 5)
    runs = Runs(SPACE, POINTS[[*rows, 9]], made, ("y",))
    findings = Findings("s", runs, {"y": surface}, design=design)
    assert run_labels(findings) == ["1", "3", "4", "added 1"]
    assert rows_of(surface, runs.points, [True, True, False, True])[:4] == [0, -1, 1, -1]


def test_the_page_of_a_table_says_what_is_not_shown(tmp_path):
    """Rows without a value are left out of one surface only; counts have no run-by-run judgement."""
    lines = ["x,z,y,w,bad,n"]
    for i, (x, z) in enumerate((x, z) for x in (1, 2, 3) for z in (4, 5, 6)):
        lines.append(f"{x},{z},{x * z + i % 2},{'' if i == 2 else x - z * z},{i},20")
    (tmp_path / "t.csv").write_text("\n".join(lines))
    data = ["fit", "--data", str(tmp_path / "t.csv"), "--factors", "x,z", "--page", str(tmp_path / "p.html")]

    def scene(*more):
        done = runner().invoke(main, [*data, "--json", *more])
        assert done.exit_code == 0, done.output
        assert json.loads(done.stdout)["files"] == [str(tmp_path / "p.html")]
        page = (tmp_path / "p.html").read_text(encoding="utf-8")
        return json.loads(re.search(r'id="data">(.*?)</script>', page, re.DOTALL)[1])

    both = scene("--response", "y,w", "--order", "1")
    assert both["run_labels"] == [str(i) for i in range(1, 10)]
    assert both["fits"]["w"]["columns"]["labels"] == ["1", "2", *(str(i) for i in range(4, 10))]
    assert both["fits"]["w"]["columns"]["runs"] == [0, 1, *range(3, 9)]
    counts = scene("--response", "bad", "--order", "1", "--distribution", "binomial", "--trials", "n")
    assert "limits" not in counts["fits"]["bad"]
    written = counts["fits"]["bad"]["polynomial"]
    assert [e["units"] for e in written["equations"]] == ["natural", "coded"]
    assert written["back"] == {"function": "logistic"}
    assert len(counts["fits"]["bad"]["columns"]["observed"]) == 9


def test_a_page_without_a_table_is_refused(tmp_path):
    told = CliRunner().invoke(main, ["fit", "--page", str(tmp_path / "p.html"), str(tmp_path)])
    assert told.exit_code != 0
    assert "rsmkit explore" in told.output
