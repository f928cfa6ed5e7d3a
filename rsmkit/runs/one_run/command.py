"""Runs by an external program: each in its own folder, without a shell, ended with all its children."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from rsmkit.io.files.regular_files import open_regular, read_regular
from rsmkit.io.files.system_calls import KILL, end_tree
from rsmkit.io.tables.csv_tables import LARGEST_FILE_BYTES
from rsmkit.runs.one_run.command_template import fill, placeholders
from rsmkit.runs.one_run.output_limit import drop_beginning
from rsmkit.runs.one_run.picking import STDOUT_FILE, pick_outputs
from rsmkit.runs.one_run.simulator import Simulator, SimulatorError
from rsmkit.runs.one_run.time_limits import TimeLimit, time_limit
from rsmkit.runs.record.run import Status, Value

__all__ = ["CommandError", "check_command", "end_command", "end_own_commands", "refuse_unused", "run_command"]

STDERR_FILE = "stderr.txt"
PROCESS_FILE = "process.txt"
MARK = "RSMKIT_RUN"
LOOK_S = 0.2
PATIENCE_S = 1.0
PICKING_S = 60.0
STDERR_READ_BYTES = 20_000

_running: set[int] = set()


class CommandError(Exception):
    """The program did not come to a good end; ``status`` says which kind of end it was."""

    def __init__(self, status: Status, message: str) -> None:
        super().__init__(message)
        self.status: Status = status


def check_command(simulator: Simulator) -> None:
    """Make sure that the program and the templates are there.

    Raises
    ------
    SimulatorError
        Naming what is missing and where it was looked for.
    """
    word = simulator.options.words[0]
    program = _program(simulator, word)
    if "{" not in word and shutil.which(program, path=_environment(simulator)["PATH"]) is None:
        where = program if os.sep in word else "the search path; write ./name for one beside the study file"
        raise SimulatorError(f"simulator: no program {word} that can be executed (looked in {where})")
    simulator.templates()


def refuse_unused(simulator: Simulator, factors: Iterable[str]) -> None:
    """Make sure that the program of a command receives every factor; a callable refuses what it cannot take.

    Raises
    ------
    SimulatorError
        Naming the factors that stand neither in the command nor in a template of its inputs.
    """
    if not simulator.options.command:
        return
    texts = [*simulator.options.words, *simulator.templates().values()]
    used = {name for text in texts for name in placeholders(text)}
    unused = [name for name in factors if name not in used]
    if unused:
        raise SimulatorError(
            f"simulator: the program never receives {', '.join(unused)}: neither command nor inputs have "
            f"{{{unused[0]}}}. Write that where the number belongs, or make it no factor"
        )


def run_command(simulator: Simulator, key: str, values: Mapping[str, Value]) -> Mapping[str, Any]:
    """Run the program once and read its results.

    Parameters
    ----------
    simulator : Simulator
        What to run.
    key : str
        The run's key; its folder is ``runs/<key>`` beside the study file.
    values : mapping
        Placeholders: factors, settings, ``replicate`` and ``seed``.

    Raises
    ------
    CommandError
        If it fails, dies or takes too long; its output stays in ``stdout.txt`` and ``stderr.txt``.
    OutputError
        If its results cannot be read.
    """
    options, home = simulator.options, simulator.folder.resolve()
    folder = home / "runs" / key
    if folder.parent.is_symlink():
        raise SimulatorError(
            f"{folder.parent} is a link, and links are not followed; put a folder in its place"
        )
    end_command(folder)
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    known = {
        **options.settings,
        **values,
        "study": str(home),
        "folder": str(folder),
        "python": sys.executable,
    }
    for name, template in simulator.templates().items():
        target = folder / name
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(fill(template, known, options.inputs[name]), encoding="utf-8")
    words = [fill(word, known, "command") for word in options.words]
    words[0] = _program(simulator, words[0])
    with open(folder / STDOUT_FILE, "wb") as out, open(folder / STDERR_FILE, "wb") as err:
        try:
            process = subprocess.Popen(
                words,
                cwd=folder,
                env={**_environment(simulator), MARK: str(folder)},
                stdin=subprocess.DEVNULL,
                stdout=out,
                stderr=err,
                start_new_session=True,
            )
        except OSError as error:
            raise CommandError("failed", f"{words[0]} cannot be started: {error.strerror}") from None
    _running.add(process.pid)
    (folder / PROCESS_FILE).write_text(f"{process.pid} {_birth(process.pid)}")
    try:
        code = _wait(process, options.timeout_s, folder)
    except subprocess.TimeoutExpired:
        _end_group(process)
        _end_strays(folder)
        raise CommandError("timeout", f"stopped after timeout_s = {options.timeout_s:g} s") from None
    finally:
        _running.discard(process.pid)
        (folder / PROCESS_FILE).unlink(missing_ok=True)
    if code < 0:
        raise CommandError(
            "crashed", f"{options.words[0]} died ({_signal_name(-code)})" + _last_words(folder)
        )
    if code not in options.success_codes:
        raise CommandError("failed", f"{options.words[0]} ended with exit code {code}" + _last_words(folder))
    try:
        with time_limit(PICKING_S):  # a pattern can take for ever
            results = pick_outputs(options, folder)
    except TimeLimit:
        raise CommandError("failed", f"its outputs could not be picked within {PICKING_S:g} s") from None
    if not options.keep_folders:
        shutil.rmtree(folder, ignore_errors=True)
    return results


def _wait(process: subprocess.Popen[bytes], limit_s: float | None, folder: Path) -> int:
    """Wait for the end; of what it prints only the end is kept once there is more than can be read."""
    deadline = None if limit_s is None else time.monotonic() + limit_s
    while True:
        left = LOOK_S if deadline is None else min(LOOK_S, deadline - time.monotonic())
        try:
            return process.wait(max(left, 0.0))
        except subprocess.TimeoutExpired:
            if deadline is not None and time.monotonic() >= deadline:
                raise
        for name in (STDOUT_FILE, STDERR_FILE):
            with suppress(OSError), open(open_regular(folder / name, os.O_RDWR), "rb") as stream:
                drop_beginning(stream.fileno(), LARGEST_FILE_BYTES)


def end_command(folder: Path) -> None:
    """Kill the program (and its children) that a dead worker left running in `folder`, if there is one."""
    with suppress(OSError, ValueError):
        pid, birth = read_regular(folder / PROCESS_FILE, 100).decode().split()
        if birth == _birth(int(pid)) != "unknown":
            end_tree(int(pid))
        _end_strays(folder)


def end_own_commands() -> None:
    """Kill the programs that this process is running."""
    for pid in tuple(_running):
        with suppress(OSError):
            end_tree(pid)


def _end_group(process: subprocess.Popen[bytes]) -> None:
    with suppress(ProcessLookupError):
        end_tree(process.pid, at_once=False)
        with suppress(subprocess.TimeoutExpired):
            process.wait(PATIENCE_S)
        end_tree(process.pid)
    process.wait()


def _end_strays(folder: Path) -> None:
    """Kill what left the program's process group (a daemon): its environment still names the run."""
    mark = f"{MARK}={folder}".encode()
    for entry in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            if mark in (entry / "environ").read_bytes().split(b"\0"):
                os.kill(int(entry.name), KILL)


def _birth(pid: int) -> str:
    """Tell a process from a later one with the same number, by its start time in clock ticks since boot."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[19]
    except OSError:
        return "unknown"


def _program(simulator: Simulator, word: str) -> str:
    return str(simulator.folder.resolve() / word) if os.sep in word else word


def _environment(simulator: Simulator) -> dict[str, str]:
    return {"PATH": os.defpath, **os.environ, **simulator.options.environment}


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:  # a real-time signal
        return f"signal {number}"


def _last_words(folder: Path) -> str:
    """Give the last line of stderr, unless the program did away with it."""
    lines = []
    with suppress(OSError), open(open_regular(folder / STDERR_FILE), "rb") as stream:
        stream.seek(max(0, os.fstat(stream.fileno()).st_size - STDERR_READ_BYTES))
        lines = stream.read(STDERR_READ_BYTES).decode(errors="replace").split("\n")
    said = next((line.strip() for line in reversed(lines) if line.strip()), "")
    return f": {said[:200]}" if said else ""
