"""What happens inside a worker process: one run after the other, each with a clock and a safety net.

Workers import as little as possible, leave Ctrl-C to their driver, and die with it.
"""

from __future__ import annotations

import ctypes
import faulthandler
import os
import signal
import socket
import sys
import tempfile
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from types import FrameType
from typing import Any, NamedTuple

from rsmkit.runs.run import Run, Status, Value
from rsmkit.runs.simulator import OutputError, Simulator, read_output

__all__ = ["Outcome", "Task", "hard_limit_s", "run_tasks", "start_worker"]

GRACE_S = 2.0
WATCH_INTERVAL_S = 0.5
OUTPUT_KEPT_BYTES = 20_000
ERROR_KEPT_CHARACTERS = 500
_PR_SET_PDEATHSIG = 1

_capture: int | None = None
_loaded: dict[tuple[str, str], Callable[..., Any]] = {}


class Task(NamedTuple):
    """A run to be made."""

    key: str
    factors: dict[str, Value]
    replicate: int = 0
    attempt: int = 1


class Outcome(NamedTuple):
    """A run that was made, with the details that do not belong in the journal."""

    run: Run
    traceback: str = ""
    output: str = ""


class TimeLimit(BaseException):
    """Raised inside a run that takes too long; not an Exception, so that simulators rarely swallow it."""


def start_worker(driver_pid: int, capture: str = "") -> None:
    """Prepare a fresh worker process.

    Parameters
    ----------
    driver_pid : int
        The process to die with.
    capture : str
        File that receives whatever the simulator prints, complete even after a crash. By default an anonymous
        one, from which the output of failed runs is taken.
    """
    global _capture
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT, signal.SIGTERM})
    if sys.platform == "linux":
        # The kernel reaches even a worker that is deep in compiled code, where no Python thread gets a turn.
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    threading.Thread(target=_die_with, args=(driver_pid,), daemon=True).start()

    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    with open(capture, "w+b") if capture else tempfile.TemporaryFile() as file:
        _capture = os.dup(file.fileno())
    os.dup2(_capture, 1)
    os.dup2(_capture, 2)
    faulthandler.enable()


def _die_with(driver_pid: int) -> None:
    while os.getppid() == driver_pid:
        time.sleep(WATCH_INTERVAL_S)
    os._exit(1)


def run_tasks(simulator: Simulator, tasks: Sequence[Task], names: tuple[str, ...]) -> list[Outcome]:
    """Make the runs in order; each gets an outcome, whatever the simulator does to it.

    Parameters
    ----------
    simulator : Simulator
        What to run.
    tasks : sequence of Task
        The runs.
    names : tuple of str
        Responses asked for.

    Raises
    ------
    SimulatorError
        If the simulator cannot be loaded, which no single run is to blame for.
    """
    place = (simulator.identity, str(simulator.folder))
    if place not in _loaded:
        _loaded[place] = simulator.load()
    limit = hard_limit_s(simulator, len(tasks)) if _capture is not None else None
    if limit is not None:
        # Ends the process from a thread that needs no interpreter, should the simulator never return to
        # Python.
        faulthandler.dump_traceback_later(limit, exit=True)
    try:
        return [_run_task(_loaded[place], simulator, task, names) for task in tasks]
    finally:
        if limit is not None:
            faulthandler.cancel_dump_traceback_later()


def hard_limit_s(simulator: Simulator, count: int) -> float | None:
    """Time after which a process that makes `count` runs is ended, in seconds; None without a limit."""
    limit = simulator.options.timeout_s
    return None if limit is None else count * limit + GRACE_S


def _run_task(call: Callable[..., Any], simulator: Simulator, task: Task, names: tuple[str, ...]) -> Outcome:
    responses: dict[str, float] = {}
    extras: dict[str, Any] = {}
    status: Status = "done"
    error = trace = ""
    limit = simulator.options.timeout_s
    _forget_output()
    started = datetime.now(UTC).isoformat(timespec="seconds")
    begin = time.perf_counter()
    try:
        with _time_limit(limit):
            returned = call(**task.factors, **simulator.options.settings)
        responses, extras = read_output(returned, names)
    except TimeLimit as reason:
        status, error = "timeout", f"stopped after timeout_s = {limit:g} s"
        trace = _trace(reason)
    except OutputError as reason:
        status, error, extras = "failed", _one_line(str(reason)), reason.extras
    except BaseException as reason:
        status, error, trace = "failed", _one_line(_describe(reason)), _trace(reason)
    seconds = time.perf_counter() - begin
    run = Run(
        key=task.key,
        simulator=simulator.identity,
        settings=simulator.options.settings,
        factors=task.factors,
        replicate=task.replicate,
        status=status,
        responses=responses,
        extras=extras,
        seconds=round(seconds, 6),
        attempt=task.attempt,
        error=error,
        host=socket.gethostname(),
        started=started,
    )
    return Outcome(run) if status == "done" else Outcome(run, trace, _recent_output())


@contextmanager
def _time_limit(seconds: float | None) -> Iterator[None]:
    if seconds is None or threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(number: int, frame: FrameType | None) -> None:
        raise TimeLimit

    previous = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, previous)


def _describe(error: BaseException) -> str:
    name = type(error).__name__
    try:
        text = str(error)
    except Exception:
        text = ""
    return f"{name}: {text}" if text else name


def _one_line(text: str) -> str:
    line = " ".join(text.split())
    return line if len(line) <= ERROR_KEPT_CHARACTERS else line[: ERROR_KEPT_CHARACTERS - 3] + "..."


def _trace(error: BaseException) -> str:
    """Format the traceback without rsmkit's own frame."""
    inner = error.__traceback__.tb_next if error.__traceback__ else None
    try:
        return "".join(traceback.format_exception(type(error), error, inner))
    except Exception:
        return type(error).__name__


def _forget_output() -> None:
    if _capture is not None:
        os.ftruncate(_capture, 0)
        os.lseek(_capture, 0, os.SEEK_SET)


def _recent_output() -> str:
    if _capture is None:
        return ""
    sys.stdout.flush()
    sys.stderr.flush()
    end = os.fstat(_capture).st_size
    kept = os.pread(_capture, OUTPUT_KEPT_BYTES, max(0, end - OUTPUT_KEPT_BYTES))
    return kept.decode(errors="replace")
