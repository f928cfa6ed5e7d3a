"""Two-level designs: Lenth's method, the centre's test of curvature, near replicates."""

import numpy as np
import pytest
from scipy.stats import norm
from surfaces_data import DATA

from rsmkit.errors import RsmkitError
from rsmkit.surfaces.statistics.two_level.lenth import _null_ratios, _share_above, screen_effects
from rsmkit.surfaces.statistics.two_level.two_levels import curvature_test
from rsmkit.surfaces.tables.table_fit import fit_table

FACTORS = ["A", "B", "C", "D"]
FILTRATION = [45, 71, 48, 65, 68, 60, 80, 65, 43, 100, 45, 104, 75, 86, 70, 96]
"""Montgomery (2013), table 6.10: 2^4 in standard order."""
CENTER = [73, 75, 66, 69]
"""Montgomery (2013), example 6.7: the same experiment at the centre."""


def table(path, y, center=(), levels=("-1", "1"), columns=FACTORS):
    rows = [[levels[i >> j & 1] for j in range(len(columns))] for i in range(len(y))]
    rows = [*zip(rows, y, strict=True), *((["0"] * len(columns), value) for value in center)]
    lines = [",".join([*columns, "y"]), *(",".join([*row, str(value)]) for row, value in rows)]
    path.write_text("\n".join(lines) + "\n")
    return path


def report(path, words, columns=FACTORS, **more):
    return fit_table(path, columns, ["y"], terms=words, **more).report()["responses"]["y"]


@pytest.mark.parametrize("levels", [("-1", "1"), ("10", "50"), ("low", "up")])
def test_the_filtration_experiment(tmp_path, levels):
    """Montgomery (2013), example 6.2, whatever the units: Lenth's margins, and t and p as JMP prints them."""
    found = report(table(tmp_path / "f.csv", FILTRATION, levels=levels), ["A*B*C*D"])["screening"]
    assert (found["pse"], round(found["me"], 3), round(found["sme"], 2)) == (
        pytest.approx(2.625),
        6.748,
        13.70,
    )
    rows = {row["name"]: row for row in found["effects"]}
    printed = {"A": (8.24, 0.0004), "A*C": (-6.90, 0.0010), "D": (5.57, 0.0026), "A*B*D": (1.57, 0.1769)}
    for name, (t, p) in printed.items():
        assert (round(rows[name]["t"], 2), round(rows[name]["p_by_t"], 4)) == (t, p)
    assert rows["A"]["effect"] == pytest.approx(21.625)
    real = [row["name"] for row in found["effects"] if row["p"] < 0.05]
    assert sorted(real) == ["A", "A*C", "A*D", "C", "D"]
    order = sorted(found["effects"], key=lambda row: abs(row["effect"]))
    expected = norm.ppf(0.5 + 0.5 * (np.arange(15) + 0.5) / 15)
    np.testing.assert_allclose([row["half_normal"] for row in order], expected)


@pytest.mark.parametrize(
    ("count", "individual", "experimentwise"), [(7, 2.30, 4.87), (11, 2.21, 4.44), (15, 2.16, 4.24)]
)
def test_the_published_quantiles(count, individual, experimentwise):
    """5 % points of Wu & Hamada, *Experiments* (2000), appendix H.

    Both are simulations: 0.05 has a standard error below 0.0005 for single effects here, and of 0.0008 for
    the largest of 15; as much again in the table, and 0.0002 for its last digit.
    """
    one, largest = _null_ratios(count)
    assert _share_above(one, np.array([individual]))[0] == pytest.approx(0.05, abs=0.002)
    assert _share_above(largest, np.array([experimentwise]))[0] == pytest.approx(0.05, abs=0.004)


def test_where_lenths_method_does_not_apply(tmp_path):
    path = table(tmp_path / "f.csv", FILTRATION)
    four = table(tmp_path / "four.csv", FILTRATION[:4], columns=["A", "B"])
    assert "at least 3" in report(four, ["FO"], columns=["A", "B"])["screening"]["reason"]
    three = report(path, ["FO"], columns=["A", "B", "C"])
    assert "repeated" in three["screening"]["reason"]
    lines = path.read_text().splitlines()
    short = tmp_path / "short.csv"
    short.write_text("\n".join(lines[:-2]) + "\n")
    assert "equally precise" in report(short, ["FO", "TWI"])["screening"]["reason"]
    other = tmp_path / "other.csv"
    other.write_text("\n".join([*lines, "0.5,1,1,1,90"]) + "\n")
    assert "other values" in report(other, ["FO"])["screening"]["reason"]
    surface = fit_table(other, FACTORS, ["y"], terms=["FO"]).surfaces["y"].surface
    with pytest.raises(RsmkitError, match="y: A has other values"):
        screen_effects(surface)


def test_effects_without_noise_have_no_p(tmp_path):
    path = table(tmp_path / "f.csv", [0, 2, 0, 2, 0, 2, 0, 2], columns=["A", "B", "C"])
    found = report(path, ["A*B*C"], columns=["A", "B", "C"])["screening"]
    assert found["pse"] == pytest.approx(0.0, abs=1e-14)
    assert found["effects"][0]["effect"] == pytest.approx(2.0)


def test_the_curvature_of_the_filtration_experiment(tmp_path):
    """Montgomery (2013), example 6.7: difference -0.69, sum of squares 1.51, F on 1 and 3."""
    path = table(tmp_path / "f.csv", FILTRATION, CENTER)
    found = report(path, ["A*B*C*D"])["curvature"]
    assert found["difference"] == pytest.approx(70.0625 - 70.75)
    assert round(found["ss"], 2) == 1.51
    assert found["df"] == [1, 3]
    assert found["F"] == pytest.approx(1.5125 / 16.25)
    assert round(found["F"], 2) == 0.09


def test_curvature_against_pure_error():
    """Montgomery (2013), example 11.1: 0.0027 / 0.0430 = 0.063."""
    path = DATA / "montgomery_first_order.csv"
    surface = fit_table(path, ["x1", "x2"], ["y"], order=1).surfaces["y"].surface
    found = curvature_test(surface)
    assert (round(found.ss, 4), found.df, found.error) == (0.0027, 4, "pure error")
    assert found.f == pytest.approx(0.00272222 / 0.043, rel=1e-5)


def test_curvature_without_repeated_runs_is_judged_by_the_residual(tmp_path):
    """The t of the centre in the model with a column for it (ordinary least squares)."""
    path = table(tmp_path / "f.csv", FILTRATION, CENTER[:1])
    found = report(path, ["FO", "TWI"])["curvature"]
    signs = np.array([[1 if i >> j & 1 else -1 for j in range(4)] for i in range(16)] + [[0] * 4])
    pairs = [signs[:, i] * signs[:, j] for i in range(4) for j in range(i)]
    x = np.column_stack([np.ones(17), signs, *pairs, np.arange(17) == 16])
    beta, rss, *_ = np.linalg.lstsq(x, np.array([*FILTRATION, 73.0]), rcond=None)
    variance = rss[0] / 5 * np.linalg.inv(x.T @ x)[-1, -1]
    assert found["df"] == [1, 5]
    assert found["error"] == "residual"
    assert found["F"] == pytest.approx(beta[-1] ** 2 / variance, rel=1e-10)


def test_where_there_is_no_curvature_to_test(tmp_path):
    path = table(tmp_path / "f.csv", FILTRATION, CENTER)
    assert "take up" in report(path, ["FO", "A^2"])["curvature"]["reason"]
    plain = table(tmp_path / "p.csv", FILTRATION)
    assert "no runs at the centre" in report(plain, ["FO"])["curvature"]["reason"]


def test_the_text_tells_of_both(tmp_path):
    text = fit_table(
        table(tmp_path / "f.csv", FILTRATION, CENTER), FACTORS, ["y"], terms=["A*B*C*D"]
    ).summary()
    assert "Curvature: mean at two levels less mean at the centre -0.6875" in text
    assert "PSE 2.625, ME 6.7478, SME 13.699" in text


NEAR = """x,z,b,y
1,0,p,3.31
1.02,0.01,q,3.53
2,1,p,4.48
2.03,1.02,q,4.06
3,0,p,2.46
3.01,0,q,2.39
4,1,p,1.63
4.05,0.99,q,1.81
5,0.5,p,-1.87
5.04,0.52,q,-1.22
1,1,p,4.38
3,1.01,q,3.07
"""


def test_near_replicates(tmp_path):
    """R: anova(lm(y ~ b + x + z), lm(y ~ b + x + z + factor(c(1, 1, 2, 2, 3, 3, 4, 4, 5, 5, 6, 7))))."""
    path = tmp_path / "near.csv"
    path.write_text(NEAR)
    fitted = fit_table(path, ["x", "z"], ["y"], order=1, blocks="b", near_replicates=0.03)
    found = fitted.report()["responses"]["y"]
    assert "reason" in found["lack_of_fit"]
    assert found["near_replicates"]["groups"] == 7
    assert found["near_replicates"]["df"] == [6, 2]
    assert found["near_replicates"]["F"] == pytest.approx(5.865731005462 / 6 / (0.266125970149 / 2), rel=1e-9)
    assert "within 3 % of the ranges as repeated (7 groups): F 7.3471" in fitted.summary()
    far = fit_table(path, ["x", "z"], ["y"], order=1, near_replicates=1e-3).answers["y"]["near_replicates"]
    assert far["reason"] == "no two runs are that near"
    with pytest.raises(RsmkitError, match="share of the range"):
        fit_table(path, ["x", "z"], ["y"], order=1, near_replicates=3.0)


def test_exact_replicates_are_near_ones(tmp_path):
    """With repeated runs only, the test of near replicates is the ordinary one."""
    path = DATA / "montgomery_ccd.csv"
    found = fit_table(path, ["x1", "x2"], ["y1"], near_replicates=1e-6).report()["responses"]["y1"]
    assert found["near_replicates"]["df"] == found["lack_of_fit"]["df"]
    assert found["near_replicates"]["F"] == pytest.approx(found["lack_of_fit"]["F"], rel=1e-9)
