"""Surfaces straight from a CSV file of finished runs."""

import json

import numpy as np
import pytest

from rsmkit.errors import RsmkitError
from rsmkit.surfaces.estimation.fit_data import cells
from rsmkit.surfaces.tables.coding import parse_coding
from rsmkit.surfaces.tables.table_fit import fit_table

CODED = [(-1, -1), (1, -1), (-1, 1), (1, 1), (0, 0), (0, 0), (0, 0), (1.4, 0), (-1.4, 0), (0, 1.4), (0, -1.4)]
Y = [76.5, 78.0, 77.0, 79.5, 79.9, 80.3, 80.0, 78.4, 75.6, 78.5, 77.0]


def write(path, rows, head="time,temp,y,batch,w", separator=","):
    lines = [head.replace(",", separator), *(separator.join(map(str, row)) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.fixture
def natural(tmp_path):
    rows = [
        (85 + 5 * a, 175 + 5 * b, y, "AB"[i % 2], 1 + i % 3)
        for i, ((a, b), y) in enumerate(zip(CODED, Y, strict=True))
    ]
    return write(tmp_path / "natural.csv", rows)


def test_coding_gives_the_same_coefficients_as_a_table_in_coded_units(natural, tmp_path):
    coded = write(tmp_path / "coded.csv", [(a, b, y, "A", 1) for (a, b), y in zip(CODED, Y, strict=True)])
    coding = parse_coding("time=85:5, temp=175:5")
    first = fit_table(natural, ["time", "temp"], ["y"], coding=coding).surfaces["y"]
    second = fit_table(coded, ["time", "temp"], ["y"]).surfaces["y"]
    np.testing.assert_allclose(first.coefficients, second.coefficients, rtol=1e-11)
    third = fit_table(coded, ["time", "temp"], ["y"], coding=coding, columns="coded").surfaces["y"]
    assert third.report()["stationary_point"]["natural"] == pytest.approx(
        first.report()["stationary_point"]["natural"], rel=1e-10
    )
    x = np.column_stack([np.ones(11), np.array(CODED), np.prod(CODED, axis=1), np.array(CODED) ** 2])
    np.testing.assert_allclose(
        second.coefficients, np.linalg.lstsq(x, np.array(Y), rcond=None)[0], rtol=1e-11
    )


def test_without_coding_a_column_is_coded_by_its_range_and_told_in_its_own_units(natural):
    report = fit_table(natural, ["time", "temp"], ["y"], order=1).report()["responses"]["y"]
    columns = 5 * np.array(CODED)
    for center, half, key in (((0, 0), 7.0, "terms"), ((-85, -175), 1.0, "terms_natural")):
        x = np.column_stack([np.ones(11), (columns - np.array(center)) / half])
        peer, rest, *_ = np.linalg.lstsq(x, np.array(Y), rcond=None)
        errors = np.sqrt(rest[0] / 8 * np.diag(np.linalg.inv(x.T @ x)))
        np.testing.assert_allclose([term["estimate"] for term in report[key]], peer, rtol=1e-10)
        np.testing.assert_allclose([term["std_error"] for term in report[key]], errors, rtol=1e-10)
    assert report["coding"] == {
        "time": {"center": 85, "half_range": 7},
        "temp": {"center": 175, "half_range": 7},
    }


def test_blocks_weights_and_the_report(natural):
    fitted = fit_table(
        natural, ["time", "temp"], ["y"], coding=parse_coding("time=85:5,temp=175:5"), blocks="batch"
    )
    report = json.loads(json.dumps(fitted.report(), allow_nan=False))["responses"]["y"]
    assert [term["name"] for term in report["terms"]][:2] == ["1", "block[B]"]
    assert report["anova"]["block"]["df"] == 1
    assert "block[B]" in fitted.summary()
    weighted = fit_table(natural, ["time", "temp"], ["y"], weights="w", order=1).surfaces["y"]
    assert weighted.data.weights is not None
    assert weighted.data.weights[:4].tolist() == [1, 2, 3, 1]


def test_chosen_terms_and_no_constant(natural):
    request = (natural, ["time", "temp"], ["y"])
    assert fit_table(*request, terms=["FO", "temp^2"]).surfaces["y"].names == ("1", "time", "temp", "temp^2")
    through_origin = fit_table(*request, terms=["0", "FO"]).surfaces["y"]
    x = np.column_stack([85 + 5 * np.array(CODED)[:, 0], 175 + 5 * np.array(CODED)[:, 1]])
    np.testing.assert_allclose(
        through_origin.coefficients, np.linalg.lstsq(x, np.array(Y), rcond=None)[0], rtol=1e-10
    )
    with pytest.raises(RsmkitError, match="neither a group"):
        fit_table(*request, terms=["FO", "tempo^2"])


def test_text_columns_are_categorical_and_empty_responses_are_left_out(tmp_path):
    rows = [
        (x, kind, y)
        for x, kind, y in zip([0, 1, 2, 0, 1, 2, 3], "aaabbba", [1, 2, 3.5, 4, 5, 7, ""], strict=True)
    ]
    path = write(tmp_path / "mixed.csv", rows, "x;kind;y".replace(";", ","), ";")
    fitted = fit_table(path, ["x", "kind"], ["y"], order=1)
    assert fitted.surfaces["y"].names == ("1", "x", "kind[b]")
    assert fitted.report()["responses"]["y"]["rows_without_value"] == 1
    assert fitted.surfaces["y"].fit.n == 6


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"factors": ["tima", "temp"]}, "no column tima; did you mean time"),
        ({"responses": ["z"]}, "its columns are time, temp, y, batch, w"),
        ({"factors": []}, "at least one factor"),
        ({"factors": ["time", "time"]}, "column time is named twice"),
        ({"factors": ["time", "y"]}, "column y is named twice"),
        ({"responses": ["y", "y"]}, "column y is named twice"),
        ({"blocks": "temp"}, "column temp is named twice"),
        ({"factors": ["TIME", "temp"]}, "no column TIME; did you mean time"),
        ({"coding": {"z": (0, 1)}}, "coding names z"),
        ({"factors": ["time", "batch"], "coding": {"batch": (0, 1)}}, "holds texts"),
        ({"responses": ["batch"]}, "column batch, line 2: 'A' is not a finite number"),
        ({"weights": "batch"}, "column batch, line 2"),
        ({"factors": ["time"], "order": 20, "terms": ["time^30"]}, "at most 20"),
    ],
)
def test_wrong_requests_are_refused(natural, change, message):
    request = {"factors": ["time", "temp"], "responses": ["y"], **change}
    with pytest.raises(RsmkitError, match=message):
        fit_table(natural, request.pop("factors"), request.pop("responses"), **request)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"x,y\n", "at least one run"),
        (b"x,y,x\n1,2,3\n", "two columns are named x"),
        (b"x,y\n\n1,2\n1\n", "line 4 has 1 values"),
        (b"x,y\n1,\x81\n", "not UTF-8"),
        (b"x,y\n1,NA\n2,\n", "no row has a value of y, x"),
        (b"x,y\n1,1\nx,2\n", "column x, line 3: 'x' is not"),
        (b"x,y\n,1\nNA,2\n", "no row has a value of y, x"),
        (b"x,y\nred,1\nred,2\n", "holds 'red' only"),
        (b'x,y\n"1,5",1\n2,2\n', "thousands or decimals"),
        (b"x,y\n1_0,1\n2,2\n", "line 2: '1_0' is not"),
    ],
)
def test_unreadable_files_are_refused(tmp_path, content, message):
    path = tmp_path / "runs.csv"
    path.write_bytes(content)
    with pytest.raises(RsmkitError, match=message):
        fit_table(path, ["x"], ["y"])
    with pytest.raises(RsmkitError, match="cannot be read"):
        fit_table(tmp_path / "none.csv", ["x"], ["y"])


@pytest.mark.parametrize("text", ["x1", "x1=85", "x1=85:0", "x1=a:1", "x1=85:-1", "x1=nan:1"])
def test_wrong_coding_is_refused(text):
    with pytest.raises(RsmkitError, match="coding 'x1"):
        parse_coding(text)


def test_column_names_are_kept_as_they_are(tmp_path):
    path = write(tmp_path / "named.csv", [(i, i * i) for i in range(6)], '"Temp (C)",feed.rate')
    fitted = fit_table(path, ["Temp (C)"], ["feed.rate"])
    assert fitted.surfaces["feed.rate"].names == ("1", "Temp (C)", "Temp (C)^2")
    report = fitted.report()["responses"]["feed.rate"]
    assert list(report["stationary_point"]["natural"]) == ["Temp (C)"]


X = [-1.0, -0.5, 0.25, 0.5, 1.0, 1.5]
PLAIN = "x,y,b\n" + "".join(f"{x},{2 + x + 0.5 * x * x:.6f},g{i % 2}\n" for i, x in enumerate(X))


@pytest.mark.parametrize(
    "content",
    [
        PLAIN.encode("utf-8-sig"),
        PLAIN.encode("utf-16"),
        PLAIN.replace("\n", "\r\n").encode(),
        PLAIN.replace("\n", "\r").encode(),
        PLAIN.replace(",", "\t").encode(),
        PLAIN.replace(",", ";").replace(".", ",").encode(),
        PLAIN.replace(",", "   ").encode(),
        PLAIN.replace(",", ", ").replace("x,", " x ,", 1).encode(),
        PLAIN.replace("-1", "\u22121").replace("-0", "\u20130").encode(),
        ("# made by hand, in May\n\n" + PLAIN.replace("\n", "\n\n") + "# end\n").encode(),
        PLAIN.replace("x,y,b", '"x","y","b"').replace("g0", '"g, 0"').replace("g1", '"g, 1"').encode(),
        PLAIN.replace("\n", ",\n").encode(),
        "".join(f"{i or ''}{',' * bool(i)}{row}\n" for i, row in enumerate(PLAIN.splitlines())).encode(),
        (PLAIN + "2,,g0\n3,NA,g1\n,.,\n").encode(),
    ],
    ids=[
        "BOM", "UTF-16", "CRLF", "CR", "tabs", "decimal commas", "blanks", "padded", "minus signs",
        "comments", "quoted", "trailing commas", "row names", "missing responses",
    ],
)  # fmt: skip
def test_ways_to_write_the_same_table(tmp_path, content):
    path = tmp_path / "runs.csv"
    path.write_bytes(content)
    surface = fit_table(path, ["x"], ["y"], blocks="b", columns="coded").surfaces["y"]
    assert surface.fit.n == 6
    assert surface.data.block_names in (("g0", "g1"), ("g, 0", "g, 1"))
    np.testing.assert_allclose(surface.coefficients, [2, 0, 1, 0.5], atol=1e-6)


def test_runs_of_weight_zero_count_for_nothing(natural, tmp_path):
    rows = [(85 + 5 * a, 175 + 5 * b, y, "A", 2) for (a, b), y in zip(CODED, Y, strict=True)]
    more = write(tmp_path / "more.csv", [*rows, (80, 180, 500, "A", 0)])
    first = fit_table(natural, ["time", "temp"], ["y"]).surfaces["y"]
    second = fit_table(more, ["time", "temp"], ["y"], weights="w").surfaces["y"]
    np.testing.assert_allclose(second.coefficients, first.coefficients, rtol=1e-9)
    assert second.fit.df == first.fit.df
    bad = write(tmp_path / "bad.csv", [*rows, (80, 180, 5, "A", -1)])
    with pytest.raises(RsmkitError, match=r"line 13: a weight of -1 is negative"):
        fit_table(bad, ["time", "temp"], ["y"], weights="w")


def test_terms_that_cannot_be_estimated_are_named_with_what_can_be(tmp_path):
    corners = [(a, b, a + 2 * b + a * b + c) for a in (-1, 1) for b in (-1, 1) for c in (0, 0.5)]
    path = write(tmp_path / "corners.csv", corners, "speed,feed,y")
    with pytest.raises(RsmkitError, match=r"speed\^2 \(same as 1\).*can estimate --terms FO,TWI"):
        fit_table(path, ["speed", "feed"], ["y"])
    assert fit_table(path, ["speed", "feed"], ["y"], terms=["FO", "TWI"]).surfaces["y"].fit.df == 4
    single = write(tmp_path / "single.csv", corners[::2][:3], "speed,feed,y")
    with pytest.raises(RsmkitError, match=r"can estimate --terms FO$"):
        fit_table(single, ["speed", "feed"], ["y"], terms=["FO", "TWI"])
    levels = [(a, b, a + a * b + b * b) for a in (0, 1, 2) for b in (3, 5, 9)]
    with pytest.raises(RsmkitError, match=r"can estimate --terms SO$"):
        fit_table(write(tmp_path / "nine.csv", levels, "a,b,y"), ["a", "b"], ["y"], order=3)
    shares = [(a / 4, b / 4, 1 - (a + b) / 4, a * b) for a in range(5) for b in range(5 - a)]
    with pytest.raises(RsmkitError, match=r"can estimate --terms 0,FO,TWI$"):
        fit_table(write(tmp_path / "mixture.csv", shares, "a,b,c,y"), ["a", "b", "c"], ["y"])


@pytest.mark.parametrize(
    ("rows", "order"),
    [
        ([(x, 3.0) for x in range(6)], 2),
        ([(x, 1 + 2 * x + x * x) for x in range(6)], 2),
        ([(x, y) for x, y in enumerate([1, 4, 2])], 2),
        ([(0, 1), (0, 2), (1, 4), (1, 5)], 1),
    ],
    ids=["constant response", "exact fit", "no degrees of freedom left", "as many points as terms"],
)
def test_reports_of_degenerate_fits_are_json(tmp_path, rows, order):
    fitted = fit_table(write(tmp_path / "rows.csv", rows, "x,y"), ["x"], ["y"], order=order)
    text = json.dumps(fitted.report(), allow_nan=False)
    report = json.loads(text)["responses"]["y"]
    assert {"reason"} == set(report["lack_of_fit"])
    assert fitted.summary()
    if len(rows) == 3:
        assert report["sigma"] is None
        assert report["r2_adjusted"] is None
        assert {term["p"] for term in report["terms"]} == {None}
    if rows[0] == rows[1]:
        assert report["r2"] is None


def test_ten_factors_and_several_responses(tmp_path):
    rng = np.random.default_rng(0)
    points = rng.integers(-1, 2, (120, 10)).astype(float)
    y = points @ np.arange(10.0) + points[:, 3] ** 2 + rng.normal(size=120)
    names = [f"x{j}" for j in range(10)]
    path = write(
        tmp_path / "ten.csv", np.column_stack([points, y, -y]).tolist(), ",".join([*names, "y", "z"])
    )
    responses = fit_table(path, names, ["y", "z"]).report()["responses"]
    assert [len(responses[name]["terms"]) for name in "yz"] == [66, 66]
    assert responses["z"]["eigenvalues"] == pytest.approx([-v for v in responses["y"]["eigenvalues"]][::-1])


def test_the_optimum_between_the_bounds_is_the_best_of_a_fine_grid(natural):
    request = (natural, ["time", "temp"], ["y"])
    whole = np.array([85.0, 175.0]) + 5.0 * np.array(CODED)
    for coding, low, high in (
        ({"time": (85.0, 5.0), "temp": (175.0, 5.0)}, [80, 170], [90, 180]),
        ({"time": (85.0, 5.0)}, [80, whole[:, 1].min()], [90, whole[:, 1].max()]),
    ):
        fitted = fit_table(*request, coding=coding)
        found = fitted.report()["responses"]["y"]["optimum"]
        assert list(found["bounds"].values()) == [pytest.approx(end) for end in zip(low, high, strict=True)]
        axes = [np.linspace(a, b, 401) for a, b in zip(low, high, strict=True)]
        grid = np.column_stack([axis.ravel() for axis in np.meshgrid(*axes)])
        values = fitted.surfaces["y"].predict(grid)
        for goal, at in (("maximum", values.argmax()), ("minimum", values.argmin())):
            assert found[goal]["predicted"] == pytest.approx(values[at], abs=1e-4)
            assert list(found[goal]["natural"].values()) == pytest.approx(grid[at], abs=0.05)
        assert "Maximum between the bounds: time = " in fitted.summary()


def test_intervals_at_the_runs(natural):
    import statsmodels.api as sm

    report = fit_table(natural, ["time", "temp"], ["y"], order=1).report()["responses"]["y"]
    x = np.column_stack([np.ones(11), 85 + 5 * np.array(CODED)[:, 0], 175 + 5 * np.array(CODED)[:, 1]])
    peer = sm.OLS(np.array(Y), x).fit().get_prediction(x).summary_frame(alpha=0.05)
    found = report["intervals"]
    assert found["confidence"] == 0.95
    for name, prefix in (("mean", "mean_ci"), ("prediction", "obs_ci")):
        for side, suffix in (("low", "lower"), ("high", "upper")):
            np.testing.assert_allclose(found[name][side], peer[f"{prefix}_{suffix}"], rtol=1e-9)
    widths = {name: np.subtract(found[name]["high"], found[name]["low"]) for name in ("mean", "simultaneous")}
    scheffe = np.sqrt(3 * 4.066180551) / 2.306004135  # F(3, 8) and t(8) at 95 %, from tables
    np.testing.assert_allclose(widths["simultaneous"] / widths["mean"], scheffe, rtol=1e-8)


def test_categories_alone_have_their_best_cell(tmp_path):
    cells = {("a", "u"): 3.0, ("a", "v"): 5.0, ("b", "u"): 9.0, ("b", "v"): 4.0}
    rows = [(p, q, y + e) for (p, q), y in cells.items() for e in (-0.5, 0.5)]
    fitted = fit_table(write(tmp_path / "cells.csv", rows, "p,q,y"), ["p", "q"], ["y"])
    found = fitted.report()["responses"]["y"]["optimum"]
    assert found["bounds"] == {"p": ["a", "b"], "q": ["u", "v"]}
    assert found["maximum"] == {"natural": {"p": "b", "q": "u"}, "predicted": pytest.approx(9.0)}
    assert found["minimum"] == {"natural": {"p": "a", "q": "u"}, "predicted": pytest.approx(3.0)}


@pytest.mark.parametrize("column", [0, 1, 2])
@pytest.mark.parametrize(("value", "unit"), [("-1e200", "larger"), ("3e-300", "smaller")])
def test_numbers_that_cannot_be_squared_are_refused(tmp_path, column, value, unit):
    rows = [[i + 1, i * i + 1, 1] for i in range(6)]
    rows[3][column] = value
    path = write(tmp_path / "extreme.csv", rows, "x,y,w")
    with pytest.raises(RsmkitError, match=f"line 5: {value} is too .* take a {unit} unit"):
        fit_table(path, ["x"], ["y"], weights="w")


ODOR = {"T": (80.0, 40.0), "R": (0.5, 0.2), "H": (4.0, 2.0)}
WIDE = {"T": (0.0, 100.0), "R": (0.0, 1.0), "H": (0.5, 0.5)}


@pytest.mark.parametrize("coding", [ODOR, WIDE], ids=["odor", "wide"])
@pytest.mark.parametrize("reach", [1.0, 1.682, 2.0])
@pytest.mark.parametrize("hold", ["natural values", "coded values"])
def test_tables_in_coded_units_are_read_as_they_are_asked_to_be(tmp_path, coding, reach, hold):
    star = reach * np.vstack([np.eye(3), -np.eye(3)])
    corners = np.array([[a, b, c] for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)], float)
    coded = np.vstack([corners, star, np.zeros((2, 3))])
    y = coded @ [1.0, -2.0, 0.5] + (coded**2) @ [3.0, 2.0, 1.0]
    center, half = np.array(list(coding.values())).T
    points = center + half * coded if hold == "natural values" else coded
    path = write(tmp_path / "runs.csv", np.column_stack([points, y]).tolist(), "T,R,H,y")
    fitted = fit_table(path, list(coding), ["y"], coding=coding, columns=hold.split()[0])
    assert fitted.report()["columns_hold"] == hold
    assert fitted.notes == ()
    guessed = fit_table(path, list(coding), ["y"], coding=coding)
    # runs about zero are not about the centre of T (80 +- 40), nor of the H that goes from 0 to 1
    assert guessed.report()["columns_hold"] == hold
    assert bool(guessed.notes) == (hold == "coded values")
    assert ("hold coded values" in guessed.summary()) == (hold == "coded values")
    assert all(note[:40] in guessed.summary() for note in guessed.notes)
    found = dict(zip(fitted.surfaces["y"].names, fitted.surfaces["y"].coefficients, strict=True))
    expected = {"1": 0, "T": 1, "R": -2, "H": 0.5, "T^2": 3, "R^2": 2, "H^2": 1, "T*R": 0, "T*H": 0, "R*H": 0}
    assert found == pytest.approx(expected, abs=1e-9)
    natural = list(fitted.report()["responses"]["y"]["stationary_point"]["natural"].values())
    assert natural == pytest.approx(center + half * np.array([-1 / 6, 0.5, -0.25]))


def test_rows_that_lack_any_value_in_use_are_left_out_and_counted(natural, tmp_path):
    lines = natural.read_text().splitlines()
    gaps = ["NA,175,78,A,1", "85,,78,A,1", "85,175,NA,A,1", "85,175,78,,1", "85,175,78,A,.", "85,175,78,A,0"]
    path = tmp_path / "gaps.csv"
    path.write_text("\n".join([*lines[:4], *gaps, *lines[4:]]))
    request = (["time", "temp"], ["y"])
    chosen = {"blocks": "batch", "weights": "w", "order": 1}
    whole, gappy = fit_table(natural, *request, **chosen), fit_table(path, *request, **chosen)
    assert gappy.surfaces["y"].report() == whole.surfaces["y"].report()
    assert gappy.report()["responses"]["y"]["rows_without_value"] == 6
    reasons = ["no time", "no temp", "no y", "no batch", "no w", "weight 0"]
    named = ", ".join(f"{line} ({reason})" for line, reason in enumerate(reasons, start=4))
    assert " ".join(gappy.summary().split()).endswith(
        f"Rows left out, counted from 1 below the line of names: {named}"
    )
    left_out = gappy.report()["responses"]["y"]["rows_left_out"]
    assert left_out == [{"row": line, "reason": reason} for line, reason in enumerate(reasons, start=4)]
    assert gappy.report()["responses"]["y"]["rows"] == [1, 2, 3, *range(10, 18)]


def test_words_for_missing_numbers_may_be_categories(tmp_path):
    kinds = ["none", "null", ".", "Na", "none", "null", ".", "Na", "NA", ""]
    rows = [(kind, i, i * i % 7) for i, kind in enumerate(kinds)]
    surface = fit_table(write(tmp_path / "k.csv", rows, "kind,x,y"), ["kind", "x"], ["y"], order=1).surfaces[
        "y"
    ]
    assert surface.space.factors[0].levels == (".", "Na", "none", "null")
    assert surface.fit.n == 8


def test_blocks_that_are_the_same_number_are_the_same_block(tmp_path):
    labels = ["1", "2.0", "1.0", "10", "01", "10", "2", "1"]
    rows = [(i, i * i % 7, label) for i, label in enumerate(labels)]
    fitted = fit_table(write(tmp_path / "b.csv", rows, "x,y,b"), ["x"], ["y"], order=1, blocks="b")
    assert fitted.surfaces["y"].names == ("1", "block[2]", "block[10]", "x")


@pytest.mark.parametrize(
    ("head", "factors"),
    [
        ("#,Time,y", ["Time"]),
        ("# run, Time, y", ["Time"]),
        ('run,"Time\n(min)",y', ["Time (min)"]),
        ("sep=,\nrun,Time,y", ["Time"]),
        ('run,"Time, min",y', ["Time, min"]),
    ],
    ids=["number sign", "numpy", "line break", "spreadsheet", "comma"],
)
def test_unusual_heads_of_tables(tmp_path, head, factors):
    path = tmp_path / "runs.csv"
    path.write_text(head + "".join(f"\n{i},{i / 4},{3 - i}" for i in range(8)))
    report = fit_table(path, factors, ["y"], order=1).report()["responses"]["y"]
    assert [term["estimate"] for term in report["terms_natural"]] == pytest.approx([3, -4])


def test_names_with_signs_of_formulas(tmp_path):
    rows = [(a, b, 1 + a - b + a * a) for a in (-1, 0, 1) for b in (-1, 0, 2)]
    path = write(tmp_path / "signs.csv", rows, "a*b,a,y")
    surface = fit_table(path, ["a*b", "a"], ["y"], terms=["FO", "a*b^2", "a*b*a"]).surfaces["y"]
    assert surface.names == ("1", "a*b", "a", "a*b*a", "a*b^2")
    assert parse_coding('"flow, l=1"=4:2, b=1:1') == {"flow, l=1": (4, 2), "b": (1, 1)}
    with pytest.raises(RsmkitError, match="b has a coding already"):
        parse_coding("b=1:1,b=2:1")


@pytest.mark.parametrize("scale", [1e-10, 1e-7, 1e-3, 1.0, 1e7, 1e12])
def test_units_of_a_factor_change_nothing_but_its_units(tmp_path, scale):
    """Values that differ by rounding (0.1 + 0.2 and 0.3) are repetitions in any unit."""
    x = np.array([0.1 + 0.2, 0.3, 0.6, 0.3 * 2, 0.7, 0.1 * 7, 0.9, 0.1, 0.45])
    z = np.array([0.1, 0.1, 0.5, 0.5, 0.7, 0.7, 0.2, 0.9, 0.8])
    y = 3 + x - 2 * z + np.array([0.3, -0.1, 0.2, 0.1, -0.4, 0.05, 0.0, 0.3, -0.2])
    plain = write(tmp_path / "plain.csv", zip(x.tolist(), z.tolist(), y.tolist(), strict=True), "x,z,y")
    other = write(
        tmp_path / "other.csv", zip((x * scale).tolist(), z.tolist(), y.tolist(), strict=True), "x,z,y"
    )
    first, second = (
        fit_table(path, ["x", "z"], ["y"], terms=["FO", "x^2", "z^2"]).surfaces["y"].report()
        for path in (plain, other)
    )
    power = np.array([1.0, scale, 1.0, scale**2, 1.0])
    for key in ("estimate", "std_error"):
        for units, ratio in (("terms_natural", power), ("terms", np.ones(5))):
            found = np.array([term[key] for term in second[units]])
            np.testing.assert_allclose(found * ratio, [term[key] for term in first[units]], rtol=1e-9)
    assert first["lack_of_fit"]["df"] == second["lack_of_fit"]["df"] == [1, 3]
    assert second["lack_of_fit"]["F"] == pytest.approx(first["lack_of_fit"]["F"], rel=1e-9)
    natural = (report["stationary_point"]["natural"] for report in (first, second))
    ratio = np.divide(*(list(values.values()) for values in natural))
    np.testing.assert_allclose(ratio, [1 / scale, 1.0], rtol=1e-9)


def test_points_that_differ_by_more_than_rounding_are_no_repetitions():
    x = np.array([0.1 + 0.2, 0.3, 0.3 + 1e-9, 0.7, 0.7 * (1 + 1e-6), 1.0])
    assert cells(x[:, None]).tolist() == [0, 0, 1, 2, 3, 4]
    assert cells(np.column_stack([x, x[::-1]])).max() == len(x) - 1


def test_pure_error_is_shown_where_no_lack_of_fit_can_be_seen(tmp_path):
    rows = [(x, y) for x, y in zip([0, 0, 1, 1, 1], [1, 2, 4, 5, 9], strict=True)]
    report = fit_table(write(tmp_path / "two.csv", rows, "x,y"), ["x"], ["y"], order=1).report()
    found = report["responses"]["y"]
    assert found["anova"]["pure error"] == {
        "df": 3,
        "ss": pytest.approx(14.5),
        "ms": pytest.approx(14.5 / 3),
        "F": None,
        "p": None,
    }
    assert found["anova"]["lack of fit"] == {"df": 0, "ss": 0.0, "ms": None, "F": None, "p": None}
    assert "as many terms" in found["lack_of_fit"]["reason"]


def test_residuals_of_rounding_are_called_so(tmp_path):
    exact = write(tmp_path / "exact.csv", [(i / 10, 0.1 + 0.7 * i) for i in range(9)], "x,y")
    report = fit_table(exact, ["x"], ["y"], order=1).report()["responses"]["y"]
    assert "rounding errors" in report["note"]
    constant = write(tmp_path / "constant.csv", [(i, 3.3) for i in range(9)], "x,y")
    report = fit_table(constant, ["x"], ["y"]).report()["responses"]["y"]
    assert "rounding errors" in report["note"]
    assert "flat" in report["stationary_point"]["reason"]


def test_text_says_what_a_statistician_looks_for(natural):
    coding = {"time": (85.0, 5.0), "temp": (175.0, 5.0)}
    fitted = fit_table(natural, ["time", "temp"], ["y"], coding=coding)
    text, report = fitted.summary(), fitted.report()["responses"]["y"]
    assert "coded units: (time - 85)/5, (temp - 175)/5" in text
    point = report["stationary_point"]["coded"]
    assert f"in coded units: time = {point['time']:.5g}, temp = {point['temp']:.5g}" in text
    for row in np.array(report["eigenvectors"]).T:
        assert "  ".join(f"{x:.5g}" for x in row) in " ".join(text.split()).replace(" ", "  ")
    line = fit_table(natural, ["time", "temp"], ["y"], coding=coding, order=1)
    b = line.surfaces["y"].coefficients[1:] / np.hypot(*line.surfaces["y"].coefficients[1:])
    assert (
        f"Steepest ascent by one coded unit: time = {b[0]:.5g}, temp = {b[1]:.5g} coded; "
        f"time = {5 * b[0]:.5g}, temp = {5 * b[1]:.5g} natural"
    ) in line.summary()
