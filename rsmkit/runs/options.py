"""The ``[simulator]`` table of a study file."""

from __future__ import annotations

from dataclasses import dataclass

from rsmkit.options import doc

__all__ = ["SimulatorOptions"]

Setting = bool | int | float | str | list[bool | int | float | str]


@dataclass(frozen=True)
class SimulatorOptions:
    """What one run is."""

    run: str = doc("Python callable, 'module:function', found beside the study file or installed", "")
    deterministic: bool = doc("same input, same output: replicates are run once", True)
    timeout_s: float | None = doc("a run longer than this is stopped and recorded as timed out", None)
    settings: dict[str, Setting] = doc(
        "passed to every run as keywords; part of the run's identity", factory=dict
    )

    def problems(self) -> list[tuple[str, str]]:
        """Report what is wrong beyond types."""
        found = []
        if not self.run:
            found.append(("run", "is missing; name your simulator as 'module:function'"))
        elif (
            not all(part.isidentifier() for part in self.run.replace(":", ".").split("."))
            or ":" not in self.run
        ):
            found.append(("run", f"must look like 'module:function', got '{self.run}'"))
        if self.timeout_s is not None and not self.timeout_s > 0:
            found.append(("timeout_s", f"must be positive, got {self.timeout_s:g}"))
        return found
