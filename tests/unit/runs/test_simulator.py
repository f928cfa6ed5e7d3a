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


def test_without_names_every_finite_number_is_a_response():
    output = read_output({"y": 1, "nan": math.nan, "text": "a"})
    assert output.responses == {"y": 1.0}
    assert output.extras == {"nan": None, "text": "a"}
