"""A worker process: how it starts, how it dies with its driver, its clocks, and what is printed in it.

Workers import as little as possible and leave Ctrl-C to their driver.
"""

from __future__ import annotations

import ctypes
import faulthandler
import os
import signal
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from rsmkit.runs.command import end_own_commands

__all__ = ["TimeLimit", "forget_output", "hard_limit", "recent_output", "start_worker", "time_limit"]

WATCH_INTERVAL_S = 0.5
OUTPUT_KEPT_BYTES = 20_000
_PR_SET_PDEATHSIG = 1

_capture: int | None = None


class TimeLimit(BaseException):
    """Raised inside a run that takes too long; not an Exception, so that simulators rarely swallow it."""


def start_worker(driver_pid: int, capture: str, at_once: bool) -> None:
    """Prepare a fresh worker process.

    Parameters
    ----------
    driver_pid : int
        The process to die with.
    capture : str
        File that receives whatever the simulator prints, complete even after a crash. When empty an anonymous
        one, from which the output of failed runs is taken.
    at_once : bool
        Die with the driver even while deep in compiled code, where no Python thread gets a turn; otherwise
        there is time to end external programs first.
    """
    global _capture
    for number in (signal.SIGINT, signal.SIGTERM):
        # Not SIG_IGN, which external programs would inherit.
        signal.signal(number, lambda number, frame: None)
        signal.siginterrupt(number, False)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT, signal.SIGTERM})
    if at_once and sys.platform == "linux":
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
    end_own_commands()
    os._exit(1)


@contextmanager
def hard_limit(seconds: float | None) -> Iterator[None]:
    """End this process after so long, from a thread that needs no interpreter (some code never returns)."""
    if seconds is None or _capture is None:
        yield
        return
    faulthandler.dump_traceback_later(seconds, exit=True)
    try:
        yield
    finally:
        faulthandler.cancel_dump_traceback_later()


@contextmanager
def time_limit(seconds: float | None) -> Iterator[None]:
    """Raise :class:`TimeLimit` inside the block after so many seconds; works in the main thread only."""
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


def forget_output() -> None:
    """Begin a run with a clean slate."""
    if _capture is not None:
        os.ftruncate(_capture, 0)
        os.lseek(_capture, 0, os.SEEK_SET)


def recent_output() -> str:
    """Give the end of what was printed since :func:`forget_output`, by Python or by anything else."""
    if _capture is None:
        return ""
    sys.stdout.flush()
    sys.stderr.flush()
    end = os.fstat(_capture).st_size
    kept = os.pread(_capture, OUTPUT_KEPT_BYTES, max(0, end - OUTPUT_KEPT_BYTES))
    return kept.decode(errors="replace")
