"""How two records of what an artefact was made from differ, in words."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

__all__ = ["changes"]

MOST_CHANGES = 8
"""Differences that a message spells out."""


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
