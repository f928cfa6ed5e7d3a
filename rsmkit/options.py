"""What the tables of a study file share: how each describes itself and checks itself.

Every table of ``study.toml`` is one frozen dataclass, kept beside the code it steers
(``rsmkit/design/options.py``, ``rsmkit/runs/options.py``, ...). A field's type is what the file may hold, its
default is the file's default, and ``doc(...)`` is its line in the reference.
"""

from __future__ import annotations

from dataclasses import MISSING, field
from typing import Any, Protocol

__all__ = ["Options", "doc"]


class Options(Protocol):
    """A table of the study file."""

    def problems(self) -> list[tuple[str, str]]:
        """Report what is wrong beyond types: pairs of (key, message), empty when all is well."""
        ...


def doc(text: str, default: Any = MISSING, *, factory: Any = MISSING) -> Any:
    """Make a dataclass field that carries its own line of the study-file reference."""
    if factory is not MISSING:
        return field(default_factory=factory, metadata={"doc": text})
    return field(default=default, metadata={"doc": text})
