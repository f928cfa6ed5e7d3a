"""Ctrl-C, SIGTERM or a closed terminal during runs: the first finishes what is running, the second aborts."""

from __future__ import annotations

import signal
import threading
from types import FrameType, TracebackType
from typing import Any

from rsmkit.errors import EXIT_INTERRUPTED, RsmkitError
from rsmkit.io.files.system_calls import signals

__all__ = ["STOP_SIGNALS", "Interrupted", "Interrupts"]

STOP_SIGNALS = signals("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")


class Interrupted(RsmkitError):
    """The person (or the system) asked to stop; every finished run is recorded."""

    exit_code = EXIT_INTERRUPTED


class Interrupts:
    """Counts requests to stop while the ``with`` block lasts.

    Signals can only be received in the main thread; elsewhere the block has no effect. From the third signal
    on the handlers from before are back in force.
    """

    def __init__(self) -> None:
        self.count = 0
        self._previous: dict[int, Any] = {}

    def __enter__(self) -> Interrupts:
        if threading.current_thread() is threading.main_thread():
            deaf = [
                number for number in signals("SIGHUP") if signal.getsignal(number) == signal.SIG_IGN
            ]  # nohup: go on without a terminal
            heeded = [number for number in STOP_SIGNALS if number not in deaf]
            self._previous = {number: signal.signal(number, self._receive) for number in heeded}
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._restore()

    def _receive(self, number: int, frame: FrameType | None) -> None:
        self.count += 1
        if self.count == 2:
            self._restore()

    def _restore(self) -> None:
        for number, handler in self._previous.items():
            signal.signal(number, signal.SIG_DFL if handler is None else handler)
        self._previous = {}
