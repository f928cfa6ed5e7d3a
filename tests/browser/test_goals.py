"""The page's own search finds what Python's finds, and its desirabilities are Python's."""

from dataclasses import replace

import numpy as np
import pytest

from rsmkit.language.expression import parse_expression
from rsmkit.optimum.desirability import Desire, desirability
from rsmkit.optimum.options import SearchOptions
from rsmkit.optimum.problem import build_problem
from rsmkit.optimum.search import search_problem
from rsmkit.report.explorer.explorer_page import write_explorer

pytestmark = [pytest.mark.browser, pytest.mark.slow]

WISHES = {
    "ends": {"cost": Desire("minimize", 40.0, 70.0), "wear": Desire("maximize", 10.0, 30.0, weight=1.5)},
    "peak": {
        "cost": Desire("target", 46.0, 60.0, target=50.0, weight=0.7, weight_above=2.0, importance=2.0),
        "wear": Desire("minimize", 14.0, 25.0, importance=3.0),
    },
}
LIMIT = "speed + 2*angle <= 26"
GOALS = {"minimize": "min", "maximize": "max", "target": "target"}
SEARCH = """async () => {
    rsmkit.state.set({ point: rsmkit.data.factors.map(rsmkit.state.centre) });
    rsmkit.data.searches.length = 0;  // the page must not start from the answer
    const found = await rsmkit.optimise.best();
    return [found.isFeasible, found.value, found.point];
}"""


def searched(findings, options):
    def predicted(x):
        return {name: surface.predict(x) for name, surface in findings.surfaces.items()}

    limits = {"responses": ("cost", "wear"), "subject_to": options.subject_to}
    problem = build_problem(findings.space, list(options.objectives), predicted, **limits)
    return search_problem(problem, options)


def test_the_page_finds_the_desirability_that_python_finds(open_page, findings, tmp_path):
    options = SearchOptions(desirability=WISHES["ends"], subject_to=(LIMIT,), preset="fast", seed=1)
    optimum = searched(findings, options)
    path = tmp_path / "explorer.html"
    write_explorer(
        path, replace(findings, optima=(optimum,), verification=None, refinements={}, functions={})
    )
    page = open_page(path)
    points = np.random.default_rng(6).uniform(findings.space.lows, findings.space.highs, (100_000, 3))
    predicted = {n: s.predict(points) for n, s in findings.surfaces.items()}
    for name, wishes in WISHES.items():
        if name != "ends":  # the goals of the study are there from the start
            goals = {key: {**vars(wish), "goal": GOALS[wish.goal]} for key, wish in wishes.items()}
            page.evaluate("(goals) => { rsmkit.state.set({ goals }); rsmkit.state.flush(); }", goals)
        wished = parse_expression(desirability(wishes))
        expected = wished(predicted)
        best = np.argsort(expected)[-30:]
        got = page.evaluate("(points) => points.map(rsmkit.goals.desirability)", points[best].tolist())
        np.testing.assert_allclose(got, expected[best], rtol=1e-12)
        is_feasible, value, point = page.evaluate(SEARCH)
        assert is_feasible
        assert point[0] + 2 * point[1] <= 26 + 1e-8
        there = {n: s.predict(np.array([point])) for n, s in findings.surfaces.items()}
        assert -value == pytest.approx(wished(there)[0], rel=1e-12)
        allowed = points[:, 0] + 2 * points[:, 1] <= 26
        assert -value > expected[allowed].max()
        if name == "ends":
            assert value == pytest.approx(optimum.best.objectives[0], abs=1e-6)


def test_the_page_finds_the_minimum_that_python_finds_on_a_limit(open_page, findings, tmp_path):
    options = SearchOptions(minimize="cost", name="cheap", subject_to=("wear <= 16", LIMIT), seed=1)
    optimum = searched(findings, options)
    path = tmp_path / "explorer.html"
    write_explorer(
        path, replace(findings, optima=(optimum,), verification=None, refinements={}, functions={})
    )
    page = open_page(path)
    is_feasible, value, _ = page.evaluate(SEARCH)
    assert is_feasible
    assert value == pytest.approx(optimum.best.objectives[0], rel=1e-6)
    page.evaluate(
        "rsmkit.data.equalities.push({ text: 'sum', terms: [[0, 1], [2, 0.1]], value: 44 })"
    )  # a sum, as of a mixture, is kept
    mixed = page.evaluate("rsmkit.optimise.best()")
    assert mixed["point"][0] + 0.1 * mixed["point"][2] == pytest.approx(44, abs=1e-7)
    page.evaluate("rsmkit.data.equalities.length = 0; rsmkit.state.set({ point: [10, 0, 250], held: [0] })")
    held = page.evaluate("rsmkit.optimise.best()")
    assert held["point"][0] == 10
