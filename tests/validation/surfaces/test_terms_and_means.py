"""Tests by term and means of levels against R (`car::Anova`, `emmeans`) on unbalanced data, to 1e-8."""

import csv
from collections import defaultdict
from functools import cache

import numpy as np
import pytest
from scipy.stats import t as student
from surfaces_data import DATA

from rsmkit.errors import RsmkitError
from rsmkit.language.space import Factor, Space
from rsmkit.language.terms import full_terms
from rsmkit.surfaces.polynomial_fit import fit_surface
from rsmkit.surfaces.statistics.terms.means import contrast_of_means, estimated_means, parse_contrast
from rsmkit.surfaces.statistics.terms.questions import Questions, answers
from rsmkit.surfaces.statistics.terms.studentized_range import range_tail
from rsmkit.surfaces.statistics.terms.term_tests import term_tests
from rsmkit.surfaces.tables.table_fit import fit_table

RTOL = 1e-8
CASES = {
    "warpbreaks": (
        {1, 5, 20, 21, 22, 40},
        {"factors": ["wool", "tension"], "responses": ["breaks"]},
    ),
    "mtcars": (
        set(),
        {
            "factors": ["cyl", "am", "wt", "vs"],
            "responses": ["mpg"],
            "weights": "w",
            "coding": {"wt": (3.5, 1.5), "vs": (0.0, 1.0)},
            "terms": ["FO", "cyl*am", "cyl*wt", "wt^2"],
        },
    ),
    "npk": (
        {3, 10, 17},
        {"factors": ["N", "P", "K"], "responses": ["yield"], "blocks": "block", "terms": ["FO", "N*P"]},
    ),
}
"""Data set: rows left out, and the fit (see tests/data/surfaces/README.md for the calls of R)."""
R_NAMES = {"wt": "x", "cyl*wt": "cyl*x", "wt^2": "x^2"}


@cache
def truth():
    found = defaultdict(lambda: defaultdict(dict))
    with open(DATA / "r_terms.csv", newline="") as file:
        for row in csv.DictReader(file):
            found[row["dataset"]][row["quantity"]][row["index"]] = float(row["value"])
    return found


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    folder, made = tmp_path_factory.mktemp("unbalanced"), {}
    for name, (left_out, request) in CASES.items():
        lines = (DATA / "published" / f"{name}.csv").read_text().splitlines()
        kept = [line for i, line in enumerate(lines) if i not in left_out]
        (folder / f"{name}.csv").write_text("\n".join(kept) + "\n")
        (made[name],) = fit_table(folder / f"{name}.csv", **request).surfaces.values()
    return made


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("kind", ["type2", "type3"])
def test_tests_by_term(fitted, name, kind):
    rows = fitted[name].report()["anova_terms"]
    for quantity in ("df", "ss", "F", "p"):
        found = {
            R_NAMES.get(row["term"], row["term"]): (row if quantity == "df" else row[kind])[quantity]
            for row in rows
        }
        assert found == pytest.approx(truth()[name][f"{kind}_{quantity}"], rel=RTOL), quantity


@pytest.mark.parametrize("name", CASES)
def test_means_and_differences(fitted, name):
    expected = truth()[name]
    for factor in {index.split(": ")[0] for index in expected["mean"]}:
        found = estimated_means(fitted[name].surface, factor).report()
        for row in found["levels"]:
            index = f"{factor}: {row['level']}"
            for ours, theirs in (
                ("mean", "mean"),
                ("std_error", "mean_se"),
                ("low", "mean_low"),
                ("high", "mean_high"),
            ):
                assert row[ours] == pytest.approx(expected[theirs][index], rel=RTOL), (index, ours)
        assert len(found["differences"]) == sum(x.startswith(f"{factor}: ") for x in expected["difference"])
        for row in found["differences"]:
            pair = row["pair"] if factor != "vs" else "vs0 - vs1"
            index = f"{factor}: {pair}"
            assert row["difference"] == pytest.approx(expected["difference"][index], rel=RTOL)
            assert row["std_error"] == pytest.approx(expected["difference_se"][index], rel=RTOL)
            # R's ptukey stops at an error of about 1e-8
            assert row["p"] == pytest.approx(expected["difference_p"][index], abs=1e-7)


def test_a_contrast_of_means(fitted):
    expected = truth()["warpbreaks"]
    factor, weights = parse_contrast("tension: T1=1, T2=-0.5, T3=-0.5")
    found = contrast_of_means(estimated_means(fitted["warpbreaks"].surface, factor), weights)
    for ours, theirs in (("estimate", "estimate"), ("std_error", "SE"), ("t", "t.ratio"), ("p", "p.value")):
        assert found[ours] == pytest.approx(expected[f"contrast_{theirs}"]["T1"], rel=RTOL)


def test_a_balanced_table_has_one_sum_of_squares(tmp_path):
    """Montgomery (2013), example 5.1, life of batteries: table 5.5 prints one for each term."""
    (surface,) = fit_table(
        DATA / "published" / "battery.csv", ["material", "temperature"], ["life"]
    ).surfaces.values()
    printed = {
        "material": (2, 10683.72, 7.91),
        "temperature": (2, 39118.72, 28.97),
        "material*temperature": (4, 9613.78, 3.56),
    }
    for test in term_tests(surface.surface):
        df, ss, f = printed[test.term]
        for row in (test.type1, test.type2, test.type3):
            assert (row.df, round(row.ss, 2), round(row.f, 2)) == (df, ss, f)


@pytest.mark.parametrize("df", [1, 2, 3, 10, 200])
@pytest.mark.parametrize("q", [0.05, 1.0, 3.5, 8.0])
def test_the_range_of_two_means_is_their_difference(q, df):
    """|x1 - x2| = sqrt(2) |t|; the integrals are good to 1e-12 absolute for df > 1 (a smooth density)."""
    assert range_tail(q, 2, df) == pytest.approx(
        2 * student.sf(q / np.sqrt(2), df), abs=1e-12 if df > 1 else 1e-9
    )


@pytest.mark.parametrize(
    ("count", "df", "q05"), [(3, 10, 3.877), (4, 20, 3.958), (10, 5, 6.995), (5, 60, 3.977), (2, 2, 6.085)]
)
def test_the_published_five_percent_points(count, df, q05):
    """Upper 5 % points of the studentized range: Harter, *Order Statistics and Their Use* 1 (1970)."""
    assert range_tail(q05 - 5e-4, count, df) >= 0.05 >= range_tail(q05 + 5e-4, count, df)


def test_numbers_have_the_values_of_the_runs(tmp_path):
    path = tmp_path / "three.csv"
    path.write_text("x,z,y\n" + "\n".join(f"{x},{z},{x * x + z}" for x in (1, 2, 4) for z in (0, 1)))
    surface = fit_table(path, ["x", "z"], ["y"], terms=["FO", "x^2"]).surfaces["y"].surface
    found = estimated_means(surface, "x")
    assert found.levels == ("1", "2", "4")
    np.testing.assert_allclose(found.estimates, [1.5, 4.5, 16.5], rtol=1e-12)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("tension", "level=weight"),
        ("tension: T1=one", "level=weight"),
        ("tension: T1=1, T2=-0.5", "add to zero"),
        ("tension: T1=1, T9=-1", "T9"),
        ("tensio: T1=1, T2=-1", "did you mean 'tension'"),
    ],
)
def test_contrasts_that_mean_nothing_are_refused(fitted, text, message):
    with pytest.raises(RsmkitError, match=message):
        answers(fitted["warpbreaks"].surface, Questions(compare=(text,)))


def test_the_report_and_the_text_of_a_table_answer_what_was_asked():
    fitted = fit_table(
        DATA / "published" / "warpbreaks.csv",
        ["wool", "tension"],
        ["breaks"],
        means=["tension", "wool*tension"],
        compare=["tension: T1=1, T2=-1"],
    )
    report, text = fitted.report()["responses"]["breaks"], fitted.summary()
    assert list(report["means"]) == ["tension", "wool*tension"]
    assert len(report["means"]["wool*tension"]["differences"]) == 15
    (row,) = report["contrasts_of_means"]
    assert row["estimate"] == pytest.approx(report["means"]["tension"]["differences"][0]["difference"])
    assert "mean by wool*tension" in text
    assert "tension: +1 T1 -1 T2" in text


def test_a_saturated_table_has_sums_of_squares_but_no_tests(tmp_path):
    path = tmp_path / "four.csv"
    path.write_text("a,b,y\nlow,1,3\nhigh,1,5\nlow,2,4\nhigh,2,9\n")
    surface = fit_table(path, ["a", "b"], ["y"], coding={"b": (1.5, 0.5)}, terms=["FO", "TWI"]).surfaces["y"]
    report = surface.report()["anova_terms"]
    assert [row["type3"]["F"] for row in report] == [None] * 3
    np.testing.assert_allclose([row["type3"]["ss"] for row in report], [12.25, 6.25, 2.25])


def test_stretched_surfaces_know_no_types(fitted):
    class Stretched:
        units, response = "stretched", "y"

    with pytest.raises(RsmkitError, match="stretched"):
        term_tests.__wrapped__(Stretched())


def test_tests_by_term_of_categories_with_many_levels_are_those_of_the_textbook():
    """Every cell counts, however many there are: 20 parts by 3 operators twice (Montgomery, section 13.3)."""
    rng = np.random.default_rng(2)
    cells = np.array([(i, j) for i in range(20) for j in range(3) for _ in range(2)], float)
    y = rng.normal(size=len(cells)) + cells[:, 0] ** 2
    space = Space(
        [Factor("part", levels=tuple(map(str, range(20)))), Factor("operator", levels=tuple("abc"))]
    )
    found = fit_surface(space, cells, y, terms=full_terms(space, 2), deterministic=False)
    table, mean = y.reshape(20, 3, 2), y.mean()
    parts, operators = table.mean((1, 2)) - mean, table.mean((0, 2)) - mean
    both = table.mean(2) - mean - parts[:, None] - operators
    right = {
        "part": 6 * (parts**2).sum(),
        "operator": 40 * (operators**2).sum(),
        "part*operator": 2 * (both**2).sum(),
    }
    for row in term_tests(found.surface):
        assert [row.type2.ss, row.type3.ss] == pytest.approx([right[row.term]] * 2, rel=1e-9)
