"""A worker process: how it starts, how it dies with its driver, its clocks, and what is printed in it.

Workers import as little as possible and leave Ctrl-C to their driver.
"""

from __future__ import annotations

import ctypes
import faulthandler
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from multiprocessing import set_start_method
from types import FrameType
from typing import Any

from rsmkit.io.files.system_calls import append_only, signals, write_at
from rsmkit.runs.one_run.command import end_own_commands
from rsmkit.runs.one_run.interrupts import STOP_SIGNALS
from rsmkit.runs.one_run.output_limit import drop_beginning, last_bytes
from rsmkit.runs.one_run.pristine import os, signal, time

__all__ = [
    "OUTPUT_KEPT_BYTES",
    "PRINTED",
    "clean_slate",
    "end_copy",
    "hard_limit",
    "recent_output",
    "seconds_under_way",
    "start_worker",
    "turn_deaf",
    "under_way",
]

WATCH_INTERVAL_S = 0.5
OUTPUT_KEPT_BYTES = 20_000
PRINTED = ".out"
"""End of the name of a file, beside a worker's notes, that receives what is printed."""
PRINTING_S = 0.05
_PR_SET_PDEATHSIG = 1
_LEFT_TO_DRIVER = (*STOP_SIGNALS, *signals("SIGTSTP"))
_HAS_MASKS = hasattr(signal, "pthread_sigmask")

_capture: int | None = None
_notes: int | None = None  # the file that tells the driver what this worker has begun
_home: int | str | None = None  # the working folder, set in workers of our own only
_streams: tuple[Any, Any] = (None, None)
_pid = os.getpid()
_begun: dict[str, float] = {}


def start_worker(driver_pid: int, capture: str, notes: str, at_once: bool) -> None:
    """Prepare a fresh worker process.

    Parameters
    ----------
    driver_pid : int
        The process to die with.
    capture : str
        File that receives whatever the simulator prints, its end there even after a crash. When empty one
        beside the notes, from which the output of failed runs is taken.
    notes : str
        Folder in which the worker notes what it has begun; when empty it does not.
    at_once : bool
        Die with the driver even while deep in compiled code, where no Python thread gets a turn; otherwise
        there is time to end external programs first.
    """
    global _capture, _home, _notes, _streams, _pid
    _leave_signals()
    if _HAS_MASKS:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, STOP_SIGNALS)
    with suppress(OSError, AttributeError):
        os.setsid()  # out of reach of the terminal, as is whatever the simulator starts
    if at_once and sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    threading.Thread(target=_die_with, args=(driver_pid,), daemon=True).start()

    nothing = os.open(os.devnull, os.O_RDWR)
    os.dup2(nothing, 0)
    printed = capture or (os.path.join(notes, f"{os.getpid()}{PRINTED}") if notes else "")
    try:
        with open(printed, "w+b") if printed else tempfile.TemporaryFile() as file:
            _capture = os.dup(file.fileno())
        append_only(_capture)
        threading.Thread(target=_keep_short, args=(_capture,), daemon=True).start()
    except OSError:  # no room for temporary files: what is printed is lost, the runs are not
        _capture = None
    if notes:
        with suppress(OSError):
            _notes = os.open(os.path.join(notes, f"{os.getpid()}"), os.O_WRONLY | os.O_CREAT, 0o600)
    for stream in (1, 2):
        os.dup2(nothing if _capture is None else _capture, stream)
    faulthandler.enable()
    set_start_method(None, force=True)  # a simulator's own processes would not know loky's
    # Not its name, which may change, where a folder can be held otherwise.
    _home = os.open(".", os.O_RDONLY) if os.chdir in os.supports_fd else os.getcwd()
    _streams, _pid = (sys.stdout, sys.stderr), os.getpid()


def turn_deaf() -> None:
    """Leave signals that ask to stop or to pause to the driver, also after a simulator that wanted them.

    Once a batch; between its runs :func:`clean_slate` looks for new handlers, which costs a third as much.
    """
    if _home is not None:
        _leave_signals()
        if _HAS_MASKS:
            signal.pthread_sigmask(signal.SIG_SETMASK, ())


def _leave_signals() -> None:
    for number in _LEFT_TO_DRIVER:
        # Not SIG_IGN, which external programs would inherit.
        signal.signal(number, _leave)
        if _HAS_MASKS:
            signal.siginterrupt(number, False)


def _leave(number: int, frame: FrameType | None) -> None:
    """Leave a signal to the driver."""


def _keep_short(capture: int) -> None:
    """Keep only the end of what is printed, so that it cannot fill the disk."""
    with suppress(OSError):
        while True:
            time.sleep(PRINTING_S)
            drop_beginning(capture)


def _die_with(driver_pid: int) -> None:
    while os.getppid() == driver_pid:
        time.sleep(WATCH_INTERVAL_S)
    end_own_commands()
    os._exit(1)


@contextmanager
def under_way(key: str) -> Iterator[None]:
    """Let the driver know that the batch with this first run has begun: the simulator is loaded."""
    _begun[key] = time.monotonic()
    if _notes is not None:
        with suppress(OSError):
            write_at(_notes, f"{key} {_begun[key]:20.6f}\n".encode(), 0)
    try:
        yield
    finally:
        _begun.pop(key, None)


def seconds_under_way(key: str) -> float | None:
    """Time since this process began a batch; None when it has not."""
    began = _begun.get(key)
    return None if began is None else time.monotonic() - began


@contextmanager
def hard_limit(seconds: float | None) -> Iterator[None]:
    """End this process after so long, from a thread that needs no interpreter (some code never returns)."""
    if seconds is None or _home is None:
        yield
        return
    faulthandler.dump_traceback_later(seconds, exit=True, file=2)  # sys.stderr may be anything
    try:
        yield
    finally:
        faulthandler.cancel_dump_traceback_later()


def clean_slate() -> None:
    """Begin a run as the first one began, whatever the last did to folder, streams and signal handlers."""
    if _home is not None:
        if any(signal.getsignal(number) is not _leave for number in _LEFT_TO_DRIVER):
            _leave_signals()
        os.chdir(_home)
        sys.stdout, sys.stderr = _streams
        for number, name in ((1, "stdout"), (2, "stderr")):
            if getattr(getattr(sys, name), "closed", True):
                stream = os.fdopen(number, "w", closefd=False, errors="backslashreplace")
                setattr(sys, name, stream)
    if _capture is not None:
        os.ftruncate(_capture, 0)
        os.lseek(_capture, 0, os.SEEK_SET)


def recent_output() -> str:
    """Give the end of what was printed since :func:`clean_slate`, by Python or by anything else."""
    if _capture is None:
        return ""
    with suppress(BaseException):  # the simulator may have closed or replaced them
        sys.stdout.flush()
        sys.stderr.flush()
    return last_bytes(_capture, OUTPUT_KEPT_BYTES).decode(errors="replace")


def end_copy() -> None:
    """End a process that is a copy of a worker: a simulator forked, and the child came back from its run."""
    if _home is not None and os.getpid() != _pid:
        os._exit(0)
