"""A lock between processes that spares work and never stands in its way."""

from __future__ import annotations

import os
import time
from pathlib import Path
from types import TracebackType
from typing import Any

fcntl: Any
try:
    import fcntl
except ImportError:  # not a POSIX system: every process works for itself
    fcntl = None

__all__ = ["FolderLock"]

PATIENCE_S = 600.0
_POLL_S = 0.05


class FolderLock:
    """Turn to work in a folder, which a process may take again while it has it.

    The kernel gives the turn back when its holder dies. It is a courtesy: where there is no locking (some
    network file systems, a folder that cannot be written), or after ten minutes of waiting, work goes on
    without it. Threads of one process must take turns by other means.
    """

    def __init__(self, folder: Path) -> None:
        self._path = folder / "lock"
        self._depth = 0
        self._handle: int | None = None

    def __enter__(self) -> None:
        if self._depth == 0 and fcntl is not None:
            self._handle = self._acquired()
        self._depth += 1

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._depth -= 1
        if self._depth == 0 and self._handle is not None:
            # Said explicitly: a process forked meanwhile shares the lock, and closing would leave it that.
            fcntl.flock(self._handle, fcntl.LOCK_UN)
            os.close(self._handle)
            self._handle = None

    def _acquired(self) -> int | None:
        deadline = time.monotonic() + PATIENCE_S
        try:
            handle = os.open(self._path, os.O_RDWR | os.O_CREAT, 0o666)
        except OSError:
            return None
        try:
            while time.monotonic() < deadline:
                try:
                    fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    return handle
                except BlockingIOError:
                    time.sleep(_POLL_S)
        except OSError:
            pass
        except BaseException:  # a time limit, Ctrl-C
            os.close(handle)
            raise
        os.close(handle)
        return None
