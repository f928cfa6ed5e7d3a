"""How the numeric core is compiled: decorators for three kinds of functions.

A compiled function contains those it calls, and the compiler goes through them again with every caller. So
what is large is handed over by :func:`sim.core.machine_code.reference`, and the integrator reaches the loads
on the surface through :func:`sim.core.machine_code.call`.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba.extending

from sim.core.machine_code import MachineCode, Reference, cgutils, types

__all__ = ["MACHINE_CODE", "compiled", "inlined", "kernel", "part"]

MACHINE_CODE = MachineCode(Path(__file__).resolve().parents[1], "rsmkit-sim", "SIM_CACHE_DIR")

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(function: Function) -> Function:
    """Compile a function of floats, float arrays and named tuples of them: ``@compiled``.

    See :meth:`sim.core.machine_code.MachineCode.compile` for the arithmetic and the cache.
    """
    return MACHINE_CODE.compile(function)


def kernel(function: Function) -> Function:
    """Compile a function that works on the arrays it is given, makes none and returns none.

    Its arrays are not reference-counted: counting those of a vehicle's model up and down, atomically and at
    every call, took a fifth of a flight. To allocate an array in here does not compile.
    """
    return MACHINE_CODE.compile(function, _nrt=False)


def inlined(function: Function) -> Function:
    """Compile a function of an inner loop into its callers, where its dozens of arguments cost nothing."""
    return MACHINE_CODE.compile(function, _nrt=False, forceinline=True)


def _place_of_part(typing_context: Any, whole: Any, index: Any) -> Any:
    """Where a field of a named tuple lies, given where the tuple lies: nothing is copied."""
    number = index.literal_value

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return cgutils.gep_inbounds(builder, values[0], 0, number)

    return types.CPointer(whole.dtype.types[number])(whole, index), generate


part: Callable[[Reference[Any], int], Reference[Any]] = cast(Any, numba.extending.intrinsic)(
    prefer_literal=True
)(_place_of_part)
