"""Tables in the units people have: coding by range, both equations, categories, models without a constant.

Numbers of R 4.2 with the calls beside them.
"""

import itertools
import re

import numpy as np
import pytest

from rsmkit.errors import RsmkitError
from rsmkit.surfaces.fitted_response import surface_from_json
from rsmkit.surfaces.tables.table_fit import fit_table


def write(path, head, rows):
    path.write_text("\n".join([head, *(",".join(map(str, row)) for row in rows)]) + "\n")
    return path


# d digits leave an error of at most 5e-d of each term; d is 5 more than the digits lost between the largest
# sum of the sizes of the terms and the spread of the fitted values.
WRITTEN = 5e-5


def evaluated(equation, **values):
    """What an equation as it is printed gives."""
    response, _, text = equation.partition(" = ")
    assert response == "y"
    text = re.sub(r"(\w+)\[(\w+)\]", r"\1_\2", text).replace("^", "**")
    return eval(text, {"__builtins__": {}}, values)


CUBE = [(t, p, v) for t in (150, 175, 200) for p in (10, 20, 30) for v in (4, 14.5, 25)]
NOISE = [0.3, -1.1, 0.6, 0.2, -0.4, 1.2, -0.9, 0.1, 0.5, -0.2, 0.8, -0.7, 0.4, -1.3, 0.9, 0.0, 0.6, -0.5]
NOISE += [0.7, -0.1, -0.8, 1.0, -0.6, 0.3, 0.2, -0.3, -0.4]


@pytest.fixture
def cube(tmp_path):
    rows = []
    for (t, p, v), e in zip(CUBE, NOISE, strict=True):
        a, b, c = (t - 175) / 25, (p - 20) / 10, (v - 14.5) / 10.5
        rows.append((t, p, v, round(50 + 3 * a - 2 * b + 0.9 * c + a * b - 2 * a * a + e, 3)))
    return write(tmp_path / "cube.csv", "T,p,v,y", rows)


def test_an_orthogonal_design_in_natural_units_stays_orthogonal(cube):
    fitted = fit_table(cube, ["T", "p", "v"], ["y"])
    report = fitted.report()["responses"]["y"]
    terms = {term["name"]: term for term in report["terms"]}
    assert [terms[name]["vif"] for name in list(terms)[1:]] == pytest.approx([1.0] * 9)
    # lm(y ~ (a + b + c)^2 + I(a^2) + I(b^2) + I(c^2)) of the coded values, computed here by hand:
    # in an orthogonal design the slope is the sum of products over 18 rows at -1 or +1.
    coded = (np.array(CUBE) - [175, 20, 14.5]) / [25, 10, 10.5]
    y = np.loadtxt(cube, delimiter=",", skiprows=1)[:, 3]
    for j, name in enumerate("Tpv"):
        slope = coded[:, j] @ y / 18
        assert terms[name]["estimate"] == pytest.approx(slope)
        assert terms[name]["t"] == pytest.approx(slope / (report["sigma"] / np.sqrt(18)))
        assert terms[name]["effect"] == pytest.approx(2 * slope)
    assert terms["T^2"]["effect"] == pytest.approx(terms["T^2"]["estimate"])
    assert terms["1"]["effect"] is None


def test_steepest_ascent_follows_the_coded_slopes(cube):
    fitted = fit_table(cube, ["T", "p", "v"], ["y"], order=1)
    report = fitted.report()["responses"]["y"]
    slopes = np.array([term["estimate"] for term in report["terms"]])[1:]
    last = report["ascent"]["points"][-1]
    step = np.array(list(last["natural"].values())) - [175, 20, 14.5]
    np.testing.assert_allclose(
        step / np.linalg.norm(step / [25, 10, 10.5]), slopes * [25, 10, 10.5] / np.linalg.norm(slopes)
    )


def test_both_equations_give_the_predictions(cube):
    fitted = fit_table(cube, ["T", "p", "v"], ["y"])
    surface, found = fitted.surfaces["y"], fitted.surfaces["y"].report()["equations"]
    spread = np.ptp(surface.fit.fitted)
    for t, p, v in [(150, 10, 4), (163, 28.5, 20), (200, 30, 25)]:
        expected = surface.predict([[t, p, v]])[0]
        assert evaluated(found["natural"], T=t, p=p, v=v) == pytest.approx(expected, abs=WRITTEN * spread)
        coded = {"T": (t - 175) / 25, "p": (p - 20) / 10, "v": (v - 14.5) / 10.5}
        assert evaluated(found["coded"], **coded) == pytest.approx(expected, abs=WRITTEN * spread)
    text = " ".join(fitted.summary().split())
    assert all(found[units] in text for units in ("coded", "natural"))


PILOT = [(-1, -1, 2.1), (1, -1, 3.9), (-1, 1, 4.2), (1, 1, 6.1), (0, 0, 4.0), (0, 0, 4.1)]


def test_a_pilot_far_narrower_than_its_coding_is_read_as_it_was_asked_to_be(tmp_path):
    path = write(tmp_path / "pilot.csv", "angle,flow,y", PILOT)
    coding = {"angle": (0.0, 10.0), "flow": (0.0, 10.0)}
    fitted = fit_table(path, ["angle", "flow"], ["y"], coding=coding, terms=["FO"])
    surface = fitted.surfaces["y"]
    assert "say --columns coded" in fitted.notes[0]
    # lm(y ~ I(angle/10) + I(flow/10)): 4.06667, 9.25, 10.75; predict at angle = flow = 10: 24.0667
    assert surface.coefficients == pytest.approx([4.0666666667, 9.25, 10.75])
    assert surface.predict([[10, 10]])[0] == pytest.approx(24.0666666667)


@pytest.mark.parametrize("half", [0.1, 0.5, 1.2, 1.5, 2.0, 10.0, 1e3])
@pytest.mark.parametrize("center", [0.0, 0.3])
def test_the_size_of_a_coding_does_not_change_how_columns_are_read(tmp_path, center, half):
    path = write(tmp_path / "pilot.csv", "angle,flow,y", PILOT)
    coding = {"angle": (center * half, half), "flow": (0.0, half)}
    surface = fit_table(path, ["angle", "flow"], ["y"], coding=coding, terms=["FO"]).surfaces["y"]
    assert surface.coefficients[1:] == pytest.approx([0.925 * half, 1.075 * half])


PATH = [(-1, -1, 8.0), (1, -1, 12.5), (-1, 1, 9.0), (1, 1, 14.0), (0, 0, 11.0), (0, 0, 10.6), (6, 3, 30.0)]


@pytest.mark.parametrize("coding", [{}, {"a": (80.0, 5.0), "b": (2.0, 0.5)}])
def test_a_run_far_along_a_path_does_not_change_how_coded_columns_are_read(tmp_path, coding):
    path = write(tmp_path / "path.csv", "a,b,y", PATH)
    x = np.array([(1, a, b) for a, b, _ in PATH], float)
    expected = np.linalg.lstsq(x, np.array([row[2] for row in PATH]), rcond=None)[0]
    for columns in ("coded", None):
        fitted = fit_table(path, ["a", "b"], ["y"], coding=coding, columns=columns, terms=["FO"])
        assert fitted.surfaces["y"].coefficients == pytest.approx(expected)
        assert fitted.report()["columns_hold"] == "coded values"
        assert bool(fitted.report()["notes"]) == (columns is None)


def test_runs_far_from_the_range_of_a_coding_are_never_taken_without_a_word(tmp_path):
    """Runs along a path: Box & Draper, *Response Surfaces, Mixtures, and Ridge Analyses*, exercise 6.1."""
    runs = [(30.5, 62, 62), (43.25, 53, 65), (34.75, 59, 68), (34.75, 53, 71), (43.25, 59, 68), (39, 56, 72)]
    coded = [((a - 90) / 10, (b - 20) / 10, y) for a, b, y in runs]
    path = write(tmp_path / "coded.csv", "X1,X2,y", coded)
    coding = {"X1": (90.0, 10.0), "X2": (20.0, 10.0)}
    guessed = fit_table(path, ["X1", "X2"], ["y"], coding=coding, terms=["FO"])
    assert "for X1, X2; if the columns hold coded values, say --columns coded" in guessed.notes[0]
    told = fit_table(path, ["X1", "X2"], ["y"], coding=coding, columns="coded", terms=["FO"])
    natural = write(tmp_path / "natural.csv", "X1,X2,y", runs)
    same = fit_table(natural, ["X1", "X2"], ["y"], coding=coding, columns="natural", terms=["FO"])
    assert told.surfaces["y"].coefficients == pytest.approx(same.surfaces["y"].coefficients, rel=1e-9)


def test_runs_on_both_sides_of_zero_are_coded_ones_if_no_natural_one_would_lie_in_the_range(tmp_path):
    rows = [(-2.5, -1.3, 4.0), (7.0, -0.4, 9.1), (0.3, 5.5, 7.2), (3.1, 2.2, 8.0), (-0.7, 0.9, 5.1)]
    path = write(tmp_path / "drawn.csv", "a,b,y", rows)
    coding = {"a": (80.0, 5.0), "b": (0.0, 2.0)}
    guessed = fit_table(path, ["a", "b"], ["y"], coding=coding, terms=["FO"])
    assert "--columns natural" in guessed.notes[0]
    x = np.array([(1, a, b) for a, b, _ in rows], float)
    expected = np.linalg.lstsq(x, np.array([row[2] for row in rows]), rcond=None)[0]
    assert guessed.surfaces["y"].coefficients == pytest.approx(expected)


STAR = [(a, b) for a in (-1, 1) for b in (-1, 1)] + [(0, 0)] * 3
STAR += [(1.41421, 0), (-1.41421, 0), (0, 1.41421), (0, -1.41421)]


def test_a_guess_is_a_note_and_can_be_overruled(tmp_path):
    rows = [(a, b, round(10 + a - 2 * b - a * a + 0.1 * i, 2)) for i, (a, b) in enumerate(STAR)]
    path = write(tmp_path / "star.csv", "a,b,y", rows)
    guessed = fit_table(path, ["a", "b"], ["y"])
    assert "--columns natural" in "".join(guessed.summary().splitlines()[:2])
    assert guessed.space["a"].half_range == 1
    asked = fit_table(path, ["a", "b"], ["y"], columns="natural")
    assert asked.notes == ()
    assert asked.space["a"].half_range == 1.41421
    ratio = asked.surfaces["y"].coefficients / guessed.surfaces["y"].coefficients
    assert ratio == pytest.approx(1.41421 ** np.array([0, 1, 1, 2, 2, 2]))


@pytest.mark.parametrize(
    ("x", "half"),
    [
        ([0, 0.25, 0.5, 0.75, 1], 0.5),  # shares
        ([-1, 0, 3, 7, 10], 5.5),  # degrees below and above zero
        ([-2, -1, 0, 1, 2], 1),  # five levels in coded units
        ([-0.87, -0.5, 0, 0.5, 0.87], 1),  # a hexagon
        ([-10, -5, 0, 5, 10], 10),
        ([3, 4, 5, 6, 7], 2),
    ],
)
def test_columns_that_look_coded(tmp_path, x, half):
    path = write(tmp_path / "x.csv", "x,y", [(value, i * i % 5) for i, value in enumerate(x)])
    assert fit_table(path, ["x"], ["y"], order=1).space["x"].half_range == half


CATEGORIES = """10,a,1,1,5.1
20,a,2,2,6.3
30,a,10,1,8.8
10,b,2,1,4.0
20,b,10,2,7.9
30,b,1,1,6.2
10,c,10,3,6.6
20,c,1,1,4.7
30,c,2,1,9.1
15,a,10,1,7.4
25,b,2,2,7.0
30,c,10,1,11.2
10,a,2,1,4.4
20,c,2,1,6.9
15,b,1,1,4.1
25,a,1,2,6.6"""
MODEL = {"categorical": ["nozzle"], "weights": "w", "terms": ["FO", "x*tool"]}


@pytest.fixture
def categories(tmp_path):
    return write(tmp_path / "c.csv", "x,tool,nozzle,w,y", [row.split(",") for row in CATEGORIES.split("\n")])


def test_sum_contrasts_are_those_of_r(categories):
    """Of u = (x - 20)/10: options(contrasts = "contr.sum"), summary(lm(y ~ u*tool + nozzle, weights = w))."""
    fitted = fit_table(categories, ["x", "tool", "nozzle"], ["y"], contrasts="sum", **MODEL)
    report = fitted.report()["responses"]["y"]
    truth = {
        "1": (6.67396962613945011, 0.160612957384534, 1.23925719003863e-10, np.nan),
        "x": (1.69299046307837697, 0.227303440437906, 7.27730180828303e-05, 0.73647792736417883),
        "tool[a]": (0.03443052009378118, 0.223746216354983, 8.81513783195359e-01, 0.01711380129991298),
        "tool[b]": (-0.44000763900097317, 0.228377857619371, 9.01835536798399e-02, -0.21161211502349975),
        "nozzle[1]": (-1.20254493463257894, 0.242949502189982, 1.12120348503172e-03, -0.57457014812934604),
        "nozzle[2]": (-0.38033235974152613, 0.232038381419268, 1.39826118746156e-01, -0.19554177945519918),
        "x*tool[a]": (-0.52434271209490291, 0.327969939549434, 1.48542978089365e-01, -0.19922937089622303),
        "x*tool[b]": (-0.00779356353399513, 0.343910196465304, 9.82475231886721e-01, -0.00277024748908709),
    }
    assert [term["name"] for term in report["terms"]] == list(truth)
    for term in report["terms"]:
        found = np.array([term[key] for key in ("estimate", "std_error", "p", "standardised")], float)
        np.testing.assert_allclose(found, truth[term["name"]], rtol=1e-9)
    # the same of x: lm(y ~ x*tool + nozzle, weights = w)
    natural = {"1": 3.287988699982694, "x": 0.169299046307838, "tool[a]": 1.083115944283587}
    found = {term["name"]: term["estimate"] for term in report["terms_natural"]}
    assert {name: found[name] for name in natural} == pytest.approx(natural, rel=1e-9)
    assert report["r2"] == pytest.approx(0.928220459018849, rel=1e-12)


def test_contrasts_change_what_is_printed_and_nothing_else(categories):
    factors = ["x", "tool", "nozzle"]
    first, second = (
        fit_table(categories, factors, ["y"], contrasts=contrasts, **MODEL)
        for contrasts in ("treatment", "sum")
    )
    a, b = first.surfaces["y"], second.surfaces["y"]
    assert a.names[2:4] == ("tool[b]", "tool[c]")
    np.testing.assert_allclose(b.fit.fitted, a.fit.fitted, rtol=1e-12)
    np.testing.assert_allclose(b.gradient(a.data.points), a.gradient(a.data.points), rtol=1e-9)
    again = surface_from_json(b.to_json())
    assert again.names == b.names
    assert again.coefficients.tolist() == b.coefficients.tolist()
    rows = [surface.report()["equations"]["by_category"] for surface in (a, b)]
    assert [row["category"] for row in rows[0]] == [
        {"tool": tool, "nozzle": nozzle} for tool in "abc" for nozzle in ("1", "2", "10")
    ]
    spread = np.ptp(a.fit.fitted)
    for one, other in zip(*rows, strict=True):
        assert one["category"] == other["category"]
        for x in (10.0, 22.0):
            expected = a.predict({"x": [x], **{name: [v] for name, v in one["category"].items()}})[0]
            for row in (one, other):
                assert evaluated(row["natural"], x=x) == pytest.approx(expected, abs=WRITTEN * spread)
                assert evaluated(row["coded"], x=(x - 20) / 10) == pytest.approx(
                    expected, abs=WRITTEN * spread
                )
    assert "tool = b, nozzle = 10" in second.summary()
    assert "each level before the last less the average of all (sum contrasts)" in second.summary()
    assert "each level after the first less the first (treatment contrasts)" in first.summary()
    assert [surface.report()["contrasts"] for surface in (a, b)] == ["treatment", "sum"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"categorical": ["nosle"]}, "categorical factors include nosle"),
        ({"categorical": ["x"], "coding": {"x": (20.0, 10.0)}}, "x is categorical, so it has no coding"),
        ({"contrasts": "helmert"}, "contrasts must be treatment or sum"),
        ({"columns": "codet"}, "did you mean 'coded'"),
        ({"categorical": ["w"]}, "column w holds '1' only"),
    ],
)
def test_wrong_categories_and_units_are_refused(tmp_path, change, message):
    path = write(tmp_path / "c.csv", "x,w,y", [(i, 1, i * i) for i in range(6)])
    with pytest.raises(RsmkitError, match=message):
        fit_table(path, ["x", "w"], ["y"], terms=["x"], **change)


def test_bounds_are_the_ends_of_the_runs_without_a_constant_too(tmp_path):
    rows = [(4, 2), (7, 4), (10, 18), (15, 26), (20, 32), (25, 85)]
    fitted = fit_table(
        write(tmp_path / "cars.csv", "speed,y", rows), ["speed"], ["y"], terms=["0", "speed^2"]
    )
    found = fitted.report()["responses"]["y"]
    assert found["optimum"]["bounds"] == {"speed": [4, 25]}
    assert found["optimum"]["minimum"]["natural"]["speed"] >= 4
    x = np.array(rows, float)
    expected = np.linalg.lstsq(np.column_stack([x[:, 0], x[:, 0] ** 2]), x[:, 1], rcond=None)[0]
    assert [term["estimate"] for term in found["terms"]] == pytest.approx(expected)
    assert found["r2"] == pytest.approx(1 - found["anova"]["residual"]["ss"] / (x[:, 1] ** 2).sum())


def test_sums_of_squares_of_a_mixture_are_about_the_mean(tmp_path):
    shares = [p for p in itertools.product([0, 0.25, 0.5, 0.75, 1], repeat=3) if sum(p) == 1]
    rows = [
        (*p, round(3 * p[0] + 5 * p[1] + 9 * p[2] + 8 * p[0] * p[1] + 0.1 * (i % 4), 3))
        for i, p in enumerate(shares)
    ]
    report = fit_table(
        write(tmp_path / "mix.csv", "a,b,c,y", rows), ["a", "b", "c"], ["y"], terms=["0", "FO", "TWI"]
    ).report()["responses"]["y"]
    x, y = np.array(rows)[:, :3], np.array(rows)[:, 3]
    products = [x[:, i] * x[:, j] for i, j in ((0, 1), (0, 2), (1, 2))]

    def left(*columns):
        basis = np.column_stack(columns)
        return float(((y - basis @ np.linalg.lstsq(basis, y, rcond=None)[0]) ** 2).sum())

    total, linear, full = ((y - y.mean()) ** 2).sum(), left(*x.T), left(*x.T, *products)
    assert report["r2"] == pytest.approx(1 - full / total)
    assert report["r2_adjusted"] == pytest.approx(1 - (full / 9) / (total / 14))
    table = {row["source"]: (row["df"], row["ss"]) for row in report["anova_table"]}
    expected = {
        "model": (5, total - full),
        "FO": (2, total - linear),
        "TWI": (3, linear - full),
        "residual": (9, full),
        "total": (14, total),
    }
    assert set(table) == set(expected)
    for source, values in expected.items():
        assert table[source] == pytest.approx(values, abs=1e-9)
    assert report["model_test"]["df"] == [5, 9]
    assert report["model_test"]["F"] == pytest.approx((total - full) / 5 / (full / 9))


def test_the_regression_and_the_total_stand_around_the_groups(cube):
    report = fit_table(cube, ["T", "p", "v"], ["y"]).report()["responses"]["y"]
    table = {row.pop("source"): row for row in report["anova_table"]}
    assert list(table) == ["model", "FO", "TWI", "PQ", "residual", "total"]
    assert {source: row for source, row in table.items() if source in report["anova"]} == report["anova"]
    y = np.loadtxt(cube, delimiter=",", skiprows=1)[:, 3]
    assert table["total"]["ss"] == pytest.approx(((y - y.mean()) ** 2).sum())
    assert table["model"]["ss"] == pytest.approx(table["total"]["ss"] - table["residual"]["ss"])
    assert (table["model"]["df"], table["total"]["df"]) == (9, 26)
    assert table["model"]["F"] == report["model_test"]["F"]


def test_the_text_of_a_wide_table_is_short_and_details_are_there_on_request(tmp_path):
    rng = np.random.default_rng(5)
    x = rng.uniform(10, 20, (80, 10))
    y = 5 * x[:, 2] - 0.3 * x[:, 0] * x[:, 7] + rng.normal(0, 0.5, 80)
    names = [f"factor_{i}" for i in range(10)]
    path = write(tmp_path / "wide.csv", ",".join([*names, "y"]), np.column_stack([x, y]).round(4).tolist())
    fitted = fit_table(path, names, ["y"])
    short, whole = fitted.summary(), fitted.summary(details=True)
    assert "66 coefficients" in short
    assert len(short.splitlines()) < 80
    assert max(map(len, short.splitlines())) < 200
    assert "... and 45 more with |t| of at most " in short
    listed = [line.split()[0] for line in short.splitlines() if line.startswith("factor_")]
    by_size = sorted(fitted.report()["responses"]["y"]["terms"][1:], key=lambda term: -abs(term["t"]))
    assert set(listed) == {term["name"] for term in by_size[:20]}
    for name in fitted.surfaces["y"].names:
        assert f"\n{name} " in whole
    assert "natural: y = " in whole
    assert "factor_9*" not in "".join(line for line in short.splitlines() if "natural" in line)
    assert len([line for line in whole.splitlines() if line.startswith("eigenvalue ")]) == 1
    words = [line for line in short.splitlines() if " = " in line or ")/" in line]
    broken = [line for line in words if line.endswith((" =", " -", "("))]
    assert len(words) > 6
    assert broken == []


def test_a_natural_equation_that_cannot_be_evaluated_is_called_so(tmp_path):
    x = 1e6 + np.array([0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0])
    rows = list(zip(x.tolist(), [1.0, 1.4, 1.1, 0.7, 0.4, 0.9, 2.2], strict=True))
    path = write(tmp_path / "far.csv", "x,y", rows)
    for order, useless in ((1, False), (3, True)):
        fitted = fit_table(path, ["x"], ["y"], order=order)
        found = fitted.surfaces["y"].report()["equations"]
        assert ("note" in found) == useless
        assert ("use the coded" in fitted.summary()) == useless
        middle = fitted.surfaces["y"].predict([[1e6 + 1.2]])[0]
        assert evaluated(found["coded"], x=(1.2 - 1.5) / 1.5) == pytest.approx(middle, abs=2 * WRITTEN)
