"""What is printed cannot fill the disk."""

import os

import pytest

from rsmkit.runs.one_run import output_limit
from rsmkit.runs.one_run.output_limit import END_KEPT_BYTES, drop_beginning, last_bytes


@pytest.fixture
def printed(tmp_path):
    handle = os.open(tmp_path / "printed", os.O_RDWR | os.O_CREAT | os.O_APPEND)
    yield handle
    os.close(handle)


def taken(handle):
    return os.fstat(handle).st_blocks * 512


def test_only_the_end_stays_and_writing_goes_on(printed):
    for i in range(12):
        os.write(printed, bytes([65 + i]) * END_KEPT_BYTES)
        drop_beginning(printed)
        assert taken(printed) <= 5 * END_KEPT_BYTES
    os.write(printed, b"the last words")
    assert last_bytes(printed, 20) == b"LLLLLLthe last words"


def test_a_little_is_let_be(printed):
    os.write(printed, b"a few words")
    drop_beginning(printed)
    assert last_bytes(printed, 100) == b"a few words"


def test_where_holes_cannot_be_made_the_file_is_emptied(printed, monkeypatch):
    monkeypatch.setattr(output_limit, "_punched", lambda handle, length: False)
    os.write(printed, b"x" * 5 * END_KEPT_BYTES)
    drop_beginning(printed)
    os.write(printed, b"the last words")
    assert last_bytes(printed, 20) == b"the last words"
    assert os.fstat(printed).st_size == 14
