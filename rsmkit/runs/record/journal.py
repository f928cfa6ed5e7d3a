"""The journal ``runs.jsonl``: every run that has ended, one JSON object a line, only ever appended to.

A run counts as finished when its line has reached the disk (``fsync``). Whatever happens afterwards, reading
gives it back: a last line that was cut short by a crash is ignored on reading and removed before the next
append.
"""

from __future__ import annotations

import hashlib
import os
import stat
from codecs import BOM_UTF8
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO

from rsmkit.errors import RsmkitError
from rsmkit.io.files.regular_files import open_regular
from rsmkit.io.files.system_calls import read_at, sync_folder
from rsmkit.runs.record.journal_lock import Lock, is_still
from rsmkit.runs.record.run import Run, recordable, run_from_json, run_to_json

__all__ = ["EMPTY", "Journal"]

_REMEDY = (
    "Free the disk or choose a folder you may write to, then type the same command: nothing recorded is lost."
)
_CHUNK = 1 << 16
EMPTY = (0, hashlib.blake2b(digest_size=16).hexdigest())
"""The extent of a journal without runs."""


class Journal:
    """The record of all runs of a study.

    Reading needs no permission; writing happens inside ``with journal:``, which holds the lock against a
    second driver.

    Parameters
    ----------
    path : path
        The file; it need not exist yet, its folder must.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self._lock = Lock(self.path)
        self._handle: int | None = None
        self._runs: dict[str, Run] = {}
        self._earlier: dict[str, list[Run]] = {}
        self._settings: dict[str, Any] = {}  # most runs share theirs
        self._added: list[Run] = []  # written here since the last look: they need not be read again
        self._seen: tuple[int, ...] | None = None

    @property
    def folder(self) -> Path:
        """Where the details of failed runs are kept, one folder per key."""
        return self.path.parent / "runs"

    def load(self) -> Mapping[str, Run]:
        """Read all runs by key, the latest record of each; the same object again while nothing has changed.

        Raises
        ------
        RsmkitError
            If a complete line is damaged (a torn last line is not an error), or the file cannot be read.
        """
        try:
            found = os.lstat(self.path)
            self._refuse_others(found)
            if _signature(found) != self._seen:
                self._read()
        except FileNotFoundError:
            self._forget()
        except OSError as error:
            raise RsmkitError(f"{self.path}: cannot be read: {error.strerror}") from None
        if self._added:
            self._runs = dict(self._runs)  # whoever has the old one keeps it
            for run in self._added:
                self._put(run)
            self._added = []
        return self._runs

    def earlier(self, key: str) -> Sequence[Run]:
        """Records of a run that a later one has replaced, oldest first."""
        self.load()
        return self._earlier.get(key, ())

    def extent(self) -> tuple[int, str]:
        """Size and hash of the whole lines that :meth:`load` has read."""
        with open(open_regular(self.path), "rb") as stream:
            size = _end_of_lines(stream.fileno(), self._seen[2] if self._seen else 0)
            return size, _hash_start(stream, size).hexdigest()

    def read_on(self, size: int, digest: str, take: Callable[[Run], bool]) -> tuple[int, str] | None:
        """Read only the runs that were appended to a journal of this size and hash.

        Parameters
        ----------
        size, digest : int, str
            As :meth:`extent` gave them.
        take : callable
            Given each run in turn; False where one cannot be dealt with alone.

        Returns
        -------
        tuple of int and str, or None
            The extent now; None where the journal is another, damaged, or `take` has given up.
        """
        try:
            handle = open_regular(self.path)
        except OSError:
            return None
        with open(handle, "rb") as stream:
            end = _end_of_lines(stream.fileno(), os.fstat(stream.fileno()).st_size)
            if end < size:
                return None
            hashed = _hash_start(stream, size)
            if hashed.hexdigest() != digest:
                return None
            while size < end:
                line = stream.readline()
                size += len(line)
                hashed.update(line)
                try:
                    if not line.isspace() and not take(run_from_json(line, self._settings)):
                        return None
                except ValueError:
                    return None
            return size, hashed.hexdigest()

    def _forget(self) -> None:
        self._runs, self._earlier, self._settings, self._added, self._seen = {}, {}, {}, [], None

    def _read(self) -> None:
        self._forget()
        with open(open_regular(self.path), "rb") as stream:
            seen = _signature(os.fstat(stream.fileno()))
            if stream.read(len(BOM_UTF8)) != BOM_UTF8:  # some editors put one there
                stream.seek(0)
            self._take(stream)
        self._seen = seen

    def _take(self, lines: Iterable[bytes]) -> None:
        for number, line in enumerate(lines, start=1):
            if line.isspace():
                continue
            try:
                run = run_from_json(line, self._settings)
            except ValueError as error:
                if not line.endswith(b"\n"):
                    break
                raise RsmkitError(
                    f"{self.path}: line {number} is damaged ({str(error)[:200]}). "
                    "Delete that line, and its run is simply made again."
                ) from None
            self._put(run)

    def _put(self, run: Run) -> None:
        if run.key in self._runs:
            self._earlier.setdefault(run.key, []).append(self._runs[run.key])
        self._runs[run.key] = run

    def __enter__(self) -> Journal:
        self._lock.acquire()
        try:
            with suppress(FileNotFoundError):
                self._refuse_others(os.lstat(self.path))
            self._handle = open_regular(self.path, os.O_RDWR | os.O_CREAT | os.O_APPEND)
            self._lock.extend(self._handle)
            _heal(self._handle)
            sync_folder(self.path.parent)
        except OSError as error:
            self._release()
            raise RsmkitError(f"{self.path}: cannot be written: {error.strerror}. {_REMEDY}") from None
        except BaseException:
            self._release()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._release()

    def append(self, runs: Run | Iterable[Run]) -> None:
        """Write runs at the end and wait until they are on the disk; one ``fsync`` for all of them.

        Nothing is written that could not be read back: such a run is recorded as failed.

        Raises
        ------
        RsmkitError
            If the disk does not take them all; those it took are kept, as is all that was there before. Also
            if the file is no longer where it was.
        """
        if self._handle is None:
            raise RuntimeError("append needs the lock: use 'with journal:'")
        batch = [recordable(run, self._settings) for run in ([runs] if isinstance(runs, Run) else runs)]
        data = b"".join(f"{run_to_json(run)}\n".encode() for run in batch)
        before = os.fstat(self._handle)
        is_known = _signature(before) == self._seen
        problem = _write(self._handle, data, before.st_size)
        if problem is not None:
            raise RsmkitError(
                f"{self.path}: not all of {len(batch)} run(s) could be recorded: {problem.strerror}. "
                f"{_REMEDY}"
            )
        if not is_still(self._handle, self.path):
            raise RsmkitError(
                f"{self.path} was deleted or moved while runs were being recorded; put it back and try again"
            )
        if is_known:  # nobody else has written: the next look need not read the file
            self._seen = _signature(os.fstat(self._handle))
            self._added += batch

    def _refuse_others(self, found: os.stat_result) -> None:
        """Refuse what is no file: a pipe or a device could keep whoever reads it waiting for ever."""
        if stat.S_ISLNK(found.st_mode):
            raise RsmkitError(
                f"{self.path}: is a link, and links are not followed. Put the file in its place."
            )
        if not stat.S_ISREG(found.st_mode):
            raise RsmkitError(f"{self.path}: is not a file. Move away what is there, then try again.")

    def _release(self) -> None:
        if self._handle is not None:
            os.close(self._handle)
            self._handle = None
        self._lock.release()


def _signature(found: os.stat_result) -> tuple[int, ...]:
    """What changes when anybody else writes to the file."""
    return found.st_dev, found.st_ino, found.st_size, found.st_mtime_ns


def _write(handle: int, data: bytes, size: int) -> OSError | None:
    """Write to the end of a file of this size, and to the disk; give what went wrong.

    Whole lines that the disk took are kept. What it would not confirm is cut off again: a run that is in the
    memory of the computer only does not count.
    """
    problem = None
    try:
        while data:
            data = data[os.write(handle, data) :]
    except OSError as error:
        problem = error
        with suppress(OSError):
            _heal(handle)
    try:
        os.fsync(handle)
    except OSError as error:
        problem = error
        with suppress(OSError):
            os.ftruncate(handle, size)
    return problem


def _heal(handle: int) -> None:
    """Cut a torn last line off; give a whole one that only lacks its newline that newline."""
    size = os.fstat(handle).st_size
    start, tail = size, b""
    while start and b"\n" not in tail:
        length = min(_CHUNK, start)
        start -= length
        tail = read_at(handle, length, start) + tail
    torn = tail.rpartition(b"\n")[2]
    if not torn:
        return
    try:
        run_from_json(torn)
        os.write(handle, b"\n")
    except ValueError:
        os.ftruncate(handle, size - len(torn))
    os.fsync(handle)


def _end_of_lines(handle: int, size: int) -> int:
    """Where the last whole line within the first `size` bytes ends."""
    while size:
        length = min(_CHUNK, size)
        found = read_at(handle, length, size - length).rfind(b"\n")
        if found >= 0:
            return size - length + found + 1
        size -= length
    return 0


def _hash_start(stream: BinaryIO, size: int) -> hashlib.blake2b:
    """Hash the first bytes of a file, and leave it there."""
    hashed = hashlib.blake2b(digest_size=16)
    while size:
        data = stream.read(min(_CHUNK << 4, size))
        if not data:
            break
        hashed.update(data)
        size -= len(data)
    return hashed
