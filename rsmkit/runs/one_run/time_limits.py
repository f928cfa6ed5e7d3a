"""A limit on the time that a piece of Python may take."""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from rsmkit.runs.one_run.pristine import signal

__all__ = ["TimeLimit", "time_limit"]


class TimeLimit(BaseException):
    """Raised inside a run that takes too long; not an Exception, so that simulators rarely swallow it."""


@contextmanager
def time_limit(seconds: float | None) -> Iterator[None]:
    """Raise :class:`TimeLimit` inside the block after so many seconds.

    In the main thread by a signal, which also wakes what sleeps; in others between two steps of the
    interpreter.
    """
    if seconds is None:
        yield
        return
    main = threading.current_thread() is threading.main_thread() and hasattr(signal, "SIGALRM")
    limit = _by_signal if main else _by_thread
    with limit(seconds):
        yield


@contextmanager
def _by_signal(seconds: float) -> Iterator[None]:
    def stop(number: int, frame: FrameType | None) -> None:
        raise TimeLimit(f"more than {seconds:g} s")

    previous = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, previous)


@contextmanager
def _by_thread(seconds: float) -> Iterator[None]:
    thread, raise_in = ctypes.c_ulong(threading.get_ident()), ctypes.pythonapi.PyThreadState_SetAsyncExc
    lock = threading.Lock()
    running = True

    def stop() -> None:
        with lock:
            if running:
                raise_in(thread, ctypes.py_object(TimeLimit))

    timer = threading.Timer(seconds, stop)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        with lock:
            running = False
        raise_in(thread, None)  # take back what has not arrived
        timer.cancel()
