"""Searches over what varies, beside direct searches of the simulator."""

import numpy as np
import pytest

from rsmkit.runs.how_to_run import HowToRun
from rsmkit.stages.compare import compare_with_direct
from rsmkit.stages.evaluate import evaluate_design
from rsmkit.stages.fit import fit_study
from rsmkit.stages.planning.plan import plan_design
from rsmkit.stages.verify import verify_study
from rsmkit.study.folder import open_study

STUDY = """
[simulator]
run = "varying:run"
[factors]
x = {low = -1, high = 1}
z = {low = -1, high = 1}
[responses]
y = {}
[[search]]
name = "robust"
minimize = "y"
population = 4
generations = 1
polish = false
robust = { deviations = 1, noise = { z = { mean = 0.0, spread = 0.3 } } }
[[search]]
name = "front"
minimize = ["mean_y", "sd_y"]
population = 4
generations = 1
polish = false
service = { nodes = 8 }
[uncertainty]
x = { sd = 0.05 }
"""
SIMULATOR = "def run(x, z):\n    return {'y': (x - 0.5) ** 2 + x * z}\n"


def test_robust_searches_and_those_in_service_are_compared_with_the_simulator(tmp_path):
    (tmp_path / "study.toml").write_text(STUDY)
    (tmp_path / "varying.py").write_text(SIMULATOR)
    folder, one = open_study(tmp_path), HowToRun(jobs=1)
    plan_design(folder)
    evaluate_design(folder, one)
    fit_study(folder)
    verify_study(folder, one)
    robust, front = compare_with_direct(folder, one)
    best = robust.best.optimum
    # mean and deviation of (x - 0.5)^2 + x z over z: three nodes are exact for them
    for x, objective in (
        (robust.surrogate_factors["x"], robust.surrogate_objective),
        (best.factors["x"], best.best.objectives[0]),
    ):
        assert objective == pytest.approx((x - 0.5) ** 2 + 0.3 * abs(x), rel=1e-9)
    assert [row.factor for row in robust.differences] == ["x"]
    assert robust.best.runs == 3 * len(robust.best.objectives)
    assert robust.surrogate_runs == 9 + 3
    # no single run of the design tells a mean and a deviation: the surrogate knows what it verified
    assert front.surrogate_runs == 9 + 8 * len(front.surrogate)
    for own in front.direct[0].optimum.front:
        x, z = own.point
        # x varies with deviation 0.05; the mean of 8 points of a Sobol sequence is right to a tenth of it
        assert own.objectives[0] == pytest.approx((x - 0.5) ** 2 + x * z, abs=0.01 * (1 + abs(2 * x - 1 + z)))
    assert np.isfinite(front.surrogate).all()
