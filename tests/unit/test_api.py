"""The Python interface: every name leads somewhere, importing is free, the four functions work together."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import rsmkit as rk
from rsmkit.runs.record.run_table import Runs


def test_every_public_name_leads_somewhere():
    for name in rk.__all__:
        assert getattr(rk, name).__doc__
    assert set(rk.__all__) <= set(dir(rk))
    with pytest.raises(AttributeError, match="nonsense"):
        _ = rk.nonsense


def test_importing_loads_nothing_numerical():
    code = "import sys, rsmkit; assert not {'numpy', 'scipy', 'pandas', 'click'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_four_functions_find_the_minimum_of_a_paraboloid(tmp_path, monkeypatch):
    """The minimum of (x - 1)^2 + 2 (y + 2)^2 + 5 is 5 at (1, -2); a quadratic surface is exact."""
    (tmp_path / "bowl_for_api.py").write_text(
        "def bowl(x, y, offset):\n    return {'height': (x - 1) ** 2 + 2 * (y + 2) ** 2 + offset}\n"
    )
    monkeypatch.chdir(tmp_path)
    design = rk.ccd(rk.Space(x=(-3.0, 3.0), y=(-4.0, 2.0)), star="inscribed", center=1)
    simulator, settings = "bowl_for_api:bowl", {"offset": 5.0}
    runs = rk.evaluate(simulator, design, responses=["height"], settings=settings, jobs=1)
    assert runs.done.all()
    surfaces = rk.fit(runs)
    best = rk.search(surfaces, "height", subject_to=["x + y >= -4"])
    np.testing.assert_allclose(best.point, [1.0, -2.0], atol=1e-5)
    checked = rk.verify(best, simulator, surfaces, runs, settings=settings)
    assert checked.objective.actual == pytest.approx(5.0, abs=1e-9)
    assert checked.verdict == "CONFIRMED"


def test_a_function_that_workers_cannot_find_is_refused(tmp_path):
    design = rk.ccd(rk.Space(x=(0.0, 1.0), y=(0.0, 1.0)))
    with pytest.raises(rk.RsmkitError, match=r"put it into a \.py file"):
        rk.evaluate(lambda x, y: {"z": x}, design, save=tmp_path / "runs.jsonl")


def test_a_fit_to_runs_that_all_failed_says_why(tmp_path, monkeypatch):
    (tmp_path / "broken_for_api.py").write_text("def f(x):\n    raise ValueError(f'no fuel at {x}')\n")
    monkeypatch.chdir(tmp_path)
    design = rk.full_factorial(rk.Space(x=(0.5, 1.0)), levels=3)
    runs = rk.evaluate("broken_for_api:f", design, jobs=1)
    message = "none of the 3 runs succeeded: the first failed at x 0.5: failed, ValueError: no fuel at 0.5"
    with pytest.raises(rk.RsmkitError) as refusal:
        rk.fit(runs)
    assert str(refusal.value) == message
    with pytest.raises(rk.RsmkitError, match="none of the 3 runs succeeded: none has been made"):
        rk.fit(Runs(design.space, design.points, (None,) * 3), ["y"])


@pytest.fixture(scope="module")
def surfaces(tmp_path_factory):
    """A plane in a number and a category, known everywhere: y = 2 speed + 10 on steel, 2 speed on brass."""
    folder = tmp_path_factory.mktemp("plane")
    space = rk.Space(speed=(1.0, 3.0), metal=["steel", "brass"])
    design = rk.full_factorial(space, levels=3)
    values = [
        2 * point["speed"] + 10 * (point["metal"] == "steel") for point in map(space.values, design.points)
    ]
    (folder / "known_for_api.py").write_text(
        "def f(speed, metal):\n    return {'load_N': 2 * speed + 10 * (metal == 'steel')}\n"
    )
    before = Path.cwd()
    os.chdir(folder)
    try:
        runs = rk.evaluate("known_for_api:f", design, jobs=1)
    finally:
        os.chdir(before)
    assert runs.y("load_N").tolist() == values
    return rk.fit(runs, order=1)


@pytest.mark.parametrize(
    "points",
    [
        pd.DataFrame({"speed": [1.0, 2.5], "metal": ["brass", "steel"]}),
        pd.DataFrame({"metal": ["brass", "steel"], "speed": [1.0, 2.5]}),
        {"metal": ["brass", "steel"], "speed": np.array([1.0, 2.5])},
        [[1.0, 1.0], [2.5, 0.0]],
    ],
    ids=["frame", "columns swapped", "mapping", "array"],
)
def test_predictions_go_by_the_names_of_the_columns(surfaces, points):
    np.testing.assert_allclose(surfaces["load_N"].predict(points), [2.0, 15.0], rtol=1e-12)


def test_one_value_holds_for_every_row(surfaces):
    found = surfaces["load_N"].predict({"speed": [1.0, 2.0, 3.0], "metal": "brass"}, 0.95)
    np.testing.assert_allclose(found[0], [2.0, 4.0, 6.0], rtol=1e-12)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda s: s["load"], "did you mean 'load_N'"),
        (
            lambda s: s["load_N"].predict(pd.DataFrame({"spede": [1.0], "metal": ["brass"]})),
            "missing speed; unknown spede",
        ),
        (
            lambda s: s["load_N"].predict({"speed": [1.0, 2.0], "metal": ["brass"] * 3}),
            "should have 3 values",
        ),
        (lambda s: s["load_N"].predict({"speed": 1.0, "metal": "tin"}), "tin"),
        (lambda s: s["load_N"].predict([[1.0, 0.0]], 0.95, "predicton"), "did you mean 'prediction'"),
        (lambda s: s["load_N"].space["sped"], "did you mean 'speed'"),
        (lambda s: rk.fit(pd.DataFrame()), "runs must be a Runs; got a DataFrame"),
        (lambda s: rk.search(s, "load_N", polsh=False), "unknown key polsh; did you mean polish"),
        (lambda s: rk.search(s, "load_N", preset="papr"), "did you mean 'paper'"),
        (lambda s: rk.search({}, "load_N"), "fit some first"),
    ],
)
def test_a_wrong_word_is_one_clear_message(surfaces, call, words):
    with pytest.raises(rk.RsmkitError, match=words):
        call(surfaces)


def test_one_constraint_may_be_a_text(surfaces):
    best = rk.search(surfaces, "load_N", subject_to="speed >= 2")
    assert best.factors["speed"] == pytest.approx(2.0, abs=1e-6)
    assert best.factors["metal"] == "brass"


def test_refining_goes_on_from_an_optimum_and_from_a_front(tmp_path, monkeypatch):
    """The minimum of exp(2 x) - 2 x + (y - 0.3)^2 is 1 at (0, 0.3); a quadratic surface misses it."""
    (tmp_path / "skew_for_api.py").write_text(
        "import math\ndef skew(x, y):\n"
        "    return {'f': math.exp(2 * x) - 2 * x + (y - 0.3) ** 2, 'g': (x - 1) ** 2 + (y - 0.3) ** 2}\n"
    )
    monkeypatch.chdir(tmp_path)
    design = rk.ccd(rk.Space(x=(-1.0, 1.0), y=(-1.0, 1.0)), star="inscribed", center=1)
    runs = rk.evaluate("skew_for_api:skew", design, jobs=1)
    surfaces = rk.fit(runs)
    best = rk.search(surfaces, "f")
    waves = []
    found = rk.refine(
        best, "skew_for_api:skew", surfaces, runs, jobs=1, batch=2, max_runs=12, on_wave=waves.append
    )
    assert found.best.objectives[0, 0] == pytest.approx(1.0, abs=1e-4)
    assert list(found.waves) == waves
    assert all(len(wave.points) <= 2 for wave in waves)
    front = rk.search(surfaces, ["f", "g"])
    spread = rk.refine(front, "skew_for_api:skew", surfaces, runs, jobs=1, max_runs=8).result.front
    np.testing.assert_allclose(spread.points[1:-1, 1], 0.3, atol=0.1)  # the front is y = 0.3, x from 0 to 1
    with pytest.raises(rk.RsmkitError, match="unknown key max_run; did you mean max_runs"):
        rk.refine(best, "skew_for_api:skew", surfaces, runs, max_run=3)
