"""Debian's chromium, and one finished study shown in it."""

import os
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from browser_page import PATIENCE_MS, patient_page

from rsmkit.design.design import Design
from rsmkit.language.expression import parse_expression
from rsmkit.language.space import Factor, Space
from rsmkit.optimum.options import SearchOptions
from rsmkit.optimum.problem import build_problem
from rsmkit.optimum.search import search_problem
from rsmkit.report.explorer.explorer_page import write_explorer
from rsmkit.report.findings import Findings
from rsmkit.report.replay import Replay
from rsmkit.runs.record.run import Run
from rsmkit.runs.record.run_table import Runs
from rsmkit.surfaces.estimation.coordinates import hull
from rsmkit.surfaces.estimation.fit_data import FitData
from rsmkit.surfaces.fitted_response import FittedResponse
from rsmkit.surfaces.models.gaussian_process import GaussianProcessSurface
from rsmkit.surfaces.polynomial_fit import fit_surface
from rsmkit.verification.judge import judge_optimum
from rsmkit.verification.refinement.refinement import RefinementRecord, WaveRecord
from rsmkit.verification.verification import SimulatorRuns, Verification

CHROMIUM = Path("/usr/bin/chromium")
FLAGS = (
    "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync",
)  # fmt: skip
MINIMIZE = "0.5*cost + 2*wear"
HOSTILE = '</script><img src=x onerror="document.title=1">'
SCENE = """
function draw(canvas, factors, frame) {
  canvas.dataset.factors = JSON.stringify(factors);
  canvas.dataset.row = JSON.stringify(frame.row);
}
"""


REFINEMENT = RefinementRecord(
    factors={"speed": 12.5, "angle": 1.0, "load": 222.0},
    objective=7.5,
    responses={},
    start_runs=17,
    runs=3,
    reason="no model promises a gain",
    waves=(
        WaveRecord(1, (), (9.0, None), 1.0, "quadratic", None, None, 9.0, "wave 1: 2 runs in the whole box"),
        WaveRecord(2, (), (7.5,), 0.5, "quadratic", 1.5, 1.5, 7.5, "wave 2: 1 run"),
    ),
)


@pytest.fixture(scope="session")
def browser():
    if not CHROMIUM.exists():
        if os.environ.get("RSMKIT_REQUIRE_BROWSER") == "1":
            pytest.fail(f"{CHROMIUM} is missing: apt-get install chromium")
        pytest.skip(f"{CHROMIUM} is missing: apt-get install chromium")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(
            executable_path=str(CHROMIUM), args=list(FLAGS), timeout=PATIENCE_MS
        )
        yield chromium
        chromium.close()


@pytest.fixture(scope="session")
def findings():
    """Three factors, two noisy responses, an optimum, a Pareto front, a constraint on a function."""
    space = Space(
        [
            Factor("speed", 10.0, 30.0, label=f"speed {HOSTILE}", unit="m/s"),
            Factor("angle", -5.0, 5.0, label="angle", unit="deg"),
            Factor("load", 100.0, 400.0, label="load", unit="N"),
        ]
    )
    cube = np.array(list(product([-1.0, 1.0], repeat=3)))
    star = 8**0.25 * np.vstack([np.eye(3), -np.eye(3)])
    points = space.decode(np.vstack([cube, star, np.zeros((3, 3))]))
    design = Design(space, points, ("factorial",) * 8 + ("axial",) * 6 + ("center",) * 3)
    values = simulate(space, design.points)
    noise = np.random.default_rng(7).normal(size=(2, len(design.points)))
    values = {name: y + 0.4 * e for (name, y), e in zip(values.items(), noise, strict=True)}
    made = []
    for i, point in enumerate(design.points):
        responses = {name: float(y[i]) for name, y in values.items()}
        made.append(Run(str(i), "tests", {}, space.values(point), 0, "done", responses, {}, 0.1))
    runs = Runs(space, design.points, tuple(made), ("cost", "wear"))
    surfaces = {
        name: fit_surface(space, runs.points, y, response=name, deterministic=False)
        for name, y in values.items()
    }
    objective = parse_expression(MINIMIZE)(values)
    own = fit_surface(space, runs.points, objective, response=MINIMIZE, deterministic=False)
    functions = {"room": lambda x: 45.0 - x[:, 0] - 2.0 * x[:, 1]}
    problems = {
        name: build_problem(
            space, minimize, lambda x: {n: s.predict(x) for n, s in surfaces.items()},
            responses=("cost", "wear"), subject_to=("room >= 0",), functions=functions,
        )
        for name, minimize in (("cheapest", [MINIMIZE]), ("both", ["cost", "wear"]))
    }  # fmt: skip
    single = search_problem(
        problems["cheapest"],
        SearchOptions(minimize=MINIMIZE, name="cheapest", subject_to=("room >= 0",), seed=1),
    )
    front = search_problem(
        problems["both"],
        SearchOptions(
            minimize=("cost", "wear"), name="both", subject_to=("room >= 0",), method="nsga2", seed=1
        ),
    )
    truth = {name: float(y[0]) for name, y in simulate(space, single.point[None]).items()}
    confirmation = judge_optimum(
        problems["cheapest"], single, [truth], surfaces=surfaces, objective_surfaces={MINIMIZE: own},
        design=problems["cheapest"].evaluation(runs.points, values),
    )  # fmt: skip
    return Findings(
        study_name="Wear & tear <b>study</b>",
        runs=runs,
        surfaces=surfaces,
        objective_surfaces={MINIMIZE: own},
        titles={"cost": "running cost [EUR]", "wear": f"wear {HOSTILE}"},
        design=design,
        optima=(single, front),
        verification=Verification((confirmation,), SimulatorRuns(len(runs), 1)),
        refinements={"cheapest": REFINEMENT},
        functions=functions,
        scene=SCENE,
        replays=(
            Replay("cheapest", single.factors, {"time_s": [0.0, 1.0, 3.0], "height_m": [9.0, 4.0, 0.0]}),
        ),
    )


def simulate(space, points):
    """Two smooth quantities."""
    a, b, c = space.encode(points).T
    return {
        "cost": 50 + 4 * a - 3 * b + 6 * a * a + 2 * b * c + 3 * c * c + 0.4 * a * a * b,
        "wear": 20 - 5 * a + b * b - 2 * c + 1.5 * a * c,
    }


@pytest.fixture(scope="session")
def page_path(findings, tmp_path_factory):
    path = tmp_path_factory.mktemp("explorer") / "explorer.html"
    write_explorer(path, findings)
    return path


@pytest.fixture(scope="session")
def plain_path(findings, tmp_path_factory):
    """The least a study can show: surfaces alone."""
    path = tmp_path_factory.mktemp("plain") / "explorer.html"
    bare = replace(
        findings,
        objective_surfaces={},
        design=None,
        optima=(),
        verification=None,
        refinements={},
        functions={},
        scene="",
        replays=(),
    )
    write_explorer(path, bare)
    return path


@pytest.fixture(scope="session")
def large_path(tmp_path_factory):
    """Ten factors, three Gaussian processes of 300 runs each."""
    space = Space([Factor(f"x{j}", -1.0, 1.0 + j) for j in range(10)])
    rng = np.random.default_rng(8)
    points = rng.uniform(space.lows, space.highs, (300, 10))
    coordinates = hull(space, points)
    surfaces, observed = {}, {}
    for name in ("u", "v", "w"):
        z = space.encode(points)
        observed[name] = z @ rng.normal(size=10) + np.sin(z @ rng.normal(size=10))
        data = FitData(points, observed[name])
        surfaces[name] = FittedResponse(
            GaussianProcessSurface(space, name, coordinates, data, "matern52", np.full(10, 1.5), 1.3, 1e-4)
        )
    values = [{name: float(y[i]) for name, y in observed.items()} for i in range(300)]
    made = tuple(
        Run(str(i), "tests", {}, space.values(point), 0, "done", values[i], {}, 0.1)
        for i, point in enumerate(points)
    )
    path = tmp_path_factory.mktemp("large") / "explorer.html"
    write_explorer(path, Findings("Large", Runs(space, points, made, ("u", "v", "w")), surfaces))
    return path


@pytest.fixture
def open_page(browser):
    """Open pages; at the end nothing may have gone wrong in them, nor may they have asked for anything."""
    pages, problems = [], []

    def opened(path, fragment="", **options):
        page = watched_page(browser, problems, **options)
        pages.append(page)
        page.goto(f"file://{path}{fragment}")
        page.wait_for_selector("html[data-ready]")
        return page

    yield opened
    for page in pages:
        page.context.close()
    assert not problems


@pytest.fixture(scope="session")
def shared_page(browser, page_path):
    problems = []
    page = watched_page(browser, problems)
    page.goto(f"file://{page_path}")
    page.wait_for_selector("html[data-ready]")
    page.evaluate("window.untouched = { ...rsmkit.state }")
    yield page, problems
    page.context.close()


@pytest.fixture
def page(shared_page):
    """The full page in its first state, opened once for all tests."""
    page, problems = shared_page
    page.evaluate("rsmkit.state.set({ ...untouched }); rsmkit.state.flush(); scrollTo(0, 0)")
    yield page
    assert not problems


def watched_page(browser, problems, **options):
    """New page that notes errors and requests."""
    page = patient_page(browser, **options)
    page.on("console", lambda m: problems.append(m.text) if m.type == "error" else None)
    page.on("pageerror", lambda e: problems.append(str(e)))
    local = ("file:", "data:", "blob:")
    page.on("request", lambda r: None if r.url.startswith(local) else problems.append(r.url))
    return page
