"""What operating systems do differently: locks, places in files, folders on the disk, signals, process trees.

POSIX systems have all of it. On Windows a lock is one byte of the file, far behind its end, that nobody else
can lock; folders need not be flushed; there are fewer signals; a process tree is ended by ``taskkill``.
"""

from __future__ import annotations

import errno
import importlib
import os
import signal
import subprocess
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

__all__ = [
    "KILL",
    "append_only",
    "end_tree",
    "lock",
    "masked",
    "read_at",
    "signals",
    "sync_folder",
    "write_at",
]

LOCKED_BYTE = 1 << 40
"""Windows keeps everybody from reading what is locked, so it is a byte that no file has."""


# As they are now: a simulator may replace them.
_PREAD: Any = getattr(os, "pread", None)
_PWRITE: Any = getattr(os, "pwrite", None)


def _module(name: str) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError:
        return None


def signals(*names: str) -> tuple[signal.Signals, ...]:
    """Those of the signals that this system has."""
    return tuple(getattr(signal, name) for name in names if hasattr(signal, name))


(KILL,) = signals("SIGKILL") or signals("SIGTERM")
"""Ends a process at once; on Windows SIGTERM does."""


def lock(handle: int) -> None:
    """Lock an open file until it is closed, or the process ends however it ends.

    Raises
    ------
    BlockingIOError
        If another process has it.
    OSError
        If the file system has no locks.
    """
    fcntl, msvcrt = _module("fcntl"), _module("msvcrt")
    if fcntl is not None:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    elif msvcrt is not None:
        place = os.lseek(handle, 0, os.SEEK_CUR)
        os.lseek(handle, LOCKED_BYTE, os.SEEK_SET)
        try:
            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        except OSError as error:
            if error.errno in (errno.EACCES, errno.EDEADLK):
                raise BlockingIOError(errno.EAGAIN, "another process has it") from None
            raise
        finally:
            os.lseek(handle, place, os.SEEK_SET)
    else:
        raise OSError(errno.ENOSYS, "this system has no locks")


def read_at(handle: int, count: int, place: int) -> bytes:
    """Read from a place in a file, as ``os.pread`` does."""
    if _PREAD is not None:
        return bytes(_PREAD(handle, count, place))
    os.lseek(handle, place, os.SEEK_SET)
    return os.read(handle, count)


def write_at(handle: int, data: bytes, place: int) -> int:
    """Write at a place in a file, as ``os.pwrite`` does."""
    if _PWRITE is not None:
        return int(_PWRITE(handle, data, place))
    os.lseek(handle, place, os.SEEK_SET)
    return os.write(handle, data)


def sync_folder(folder: Path) -> None:
    """Make the names of files durable, not only their contents; where folders cannot be opened they are."""
    if os.name == "nt":
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def append_only(handle: int) -> None:
    """Have everything that is written to an open file go to its end."""
    fcntl = _module("fcntl")
    if fcntl is not None:
        fcntl.fcntl(handle, fcntl.F_SETFL, fcntl.fcntl(handle, fcntl.F_GETFL) | os.O_APPEND)


@contextmanager
def masked(held_back: Iterable[signal.Signals]) -> Iterator[None]:
    """Hold signals back meanwhile; processes that start inherit that."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, held_back)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def end_tree(pid: int, *, at_once: bool = True) -> None:
    """End a process that leads a group, with all of it.

    Parameters
    ----------
    pid : int
    at_once : bool
        Not asking it first.

    Raises
    ------
    ProcessLookupError
        If there is none.
    """
    if hasattr(os, "killpg"):
        os.killpg(pid, KILL if at_once else signal.SIGTERM)
        return
    words = ["taskkill", "/T", *["/F"] * at_once, "/PID", str(pid)]
    with suppress(OSError):
        subprocess.run(words, stdin=subprocess.DEVNULL, capture_output=True, check=False, timeout=60)
