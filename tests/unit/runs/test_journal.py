"""The journal on the disk: durable, healed, locked."""

import errno
import json
import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from rsmkit.errors import RsmkitError
from rsmkit.runs.record.journal import Journal
from rsmkit.runs.record.run import Run, run_to_json

OLD = Path(__file__).parents[2] / "data" / "runs" / "journals"


def make(index, **changes):
    fields = {
        "key": f"{index:016x}",
        "simulator": "m:f",
        "settings": {"speed": 1.0},
        "factors": {"a": float(index)},
        "replicate": 0,
        "status": "done",
        "responses": {"y": float(index)},
        "extras": {},
        "seconds": 0.1,
    }
    return Run(**(fields | changes))


@pytest.fixture
def journal(tmp_path):
    return Journal(tmp_path / "runs.jsonl")


def test_no_file_is_no_runs(journal):
    assert journal.load() == {}
    assert not journal.path.exists()


def test_runs_come_back_by_key_and_the_latest_record_counts(journal):
    with journal:
        journal.append([make(1, status="failed", responses={}, error="x"), make(2)])
        journal.append(make(1, attempt=2))
    runs = journal.load()
    assert list(runs) == [make(1).key, make(2).key]
    assert runs[make(1).key] == make(1, attempt=2)
    assert runs[make(1).key].settings is runs[make(2).key].settings
    assert not journal.path.with_name("runs.jsonl.lock").exists()


def test_each_append_reaches_the_disk_before_it_returns(journal, monkeypatch):
    synced = []
    real = os.fsync
    monkeypatch.setattr(os, "fsync", lambda handle: (synced.append(os.fstat(handle).st_size), real(handle)))
    with journal:
        synced.clear()
        journal.append([make(1), make(2)])
        assert synced == [journal.path.stat().st_size]


@pytest.fixture
def flushed(monkeypatch):
    """What has been flushed to the disk: "folder", or how large the file was."""
    found = []
    real = os.fsync

    def fsync(handle):
        seen = os.fstat(handle)
        found.append("folder" if stat.S_ISDIR(seen.st_mode) else seen.st_size)
        real(handle)

    monkeypatch.setattr(os, "fsync", fsync)
    return found


def test_the_name_of_a_new_journal_reaches_the_disk_too(journal, flushed):
    with journal:
        assert flushed == ["folder"]


@pytest.mark.parametrize("tail", [b'{"schema": 1, "ke', run_to_json(make(2)).encode()])
def test_a_healed_journal_reaches_the_disk_before_anything_is_appended(journal, flushed, tail):
    with journal:
        journal.append(make(1))
    with journal.path.open("ab") as stream:
        stream.write(tail)
    flushed.clear()
    with journal:
        assert flushed == [journal.path.stat().st_size, "folder"]


def test_a_torn_last_line_is_dropped_on_reading_and_cut_off_before_the_next_append(journal):
    with journal:
        journal.append([make(1), make(2)])
    whole = journal.path.read_bytes()
    journal.path.write_bytes(whole + run_to_json(make(3)).encode()[:-9])
    assert len(journal.load()) == 2
    with journal:
        assert journal.path.read_bytes() == whole
        journal.append(make(4))
    assert [run.factors["a"] for run in journal.load().values()] == [1.0, 2.0, 4.0]


def test_a_whole_last_line_without_newline_is_kept(journal):
    with journal:
        journal.append([make(1), make(2)])
    journal.path.write_bytes(journal.path.read_bytes()[:-1])
    assert len(journal.load()) == 2
    with journal:
        journal.append(make(3))
    assert len(journal.load()) == 3


def test_a_torn_line_longer_than_one_read_is_healed(journal):
    with journal:
        journal.append(make(1))
    whole = journal.path.read_bytes()
    journal.path.write_bytes(whole + b'{"schema":1,"error":"' + b"x" * 200_000)
    with journal:
        pass
    assert journal.path.read_bytes() == whole


def test_a_file_of_zeros_after_a_power_cut_is_healed(journal):
    with journal:
        journal.append(make(1))
    with open(journal.path, "ab") as file:
        file.write(b"\0" * 4096)
    assert len(journal.load()) == 1
    with journal:
        journal.append(make(2))
    assert len(journal.load()) == 2


def test_a_damaged_line_in_the_middle_is_named(journal):
    with journal:
        journal.append([make(1), make(2), make(3)])
    lines = journal.path.read_text().splitlines(keepends=True)
    lines[1] = lines[1].replace('"seconds":0.1', '"seconds":oops')
    journal.path.write_text("".join(lines))
    with pytest.raises(RsmkitError, match=r"runs\.jsonl: line 2 is damaged .*Delete that line"):
        journal.load()


def test_a_journal_of_the_future_is_refused(journal):
    line = json.dumps(json.loads(run_to_json(make(1))) | {"schema": 2})
    journal.path.write_text(line + "\n")
    with pytest.raises(RsmkitError, match="schema 2 is not 1"):
        journal.load()


def test_appending_needs_the_lock(journal):
    with pytest.raises(RuntimeError, match="with journal"):
        journal.append(make(1))


def test_a_full_disk_loses_nothing_and_leaves_nothing_half_written(journal, monkeypatch):
    with journal:
        journal.append(make(1))
        before = journal.path.read_bytes()
        real = os.write

        def write(handle, data):
            if len(data) > 10:
                return real(handle, data[:10])
            raise OSError(errno.ENOSPC, "No space left on device")

        monkeypatch.setattr(os, "write", write)
        with pytest.raises(RsmkitError, match=r"could be recorded: No space left.*Free the disk"):
            journal.append(make(2))
        monkeypatch.undo()
        assert journal.path.read_bytes() == before
        journal.append(make(3))
    assert len(journal.load()) == 2


def test_a_folder_that_is_gone_is_one_clear_message(tmp_path):
    with pytest.raises(RsmkitError, match="cannot be written"), Journal(tmp_path / "gone" / "runs.jsonl"):
        pass


def test_a_journal_deleted_under_our_hands_is_noticed(journal):
    with journal:
        journal.append(make(1))
        journal.path.unlink()
        with pytest.raises(RsmkitError, match="was deleted or moved while runs were being recorded"):
            journal.append(make(2))


def test_a_journal_moved_under_our_hands_keeps_what_has_ended(tmp_path):
    (tmp_path / "here").mkdir()
    with Journal(tmp_path / "here" / "runs.jsonl") as journal:
        journal.append(make(1))
        (tmp_path / "here").rename(tmp_path / "there")
        with pytest.raises(RsmkitError, match="was deleted or moved while runs were being recorded"):
            journal.append(make(2))
    assert len(Journal(tmp_path / "there" / "runs.jsonl").load()) == 2
    assert not (tmp_path / "here").exists()


def test_a_disk_that_fails_to_flush_is_one_message(journal, monkeypatch):
    with journal:
        journal.append(make(1))

        def fsync(handle):
            raise OSError(errno.EIO, os.strerror(errno.EIO))

        monkeypatch.setattr(os, "fsync", fsync)
        with pytest.raises(RsmkitError, match=r"could be recorded: Input/output error\. Free the disk"):
            journal.append(make(2))
        monkeypatch.undo()
        assert list(Journal(journal.path).load()) == [make(1).key], "what was not flushed does not count"
        journal.append(make(3))
    assert list(journal.load()) == [make(1).key, make(3).key]


HOLD = """
import sys, time
from rsmkit.runs.record.journal import Journal
with Journal(sys.argv[1]):
    print("held", flush=True)
    time.sleep(3600)
"""


def hold(path):
    holder = subprocess.Popen([sys.executable, "-c", HOLD, str(path)], stdout=subprocess.PIPE, text=True)
    assert holder.stdout.readline() == "held\n"
    return holder


def test_a_second_driver_is_refused_and_told_who_is_first(journal):
    holder = hold(journal.path)
    try:
        with (
            pytest.raises(RsmkitError, match=rf"process {holder.pid} on .+ since \d{{4}}-.* UTC is writing"),
            journal,
        ):
            pass
        assert journal.load() == {}
    finally:
        holder.kill()
        holder.communicate()


def test_a_second_driver_is_refused_even_when_the_lock_file_was_removed(journal):
    with journal:
        journal.path.with_name("runs.jsonl.lock").unlink()
        second = Journal(journal.path)
        with (
            pytest.raises(RsmkitError, match=r"another process is writing .* Wait until it has finished"),
            second,
        ):
            pass
        journal.append(make(1))
    assert len(journal.load()) == 1


def test_the_lock_of_a_killed_driver_does_not_count(journal):
    holder = hold(journal.path)
    holder.kill()
    holder.communicate()
    assert journal.path.with_name("runs.jsonl.lock").exists()
    with journal:
        journal.append(make(1))
    assert len(journal.load()) == 1


def test_one_process_cannot_write_twice_at_a_time(journal):
    with journal, pytest.raises(RsmkitError, match=f"process {os.getpid()}"), Journal(journal.path):
        pass


def test_journals_of_every_format_so_far_still_load():
    runs = Journal(OLD / "schema1.jsonl").load()
    assert [(run.status, run.attempt) for run in runs.values()] == [
        ("done", 1),
        ("done", 2),
        ("timeout", 1),
        ("crashed", 1),
    ]
    first, second, third, last = runs.values()
    assert first.responses == {"axial_integral": 12.345678901234567, "heat_integral": -0.001}
    assert first.settings == {"speed_m_s": 4300.0, "preset": "paper", "blend": [4.5, 5.5]}
    assert first.extras == {"time_s": 151.5, "stopped": "ground", "peaks": [1, 2.5, None]}
    assert (second.replicate, second.responses["heat_integral"], second.seconds) == (2, 3, 1)
    assert third.factors == {"shape": "cône"}
    assert (last.error, last.host, last.started) == ("", "", "")


def test_line_ends_and_marks_of_other_systems_are_understood(tmp_path):
    journal = Journal(tmp_path / "runs.jsonl")
    with journal:
        journal.append([make(0), make(1)])
    whole = journal.path.read_bytes()
    journal.path.write_bytes(b"\xef\xbb\xbf" + whole.replace(b"\n", b"\r\n"))
    assert list(journal.load().values()) == [make(0), make(1)]


def test_a_folder_in_the_place_of_the_journal_is_one_message(tmp_path):
    journal = Journal(tmp_path / "runs.jsonl")
    journal.path.mkdir()
    with pytest.raises(RsmkitError, match=r"runs\.jsonl: is not a file. Move away what is there"), journal:
        pass
    with pytest.raises(RsmkitError, match=r"runs\.jsonl: is not a file. Move away what is there"):
        journal.load()


def test_a_pipe_or_a_device_in_the_place_of_the_journal_is_one_message(tmp_path):
    os.mkfifo(tmp_path / "pipe.jsonl")
    (tmp_path / "link.jsonl").symlink_to("/dev/full")
    wrong = {
        "pipe": "is not a file. Move away what is there",
        "link": "is a link, and links are not followed",
    }
    for name, words in wrong.items():
        journal = Journal(tmp_path / f"{name}.jsonl")
        with pytest.raises(RsmkitError, match=rf"{name}\.jsonl: {words}"):
            journal.load()
        with pytest.raises(RsmkitError, match=rf"{name}\.jsonl: {words}"), journal:
            pass


def test_the_journal_is_read_again_only_when_somebody_else_has_written(tmp_path):
    journal, other = Journal(tmp_path / "runs.jsonl"), Journal(tmp_path / "runs.jsonl")
    with journal:
        journal.append([make(1)])
    first = journal.load()
    assert journal.load() is first
    with journal:
        journal.append([make(2)])
        assert len(journal.load()) == 2
    assert len(first) == 1  # whoever has the old one keeps it
    assert journal.load() == other.load()
    with other:
        other.append([make(3)])
    assert len(journal.load()) == 3


def nested(depth):
    return [nested(depth - 1)] if depth else []


@pytest.mark.parametrize(
    "changes",
    [
        {"extras": {"deep": nested(900)}},
        {"extras": {"deep": nested(101)}},
        {"extras": {"z": float("nan")}},
        {"extras": {"z": object()}},
        {"host": object()},
        {"seconds": float("inf")},
        {"error": 5},
        {"responses": {"y": 10**400}},
    ],
)
def test_nothing_is_written_that_could_not_be_read_back(journal, changes):
    with journal:
        journal.append([make(1), make(2, **changes), make(3)])
        assert [run.status for run in journal.load().values()] == ["done", "failed", "done"]
    again = Journal(journal.path).load()
    assert [run.status for run in again.values()] == ["done", "failed", "done"]
    assert again[make(2).key].error.startswith("returned something that cannot be recorded")
    assert again[make(2).key].factors == make(2).factors
