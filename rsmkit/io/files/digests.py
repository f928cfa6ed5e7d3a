"""Short hashes of data: two artefacts belong together when the hash of one stands in the other."""

from __future__ import annotations

import hashlib
import json
from typing import Any

__all__ = ["digest"]


def digest(data: Any) -> str:
    """Short hash of JSON-able data (or of text), the same on every machine."""
    text = data if isinstance(data, str) else json.dumps(data, sort_keys=True, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:16]
