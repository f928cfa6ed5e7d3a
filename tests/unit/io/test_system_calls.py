"""A system that lacks what POSIX has, imitated by taking it away."""

import errno
import os
import subprocess
import sys
import types
from contextlib import suppress
from pathlib import Path

import pytest

from rsmkit.io.files import system_calls
from rsmkit.runs.record.journal import Journal
from rsmkit.runs.record.run import Run

RUN = Run("0123456789abcdef", "m:f", {}, {"a": 0.5}, 0, "done", {"y": 1.0}, {}, 0.1)


@pytest.fixture
def windows(monkeypatch):
    """No fcntl, no pread; locks as msvcrt has them: of bytes, from where the file stands."""
    held = {}

    def locking(handle, mode, count):
        assert (mode, count) == (2, 1)
        found = os.fstat(handle)
        place = found.st_ino, os.lseek(handle, 0, os.SEEK_CUR)
        alive = False
        if held.get(place, handle) != handle:
            with suppress(OSError):  # closed, and so unlocked
                alive = os.fstat(held[place]).st_ino == found.st_ino
        if alive:
            raise PermissionError(errno.EACCES, "Permission denied")
        held[place] = handle

    monkeypatch.setitem(sys.modules, "fcntl", None)
    monkeypatch.setitem(sys.modules, "msvcrt", types.SimpleNamespace(LK_NBLCK=2, locking=locking))
    monkeypatch.setattr(system_calls, "_PREAD", None)
    monkeypatch.setattr(system_calls, "_PWRITE", None)
    monkeypatch.delattr(os, "killpg")
    return held


def test_a_lock_of_a_byte_keeps_the_second_out_and_the_place_in_the_file(windows, tmp_path):
    path = tmp_path / "locked"
    path.write_text("0123456789")
    with open(path, "rb", buffering=0) as first, open(path, "rb", buffering=0) as second:
        first.seek(4)
        system_calls.lock(first.fileno())
        assert first.read(1) == b"4"
        with pytest.raises(BlockingIOError):
            system_calls.lock(second.fileno())
    ((_, place),) = windows
    assert place > 1 << 30, "the contents must stay readable for others"
    with open(path, "rb") as third:
        system_calls.lock(third.fileno())


def test_an_error_of_the_disk_is_not_taken_for_a_lock(windows, tmp_path, monkeypatch):
    def broken(*_):
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(sys.modules["msvcrt"], "locking", broken)
    with open(tmp_path / "x", "wb") as file, pytest.raises(OSError, match="Input/output") as caught:
        system_calls.lock(file.fileno())
    assert not isinstance(caught.value, BlockingIOError)


def test_without_any_locks_it_is_said(windows, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "msvcrt", None)
    with open(tmp_path / "x", "wb") as file, pytest.raises(OSError, match="no locks"):
        system_calls.lock(file.fileno())


def test_a_journal_is_written_healed_and_kept_from_a_second_driver(windows, tmp_path):
    path = tmp_path / "runs.jsonl"
    with Journal(path) as journal:
        journal.append(RUN)
        with pytest.raises(Exception, match="is writing"), Journal(path):
            pass
    with open(path, "ab") as file:
        file.write(b'{"schema":1,"ke')
    with Journal(path) as journal:
        journal.append(RUN)
    assert len(path.read_text().splitlines()) == 2
    assert [run.key for run in Journal(path).load().values()] == [RUN.key]


def test_places_in_a_file(windows, tmp_path):
    with open(tmp_path / "x", "w+b", buffering=0) as file:
        assert system_calls.write_at(file.fileno(), b"abcdef", 0) == 6
        assert system_calls.write_at(file.fileno(), b"X", 3) == 1
        assert system_calls.read_at(file.fileno(), 3, 2) == b"cXe"


def test_a_process_is_ended_with_its_children(windows, monkeypatch):
    called = []
    monkeypatch.setattr(subprocess, "run", lambda words, **how: called.append(words))
    system_calls.end_tree(17)
    system_calls.end_tree(18, at_once=False)
    assert called == [["taskkill", "/T", "/F", "/PID", "17"], ["taskkill", "/T", "/PID", "18"]]


def test_a_folder_of_windows_is_not_opened(monkeypatch):
    monkeypatch.setattr(system_calls.os, "open", lambda *_: pytest.fail("opened"))
    monkeypatch.setattr(system_calls.os, "name", "nt")
    system_calls.sync_folder("anything")


def test_signals_that_a_system_lacks_are_left_out():
    assert system_calls.signals("SIGINT", "SIGNOTHING") == system_calls.signals("SIGINT")


def test_every_module_can_be_imported_without_what_posix_has():
    root = Path(system_calls.__file__).parents[2]
    code = """
import os, signal, sys, pathlib, importlib
import asyncio, subprocess, multiprocessing.resource_tracker  # the library's own need of it
sys.modules["fcntl"] = sys.modules["resource"] = sys.modules["termios"] = sys.modules["pwd"] = None
for name in "SIGHUP SIGALRM SIGTSTP SIGKILL SIGQUIT pthread_sigmask setitimer siginterrupt".split():
    delattr(signal, name)
for name in "pread pwrite killpg setsid fork O_NOFOLLOW O_NONBLOCK O_CLOEXEC".split():
    delattr(os, name)
root = pathlib.Path(sys.argv[1])
for path in sorted([*(root / "rsmkit" / "runs").rglob("*.py"), *(root / "rsmkit" / "study").rglob("*.py")]):
    name = ".".join(path.relative_to(root).with_suffix("").parts).removesuffix(".__init__")
    importlib.import_module(name)
import rsmkit.cli.commands, rsmkit.stages.by_hand
"""
    done = subprocess.run(
        [sys.executable, "-c", code, str(root)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr[-2000:]
