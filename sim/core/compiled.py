"""Machine code for the numeric core: numba, cached on disk, never stale.

Numba keys the cache of a function by the file that defines it, so editing a function it *calls* in another
file would leave old machine code in use. Here the cache folder is named after a hash of every source file of
the package: change one byte and everything is compiled afresh, once.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

__all__ = ["cache_folder", "compiled", "inlined", "kernel"]

_PACKAGE = Path(__file__).resolve().parents[1]
_KEEP_SECONDS = 7 * 24 * 3600.0

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(function: Function) -> Function:
    """Compile a function of floats, float arrays and named tuples of them to machine code.

    Strict IEEE arithmetic (no fast-math), so that results do not depend on how the compiler reorders sums;
    a division by zero gives inf or NaN, as in NumPy. Works as a plain decorator: ``@compiled``.

    Parameters
    ----------
    function : callable
        Function in numba's nopython subset.

    Returns
    -------
    callable
        The compiled function; the first call with new argument types compiles, or loads from
        :func:`cache_folder`.
    """
    return _machine_code(function)


def kernel(function: Function) -> Function:
    """Compile a function that works on the arrays it is given, makes none and returns none.

    Its arrays are not reference-counted: counting those of a vehicle's model up and down, atomically and at
    every call, took a fifth of a flight. To allocate an array in here does not compile.
    """
    return _machine_code(function, _nrt=False)


def inlined(function: Function) -> Function:
    """Compile a function of an inner loop into its callers, where its dozens of arguments cost nothing."""
    return _machine_code(function, _nrt=False, forceinline=True)


def _machine_code(function: Function, **options: bool) -> Function:
    config: Any = numba.config
    njit: Any = numba.njit
    folder_before = config.CACHE_DIR
    config.CACHE_DIR = str(cache_folder())
    try:
        return cast(Function, njit(cache=True, error_model="numpy", **options)(function))
    finally:
        config.CACHE_DIR = folder_before


def cache_folder() -> Path:
    """Folder of the machine code that belongs to the present sources.

    ``$SIM_CACHE_DIR`` when set; else the package's own ``__pycache__``; else, when the package is read-only,
    the user's cache folder; else a temporary one.
    """
    global _folder
    if _folder is None:
        _folder = _first_writable(f"machine-code-{_source_hash()}")
    return _folder


_folder: Path | None = None


def _source_hash() -> str:
    digest = hashlib.sha256()
    for source in sorted(_PACKAGE.glob("**/*.py")):
        digest.update(source.relative_to(_PACKAGE).as_posix().encode())
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


def _first_writable(name: str) -> Path:
    chosen = os.environ.get("SIM_CACHE_DIR")
    parents = [Path(chosen)] if chosen else []
    parents.append(_PACKAGE / "__pycache__")
    parents.append(Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "rsmkit-sim")
    for parent in parents:
        folder = parent / name
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder):
                pass
        except OSError:
            continue
        _remove_outdated(parent, keep=folder)
        return folder
    return Path(tempfile.mkdtemp(prefix="rsmkit-sim-"))


def _remove_outdated(parent: Path, keep: Path) -> None:
    """Drop machine code of earlier sources that nobody has written to for a week."""
    for folder in parent.glob("machine-code-*"):
        if folder != keep and time.time() - folder.stat().st_mtime > _KEEP_SECONDS:
            shutil.rmtree(folder, ignore_errors=True)
