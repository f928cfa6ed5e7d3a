"""What a refinement did, wave by wave, as data and as JSON."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from rsmkit.io.shown import Shown
from rsmkit.language.space import Floats, Space, Value
from rsmkit.optimum.problem import Evaluation

__all__ = ["FrontPoint", "Refinement", "RefinementRecord", "Result", "Wave", "WaveRecord"]


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
        True values; nan where the run failed. Of several objectives the hypervolume after each run.
    half_width : float
        Of the region searched, in ranges of the factors; 1 is the whole box.
    model : str
        The model with the smallest leave-one-out residuals there.
    predicted_gain : float
        By how much that model promised to improve the best point; nan when it found no feasible one.
    gain : float
        By how much the best point improved, or the hypervolume grew.
    best : float
        Objective of the best point after the wave, or the hypervolume.
    action : str
        What happens to the region.
    expected_gain : float
        Greatest expected improvement of one run anywhere, before the wave.
    kinds : tuple of str
        Why each point was run.
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
    expected_gain: float
    kinds: tuple[str, ...]

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
            expected_gain=_finite(self.expected_gain),
            kinds=self.kinds,
        )


@dataclass(frozen=True)
class Result:
    """What a search on the true simulator knows.

    Parameters
    ----------
    best : Evaluation
        One row: the best feasible run, of a front its knee; the run that misses least when none is feasible.
    known : Evaluation
        All runs, failed ones included.
    feasible : bool
        Whether `best` satisfies every constraint.
    remaining_gain : float or None
        With 95 % confidence no run anywhere gains more; None for fronts and where nothing is feasible.
    front : Evaluation or None
        Of several objectives the runs that no other dominates.
    smoothed, error : float or None
        Objective of the best run as all runs together tell it, and its standard error; None without noise.
    noise_sd : float
        Standard deviation of the objective at a repeated point.
    gap : float or None
        Half the width, in ranges of the factors, of the largest cube without a run.
    """

    best: Evaluation
    known: Evaluation
    feasible: bool
    remaining_gain: float | None = None
    front: Evaluation | None = None
    smoothed: float | None = None
    error: float | None = None
    noise_sd: float = 0.0
    gap: float | None = None


@dataclass(frozen=True)
class Refinement(Shown):
    """Result of a refinement.

    Parameters
    ----------
    space : Space
        The factors.
    minimize, subject_to : tuple of str
        Objectives, and constraints in the order of their margins.
    result : Result
        What was found.
    start_runs : int
        Runs known before.
    waves : tuple of Wave
        In order.
    reason : str
        Why it stopped.
    settled : bool
        Whether it stopped because nothing more was promised.
    cost : int
        Simulator runs that one point takes.
    """

    space: Space
    minimize: tuple[str, ...]
    subject_to: tuple[str, ...]
    result: Result
    start_runs: int
    waves: tuple[Wave, ...]
    reason: str
    settled: bool = False
    cost: int = 1

    @property
    def best(self) -> Evaluation:
        """One row: the best run of all."""
        return self.result.best

    @property
    def runs(self) -> int:
        """Simulator runs the refinement spent."""
        return self.cost * sum(len(wave.points) for wave in self.waves)

    def record(self) -> RefinementRecord:
        """What is kept of it."""
        result, front = self.result, self.result.front
        several = front is not None and bool(self.waves)
        return RefinementRecord(
            factors=self.space.values(self.best.points[0]),
            objective=self.waves[-1].best if several else float(self.best.objectives[0, 0]),
            responses={name: float(column[0]) for name, column in self.best.responses.items()},
            start_runs=self.start_runs,
            runs=self.runs,
            reason=self.reason,
            waves=tuple(wave.record(self.space) for wave in self.waves),
            measure="objective" if len(self.minimize) == 1 else "hypervolume",
            feasible=result.feasible,
            remaining_gain=result.remaining_gain,
            smoothed=result.smoothed,
            standard_error=result.error,
            largest_gap=result.gap,
            front=self._points(front) if front is not None else (),
            dominated=self._points(self._dominated(front)) if front is not None else (),
            failed=tuple(self.space.values(point) for point in result.known.points[~result.known.succeeded]),
        )

    def _dominated(self, front: Evaluation) -> Evaluation:
        """Runs that succeeded and are not of the front."""
        known = self.result.known.rows(self.result.known.succeeded)
        of_front = (known.points[:, None] == front.points[None]).all(axis=2).any(axis=1)
        return known.rows(~of_front)

    def _points(self, known: Evaluation) -> tuple[FrontPoint, ...]:
        return tuple(
            FrontPoint(self.space.values(point), tuple(values))
            for point, values in zip(known.points, known.objectives.tolist(), strict=True)
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
    expected_gain: float | None = None
    kinds: tuple[str, ...] = ()


@dataclass(frozen=True)
class FrontPoint:
    """One true run of a search with several objectives."""

    factors: dict[str, Value]
    objectives: tuple[float, ...]


@dataclass(frozen=True)
class RefinementRecord:
    """One refinement as ``refinement.json`` keeps it.

    Its objective, and those of the waves, are values of the `measure`: the objective itself, or the
    hypervolume that the runs dominate.
    """

    factors: dict[str, Value]
    objective: float
    responses: dict[str, float]
    start_runs: int
    runs: int
    reason: str
    waves: tuple[WaveRecord, ...]
    measure: str = "objective"
    feasible: bool = True
    remaining_gain: float | None = None
    smoothed: float | None = None
    standard_error: float | None = None
    largest_gap: float | None = None
    front: tuple[FrontPoint, ...] = ()
    dominated: tuple[FrontPoint, ...] = ()
    failed: tuple[dict[str, Value], ...] = ()
    verdict: Literal["", "SETTLED", "NOT SETTLED", "INFEASIBLE"] = ""
    sentence: str = ""


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
