"""Machine code for the searches: numba, cached on disk, never stale, also where nothing can be written.

Numba keys its cache by the file that defines a function, so a change of a function that it *calls* in another
file would go unnoticed; the cache folder is therefore named after a hash of the files with compiled code.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

__all__ = ["cache_folder", "compiled"]

PACKAGE = Path(__file__).resolve().parent
SOURCES = (
    "machine_code.py",
    "optimal/encoding.py",
    "optimal/exchange.py",
    "optimal/fedorov.py",
    "optimal/line_search.py",
)

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(function: Function) -> Function:
    """Compile a function at its first call; it holds no lock while it runs, so that threads run it at once.

    Plain IEEE arithmetic in the order written, so that a design depends on nothing but its seed.
    """
    config: Any = numba.config
    before, config.CACHE_DIR = config.CACHE_DIR, str(cache_folder())
    try:
        return cast(Function, numba.njit(cache=True, nogil=True, error_model="numpy")(function))
    finally:
        config.CACHE_DIR = before


@cache
def cache_folder() -> Path:
    """Folder of the machine code that belongs to these sources.

    In ``$NUMBA_CACHE_DIR`` when set, else beside the package, else (read-only installation) in the user's
    cache, else in a folder for temporary files.
    """
    digest = hashlib.sha256()
    for source in SOURCES:
        digest.update((PACKAGE / source).read_bytes())
    name = f"rsmkit-design-{digest.hexdigest()[:16]}"
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    parents = [Path(chosen)] if chosen else []
    parents += [PACKAGE / "__pycache__", Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser()]
    for parent in parents:
        folder = parent / name
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder):
                return folder
        except OSError:
            continue
    return Path(tempfile.mkdtemp(prefix=name))
