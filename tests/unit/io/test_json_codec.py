from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
import pytest

from rsmkit.errors import DamagedError, RsmkitError
from rsmkit.io.json_codec import from_json, left_out_if_none, read_json, to_json, write_json
from rsmkit.io.strict_types import NULL_IS_NAN, ReadBy, Shape
from rsmkit.language.space import Floats


@dataclass(frozen=True)
class Circle:
    JSON_KEYS: ClassVar = ("kind", "area", "radius")

    radius: float
    kind: Literal["circle"] = "circle"

    def __post_init__(self) -> None:
        if self.radius < 0:
            raise RsmkitError("a radius is not negative")

    @property
    def area(self) -> float:
        return 3.0 * self.radius**2


@dataclass(frozen=True)
class Square:
    side: int
    kind: Literal["square"] = "square"


@dataclass(frozen=True)
class Names:
    joined: str


@dataclass(frozen=True)
class Pair:
    """Written as one text."""

    first: str
    second: str

    def to_form(self) -> Names:
        return Names(f"{self.first} {self.second}")

    @classmethod
    def from_form(cls, form: Names) -> Pair:
        first, _, second = form.joined.partition(" ")
        if not second:
            raise RsmkitError(f"holds one name, {first}")
        return cls(first, second)


def figure(data: Any) -> Circle | Square:
    kinds = {"circle": Circle, "square": Square}
    kind = data.get("kind") if isinstance(data, dict) else None
    if kind not in kinds:
        raise DamagedError("figure", [f"is of the kind {kind}, which is none of {', '.join(kinds)}"], "")
    return from_json(kinds[kind], data, "figure", "")


def square(data: Any) -> Square:
    if data == "defect":
        raise NotImplementedError("a defect of the program")
    return from_json(Square, data, "square", "")


Figure = Annotated[Circle | Square, ReadBy(figure)]


@dataclass(frozen=True, eq=False)
class Everything:
    points: Annotated[Floats, Shape("runs", "factors")]
    weights: Annotated[Floats, Shape("runs")] | None
    error: Annotated[float, NULL_IS_NAN]
    value: float | int | str
    figures: dict[str, Figure]
    pair: Pair
    square: Annotated[Square, ReadBy(square)]
    rows: tuple[tuple[str, float | None], ...]
    limit: float | None
    note: str | None = left_out_if_none()


WHOLE = Everything(
    np.array([[1.0, 0.1], [2.0, 1 / 3], [3.0, 1e-300]]),
    np.array([1.0, 2.0, 3.0]),
    math.nan,
    3,
    {"a": Circle(2.0), "b": Square(3)},
    Pair("Ada", "Lovelace"),
    Square(4),
    (("x", 1.0), ("y", None)),
    None,
)
DOCUMENT = {
    "points": [[1.0, 0.1], [2.0, 1 / 3], [3.0, 1e-300]],
    "weights": [1.0, 2.0, 3.0],
    "error": None,
    "value": 3,
    "figures": {"a": {"kind": "circle", "area": 12.0, "radius": 2.0}, "b": {"side": 3, "kind": "square"}},
    "pair": {"joined": "Ada Lovelace"},
    "square": {"side": 4, "kind": "square"},
    "rows": [["x", 1.0], ["y", None]],
    "limit": None,
}


def read(data: Any) -> Everything:
    return from_json(Everything, data, "all.json", "Run: it again")


def test_a_class_is_written_as_its_keys_in_order():
    assert json.dumps(to_json(WHOLE)) == json.dumps(DOCUMENT)


def test_what_was_written_is_read_back_to_the_last_bit():
    again = read(json.loads(json.dumps(DOCUMENT)))
    np.testing.assert_array_equal(again.points, WHOLE.points)
    assert math.isnan(again.error)
    assert type(again.value) is int
    assert again.figures == WHOLE.figures
    assert (again.pair, again.rows, again.limit, again.note) == (WHOLE.pair, WHOLE.rows, None, None)
    assert json.dumps(to_json(again)) == json.dumps(DOCUMENT)


def test_keys_of_later_versions_are_overlooked():
    assert read({**DOCUMENT, "colour": "red"}).value == 3


@pytest.mark.parametrize(
    ("change", "mistake"),
    [
        ({"points": 3}, "points must be a list of numbers, got 3"),
        ({"points": [[1.0, None]]}, "points must hold finite numbers only, got nothing at [0][1]"),
        ({"points": [[1.0, True]]}, "points must hold finite numbers only, got true at [0][1]"),
        ({"points": [1.0]}, "points must hold finite numbers only, got 1.0 at [0]"),
        ({"points": [[[1.0]]]}, "points must hold finite numbers only, got [1.0] at [0][0]"),
        ({"points": [[1e305]]}, "points must hold finite numbers only, got 1e+305 at [0][0]"),
        ({"points": [[1.0], [1.0, 2.0]]}, "points has rows of different lengths"),
        ({"weights": [1.0]}, "has 3 runs in points but 1 in weights"),
        ({"error": "x"}, 'error must be a number, got "x"'),
        ({"value": None}, "value must be a number or a whole number or a text, got nothing"),
        ({"value": float("inf")}, "value must be a number or a whole number or a text, got inf"),
        ({"figures": {"a": {"kind": "cube"}}}, "figures.a is of the kind cube, which is none of circle"),
        ({"figures": {"a": 1}}, "figures.a is of the kind None, which is none of circle, square"),
        ({"figures": {"a": {"kind": "square"}}}, "figures.a.side is missing"),
        ({"figures": {"a": {"kind": "circle", "radius": -1}}}, "figures.a a radius is not negative"),
        ({"pair": {"joined": "Ada"}}, "pair holds one name, Ada"),
        ({"pair": {"joined": "\ud800 x"}}, "pair.joined must not hold control characters"),
        ({"rows": [["x", 1.0], ["x"]]}, 'rows[1] must be a list of 2, got [\'x\']'),
        ({"rows": [["x", "y"]]}, 'rows[0] must be a number, got "y"'),
        ({"limit": [1]}, "limit must be a number, got [1]"),
    ],
)  # fmt: skip
def test_a_mistake_is_named_with_its_place(change, mistake):
    with pytest.raises(RsmkitError) as caught:
        read({**DOCUMENT, **change})
    assert str(caught.value).startswith(f"all.json: damaged ({mistake}".encode("unicode_escape").decode())
    assert str(caught.value).endswith("). Run: it again")


def test_all_mistakes_are_reported_at_once():
    wrong = {"points": [], "weights": 1, "figures": {"a": {"kind": "square"}}, "pair": []}
    with pytest.raises(RsmkitError) as caught:
        read({**DOCUMENT, **wrong, "error": "x", "value": None})
    assert str(caught.value).splitlines() == [
        "all.json: damaged (5 mistakes). Run: it again",
        "  weights must be a list of numbers, got 1",
        '  error must be a number, got "x"',
        "  value must be a number or a whole number or a text, got nothing",
        "  figures.a.side is missing",
        "  pair must be a table, got []",
    ]


def test_a_defect_of_the_program_is_no_mistake_of_the_file():
    with pytest.raises(NotImplementedError, match="a defect"):
        read({**DOCUMENT, "square": "defect"})


def test_of_many_mistakes_some_are_counted_only():
    message = str(DamagedError("f.json", [f"mistake\n{i}" for i in range(30)], "Do this."))
    lines = message.splitlines()
    assert lines[0] == "f.json: damaged (30 mistakes). Do this."
    assert lines[1] == "  mistake\\n0"
    assert lines[-1] == "  and 22 more"
    assert len(str(DamagedError("f.json", ["x" * 5000], "Do this."))) < 250


@pytest.mark.parametrize("data", [None, [], 3, "x", True])
def test_what_is_no_object_is_refused(data):
    with pytest.raises(RsmkitError, match="must be a table, got"):
        read(data)


def test_files_keep_every_digit_and_refuse_what_is_no_number(tmp_path):
    path = tmp_path / "x.json"
    write_json(path, {"y": 0.1 + 0.2, "é": [1e-320]})
    assert path.read_bytes() == '{\n "y": 0.30000000000000004,\n "é": [\n  1e-320\n ]\n}\n'.encode()
    assert read_json(path, "") == {"y": 0.1 + 0.2, "é": [1e-320]}
    with pytest.raises(ValueError, match="not JSON compliant"):
        write_json(path, {"y": math.nan})


@pytest.mark.parametrize(
    "text", ["", "[]", "{", '{"a": NaN}', '{"a": 1e999}', "9" * 400, '{"a": "\x85"}', '{"a":' * 100_000]
)
def test_files_that_are_no_documents_are_refused(tmp_path, text):
    path = tmp_path / "x.json"
    path.write_text(text)
    with pytest.raises(RsmkitError, match=r"x\.json: damaged \(.*\)\. Run: it again"):
        read_json(path, "Run: it again")
