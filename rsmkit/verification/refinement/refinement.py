"""What a refinement did, wave by wave, as data and as JSON."""

from __future__ import annotations

import math
from dataclasses import dataclass

from rsmkit.language.space import Floats, Space, Value
from rsmkit.optimum.problem import Evaluation

__all__ = ["Refinement", "RefinementRecord", "Wave", "WaveRecord"]


@dataclass(frozen=True)
class Wave:
    """One batch of simulator runs and what was learnt from it.

    Parameters
    ----------
    number : int
        From 1.
    points : ndarray, shape (q, k)
        Natural units.
    objectives : ndarray, shape (q,)
        True values; nan where the run failed.
    half_width : float
        Of the region searched, in ranges of the factors; 1 is the whole box.
    model : str
        The model with the smallest leave-one-out residuals there.
    predicted_gain : float
        By how much that model promised to improve the best point; nan when it found no feasible one.
    gain : float
        By how much the best point improved.
    best : float
        Objective of the best point after the wave.
    action : str
        What happens to the region.
    """

    number: int
    points: Floats
    objectives: Floats
    half_width: float
    model: str
    predicted_gain: float
    gain: float
    best: float
    action: str

    @property
    def sentence(self) -> str:
        """The wave in one line."""
        where = "the whole box"
        if self.half_width < 1:
            where = f"+-{100 * self.half_width:.3g} % of the range"
        gain = "nothing feasible"
        if math.isfinite(self.predicted_gain):
            gain = f"a gain of {self.predicted_gain:.4g}"
        runs = "1 run" if len(self.points) == 1 else f"{len(self.points)} runs"
        return (
            f"wave {self.number}: {runs} in {where}; {self.model} promised {gain}, real gain "
            f"{self.gain:.4g}, best {self.best:.8g}; {self.action}"
        )

    def record(self, space: Space) -> WaveRecord:
        """What is kept of it."""
        return WaveRecord(
            number=self.number,
            runs=tuple(space.values(point) for point in self.points),
            objectives=tuple(map(_finite, self.objectives.tolist())),
            half_width=self.half_width,
            model=self.model,
            predicted_gain=_finite(self.predicted_gain),
            gain=_finite(self.gain),
            best=_finite(self.best),
            sentence=self.sentence,
        )


@dataclass(frozen=True)
class Refinement:
    """Result of a refinement.

    Parameters
    ----------
    space : Space
        The factors.
    best : Evaluation
        One row: the best feasible run of all.
    start_runs : int
        Runs known before.
    waves : tuple of Wave
        In order.
    reason : str
        Why it stopped.
    """

    space: Space
    best: Evaluation
    start_runs: int
    waves: tuple[Wave, ...]
    reason: str

    @property
    def runs(self) -> int:
        """Simulator runs the refinement spent."""
        return sum(len(wave.points) for wave in self.waves)

    def record(self) -> RefinementRecord:
        """What is kept of it."""
        return RefinementRecord(
            factors=self.space.values(self.best.points[0]),
            objective=float(self.best.objectives[0, 0]),
            responses={name: float(column[0]) for name, column in self.best.responses.items()},
            start_runs=self.start_runs,
            runs=self.runs,
            reason=self.reason,
            waves=tuple(wave.record(self.space) for wave in self.waves),
        )


@dataclass(frozen=True)
class WaveRecord:
    """One wave as ``refinement.json`` keeps it; None where a number is not finite."""

    number: int
    runs: tuple[dict[str, Value], ...]
    objectives: tuple[float | None, ...]
    half_width: float
    model: str
    predicted_gain: float | None
    gain: float | None
    best: float | None
    sentence: str


@dataclass(frozen=True)
class RefinementRecord:
    """One refinement as ``refinement.json`` keeps it."""

    factors: dict[str, Value]
    objective: float
    responses: dict[str, float]
    start_runs: int
    runs: int
    reason: str
    waves: tuple[WaveRecord, ...]


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
