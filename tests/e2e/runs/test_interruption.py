"""Drivers that are interrupted, killed, doubled and starved; each is a process of its own."""

import os
import shlex
import signal
import subprocess
import sys
import time
from contextlib import suppress

import pytest
from runs_driver import (
    DRIVER,
    Driver,
    all_gone,
    begun,
    counts,
    gate,
    gated,
    resume,
    settings,
    wait_until,
    workers_of,
)

from rsmkit.runs.record.journal import Journal


@pytest.mark.slow
def test_interrupting_once_finishes_what_is_running(tmp_path):
    driver = Driver(tmp_path, *gated(tmp_path), simulator="simulators:gated")
    wait_until(lambda: begun(tmp_path) == 2)
    os.killpg(driver.process.pid, signal.SIGINT)  # as a terminal does: driver and workers alike
    driver.wait_for("stopping")
    gate(tmp_path).touch()
    last, code, err = driver.end()
    assert last.startswith("error: stopped with 2 of 12 runs made, all of them recorded.")
    assert (code, err) == (130, "")
    assert len(Journal(tmp_path / "runs.jsonl").load()) == 2
    assert driver.is_gone()
    resume(tmp_path, *gated(tmp_path), simulator="simulators:gated")
    assert set(counts(tmp_path).values()) == {1}


def test_interrupting_twice_stops_at_once(tmp_path):
    driver = Driver(tmp_path, *gated(tmp_path), simulator="simulators:gated")  # the gate stays shut
    wait_until(lambda: begun(tmp_path) == 2)
    driver.process.send_signal(signal.SIGINT)
    driver.wait_for("stopping")
    driver.process.send_signal(signal.SIGINT)
    last, code, err = driver.end()
    assert last.startswith("error: stopped with 0 of 12 runs made")
    assert (code, err) == (130, "")
    assert driver.is_gone()


@pytest.mark.parametrize("number", [signal.SIGTERM, pytest.param(signal.SIGHUP, marks=pytest.mark.slow)])
def test_a_request_to_terminate_is_like_an_interrupt(tmp_path, number):
    # a driver started below nohup rightly ignores a closed terminal: begin as a terminal would
    driver = Driver(
        tmp_path,
        *gated(tmp_path),
        simulator="simulators:gated",
        preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_DFL),
    )
    wait_until(lambda: begun(tmp_path) == 2)
    driver.process.send_signal(number)
    driver.wait_for("stopping")
    gate(tmp_path).touch()
    last, code, err = driver.end()
    assert last.startswith("error: stopped with 2 of 12 runs made")
    assert (code, err) == (130, "")
    assert driver.is_gone()


@pytest.mark.slow
def test_what_a_run_leaves_running_does_not_keep_the_drivers_output_open(tmp_path):
    trouble = ("settings.trouble=leaves_children",)
    driver = Driver(tmp_path, *trouble, simulator="simulators:moody", count=2, jobs=1)
    assert driver.end() == ("end: 2 done, 0 failed", 0, "")
    left = [
        pid for run in Journal(tmp_path / "runs.jsonl").load().values() for pid in run.extras.get("left", ())
    ]
    assert len(left) == 3
    assert set(left) <= set(driver.family())  # it is all still there
    for pid in driver.family():
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)


@pytest.mark.slow
def test_a_driver_that_was_stopped_for_a_while_blames_nobody(tmp_path):
    patience = ("timeout_s=6", "patience_s=0.1", "ABSENT_S=0.5")
    driver = Driver(tmp_path, *settings(tmp_path, seconds=0.2), *patience, count=6)
    driver.wait_for("finished")
    driver.process.send_signal(signal.SIGSTOP)
    time.sleep(10.0)  # longer than any run may take: its limit, 2 s to end itself, and the patience
    driver.process.send_signal(signal.SIGCONT)
    assert driver.end() == ("end: 6 done, 0 failed", 0, "")


UNREAD = """
import time
from pathlib import Path
def cantilever(width_mm, height_mm, length_m, load_N):
    while not Path({gone!r}).exists():
        time.sleep(0.005)
    return {{"mass_kg": width_mm, "sag_mm": height_mm, "stress_MPa": width_mm * height_mm}}
"""


@pytest.mark.slow
def test_output_that_nobody_reads_any_more_ends_the_evaluation_quietly(rsmkit, study):
    (study / "simulator.py").write_text(UNREAD.format(gone=str(study / "gone")))
    program = shlex.join([sys.executable, "-m", "rsmkit"])
    command = (
        f"{program} run study 2>&1 | {{ head -1; exec <&-; touch study/gone; }}; echo ${{PIPESTATUS[0]}}"
    )
    done = subprocess.run(
        ["bash", "-c", command], cwd=rsmkit.folder, env=rsmkit.environment, capture_output=True, text=True
    )
    assert done.stdout.splitlines()[1:] == ["1"]
    assert done.stderr == ""
    kept = Journal(study / "runs.jsonl").load()
    assert len(kept) < 14
    assert rsmkit.json("evaluate", "study")["made"] == 14 - len(kept)


@pytest.mark.slow
def test_an_interrupt_while_workers_start_is_quiet(tmp_path):
    driver = Driver(tmp_path, *settings(tmp_path))
    driver.wait_for("planned")
    os.killpg(driver.process.pid, signal.SIGINT)
    last, code, err = driver.end()
    assert last.startswith("error: stopped with")
    assert (code, err) == (130, "")


@pytest.mark.slow
def test_killing_the_driver_loses_nothing_finished_and_leaves_no_worker(tmp_path):
    driver = Driver(tmp_path, *settings(tmp_path))
    driver.wait_for("finished", 4)
    driver.process.kill()
    driver.process.communicate()
    assert driver.is_gone()
    kept = Journal(tmp_path / "runs.jsonl").load()
    assert len(kept) >= 4
    before = counts(tmp_path)
    resume(tmp_path)
    again = counts(tmp_path) - before
    assert sum(again.values()) == 12 - len(kept)


@pytest.mark.slow
def test_killing_the_driver_ends_workers_deep_in_compiled_code(tmp_path):
    trouble = ("settings.trouble=hang_on", f"settings.log={tmp_path / 'log'}")
    driver = Driver(tmp_path, *trouble, simulator="simulators:moody", count=2)
    wait_until(lambda: begun(tmp_path) == 2)
    driver.process.kill()
    driver.process.communicate()
    assert driver.is_gone()


@pytest.mark.slow
def test_killing_a_worker_only_repeats_what_it_took_along(tmp_path):
    driver = Driver(tmp_path, *settings(tmp_path))
    driver.wait_for("finished", 3)
    workers = workers_of(driver)
    assert len(workers) == 2
    os.kill(workers[0], signal.SIGKILL)
    last, code, err = driver.end()
    assert (last, code, err) == ("end: 12 done, 0 failed", 0, "")
    lines = (tmp_path / "runs.jsonl").read_text().splitlines()
    assert len(lines) == len(Journal(tmp_path / "runs.jsonl").load()) == 12


@pytest.fixture
def long_command(tmp_path):
    """An evaluation of an external program that has a child and never ends; the numbers of both."""
    program = DRIVER.parent / "program.py"
    driver = Driver(tmp_path, simulator=f"{{python}} {program} family {tmp_path / 'pids'}", count=1, jobs=1)
    wait_until(lambda: (tmp_path / "pids").exists() and " " in (tmp_path / "pids").read_text())
    return driver, [int(pid) for pid in (tmp_path / "pids").read_text().split()]


@pytest.mark.slow
def test_killing_the_driver_ends_external_programs_and_their_children(long_command):
    driver, pids = long_command
    driver.process.kill()
    driver.process.communicate()
    assert all_gone(pids)


@pytest.mark.slow
def test_interrupting_twice_ends_external_programs_and_their_children(long_command):
    driver, pids = long_command
    driver.process.send_signal(signal.SIGINT)
    driver.wait_for("stopping")
    driver.process.send_signal(signal.SIGINT)
    assert driver.end()[1] == 130
    assert all_gone(pids)


@pytest.mark.slow
def test_killing_a_worker_ends_its_external_program_before_it_is_run_again(long_command, tmp_path):
    driver, pids = long_command
    (tmp_path / "pids").unlink()
    os.kill(workers_of(driver)[0], signal.SIGKILL)
    assert all_gone(pids)
    driver.process.kill()
    driver.process.communicate()


@pytest.mark.slow
def test_a_second_driver_is_refused(tmp_path):
    first = Driver(tmp_path, *gated(tmp_path), simulator="simulators:gated")
    first.wait_for("started")
    last, code, err = Driver(tmp_path, *gated(tmp_path), simulator="simulators:gated").end()
    assert f"error: process {first.process.pid} on " in last
    assert (code, err) == (2, "")
    gate(tmp_path).touch()
    assert first.end()[:2] == ("end: 12 done, 0 failed", 0)


@pytest.mark.slow
def test_a_disk_that_fills_up_keeps_every_whole_line(tmp_path):
    last, code, err = Driver(tmp_path, "largest_file=1500", simulator="simulators:plane").end()
    assert "could be recorded: File too large. Free the disk" in last
    assert (code, err) == (2, "")
    assert (tmp_path / "runs.jsonl").read_bytes().endswith(b"\n")
    kept = len(Journal(tmp_path / "runs.jsonl").load())
    assert 0 < kept < 12
    assert Driver(tmp_path, simulator="simulators:plane").end()[0] == "end: 12 done, 0 failed"


@pytest.mark.slow
def test_a_full_file_system_keeps_every_whole_line(tmp_path):
    mount = ["mount", "-t", "tmpfs", "-o", "size=8k", "none", str(tmp_path)]
    if os.geteuid() or subprocess.run(mount, capture_output=True).returncode:
        pytest.skip("a small file system can be mounted by root only")
    try:
        last, code, err = Driver(tmp_path, simulator="simulators:plane", count=40).end()
        assert "could be recorded: No space left on device. Free the disk" in last
        assert (code, err) == (2, "")
        assert (tmp_path / "runs.jsonl").read_bytes().endswith(b"\n")
        assert 0 < len(Journal(tmp_path / "runs.jsonl").load()) < 40
        subprocess.run(["mount", "-o", "remount,size=1m", str(tmp_path)], check=True)
        assert Driver(tmp_path, simulator="simulators:plane", count=40).end()[0] == "end: 40 done, 0 failed"
    finally:
        subprocess.run(["umount", str(tmp_path)], check=True)


READ_ONLY = """
import os, sys
from rsmkit.errors import RsmkitError
from rsmkit.runs.record.journal import Journal
os.chdir(sys.argv[1])
os.chmod(".", 0o555)
if os.geteuid() == 0:
    os.seteuid(65534)
try:
    with Journal("runs.jsonl"):
        pass
except RsmkitError as error:
    print(error)
"""


def test_a_read_only_folder_is_one_clear_message(tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", READ_ONLY, str(tmp_path)],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )
    tmp_path.chmod(0o755)
    assert done.stdout.startswith("runs.jsonl.lock: cannot be written: Permission denied")
    assert done.stderr == ""
