"""What the simulator said about the predicted optima, as data and as JSON (``verification.json``).

Errors follow the paper's Table 9: ``error_pct = 100 |actual - predicted| / |actual|``. The signed error,
``100 (actual - predicted) / |actual|``, is positive where the surface promised a lower value than the
simulator gives; objectives are minimised, so positive means optimistic. A percentage of a value near zero
says nothing, so verdicts ask for ``scaled_error_pct``: relative to the spread of the quantity over the design
runs where that is larger than the value.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from html import escape
from typing import Any, ClassVar, Literal

from rsmkit.errors import RsmkitError
from rsmkit.io.json_codec import from_json, left_out_if_none, to_json
from rsmkit.io.shown import Shown
from rsmkit.language.space import Value
from rsmkit.optimum.optimum import missed_words

__all__ = [
    "ROUNDING",
    "BestKnown",
    "Comparison",
    "Confirmation",
    "ConstraintCheck",
    "SimulatorRuns",
    "SpentRuns",
    "Verdict",
    "Verification",
    "place_words",
]

ROUNDING = 1e-6
"""Relative difference that counts as none: a simulator with step control repeats itself no better."""

Verdict = Literal["CONFIRMED", "IMPROVED, MODEL POOR", "NOT CONFIRMED", "INFEASIBLE", "FAILED"]


def place_words(factors: Mapping[str, Value]) -> str:
    """A point in words: ``width = 30, steel = S355``."""
    return ", ".join(
        f"{name} = {value:.6g}" if isinstance(value, float) else f"{name} = {value}"
        for name, value in factors.items()
    )


@dataclass(frozen=True)
class Comparison:
    """One quantity, predicted and run.

    Parameters
    ----------
    predicted : float
        The surface's value.
    actual : float or None
        The simulator's, of several runs their mean; None where it failed.
    low, high : float or None
        Prediction interval of one run; None where no surface of this quantity exists.
    spread : float or None
        Of the quantity over the design runs, median less least; None where it is not known.
    margin_of_error : float or None
        Half width of the confidence interval of `actual`, from pure error; None for runs without noise.
    """

    JSON_KEYS: ClassVar = (
        "predicted",
        "low",
        "high",
        "actual",
        "error_pct",
        "signed_error_pct",
        "spread",
        "scaled_error_pct",
        "margin_of_error",
    )

    predicted: float
    actual: float | None
    low: float | None = None
    high: float | None = None
    spread: float | None = left_out_if_none()
    margin_of_error: float | None = left_out_if_none()

    @property
    def signed_error_pct(self) -> float | None:
        """``100 (actual - predicted) / |actual|``; None where the actual value is nothing beside its spread.

        Zero where they are equal.
        """
        if self.actual is None:
            return None
        miss = self.actual - self.predicted
        if abs(self.actual) <= ROUNDING * (self.spread or 0.0):
            return 0.0 if miss == 0.0 else None
        return 100.0 * miss / abs(self.actual)

    @property
    def error_pct(self) -> float | None:
        """``100 |actual - predicted| / |actual|``, as in the paper's Table 9."""
        signed = self.signed_error_pct
        return None if signed is None else abs(signed)

    @property
    def scale(self) -> float:
        """What an error is measured by: the larger of the actual value's size and the spread."""
        return max(abs(self.actual or 0.0), self.spread or 0.0)

    @property
    def scaled_error_pct(self) -> float | None:
        """Error in percent of :attr:`scale`; None for a failed run, or a miss where the scale is zero."""
        if self.actual is None:
            return None
        miss = abs(self.actual - self.predicted)
        if self.scale == 0.0:
            return 0.0 if miss == 0.0 else None
        return 100.0 * miss / self.scale

    @property
    def inside(self) -> bool | None:
        """Whether the actual value lies in the prediction interval; None without one.

        But for rounding, and for the noise of the actual value.
        """
        if self.low is None or self.high is None or self.actual is None:
            return None
        room = ROUNDING * max(self.scale, abs(self.predicted)) + (self.margin_of_error or 0.0)
        return self.low - room <= self.actual <= self.high + room

    def within(self, tolerance_pct: float) -> bool:
        """Whether the error is at most `tolerance_pct` of the scale, but for noise of the actual value."""
        return self._misses_at_most(tolerance_pct / 100.0 * self.scale)

    def near(self, tolerance_pct: float) -> bool:
        """Whether it is at most `tolerance_pct` of the actual value itself, however large the spread."""
        return self._misses_at_most(tolerance_pct / 100.0 * abs(self.actual or 0.0))

    def is_off(self, tolerance_pct: float) -> bool:
        """Whether the surface is poor here: past the tolerance, or outside its own interval and not near."""
        outside = self.inside is False and not self.near(tolerance_pct)
        return self.actual is not None and (outside or not self.within(tolerance_pct))

    def _misses_at_most(self, allowed: float) -> bool:
        if self.actual is None:
            return False
        return abs(self.actual - self.predicted) - (self.margin_of_error or 0.0) <= allowed


@dataclass(frozen=True)
class ConstraintCheck:
    """Margin of one constraint at a verified point, satisfied when >= 0; None where the simulator failed."""

    text: str
    predicted: float
    actual: float | None


@dataclass(frozen=True)
class SimulatorRuns:
    """Simulator runs spent on the design and on the verification."""

    design: int
    verification: int


@dataclass(frozen=True)
class SpentRuns:
    """What the runs on record were made for: the one source of every line and number that says so.

    Parameters
    ----------
    design, verification : int
        Runs that surfaces and verdicts rest on.
    total : int
        All runs on record, the failed ones too.
    """

    design: int
    verification: int
    total: int

    @property
    def others(self) -> int:
        """Runs that no surface and no verdict rests on."""
        return max(0, self.total - self.design - self.verification)

    @property
    def words(self) -> str:
        """The sum in words: ``18 for the design + 1 to verify + 5 others (...) = 24``."""
        parts = [f"{self.design} for the design"]
        shared = max(0, self.design + self.verification - self.total)
        if self.verification:
            made = f" ({shared} of them made for the design already)" if shared else ""
            parts.append(f"{self.verification} to verify{made}")
        if self.others:
            more = "other" if self.others == 1 else "others"
            parts.append(
                f"{self.others} {more} (failed, excluded, confirming, refining, or of an earlier design)"
            )
        return f"{' + '.join(parts)} = {self.total}" if len(parts) > 1 else parts[0]

    def counts(self) -> dict[str, int]:
        """The same for programs."""
        numbers = {"design": self.design, "verification": self.verification}
        return {**numbers, "others": self.others, "total": self.total}


@dataclass(frozen=True)
class BestKnown:
    """The best point of which the simulator has been asked.

    Parameters
    ----------
    source : str
        ``verified optimum`` or ``design run``.
    factors : dict
        As the simulator received them.
    objective : float
        Its true value.
    missed : dict of str to float or None
        Where no run satisfies every constraint: those that this one, the nearest, misses, and by how much.
    desirability : float or None
        Overall desirability, 0..1, where that is what was searched for.
    """

    source: Literal["verified optimum", "design run"]
    factors: dict[str, Value]
    objective: float
    missed: dict[str, float] | None = left_out_if_none()
    desirability: float | None = left_out_if_none()

    @property
    def sentence(self) -> str:
        """The point in words."""
        which = {"verified optimum": "the verified optimum", "design run": "a run of the design"}[self.source]
        wished = self.desirability
        value = f"{self.objective:.6g}" if wished is None else f"overall desirability {wished:.3f}"
        found = f"{value} at {place_words(self.factors)}, {which}"
        if not self.missed:
            return f"best known: {found}"
        return f"no run satisfies every constraint; the nearest: {found}, misses {missed_words(self.missed)}"


@dataclass(frozen=True)
class Confirmation(Shown):
    """One predicted optimum against its true run.

    Parameters
    ----------
    name, point : str
        The search, and which of its points (``optimum``, ``knee``, ``lowest <objective>``).
    factors : dict
        As the simulator received them.
    objectives : dict of str to Comparison
        By expression, in the order of the search.
    responses : dict of str to Comparison
        By name.
    constraints : tuple of ConstraintCheck
        In the order of the search.
    verdict : str
        ``CONFIRMED``, ``IMPROVED, MODEL POOR``, ``NOT CONFIRMED``, ``INFEASIBLE`` or ``FAILED``.
    sentence : str
        The verdict in words, with its numbers.
    best_design : float or None
        Least true objective of the feasible design runs inside the bounds; None for several objectives or
        when there is no such run.
    simulator_runs : SimulatorRuns
        Runs the surfaces were fitted to, and runs that this search's verification needs.
    extremes : tuple of Confirmation
        On a front, the lowest point of each objective.
    replicates : int
        Runs of this point that succeeded.
    best_known : BestKnown or None
        Of one objective; None when nothing is known, and for several objectives.
    next_step : str
        What to do now: one command.
    missed : dict of str to float or None
        Constraints that the true run violates by more than the tolerance, and by how much.
    """

    JSON_KEYS: ClassVar = (
        "name",
        "point",
        "factors",
        "objective",
        "objectives",
        "responses",
        "constraints",
        "verdict",
        "sentence",
        "best_design",
        "improvement_pct",
        "extremes",
        "simulator_runs",
        "replicates",
        "best_known",
        "next_step",
        "missed",
    )

    name: str
    point: str
    factors: dict[str, Value]
    objectives: dict[str, Comparison]
    responses: dict[str, Comparison]
    constraints: tuple[ConstraintCheck, ...]
    verdict: Verdict
    sentence: str
    best_design: float | None
    simulator_runs: SimulatorRuns
    extremes: tuple[Confirmation, ...]
    replicates: int = 1
    best_known: BestKnown | None = None
    next_step: str = ""
    missed: dict[str, float] | None = left_out_if_none()

    def __post_init__(self) -> None:
        if not self.objectives:
            raise RsmkitError("has no objectives")

    @property
    def objective(self) -> Comparison:
        """The objective; of several the one predicted worst."""
        return max(
            self.objectives.values(),
            key=lambda c: math.inf if c.scaled_error_pct is None else c.scaled_error_pct,
        )

    @property
    def improvement_pct(self) -> float | None:
        """How much lower the true objective is than the best design run's, in percent of the latter."""
        actual = self.objective.actual
        if self.best_design is None or self.best_design == 0.0 or actual is None:
            return None
        return 100.0 * (self.best_design - actual) / abs(self.best_design)

    @property
    def points(self) -> tuple[Confirmation, ...]:
        """Itself and its extremes."""
        return (self, *self.extremes)

    def holds(self, tolerance_pct: float) -> bool:
        """Whether the surfaces told the truth of this point: within the tolerance, and feasible.

        That is so too where a design run is better, which is no fault of the prediction.
        """
        own = all(comparison.within(tolerance_pct) for comparison in self.objectives.values())
        return own and not self.missed and self.verdict in ("CONFIRMED", "NOT CONFIRMED")

    def within(self, tolerance_pct: float) -> bool:
        """Whether every objective of every verified point is predicted within `tolerance_pct`."""
        own = all(comparison.within(tolerance_pct) for comparison in self.objectives.values())
        return own and all(point.within(tolerance_pct) for point in self.extremes)


@dataclass(frozen=True)
class Verification:
    """All verified searches of a study and what they cost.

    Parameters
    ----------
    searches : tuple of Confirmation
        In the order of the study file.
    simulator_runs : SimulatorRuns
        What all of it took.
    """

    searches: tuple[Confirmation, ...]
    simulator_runs: SimulatorRuns

    @property
    def verdicts(self) -> tuple[Verdict, ...]:
        """Of every verified point, in order."""
        return tuple(point.verdict for search in self.searches for point in search.points)

    def within(self, tolerance_pct: float) -> bool:
        """Whether every objective is predicted within `tolerance_pct`."""
        return all(search.within(tolerance_pct) for search in self.searches)

    def to_json(self) -> dict[str, Any]:
        """Make a document of JSON values; inverse of :meth:`from_json`."""
        document: dict[str, Any] = to_json(self)
        return document

    @classmethod
    def from_json(cls, document: Mapping[str, Any]) -> Verification:
        """Read a document made by :meth:`to_json`; anything else raises RsmkitError."""
        return from_json(cls, document, "verification.json", "Run: rsmkit verify")

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><td>{escape(s.name)}</td><td>{s.objective.predicted:.6g}</td>"
            f"<td>{'failed' if s.objective.actual is None else f'{s.objective.actual:.6g}'}</td>"
            f"<td>{'-' if s.objective.error_pct is None else f'{s.objective.error_pct:.3g} %'}</td>"
            f"<td>{escape(s.verdict)}</td></tr>"
            for s in self.searches
        )
        head = "<tr><th>search</th><th>predicted</th><th>actual</th><th>error</th><th>verdict</th></tr>"
        return f"<table>{head}{rows}</table>"
