"""A run's key and its line in the journal."""

import hashlib
import json
import math

import pytest

from rsmkit.runs.record.run import Run, run_from_json, run_key, run_to_json


def make(**changes):
    fields = {
        "key": "0123456789abcdef",
        "simulator": "m:f",
        "settings": {"speed_m_s": 4300.0},
        "factors": {"a": 0.1, "shape": "cone"},
        "replicate": 0,
        "status": "done",
        "responses": {"y": 1 / 3},
        "extras": {"note": "ä", "n": 3},
        "seconds": 0.25,
    }
    return Run(**(fields | changes))


def test_key_is_the_hash_it_is_said_to_be():
    text = '["m:f", {"speed": 4300.0}, {"a": 0.1, "b": 2.0}, 0]'
    assert (
        run_key("m:f", {"speed": 4300.0}, {"b": 2.0, "a": 0.1})
        == hashlib.sha256(text.encode()).hexdigest()[:16]
    )


@pytest.mark.parametrize(
    ("first", "second"),
    [
        (("m:f", {}, {"a": 1.0}, 0), ("m:g", {}, {"a": 1.0}, 0)),
        (("m:f", {}, {"a": 1.0}, 0), ("m:f", {"s": 1}, {"a": 1.0}, 0)),
        (("m:f", {}, {"a": 1.0}, 0), ("m:f", {}, {"a": math.nextafter(1.0, 2.0)}, 0)),
        (("m:f", {}, {"a": 1.0}, 0), ("m:f", {}, {"b": 1.0}, 0)),
        (("m:f", {}, {"a": 1.0}, 0), ("m:f", {}, {"a": 1.0}, 1)),
        (("m:f", {}, {"a": 1.0}, 0), ("m:f", {}, {"a": "1.0"}, 0)),
        (("m:f", {"s": True}, {"a": 1.0}, 0), ("m:f", {"s": 1}, {"a": 1.0}, 0)),
    ],
)
def test_key_tells_runs_apart(first, second):
    assert run_key(*first) != run_key(*second)


@pytest.mark.parametrize(
    ("first", "second"),
    [
        (({"s": 4300}, {"a": 2.0, "b": 1}), ({"s": 4300.0}, {"b": 1.0, "a": 2})),
        (({}, {"a": 0.0}), ({}, {"a": -0.0})),
        (({"list": [1, "x"]}, {"a": 1}), ({"list": (1.0, "x")}, {"a": 1})),
    ],
)
def test_key_ignores_what_changes_nothing(first, second):
    assert run_key("m:f", *first) == run_key("m:f", *second)


def test_a_line_brings_back_every_bit():
    run = make(responses={"y": 5e-324, "z": 0.1 + 0.2, "w": 1.7976931348623157e308})
    assert run_from_json(run_to_json(run)) == run
    assert "\n" not in run_to_json(make(error="two\nlines"))


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
def test_not_a_number_never_gets_into_a_line(number):
    with pytest.raises(ValueError):
        run_to_json(make(responses={"y": number}))


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"schema": 2}, "schema 2"),
        ({"key": "../../etc/passwd"}, "hexadecimal"),
        ({"key": "0123456789ABCDEF"}, "hexadecimal"),
        ({"status": "fine"}, "unknown status"),
        ({"responses": {"y": "1"}}, "not a finite number"),
        ({"responses": {"y": True}}, "not a finite number"),
        ({"responses": {"y": 10**400}}, "not a finite number"),
        ({"responses": [1]}, "responses is list"),
        ({"factors": {"a": [1]}}, "neither finite number nor text"),
        ({"replicate": True}, "replicate is bool"),
        ({"seconds": "1"}, "seconds is str"),
    ],
)
def test_a_damaged_line_says_what_is_wrong(change, reason):
    data = json.loads(run_to_json(make())) | change
    with pytest.raises(ValueError, match=reason):
        run_from_json(json.dumps(data))


@pytest.mark.parametrize(
    "text",
    [
        b"",
        b"{",
        b"[]",
        b"\xff\xfe",
        b'{"schema":1}',
        b'{"schema":1,"seconds":1e999}',
        b'{"schema":1,"seconds":NaN}',
        b"[" * 100_000,
        b'{"schema":1,"seconds":' + b"9" * 5000 + b"}",
    ],
)
def test_anything_else_is_refused_as_a_value_error(text):
    with pytest.raises(ValueError):
        run_from_json(text)


def test_values_are_found_among_extras_too():
    run = make(extras={"z": 2, "flag": True, "note": "x"})
    assert run.value("y") == 1 / 3
    assert run.value("z") == 2.0
    assert math.isnan(run.value("flag"))
    assert math.isnan(run.value("note"))
    assert math.isnan(run.value("absent"))


def test_a_record_answers_when_it_has_every_number_asked_for():
    failed = make(status="failed", responses={}, extras={"z": 2.0, "nothing": None})
    assert failed.answers(["z"])
    assert not failed.answers(["z", "y"])
    assert not failed.answers(["nothing"])
    assert not failed.answers([])
    assert make().answers([])
