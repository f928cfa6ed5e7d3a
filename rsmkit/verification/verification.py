"""What the simulator said about the predicted optima, as data and as JSON (``verification.json``).

Errors follow the paper's Table 9: ``error_pct = 100 |actual - predicted| / |actual|``. The signed error,
``100 (actual - predicted) / |actual|``, is positive where the surface promised a lower value than the
simulator gives; objectives are minimised, so positive means optimistic.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from html import escape
from typing import Any, ClassVar, Literal

from rsmkit.errors import RsmkitError
from rsmkit.io.json_codec import from_json, to_json
from rsmkit.language.space import Value

__all__ = [
    "ROUNDING",
    "Comparison",
    "Confirmation",
    "ConstraintCheck",
    "SimulatorRuns",
    "Verdict",
    "Verification",
]

ROUNDING = 1e-6
"""Relative difference that counts as none: a simulator with step control repeats itself no better."""

Verdict = Literal["CONFIRMED", "IMPROVED, MODEL POOR", "NOT CONFIRMED"]


@dataclass(frozen=True)
class Comparison:
    """One quantity, predicted and run.

    Parameters
    ----------
    predicted, actual : float
        The surface's value and the simulator's.
    low, high : float or None
        Prediction interval of one run; None where no surface of this quantity exists.
    """

    JSON_KEYS: ClassVar = ("predicted", "low", "high", "actual", "error_pct", "signed_error_pct")

    predicted: float
    actual: float
    low: float | None = None
    high: float | None = None

    @property
    def signed_error_pct(self) -> float | None:
        """``100 (actual - predicted) / |actual|``; None when the actual value is zero and missed."""
        miss = self.actual - self.predicted
        if self.actual == 0.0:
            return 0.0 if miss == 0.0 else None
        return 100.0 * miss / abs(self.actual)

    @property
    def error_pct(self) -> float | None:
        """``100 |actual - predicted| / |actual|``, as in the paper's Table 9."""
        signed = self.signed_error_pct
        return None if signed is None else abs(signed)

    @property
    def inside(self) -> bool | None:
        """Whether the actual value lies in the prediction interval, but for rounding; None without one."""
        if self.low is None or self.high is None:
            return None
        rounding = ROUNDING * max(abs(self.actual), abs(self.predicted))
        return self.low - rounding <= self.actual <= self.high + rounding

    def within(self, tolerance_pct: float) -> bool:
        """Whether the error is at most `tolerance_pct`."""
        return self.error_pct is not None and self.error_pct <= tolerance_pct


@dataclass(frozen=True)
class ConstraintCheck:
    """Margin of one constraint at a verified point, satisfied when >= 0."""

    text: str
    predicted: float
    actual: float


@dataclass(frozen=True)
class SimulatorRuns:
    """Simulator runs spent on the design and on the verification."""

    design: int
    verification: int


@dataclass(frozen=True)
class Confirmation:
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
        ``CONFIRMED``, ``IMPROVED, MODEL POOR`` or ``NOT CONFIRMED``.
    sentence : str
        The verdict in words, with its numbers.
    best_design : float or None
        Least true objective of the feasible design runs inside the bounds; None for several objectives or
        when there is no such run.
    simulator_runs : SimulatorRuns
        Runs the surfaces were fitted to, and runs that this search's verification needs.
    extremes : tuple of Confirmation
        On a front, the lowest point of each objective.
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

    def __post_init__(self) -> None:
        if not self.objectives:
            raise RsmkitError("has no objectives")

    @property
    def objective(self) -> Comparison:
        """The objective; of several the one predicted worst."""
        return max(self.objectives.values(), key=lambda c: math.inf if c.error_pct is None else c.error_pct)

    @property
    def improvement_pct(self) -> float | None:
        """How much lower the true objective is than the best design run's, in percent of the latter."""
        if self.best_design is None or self.best_design == 0.0:
            return None
        return 100.0 * (self.best_design - self.objective.actual) / abs(self.best_design)

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
            f"<tr><td>{escape(s.name)}</td><td>{s.objective.predicted:.6g}</td><td>{s.objective.actual:.6g}</td>"
            f"<td>{'-' if s.objective.error_pct is None else f'{s.objective.error_pct:.3g} %'}</td>"
            f"<td>{escape(s.verdict)}</td></tr>"
            for s in self.searches
        )
        head = "<tr><th>search</th><th>predicted</th><th>actual</th><th>error</th><th>verdict</th></tr>"
        return f"<table>{head}{rows}</table>"
