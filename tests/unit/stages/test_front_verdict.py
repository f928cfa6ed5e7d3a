"""What is said of a front that was refined."""

import numpy as np
import pytest

from rsmkit.language.space import Space
from rsmkit.optimum.problem import build_problem
from rsmkit.stages.refine import _front_verdict
from rsmkit.verification.refinement.refinement import Refinement, Result, Wave

SPACE = Space(x=(0.0, 1.0))


def refined(settled, *, promised=0.03, gain=0.01):
    problem = build_problem(
        SPACE, ["f", "g"], lambda x: {"f": x[:, 0], "g": 1 - x[:, 0]}, responses=["f", "g"]
    )
    known = problem.evaluate(np.array([[0.0], [1.0]]))
    wave = Wave(
        1,
        known.points,
        np.array([0.4, 0.5]),
        1.0,
        "model",
        promised,
        gain,
        0.5,
        "kept",
        promised,
        ("front",) * 2,
    )
    result = Result(known.rows([0]), known, feasible=True, front=known)
    return Refinement(SPACE, ("f", "g"), (), result, 4, (wave,), "the budget is spent", settled)


def test_a_front_that_is_not_settled_says_what_is_missing():
    found = _front_verdict(refined(False), 2)
    assert found.verdict == "NOT SETTLED"
    # 0.01 and 0.03 of a volume of 0.5
    assert "the last wave gained 2 % where 6 % were promised" in found.sentence


@pytest.mark.parametrize(("settled", "promised"), [(True, 0.03), (False, np.nan)])
def test_nothing_is_missing_of_a_settled_front_and_nothing_known_without_a_model(settled, promised):
    found = _front_verdict(refined(settled, promised=promised), 2)
    assert found.verdict == ("SETTLED" if settled else "NOT SETTLED")
    assert found.sentence == "2 true points of the front after 2 more runs; the budget is spent"
