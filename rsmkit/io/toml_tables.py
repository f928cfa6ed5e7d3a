"""Strict reading of parsed TOML into dataclasses: every mistake reported, nothing guessed.

An unknown key is a mistake too, with the closest known one.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import MISSING, fields, is_dataclass
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

from cattrs import ClassValidationError, Converter, IterableValidationError

from rsmkit.errors import RsmkitError
from rsmkit.io.option_fields import given
from rsmkit.io.strict_types import join, strict_converter, unknown_key, what_is_wrong
from rsmkit.io.tables.tagged_tables import TaggedTable

__all__ = ["read_options", "read_tables"]

Made = TypeVar("Made")


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
    converter = strict_converter(unknown_keys=False)
    for table in tagged:
        table.register(converter)
    hints = get_type_hints(kind)
    parts: dict[str, Any] = {}
    problems = [unknown_key("", key, list(hints)) for key in data if key not in hints]
    for item in fields(kind):
        if item.name in data:
            part, found = _read_part(converter, data[item.name], hints[item.name], item.name)
            if part is not None:
                parts[item.name] = part
            problems += found
        elif item.default is MISSING and item.default_factory is MISSING:
            problems.append(f"{item.name} is missing")
    return parts, problems


def read_options(kind: type[Made], values: Mapping[str, Any]) -> Made:
    """Make a table of options from the keywords of a Python call, as strictly as from a study file.

    Raises
    ------
    RsmkitError
        With every mistake.
    """
    parts, problems = read_tables({key: _plain(value) for key, value in values.items()}, kind)
    if not problems:
        made = kind(**parts)
        problems = _own_problems(made, "")
    if problems:
        raise RsmkitError("; ".join(dict.fromkeys(problems)))
    return made


def _plain(value: Any) -> Any:
    """What a file would hold in place of a Python value."""
    if is_dataclass(value) and not isinstance(value, type):
        return given(value)
    if isinstance(value, Mapping):
        return {key: _plain(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(part) for part in value]
    return value.item() if hasattr(value, "item") else value


def _read_part(converter: Converter, data: Any, hint: Any, path: str) -> tuple[Any, list[str]]:
    if get_origin(hint) is dict and isinstance(data, dict):
        entries, problems = {}, []
        for key, value in data.items():
            entries[key], found = _read_part(converter, value, get_args(hint)[1], join(path, key))
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
        return None, what_is_wrong(error, path)
    return part, _own_problems(part, path)


def _own_problems(table: Any, path: str) -> list[str]:
    """Collect what each nested table says of itself."""
    found: list[str] = []
    if is_dataclass(table):
        if hasattr(table, "problems"):
            found += [
                f"{join(path, key) if key else path} {message}".strip() for key, message in table.problems()
            ]
        for item in fields(table):
            found += _own_problems(getattr(table, item.name), join(path, item.name))
    elif isinstance(table, dict):
        for key, value in table.items():
            found += _own_problems(value, join(path, str(key)))
    elif isinstance(table, tuple):
        for index, value in enumerate(table):
            found += _own_problems(value, f"{path}[{index}]")
    return found
