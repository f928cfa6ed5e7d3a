"""Short hashes of data: two artefacts belong together when the hash of one stands in the other."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from typing import Any

__all__ = ["digest", "digest_of_all"]


def digest(data: Any) -> str:
    """Short hash of JSON-able data (or of text), the same on every machine."""
    text = data if isinstance(data, str) else json.dumps(data, sort_keys=True, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def digest_of_all(items: Iterable[Any]) -> str:
    """The :func:`digest` of a list of JSON-able items, which come one by one: never all of them in memory."""
    hashed, before = hashlib.sha256(b"["), ""
    for item in items:
        hashed.update(f"{before}{_ENCODE(item)}".encode())
        before = ", "
    hashed.update(b"]")
    return hashed.hexdigest()[:16]


_ENCODE = json.JSONEncoder(sort_keys=True, allow_nan=False).encode
