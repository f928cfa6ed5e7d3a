"""The options of each backend, which cost nothing to import: the command line makes its flags from them.

A field's type is what its flag takes, ``doc`` is its line of help and ``metavar`` the word for its value.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

__all__ = ["DEFAULT_BACKEND", "BackendOptions", "DaskOptions", "LokyOptions", "flag"]

DEFAULT_BACKEND = "loky"


def flag(text: str, metavar: str, default: Any) -> Any:
    """Make a dataclass field that carries the help of its own flag."""
    return field(default=default, metadata={"doc": text, "metavar": metavar})


@dataclass(frozen=True)
class BackendOptions:
    """What a backend must know beyond the number of jobs: nothing, unless it says otherwise."""

    def problems(self) -> list[tuple[str, str]]:
        """Report what is wrong beyond types, as predicates of "the ... backend"."""
        return []


@dataclass(frozen=True)
class LokyOptions(BackendOptions):
    """Processes on this computer need no options."""


@dataclass(frozen=True)
class DaskOptions(BackendOptions):
    """A dask cluster that already stands."""

    scheduler: str = flag("scheduler of the dask cluster", "ADDRESS", "")

    def problems(self) -> list[tuple[str, str]]:
        """Report a missing address."""
        if self.scheduler:
            return []
        return [("scheduler", "needs the address of a scheduler, such as tcp://host:8786")]
