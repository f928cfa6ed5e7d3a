"""Searches of a study file that are more than a sum: desirability, and a factor that varies in service."""

import json

import pytest

pytestmark = [pytest.mark.slow, pytest.mark.e2e]

SIMULATOR = """
def run(x, z):
    return {"load": x**2, "speed": x, "noisy": x**2 + (1 + x) * z}
"""

STUDY = """
[simulator]
run = "plant:run"

[factors]
x = { low = -1.0, high = 1.0 }
z = { low = -1.0, high = 1.0 }

[responses]
load = {}
speed = {}
noisy = {}

[design]
star = "faced"

[verify.refine]
max_runs = 6

[[search]]
name = "balanced"
preset = "fast"
subject_to = ["noisy <= 1"]
[search.desirability]
load  = { goal = "minimize", low = 0, high = 1 }
speed = { goal = "maximize", low = -1, high = 1 }

[[search]]
name = "sturdy"
preset = "fast"
minimize = "noisy"
robust = { noise = { z = { mean = 0.0, spread = 0.5 } }, deviations = 2.0 }

[[search]]
name = "both"
minimize = ["load + 1", "2 - speed"]
preset = "fast"
"""


@pytest.fixture
def plant(rsmkit):
    (rsmkit.folder / "plant.py").write_text(SIMULATOR)
    (rsmkit.folder / "study.toml").write_text(STUDY)
    return rsmkit


def test_from_the_study_file_to_the_verified_optimum(plant):
    said = plant("run").stdout
    assert "balanced: the greatest desirability of load, speed" in said
    assert "desirabilities: load 0.889, speed 0.667" in said
    assert "sturdy: minimise noisy; mean + 2 standard deviations over z" in said
    balanced, sturdy, _ = json.loads((plant.folder / "verification.json").read_text())["searches"]
    # (1 - x^2)(1 + x)/2 is greatest at x = 1/3, where its square root is sqrt(16/27)
    assert balanced["factors"]["x"] == pytest.approx(1 / 3, abs=1e-4)
    assert balanced["objective"]["actual"] == pytest.approx(-((16 / 27) ** 0.5))
    assert balanced["verdict"] == "CONFIRMED"
    # the mean is x^2, the standard deviation (1 + x)/2: x^2 + (1 + x) is least at x = -1/2
    assert sturdy["factors"] == {"x": pytest.approx(-0.5, abs=1e-4), "z": 0.0}
    assert sturdy["objective"]["predicted"] == pytest.approx(0.75)
    assert sturdy["objective"]["actual"] == pytest.approx(0.75)
    optima = json.loads((plant.folder / "optimum.json").read_text())["searches"]
    # over the box (1 + x)(z + x - 1) <= 0 where x + z <= 1, seven eighths of it
    assert optima[0]["feasible_region"]["share"] == pytest.approx(7 / 8, abs=0.01)
    assert "feasible_region" not in optima[1]
    # six runs for each search settle none of them, which is exit code 5
    refined = plant.json("verify", "--refine", "-j", "1", expect=5)["refinement"]
    assert list(refined) == ["balanced", "sturdy", "both"]
    assert refined["balanced"]["objective"] <= balanced["objective"]["actual"] + 1e-12
    compared = plant.json("verify", "--against-ga", "-j", "1", expect=5)["against_ga"]
    assert [item["search"] for item in compared] == ["balanced", "sturdy", "both"]
    assert compared[0]["objective_worse_pct"] == pytest.approx(0.0, abs=1e-3)
    assert compared[1]["objective_worse_pct"] == pytest.approx(0.0, abs=1e-3)
    surrogate, direct = compared[2]["fronts"]
    assert surrogate["runs"] == 9 + 3
    assert direct["runs"] >= 24 * 8
    # the front is x from 0 to 1: the surrogate has flown its ends and its knee, the direct search all of it
    assert surrogate["hypervolume_pct"] < direct["hypervolume_pct"] > 99.9
    assert surrogate["igd_plus"] > direct["igd_plus"] < 1e-3


def test_wishes_that_cannot_be_are_refused(plant):
    text = STUDY.replace("low = -1, high = 1 }\n", "low = 1, high = 1 }\n").replace("z = { m", "w = { m")
    (plant.folder / "study.toml").write_text(text)
    said = plant("check", expect=2).stderr
    assert "search[0].desirability.speed.low must be less than high" in said
    assert "search sturdy: robust.noise.w is no factor" in said
