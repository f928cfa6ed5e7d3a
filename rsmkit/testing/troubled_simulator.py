"""A simulator that gets into trouble when asked to, for the contract of backends.

Workers find it by the name of its file alone, so that loading it loads nothing else.
"""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable

__all__ = ["moody"]


def moody(a: float, b: float, *, log: str, seconds: float = 0.0, trouble: str = "") -> dict[str, float]:
    """Leave a line for having begun and one for the end; from a = 0.5 on get into trouble in between."""
    _note(log, f"start {a!r}")
    if trouble and a >= 0.5:
        _TROUBLES[trouble]()
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        time.sleep(0.01)
    _note(log, f"end {a!r}")
    return {"y": a + 2.0 * b}


def _note(log: str, text: str) -> None:
    with open(log, "a") as file:
        file.write(f"{text}\n")


def _fail() -> None:
    raise ValueError("step size underflow")


def _hang() -> None:
    while True:
        time.sleep(0.01)


def _hang_deep() -> None:
    """Stay in compiled code that lets neither signals nor threads have a turn."""
    sum(range(10**13))


def _die() -> None:
    os.kill(os.getpid(), signal.SIGSEGV)


_TROUBLES: dict[str, Callable[[], None]] = {
    "fail": _fail,
    "hang": _hang,
    "hang deep": _hang_deep,
    "die": _die,
}
