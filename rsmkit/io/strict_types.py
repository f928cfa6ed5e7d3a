"""Parsed data into types, strictly: nothing is guessed, and every mistake is reported with its place.

What TOML tables and JSON documents share. A text where a number belongs is a mistake, not a number; classes
are dataclasses whose type hints say what may stand where.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, cast, get_args, get_origin, get_type_hints

from cattrs import (
    ClassValidationError,
    Converter,
    ForbiddenExtraKeysError,
    IterableValidationError,
    IterableValidationNote,
)

from rsmkit.errors import DamagedError, RsmkitError, did_you_mean, nearest

__all__ = [
    "NULL_IS_NAN",
    "ReadBy",
    "Shape",
    "describe",
    "join",
    "show",
    "strict_converter",
    "unknown_key",
    "what_is_wrong",
]

Hook = Callable[[Any, Any], Any]

# A terminal obeys control characters (tab and newline may stay); half a character cannot be written.
_UNFIT = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\ud800-\udfff]")
_WORDS = {float: "a number", int: "a whole number", bool: "true or false", str: "a text"}
_REFUSALS = (ValueError, OverflowError, RsmkitError, ClassValidationError, IterableValidationError)
LARGEST = 1e300
"""Numbers of an array up to this size; squares of larger ones are not needed anywhere."""

NULL_IS_NAN = "null stands for a number that is none"
"""``Annotated[float, NULL_IS_NAN]``: written as null where it is not finite, and read back as nan."""


@dataclass(frozen=True)
class Shape:
    """``Annotated[Floats, Shape("runs", "factors")]``: an array of finite numbers and the names of its axes.

    Axes of one name have one length in all arrays of a class.
    """

    axes: tuple[str, ...]

    def __init__(self, *axes: str) -> None:
        object.__setattr__(self, "axes", axes)


@dataclass(frozen=True)
class ReadBy:
    """``Annotated[Surface, ReadBy(read_surface)]``: what a function makes of the value, or refuses."""

    read: Callable[[Any], Any]


def strict_converter(*, unknown_keys: bool) -> Converter:
    """Make the converter that reads strictly; `unknown_keys` says whether it overlooks keys of no field."""
    converter = Converter(forbid_extra_keys=not unknown_keys, detailed_validation=True)
    for kind in (float, int, bool, str):
        converter.register_structure_hook(kind, _strict_scalar(kind))
    for wanted, factory in (
        ((Union, UnionType), _strict_union),
        ((tuple, list), _strict_list),
        ((dict,), _strict_dict),
    ):
        converter.register_structure_hook_factory(
            _origin_in(wanted), lambda kind, make=factory: make(converter, kind)
        )
    converter.register_structure_hook_func(_origin_in((Literal,)), _strict_literal)
    converter.register_structure_hook_factory(is_dataclass, lambda kind: _strict_dataclass(converter, kind))
    converter.register_structure_hook_factory(
        lambda kind: hasattr(kind, "from_form"), lambda kind: _of_another_form(converter, kind)
    )
    # Last, which is asked first: an annotated class looks like the class itself.
    converter.register_structure_hook_factory(
        _origin_in((Annotated,)), lambda kind: _annotated(converter, kind)
    )
    return converter


def what_is_wrong(error: BaseException, path: str) -> list[str]:
    """Turn what a strict converter raised into one line per mistake, beginning with the key's path."""
    if isinstance(error, ClassValidationError):
        noted, others = error.group_exceptions()
        return [
            *(line for inner, note in noted for line in what_is_wrong(inner, join(path, note.name))),
            *(line for inner in others for line in what_is_wrong(inner, path)),
        ]
    if isinstance(error, IterableValidationError):
        noted_items, _ = error.group_exceptions()
        return [line for inner, note in noted_items for line in what_is_wrong(inner, _at(path, note.index))]
    if isinstance(error, ForbiddenExtraKeysError):
        known = [item.name for item in fields(error.cl)]
        return [unknown_key(path, key, known) for key in sorted(error.extra_fields)]
    if isinstance(error, DamagedError):
        inner = what_is_wrong(error.cause, path) if error.cause else [f"{path} {m}" for m in error.mistakes]
        return [text.strip() for text in inner]
    if isinstance(error, KeyError):
        return [f"{path} is missing"]
    if not isinstance(error, _REFUSALS):
        raise error  # a defect of the program, which cattrs has caught along with the mistakes
    return [f"{path} {error}".strip()]


def unknown_key(path: str, key: str, known: list[str]) -> str:
    """Say that a key is none of the known ones, and which was meant."""
    near = nearest(key, known)
    hint = f"did you mean {near}?" if near else f"known keys: {', '.join(known)}"
    return f"unknown key {join(path, key)}; {hint}"


def join(path: str, key: str) -> str:
    """Path of a key inside the table at `path`."""
    return f"{path}.{key}" if path else key


def _at(path: str, index: int | str) -> str:
    return f"{path}[{index}]" if isinstance(index, int) else join(path, index)


def _origin_in(wanted: tuple[Any, ...]) -> Callable[[Any], bool]:
    return lambda kind: get_origin(kind) in wanted


def _strict_scalar(kind: type) -> Hook:
    def read(value: Any, _: Any) -> Any:
        if not _fits(value, kind):
            raise ValueError(f"must be {_WORDS[kind]}, got {show(value)}")
        if kind is str and _UNFIT.search(value):
            raise ValueError(f"must not hold control characters, got {show(value)}")
        return kind(value)

    return read


def _fits(value: Any, kind: Any) -> bool:
    if kind is float:
        return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    if kind is int:
        return isinstance(value, int) and not isinstance(value, bool)
    return isinstance(value, kind)


def _strict_literal(value: Any, kind: Any) -> Any:
    options = get_args(kind)
    if not any(value == option and type(value) is type(option) for option in options):
        hint = did_you_mean(value, map(str, options))
        raise ValueError(f"must be {describe(kind)}, got {show(value)}{hint}")
    return value


def _strict_union(converter: Converter, kind: Any) -> Hook:
    members = [member for member in get_args(kind) if member is not NoneType]
    optional = len(members) < len(get_args(kind))

    def read(value: Any, _: Any) -> Any:
        if value is None and optional:
            return None
        if len(members) == 1:
            return converter.structure(value, members[0])
        if isinstance(value, dict):
            for table in filter(is_dataclass, members):
                return converter.structure(value, cast(type[Any], table))
        # The value's own type first: 3 stays 3 where float | int may stand.
        for member in sorted(members, key=lambda member: type(value) is not member):
            try:
                return converter.structure(value, member)
            except _REFUSALS:
                continue
        raise ValueError(f"must be {' or '.join(map(describe, members))}, got {show(value)}")

    return read


def _strict_list(converter: Converter, kind: Any) -> Hook:
    element, make = get_args(kind)[0], get_origin(kind)
    if make is tuple and get_args(kind)[-1] is not Ellipsis:
        return _strict_row(converter, get_args(kind))

    def read(value: Any, _: Any) -> Any:
        if not isinstance(value, list):
            raise ValueError(f"must be {describe(kind)}, got {show(value)}")
        if element is float and set(map(type, value)) == {float} and all(map(math.isfinite, value)):
            return make(value)  # a list may have a number for each of a million runs
        return make(_structure_all(converter, enumerate(value), element).values())

    return read


def _strict_row(converter: Converter, elements: tuple[Any, ...]) -> Hook:
    """A list whose elements each have a type of their own."""

    def read(value: Any, _: Any) -> Any:
        if not isinstance(value, list) or len(value) != len(elements):
            raise ValueError(f"must be a list of {len(elements)}, got {show(value)}")
        pairs = zip(value, elements, strict=True)
        return tuple(converter.structure(item, element) for item, element in pairs)

    return read


def _strict_dict(converter: Converter, kind: Any) -> Hook:
    element = get_args(kind)[1]

    def read(value: Any, _: Any) -> Any:
        if not isinstance(value, dict):
            raise ValueError(f"must be a table, got {show(value)}")
        if any(map(_UNFIT.search, value)):
            raise ValueError("must not have control characters in its keys")
        return _structure_all(converter, value.items(), element)

    return read


def _structure_all(converter: Converter, items: Iterable[tuple[Any, Any]], element: Any) -> dict[Any, Any]:
    """Read every item, and report every mistake with the item's index or key."""
    made, errors = {}, []
    for index, item in items:
        try:
            made[index] = converter.structure(item, element)
        except _REFUSALS as error:
            error.add_note(IterableValidationNote(f"element {index}", index, element))
            errors.append(error)
    if errors:
        raise IterableValidationError("elements", errors, dict)
    return made


def _strict_dataclass(converter: Converter, kind: Any) -> Hook:
    from cattrs.gen import make_dict_structure_fn

    hints = get_type_hints(kind, include_extras=True)
    for item in fields(kind):
        item.type = hints[item.name]  # cattrs itself would resolve hints without what Annotated notes
    structure = make_dict_structure_fn(kind, converter, _cattrs_forbid_extra_keys=converter.forbid_extra_keys)
    shapes = {item.name: shape for item in fields(kind) if (shape := _note(hints[item.name], Shape))}

    def read(value: Any, kind: Any) -> Any:
        if not isinstance(value, dict):
            raise ValueError(f"must be a table, got {show(value)}")
        made = structure(value, kind)
        _check_lengths(made, shapes)
        return made

    return read


def _of_another_form(converter: Converter, kind: Any) -> Hook:
    """Read the form that a class names by the argument of its ``from_form``."""
    form = get_type_hints(kind.from_form, include_extras=True)["form"]

    def read(value: Any, kind: Any) -> Any:
        return kind.from_form(converter.structure(value, form))

    return read


def _annotated(converter: Converter, kind: Any) -> Hook:
    inner, *notes = get_args(kind)
    shape, other = _note(kind, Shape), _note(kind, ReadBy)
    if shape:
        return lambda value, _: _array(value, shape)
    if other:
        return lambda value, _: other.read(value)
    if NULL_IS_NAN in notes:
        return lambda value, _: math.nan if value is None else converter.structure(value, inner)
    return lambda value, _: converter.structure(value, inner)


def _note(hint: Any, kind: type) -> Any:
    """Find a note of one kind in a type hint, or in the one type of an optional one."""
    if get_origin(hint) is Annotated:
        return next((note for note in get_args(hint)[1:] if isinstance(note, kind)), None)
    if get_origin(hint) in (Union, UnionType):
        return next((found for member in get_args(hint) if (found := _note(member, kind))), None)
    return None


def _array(value: Any, shape: Shape) -> Any:
    import numpy as np

    if not isinstance(value, list):
        raise ValueError(f"must be a list of numbers, got {show(value)}")
    if not _all_numbers(value, len(shape.axes) - 1):
        place, wrong = next(_not_numbers(value, len(shape.axes)))
        raise ValueError(f"must hold finite numbers only, got {show(wrong)} at {place}")
    if not value:  # of a list without rows nobody knows how long they would be
        return np.empty((0,) * len(shape.axes))
    try:
        return np.array(value, float)
    except ValueError:
        raise ValueError("has rows of different lengths") from None


def _all_numbers(values: list[Any], deeper: int) -> bool:
    if deeper:
        return all(isinstance(row, list) and _all_numbers(row, deeper - 1) for row in values)
    return all(map(_is_number, values))


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < LARGEST


def _not_numbers(value: Any, depth: int) -> Iterator[tuple[str, Any]]:
    if depth and isinstance(value, list):
        for index, item in enumerate(value):
            for place, wrong in _not_numbers(item, depth - 1):
                yield f"[{index}]{place}", wrong
    elif depth or not _is_number(value):
        yield "", value


def _check_lengths(made: Any, shapes: Mapping[str, Shape]) -> None:
    """Refuse arrays of one class whose axes of one name differ in length."""
    lengths: dict[str, tuple[int, str]] = {}
    for name, shape in shapes.items():
        array = getattr(made, name)
        if array is None or (array.size == 0 and array.ndim > 1):
            continue
        for axis, length in zip(shape.axes, array.shape, strict=True):
            known, first = lengths.setdefault(axis, (length, name))
            if known != length:
                raise ValueError(f"has {known} {axis} in {first} but {length} in {name}")


def describe(kind: Any) -> str:
    """Say what a type wants, in words."""
    if kind in _WORDS:
        return _WORDS[kind]
    if get_origin(kind) is Literal:
        return "one of " + ", ".join(show(option) for option in get_args(kind))
    if get_origin(kind) in (tuple, list):
        return f"a list (each element {describe(get_args(kind)[0])})"
    return "a table"


def show(value: Any) -> str:
    """Show a value as a file would hold it, shortened."""
    text = f'"{value}"' if isinstance(value, str) else repr(value)
    text = {"True": "true", "False": "false", "None": "nothing"}.get(text, text)
    return text if len(text) <= 60 else text[:57] + "..."
