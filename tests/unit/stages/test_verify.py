"""Verification of studies whose simulator fails, repeats with noise, or leaves nothing feasible."""

import json

import pytest
from click.testing import CliRunner
from command_line import runner

from rsmkit.cli.commands import main
from rsmkit.runs.how_to_run import HowToRun
from rsmkit.stages.evaluate import evaluate_design
from rsmkit.stages.fit import fit_study
from rsmkit.stages.planning.plan import plan_design
from rsmkit.stages.verify import verify_study
from rsmkit.study.folder import open_study
from rsmkit.verification.judge import RefinedVerdict

STUDY = """
[simulator]
run = "{module}:run"
{simulator}
[factors]
x = {{low = -1, high = 1}}
z = {{low = -1, high = 1}}
[responses]
y = {{}}
[design]
star = "faced"
center = {center}
"""
BOWL = "5 + (x - 0.2) ** 2 + (z + 0.3) ** 2"
ONE = HowToRun(jobs=1)


def study(folder, body, searches, *, simulator="", center=1):
    """A study in `folder`, whose simulator has the name of the folder, up to its fit."""
    module = f"{folder.name.replace('-', '_')}_simulator"
    (folder / f"{module}.py").write_text(body)
    text = STUDY.format(module=module, simulator=simulator, center=center)
    (folder / "study.toml").write_text(text + "".join(f"[[search]]\n{search}\n" for search in searches))
    made = open_study(folder)
    plan_design(made)
    evaluate_design(made, ONE)
    fit_study(made)
    return made


FAILS_INSIDE = f"""
def run(x, z):
    if 0.1 < x < 0.3 and z < 0:
        raise ValueError("no convergence")
    return {{"y": {BOWL}}}
"""
TWO = ('name = "fails"\nminimize = "y"', 'name = "goes"\nminimize = "y"\nsubject_to = ["x <= 0"]')


def lines(folder):
    return (folder.path / "runs.jsonl").read_text().count("\n")


def test_a_failed_run_at_one_optimum_leaves_the_other_its_verdict(tmp_path):
    folder = study(tmp_path, FAILS_INSIDE, TWO)
    result = verify_study(folder, ONE)
    fails, goes = result.verification.searches
    assert (fails.verdict, goes.verdict) == ("FAILED", "CONFIRMED")
    assert "no convergence" in fails.sentence
    assert fails.best_known.source == "design run"
    assert fails.next_step == f"rsmkit verify {tmp_path} --refine"
    assert result.exit_code() == 3
    assert result.exit_code({"fails": RefinedVerdict("SETTLED", "")}) == 0
    assert result.exit_code({"fails": RefinedVerdict("NOT SETTLED", "")}) == 5


def test_a_failed_run_is_repeated_only_when_asked_for(tmp_path):
    folder = study(tmp_path, FAILS_INSIDE, TWO)
    verify_study(folder, ONE)
    made = lines(folder)
    assert verify_study(open_study(tmp_path), ONE).fresh
    (tmp_path / "verification.json").unlink()
    assert not verify_study(open_study(tmp_path), ONE).fresh
    assert lines(folder) == made
    again = verify_study(open_study(tmp_path), HowToRun(jobs=1, retry_failed=True))
    assert not again.fresh
    assert lines(folder) == made + 1
    assert verify_study(open_study(tmp_path), ONE, force=True).exit_code() == 3
    assert lines(folder) == made + 2


def test_the_command_line_shows_a_failed_optimum_and_exits_3(tmp_path):
    folder = study(tmp_path, FAILS_INSIDE, TWO)
    done = CliRunner().invoke(main, ["verify", str(folder.path), "-j", "1"])
    assert done.exit_code == 3, done.output
    assert (
        "FAILED: the simulator fails at the predicted optimum (failed: ValueError: no convergence"
        in done.output
    )
    assert "Best known: 5." in done.output
    assert f"Next: rsmkit verify {tmp_path} --refine" in done.output
    assert "CONFIRMED: predicted 5.04" in done.output  # 5 + 0.2^2 at x = 0
    page = (tmp_path / "explorer.html").read_text()
    assert '<span class="tag">FAILED</span>' in page
    assert "<td>failed</td>" in page
    shown = CliRunner().invoke(main, ["status", str(tmp_path)])
    assert "fails: FAILED; goes: CONFIRMED" in shown.output
    assert CliRunner().invoke(main, ["run", str(tmp_path), "-j", "1"]).exit_code == 3


def test_where_nothing_is_feasible_fit_warns_and_verify_says_how_it_stands(tmp_path):
    searches = (
        'minimize = "y"\nsubject_to = ["y <= 4"]',
        'name = "front"\nminimize = ["y", "x"]\nsubject_to = ["y <= 4"]',
    )
    folder = study(tmp_path, f"def run(x, z):\n    return {{'y': {BOWL}}}\n", searches)
    done = runner().invoke(main, ["fit", str(tmp_path), "--json"])
    assert done.exit_code == 0, done.output
    document = json.loads(done.stdout)
    told = "no point of the surfaces satisfies every constraint; the nearest misses 'y <= 4' by 1"
    assert [told in warning for warning in document["warnings"]] == [True, True]
    assert [search["missed"] for search in document["searches"]] == [{"y <= 4": pytest.approx(1.0)}] * 2
    result = verify_study(folder, ONE)
    one, front = result.verification.searches
    assert (one.verdict, front.verdict) == ("INFEASIBLE", "INFEASIBLE")
    assert one.factors == {"x": pytest.approx(0.2, abs=1e-6), "z": pytest.approx(-0.3, abs=1e-6)}
    assert one.best_known.source == "verified optimum"
    assert one.best_known.missed == {"y <= 4": pytest.approx(1.0)}
    assert result.exit_code() == 5


NOISY = f"""
import random
def run(x, z, seed):
    return {{"y": {BOWL} + 0.05 * random.Random(seed).gauss(0, 1)}}
"""
BY_CHANCE = "deterministic = false\nseed = 'seed'"


def test_a_simulator_that_repeats_with_noise_is_run_four_times_at_the_optimum(tmp_path):
    folder = study(
        tmp_path, NOISY, ('minimize = "y"', 'name = "same"\nminimize = "y"'), simulator=BY_CHANCE, center=3
    )
    before = lines(folder)
    result = verify_study(folder, ONE)
    one, same = result.verification.searches
    assert lines(folder) == before + 4  # both searches end at one point
    assert (one.replicates, same.replicates) == (4, 4)
    assert result.verification.simulator_runs.verification == 4
    assert one.objective.margin_of_error > 0


def test_replicates_are_those_of_the_study_file(tmp_path):
    folder = study(
        tmp_path, NOISY, ('minimize = "y"\n[verify]\nreplicates = 6',), simulator=BY_CHANCE, center=3
    )
    assert verify_study(folder, ONE).verification.searches[0].replicates == 6


def test_a_deterministic_simulator_is_run_once(tmp_path):
    body = f"def run(x, z):\n    return {{'y': {BOWL}}}\n"
    folder = study(tmp_path, body, ('minimize = "y"\n[verify]\nreplicates = 6',))
    (found,) = verify_study(folder, ONE).verification.searches
    assert found.replicates == 1
    assert found.objective.margin_of_error is None
    assert (
        found.next_step == f"rsmkit verify {tmp_path} --refine, to see whether anything better lies elsewhere"
    )


def test_a_robust_search_whose_node_fails_is_failed(tmp_path):
    trouble = "if z > 0.4 and 0 < x < 0.5:\n        raise ValueError('stalls')"
    body = f"def run(x, z):\n    {trouble}\n    return {{'y': {BOWL}}}\n"
    search = 'minimize = "y"\nrobust = { noise = { z = { mean = 0.0, spread = 0.3 } } }'
    folder = study(tmp_path, body, (search,))
    (found,) = verify_study(folder, ONE).verification.searches
    assert found.verdict == "FAILED"
    assert "stalls" in found.sentence
    assert "--refine" in found.next_step
