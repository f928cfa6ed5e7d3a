"""Finding a simulator, and sorting what it returns."""

import decimal
import fractions
import math
from pathlib import Path

import numpy as np
import pytest

from rsmkit.runs.one_run.simulator import OutputError, Simulator, SimulatorError, read_output
from rsmkit.runs.options import SimulatorOptions

DATA = Path(__file__).parents[2] / "data" / "runs"


def named(run, folder=DATA):
    return Simulator(SimulatorOptions(run=run), folder)


def test_a_module_beside_the_study_is_found(monkeypatch):
    monkeypatch.setattr("sys.path", ["somewhere"])
    assert named("simulators:plane").load()(a=1.0, b=2.0)["y"] == 5.0


def test_an_installed_module_is_found_too(tmp_path):
    assert named("math:hypot", tmp_path).load() is math.hypot


@pytest.mark.parametrize(
    ("run", "message"),
    [
        ("no_such_module:f", r"module no_such_module cannot be imported \(looked in .* No module named"),
        ("simulators:nothing", r"simulators\.py has no 'nothing'"),
        ("simulators:not_callable", "is not a function but 3"),
    ],
)
def test_what_cannot_be_loaded_is_explained(run, message):
    with pytest.raises(SimulatorError, match=message):
        named(run).load()


@pytest.mark.parametrize(
    ("source", "reason"),
    [
        ("raise ValueError('not today')", "ValueError: not today"),
        ("import sys; sys.exit(3)", "SystemExit: 3"),
        ("def f(:", "SyntaxError"),
        ("import nothing_of_the_kind", "No module named 'nothing_of_the_kind'"),
    ],
)
def test_a_module_that_fails_as_it_is_imported_is_explained(tmp_path, source, reason, request):
    name = f"broken_{abs(hash(request.node.name))}"
    (tmp_path / f"{name}.py").write_text(source)
    with pytest.raises(SimulatorError, match=reason):
        named(f"{name}:f", tmp_path).load()


@pytest.mark.parametrize(
    "number", [2, 2.0, np.float32(2), np.int64(2), np.array(2.0), fractions.Fraction(2), np.array(2)]
)
def test_every_kind_of_real_number_is_a_response(number):
    assert read_output({"y": number}, ["y"]).responses == {"y": 2.0}
    assert type(read_output({"y": number}, ["y"]).responses["y"]) is float


@pytest.mark.parametrize(
    ("returned", "message"),
    [
        ({"y": math.nan}, "returned y = nan"),
        ({"y": np.float64("inf")}, "returned y = inf"),
        ({"y": 10**400}, "returned y = inf"),
        ({"y": "2.0"}, "returned y = '2.0', which is not a number"),
        ({"y": None}, "returned y = None, which is not a number"),
        ({"y": True}, "returned y = True, which is not a number"),
        ({"y": 1j}, "not a number"),
        ({"y": [1.0]}, "not a number"),
        ({"y": np.ones(3)}, "not a number"),
        ({"y": decimal.Decimal("1")}, "not a number"),
        ({"x": 1.0}, r"did not return y \(it returned x\)"),
        ({}, r"did not return y \(it returned nothing\)"),
        (2.0, "returned float instead of a mapping"),
        ([("y", 2.0)], "returned list instead of a mapping"),
        (None, "returned NoneType"),
    ],
)
def test_anything_else_is_refused_with_its_reason(returned, message):
    with pytest.raises(OutputError, match=message):
        read_output(returned, ["y"])


def test_every_problem_is_named_and_the_good_numbers_are_kept():
    with pytest.raises(OutputError, match=r"y = nan; did not return z") as caught:
        read_output({"x": 1.5, "y": math.nan, "n": 3}, ["x", "y", "z"])
    assert caught.value.extras == {"x": 1.5, "y": None, "n": 3}


def test_extras_are_made_storable():
    returned = {
        "y": 1.0,
        "nan": math.nan,
        "n": np.int32(3),
        "array": np.array([1.0, np.nan]),
        "nested": {"list": (1, "a", None), 5: True},
        "path": Path("a"),
        2: "two",
    }
    output = read_output(returned, ["y"])
    assert output.responses == {"y": 1.0}
    assert output.extras == {
        "nan": None,
        "n": 3,
        "array": [1.0, None],
        "nested": {"list": [1, "a", None], "5": True},
        "path": "a",
        "2": "two",
    }


def kept(**extras):
    return read_output({"y": 1.0, **extras}, ["y"]).extras


def deep(depth):
    inner = 1.0
    for _ in range(depth):
        inner = [inner]
    return inner


def test_what_is_kept_of_a_run_is_bounded_all_together():
    refused = "more than 10,000 values, which were not kept"
    assert kept(a=deep(20)) == {"a": deep(20)}
    assert kept(a=deep(21)) == {"a": "nested more than 20 deep, which was not kept"}
    assert kept(a=[0.0] * 10_000) == {"a": [0.0] * 10_000}
    assert kept(a=[0.0] * 10_001, b=1) == {"a": refused, "b": 1}
    assert kept(a={f"{i}": i for i in range(10_001)}) == {"a": refused}
    assert kept(a=[[0.0] * 100] * 101) == {"a": refused}
    assert kept(a=[0.0] * 6_000, b={"c": [0.0] * 6_000}, d=1) == {"a": [0.0] * 6_000, "b": refused, "d": 1}
    assert kept(a=np.zeros((100, 100)), b=np.zeros(1))["b"] == refused
    assert kept(a=[[]] * 10_001) == {"a": refused}
    assert kept(a=["x" * 9_000] * 12) == {"a": "more than 100,000 characters, which were not kept"}
    assert kept(a={"x" * 9_000 + f"{i}": 0 for i in range(12)})["a"].startswith(
        "more than 100,000 characters"
    )
    many = kept(**{f"n{i}": 0 for i in range(300_000)})
    assert len(many) == 10_001
    assert many["..."] == "290000 more, which were not kept"
    refused_late = {"long": [0.0] * 9_000, "deep": deep(30)}
    assert kept(a=refused_late, b=[0.0] * 9_000)["b"] == [0.0] * 9_000, "what is not kept takes no room"
    cycle = []
    cycle.append(cycle)
    assert kept(a=cycle) == {"a": "nested more than 20 deep, which was not kept"}


def test_a_run_may_not_return_numbers_without_end():
    with pytest.raises(OutputError, match="returned 10,001 values; a run may have 10,000"):
        read_output({f"n{i}": 0.0 for i in range(10_001)})


def test_without_names_every_finite_number_is_a_response():
    output = read_output({"y": 1, "nan": math.nan, "text": "a"})
    assert output.responses == {"y": 1.0}
    assert output.extras == {"nan": None, "text": "a"}
