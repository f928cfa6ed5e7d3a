"""The ``[[search]]`` tables of a study file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from rsmkit.io.option_fields import doc
from rsmkit.io.shown import Shown
from rsmkit.optimum.desirability import Desire, undesirability

__all__ = ["PRESETS", "Noise", "Preset", "RobustOptions", "SearchOptions", "ServiceOptions"]


@dataclass(frozen=True)
class Preset:
    """How a genetic algorithm is sized and which operators it uses."""

    population: int
    generations: int
    operators: Literal["polynomial", "adaptive", "scattered"]
    nondominated_sorting: bool = False


PRESETS = {
    "paper": Preset(24, 45, "adaptive"),
    "fast": Preset(24, 8, "polynomial"),
    "matlab_like": Preset(24, 45, "scattered"),
}


@dataclass(frozen=True)
class Noise:
    """How a factor that is set in the study varies in service."""

    mean: float = doc("its mean, natural units")
    spread: float = doc("standard deviation of a normal, half-width of a uniform distribution")
    distribution: Literal["normal", "uniform"] = doc("its law", "normal")

    def problems(self) -> list[tuple[str, str]]:
        """Report what is wrong beyond types."""
        return [] if self.spread > 0 else [("spread", f"must be positive, got {self.spread:g}")]


@dataclass(frozen=True)
class RobustOptions:
    """An objective that allows for factors nobody controls in service."""

    noise: dict[str, Noise] = doc("factors that vary: name = { mean = ..., spread = ... }")
    deviations: float = doc("the objective is its mean plus so many standard deviations", 3.0)
    nodes: int = doc(
        "values of each noise factor at which surfaces, or the simulator, are asked; 3 are exact for second "
        "order",
        3,
    )

    def problems(self) -> list[tuple[str, str]]:
        """Report what is wrong beyond types."""
        found = [] if self.noise else [("noise", "must name at least one factor")]
        if self.deviations < 0:
            found.append(("deviations", f"must not be negative, got {self.deviations:g}"))
        if not 2 <= self.nodes <= 15:
            found.append(("nodes", f"must be 2 to 15, got {self.nodes}"))
        return found


@dataclass(frozen=True)
class ServiceOptions:
    """A search over what responses do under the laws of [uncertainty]."""

    nodes: int = doc(
        "points of the laws, a power of 2, at which surfaces, or the simulator, are asked for each design", 64
    )

    def problems(self) -> list[tuple[str, str]]:
        """Report what is wrong beyond types."""
        if not 8 <= self.nodes <= 65536 or self.nodes & (self.nodes - 1):
            return [("nodes", f"must be a power of 2 from 8 to 65536, got {self.nodes}")]
        return []


MOST = 100_000
"""Individuals, and generations: more are a slip of the keyboard."""


@dataclass(frozen=True)
class SearchOptions(Shown):
    """One search for an optimum on the surfaces."""

    minimize: str | tuple[str, ...] = doc(
        "an expression of responses, factors and functions; a list of them searches for the Pareto front", ()
    )
    desirability: dict[str, Desire] = doc(
        "instead of minimize: what is wanted of each response, name = { goal = ..., low = ..., high = ... }",
        factory=dict,
    )
    robust: RobustOptions | None = doc("factors that vary in service, and how much that counts", None)
    service: ServiceOptions | None = doc(
        "lets expressions use what responses do in service: mean_y, sd_y, q01_y to q999_y, out_y, out_any",
        None,
    )
    name: str = doc("how the search is called in every artefact", "optimum")
    subject_to: tuple[str, ...] = doc("constraints such as 'dp_kpa <= 40'", ())
    method: Literal["ga", "nsga2"] | None = doc(
        "genetic algorithm; by default ga for one objective, nsga2 for several", None
    )
    preset: Literal["paper", "fast", "matlab_like"] = doc(
        "paper: 24 individuals, 45 generations, adaptive feasible mutation; fast: 24 individuals, "
        "8 generations; matlab_like: 24 individuals, 45 generations, two elites, scattered crossover",
        "paper",
    )
    population: int | None = doc("individuals per generation; the preset's when left out", None)
    generations: int | None = doc("number of generations; the preset's when left out", None)
    polish: bool = doc("finish with a local search from the best points found", True)
    polish_method: Literal["gradient", "cobyqa"] = doc(
        "gradient: SLSQP or L-BFGS-B; cobyqa: derivative-free", "gradient"
    )
    seed: int = doc("seed of the search", 1)

    def problems(self) -> list[tuple[str, str]]:
        """Report what is wrong beyond types."""
        found = []
        if self.minimize and self.desirability:
            found.append(("minimize", "and desirability exclude each other"))
        elif self.robust and self.service:
            found.append(("service", "and robust exclude each other"))
        elif not self.objectives or "" in self.objectives:
            found.append(("minimize", "must name at least one objective"))
        if not self.name or not self.name.replace("-", "_").isidentifier():
            found.append(("name", f"must be a short word (letters, digits, - and _), got '{self.name}'"))
        if self.population is not None and not 4 <= self.population <= MOST:
            found.append(("population", f"must be 4 to {MOST}, got {self.population}"))
        if self.generations is not None and not 1 <= self.generations <= MOST:
            found.append(("generations", f"must be 1 to {MOST}, got {self.generations}"))
        if self.seed < 0:
            found.append(("seed", f"must be at least 0, got {self.seed}"))
        several = len(self.objectives) > 1
        if several and self.method == "ga":
            found.append(("method", "'ga' takes one objective; use 'nsga2' for several"))
        if several and self.preset == "matlab_like":
            found.append(("preset", "'matlab_like' takes one objective; use 'paper' or 'fast' for several"))
        elif self.method == "nsga2" and self.preset == "matlab_like":
            found.append(("method", "'nsga2' and the preset 'matlab_like' exclude each other; leave one out"))
        return found

    @property
    def objectives(self) -> tuple[str, ...]:
        """The objective expressions, one or more."""
        if self.desirability:
            return (undesirability(self.desirability),)
        return (self.minimize,) if isinstance(self.minimize, str) else self.minimize

    @property
    def size(self) -> Preset:
        """The preset with the population and generations that the study file asks for."""
        preset = PRESETS[self.preset]
        return Preset(
            self.population or preset.population,
            self.generations or preset.generations,
            preset.operators,
            nondominated_sorting=self.method == "nsga2",
        )
