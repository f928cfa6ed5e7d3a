"""Wrong settings refused with a sentence: every field of a dataclass against its own type annotation."""

from __future__ import annotations

import math
import types
from collections.abc import Callable, Sequence
from dataclasses import fields
from functools import cache
from numbers import Integral, Real
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from sim.core.errors import InputError

__all__ = [
    "check_angles",
    "check_fields",
    "check_kinds",
    "check_numbers",
    "check_rates",
    "check_speed",
    "float_array",
    "is_number",
]

Floats = NDArray[np.float64]
Check = Callable[[Any], bool]

_LARGEST = 1e60
FASTEST_DEG_S = 36_000.0
FASTEST_M_S = 75_000.0
"""Escape from the Sun at the Earth's orbit, 42.1 km/s, against its 29.8 km/s, drawn in: 72.8 km/s at most."""


def check_fields(table: object, *, unbounded: Sequence[str] = ()) -> None:
    """Refuse a dataclass of which a field does not hold what its annotation says.

    A float must be finite (unless listed as `unbounded`) and may be any real number but a truth value; a
    tuple may also be a list or an array; a ``Literal`` names its choices.

    Raises
    ------
    InputError
        Naming the field, what it should be and what it is.
    """
    kind: Any = type(table)
    for name, hint, fits in _checks(kind):
        value = getattr(table, name)
        if name in unbounded and isinstance(value, float) and math.isinf(value):
            continue
        if not fits(value):
            raise InputError(f"{name} must be {_wording(hint)}, not {value!r}")


def check_numbers(**values: object) -> None:
    """Refuse arguments that are no finite numbers, naming them."""
    for name, value in values.items():
        if not is_number(value):
            raise InputError(f"{name} must be a finite number, not {value!r}")


def check_kinds(**pairs: tuple[object, type]) -> None:
    """Refuse arguments that are not of their class; each is given as (value, class)."""
    for name, (value, kind) in pairs.items():
        if not isinstance(value, kind):
            raise InputError(f"{name} must be of type {kind.__name__}, not {value!r}")


def check_angles(largest_deg: float, **values: float) -> None:
    """Refuse angles, in degrees, beyond `largest_deg` to either side, naming them."""
    for name, value in values.items():
        if not abs(value) <= largest_deg:
            raise InputError(f"{name} must lie between {-largest_deg:g} and {largest_deg:g}, not {value:g}")


def check_rates(**values: float) -> None:
    """Refuse body rates, in deg/s, beyond a hundred turns a second, naming them."""
    for name, value in values.items():
        if not abs(value) <= FASTEST_DEG_S:
            raise InputError(f"{name} must lie within +-{FASTEST_DEG_S:g} deg/s, not {value:g}")


def check_speed(name: str, value: float) -> None:
    """Refuse a speed, in m/s, at which nothing meets the Earth's air."""
    if not value <= FASTEST_M_S:
        raise InputError(
            f"{name} must be at most {FASTEST_M_S:g} m/s, not {value:g}: nothing bound to the Sun enters "
            "faster than 72,800 m/s"
        )


def float_array(name: str, values: object) -> Floats:
    """Make a column of numbers an array; refuses anything else."""
    try:
        return np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"{name} must be a column of numbers, not {values!r}") from None


def is_number(value: object) -> bool:
    """Whether this is a real number (a truth value is none) of a size that does not overflow in a formula."""
    if type(value) is float:  # nearly always; asking a number whether it is a Real takes far longer
        return abs(value) <= _LARGEST
    if isinstance(value, bool | np.bool_) or not isinstance(value, Real):
        return False
    return abs(float(value)) <= _LARGEST


@cache
def _checks(table: Any) -> tuple[tuple[str, Any, Check], ...]:
    """Of every field its name, its type and what tells whether a value is of that type.

    Made once for a class: a search asks hundreds of thousands of times.
    """
    hints = get_type_hints(table)
    return tuple((field.name, hints[field.name], _check(hints[field.name])) for field in fields(table))


def _check(hint: Any) -> Check:
    origin, choices = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        options = [_check(choice) for choice in choices]
        return lambda value: any(fits(value) for fits in options)
    if origin is Literal:
        return lambda value: isinstance(value, str) and value in choices
    if origin is tuple:
        row = choices[-1] is ...
        parts = [_check(choice) for choice in choices[: 1 if row else None]]

        def fits_in_place(value: Any) -> bool:
            if not isinstance(value, tuple | list | np.ndarray) or np.ndim(value) == 0:
                return False
            wanted = parts * len(value) if row else parts
            return len(value) == len(wanted) and all(fits(v) for fits, v in zip(wanted, value, strict=True))

        return fits_in_place
    if hint is float:
        return is_number
    if hint is int:
        return lambda value: isinstance(value, Integral) and not isinstance(value, bool)
    return lambda value: isinstance(value, hint)


def _wording(hint: Any) -> str:
    origin, choices = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        return " or ".join(_wording(choice) for choice in choices)
    if origin is Literal:
        return "one of " + ", ".join(choices)
    if origin is tuple:
        if choices[-1] is ...:
            return f"a row of {getattr(choices[0], '__name__', choices[0])}"
        return f"{len(choices)} values, each {_wording(choices[0])}"
    words = {
        float: "a finite number",
        int: "a whole number",
        str: "a text",
        bool: "true or false",
        type(None): "none",
    }
    return words.get(hint) or f"of type {hint.__name__}"
