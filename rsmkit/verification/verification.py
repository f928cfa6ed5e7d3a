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
from typing import Any, Literal, get_args

from rsmkit.errors import RsmkitError

__all__ = ["ROUNDING", "Comparison", "Confirmation", "ConstraintCheck", "Verdict", "Verification"]

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

    def to_json(self) -> dict[str, Any]:
        """Make a plain document."""
        return {
            "predicted": self.predicted,
            "low": self.low,
            "high": self.high,
            "actual": self.actual,
            "error_pct": self.error_pct,
            "signed_error_pct": self.signed_error_pct,
        }


@dataclass(frozen=True)
class ConstraintCheck:
    """Margin of one constraint at a verified point, satisfied when >= 0."""

    text: str
    predicted: float
    actual: float


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
    design_runs : int
        Runs the surfaces were fitted to.
    extremes : tuple of Confirmation
        On a front, the lowest point of each objective.
    """

    name: str
    point: str
    factors: dict[str, float | int | str]
    objectives: dict[str, Comparison]
    responses: dict[str, Comparison]
    constraints: tuple[ConstraintCheck, ...]
    verdict: Verdict
    sentence: str
    best_design: float | None
    design_runs: int
    extremes: tuple[Confirmation, ...] = ()

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

    @property
    def verification_runs(self) -> int:
        """Simulator runs this search's verification needs."""
        return 1 + len(self.extremes)

    def within(self, tolerance_pct: float) -> bool:
        """Whether every objective of every verified point is predicted within `tolerance_pct`."""
        own = all(comparison.within(tolerance_pct) for comparison in self.objectives.values())
        return own and all(point.within(tolerance_pct) for point in self.extremes)

    def to_json(self) -> dict[str, Any]:
        """Make a plain document."""
        return {
            "name": self.name,
            "point": self.point,
            "factors": dict(self.factors),
            "objective": self.objective.to_json(),
            "objectives": {key: comparison.to_json() for key, comparison in self.objectives.items()},
            "responses": {key: comparison.to_json() for key, comparison in self.responses.items()},
            "constraints": [
                {"text": c.text, "predicted": c.predicted, "actual": c.actual} for c in self.constraints
            ],
            "verdict": self.verdict,
            "sentence": self.sentence,
            "best_design": self.best_design,
            "improvement_pct": self.improvement_pct,
            "extremes": [extreme.to_json() for extreme in self.extremes],
            "simulator_runs": {"design": self.design_runs, "verification": self.verification_runs},
        }

    @classmethod
    def from_json(cls, document: Mapping[str, Any]) -> Confirmation:
        """Read a document made by :meth:`to_json`; anything else raises RsmkitError."""
        verdict = _get(document, "verdict", str)
        if verdict not in get_args(Verdict):
            raise RsmkitError(f"verification.json: unknown verdict {verdict!r}; run: rsmkit verify")
        runs = _get(document, "simulator_runs", dict)
        best = document.get("best_design")
        factors = _get(document, "factors", dict)
        objectives = _comparisons(document, "objectives")
        if not objectives or not all(isinstance(v, str | int | float) for v in factors.values()):
            raise RsmkitError("verification.json: factors or objectives are malformed; run: rsmkit verify")
        return cls(
            name=_get(document, "name", str),
            point=_get(document, "point", str),
            factors=dict(factors),
            objectives=objectives,
            responses=_comparisons(document, "responses"),
            constraints=tuple(
                ConstraintCheck(_get(c, "text", str), _number(c, "predicted"), _number(c, "actual"))
                for c in _get(document, "constraints", list)
            ),
            verdict=verdict,
            sentence=_get(document, "sentence", str),
            best_design=None if best is None else _number(document, "best_design"),
            design_runs=_get(runs, "design", int),
            extremes=tuple(cls.from_json(extreme) for extreme in _get(document, "extremes", list)),
        )


@dataclass(frozen=True)
class Verification:
    """All verified searches of a study and what they cost.

    Parameters
    ----------
    searches : tuple of Confirmation
        In the order of the study file.
    design_runs, verification_runs : int
        Simulator runs spent on the design and on the verification.
    """

    searches: tuple[Confirmation, ...]
    design_runs: int
    verification_runs: int

    def within(self, tolerance_pct: float) -> bool:
        """Whether every objective is predicted within `tolerance_pct`."""
        return all(search.within(tolerance_pct) for search in self.searches)

    def to_json(self) -> dict[str, Any]:
        """Make a plain document."""
        return {
            "searches": [search.to_json() for search in self.searches],
            "simulator_runs": {"design": self.design_runs, "verification": self.verification_runs},
        }

    @classmethod
    def from_json(cls, document: Mapping[str, Any]) -> Verification:
        """Read a document made by :meth:`to_json`; anything else raises RsmkitError."""
        runs = _get(document, "simulator_runs", dict)
        searches = tuple(Confirmation.from_json(item) for item in _get(document, "searches", list))
        return cls(searches, _get(runs, "design", int), _get(runs, "verification", int))

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><td>{escape(s.name)}</td><td>{s.objective.predicted:.6g}</td><td>{s.objective.actual:.6g}</td>"
            f"<td>{'-' if s.objective.error_pct is None else f'{s.objective.error_pct:.3g} %'}</td>"
            f"<td>{escape(s.verdict)}</td></tr>"
            for s in self.searches
        )
        head = "<tr><th>search</th><th>predicted</th><th>actual</th><th>error</th><th>verdict</th></tr>"
        return f"<table>{head}{rows}</table>"


def _get(document: Any, key: str, kind: type) -> Any:
    value = document.get(key) if isinstance(document, Mapping) else None
    if not isinstance(value, kind) or isinstance(value, bool):
        raise RsmkitError(f"verification.json: {key} must be a {kind.__name__}; run: rsmkit verify")
    return value


def _number(document: Any, key: str) -> float:
    value = document.get(key) if isinstance(document, Mapping) else None
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise RsmkitError(f"verification.json: {key} must be a finite number; run: rsmkit verify")
    return float(value)


def _comparisons(document: Mapping[str, Any], key: str) -> dict[str, Comparison]:
    return {
        name: Comparison(
            _number(item, "predicted"),
            _number(item, "actual"),
            None if _get(document, key, dict)[name].get("low") is None else _number(item, "low"),
            None if item.get("high") is None else _number(item, "high"),
        )
        for name, item in _get(document, key, dict).items()
    }
