"""Every statistic against R (`lm`, `rsm`) on published data, to 1e-8 relative."""

import numpy as np
import pytest
from surfaces_data import DATASETS, our_name, r_results, surface

from rsmkit.language.terms import Terms
from rsmkit.surfaces.estimation.fit_data import FitData
from rsmkit.surfaces.models.box_cox import box_cox
from rsmkit.surfaces.models.polynomial import fit_polynomial
from rsmkit.surfaces.statistics.collinearity import variance_inflation
from rsmkit.surfaces.statistics.optima.canonical import canonical_analysis, stationary_statistic
from rsmkit.surfaces.statistics.optima.ridge import ridge_path, steepest_path
from rsmkit.surfaces.statistics.terms.anova import partial_anova

RTOL = 1e-8
second_order = pytest.mark.parametrize("name", [n for n, spec in DATASETS.items() if spec[2] == 2])
all_sets = pytest.mark.parametrize("name", DATASETS)


@all_sets
def test_coefficients(name):
    truth, report = r_results()[name], surface(name).report()
    for ours, theirs in (("estimate", "coef"), ("std_error", "se"), ("t", "t"), ("p", "p")):
        found = {term["name"]: term[ours] for term in report["terms"]}
        expected = {our_name(key): value for key, value in truth[theirs].items()}
        assert found == pytest.approx(expected, rel=RTOL, abs=1e-12 * (ours == "estimate"))


@all_sets
def test_scalars(name):
    truth, report, fit = r_results()[name], surface(name).report(), surface(name).fit
    expected = {
        key: truth[key][""] for key in ("sigma", "r2", "r2_adj", "press", "r2_pred", "loglik", "aic", "bic")
    }
    found = dict(
        zip(
            expected,
            (
                report[k]
                for k in (
                    "sigma",
                    "r2",
                    "r2_adjusted",
                    "press",
                    "r2_predicted",
                    "log_likelihood",
                    "aic",
                    "bic",
                )
            ),
            strict=True,
        )
    )
    assert found == pytest.approx(expected, rel=RTOL)
    assert fit.df == truth["df_resid"][""]
    assert (fit.residuals**2).sum() == pytest.approx(truth["rss"][""], rel=RTOL)


@all_sets
def test_all_terms_at_once(name):
    truth, found = r_results()[name], surface(name).report()["model_test"]
    assert found["F"] == pytest.approx(truth["F"][""], rel=RTOL)
    assert found["df"] == [truth["F_df1"][""], truth["F_df2"][""]]


@all_sets
def test_diagnostics(name):
    truth, fit = r_results()[name], surface(name).fit
    pairs = {
        "fitted": fit.fitted,
        "resid": fit.residuals,
        "leverage": fit.leverages,
        "resid_int_student": fit.studentised,
        "resid_ext_student": fit.deleted,
        "cooks_d": fit.cooks_distances,
        "dffits": fit.dffits,
    }
    for key, found in pairs.items():
        scale = np.abs(fit.y).max() if key in ("fitted", "resid") else 1.0
        np.testing.assert_allclose(
            found, list(truth[key].values()), rtol=RTOL, atol=1e-12 * scale, err_msg=key
        )


@pytest.mark.parametrize(
    "name", [n for n in DATASETS if not n.endswith("WLS")]
)  # R's file ignores weights there
def test_variance_inflation(name):
    expected = {our_name(key): value for key, value in r_results()[name]["vif"].items()}
    found = dict(zip(surface(name).names, variance_inflation(surface(name)), strict=True))
    assert np.isnan(found.pop("1"))
    assert found == pytest.approx(expected, rel=RTOL)


@all_sets
def test_anova_by_group_with_lack_of_fit(name):
    truth, found = r_results()[name], surface(name).report()["anova"]
    for label in truth["anova_df"]:
        group = label.split("(")[0]
        row = found.get(
            {"Residuals": "residual", "Lack of fit": "lack of fit", "Pure error": "pure error"}.get(
                group, group
            )
        )
        if row is None:
            assert name.startswith("printing_ink")  # no replicates: R divides zero by zero
            continue
        assert row["df"] == truth["anova_df"][label]
        for ours, theirs in (("ss", "anova_ss"), ("ms", "anova_ms"), ("F", "anova_F"), ("p", "anova_p")):
            if label in truth[theirs]:
                assert row[ours] == pytest.approx(truth[theirs][label], rel=RTOL), (label, ours)


@all_sets
def test_sequential_squares_of_single_terms(name):
    truth, fitted = r_results()[name], surface(name)
    order = {our_name(key): value for key, value in truth["type1_ss"].items()}
    exponents = dict(zip(fitted.names, fitted.terms.exponents, strict=True))
    terms = Terms((exponents["1"], *(exponents[key] for key in order)), fitted.terms.levels)
    again = fit_polynomial(fitted.space, name, fitted.data, terms)
    squares = dict(zip(again.names, again.fit.effects**2, strict=True))
    squares.pop("1")
    assert squares == pytest.approx(order, rel=RTOL, abs=1e-12 * again.fit.tss)


@all_sets
def test_partial_squares_of_single_terms(name):
    truth, fitted = r_results()[name], surface(name)
    expected = {our_name(key): value for key, value in truth["type3_ss"].items()}
    found = dict(zip(fitted.names, (fitted.t_values * fitted.fit.sigma) ** 2, strict=True))
    assert found == pytest.approx(expected, rel=RTOL, abs=1e-12 * fitted.fit.tss)


@second_order
def test_partial_anova_is_the_increase_of_the_residual_without_the_group(name):
    fitted = surface(name)
    rows = {row.source: row for row in partial_anova(fitted)}
    for group in ("FO", "TWI", "PQ"):
        keep = [i for i, g in enumerate(fitted.groups) if g != group]
        matrix, root = fitted.coded_matrix[:, keep], np.sqrt(fitted.fit.weights)
        beta = np.linalg.lstsq(matrix * root[:, None], fitted.fit.y * root, rcond=None)[0]
        rss = (fitted.fit.weights * (fitted.fit.y - matrix @ beta) ** 2).sum()
        assert rows[group].ss == pytest.approx(rss - fitted.fit.rss, rel=1e-7)


@all_sets
@pytest.mark.parametrize("kind", ["mean", "prediction"])
def test_intervals(name, kind):
    truth, short = r_results()[name], {"mean": "ci", "prediction": "pi"}[kind]
    points = np.array([[float(x) for x in key.split()] for key in truth["pred_fit"]])
    mean, low, high = surface(name).predict(points, interval=0.95, kind=kind)
    for found, key in ((mean, "pred_fit"), (low, f"pred_{short}_lo"), (high, f"pred_{short}_hi")):
        np.testing.assert_allclose(found, list(truth[key].values()), rtol=RTOL)
    spread = surface(name).fit.sigma * np.sqrt(surface(name).leverage(points))
    np.testing.assert_allclose(spread, list(truth["pred_se"].values()), rtol=RTOL)


@second_order
def test_stationary_point_and_eigenvalues(name):
    truth, fitted = r_results()[name], surface(name)
    canonical = canonical_analysis(fitted)
    np.testing.assert_allclose(canonical.stationary, list(truth["canonical_xs"].values()), rtol=RTOL)
    np.testing.assert_allclose(canonical.eigenvalues, list(truth["canonical_eigenvalue"].values()), rtol=RTOL)
    point = fitted.report()["stationary_point"]
    assert point["predicted"] == pytest.approx(truth["canonical_y_at_xs_block1"][""], rel=RTOL)


def test_blocks_as_additive_effects_leave_the_cell_means_for_pure_error():
    """With a block effect that is an exact constant shift, everything but the blocks stays as it was."""
    plain = surface("montgomery_ccd_y1")
    labels = ["2" if i % 3 == 0 else "10" for i in range(len(plain.data))]
    y = plain.data.y + 5.0 * np.array([label == "10" for label in labels])
    data = FitData(plain.data.points, y, None, tuple(labels))
    blocked = fit_polynomial(plain.space, "y1", data, plain.terms)
    assert blocked.names[:2] == ("1", "block[10]")
    reference = np.column_stack([plain.coded_matrix, np.array([label == "10" for label in labels], float)])
    beta, rss, *_ = np.linalg.lstsq(reference, y, rcond=None)
    assert blocked.fit.rss == pytest.approx(rss[0], rel=1e-9)
    np.testing.assert_allclose(blocked.coefficients, np.r_[beta[0], beta[-1], beta[1:-1]], rtol=1e-9)
    x = np.array([[0.3, -0.2]])
    expected = plain.terms.matrix(x)[0] @ beta[:-1] + beta[-1] / 2
    assert blocked.predict(x)[0] == pytest.approx(expected, rel=1e-12)


@second_order
def test_eigenvalue_errors_and_box_hunter_statistic(name):
    truth, fitted = r_results()[name], surface(name)
    np.testing.assert_allclose(
        canonical_analysis(fitted).std_errors, list(truth["canonical_eigenvalue_se"].values()), rtol=RTOL
    )
    points = np.array([[float(x) for x in key.split()] for key in truth["box_hunter_stat"]])
    np.testing.assert_allclose(
        stationary_statistic(fitted, points), list(truth["box_hunter_stat"].values()), rtol=RTOL
    )


@second_order
@pytest.mark.parametrize("goal", ["maximize", "minimize"])
def test_ridge_path(name, goal):
    truth, key = r_results()[name], f"ridge_{goal[:3]}"
    radii = [float(r) for r in truth[f"{key}_x1"]]
    path = ridge_path(surface(name), radii, goal)
    expected = np.column_stack([list(truth[f"{key}_{f}"].values()) for f in surface(name).space.names])
    np.testing.assert_allclose(path.coded, expected, rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(path.predicted, list(truth[f"{key}_y_block1"].values()), rtol=RTOL)


@pytest.mark.parametrize("name", [n for n, spec in DATASETS.items() if spec[2] == 1])
def test_steepest_direction(name):
    path = steepest_path(surface(name), [0.0, 1.0])
    np.testing.assert_allclose(path.coded[1], list(r_results()[name]["steepest_unit"].values()), rtol=RTOL)


@pytest.mark.parametrize(
    "name", [n for n in DATASETS if n not in ("printing_ink_sd", "montgomery_ccd_y1_WLS")]
)
def test_box_cox(name):
    truth, found = r_results()[name], box_cox(surface(name))
    for key, value in (("boxcox_lambda", found.power), ("boxcox_lo", found.low), ("boxcox_hi", found.high)):
        if "" in truth[key]:
            assert value == pytest.approx(truth[key][""], rel=1e-6), key
