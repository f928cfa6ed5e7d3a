"""Published mixture experiments against R's ``lm`` and numbers worked out by hand.

R solves by Householder QR: its coefficients are off by up to about the condition number of the columns times
1e-16, at most 712 times that here (flares, columns of length one), its standard errors and F likewise. Eight
digits are promised by both with room to spare.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rsmkit as rk

DATA = Path(__file__).parents[1] / "data" / "mixtures"
R = json.loads((DATA / "r_numbers.json").read_text())
ASKED: dict[str, dict[str, Any]] = {
    "sausage": {"mixture": ["MCC", "RS", "OF"], "model": "scheffe-special-cubic"},
    "yarn": {"mixture": ["a", "b", "c"]},
    "etch": {"mixture": ["x1", "x2", "x3"], "terms": ["x1*x2*x3", "x2*x3", "x1*x2*(x1-x2)", "x1*x3*(x1-x3)"]},
    "flare": {"mixture": ["mg", "nano3", "sr", "binder"]},
    "octane_eight": {"mixture": [f"x{j}" for j in range(1, 9)], "model": "scheffe-linear"},
    "burn": {"mixture": ["Coarse", "Fine", "Binder"], "factors": ["z"], "exclude": [6]},
    "fish_patties": {"mixture": ["x1", "x2", "x3"], "factors": ["z1", "z2", "z3"], "process": "main"},
}
RESPONSES = {"sausage": "Hardness", "yarn": "elongation", "etch": "erate", "flare": "light"}


def fitted(name: str, **more: Any) -> tuple[dict[str, Any], Any]:
    asked = {"factors": [], **ASKED[name], **more}
    response = RESPONSES.get(name, "y")
    fit = rk.fit_table(DATA / f"{name}.csv", asked.pop("factors"), [response], **asked)
    return fit.report()["responses"][response], fit.surfaces[response]


@pytest.mark.parametrize("name", sorted(ASKED))
def test_numbers_of_r(name: str) -> None:
    report, surface = fitted(name)
    truth = R[name]
    rows = {row["name"]: row for row in report["terms"]}
    assert sorted(rows) == sorted(truth["terms"])
    for key in ("estimate", "std_error", "t", "p"):
        ours = [rows[term][key] for term in truth["terms"]]
        np.testing.assert_allclose(ours, truth[key], rtol=1e-8, atol=1e-8 * np.abs(truth[key]).max())
    for key in ("sigma", "df", "r2", "r2_adjusted", "press"):
        np.testing.assert_allclose(report[key], truth[key][0], rtol=1e-8)
    np.testing.assert_allclose(report["model_test"]["F"], truth["f_model"][0], rtol=1e-8)
    linear = report["anova"]["linear blending"]
    assert linear["df"] == len(report["mixture"]["components"]) - 1
    np.testing.assert_allclose(linear["ss"], truth["ss_linear"][0], rtol=1e-8)
    limits = np.transpose(surface.predict(surface.data.points[:2], interval=0.95))
    np.testing.assert_allclose(limits, truth["prediction"], rtol=1e-8)


def test_the_sausages_are_those_of_the_text() -> None:
    """Special cubic: R2 about the mean 0.8341, s 4.647 on 4 degrees of freedom."""
    report, _ = fitted("sausage")
    estimates = {row["name"]: row["estimate"] for row in report["terms"]}
    assert [round(x, 5) for x in estimates.values()] == [
        54.30432, 48.79405, 62.93214, -28.75529, -72.93694, -0.06174, 16.95888,
    ]  # fmt: skip
    assert (round(report["r2"], 4), round(report["sigma"], 3), report["df"]) == (0.8341, 4.647, 4)


def test_yarn_is_that_of_cornell() -> None:
    report, _ = fitted("yarn")
    estimates = {row["name"]: row["estimate"] for row in report["terms"]}
    expected = {"a": 11.7, "b": 9.4, "c": 16.4, "a*b": 19.0, "a*c": 11.4, "b*c": -9.6}
    assert estimates == pytest.approx(expected, rel=1e-12)
    assert round(report["r2"], 4) == 0.9514
    assert report["blending_models"]["suggested"] == "quadratic"
    best = report["optimum"]["maximum"]
    assert sum(best["natural"].values()) == pytest.approx(1.0, abs=1e-12)
    # on the edge a + c = 1: 11.7 a + 16.4 c + 11.4 a c is greatest at a = (11.4 - 4.7) / 22.8
    a = 6.7 / 22.8
    assert best["natural"] == pytest.approx({"a": a, "b": 0.0, "c": 1 - a}, abs=1e-6)
    assert best["predicted"] == pytest.approx(16.4 - 4.7 * a + 11.4 * a * (1 - a), rel=1e-12)


def test_lattice_means_by_hand(tmp_path: Path) -> None:
    """{2, 2} lattice: pure blends are the coefficients, 4 y12 - 2 (y1 + y2) the blending."""
    table = tmp_path / "lattice.csv"
    table.write_text("a,b,y\n1,0,3\n0,1,5\n0.5,0.5,10\n1,0,3.5\n")
    report = rk.fit_table(table, [], ["y"], mixture=["a", "b"]).report()["responses"]["y"]
    assert [row["estimate"] for row in report["terms"]] == pytest.approx([3.25, 5.0, 4 * 10 - 2 * 8.25])


def test_pseudo_components_of_the_flares() -> None:
    """R: the same ``lm`` with ``(x - low) / (1 - sum(low))``."""
    report, _ = fitted("flare")
    assert report["mixture"]["pseudo"]["kind"] == "L"
    truth = [
        -208.180532321, 124.329145525, 61.995831110, 2908.339695521, 1136.224793418, 1105.591579299,
        -904.721399956, 439.942818148, -2324.818600759, -2342.490571870,
    ]  # fmt: skip
    np.testing.assert_allclose([row["estimate"] for row in report["terms_pseudo"]], truth, rtol=1e-8)
    best = report["optimum"]["maximum"]
    low, high = np.array(list(report["optimum"]["bounds"].values())).T
    blend = np.array(list(best["natural"].values()))
    assert abs(blend.sum() - 1.0) < 1e-12
    assert (blend >= low).all()
    assert (blend <= high).all()


def test_random_days_are_those_of_lmer() -> None:
    """R: lmerTest, Kenward-Roger; linear blending by ``contest`` of two differences of coefficients.

    REML is minimised there to about 1e-8 of the deviance, so the ratio of variances is right to some 1e-5.
    """
    fit = rk.fit_table(DATA / "days.csv", ["z"], ["y"], mixture=["a", "b", "c"], random=["day"])
    report = fit.report()["responses"]["y"]
    rows = {row["name"]: row for row in report["terms"]}
    truth = {
        "a": (3.24499592034, 0.4975905176, 4.271767440),
        "a*b": (11.83668072062, 1.2792981476, 8.166755147),
        "c*z": (-0.02891983177, 0.2037553485, 8.135188442),
    }
    for name, numbers in truth.items():
        ours = [rows[name][key] for key in ("estimate", "std_error_adjusted", "df")]
        np.testing.assert_allclose(ours, numbers, rtol=1e-5)
    variances = [row["variance"] for row in report["variance_components"]]
    np.testing.assert_allclose(variances, [0.792058826, 0.092272886], rtol=1e-5)
    linear = next(row for row in report["anova_terms"] if row["term"] == "linear blending")
    np.testing.assert_allclose([linear["F"], linear["denominator_df"]], [194.7677, 8.0156517], rtol=1e-5)


def test_counts_of_blends_are_those_of_glm() -> None:
    """R: ``glm(..., poisson)``; linear blending by the deviance of ``cnt ~ 1`` less ``-1 + a + b + c``."""
    fit = rk.fit_table(DATA / "days.csv", [], ["cnt"], mixture=["a", "b", "c"], distribution="poisson")
    report = fit.report()["responses"]["cnt"]
    truth = [1.811670098, 1.329925133, 2.055619784, -0.894535600, -2.303284438, 1.069959390]
    np.testing.assert_allclose([row["estimate"] for row in report["terms"]], truth, rtol=1e-8)
    linear = report["anova_terms"][0]
    assert (linear["term"], linear["df"]) == ("linear blending", 2)
    np.testing.assert_allclose(linear["chi2"], 3.055654451, rtol=1e-8)
