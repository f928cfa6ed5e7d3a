"""Refinement of a study whose simulator is run several times at each point."""

import json

import numpy as np
from click.testing import CliRunner
from command_line import runner

from rsmkit.cli import main
from rsmkit.language.space import Space
from rsmkit.optimum.problem import build_problem, joined
from rsmkit.report.paper.blocks import Text
from rsmkit.stages.evaluate import evaluate_design
from rsmkit.stages.fit import fit_study
from rsmkit.stages.hand_in import study_paper
from rsmkit.stages.looks.status import study_status
from rsmkit.stages.planning.plan import plan_design
from rsmkit.stages.refine import _first_spread, refine_study, simulator_problem
from rsmkit.stages.report import write_reports
from rsmkit.stages.verify import verify_study
from rsmkit.study.folder import open_study
from rsmkit.verification.refinement.refinement import Refinement, Result, Wave

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


def study(tmp_path, simulator, searches, factors=("x", "z"), extra=""):
    lines = [
        "[simulator]",
        'run = "model:run"',
        "[factors]",
        *(f"{f} = {{low = -1, high = 1}}" for f in factors),
    ]
    text = "\n".join([*lines, "[responses]", "y = {}", "v = {}", *searches, extra])
    (tmp_path / "study.toml").write_text(text)
    (tmp_path / "model.py").write_text(f"import math\ndef run({', '.join(factors)}):\n{simulator}")
    folder = open_study(tmp_path)
    plan_design(folder)
    evaluate_design(folder)
    fit_study(folder)
    verify_study(folder)
    return folder


def test_every_kind_of_search_is_refined_and_runs_are_shared(tmp_path):
    folder = study(
        tmp_path,
        "    y = (x - 0.3) ** 2 + 0.5 * z ** 2 + 0.1 * math.sin(4 * x)\n"
        "    return {'y': y, 'v': (x + 0.5) ** 2 + (z - 0.2) ** 2}",
        [
            '[[search]]\nname = "least"\nminimize = "y"',
            '[[search]]\nname = "again"\nminimize = "y"',
            '[[search]]\nname = "both"\nminimize = ["y", "v"]',
            '[[search]]\nname = "liked"\n'
            'desirability = { y = { goal = "minimize", low = 0.0, high = 1.0 }, '
            'v = { goal = "minimize", low = 0.0, high = 1.0 } }',
            '[[search]]\nname = "robust"\nminimize = "y"\n'
            "robust = { noise = { z = { mean = 0.0, spread = 0.2 } }, deviations = 1 }",
        ],
        extra="[verify]\npoints = 5\n[verify.refine]\nmax_runs = 6",
    )
    result = refine_study(folder)
    assert list(result.refinements) == ["least", "again", "both", "liked", "robust"]
    assert all(found.runs <= 6 for found in result.refinements.values())
    least, again = result.refinements["least"], result.refinements["again"]
    assert again.start_runs == least.start_runs + least.runs
    assert again.best.objectives[0, 0] <= least.best.objectives[0, 0]
    assert len(result.refinements["both"].result.front) > 5
    assert result.refinements["robust"].best.points[0, 1] == 0.0
    assert folder.refinements() == result.records()
    runs = len(folder.journal.load())
    again = refine_study(open_study(tmp_path))  # as after an interruption
    assert again.records() == result.records()
    assert len(folder.journal.load()) == runs


def test_a_desirability_out_of_reach_is_settled_by_no_refinement(tmp_path):
    folder = study(
        tmp_path,
        "    return {'y': x + z, 'v': 1.0 + x * x}",
        ['[[search]]\ndesirability = { y = { goal = "maximize", low = 5, high = 9 } }'],
        extra="[verify.refine]\nmax_runs = 4",
    )
    result = refine_study(folder)
    (found,) = result.verdicts.values()
    assert found.verdict == "INFEASIBLE"
    assert "y is 2, acceptable above 5 (misses by 3)" in found.sentence
    assert next(iter(result.records().values())).verdict == "INFEASIBLE"


def test_what_may_be_gained_is_measured_by_the_first_runs(tmp_path):
    known = build_problem(Space(x=(0.0, 1.0)), "y", lambda p: {"y": p[:, 0]}, responses=["y"])
    first = known.evaluate(np.array([[0.0], [0.2], [0.8], [1.0], [0.9]]))
    near = known.evaluate(np.full((20, 1), 0.01))
    waves = (Wave(1, near.points, near.objectives[:, 0], 0.1, "", 0.0, 0.0, 0.0, "", 0.0, ()),)
    result = Result(first.rows([0]), joined(first, near), True, 0.0)
    found = Refinement(known.space, ("y",), (), result, 5, waves, "")
    assert _first_spread(found) == 0.8  # the median of all 25 would be 0.01


def test_a_front_is_verified_at_as_many_points_as_asked_for(tmp_path):
    folder = study(
        tmp_path,
        "    return {'y': (x - 0.5) ** 2 + z ** 2, 'v': (x + 0.5) ** 2 + z ** 2}",
        ['[[search]]\nminimize = ["y", "v"]'],
        extra="[verify]\npoints = 7",
    )
    (search,) = folder.verification().searches
    places = np.sort([point.factors["x"] for point in search.points])
    assert len(places) == 7
    assert np.diff(places).max() < 0.3  # spread over -0.5 to 0.5


def test_a_failing_optimum_is_left_for_the_best_that_runs(tmp_path):
    folder = study(
        tmp_path,
        "    if x > 0.4 and z < 0: raise ValueError('no equilibrium')\n"
        "    return {'y': (x - 0.8) ** 2 + (z + 0.3) ** 2, 'v': x}",
        ['[[search]]\nminimize = "y"'],
        extra="[verify.refine]\nmax_runs = 24",
    )
    (found,) = refine_study(folder).refinements.values()
    # the least value that can be run is 0.09, on the edge of the hole at x = 0.8; the other edge has 0.16
    assert found.best.objectives[0, 0] < 0.13
    assert found.record().failed


def test_a_study_can_ask_to_be_refined_whenever_it_is_run(tmp_path):
    body = "    return {'y': math.exp(2 * x) - 3 * x + z ** 4 + z ** 2, 'v': x}"
    asked = "[verify]\nalways_refine = true\n[verify.refine]\nmax_runs = "
    study(tmp_path, body, ['[[search]]\nminimize = "y"'], extra=f"{asked}4")

    def run(command):
        done = runner().invoke(main, [command, str(tmp_path), "--jobs", "1", "--json"])
        document = json.loads(done.stdout)
        return done.exit_code, document, len(open_study(tmp_path).journal.load())

    first, verified, runs = run("verify")
    assert list(verified["refinement"]) == ["optimum"]
    code, again, more = run("run")  # up to date: nothing is refined again
    assert [stage["stage"] for stage in again["stages"]] == ["plan", "evaluate", "fit", "verify"]
    assert (code, more) == (first, runs)
    text = (tmp_path / "study.toml").read_text()
    (tmp_path / "study.toml").write_text(text.replace(f"{asked}4", f"{asked}8"))
    _, onward, more = run("run")  # a larger budget: goes on from what is known
    assert onward["stages"][-1]["stage"] == "refine"
    assert more > runs
    (found,) = onward["stages"][-1]["searches"].values()
    assert found == json.loads((tmp_path / "refinement.json").read_text())["searches"]["optimum"]


def test_page_and_status_say_what_the_refinement_has_settled(tmp_path):
    body = "    return {'y': math.exp(2 * x) - 3 * x + z ** 4 + z ** 2, 'v': x}"
    folder = study(tmp_path, body, ['[[search]]\nminimize = "y"'], extra="[verify.refine]\nmax_runs = 8")
    (before,) = folder.verification().searches
    refined = refine_study(folder)
    write_reports(folder)
    verdict = refined.verdicts["optimum"]
    assert verdict.verdict != before.verdict
    page = (tmp_path / "explorer.html").read_text()
    assert f'<span class="tag">{verdict.verdict}</span>' in page
    assert f"Before: {before.verdict}." in page
    assert "verify --refine" not in page[: page.index("Before:")]
    status = study_status(folder)
    assert status.stages[-1].reason == f"optimum: {verdict.verdict}"
    # one thing to do next, whoever is asked; and the report leads with what is known last
    assert verdict.verdict == "NOT SETTLED"
    assert f"<b>Next:</b> {status.next}." in page
    summary = [block for block in study_paper(folder).blocks if isinstance(block, Text)]
    assert f"Next: {status.next}." in [block.text for block in summary]
    (strong,) = [block.text for block in summary[:3] if block.strong]
    assert f"{verdict.verdict}: {verdict.sentence}" in strong
    terminal = CliRunner().invoke(main, ["verify", str(tmp_path)]).output
    assert f"Next: {status.next}" in " ".join(terminal.split())
    for command in ("check", "evaluate", "fit"):  # each finds that nothing before verify is to do
        terminal = CliRunner().invoke(main, [command, str(tmp_path)]).output
        assert f"Next: {status.next}" in " ".join(terminal.split()), command
    again = verify_study(open_study(tmp_path))
    assert again.fresh
    assert again.refined == refined.verdicts
    assert again.exit_code() == again.exit_code(refined.verdicts)
