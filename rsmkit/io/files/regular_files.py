"""Opening files of a study's folder, which a stranger may have packed.

Under none of our names is a link followed, so that nothing outside the folder is read or written; a pipe or a
device, from which reading may never end, is refused.
"""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path, PurePath

from rsmkit.errors import RsmkitError

__all__ = ["LARGEST_BYTES", "inside", "open_regular", "read_regular", "stays_inside"]

LARGEST_BYTES = 1 << 30
"""Of a file that is read as a whole."""
_CAREFULLY = sum(getattr(os, name, 0) for name in ("O_NOFOLLOW", "O_NONBLOCK", "O_CLOEXEC", "O_BINARY"))


def open_regular(path: Path, flags: int = os.O_RDONLY, mode: int = 0o666) -> int:
    """Open a file as ``os.open`` does, if it is one.

    Returns
    -------
    int
        Its handle.

    Raises
    ------
    OSError
        As ever; also if it is a link, or no regular file.
    """
    try:
        if not hasattr(os, "O_NOFOLLOW") and os.path.islink(path):
            raise OSError(errno.ELOOP, "it is a link, and links are not followed here", str(path))
        handle = os.open(os.fspath(path), flags | _CAREFULLY, mode)
    except OSError as error:
        if error.errno in (errno.ELOOP, errno.EMLINK) and os.path.islink(path):
            raise OSError(errno.ELOOP, "it is a link, and links are not followed here", str(path)) from None
        raise
    found = os.fstat(handle)
    if not stat.S_ISREG(found.st_mode):
        os.close(handle)
        directory = stat.S_ISDIR(found.st_mode)
        raise OSError(errno.EISDIR, "it is a folder" if directory else "it is not a file", str(path))
    return handle


def read_regular(path: Path, most: int = LARGEST_BYTES) -> bytes:
    """Read a file of at most so many bytes as a whole.

    Raises
    ------
    OSError
        As for :func:`open_regular`; also if it is larger.
    """
    handle = open_regular(path)
    with open(handle, "rb") as stream:
        size = os.fstat(handle).st_size
        if size > most:
            raise OSError(errno.EFBIG, f"it has {size >> 20} MB; at most {most >> 20} are read", str(path))
        return stream.read(most)


def stays_inside(name: str) -> bool:
    """Whether a relative name, as it is written, lies within the folder it is relative to."""
    path = PurePath(name)
    return bool(path.parts) and not path.is_absolute() and ".." not in path.parts and "\0" not in name


def inside(folder: Path, name: str, where: str) -> Path:
    """Give the path of a file that a study file names.

    Parameters
    ----------
    folder : path
        The study's folder.
    name : str
        Relative to it.
    where : str
        The key that names it, for the message.

    Raises
    ------
    RsmkitError
        If it lies elsewhere, by its name or by way of a link, or is itself a link or no regular file.
    """
    path = folder / name
    if not stays_inside(name) or not path.resolve().is_relative_to(folder.resolve()):
        raise RsmkitError(f"{where}: {name} lies outside the study's folder; put a copy beside study.toml")
    if path.is_symlink():
        raise RsmkitError(f"{where}: {name} is a link, and links are not followed; put a copy in its place")
    if path.exists() and not path.is_file():
        raise RsmkitError(f"{where}: {name} is not a file")
    return path
