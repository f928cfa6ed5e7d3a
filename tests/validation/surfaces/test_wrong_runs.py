"""Outliers and influence named, rows left out on request, robust estimates against R."""

import numpy as np
import pytest
from surfaces_data import DATA

from rsmkit.errors import FitError, RsmkitError
from rsmkit.surfaces.estimation.robust_regression import robust_fit
from rsmkit.surfaces.statistics.influence import bonferroni_p, flagged_runs, without_runs
from rsmkit.surfaces.statistics.robust_estimates import robust_estimates
from rsmkit.surfaces.tables.table_fit import fit_table

FACTORS = ["A", "B", "C", "D"]
TERMS = ["FO", "A*C", "A*D"]
WRONG = 15
"""Row of the filtration experiment that is made wrong: 15 where 70 was measured."""

# R 4.2, robustbase 0.95: lmrob(y ~ ..., control = lmrob.control(max.it = 500, rel.tol = 1e-13,
# refine.tol = 1e-13, nResample = 20000, best.r.s = 50, maxit.scale = 2000, scale.tol = 1e-14)); estimate,
# standard error, p. `wrong` is the table of the fixture below, `stack_loss` R's stackloss.
LMROB = {
    "stack_loss": (
        1.91235190664405,
        {
            "1": (-41.524611670121764, 5.297797664619250, 4.81613222403822e-07),
            "air": (0.938845476897267, 0.117429410767029, 3.68127385610616e-07),
            "temp": (0.579552744156289, 0.262963024590821, 4.16014801966560e-02),
            "acid": (-0.112921861954077, 0.069889932027604, 1.24562113137508e-01),
        },
    ),
    "wrong": (
        4.06469355214041,
        {
            "1": (70.68859652320707, 0.976872145820489, 2.49500947638544e-18),
            "A": (10.45051439807199, 0.864119039890510, 1.90325233174819e-08),
            "B": (2.04284863432124, 0.894299305842835, 3.98006391156189e-02),
            "C": (5.34342662815116, 0.902200208738762, 5.04495264641691e-05),
            "D": (7.63500759148202, 0.882162325024728, 9.35302541059869e-07),
            "A*C": (-9.61675490224613, 1.023945933102014, 3.70733183692706e-07),
            "A*D": (7.84359879833106, 0.946929059779684, 1.52479714132243e-06),
        },
    ),
}
# MASS 7.3: rlm(y ~ ..., psi = psi.huber, maxit = 500, acc = 1e-13)
RLM = {
    "stack_loss": {
        "1": (-41.026485373294975, 9.806872294353353),
        "air": (0.829385770253849, 0.111174962319929),
        "temp": (0.926059415548633, 0.303393403349562),
        "acid": (-0.127846317965419, 0.128846345686815),
    },
    "wrong": {
        "1": (70.31208119626167, 1.47852249815175),
        "A": (11.04458883551566, 1.65303840606506),
        "B": (1.70700507476820, 1.65303840606506),
        "C": (4.72649998644703, 1.65303840606506),
        "D": (7.05374365654054, 1.65303840606506),
        "A*C": (-9.20500252383175, 1.65303840606506),
        "A*D": (8.21775380607474, 1.65303840606506),
    },
}


@pytest.fixture(scope="module")
def tables(tmp_path_factory):
    """The filtration experiment with four runs at the centre and one wrong result."""
    path = tmp_path_factory.mktemp("wrong") / "wrong.csv"
    lines = (DATA / "published" / "filtration.csv").read_text().split()
    lines[WRONG] = lines[WRONG].rpartition(",")[0] + ",15"
    path.write_text("\n".join([*lines, *(f"0,0,0,0,{y}" for y in (73, 75, 66, 69))]) + "\n")
    unit = dict.fromkeys(("air", "temp", "acid"), (0.0, 1.0))
    return {
        "wrong": (path, FACTORS, ["y"], {"terms": TERMS}),
        "stack_loss": (
            DATA / "published" / "stack_loss.csv",
            list(unit),
            ["loss"],
            {"order": 1, "coding": unit},
        ),
    }


def fit(tables, name, **more):
    path, factors, responses, request = tables[name]
    return fit_table(path, factors, responses, **request, **more)


def answers(tables, name, **more):
    (found,) = fit(tables, name, **more).answers.values()
    return found


def test_the_wrong_run_is_named_with_what_it_does(tables):
    """R: outlierTest gives rstudent -12.1407 and a Bonferroni p of 8.4927e-07 for row 15, nothing else."""
    found = answers(tables, "wrong")["influence"]
    (row,) = found["flagged"]
    assert (row["row"], row["reasons"]) == (WRONG, ["outlier", "influential"])
    assert row["deleted"] == pytest.approx(-12.1407205064735, rel=1e-10)
    assert row["p_bonferroni"] == pytest.approx(8.4927e-07, rel=1e-4)
    without = fit(tables, "wrong", exclude=[WRONG]).report()["responses"]["y"]
    assert found["without"]["rows"] == [WRONG]
    for key in ("sigma", "r2", "r2_predicted", "df"):
        assert found["without"][key] == pytest.approx(without[key], rel=1e-12)
    for ours, theirs in zip(found["without"]["terms"], without["terms"], strict=True):
        assert ours["estimate"] == pytest.approx(theirs["estimate"], rel=1e-10)


def test_no_run_of_stack_loss_is_an_outlier_but_one_decides_much(tables):
    """R: the largest rstudent is -3.33049 (row 21, p 0.0889988 times n), its Cook's distance 0.692."""
    (surface,) = fit(tables, "stack_loss").surfaces.values()
    p = bonferroni_p(surface.fit)
    assert p.argmin() == 20
    assert p.min() == pytest.approx(0.0889988412866, rel=1e-10)
    flagged = {item.run + 1: item.reasons for item in flagged_runs(surface.surface)}
    assert flagged == {}


def test_two_wrong_runs_one_behind_the_other(tmp_path):
    """The second is hidden until the first is gone."""
    x = np.linspace(-1, 1, 20)
    y = 3 + 2 * x + 0.05 * np.cos(40 * x)
    y[4] += 30.0
    y[11] += 3.0
    path = tmp_path / "two.csv"
    path.write_text("x,y\n" + "\n".join(f"{a},{b}" for a, b in zip(x, y, strict=True)))
    flagged = fit_table(path, ["x"], ["y"], order=1).answers["y"]["influence"]["flagged"]
    assert [row["row"] for row in flagged if "outlier" in row["reasons"]] == [5, 12]


def test_a_run_that_decides_alone(tmp_path):
    """One far-out run: leverage near 1, residual near 0."""
    path = tmp_path / "far.csv"
    rows = zip([*range(9), 80], [3, 1, 4, 1, 5, 9, 2, 6, 5, 0], strict=True)
    path.write_text("x,y\n" + "\n".join(f"{x},{y}" for x, y in rows))
    (row,) = fit_table(path, ["x"], ["y"], order=1).answers["y"]["influence"]["flagged"]
    assert row["row"] == 10
    assert row["reasons"] == ["influential", "leverage"]


def test_the_text_shows_residuals_and_what_happens_without(tables):
    text = fit(tables, "wrong", robust="mm").summary()
    (line,) = [line for line in text.splitlines() if line.endswith("outlier, influential")]
    assert line.split()[:2] == ["15", "15"]
    assert "Without row 15: R2 0.969 (with: 0.72569), predicted R2 0.91726 (with: 0.19071)" in text
    assert "Rows that count less than half: 15 (0.00)" in text
    assert "outlier" not in fit(tables, "wrong", exclude=[WRONG]).summary()


def test_rows_keep_their_numbers_when_others_are_left_out(tables):
    found = fit(tables, "wrong", exclude=[1, 2]).report()["responses"]["y"]
    assert found["rows"] == list(range(3, 21))
    assert found["influence"]["flagged"][0]["row"] == WRONG
    assert (found["runs"], found["rows_without_value"]) == (18, 0)


def test_rows_that_are_not_there_cannot_be_excluded(tables):
    with pytest.raises(RsmkitError, match="no row 21 to exclude; its rows are 1 to 20"):
        fit(tables, "wrong", exclude=[21])


@pytest.mark.parametrize("name", LMROB)
def test_the_mm_estimate(tables, name):
    """Both programs iterate to 1e-12 or so; the p is as good as t, that is 1e-8 relative at |t| = 100."""
    scale, terms = LMROB[name]
    found = answers(tables, name, robust="mm")["robust"]
    assert found["scale"] == pytest.approx(scale, rel=1e-9)
    for row in found["terms"]:
        estimate, error, p = terms[row["name"]]
        assert row["estimate"] == pytest.approx(estimate, rel=1e-8)
        assert row["std_error"] == pytest.approx(error, rel=1e-8)
        assert row["p"] == pytest.approx(p, rel=1e-6)


@pytest.mark.parametrize("name", RLM)
def test_hubers_estimate(tables, name):
    """MASS divides the median absolute deviation by 0.6745, statsmodels by 0.674490: 1.5e-5 apart.

    Estimates follow the scale by less than a standard error each. In the correction of the standard errors
    for the number of coefficients, 1 + p var(psi') / (n mean(psi')^2), psi' being 1 where a run is not cut,
    MASS divides the variance by n - 1, statsmodels by n.
    """
    found = answers(tables, name, robust="huber")["robust"]
    whole = np.array(found["weights"]) == 1
    n, p = len(whole), len(found["terms"])
    ours, theirs = (1 + p / n * whole.var(ddof=ddof) / whole.mean() ** 2 for ddof in (0, 1))
    for row in found["terms"]:
        estimate, error = RLM[name][row["name"]]
        assert row["estimate"] == pytest.approx(estimate, abs=1e-4 * error)
        assert row["std_error"] * theirs / ours == pytest.approx(error, rel=1e-4)


def test_weights_enter_the_mm_estimate(tmp_path):
    """R: lmrob(stack.loss ~ ., stackloss, weights = rep(1:3, 7)) with the controls above."""
    lines = (DATA / "published" / "stack_loss.csv").read_text().split()
    path = tmp_path / "weighted.csv"
    path.write_text(
        "\n".join([f"{lines[0]},w", *(f"{x},{1 + i % 3}" for i, x in enumerate(lines[1:]))]) + "\n"
    )
    unit = dict.fromkeys(("air", "temp", "acid"), (0.0, 1.0))
    fitted = fit_table(path, list(unit), ["loss"], order=1, coding=unit, weights="w", robust="mm")
    found = fitted.answers["loss"]["robust"]
    assert found["scale"] == pytest.approx(2.5894731388053938, rel=1e-9)
    estimates = [row["estimate"] for row in found["terms"]]
    errors = [row["std_error"] for row in found["terms"]]
    assert estimates == pytest.approx(
        [-40.7122922344202749, 0.9298236879961379, 0.5019038201640974, -0.0976817263506232], rel=1e-7
    )
    assert errors == pytest.approx(
        [6.6307747864719104, 0.1840485478767624, 0.1814480500474238, 0.0806357343012897], rel=1e-6
    )


def test_units_of_the_factors_do_not_matter(tables):
    """Estimates in other units are those of the same fit, converted."""
    path, factors, responses, _ = tables["stack_loss"]
    coded = fit_table(
        path, factors, responses, order=1, coding={"air": (60, 10), "temp": (20, 5), "acid": (85, 4)}
    )
    (surface,) = coded.surfaces.values()
    found = robust_estimates(surface.surface)
    _, terms = LMROB["stack_loss"]
    assert found.coefficients[1] == pytest.approx(10 * terms["air"][0], rel=1e-8)
    assert np.sqrt(found.covariance[3, 3]) == pytest.approx(4 * terms["acid"][1], rel=1e-8)


def test_nearly_half_of_the_runs_may_be_wrong():
    """A line with 8 of 20 points far off: the MM estimate is that of the good ones (no cut reaches them)."""
    x = np.linspace(0, 1, 20)
    matrix = np.column_stack([np.ones(20), x])
    y = 1 + 2 * x + 0.01 * np.sin(50 * x)
    wrong = np.arange(8) * 2
    y[wrong] += 100 + 10 * x[wrong]
    found = robust_fit(matrix, y, "mm")
    assert found.coefficients == pytest.approx([1.0, 2.0], abs=0.02)
    assert (found.weights[wrong] == 0).all()


def test_what_cannot_be_fitted_robustly_is_said(tmp_path):
    path = tmp_path / "exact.csv"
    path.write_text("x,y\n" + "\n".join(f"{x},{2 * x + (x == 3)}" for x in range(8)))
    found = fit_table(path, ["x"], ["y"], order=1, robust="mm").answers["y"]["robust"]
    assert "fitted exactly" in found["reason"]
    few = tmp_path / "few.csv"
    few.write_text("x,y\n1,2\n2,4.1\n3,5.9\n")
    fitted = fit_table(few, ["x"], ["y"], order=1, robust="huber")
    assert "needs at least 4 runs" in fitted.answers["y"]["robust"]["reason"]
    assert "No Huber estimate: a robust fit of 2 coefficients needs" in fitted.summary()


@pytest.mark.parametrize("method", ["huber", "mm"])
def test_a_constant_response_has_no_scale(tmp_path, method):
    path = tmp_path / "constant.csv"
    path.write_text("x,z,y\n" + "\n".join(f"{x},{z},5" for x in (-1, 0, 1) for z in (-1, 0, 1)))
    found = fit_table(path, ["x", "z"], ["y"], order=1, robust=method).answers["y"]["robust"]
    assert "fitted exactly" in found["reason"]


def test_a_saturated_or_exact_fit_flags_nothing(tmp_path):
    path = tmp_path / "line.csv"
    path.write_text("x,y\n" + "\n".join(f"{x},{2 * x}" for x in range(8)))
    found = fit_table(path, ["x"], ["y"], order=1)
    assert found.report()["responses"]["y"]["influence"] == {"flagged": [], "without": None}
    assert "Bonferroni" not in found.summary()


def test_without_runs_that_are_needed(tmp_path):
    path = tmp_path / "one.csv"
    path.write_text("x,z,y\n" + "\n".join(f"{x},{int(x == 7)},{x * x}" for x in range(8)))
    surface = fit_table(path, ["x", "z"], ["y"], order=1).surfaces["y"].surface
    with pytest.raises(FitError, match="z"):
        without_runs(surface, [7])


def test_runs_in_random_groups_are_not_judged_one_by_one(tmp_path):
    path = tmp_path / "groups.csv"
    rows = [(g, x, 2 * x + 3 * g + (x * g) % 3) for g in range(4) for x in range(4)]
    path.write_text("g,x,y\n" + "\n".join(f"d{g},{x},{y}" for g, x, y in rows))
    found = fit_table(path, ["x"], ["y"], order=1, random=["g"])
    assert found.answers["y"]["influence"]["flagged"] == []
    with pytest.raises(RsmkitError, match="independent runs"):
        fit_table(path, ["x"], ["y"], order=1, random=["g"], robust="mm").report()
