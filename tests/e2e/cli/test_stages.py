"""The four stages through the real command line: what they write, skip, resume and refuse."""

import csv
import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from runs_driver import PATIENCE_S, wait_until

pytestmark = [pytest.mark.slow, pytest.mark.e2e]


def journal(study):
    return [json.loads(line) for line in (study / "runs.jsonl").read_text().splitlines()]


def recorded(study):
    """How many lines the journal has so far."""
    return (study / "runs.jsonl").read_bytes().count(b"\n") if (study / "runs.jsonl").exists() else 0


def done_runs(study):
    return [record for record in journal(study) if record.get("status") == "done"]


def edit(path, old, new):
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


def test_new_and_check(rsmkit):
    rsmkit("new", "study")
    study = rsmkit.folder / "study"
    assert rsmkit.json("status", "study")["next"] == "rsmkit plan"
    assert rsmkit.json("check", "study")["run"]["status"] == "done"
    assert not (study / "runs.jsonl").exists()


def test_run_goes_through_all_stages(finished_once):
    study, document = finished_once
    assert [stage["stage"] for stage in document["stages"]] == ["plan", "evaluate", "fit", "verify"]

    with (study / "design.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == 14
    assert [row["kind"] for row in rows].count("factorial") == 4
    assert [row["kind"] for row in rows].count("axial") == 4

    verification = json.loads((study / "verification.json").read_text())
    (found,) = verification["searches"]
    assert found["name"] == "lightest"
    assert set(found["objective"]) >= {"predicted", "actual", "error_pct"}
    assert set(found["responses"]) == {"mass_kg", "sag_mm", "stress_MPa"}
    for response in found["responses"].values():
        assert set(response) >= {"predicted", "low", "high", "actual", "error_pct"}
        assert response["low"] <= response["predicted"] <= response["high"]
    assert found["simulator_runs"] == verification["simulator_runs"] == {"design": 14, "verification": 1}
    assert len(done_runs(study)) == 15
    assert b"rsmkit.start()" in (study / "explorer.html").read_bytes()


def test_the_optimum_is_the_closed_form_one(finished_once):
    """Mass is width times height, sag goes with 1/(width height^3): the lightest has the least width."""
    study, _ = finished_once
    (found,) = json.loads((study / "verification.json").read_text())["searches"]
    factors = found["factors"]
    assert factors["width_mm"] == pytest.approx(30.0)
    load, length, modulus, sag = 4000.0, 1.5, 210e9, 0.010
    height_mm = 1000 * (4 * load * length**3 / (modulus * sag * 0.030)) ** (1 / 3)
    assert factors["height_mm"] == pytest.approx(height_mm, rel=2e-3)
    # a width-height interaction, so the surface must predict it exactly
    mass = found["responses"]["mass_kg"]
    assert mass["actual"] == pytest.approx(mass["predicted"], rel=1e-9)
    assert mass["actual"] == pytest.approx(7850 * factors["width_mm"] * factors["height_mm"] * 1e-6 * length)


def test_status_of_a_finished_study(rsmkit, finished):
    status = rsmkit.json("status", "study")
    assert [stage["state"] for stage in status["stages"]] == ["fresh"] * 4
    verified = json.loads((finished / "verification.json").read_text())["searches"]
    assert status["next"] == verified[0]["next_step"]  # what verify says


def test_a_second_run_costs_nothing(rsmkit, finished):
    before = (finished / "runs.jsonl").read_bytes()
    document = rsmkit.json("run", "study")
    assert all(stage["skipped"] for stage in document["stages"])
    assert (finished / "runs.jsonl").read_bytes() == before


def test_changed_bounds_make_the_plan_stale_and_keep_every_run(rsmkit, finished):
    before = done_runs(finished)
    edit(finished / "study.toml", "high = 60.0", "high = 62.0")
    refused = rsmkit("evaluate", "study", expect=4)
    assert "width_mm.high changed 60.0 -> 62.0" in refused.stderr
    assert "rsmkit plan" in refused.stderr
    rsmkit("plan", "study")
    rsmkit("evaluate", "study")
    assert done_runs(finished)[: len(before)] == before


def test_a_changed_search_repeats_no_run_of_the_design(rsmkit, finished):
    edit(finished / "study.toml", "sag_mm <= 10", "sag_mm <= 12")
    document = rsmkit.json("run", "study")
    skipped = {stage["stage"]: stage["skipped"] for stage in document["stages"]}
    assert skipped == {"plan": True, "evaluate": True, "fit": False, "verify": False}


def test_explore_writes_the_page_again(rsmkit, finished):
    (finished / "explorer.html").unlink()
    document = rsmkit.json("explore", "study", "--no-open")
    assert document["file"].endswith("explorer.html")
    assert (finished / "explorer.html").exists()


def test_refine_ends_at_the_closed_form_optimum(rsmkit, finished):
    edit(finished / "study.toml", "[verify]", "[verify]\nrefine = { batch = 4, max_runs = 12 }")
    (found,) = rsmkit.json("verify", "study", "--refine")["refinement"].values()
    height_mm = 1000 * (4 * 4000.0 * 1.5**3 / (210e9 * 0.010 * 0.030)) ** (1 / 3)
    assert found["runs"] <= 12
    assert found["objective"] == pytest.approx(7850 * 0.030 * height_mm / 1000 * 1.5, rel=1e-3)
    runs = len(done_runs(finished))
    again = rsmkit("verify", "study", "--refine").stdout
    assert "refined:" in again
    assert "--refine" not in again  # what has just been done is not the next step
    assert len(done_runs(finished)) == runs


def test_stages_in_the_wrong_order_say_which_is_missing(rsmkit, study):
    assert "rsmkit plan" in rsmkit("evaluate", "study", expect=4).stderr
    assert "rsmkit plan" in rsmkit("verify", "study", expect=4).stderr
    rsmkit("plan", "study")
    assert "rsmkit evaluate" in rsmkit("fit", "study", expect=4).stderr
    rsmkit("evaluate", "study")
    assert "rsmkit fit" in rsmkit("verify", "study", expect=4).stderr


def test_the_file_itself_and_the_current_folder_name_a_study(rsmkit, study):
    rsmkit("plan", "study/study.toml")
    rsmkit.folder = study
    assert rsmkit.json("plan")["skipped"]


def test_same_seed_same_numbers(rsmkit, finished):
    first = json.loads((finished / "optimum.json").read_text())
    for name in ("design.csv", "plan.json", "runs.jsonl", "model.json", "optimum.json", "verification.json"):
        (finished / name).unlink()
    rsmkit("run", "study", "--jobs", "1")
    second = json.loads((finished / "optimum.json").read_text())
    assert first["searches"] == second["searches"]


SLOW = """
import time
def slow(width_mm, height_mm, length_m, load_N):
    time.sleep(0.3)
    return {"mass_kg": width_mm, "sag_mm": height_mm, "stress_MPa": width_mm * height_mm}
"""


def test_sigkill_loses_no_finished_run(rsmkit, study):
    (study / "simulator.py").write_text(SLOW)
    edit(study / "study.toml", "simulator:cantilever", "simulator:slow")
    rsmkit("plan", "study")
    process = rsmkit.start("evaluate", "study", "--jobs", "2")
    wait_until(lambda: recorded(study) >= 3)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    kept = done_runs(study)
    assert len(kept) >= 3
    rsmkit("evaluate", "study")
    after = done_runs(study)
    assert after[: len(kept)] == kept
    keys = [record["key"] for record in after]
    assert len(keys) == len(set(keys)) == 14


def test_interrupt_keeps_finished_runs_and_says_how_to_go_on(rsmkit, study):
    (study / "simulator.py").write_text(SLOW)
    edit(study / "study.toml", "simulator:cantilever", "simulator:slow")
    rsmkit("plan", "study")
    process = rsmkit.start("evaluate", "study", "--jobs", "1")
    wait_until(lambda: recorded(study) >= 2)
    process.send_signal(signal.SIGINT)
    assert process.wait(timeout=PATIENCE_S) == 130
    assert len(done_runs(study)) >= 2


FAILING = """
def cantilever(width_mm, height_mm, length_m, load_N):
    at = round(width_mm, 3), round(height_mm, 3)
    {actions}
    return {{"mass_kg": width_mm, "sag_mm": 1.0 / width_mm, "stress_MPa": height_mm / 100}}
"""


def fail_at(study, **actions):
    """Write a simulator that does such things at the points of the plan that have these numbers."""
    with (study / "design.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    lines = []
    for number, action in actions.items():
        row = rows[int(number.removeprefix("run")) - 1]
        at = tuple(round(float(row[name]), 3) for name in ("width_mm", "height_mm"))
        lines.append(f"if at == {at}: {action}")
    (study / "simulator.py").write_text(FAILING.format(actions="\n    ".join(lines)))


def test_failing_runs_are_recorded_and_the_others_finish(rsmkit, study):
    rsmkit("plan", "study")
    fail_at(
        study,
        run1="raise ValueError('the mesh is too coarse')",
        run2="return {'mass_kg': float('nan'), 'sag_mm': 1.0, 'stress_MPa': 2.0}",
        run3="return {'mass_kg': 1.0, 'stress_MPa': 2.0}",
        run4="return {'mass_kg': 1.0, 'sag_mm': 'much', 'stress_MPa': 2.0}",
        run5="return None",
    )
    done = rsmkit("evaluate", "study", expect=3)
    errors = {
        tuple(record["factors"].values()): record["error"]
        for record in journal(study)
        if record["status"] == "failed"
    }
    with (study / "design.csv").open() as stream:
        points = [(float(r["width_mm"]), float(r["height_mm"])) for r in csv.DictReader(stream)]
    words = ("the mesh is too coarse", "mass_kg", "sag_mm", "sag_mm", "mapping")
    assert errors.keys() == set(points[: len(words)])
    for point, word in zip(points, words, strict=False):
        assert word in errors[point]
        assert word in done.stdout + done.stderr
    assert len(done_runs(study)) == 9


def test_a_study_goes_on_without_a_failed_run_and_repeats_only_that(rsmkit, study):
    rsmkit("plan", "study")
    fail_at(study, run1="raise ValueError('no')")
    rsmkit("evaluate", "study", expect=3)
    count = len(journal(study))
    assert rsmkit.json("fit", "study")["runs"] == {"done": 13, "failed": 1}
    rsmkit("evaluate", "study", expect=3)
    assert len(journal(study)) == count
    fail_at(study)
    rsmkit("evaluate", "study", "--retry-failed")
    assert len(done_runs(study)) == 14
    assert len(journal(study)) == count + 1


def test_a_read_only_folder_is_one_message(rsmkit, study):
    if os.geteuid() != 0:
        study.chmod(0o555)
        prefix = ""
    else:
        prefix = f"mount --bind {study} {study} && mount -o remount,ro,bind {study} && "
    command = f"{prefix}{sys.executable} -m rsmkit plan study"
    wrapper = ["unshare", "--mount"] if prefix else []
    done = subprocess.run([*wrapper, "sh", "-c", command], cwd=rsmkit.folder, capture_output=True, text=True)
    if prefix and "unshare" in done.stderr:
        pytest.skip("root without mount namespaces cannot make a folder read-only")
    assert done.returncode == 2, done.stderr
    assert "design.csv: cannot be written" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("old", "new", "code", "message"),
    [
        ("low = 30.0", "low = 90.0", 2, "factors.width_mm: low (90) must be less than high (60)"),
        ("center     = 1", "centre = 1", 2, "unknown key design.centre; did you mean center?"),
        ("simulator:cantilever", "simulater:cantilever", 2, "simulater"),
        ("simulator:cantilever", "simulator:cantilevers", 2, "cantilevers"),
        ("length_m = 1.5", "span_m = 1.5", 3, "span_m"),
        ("sag_mm     =", "sagg_mm     =", 2, "sag_mm"),
        ("mass_kg    =", "mas_kg     =", 2, "mass_kg"),
    ],
)
def test_wrong_studies_get_one_clear_message(rsmkit, study, old, new, code, message):
    edit(study / "study.toml", old, new)
    assert message in rsmkit("check", "study", expect=code).stderr


def test_programs_get_the_same_message(rsmkit, study):
    edit(study / "study.toml", "length_m = 1.5", "span_m = 1.5")
    document = rsmkit.json("check", "study", expect=3)
    assert "span_m" in document["error"]["message"]


def test_a_missing_response_fails_check_with_its_name(rsmkit, study):
    edit(study / "study.toml", "[responses]  ", "[responses]\nlife_h = {}\n#")
    assert "life_h" in rsmkit("check", "study", expect=3).stderr


def test_usage_errors_exit_2(rsmkit):
    assert "No such command" in rsmkit("paln", expect=2).stderr
    assert "no study found" in rsmkit("plan", "nowhere", expect=2).stderr
    assert "rsmkit new" in rsmkit("status", expect=2).stderr


def test_new_never_overwrites(rsmkit, study):
    (study / "study.toml").write_text("mine")
    assert "exists already" in rsmkit("new", "study", expect=2).stderr
    assert (study / "study.toml").read_text() == "mine"


def test_verification_outside_tolerance_exits_5(rsmkit, finished):
    edit(finished / "study.toml", 'minimize   = "mass_kg"', 'minimize   = "stress_MPa + sag_mm"')
    rsmkit("run", "study", expect=5)
    (found,) = json.loads((finished / "verification.json").read_text())["searches"]
    assert found["objective"]["error_pct"] > 2.0
    rsmkit("verify", "study", "--tolerance", "20")


def test_design_matches_the_textbook_circumscribed_design(rsmkit, study):
    edit(study / "study.toml", '"inscribed"', '"circumscribed"')
    rsmkit("plan", "study")
    with (study / "design.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    coded = np.array([[float(r["width_mm_coded"]), float(r["height_mm_coded"])] for r in rows])
    axial = coded[[r["kind"] == "axial" for r in rows]]
    # rotatable: star distance is the fourth root of the number of factorial points
    np.testing.assert_allclose(np.sort(np.abs(axial).max(axis=1)), 4 ** (1 / 4), rtol=1e-12)


LABORATORY = Path(__file__).parents[3] / "studies" / "laboratory"


def test_runs_made_by_hand(rsmkit):
    """The textbook's process: run sheet out, results in, and its published surface comes back."""
    study = rsmkit.folder / "process"
    study.mkdir()
    shutil.copy(LABORATORY / "study.toml", study)
    rsmkit("plan", "process")
    refused = rsmkit("evaluate", "process", expect=4)
    assert "rsmkit sheet" in refused.stderr
    assert rsmkit.json("sheet", "sheet.csv", "process")["rows"] == 13
    assert rsmkit.json("record", str(LABORATORY / "results.csv"), "process")["new"] == 13
    rsmkit("evaluate", "process")
    report = rsmkit.json("fit", "process")["surfaces"]["yield_pct"]
    estimates = {term["name"]: term["estimate"] for term in report["terms"]}
    assert estimates["1"] == pytest.approx(79.94, abs=5e-3)
    assert estimates["time_min^2"] == pytest.approx(-1.376, abs=1e-3)
    assert report["lack_of_fit"]["df"] == [3, 4]
    assert "rsmkit sheet" in rsmkit("verify", "process", expect=4).stderr


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_scripts_are_for_this_command(rsmkit, shell):
    script = rsmkit("completion", shell).stdout
    assert f"_RSMKIT_COMPLETE={shell}_complete" in script


def test_completion_knows_the_commands(rsmkit):
    rsmkit.environment |= {"_RSMKIT_COMPLETE": "bash_complete", "COMP_WORDS": "rsmkit ev", "COMP_CWORD": "1"}
    assert rsmkit().stdout.strip() == "plain,evaluate"
