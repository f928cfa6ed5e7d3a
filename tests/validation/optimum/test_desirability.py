import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from rsmkit.language.expression import parse_expression
from rsmkit.language.space import Space
from rsmkit.language.terms import full_terms
from rsmkit.optimum.desirability import Desire
from rsmkit.optimum.options import SearchOptions
from rsmkit.optimum.problem import build_problem
from rsmkit.optimum.search import search_problem

DATA = Path(__file__).parents[2] / "data"
TRUTH = json.loads((DATA / "optimum" / "desirability.json").read_text())

TIRE = {
    "y1": Desire("maximize", 120.0, 170.0),
    "y2": Desire("maximize", 1000.0, 1300.0),
    "y3": Desire("target", 400.0, 600.0, target=500.0),
    "y4": Desire("target", 60.0, 75.0, target=67.5),
}
IMPORTANT = {**TIRE, "y1": replace(TIRE["y1"], importance=3.0), "y4": replace(TIRE["y4"], importance=2.0)}
CHEMICAL = {
    "y1": Desire("maximize", 70.0, 80.0),
    "y2": Desire("target", 62.0, 68.0, target=65.0),
    "y3": Desire("minimize", 3200.0, 3400.0),
}
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
    outputs = list(desires)
    terms = full_terms(k, 2)
    matrix = terms.matrix(table[inputs].to_numpy(float))
    fit = np.linalg.lstsq(matrix, table[outputs].to_numpy(float), rcond=None)[0]
    space = Space(**dict.fromkeys(inputs, (-truth["box"], truth["box"])))

    def surfaces(points):
        return dict(zip(outputs, (terms.matrix(points) @ fit).T, strict=True))

    options = SearchOptions(desirability=desires)
    optimum = search_problem(build_problem(space, options.objectives, surfaces, responses=outputs), options)
    assert -optimum.best.objectives[0] == pytest.approx(truth["D"], abs=1e-6)
    assert -optimum.best.objectives[0] <= truth["D"] + 1e-9
    weights = [desire.importance for desire in desires.values()]
    product = np.average(np.log(list(optimum.desirabilities.values())), weights=weights)
    assert np.exp(product) == pytest.approx(truth["D"], abs=1e-6)
    np.testing.assert_allclose(optimum.point, truth["x"], atol=0.02)


def test_individual_desirabilities_at_the_published_optimum():
    truth = TRUTH["derringer_suich_1980"]
    values = dict(zip(TIRE, truth["responses"], strict=True))
    found = [parse_expression(desire.text(name))(values) for name, desire in TIRE.items()]
    np.testing.assert_allclose(found, truth["d"], rtol=1e-9)
