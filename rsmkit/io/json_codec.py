"""JSON documents: written readable by eye, read strictly, compared in words."""

from __future__ import annotations

import hashlib
import json
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rsmkit.errors import RsmkitError
from rsmkit.io.atomic_files import read_text, write_text

__all__ = ["changes", "digest", "read_json", "write_json"]

_CONTROL = re.compile(r"[\x7f-\x9f]|\\u00(?:[01][0-9a-f]|7f|[89][0-9a-f])", re.IGNORECASE)
MOST_CHANGES = 8
"""Differences of two records that a message spells out."""


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
    except (ValueError, RecursionError) as error:
        raise RsmkitError(f"{path}: damaged ({error}). {remedy}") from None
    if not isinstance(data, dict):
        raise RsmkitError(f"{path}: damaged (not a JSON object). {remedy}")
    return data


def digest(data: Any) -> str:
    """Short hash of JSON-able data (or of text), the same on every machine."""
    text = data if isinstance(data, str) else json.dumps(data, sort_keys=True, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def changes(old: Any, new: Any) -> list[str]:
    """Say in words how two records differ: ``nose_radius_m.high changed 0.3 -> 0.35``."""
    found = _changes(old, new, "")
    return (
        found if len(found) <= MOST_CHANGES else [*found[:MOST_CHANGES], f"{len(found) - MOST_CHANGES} more"]
    )


def _changes(old: Any, new: Any, path: str) -> list[str]:
    if old == new:
        return []
    if isinstance(old, Mapping) and isinstance(new, Mapping):
        keys = [*old, *(key for key in new if key not in old)]
        return [
            line
            for key in keys
            for line in _changes(old.get(key), new.get(key), f"{path}.{key}" if path else str(key))
        ]
    if old is None or new is None:
        return [f"{path:.60} {'added' if old is None else 'removed'}"]
    if isinstance(old, list | dict | tuple) or isinstance(new, list | dict | tuple) or _is_digest(old):
        return [f"{path:.60} changed"]
    return [f"{path:.60} changed {old!s:.60} -> {new!s:.60}"]


def _is_digest(value: Any) -> bool:
    return isinstance(value, str) and re.fullmatch(r"[0-9a-f]{16}", value) is not None


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
