"""JSON values in and out; when reading, everything is checked, because files get edited and mixed up."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, TypeVar

import numpy as np

from rsmkit.errors import RsmkitError
from rsmkit.language.space import Factor, Floats, Space

__all__ = [
    "fail",
    "number",
    "numbers",
    "read_floats",
    "read_item",
    "read_number",
    "read_space",
    "write_space",
]


T = TypeVar("T")


def number(value: float) -> float | None:
    """JSON number, None for nan and infinities."""
    return float(value) if math.isfinite(value) else None


def numbers(values: Floats) -> list[float | None]:
    """JSON numbers, None for nan and infinities."""
    return [number(v) for v in np.asarray(values).tolist()]


def fail(message: str) -> RsmkitError:
    """Make the error for a model that cannot be read."""
    return RsmkitError(f"surface model: {message}; fit the surface again")


def read_item(data: Any, key: str, kind: type[T]) -> T:
    """Take a value of one type out of an object."""
    if not isinstance(data, Mapping):
        raise fail(f"expected an object that holds '{key}', found {type(data).__name__}")
    if key not in data:
        raise fail(f"'{key}' is missing")
    value = data[key]
    if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
        raise fail(f"'{key}' should be of type {kind.__name__}, found {type(value).__name__}")
    return value


def read_number(data: Any, key: str) -> float:
    """Take a finite number out of an object."""
    value = read_item(data, key, object)
    if not _all_numbers(value, 0):
        raise fail(f"'{key}' should be a finite number, found {value!r:.40}")
    return float(value)  # type: ignore[arg-type]


def read_floats(data: Any, key: str, shape: tuple[int | None, ...]) -> Floats:
    """Take an array of finite numbers out of an object; None in the shape fits any length."""
    value = read_item(data, key, list)
    if not _all_numbers(value):
        raise fail(f"'{key}' should hold finite numbers only")
    try:
        array = np.array(value, dtype=float)
    except ValueError:
        raise fail(f"'{key}' has rows of different lengths") from None
    if array.size == 0 and len(shape) == 2 and array.ndim == 1:
        array = array.reshape(0, shape[1] or 0)
    expected = tuple(n if n is not None else m for n, m in zip(shape, array.shape, strict=False))
    if array.ndim != len(shape) or array.shape != expected:
        wanted = " x ".join("any" if n is None else str(n) for n in shape)
        raise fail(f"'{key}' should have size {wanted}, found {' x '.join(map(str, array.shape))}")
    return array


def write_space(space: Space) -> list[dict[str, Any]]:
    """Turn factors into JSON values."""
    return [
        {
            "name": f.name,
            "low": f.low,
            "high": f.high,
            "label": f.label,
            "unit": f.unit,
            "integer": f.integer,
            "levels": list(f.levels),
        }
        for f in space
    ]


def read_space(data: Any, key: str = "factors") -> Space:
    """Inverse of :func:`write_space`."""
    factors = []
    for row in read_item(data, key, list):
        levels = read_item(row, "levels", list)
        if not all(isinstance(level, str | float | int) and not isinstance(level, bool) for level in levels):
            raise fail("'levels' should hold numbers or texts")
        factors.append(
            Factor(
                read_item(row, "name", str),
                read_number(row, "low"),
                read_number(row, "high"),
                read_item(row, "label", str),
                read_item(row, "unit", str),
                read_item(row, "integer", bool),
                tuple(levels),
            )
        )
    return Space(factors)


def _all_numbers(value: Any, depth: int = 2) -> bool:
    if isinstance(value, list):
        return depth > 0 and all(_all_numbers(item, depth - 1) for item in value)
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e300
