"""Surfaces straight from a CSV file of finished runs."""

import json

import numpy as np
import pytest

from rsmkit.errors import RsmkitError
from rsmkit.surfaces.table import fit_table, parse_coding

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
    third = fit_table(coded, ["time", "temp"], ["y"], coding=coding).surfaces["y"]
    assert third.report()["stationary_point"]["natural"] == pytest.approx(
        first.report()["stationary_point"]["natural"], rel=1e-10
    )
    x = np.column_stack([np.ones(11), np.array(CODED), np.prod(CODED, axis=1), np.array(CODED) ** 2])
    np.testing.assert_allclose(
        second.coefficients, np.linalg.lstsq(x, np.array(Y), rcond=None)[0], rtol=1e-11
    )


def test_without_coding_coefficients_belong_to_the_columns_as_they_are(natural):
    surface = fit_table(natural, ["time", "temp"], ["y"], order=1).surfaces["y"]
    x = np.column_stack([np.ones(11), 85 + 5 * np.array(CODED)[:, 0], 175 + 5 * np.array(CODED)[:, 1]])
    np.testing.assert_allclose(
        surface.coefficients, np.linalg.lstsq(x, np.array(Y), rcond=None)[0], rtol=1e-10
    )


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
        ({"factors": ["time", "time"]}, "named twice"),
        ({"coding": {"z": (0, 1)}}, "coding names z"),
        ({"factors": ["time", "batch"], "coding": {"batch": (0, 1)}}, "holds texts"),
        ({"responses": ["batch"]}, "column batch, row 2: 'A' is not a finite number"),
        ({"weights": "batch"}, "column batch, row 2"),
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
        (b"x,x\n1,2\n", "same name"),
        (b"x,y\n1,2\n1\n", "row 3 has 1 values"),
        (b"x,y\n1,\xff\xfe\n", "not UTF-8"),
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


def test_column_names_become_identifiers(tmp_path):
    path = write(tmp_path / "named.csv", [(i, i * i) for i in range(6)], "Temp (C),y")
    fitted = fit_table(path, ["Temp (C)"], ["y"])
    assert fitted.surfaces["y"].names == ("1", "Temp__C_", "Temp__C_^2")
    assert fitted.space.factors[0].label == "Temp (C)"
