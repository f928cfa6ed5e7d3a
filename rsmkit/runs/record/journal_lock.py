"""One driver at a time: a lock that names its holder and that the kernel releases when the holder dies."""

from __future__ import annotations

import errno
import json
import os
import socket
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path

from rsmkit.errors import RsmkitError
from rsmkit.io.files.regular_files import open_regular, read_regular
from rsmkit.io.files.system_calls import lock, write_at

__all__ = ["Lock", "is_still"]


class Lock:
    """Exclusive right to write one file, kept in ``<file>.lock`` beside it.

    The right is an advisory lock of the operating system (``flock``), so a killed driver never leaves it
    behind; what is written in the lock file only serves the message. The clock plays no part.
    """

    def __init__(self, guarded: Path) -> None:
        self.guarded = guarded
        self.path = guarded.with_name(f"{guarded.name}.lock")
        self._handle: int | None = None

    def acquire(self) -> None:
        """Take the lock, or say who has it.

        Raises
        ------
        RsmkitError
            If another process holds it, or the folder cannot be written.
        """
        while self._handle is None:
            try:
                handle = open_regular(self.path, os.O_RDWR | os.O_CREAT)
            except OSError as error:
                raise RsmkitError(f"{self.path}: cannot be written: {error.strerror}") from None
            try:
                if os.fstat(handle).st_nlink > 1:
                    raise OSError(errno.EMLINK, "it is another name of another file; remove it")
                lock(handle)
                if is_still(handle, self.path):
                    os.ftruncate(handle, 0)
                    write_at(handle, json.dumps(_whoami()).encode(), 0)
                    self._handle = handle
                    continue
            except BlockingIOError:
                os.close(handle)
                raise RsmkitError(self._refusal()) from None
            except OSError as error:
                os.close(handle)
                raise RsmkitError(f"{self.path}: cannot be locked: {error.strerror}") from None
            os.close(handle)  # the previous holder removed the file in between: try the new one

    def extend(self, handle: int) -> None:
        """Lock the open file itself too, lest a second driver gets in when a person removes the lock file.

        Raises
        ------
        RsmkitError
            If another process holds it.
        """
        try:
            lock(handle)
        except BlockingIOError:
            raise RsmkitError(f"another process {self._waiting()}") from None

    def release(self) -> None:
        """Give the lock back and remove its file."""
        if self._handle is not None:
            if os.name == "nt":  # where what is open cannot be removed
                os.close(self._handle)
                with suppress(OSError):  # the next one may have it by now
                    self.path.unlink(missing_ok=True)
            else:
                self.path.unlink(missing_ok=True)
                os.close(self._handle)
            self._handle = None

    def _refusal(self) -> str:
        try:
            holder = json.loads(read_regular(self.path, 4096))
            who = f"process {holder['pid']} on {holder['host']} since {holder['since']}"
        except (OSError, ValueError, KeyError, TypeError):
            who = "another process"
        return f"{who} {self._waiting()}"

    def _waiting(self) -> str:
        return f"is writing {self.guarded}. Wait until it has finished, or stop it, then try again."


def _whoami() -> dict[str, str | int]:
    since = datetime.now(UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
    return {"pid": os.getpid(), "host": socket.gethostname(), "since": since}


def is_still(handle: int, path: Path) -> bool:
    """Whether an open file is still the one of that name."""
    try:
        return os.path.samestat(os.fstat(handle), os.stat(path))
    except OSError:
        return False
