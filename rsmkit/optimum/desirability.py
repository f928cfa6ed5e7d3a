"""Desirability after Derringer and Suich (Journal of Quality Technology 12, 1980), as an expression.

Each response gets a desirability from 0 (unacceptable) to 1 (as good as it need be); the whole is their
geometric mean, weighted by importance, which is to be maximised. One unacceptable response makes the whole
unacceptable. As an expression it is an objective like any other: on surfaces, on the simulator, in the page.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from rsmkit.io.arguments import checked
from rsmkit.io.option_fields import doc
from rsmkit.io.shown import Shown

__all__ = ["Desire", "desirability", "undesirability"]

ROUNDING = 1e-9
"""Part of a scale by which nothing is missed: the end of the scale itself is unacceptable, too."""


@dataclass(frozen=True)
class Desire(Shown):
    """What is wanted of one response (or function, or factor)."""

    goal: Literal["maximize", "minimize", "target"] = doc(
        "maximize: desirability 0 at low, 1 at high; minimize: 1 at low, 0 at high; target: 1 at the target, "
        "0 at low and at high"
    )
    low: float = doc("lower end of the scale")
    high: float = doc("upper end of the scale")
    target: float | None = doc("where a target lies, between low and high", None)
    weight: float = doc("exponent: above 1 only values near the goal please", 1.0)
    weight_above: float | None = doc("exponent above the target; weight when left out", None)
    importance: float = doc("exponent in the geometric mean of all", 1.0)

    def problems(self) -> list[tuple[str, str]]:
        """Report what is wrong beyond types."""
        found = []
        if not self.low < self.high:
            found.append(("low", f"must be less than high, got {self.low:g} and {self.high:g}"))
        if (self.goal == "target") != (self.target is not None):
            found.append(("target", "belongs to goal = 'target', and to no other"))
        elif self.target is not None and not self.low < self.target < self.high:
            found.append(("target", f"must lie between low and high, got {self.target:g}"))
        for key in ("weight", "weight_above", "importance"):
            value = getattr(self, key)
            if value is not None and value <= 0:
                found.append((key, f"must be positive, got {value:g}"))
        return found

    def text(self, name: str, exponent: float = 1.0) -> str:
        """Desirability of the quantity `name`, raised to a power, as an expression."""
        rising = _ramp(f"({name} - {_number(self.low)})", self.high - self.low)
        falling = _ramp(f"({_number(self.high)} - {name})", self.high - self.low)
        if self.target is None:
            return f"{rising if self.goal == 'maximize' else falling}{_power(self.weight * exponent)}"
        below = _ramp(f"({name} - {_number(self.low)})", self.target - self.low)
        above = _ramp(f"({_number(self.high)} - {name})", self.high - self.target)
        weight_above = self.weight if self.weight_above is None else self.weight_above
        return f"{below}{_power(self.weight * exponent)}*{above}{_power(weight_above * exponent)}"

    def obstacle(self, name: str, value: float) -> str:
        """Say that a value is unacceptable, and what would be acceptable."""
        limits = {"maximize": f"above {self.low:g}", "minimize": f"below {self.high:g}"}
        between = f"between {self.low:g} and {self.high:g}"
        short = value - self.high if value > self.high or self.goal == "minimize" else self.low - value
        missed = f" (misses by {short:.4g})" if short > ROUNDING * (self.high - self.low) else ""
        return f"{name} is {value:.5g}, acceptable {limits.get(self.goal, between)}{missed}"

    def shortfall(self, name: str) -> str:
        """How far the quantity `name` lies beyond the unacceptable end, in lengths of the scale."""
        sides = []
        if self.goal != "minimize":
            sides.append(f"max(0, {_number(self.low)} - {name})")
        if self.goal != "maximize":
            sides.append(f"max(0, {name} - {_number(self.high)})")
        return f"({' + '.join(sides)})/{_number(self.high - self.low)}"


@checked
def desirability(desires: Mapping[str, Desire]) -> str:
    """Overall desirability, 0..1, of named quantities, as an expression to be maximised."""
    total = sum(desire.importance for desire in desires.values())
    return "*".join(desire.text(name, desire.importance / total) for name, desire in desires.items())


def undesirability(desires: Mapping[str, Desire]) -> str:
    """What a search minimises: minus the desirability.

    Where some response is unacceptable the desirability is flat at zero; there the expression rises with the
    distance of the responses from what is acceptable, so that a search finds its way.
    """
    return " + ".join([f"-({desirability(desires)})", *(d.shortfall(name) for name, d in desires.items())])


def _ramp(rise: str, length: float) -> str:
    return f"min(1, max(0, {rise}/{_number(length)}))"


def _power(exponent: float) -> str:
    return "" if exponent == 1.0 else f"**{_number(exponent)}"


def _number(value: float) -> str:
    return repr(float(value)) if value >= 0 else f"({float(value)!r})"
