"""The main job: the whole re-entry study through the command line, against pinned numbers.

The pinned numbers are this program's own (``tests/data/regression/reentry.json``, written by
``python tests/regression/test_reentry_study.py STUDY_FOLDER`` from a finished study): they guard against
unintended change. What makes the numbers right is tested in ``tests/validation``.
"""

import json
import math
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pytestmark = [pytest.mark.slow, pytest.mark.e2e]

ROOT = Path(__file__).parents[2]
PINNED = ROOT / "tests" / "data" / "regression" / "reentry.json"
RESPONSES = ("axial_integral", "heat_integral", "margin_inverse")


NOISE = math.sqrt(1800) * 1e-7
"""How far a response moves, relative to itself, when something rounds otherwise (the C library of another
machine): the adaptive flight takes other steps. Each of some 1800 steps (docs/validation/flight-accuracy.md)
errs by up to the tolerance of the integration, 1e-7 of its size, independently of the others. 0.5e-6 (F1),
0.4e-6 (F2) and 2.3e-6 (F3) were seen in 50 flights with a library without fused multiply-add."""


def read(folder, name):
    return json.loads((folder / name).read_text())


def summary(folder):
    """What is pinned: every coefficient, and the objective at each optimum, predicted and flown."""
    reports = read(folder, "model.json")["reports"]
    return {
        "coefficients": {
            name: {term["name"]: term["estimate"] for term in report["terms"]}
            for name, report in reports.items()
        },
        "objectives": {
            search["name"]: {key: search["objective"][key] for key in ("predicted", "actual")}
            for search in read(folder, "verification.json")["searches"]
        },
    }


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """A finished re-entry study, made by the one command of the README."""
    folder = tmp_path_factory.mktemp("reentry")
    for source in (ROOT / "studies" / "reentry").iterdir():
        if source.suffix in (".toml", ".js"):
            shutil.copy(source, folder)
    done = subprocess.run(
        [sys.executable, "-m", "rsmkit", "run", str(folder)], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


@pytest.fixture(scope="module")
def pinned():
    return json.loads(PINNED.read_text())


def test_it_spends_fifty_runs_one_per_optimum_and_a_few_to_prove_the_true_ones(study):
    runs = [json.loads(line) for line in (study / "runs.jsonl").read_text().splitlines()]
    assert all(run["status"] == "done" for run in runs)
    assert read(study, "verification.json")["simulator_runs"] == {"design": 50, "verification": 2}
    refined = read(study, "refinement.json")["searches"]
    assert {name: found["verdict"] for name, found in refined.items()} == {
        "table1": "SETTLED",
        "table9": "SETTLED",
    }
    assert len(runs) == 52 + sum(found["runs"] for found in refined.values()) <= 80


def test_coefficients_are_the_pinned_ones(study, pinned):
    """Coefficients are ``L y``, so a change dy moves the i-th by at most ``|L_i| |dy|``, Euclidean lengths.

    ``|L_i|`` is its standard error over sigma, and ``|dy| <= NOISE |y|``.
    """
    found = summary(study)["coefficients"]
    reports = read(study, "model.json")["reports"]
    assert found.keys() == pinned["coefficients"].keys()
    for name, terms in pinned["coefficients"].items():
        report = reports[name]
        assert found[name].keys() == terms.keys()
        assert len(terms) == 10
        size = math.hypot(*report["diagnostics"]["observed"])
        for term in report["terms"]:
            limit = term["std_error"] / report["sigma"] * NOISE * size
            assert term["estimate"] == pytest.approx(terms[term["name"]], rel=0, abs=limit), (
                name,
                term["name"],
            )


def test_objectives_at_the_optimum_are_the_pinned_ones(study, pinned):
    """A prediction moves by at most ``sqrt(leverage) NOISE |y|``, here ``NOISE sqrt(50)`` of itself, 3e-5.

    The point at which it is least moves too, but the objective is flat there; 1e-4 leaves room for that.
    """
    found = summary(study)["objectives"]
    for name, values in pinned["objectives"].items():
        for key, value in values.items():
            assert found[name][key] == pytest.approx(value, rel=1e-4)


def test_the_surface_of_the_weighted_sum_is_the_weighted_sum_of_the_surfaces(study):
    coefficients = summary(study)["coefficients"]
    for weights in ((0.2, 0.7, 0.1), (0.1, 0.7, 0.2)):
        text = " + ".join(f"{w}*{name}" for w, name in zip(weights, RESPONSES, strict=True))
        parts = np.array([list(coefficients[name].values()) for name in RESPONSES])
        whole = np.array(list(coefficients[text].values()))
        np.testing.assert_allclose(whole, weights @ parts, rtol=1e-9, atol=1e-9 * np.abs(whole).max())


def test_the_optimum_was_flown(study):
    """What is called actual is what the simulator says, asked once more without rsmkit."""
    from sim.reentry import evaluate

    settings = read_settings()
    for search in read(study, "verification.json")["searches"]:
        flown = evaluate(**search["factors"], **settings)
        for name in RESPONSES:
            assert search["responses"][name]["actual"] == pytest.approx(flown[name], rel=1e-12)
        assert search["objective"]["actual"] == pytest.approx(flown[f"objective_{search['name']}"], rel=1e-12)


def read_settings():
    import tomllib

    return tomllib.loads((ROOT / "studies" / "reentry" / "study.toml").read_text())["simulator"]["settings"]


if __name__ == "__main__":
    PINNED.write_text(json.dumps(summary(Path(sys.argv[1])), indent=1) + "\n")
