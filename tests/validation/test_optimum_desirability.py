import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from rsmkit.optimum.desirability import Desire, desirability_problem
from rsmkit.optimum.options import SearchOptions
from rsmkit.optimum.problem import build_problem
from rsmkit.optimum.search import search
from rsmkit.space import Space
from rsmkit.terms import full_terms

DATA = Path(__file__).parent.parent / "data"
TRUTH = json.loads((DATA / "optimum" / "desirability.json").read_text())

TIRE = (
    Desire("y1", "maximise", 120.0, 170.0),
    Desire("y2", "maximise", 1000.0, 1300.0),
    Desire("y3", "target", 400.0, 600.0, target=500.0),
    Desire("y4", "target", 60.0, 75.0, target=67.5),
)
IMPORTANT = tuple(
    Desire(d.response, d.goal, d.low, d.high, d.target, importance=weight)
    for d, weight in zip(TIRE, (3.0, 1.0, 1.0, 2.0), strict=True)
)
CHEMICAL = (
    Desire("y1", "maximise", 70.0, 80.0),
    Desire("y2", "target", 62.0, 68.0, target=65.0),
    Desire("y3", "minimise", 3200.0, 3400.0),
)
CASES = {
    "derringer_suich_1980": ("derringer_suich.csv", TIRE),
    "derringer_suich_importance_3_1_1_2": ("derringer_suich.csv", IMPORTANT),
    "montgomery_ccd_max78.5_target65_min3200_3400": ("montgomery_ccd.csv", CHEMICAL),
}


@pytest.mark.parametrize("name", list(CASES))
def test_largest_desirability(name):
    file, desires = CASES[name]
    truth = TRUTH[name]
    table = pd.read_csv(DATA / "surfaces" / file, comment="#")
    k = len(truth["x"])
    inputs = [f"x{j + 1}" for j in range(k)]
    outputs = [desire.response for desire in desires]
    terms = full_terms(k, 2)
    matrix = terms.matrix(table[inputs].to_numpy(float))
    fit = np.linalg.lstsq(matrix, table[outputs].to_numpy(float), rcond=None)[0]
    space = Space(**dict.fromkeys(inputs, (-truth["box"], truth["box"])))

    def surfaces(points):
        return dict(zip(outputs, (terms.matrix(points) @ fit).T, strict=True))

    problem = desirability_problem(build_problem(space, "y1", surfaces, responses=outputs), desires)
    optimum = search(problem, SearchOptions("undesirability"))
    assert 1 - optimum.best.objectives[0] == pytest.approx(truth["D"], abs=1e-6)
    assert 1 - optimum.best.objectives[0] <= truth["D"] + 1e-9
    np.testing.assert_allclose(optimum.point, truth["x"], atol=0.02)


def test_individual_desirabilities_at_the_published_optimum():
    truth = TRUTH["derringer_suich_1980"]
    found = [desire(np.array(y)) for desire, y in zip(TIRE, truth["responses"], strict=True)]
    np.testing.assert_allclose(found, truth["d"], rtol=1e-9)
