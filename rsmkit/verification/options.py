"""The ``[verify]`` table of a study file."""

from __future__ import annotations

from dataclasses import dataclass

from rsmkit.options import doc

__all__ = ["VerifyOptions"]


@dataclass(frozen=True)
class VerifyOptions:
    """Which optima are flown, and what counts as confirmed."""

    searches: tuple[str, ...] = doc("names of the searches to verify; all when left out", ())
    tolerance_pct: float = doc(
        "largest acceptable error of the predicted objective, in percent of the true value", 2.0
    )
    confidence: float = doc("confidence of the prediction intervals", 0.95)

    def problems(self) -> list[tuple[str, str]]:
        """Report what is wrong beyond types."""
        found = []
        if not self.tolerance_pct > 0:
            found.append(("tolerance_pct", f"must be positive, got {self.tolerance_pct:g}"))
        if not 0 < self.confidence < 1:
            found.append(("confidence", f"must lie between 0 and 1, got {self.confidence:g}"))
        return found
