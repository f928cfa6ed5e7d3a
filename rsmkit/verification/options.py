"""The ``[verify]`` table of a study file."""

from __future__ import annotations

from dataclasses import dataclass

from rsmkit.io.option_fields import doc
from rsmkit.io.shown import Shown

__all__ = ["RefineOptions", "VerifyOptions"]


@dataclass(frozen=True)
class RefineOptions(Shown):
    """How ``verify --refine`` spends further runs."""

    batch: int = doc("runs per wave; --jobs when that is more", 4)
    max_runs: int = doc("budget of runs, without those already made", 60)
    gain_tolerance: float = doc(
        "a promised gain below this fraction of the spread of the objective (median minus best of the first "
        "runs) is none",
        1e-4,
    )
    noise_sd: float | None = doc(
        "standard deviation of the objective at a repeated point, 0 if it repeats exactly; that of the "
        "repeated points when left out",
        None,
    )
    seed: int = doc("seed of every random choice", 1)

    def problems(self) -> list[tuple[str, str]]:
        """Report what is wrong beyond types."""
        found = [
            (key, f"must be at least 1, got {value}")
            for key, value in (("batch", self.batch), ("max_runs", self.max_runs))
            if value < 1
        ]
        found += [
            (key, f"must not be negative, got {value:g}")
            for key, value in (("noise_sd", self.noise_sd or 0.0), ("seed", self.seed))
            if value < 0
        ]
        if not self.gain_tolerance > 0:
            found.append(("gain_tolerance", f"must be positive, got {self.gain_tolerance:g}"))
        return found


@dataclass(frozen=True)
class VerifyOptions(Shown):
    """Which optima are flown, and what counts as confirmed."""

    searches: tuple[str, ...] = doc("names of the searches to verify; all when left out", ())
    tolerance_pct: float = doc(
        "largest acceptable error of the predicted objective, in percent of the true value or, where that is "
        "larger, of the spread of the objective over the design runs (median less least)",
        2.0,
    )
    replicates: int | None = doc(
        "runs of each optimum; by default 1, and 4 where runs repeat with noise (deterministic = false)", None
    )
    points: int | None = doc(
        "points of a Pareto front that are run, spread over it; its knee and the lowest point of each "
        "objective when left out",
        None,
    )
    confidence: float = doc("confidence of the prediction intervals", 0.95)
    always_refine: bool = doc("whether `rsmkit run` and `rsmkit verify` go on as with --refine", False)
    refine: RefineOptions = doc("how verify --refine spends further runs", factory=RefineOptions)

    def problems(self) -> list[tuple[str, str]]:
        """Report what is wrong beyond types."""
        found = []
        if not self.tolerance_pct > 0:
            found.append(("tolerance_pct", f"must be positive, got {self.tolerance_pct:g}"))
        if self.replicates is not None and self.replicates < 1:
            found.append(("replicates", f"must be at least 1, got {self.replicates}"))
        if self.points is not None and self.points < 1:
            found.append(("points", f"must be at least 1, got {self.points}"))
        if not 0 < self.confidence < 1:
            found.append(("confidence", f"must lie between 0 and 1, got {self.confidence:g}"))
        return found + [(f"refine.{key}", message) for key, message in self.refine.problems()]
