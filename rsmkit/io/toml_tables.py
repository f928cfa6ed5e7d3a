"""Strict reading of parsed TOML into dataclasses: every mistake reported, nothing guessed.

A text where a number belongs is an error, not a number; an unknown key is an error with the closest
known one.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable
from dataclasses import MISSING, fields, is_dataclass
from difflib import get_close_matches
from types import NoneType, UnionType
from typing import Any, Literal, Union, cast, get_args, get_origin, get_type_hints

from cattrs import (
    ClassValidationError,
    Converter,
    ForbiddenExtraKeysError,
    IterableValidationError,
    IterableValidationNote,
)

from rsmkit.io.tagged_tables import TaggedTable

__all__ = ["read_tables"]

Hook = Callable[[Any, Any], Any]

_CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]")  # a terminal obeys them; tab and newline may stay
_WORDS = {float: "a number", int: "a whole number", bool: "true or false", str: "a text"}


def read_tables(
    data: dict[str, Any], kind: type[Any], tagged: Iterable[TaggedTable] = ()
) -> tuple[dict[str, Any], list[str]]:
    """Read parsed TOML into the fields of the dataclass `kind`, each by itself.

    Entries of a dict field and tables of a list field are also read one by one, so that one mistake does not
    hide the next.

    Returns
    -------
    parts : dict
        The fields, entries and tables that could be read.
    problems : list of str
        One line per mistake, beginning with the key's path. With none, ``kind(**parts)`` is complete.
    """
    converter = _converter()
    for table in tagged:
        table.register(converter)
    hints = get_type_hints(kind)
    parts: dict[str, Any] = {}
    problems = [_unknown_key("", key, list(hints)) for key in data if key not in hints]
    for item in fields(kind):
        if item.name in data:
            part, found = _read_part(converter, data[item.name], hints[item.name], item.name)
            if part is not None:
                parts[item.name] = part
            problems += found
        elif item.default is MISSING and item.default_factory is MISSING:
            problems.append(f"{item.name} is missing")
    return parts, problems


def _read_part(converter: Converter, data: Any, hint: Any, path: str) -> tuple[Any, list[str]]:
    if get_origin(hint) is dict and isinstance(data, dict):
        entries, problems = {}, []
        for key, value in data.items():
            entries[key], found = _read_part(converter, value, get_args(hint)[1], _join(path, key))
            problems += found
        return {key: entry for key, entry in entries.items() if entry is not None}, problems
    if get_origin(hint) is tuple and is_dataclass(get_args(hint)[0]) and isinstance(data, list):
        read = [_read_part(converter, v, get_args(hint)[0], f"{path}[{i}]") for i, v in enumerate(data)]
        return tuple(part for part, _ in read if part is not None), [
            line for _, found in read for line in found
        ]
    try:
        part = converter.structure(data, hint)
    except (ValueError, ClassValidationError, IterableValidationError) as error:
        return None, _explain(error, path)
    return part, _own_problems(part, path)


def _own_problems(table: Any, path: str) -> list[str]:
    """Collect what each nested table says of itself."""
    found: list[str] = []
    if is_dataclass(table):
        if hasattr(table, "problems"):
            found += [f"{_join(path, key)} {message}" for key, message in table.problems()]
        for item in fields(table):
            found += _own_problems(getattr(table, item.name), _join(path, item.name))
    elif isinstance(table, dict):
        for key, value in table.items():
            found += _own_problems(value, _join(path, str(key)))
    elif isinstance(table, tuple):
        for index, value in enumerate(table):
            found += _own_problems(value, f"{path}[{index}]")
    return found


def _join(path: str, key: str) -> str:
    return f"{path}.{key}" if path else key


def _at(path: str, index: int | str) -> str:
    return f"{path}[{index}]" if isinstance(index, int) else _join(path, index)


def _explain(error: BaseException, path: str) -> list[str]:
    if isinstance(error, ClassValidationError):
        noted, others = error.group_exceptions()
        return [
            *(line for inner, note in noted for line in _explain(inner, _join(path, note.name))),
            *(line for inner in others for line in _explain(inner, path)),
        ]
    if isinstance(error, IterableValidationError):
        noted_items, _ = error.group_exceptions()
        return [line for inner, note in noted_items for line in _explain(inner, _at(path, note.index))]
    if isinstance(error, ForbiddenExtraKeysError):
        known = [item.name for item in fields(error.cl)]
        return [_unknown_key(path, key, known) for key in sorted(error.extra_fields)]
    if isinstance(error, KeyError):
        return [f"{path} is missing"]
    return [f"{path} {error}"]


def _unknown_key(path: str, key: str, known: list[str]) -> str:
    close = get_close_matches(key, known, n=1)
    hint = f"did you mean {close[0]}?" if close else f"known keys: {', '.join(known)}"
    return f"unknown key {_join(path, key)}; {hint}"


def _converter() -> Converter:
    converter = Converter(forbid_extra_keys=True, detailed_validation=True)
    for kind in (float, int, bool, str):
        converter.register_structure_hook(kind, _strict_scalar(kind))
    converter.register_structure_hook_func(lambda kind: _origin(kind) is Literal, _strict_literal)
    converter.register_structure_hook_factory(
        lambda kind: _origin(kind) in (Union, UnionType), lambda kind: _strict_union(converter, kind)
    )
    converter.register_structure_hook_factory(
        lambda kind: _origin(kind) in (tuple, list), lambda kind: _strict_list(converter, kind)
    )
    converter.register_structure_hook_factory(
        lambda kind: _origin(kind) is dict, lambda kind: _strict_dict(converter, kind)
    )
    converter.register_structure_hook_factory(is_dataclass, lambda kind: _strict_dataclass(converter, kind))
    return converter


def _origin(kind: Any) -> Any:
    return get_origin(kind)


def _strict_scalar(kind: type) -> Hook:
    def read(value: Any, _: Any) -> Any:
        if not _fits(value, kind):
            raise ValueError(f"must be {_WORDS[kind]}, got {_show(value)}")
        if kind is str and _CONTROL.search(value):
            raise ValueError(f"must not hold control characters, got {_show(value)}")
        return kind(value)

    return read


def _fits(value: Any, kind: Any) -> bool:
    if kind is float:
        return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    if kind is int:
        return isinstance(value, int) and not isinstance(value, bool)
    return isinstance(value, kind)


def _strict_literal(value: Any, kind: Any) -> Any:
    if not any(value == option and type(value) is type(option) for option in get_args(kind)):
        raise ValueError(f"must be {_describe(kind)}, got {_show(value)}")
    return value


def _strict_union(converter: Converter, kind: Any) -> Hook:
    members = [member for member in get_args(kind) if member is not NoneType]

    def read(value: Any, _: Any) -> Any:
        if len(members) == 1:
            return converter.structure(value, members[0])
        if isinstance(value, dict):
            for table in filter(is_dataclass, members):
                return converter.structure(value, cast(type[Any], table))
        for member in members:
            try:
                return converter.structure(value, member)
            except (ValueError, ClassValidationError, IterableValidationError):
                continue
        raise ValueError(f"must be {' or '.join(map(_describe, members))}, got {_show(value)}")

    return read


def _strict_list(converter: Converter, kind: Any) -> Hook:
    element, make = get_args(kind)[0], get_origin(kind)

    def read(value: Any, _: Any) -> Any:
        if not isinstance(value, list):
            raise ValueError(f"must be {_describe(kind)}, got {_show(value)}")
        return make(_structure_all(converter, enumerate(value), element).values())

    return read


def _strict_dict(converter: Converter, kind: Any) -> Hook:
    element = get_args(kind)[1]

    def read(value: Any, _: Any) -> Any:
        if not isinstance(value, dict):
            raise ValueError(f"must be a table, got {_show(value)}")
        if any(map(_CONTROL.search, value)):
            raise ValueError("must not have control characters in its keys")
        return _structure_all(converter, value.items(), element)

    return read


def _structure_all(converter: Converter, items: Iterable[tuple[Any, Any]], element: Any) -> dict[Any, Any]:
    """Read every item, and report every mistake with the item's index or key."""
    made, errors = {}, []
    for index, item in items:
        try:
            made[index] = converter.structure(item, element)
        except (ValueError, ClassValidationError, IterableValidationError) as error:
            error.add_note(IterableValidationNote(f"element {index}", index, element))
            errors.append(error)
    if errors:
        raise IterableValidationError("elements", errors, dict)
    return made


def _strict_dataclass(converter: Converter, kind: Any) -> Hook:
    from cattrs.gen import make_dict_structure_fn

    structure = make_dict_structure_fn(kind, converter, _cattrs_forbid_extra_keys=True)

    def read(value: Any, kind: Any) -> Any:
        if not isinstance(value, dict):
            raise ValueError(f"must be a table, got {_show(value)}")
        return structure(value, kind)

    return read


def _describe(kind: Any) -> str:
    if kind in _WORDS:
        return _WORDS[kind]
    if get_origin(kind) is Literal:
        return "one of " + ", ".join(_show(option) for option in get_args(kind))
    if get_origin(kind) in (tuple, list):
        return f"a list (each element {_describe(get_args(kind)[0])})"
    return "a table"


def _show(value: Any) -> str:
    text = f'"{value}"' if isinstance(value, str) else repr(value)
    text = {"True": "true", "False": "false"}.get(text, text)
    return text if len(text) <= 60 else text[:57] + "..."
