"""Locks between processes that spare work and never stand in its way."""

from __future__ import annotations

import os
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

fcntl: Any
try:
    import fcntl
except ImportError:  # not a POSIX system: every process works for itself
    fcntl = None

__all__ = ["FolderLocks"]

PATIENCE_S = 600.0
_POLL_S = 0.05


class FolderLocks:
    """Named turns to work in a folder; a process has one at a time, and keeps it for work within that work.

    The kernel gives a turn back when its holder dies. It is a courtesy: where there is no locking (some
    network file systems, a folder that cannot be written), or after ten minutes of waiting, work goes on
    without it. Threads of one process must take turns by other means.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._busy = False

    @contextmanager
    def turn(self, names: Iterable[str]) -> Iterator[str]:
        """Wait for a turn under any of these names, the first that is free; gives the name."""
        names = list(names)
        if self._busy or fcntl is None:
            yield names[0]
            return
        name, handle = self._taken(names)
        self._busy = True
        try:
            yield name
        finally:
            self._busy = False
            if handle is not None:
                # Said explicitly: a process forked meanwhile shares the lock, which closing leaves it.
                fcntl.flock(handle, fcntl.LOCK_UN)
                os.close(handle)

    def _taken(self, names: list[str]) -> tuple[str, int | None]:
        deadline = time.monotonic() + PATIENCE_S
        while time.monotonic() < deadline:
            for name in names:
                try:
                    return name, self._locked(name)
                except BlockingIOError:
                    continue
                except OSError:
                    return name, None
            time.sleep(_POLL_S)
        return names[0], None

    def _locked(self, name: str) -> int:
        handle = os.open(self._folder / f"{name}.lock", os.O_RDWR | os.O_CREAT, 0o666)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BaseException:
            os.close(handle)
            raise
        return handle
