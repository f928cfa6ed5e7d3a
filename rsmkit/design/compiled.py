"""How the searches for designs are compiled: one decorator."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from rsmkit.machine_code import MachineCode

__all__ = ["MACHINE_CODE", "compiled"]

MACHINE_CODE = MachineCode(Path(__file__).resolve().parent, "rsmkit-design", "NUMBA_CACHE_DIR")

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(function: Function) -> Function:
    """Compile a function at its first call; it holds no lock while it runs, so that threads run it at once.

    Its arrays are not reference-counted, so that it must not make any. Plain IEEE arithmetic in the order
    written, so that a design depends on nothing but its seed. See
    :meth:`rsmkit.machine_code.MachineCode.compile` for the cache.
    """
    return MACHINE_CODE.compile(function, nogil=True, _nrt=False)
