"""Writing so that nothing is ever half written, and reading so that a damaged file is explained."""

from __future__ import annotations

import hashlib
import json
import os
import re
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rsmkit.errors import RsmkitError

__all__ = ["changes", "digest", "read_json", "write_json", "write_text"]


_CONTROL = re.compile(r"[\x7f-\x9f]|\\u00(?:[01][0-9a-f]|7f|[89][0-9a-f])", re.IGNORECASE)


def write_text(path: Path, text: str) -> None:
    """Replace `path` in one step: temporary file in the same folder, flush to disk, rename.

    Raises
    ------
    RsmkitError
        If the folder cannot be written or the disk is full.
    """
    try:
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=".tmp")
        try:
            with open(handle, "w", encoding="utf-8", newline="") as stream:
                stream.write(text)
                stream.flush()
                os.fsync(stream.fileno())
            os.chmod(temporary, 0o666 & ~_umask())
            os.replace(temporary, path)
        except BaseException:
            os.unlink(temporary)
            raise
    except OSError as error:
        raise RsmkitError(
            f"{path}: cannot be written: {error.strerror}. Free the disk or choose a folder you may write to."
        ) from None


def write_json(path: Path, data: Mapping[str, Any]) -> None:
    """Write one JSON document, readable by eye; numbers keep every digit, nan and inf are refused."""
    write_text(path, json.dumps(data, indent=1, ensure_ascii=False, allow_nan=False) + "\n")


def read_json(path: Path, remedy: str) -> dict[str, Any]:
    """Read a JSON object; `remedy` ends the message when the file is damaged."""
    try:
        text = path.read_text(encoding="utf-8")
        if _CONTROL.search(text):
            raise ValueError("holds control characters")
        data = json.loads(text, parse_constant=_refuse_constant)
    except (ValueError, RecursionError) as error:
        raise RsmkitError(f"{path}: damaged ({error}). {remedy}") from None
    except OSError as error:
        raise RsmkitError(f"{path}: cannot be read: {error.strerror}. {remedy}") from None
    if not isinstance(data, dict):
        raise RsmkitError(f"{path}: damaged (not a JSON object). {remedy}")
    return data


def digest(data: Any) -> str:
    """Short hash of JSON-able data (or of text), the same on every machine."""
    text = data if isinstance(data, str) else json.dumps(data, sort_keys=True, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def changes(old: Any, new: Any, path: str = "") -> list[str]:
    """Say in words how two records differ: ``nose_radius_m.high changed 0.3 -> 0.35``."""
    if old == new:
        return []
    if isinstance(old, Mapping) and isinstance(new, Mapping):
        keys = [*old, *(key for key in new if key not in old)]
        return [
            line
            for key in keys
            for line in changes(old.get(key), new.get(key), f"{path}.{key}" if path else str(key))
        ]
    if old is None or new is None:
        return [f"{path} {'added' if old is None else 'removed'}"]
    if isinstance(old, list | dict | tuple) or isinstance(new, list | dict | tuple) or _is_digest(old):
        return [f"{path} changed"]
    return [f"{path} changed {old} -> {new}"]


def _is_digest(value: Any) -> bool:
    return isinstance(value, str) and re.fullmatch(r"[0-9a-f]{16}", value) is not None


def _refuse_constant(name: str) -> None:
    raise ValueError(f"{name} is not a number of JSON")


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
