"""Writing so that nothing is ever half written, and reading so that what is wrong is explained."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from rsmkit.errors import RsmkitError
from rsmkit.io.files.regular_files import read_regular

__all__ = ["check_folder", "read_text", "write_bytes", "write_text"]


def write_text(path: Path, text: str) -> None:
    """Write a text as UTF-8; see :func:`write_bytes`."""
    write_bytes(path, text.encode("utf-8"))


def write_bytes(path: Path, data: bytes) -> None:
    """Replace `path` in one step: temporary file in the same folder, flush to disk, rename.

    Raises
    ------
    RsmkitError
        If the folder cannot be written or the disk is full.
    """
    try:
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=".tmp")
        try:
            with open(handle, "wb") as stream:
                stream.write(data)
                stream.flush()
                os.fsync(stream.fileno())
            os.chmod(temporary, 0o666 & ~_umask())
            os.replace(temporary, path)
        except BaseException:
            os.unlink(temporary)
            raise
    except OSError as error:
        check_folder(path)
        raise RsmkitError(
            f"{path}: cannot be written: {error.strerror}. Free the disk or choose a folder you may write to."
        ) from None


def check_folder(*paths: Path) -> None:
    """Refuse a file whose folder does not exist, before work is done that it should hold.

    Raises
    ------
    RsmkitError
        Naming the folder.
    """
    for path in paths:
        if not path.parent.exists():
            raise RsmkitError(
                f"{path}: cannot be written, for there is no folder {path.parent}. Make it, or name one that "
                "is there"
            ) from None


def read_text(path: Path, remedy: str) -> str:
    """Read a text, if it is a regular file; `remedy` ends the message when that is not possible."""
    try:
        return read_regular(path).decode("utf-8").replace("\r\n", "\n").replace("\r", "\n")
    except UnicodeDecodeError:
        raise RsmkitError(f"{path}: damaged (not UTF-8 text). {remedy}") from None
    except OSError as error:
        raise RsmkitError(f"{path}: cannot be read: {error.strerror}. {remedy}") from None


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
