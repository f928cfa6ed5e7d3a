"""The ``[explorer]`` table of a study file."""

from __future__ import annotations

from dataclasses import dataclass

from rsmkit.io.option_fields import doc

__all__ = ["ExplorerOptions"]


@dataclass(frozen=True)
class ExplorerOptions:
    """Extras of the explorer page that only the study knows."""

    history: str = doc(
        "'module:function' from factors to a time table of one run, saved for each verified design", ""
    )
    scene: str = doc("JavaScript file beside the study that draws the designed object", "")

    def problems(self) -> list[tuple[str, str]]:
        """Report what is wrong beyond types."""
        if self.history and self.history.count(":") != 1:
            return [("history", f"must look like 'module:function', got '{self.history}'")]
        return []
