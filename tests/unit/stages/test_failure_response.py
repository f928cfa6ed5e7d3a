"""Studies in which a response is the failure of the simulator itself: fitted, searched, verified."""

import numpy as np
import pytest

from rsmkit.cli import main
from rsmkit.errors import StudyError
from rsmkit.stages.fit import fit_study
from rsmkit.stages.refine import simulator_problem
from rsmkit.study.file import load_study
from rsmkit.study.folder import open_study

PUMP = """
[simulator]
run = "pump:head"
[factors]
speed = { low = 0.0, high = 2.0 }
angle = { low = 0.0, high = 1.0 }
[responses]
head_m = {}
cavitates = { distribution = "binomial", failure = true }
[design]
kind = "sobol"
runs = 16
[surface]
terms = ["FO"]
[[search]]
minimize = "-head_m"
subject_to = ["cavitates <= 0.3"]
"""
SIMULATOR = """
def head(speed, angle):
    if speed + angle > LIMIT:
        raise RuntimeError("cavitation")
    return {"head_m": 10 + 6 * speed + 3 * angle}
"""


def rsmkit(capsys, *words):
    with pytest.raises(SystemExit) as end:
        main(list(words))
    out = capsys.readouterr()
    return end.value.code, out.out + out.err


@pytest.fixture
def pump(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "study.toml").write_text(PUMP)
    (tmp_path / "pump.py").write_text(SIMULATOR.replace("LIMIT", "2.0"))
    return tmp_path


def test_failure_is_fitted_searched_and_verified(pump, capsys):
    for stage in ("plan", "evaluate"):  # failures are what the study asks for
        assert rsmkit(capsys, stage, ".", *["-j", "1"] * (stage == "evaluate"))[0] == 0
    folder = open_study(pump)
    result = fit_study(folder)
    runs = folder.design_runs()
    assert runs.failed > 0
    surface = result.responses["cavitates"].surface.surface
    points = np.asarray(runs.runs.points)
    truth = points.sum(axis=1) > 2.0
    assert len(surface.data) == len(points)  # those that failed as well
    assert surface.data.y.sum() == truth.sum() == runs.failed
    assert surface.bias_reduced  # a straight border is one that the runs are separated by
    predicted = surface.predict(points)
    assert predicted[truth].min() > predicted[~truth].max()
    assert len(result.responses["head_m"].surface.surface.data) == len(points) - runs.failed
    (optimum,) = result.optima
    best = np.array(optimum.candidates[0].point)
    assert surface.predict(best[None])[0] == pytest.approx(0.3, abs=1e-6)  # the limit binds

    code, text = rsmkit(capsys, "verify", ".", "-j", "1")
    assert code == 0
    assert "CONFIRMED" in text
    assert "NOT CONFIRMED" not in text
    assert rsmkit(capsys, "status", ".")[0] == 0
    assert open_study(pump).fit_problem() is None

    fly = simulator_problem(open_study(pump), open_study(pump).study.searches[0].name)
    flown = fly.evaluator(np.array([[0.0, 0.0], [2.0, 1.0]]))
    assert flown["cavitates"].tolist() == [0.0, 1.0]
    assert np.isnan(flown["head_m"]).tolist() == [False, True]


def test_a_simulator_that_never_fails_stops_nothing(pump, capsys):
    (pump / "pump.py").write_text(SIMULATOR.replace("LIMIT", "9.0"))
    for stage in ("plan", "evaluate", "fit"):
        assert rsmkit(capsys, stage, ".", *["-j", "1"] * (stage == "evaluate"))[0] == 0
    report = fit_study(open_study(pump)).overview()["surfaces"]["cavitates"]
    assert "not one success in 16 runs" in report["note"]
    # At the middle of the factors about half a failure more than none in 17 runs.
    assert max(report["diagnostics"]["fitted"]) < 0.25


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("head_m = {}\n", "", "name a number that the simulator returns, too"),
        ('distribution = "binomial", ', "", r"cavitates\.failure goes with distribution = 'binomial'"),
        ("failure = true", "failure = true, trials = 4", r"cavitates\.trials is 1 for the failure of a run"),
        ('[simulator]\nrun = "pump:head"\n', "", "there is no simulator that could fail"),
    ],
)
def test_what_does_not_go_with_failure_is_refused(pump, old, new, message):
    file = pump / "study.toml"
    file.write_text(file.read_text().replace(old, new))
    with pytest.raises(StudyError, match=message):
        load_study(pump)
