import copy
import json

import numpy as np
import pytest

from rsmkit.errors import RsmkitError
from rsmkit.language.space import Factor, Space
from rsmkit.optimum.optimum import Optimum
from rsmkit.optimum.options import SearchOptions
from rsmkit.optimum.problem import build_problem
from rsmkit.optimum.search import search_problem

SPACE = Space([Factor("x", 0.0, 10.0), Factor("metal", levels=("steel", "brass"))])


@pytest.fixture(scope="module")
def document():
    problem = build_problem(
        SPACE,
        ["f", "g"],
        lambda p: {"f": p[:, 0] ** 2, "g": (p[:, 0] - 1) ** 2 + p[:, 1]},
        responses=["f", "g"],
    )
    return search_problem(problem, SearchOptions(("f", "g"), name="pareto", preset="fast")).to_json()


def test_round_trip_through_text(document):
    text = json.dumps(document, allow_nan=False)
    again = Optimum.from_json(json.loads(text), SPACE)
    assert again.to_json() == document


def test_content(document):
    assert document["settings"] == {
        "method": "nsga2",
        "preset": "fast",
        "population": 24,
        "generations": 8,
        "polish": True,
    }
    assert document["seed"] == 1
    assert document["factors"]["metal"] == "steel"
    assert document["coded"]["x"] == pytest.approx(document["factors"]["x"] / 5 - 1)
    assert document["responses"] == pytest.approx(dict(zip("fg", document["objectives"], strict=True)))


def test_html_escapes_and_names_the_search(document):
    html = Optimum.from_json({**document, "name": "<b>"}, SPACE)._repr_html_()
    assert "&lt;b&gt;" in html
    assert "<b>" not in html


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("name",), 3),
        (("minimize",), []),
        (("minimize",), ["f", 1]),
        (("seed",), True),
        (("evaluations",), "many"),
        (("factors",), {"x": 3.0}),
        (("factors",), {"x": 99.0, "metal": "steel"}),
        (("factors",), {"x": float("nan"), "metal": "steel"}),
        (("factors",), {"x": None, "metal": "steel"}),
        (("factors",), {"x": [1.0], "metal": "steel"}),
        (("factors",), {"x": 1.0, "metal": "gold"}),
        (("objectives",), [1.0]),
        (("objectives",), [1.0, float("inf")]),
        (("responses",), {"f": None}),
        (("margins",), ["0"]),
        (("history",), {"best": [1.0], "mean": []}),
        (("history",), {"best": ["x"]}),
        (("front",), [{}]),
        (("front",), [1]),
        (("front",), {}),
    ],
)
def test_anything_else_is_refused(document, path, value):
    broken = copy.deepcopy(document)
    *parents, last = path
    inner = broken
    for key in parents:
        inner = inner[key]
    inner[last] = value
    with pytest.raises(RsmkitError):
        Optimum.from_json(broken, SPACE)


def test_missing_keys_are_refused(document):
    for key in document:
        if key in ("coded", "hypervolume"):  # follow from the rest
            continue
        with pytest.raises(RsmkitError):
            Optimum.from_json({k: v for k, v in document.items() if k != key}, SPACE)
    with pytest.raises(RsmkitError):
        Optimum.from_json([], SPACE)  # type: ignore[arg-type]


def test_levels_of_numbers_survive_as_the_simulator_receives_them():
    space = Space([Factor("n", 1, 5, integer=True)])
    optimum = search_problem(
        build_problem(space, "(n - 3)**2", lambda p: {}, responses=[]), SearchOptions("f", preset="fast")
    )
    assert optimum.to_json()["factors"] == {"n": 3}
    assert np.array_equal(Optimum.from_json(optimum.to_json(), space).point, [3.0])
