"""Keeping only the end of what is being printed into a file, whoever prints, without stopping it.

The beginning of the file becomes a hole: its bytes are given back to the disk, and whoever writes goes on at
the same place. Where holes cannot be made the file is emptied.
"""

from __future__ import annotations

import ctypes

from rsmkit.io.files.system_calls import read_at
from rsmkit.runs.one_run.pristine import os

__all__ = ["END_KEPT_BYTES", "drop_beginning", "last_bytes"]

END_KEPT_BYTES = 1 << 20
_PUNCH_HOLE = 0x02 | 0x01  # and keep the size
_BLOCK = 512


def drop_beginning(handle: int, most: int = 4 * END_KEPT_BYTES) -> None:
    """Free the disk of all but the last megabyte of a file that takes up more than `most` bytes.

    Parameters
    ----------
    handle : int
        The file, open for writing. Emptied where holes cannot be made; its writers must append then.
    most : int
        Bytes on the disk that are let be.

    Raises
    ------
    OSError
        If neither can be done.
    """
    found = os.fstat(handle)
    if getattr(found, "st_blocks", found.st_size // _BLOCK) * _BLOCK <= most:
        return
    beginning = found.st_size - END_KEPT_BYTES
    if beginning > 0 and not _punched(handle, beginning):
        os.ftruncate(handle, 0)


def last_bytes(handle: int, count: int) -> bytes:
    """Give the end of a file without the hole before it."""
    end = os.fstat(handle).st_size
    return read_at(handle, count, max(0, end - count)).lstrip(b"\0")


def _punched(handle: int, length: int) -> bool:
    try:
        fallocate = ctypes.CDLL(None).fallocate
    except (AttributeError, OSError, TypeError):  # not Linux
        return False
    fallocate.argtypes = [ctypes.c_int, ctypes.c_int, ctypes.c_longlong, ctypes.c_longlong]
    return bool(fallocate(handle, _PUNCH_HOLE, 0, length) == 0)
