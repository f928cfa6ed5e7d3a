"""Drivers in processes of their own, and what can be done to them; shared by several tests."""

import os
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path
from uuid import uuid4

from rsmkit.runs.record.journal import Journal

DRIVER = Path(__file__).parents[1] / "data" / "runs" / "driver.py"
# Only against waiting for ever: a busy machine may take its time. What must not end by itself takes longer.
PATIENCE_S = 240.0


class Driver:
    """An evaluation under way in another process, in a process group of its own.

    All processes it starts are known by a mark in their environment.
    """

    def __init__(self, folder, *arguments, simulator="simulators:logged", count=12, jobs=2, **options):
        command = [sys.executable, str(DRIVER), str(folder), simulator, str(count), str(jobs), *arguments]
        self.mark = f"{uuid4()}"
        self.process = subprocess.Popen(
            command,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "RSMKIT_TEST_DRIVER": self.mark},
            start_new_session=True,
            **options,
        )

    def wait_for(self, kind, times=1):
        """Read events until `kind` has come up so often."""
        while times:
            line = self.process.stdout.readline()
            assert line, f"driver ended before {kind}: {self.process.communicate()}"
            times -= line.startswith(kind)

    def end(self):
        """Wait; give the last line, the exit code and what was written to standard error."""
        out, err = self.process.communicate(timeout=PATIENCE_S)
        return (out.splitlines() or [""])[-1], self.process.returncode, err

    def family(self):
        """Every process of this driver that there is."""
        mark = f"RSMKIT_TEST_DRIVER={self.mark}".encode()
        return [int(pid) for pid in os.listdir("/proc") if mark in environment(pid)]

    def is_gone(self):
        """Whether this driver and every process it started end."""
        return all_gone(self.family())


def settings(folder, seconds=0.15):
    return (f"settings.log={folder / 'log'}", f"settings.seconds={seconds}")


def gate(folder):
    """The file that runs of ``simulators:gated`` wait for."""
    return folder / "gate"


def gated(folder, free=0.0):
    """Settings of runs that end when they are let through; those below a = `free` at once."""
    return (f"settings.log={folder / 'log'}", f"settings.gate={gate(folder)}", f"settings.free={free}")


def wait_until(condition):
    """Wait for something that another process does."""
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.005)


def begun(folder):
    """How many runs have begun, by the simulator's own account."""
    return (folder / "log").read_text().count("start") if (folder / "log").exists() else 0


def counts(folder):
    """How often each run was started and finished, by the simulator's own account."""
    lines = (folder / "log").read_text().splitlines()
    return Counter(line for line in lines if line.startswith("end"))


def resume(folder, *arguments, count=12, **options):
    last, code, err = Driver(folder, *(arguments or settings(folder)), count=count, **options).end()
    assert (last, code, err) == (f"end: {count} done, 0 failed", 0, "")
    lines = Journal(folder / "runs.jsonl").path.read_text().splitlines()
    assert len(lines) == len(Journal(folder / "runs.jsonl").load()) == count


def children(pid):
    """Processes whose parent is `pid`."""
    return [
        int(entry.name) for entry in Path("/proc").iterdir() if entry.name.isdigit() and parent(entry) == pid
    ]


def parent(entry):
    try:
        return int((entry / "stat").read_text().rpartition(")")[2].split()[1])
    except OSError:
        return None


def all_gone(pids):
    """Wait until all these processes have ended."""
    wait_until(lambda: all(state(pid) in (None, "Z") for pid in pids))
    return True


def state(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return None


def environment(pid):
    try:
        return Path(f"/proc/{pid}/environ").read_bytes().split(b"\0")
    except OSError:
        return []


def command_line(pid):
    try:
        return Path(f"/proc/{pid}/cmdline").read_text()
    except OSError:
        return ""


def workers_of(driver):
    """Worker processes of an evaluation."""
    return [pid for pid in children(driver.process.pid) if "popen_loky" in command_line(pid)]
