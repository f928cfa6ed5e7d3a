"""Counts and yes/no against R's ``glm`` on published data, and what is refused.

R 4.2: ``glm(cbind(dead, 20 - dead) ~ sex*ldose, binomial)`` for the moths of Collett (1991), printed by
Venables & Ripley, *Modern Applied Statistics with S*, 4th ed., section 7.2; ``glm(breaks ~ wool*tension,
poisson)`` for ``datasets::warpbreaks``. Nine digits were printed; R's profile limits are interpolated, good
to four digits.
"""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.special import expit

from rsmkit.cli import main
from rsmkit.errors import FitError, RsmkitError
from rsmkit.surfaces.fitted_response import surface_from_json
from rsmkit.surfaces.tables.table_fit import fit_table

PUBLISHED = Path(__file__).parents[2] / "data" / "surfaces" / "published"
DEAD = {"M": (1, 4, 9, 13, 18, 20), "F": (0, 2, 6, 10, 12, 16)}


@pytest.fixture
def moths(tmp_path):
    rows = [f"{sex},{dose},{count},20" for sex, counts in DEAD.items() for dose, count in enumerate(counts)]
    path = tmp_path / "moths.csv"
    path.write_text("\n".join(["sex,ldose,dead,n", *rows]) + "\n")
    return path


def fit(path, *, columns="coded", **request):
    return fit_table(path, ["sex", "ldose"], ["dead"], columns=columns, terms=["FO", "TWI"], **request)


def test_moths(moths):
    found = fit(moths, distribution="binomial", trials="n").surfaces["dead"]
    report = found.report()
    terms = {term["name"]: term for term in report["terms"]}
    expected = {
        "1": (-2.993541755, 0.552699692),
        "sex[M]": (0.174986788, 0.778310028),
        "ldose": (0.906036435, 0.167101643),
        "sex[M]*ldose": (0.352912989, 0.269990246),
    }
    for name, (estimate, error) in expected.items():
        # what R prints follows from its own stop, at a relative change of the deviance of 1e-8
        assert terms[name]["estimate"] == pytest.approx(estimate, rel=1e-6)
        assert terms[name]["std_error"] == pytest.approx(error, rel=1e-5)
    assert terms["ldose"]["z"] == pytest.approx(5.4220678, rel=1e-5)
    assert (terms["1"]["low"], terms["1"]["high"]) == pytest.approx((-4.186578, -2.001860), rel=2e-4)
    assert (report["deviance"], report["null_deviance"]) == pytest.approx((4.99372731, 124.87559260))
    assert report["aic"] == pytest.approx(43.10412831)
    assert (report["df"], report["null_df"]) == (8, 11)
    sequential = {row["term"]: row["type1"]["chi2"] for row in report["anova_terms"]}
    assert sequential == pytest.approx(
        {"sex": 6.076979, "ldose": 112.041549, "sex*ldose": 1.763337}, rel=1e-6
    )
    point = found.space.point({"sex": "M", "ldose": 3.0})
    mean, low, high = found.predict(point[None], 0.95, "mean")
    assert mean[0] == pytest.approx(0.722779966, rel=1e-6)
    assert 0 < low[0] < mean[0] < high[0] < 1
    again = surface_from_json(json.loads(json.dumps(found.to_json())))
    assert again.report()["terms"] == report["terms"]


def test_breaks_of_yarn_vary_more_than_poisson():
    path = PUBLISHED / "warpbreaks.csv"
    table = fit_table(path, ["wool", "tension"], ["breaks"], terms=["FO", "TWI"], distribution="poisson")
    report = table.report()["responses"]["breaks"]
    assert (report["deviance"], report["null_deviance"]) == pytest.approx((182.30513129, 297.37221180))
    assert report["aic"] == pytest.approx(468.96920894)
    assert report["dispersion"]["estimate"] == pytest.approx(3.76388133, rel=1e-6)
    assert report["dispersion"]["over"]
    sequential = {row["term"]: (row["df"], row["type1"]["chi2"]) for row in report["anova_terms"]}
    assert sequential["wool"] == pytest.approx((1, 16.038753), rel=1e-6)
    assert sequential["tension"] == pytest.approx((2, 70.941571), rel=1e-6)
    assert sequential["wool*tension"] == pytest.approx((2, 28.086757), rel=1e-6)
    assert "vary more than a poisson distribution allows" in table.summary()


def test_a_rate_is_per_exposure(tmp_path):
    """Counts 10, 20, 40 over 1, 2, 4 hours are one rate whatever the factor does."""
    path = tmp_path / "rate.csv"
    path.write_text("x,count,hours\n-1,10,1\n0,20,2\n1,40,4\n-1,20,2\n")
    found = fit_table(path, ["x"], ["count"], order=1, distribution="poisson", exposure="hours")
    surface = found.surfaces["count"]
    assert surface.coefficients == pytest.approx([np.log(10), 0.0], abs=1e-9)
    assert surface.predict([[0.5]]) == pytest.approx([10.0])
    assert surface.gradient([[0.5]]) == pytest.approx(np.array([[0.0]]), abs=1e-8)


def test_separation_is_named(tmp_path):
    path = tmp_path / "apart.csv"
    rows = [f"{x},{z},{int(x > 0)}" for x in (-2, -1, 1, 2) for z in (-1, 1)]
    path.write_text("\n".join(["x,z,failed", *rows]) + "\n")
    with pytest.raises(RsmkitError, match=r"separated: a combination of .*x.* tells runs with only yes"):
        fit_table(path, ["x", "z"], ["failed"], order=1, distribution="binomial")
    rows[0] = "-2,-1,1"
    rows[-1] = "2,1,0"
    path.write_text("\n".join(["x,z,failed", *rows]) + "\n")
    fit_table(path, ["x", "z"], ["failed"], order=1, distribution="binomial")


@pytest.mark.parametrize(
    ("request_", "message"),
    [
        ({"distribution": "poisson", "trials": "n"}, "trials go with the distribution binomial"),
        ({"exposure": "n"}, "an exposure goes with"),
        ({"distribution": "binomial"}, r"row \d+: \d+ is neither 0 nor 1; name the trials"),
        ({"distribution": "binomial", "trials": "ldose"}, "named twice"),
        ({"distribution": "binomial", "trials": "n", "weights": "w"}, "neither weights nor random"),
    ],
)
def test_what_does_not_go_with_counts_is_refused(moths, request_, message):
    with pytest.raises(RsmkitError, match=message):
        fit(moths, **request_)


def test_parts_of_counts_are_refused(tmp_path):
    path = tmp_path / "parts.csv"
    path.write_text("x,y\n-1,1\n0,2.5\n1,4\n1,3\n")
    with pytest.raises(RsmkitError, match=r"row 2: 2.5 is no count"):
        fit_table(path, ["x"], ["y"], order=1, distribution="poisson")


def test_rows_are_numbered_as_in_the_table(tmp_path):
    path = tmp_path / "areas.csv"
    path.write_text("x,y,area\n-1,,1\n0,2,1\n1,4,-3\n1,3,1\n")
    with pytest.raises(RsmkitError, match=r"row 3: exposure of -3; it should be above 0"):
        fit_table(path, ["x"], ["y"], order=1, distribution="poisson", exposure="area")


def test_one_response_that_is_separated_does_not_stop_the_others(tmp_path):
    path = tmp_path / "two.csv"
    rows = ["-2,no,yes", "-1,no,no", "0,no,no", "0,yes,yes", "1,yes,no", "2,yes,yes"]
    path.write_text("\n".join(["x,apart,mixed", *rows]) + "\n")
    found = fit_table(path, ["x"], ["apart", "mixed"], terms=["FO"], distribution="binomial")
    assert list(found.surfaces) == ["mixed"]
    assert "separated" in found.not_fitted["apart"]
    assert found.report()["not_fitted"] == found.not_fitted
    assert "not fitted: response apart" in found.summary()
    # Half of the runs are yes on either side, so the probability is a half everywhere.
    assert found.surfaces["mixed"].predict([[0.0], [2.0]]) == pytest.approx([0.5, 0.5], abs=1e-9)
    dispersion = found.report()["responses"]["mixed"]["dispersion"]
    assert dispersion["p"] is None
    assert "single trials" in dispersion["words"]


def test_words_other_than_yes_and_no_are_refused(tmp_path):
    path = tmp_path / "words.csv"
    path.write_text("x,y\n-1,yes\n0,maybe\n1,no\n")
    with pytest.raises(RsmkitError, match=r"line 3: 'maybe' is neither yes nor no; write 1 or 0"):
        fit_table(path, ["x"], ["y"], terms=["FO"], distribution="binomial")


def test_the_command_line_fits_counts(moths, capsys):
    words = f"fit --data {moths} --factors sex,ldose --response dead --distribution binomial --trials n"
    with pytest.raises(SystemExit) as end:
        main([*words.split(), "--terms", "FO", "--json"])
    assert end.value.code == 0
    report = json.loads(capsys.readouterr().out)["responses"]["dead"]
    assert report["deviance"] == pytest.approx(6.757064, rel=1e-6)
    assert report["optimum"]["maximum"]["natural"]["sex"] == "M"


# ---------------------------------------------------------------------- bias-reduced estimates


@pytest.mark.parametrize(("distribution", "size"), [("binomial", "5,7"), ("poisson", "5,7")])
def test_bias_reduced_estimates_of_two_groups_add_a_half(tmp_path, distribution, size):
    """The closed form of Firth (1993): half an event more in each group, and of trials half a miss."""
    path = tmp_path / "groups.csv"
    n = [float(text) for text in size.split(",")]
    path.write_text(f"x,y,n\n-1,0,{n[0]:g}\n1,7,{n[1]:g}\n")
    column = {"binomial": "trials", "poisson": "exposure"}[distribution]
    found = fit_table(
        path, ["x"], ["y"], terms=["FO"], distribution=distribution, bias_reduced=True, **{column: "n"}
    )
    surface = found.surfaces["y"]
    counts = np.array([0.5, 7.5])
    if distribution == "binomial":
        expected = counts / (np.array(n) + 1.0)
    else:
        expected = counts / np.array(n)
    assert surface.predict([[-1.0], [1.0]]) == pytest.approx(expected, rel=1e-9)
    assert found.report()["responses"]["y"]["bias_reduced"] is True


def test_separated_runs_have_bias_reduced_estimates_and_tests(tmp_path):
    """Against the penalised likelihood written out here and minimised by another method."""
    path = tmp_path / "apart.csv"
    x = np.array([-1.0, -0.8, -0.3, -0.1, 0.2, 0.4, 0.7, 1.0])
    y = (x > 0).astype(float)
    path.write_text("x,y\n" + "".join(f"{a},{b:g}\n" for a, b in zip(x, y, strict=True)))
    with pytest.raises(FitError, match=r"separated.*or take bias-reduced estimates"):
        fit_table(path, ["x"], ["y"], terms=["FO"], distribution="binomial")
    found = fit_table(path, ["x"], ["y"], terms=["FO"], distribution="binomial", bias_reduced=True)
    matrix = np.column_stack([np.ones(8), x])

    def penalised(beta):
        p = expit(matrix @ beta)
        information = matrix.T @ (matrix * (p * (1 - p))[:, None])
        likelihood = np.log(np.where(y == 1, p, 1 - p)).sum()
        return -2.0 * likelihood - np.linalg.slogdet(information)[1]

    strict = {"xatol": 1e-10, "fatol": 1e-13, "maxiter": 4000}
    full = minimize(penalised, [0.0, 1.0], method="Nelder-Mead", options=strict)
    without = minimize(
        lambda b: penalised(np.array([b[0], 0.0])), [0.1], method="Nelder-Mead", options=strict
    )
    surface = found.surfaces["y"]
    # A minimum is found to the root of the rounding of its value by a method without derivatives.
    assert surface.predict([[0.5]])[0] == pytest.approx(expit(full.x @ [1.0, 0.5]), abs=1e-7)
    test = found.report()["responses"]["y"]["anova_terms"][0]
    assert test["chi2"] == pytest.approx(without.fun - full.fun, abs=1e-9)
    again = surface_from_json(surface.to_json())
    assert again.predict([[0.5]]) == pytest.approx(surface.predict([[0.5]]), abs=1e-12)
