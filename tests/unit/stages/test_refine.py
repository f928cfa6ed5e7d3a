"""Refinement of a study whose simulator is run several times at each point."""

import numpy as np

from rsmkit.stages.evaluate import evaluate_design
from rsmkit.stages.fit import fit_study
from rsmkit.stages.plan import plan_design
from rsmkit.stages.refine import refine_study, simulator_problem
from rsmkit.stages.verify import verify_study
from rsmkit.study.folder import open_study

STUDY = """
[simulator]
run = "twice:run"
deterministic = false
replicates = 2
[factors]
x = {low = -1, high = 1}
z = {low = -1, high = 1}
[responses]
y = {}
[[search]]
minimize = "y"
[verify.refine]
max_runs = 8
"""
SIMULATOR = """
import itertools
COUNT = itertools.count()
def run(x, z, seed=0):
    return {"y": (x - 0.2) ** 2 + (z + 0.1) ** 2 + (1e-3 if next(COUNT) % 2 else -1e-3)}
"""


def test_replicates_of_a_point_count_as_their_mean(tmp_path):
    (tmp_path / "study.toml").write_text(STUDY)
    (tmp_path / "twice.py").write_text(SIMULATOR)
    folder = open_study(tmp_path)
    plan_design(folder)
    evaluate_design(folder)
    fit_study(folder)
    verify_study(folder)
    points = np.array([[0.5, 0.5], [0.0, 0.0]])
    found = simulator_problem(folder, "optimum").evaluator(points)["y"]
    assert found.shape == (2,)
    np.testing.assert_allclose(found, [0.3**2 + 0.6**2, 0.2**2 + 0.1**2], atol=1.1e-3)
    (refined,) = refine_study(folder).refinements.values()
    assert refined.best.objectives[0, 0] < 0.01
