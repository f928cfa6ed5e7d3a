"""What the stages of a study hand to its folder to keep, and get back from it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from rsmkit.io.shown import Shown

if TYPE_CHECKING:  # these load the numerical libraries, which a look at a small file does not need
    from rsmkit.design.design import Design
    from rsmkit.design.quality.assessment import Quality
    from rsmkit.optimum.optimum import Optimum
    from rsmkit.runs.record.run_table import Runs
    from rsmkit.surfaces.choose import Choice
    from rsmkit.surfaces.fitted_response import FittedResponse
    from rsmkit.surfaces.models.surface import Surface

__all__ = ["Fitted", "KeptRuns", "Plan"]


@dataclass(frozen=True)
class Plan:
    """A design and what it can do, as ``plan.json`` has it."""

    design: Design
    quality: Quality
    kept: KeptRuns | None = None


@dataclass(frozen=True)
class KeptRuns:
    """What a plan notes of the runs that it was made around.

    Parameters
    ----------
    wanted : int
        Runs the study is to have, failed ones and those outside its bounds not counted.
    earlier : tuple of str
        Keys of runs that were part of an earlier design and mean nothing to the study as it is now.
    """

    wanted: int
    earlier: tuple[str, ...] = ()


@dataclass(frozen=True)
class Fitted(Shown):
    """The runs, their surfaces, and what the searches found on them."""

    runs: Runs
    failed: int
    responses: dict[str, Choice]
    objectives: dict[str, Choice]
    optima: tuple[Optimum, ...]

    @property
    def surfaces(self) -> dict[str, FittedResponse[Surface]]:
        """The surface of each response."""
        return {name: choice.surface for name, choice in self.responses.items()}

    @property
    def objective_surfaces(self) -> dict[str, FittedResponse[Surface]]:
        """The surface of each objective's own values, by expression."""
        return {text: choice.surface for text, choice in self.objectives.items()}
