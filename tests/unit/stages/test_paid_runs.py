"""A study that has changed: runs that still mean something stay, and only what is missing is planned."""

import json
import math

import numpy as np
import pytest

from rsmkit.language.space import Space
from rsmkit.runs.record.journal import Journal
from rsmkit.runs.record.meaning import Caller, Meaning, known_runs
from rsmkit.runs.record.run import Run, run_key
from rsmkit.stages.evaluate import evaluation_agenda
from rsmkit.stages.fit import fit_study
from rsmkit.stages.planning.paid_runs import _Records
from rsmkit.stages.planning.plan import plan_design
from rsmkit.study.folder import open_study

STUDY = """
[simulator]
run = "s:f"
{simulator}
[simulator.settings]
{settings}
[factors]
{factors}
[responses]
y = {{}}
{responses}
[design]
{design}
[surface]
order = {order}
"""
TWO = "a = {low = 0.0, high = 1.0}\nb = {low = 0.0, high = 0.36}"
THREE = f"{TWO}\nc = {{low = 0.0, high = 1.0}}"
PLAIN = {
    "simulator": "",
    "settings": "c = 0.5",
    "factors": TWO,
    "responses": "",
    "design": "kind = 'optimal'\nruns = 12\nstarts = 3",
    "order": 2,
}


class Bench:
    """A study whose runs are written into its journal as the simulator would have made them."""

    def __init__(self, path):
        self.path = path
        self.fails = lambda arguments: False

    def study(self, **changes):
        (self.path / "study.toml").write_text(STUDY.format(**PLAIN | changes))
        return open_study(self.path)

    def plan(self, **changes):
        """Plan, as the command does; the runs that would be made."""
        folder = self.study(**changes)
        self.result = plan_design(folder, replace_lost=True)
        return evaluation_agenda(folder).todo

    def run(self, **changes):
        """Plan, and make what is missing; how many runs that took."""
        todo = self.plan(**changes)
        folder = open_study(self.path)
        with Journal(self.path / "runs.jsonl") as journal:
            for task in todo:
                called = {"c": 0.25, **folder.simulator.options.settings, **task.factors}
                bad = self.fails(called)
                values = {"y": called["a"] ** 2 + called["b"] * called["c"]}
                journal.append(
                    Run(
                        task.key,
                        folder.simulator.identity,
                        folder.simulator.options.settings,
                        task.factors,
                        task.replicate,
                        "failed" if bad else "done",
                        {} if bad else values,
                        {} if bad else {"z": called["a"] - called["b"]},
                        0.1,
                        task.attempt,
                        "breaks" if bad else "",
                    )
                )
        return len(todo)

    def design_lost(self):
        return open_study(self.path).standing().failed

    def fitted(self):
        return len(fit_study(open_study(self.path)).runs)

    def stock(self):
        return self.result.overview()["kept"]

    @property
    def design(self):
        return (self.path / "design.csv").read_bytes()


@pytest.fixture
def bench(tmp_path):
    (tmp_path / "s.py").write_text("def f(**all):\n    raise RuntimeError\n")
    return Bench(tmp_path)


def test_an_unchanged_study_keeps_its_design_and_its_plan_to_the_byte(bench):
    assert bench.run() == 12
    before, plan = bench.design, (bench.path / "plan.json").read_bytes()
    plan_design(open_study(bench.path), force=True)
    assert (bench.design, (bench.path / "plan.json").read_bytes()) == (before, plan)
    (bench.path / "design.csv").unlink()
    (bench.path / "plan.json").unlink()
    assert (bench.run(), bench.design) == (0, before)


def test_an_interrupted_study_goes_on_with_the_same_design(bench):
    bench.run()
    before = bench.design
    journal = bench.path / "runs.jsonl"
    journal.write_text("".join(journal.read_text().splitlines(keepends=True)[:5]))
    plan_design(open_study(bench.path), force=True)
    assert bench.design == before
    assert bench.run() == 7


GROWTH = [
    ("kind = 'optimal'\nstarts = 3\nruns = {}", 24, 28),
    ("star = 'inscribed'\ncenter = 1\nstarts = 3\naugment_to = {}", 14, 16),
    ("kind = 'latin-hypercube'\nruns = {}", 12, 15),
    ("kind = 'maximin'\nruns = {}", 9, 10),
]


@pytest.mark.slow
@pytest.mark.parametrize(("design", "few", "many"), GROWTH)
def test_more_runs_cost_the_difference(bench, design, few, many):
    assert bench.run(design=design.format(few)) == few
    assert bench.run(design=design.format(many)) == many - few
    assert bench.fitted() == many
    assert bench.run(design=design.format(few)) == 0, "fewer runs than there are cost nothing"
    assert bench.fitted() == many


@pytest.mark.slow
def test_wider_bounds_cost_the_runs_that_reach_there(bench):
    bench.run()
    wider = TWO.replace("0.36", "0.38")
    assert [0.36 < task.factors["b"] <= 0.38 for task in bench.plan(factors=wider)] == [True]
    assert bench.run(factors=wider) == 1
    assert bench.fitted() == 13
    assert bench.stock() == {"kept": 12, "outside": 0, "failed": 0, "new": 1, "left_out": []}
    many = bench.plan(factors=TWO.replace("0.36", "3.6"))
    assert 3 <= len(many) < 12
    assert max(task.factors["b"] for task in many) == 3.6


def test_runs_outside_narrower_bounds_stay_as_data_and_not_as_design(bench):
    bench.run()
    narrow = TWO.replace("low = 0.0, high = 0.36", "low = 0.1, high = 0.3")
    made = bench.run(factors=narrow)
    stock = bench.stock()
    assert made < 12
    assert stock["outside"] + stock["kept"] == 12
    assert stock["kept"] + made >= 12
    assert bench.result.quality.runs == 12, "the quality is that of the design"
    assert bench.result.design.kinds.count("outside") == stock["outside"]
    assert bench.fitted() == 12 + made
    assert all(0.1 <= task.factors["b"] <= 0.3 for task in evaluation_agenda(open_study(bench.path)).todo)


def test_points_that_a_new_constraint_forbids_are_data(bench):
    bench.run()
    limited = PLAIN["design"] + "\nsubject_to = ['a + b <= 1.0']"
    todo = bench.plan(design=limited)
    assert todo
    assert all(task.factors["a"] + task.factors["b"] <= 1.0 + 1e-9 for task in todo)
    assert bench.stock()["outside"] > 0


@pytest.mark.parametrize(
    "design",
    [
        "kind = 'ccd'\nstar = 'inscribed'\ncenter = 1\naugment_to = 12\nstarts = 3",
        "kind = 'latin-hypercube'\nruns = 12",
        "kind = 'sobol'\nruns = 10",
    ],
)
def test_another_kind_of_design_takes_the_runs_that_are_there(bench, design):
    bench.run()
    assert bench.run(design=design) == 0
    assert bench.fitted() == 12


def test_points_that_the_user_names_are_run_beside_those_that_are_there(bench):
    bench.run()
    (bench.path / "own.csv").write_text("a,b\n0.11,0.12\n0.41,0.22\n")
    assert bench.run(design="kind = 'file'\nfile = 'own.csv'\n") == 2
    assert bench.fitted() == 14


def test_a_setting_that_becomes_a_factor_gives_old_runs_its_value(bench):
    bench.run()
    wider = {"settings": "", "factors": THREE, "design": "kind = 'optimal'\nruns = 18\nstarts = 3"}
    made = bench.run(**wider)
    assert made < 12
    runs = fit_study(open_study(bench.path)).runs
    assert len(runs) == 12 + made
    assert (runs.points[:, 2] == 0.5).sum() >= 12
    surface = fit_study(open_study(bench.path)).responses["y"].surface
    assert surface.predict([[0.3, 0.2, 0.9]])[0] == pytest.approx(0.3**2 + 0.2 * 0.9, abs=1e-9)


@pytest.mark.slow
def test_a_factor_that_is_frozen_keeps_the_runs_at_its_value_and_thaws_with_all(bench):
    wider = {"settings": "", "factors": THREE, "design": "kind = 'optimal'\nruns = 18\nstarts = 3"}
    bench.run()
    bench.run(**wider)
    total = bench.fitted()
    assert bench.run() == 0
    assert bench.fitted() == 12
    (reason,) = bench.stock()["left_out"]
    assert reason == f"{total - 12} finished runs are left out: made at another c than 0.5"
    assert bench.run(settings="c = 0.0") < 12
    assert bench.run(**wider) == 0
    assert bench.fitted() > total, "thawed, all of them count"


def test_a_factor_frozen_at_its_centre_keeps_the_runs_there_to_rounding(bench):
    design = "kind = 'ccd'\nstar = 'faced'\ncenter = 1"
    three = "\n".join([TWO, "c = {low = 0.15, high = 0.3}"])
    bench.run(settings="", factors=three, design=design)
    middle = {row.split(",")[4] for row in bench.design.decode().splitlines()[1:]} - {"0.15", "0.3"}
    assert middle == {"0.22499999999999998"}, "as it is computed"
    bench.plan(settings="c = 0.225", design=design)
    assert bench.stock()["kept"] == 5


def test_what_the_simulator_takes_by_default_can_be_said_afterwards(bench):
    bench.run(settings="")
    wider = {"settings": "", "factors": THREE, "design": "kind = 'optimal'\nruns = 18\nstarts = 3"}
    assert len(bench.plan(**wider)) == 18
    (reason,) = bench.stock()["left_out"]
    assert reason.endswith("made without c, so that nothing says its value")
    bench.plan(settings="")
    assert len(bench.plan(**wider, simulator="defaults = {c = 0.25}")) < 12
    assert bench.plan(settings="c = 0.25", simulator="defaults = {c = 0.25}") == ()


def test_a_response_that_old_runs_returned_besides_needs_no_run(bench):
    bench.run()
    assert bench.run(responses="z = {}") == 0
    assert bench.fitted() == 12
    assert len(bench.plan(responses="q = {}")) == 12
    assert bench.stock()["left_out"] == ["12 finished runs are left out: made without q"]


def test_the_version_decides_whether_a_changed_simulator_keeps_its_runs(bench):
    bench.run()
    assert bench.run(simulator="version = 2") == 12
    assert "now s:f, version 2" in bench.stock()["left_out"][0]
    assert bench.run() == 0
    assert bench.run(simulator="version = 'code'") == 12
    assert bench.run(simulator="version = 'code'") == 0
    (bench.path / "s.py").write_text("def f(**all):\n    raise ValueError\n")
    assert bench.run(simulator="version = 'code'") == 12


def test_a_design_around_runs_is_out_of_date_when_these_mean_nothing_any_more(bench):
    bench.run()
    narrow = TWO.replace("low = 0.0, high = 0.36", "low = 0.1, high = 0.3")
    bench.run(factors=narrow)
    again = bench.plan(factors=narrow, simulator="version = 2")
    assert len(again) == 12
    assert all(0.1 <= task.factors["b"] <= 0.3 for task in again)
    (bench.path / "runs.jsonl").unlink()
    assert all(0.1 <= task.factors["b"] <= 0.3 for task in bench.plan(factors=narrow))


def test_runs_that_verified_are_no_design(bench):
    bench.run()
    lines = (bench.path / "runs.jsonl").read_text().splitlines()
    other = json.loads(lines[0]) | {"key": "0" * 16, "factors": {"a": 0.123, "b": 0.321}}
    with (bench.path / "runs.jsonl").open("a") as stream:
        stream.write(json.dumps(other) + "\n")
    assert bench.run(design="kind = 'optimal'\nruns = 14\nstarts = 3") == 2
    assert bench.fitted() == 14


def test_a_study_may_plan_as_if_nothing_had_been_run(bench):
    bench.run()
    wider = TWO.replace("0.36", "0.38")
    assert len(bench.plan(factors=wider, design=PLAIN["design"] + "\nkeep_runs = false")) > 6


@pytest.mark.slow
def test_lost_points_are_replaced_away_from_where_runs_fail(bench):
    bench.fails = lambda called: called["a"] + called["b"] > 1.2
    assert bench.run() == 12
    lost = 12 - bench.fitted()
    assert lost > 0
    where = [run.factors for run in Journal(bench.path / "runs.jsonl").load().values() if not run.done]
    todo = bench.plan()
    assert len(todo) == lost
    for task in todo:
        assert all(
            math.dist(
                (2 * task.factors["a"], 2 * task.factors["b"] / 0.36), (2 * bad["a"], 2 * bad["b"] / 0.36)
            )
            > 0.19
            for bad in where
        )
    assert bench.plan() == todo, "asked again, the same"
    for _ in range(5):
        bench.run()
    assert bench.fitted() == 12
    fit = fit_study(open_study(bench.path))
    assert fit.failed >= lost, "what failed stays in the record"
    assert bench.plan() == ()


def test_new_points_keep_to_where_runs_should_succeed_not_to_the_edge_of_it(bench):
    bench.fails = lambda called: called["a"] + called["b"] / 0.36 > 1.4
    bench.run(design="kind = 'ccd'\nstar = 'faced'")
    lost = bench.design_lost()
    new = bench.plan(design="kind = 'ccd'\nstar = 'faced'")
    assert len(new) == lost > 0
    assert not any(bench.fails(task.factors) for task in new)


def test_nothing_is_replaced_while_everything_fails(bench):
    bench.fails = lambda called: True
    bench.run()
    before = bench.design
    assert bench.plan() == ()
    assert bench.design == before


def test_noisy_runs_keep_their_repetitions(bench):
    noisy = {"simulator": "deterministic = false", "design": "kind = 'ccd'\ncenter = 3"}
    assert bench.run(**noisy) == 11
    assert bench.run(**noisy | {"design": "kind = 'ccd'\ncenter = 5"}) == 2
    assert bench.fitted() == 13


def test_blocks_of_earlier_runs_stay_and_new_runs_are_one(bench):
    blocked = "kind = 'optimal'\nruns = 12\nblocks = [6, 6]\nstarts = 3"
    bench.run(design=blocked)
    assert bench.run(design="kind = 'optimal'\nruns = 15\nblocks = [6, 6, 3]\nstarts = 3") == 3
    assert bench.result.design.blocks == (1,) * 6 + (2,) * 6 + (3,) * 3


def test_a_category_that_is_gone_takes_its_runs_along_and_a_new_one_costs_its_own(bench):
    kinds = {"design": "kind = 'factorial'\nlevels = {a = 2, b = 2}", "order": 1}
    assert bench.run(factors=f"{TWO}\nd = {{levels = ['x', 'y']}}", **kinds) == 8
    assert bench.run(factors=f"{TWO}\nd = {{levels = ['x', 'y', 'z']}}", **kinds) == 4
    assert bench.run(factors=f"{TWO}\nd = {{levels = ['z', 'y']}}", **kinds) == 0
    assert bench.stock()["left_out"] == [
        "4 finished runs are left out: made at a d that it cannot take any more"
    ]
    assert bench.fitted() == 8


def test_a_point_that_succeeded_once_is_good_though_a_run_called_otherwise_failed_there():
    for fates in ((True, False), (False, True)):
        records = _Records(True, 1)
        for good in fates:
            records.add(np.array([0.5]), 0, good, None)
        assert (records.places(True), records.places(False)) == ([(0.5,)], [])


def called(b, status="done", **given):
    """A run made at a = 0.5 when b was a factor, too."""
    values = {"y": 1.0} if status == "done" else {}
    factors = {"a": 0.5, "b": b, **given}
    return Run(run_key("s:f", {}, factors), "s:f", {}, factors, 0, status, values, {}, 1.0)


def test_a_setting_is_the_same_to_rounding_and_no_further():
    meaning = Meaning(Caller("s:f", {"b": 1.0}, {}, Space(a=(0.0, 1.0))))
    assert meaning.point(called(1.0 + 1e-14)) == [0.5]
    assert meaning.point(called(1.0 + 1e-9)) == "made at another b than 1.0"


def test_a_run_that_failed_under_another_call_does_not_replace_one_that_did_not():
    caller = Caller("s:f", {"b": 1.0}, {"c": 2.0}, Space(a=(0.0, 1.0)))
    good, bad = called(1.0), called(1.0, "failed", c=2.0)
    for runs in ((good, bad), (bad, good)):
        known = known_runs(caller, {run.key: run for run in runs})
        assert known[run_key("s:f", {"b": 1.0}, {"a": 0.5})] is good
