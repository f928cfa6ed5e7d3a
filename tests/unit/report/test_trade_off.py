"""What the runs say of two objectives: their true values, and which of them no feasible run beats."""

import numpy as np

from rsmkit.language.space import Space
from rsmkit.optimum.optimum import Candidate, Optimum
from rsmkit.report.explorer.page_document import page_document
from rsmkit.report.explorer.trade_off import trade_off
from rsmkit.report.findings import Findings
from rsmkit.runs.record.run import Run
from rsmkit.runs.record.run_table import Runs
from rsmkit.surfaces.polynomial_fit import fit_surface

SPACE = Space(x=(0.0, 3.0))
POINTS = np.array([[0.0], [1.0], [2.0], [3.0]])
VALUES = {"cost": [1.0, 2.0, 3.0, 0.5], "wear": [3.0, 2.0, 2.5, 9.0]}


def findings():
    made = tuple(
        Run(str(i), "s", {}, SPACE.values(p), 0, "done", {k: v[i] for k, v in VALUES.items()}, {}, 0.1)
        for i, p in enumerate(POINTS)
    )
    surfaces = {k: fit_surface(SPACE, POINTS, np.array(v), response=k, order=1) for k, v in VALUES.items()}
    return Findings("s", Runs(SPACE, POINTS, made, ("cost", "wear")), surfaces, failed_points=[[1.5]])


def search(*minimize, subject_to=()):
    best = Candidate(POINTS[0], (1.0,) * len(minimize), {"cost": 1.0, "wear": 3.0}, (1.0,) * len(subject_to))
    return Optimum("best", SPACE, minimize, subject_to, {}, 1, 9, best)


def test_runs_that_no_feasible_run_beats_are_best():
    """(3, 2.5) is beaten by (2, 2); (0.5, 9) breaks wear <= 5; twice the cost is 2, 4, 6, 1."""
    found = trade_off(findings(), search("2*cost", "wear", subject_to=("wear <= 5",)), 1)
    assert found["objectives"] == [[2.0, 3.0], [4.0, 2.0], [6.0, 2.5], [1.0, 9.0]]
    assert found["state"] == ["best", "best", "dominated", "infeasible"]
    assert trade_off(findings(), search("2*cost", "wear"), 2)["state"] == ["best", "dominated"]
    assert trade_off(findings(), search("cost"), 1) is None


def test_failed_runs_are_told_of():
    assert page_document(findings())["failed"] == [{"x": 1.5}]
