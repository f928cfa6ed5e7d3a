"""JSON documents: written readable by eye, read strictly into classes that say what may stand where.

A class is written as its fields, in their order, and read back from the same; keys that it does not know are
overlooked, so that a later version may add some. A class can say otherwise by one of two means:

``JSON_KEYS``
    names of attributes in the order in which they are written; those that are no fields (a value that
    follows from others) are for readers of the file and are not read back.
``to_form``, ``from_form(form)``
    turn it into an instance of the class that shows how it is written, and back.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from dataclasses import Field, field, fields, is_dataclass
from functools import cache
from pathlib import Path
from typing import Annotated, Any, TypeVar, get_args, get_origin, get_type_hints

from cattrs import ClassValidationError, Converter, IterableValidationError

from rsmkit.errors import DamagedError, RsmkitError
from rsmkit.io.files.atomic_files import read_text, write_text
from rsmkit.io.shown import Shown
from rsmkit.io.strict_types import NULL_IS_NAN, strict_converter, what_is_wrong

__all__ = ["Document", "from_json", "left_out_if_none", "read_json", "to_json", "write_json"]

_HALF = re.compile(r"\\u[dD][89a-fA-F]")
_CONTROL = re.compile(r"[\x7f-\x9f]|\\u00(?:[01][0-9a-f]|7f|[89][0-9a-f])", re.IGNORECASE)

T = TypeVar("T")


def write_json(path: Path, data: Mapping[str, Any]) -> None:
    """Write one JSON document, readable by eye; numbers keep every digit, nan and inf are refused."""
    write_text(path, json.dumps(data, indent=1, ensure_ascii=False, allow_nan=False) + "\n")


def read_json(path: Path, remedy: str) -> dict[str, Any]:
    """Read a JSON object; `remedy` ends the message when the file is damaged."""
    text = read_text(path, remedy)
    try:
        if _CONTROL.search(text):
            raise ValueError("holds control characters")
        data = (_CAREFUL if _MAYBE_HUGE.search(text) else _DECODER).decode(text)
        if _HALF.search(text):  # of a pair, which are well: half a character alone can be written nowhere
            json.dumps(data, ensure_ascii=False).encode()
    except (ValueError, RecursionError) as error:
        raise DamagedError(path, [str(error)], remedy) from None
    if not isinstance(data, dict):
        raise DamagedError(path, ["not a JSON object"], remedy)
    return data


def from_json(kind: type[T], data: Any, source: Path | str, remedy: str, *, at: str = "") -> T:
    """Read JSON values into a class.

    Parameters
    ----------
    kind : type
        A dataclass, or a class with ``from_form``.
    data : Any
        What :func:`read_json` gave, or a part of it.
    source : path or str
        The document as the user knows it.
    remedy : str
        What to do when it is damaged; ends the message.
    at : str, optional
        Path of `data` in the document.

    Raises
    ------
    DamagedError
        With every mistake and the path of its key, not only the first.
    """
    try:
        return _converter().structure(data, kind)
    except (ValueError, OverflowError, RsmkitError, ClassValidationError, IterableValidationError) as error:
        raise DamagedError(source, what_is_wrong(error, at), remedy, error) from None


def to_json(value: Any) -> Any:
    """Turn a class, and all that it holds, into JSON values; the inverse of :func:`from_json`."""
    if value is None or isinstance(value, str | int | float):  # most of what there is
        return value
    if hasattr(value, "to_form"):
        return to_json(value.to_form())
    if is_dataclass(value) and not isinstance(value, type):
        document = {}
        for key, may_be_none, may_be_nan in _keys(type(value)):
            part = getattr(value, key)
            if part is not None or not may_be_none:
                document[key] = to_json(part if not may_be_nan or math.isfinite(part) else None)
        return document
    if isinstance(value, Mapping):
        return {key: to_json(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return list(value) if set(map(type, value)) == {float} else [to_json(part) for part in value]
    return value.tolist() if hasattr(value, "tolist") else value


class Document(Shown):
    """What is written as a JSON document of its own."""

    def to_json(self) -> dict[str, Any]:
        """JSON values, which make the same again to the last bit."""
        return dict(to_json(self))


def left_out_if_none() -> Any:
    """Make a field whose key is not written at all while it is None."""
    return field(default=None, metadata={_LEFT_OUT: True})


@cache
def _converter() -> Converter:
    """Keep one converter: it makes a reader of each class once."""
    return strict_converter(unknown_keys=True)


@cache
def _keys(kind: type[Any]) -> tuple[tuple[str, bool, bool], ...]:
    """Key, whether it is left out where it is None, whether null stands for nan; of each key of a class."""
    known: dict[str, Field[Any]] = {item.name: item for item in fields(kind)}
    hints = get_type_hints(kind, include_extras=True)

    def of(name: str) -> tuple[str, bool, bool]:
        hint = hints.get(name)
        nan = get_origin(hint) is Annotated and NULL_IS_NAN in get_args(hint)
        return name, name in known and _LEFT_OUT in known[name].metadata, nan

    return tuple(map(of, getattr(kind, "JSON_KEYS", known)))


def _refuse_constant(name: str) -> None:
    raise ValueError(f"{name} is not a number of JSON")


def _not_huge(text: str) -> float | int:
    number = float(text)
    if math.isinf(number):
        raise ValueError("a number is too large")
    return number if "." in text or "e" in text.lower() else int(text)


_DECODER = json.JSONDecoder(parse_constant=_refuse_constant)
_CAREFUL = json.JSONDecoder(parse_constant=_refuse_constant, parse_float=_not_huge, parse_int=_not_huge)
_MAYBE_HUGE = re.compile(r"\d{300}|\d[eE]\+?\d{3}")
_LEFT_OUT = "left out if none"
