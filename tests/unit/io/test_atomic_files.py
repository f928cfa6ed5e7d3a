"""Files that are replaced in one step."""

import os

import pytest

from rsmkit.errors import RsmkitError
from rsmkit.io.files.atomic_files import read_text, write_text


def test_the_text_is_on_the_disk_before_it_takes_the_name(tmp_path, monkeypatch):
    steps = []
    fsync, replace = os.fsync, os.replace
    monkeypatch.setattr(os, "fsync", lambda handle: (steps.append(os.fstat(handle).st_size), fsync(handle)))
    monkeypatch.setattr(os, "replace", lambda a, b: (steps.append("named"), replace(a, b)))
    write_text(tmp_path / "a.txt", "whole")
    assert steps == [5, "named"]
    assert read_text(tmp_path / "a.txt", "") == "whole"


@pytest.mark.parametrize(("mask", "mode"), [(0o022, 0o644), (0o077, 0o600), (0o002, 0o664)])
def test_the_file_may_be_read_by_whom_the_umask_allows(tmp_path, mask, mode):
    before = os.umask(mask)
    try:
        write_text(tmp_path / "a.txt", "")
    finally:
        os.umask(before)
    assert (tmp_path / "a.txt").stat().st_mode & 0o777 == mode


def test_what_cannot_be_replaced_leaves_nothing_behind(tmp_path):
    (tmp_path / "a.txt").mkdir()
    with pytest.raises(RsmkitError, match="cannot be written"):
        write_text(tmp_path / "a.txt", "new")
    assert [path.name for path in tmp_path.iterdir()] == ["a.txt"]


def test_a_folder_that_is_missing_is_named(tmp_path):
    with pytest.raises(
        RsmkitError, match=r"there is no folder .*nowhere\. Make it, or name one that is there"
    ):
        write_text(tmp_path / "nowhere" / "page.html", "text")
