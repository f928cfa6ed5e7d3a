"""The ``[surface]`` table of a study file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from rsmkit.options import doc

__all__ = ["SurfaceOptions"]


@dataclass(frozen=True)
class SurfaceOptions:
    """Which model each response gets."""

    order: Literal[1, 2, 3] = doc("1 linear, 2 full second order, 3 full third order", 2)

    def problems(self) -> list[tuple[str, str]]:
        """Report what is wrong beyond types."""
        return []
