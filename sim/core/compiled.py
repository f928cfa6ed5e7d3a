"""How the numeric core is compiled: decorators for three kinds of functions, and what keeps them apart.

A compiled function contains those it calls, and the compiler goes through them again with every caller; large
arguments cost it more than the functions themselves. So what is large is handed over by :func:`reference`,
and the integrator reaches the loads on the surface through :func:`call`.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol, TypeVar, cast

import numba
import numba.core.cgutils
import numba.extending
from llvmlite import ir

from sim.core.machine_code import MachineCode

__all__ = ["MACHINE_CODE", "Reference", "call", "compiled", "inlined", "kernel", "reference"]

MACHINE_CODE = MachineCode(Path(__file__).resolve().parents[1], "rsmkit-sim", "SIM_CACHE_DIR")

cgutils: Any = numba.core.cgutils
types: Any = numba.types

Function = TypeVar("Function", bound=Callable[..., Any])
T = TypeVar("T")
T_co = TypeVar("T_co", covariant=True)


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


class Reference(Protocol[T_co]):
    """Where a value lies in memory; at index 0 is the value itself."""

    def __getitem__(self, index: int) -> T_co: ...


def _place_on_stack(typing_context: Any, value: Any) -> Any:
    """Give a value a place that lasts until the compiled function that asks for it returns.

    A vehicle's model is some three hundred numbers, each an argument of its own when handed over by value:
    that took most of the compiler's time. In compiled functions only; truth values have no place.
    """

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        place = cgutils.alloca_once(builder, context.get_data_type(value))
        context.pack_value(builder, value, values[0], place)
        return place

    return types.CPointer(value)(value), generate


def _call_by_address(typing_context: Any, address: Any, arguments: Any) -> Any:
    """Call what :meth:`.MachineCode.entry` has made, with a tuple of exactly its arguments."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        given = cgutils.unpack_tuple(builder, values[1])
        kind = ir.FunctionType(context.get_value_type(types.void), [part.type for part in given])
        builder.call(builder.inttoptr(values[0], kind.as_pointer()), given)
        return context.get_dummy_value()

    return types.void(types.int64, arguments), generate


reference: Callable[[T], Reference[T]] = cast(Any, numba.extending.intrinsic)(_place_on_stack)
call: Callable[[int, tuple[Any, ...]], None] = cast(Any, numba.extending.intrinsic)(_call_by_address)
