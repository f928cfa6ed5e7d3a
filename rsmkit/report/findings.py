"""What a study found: what every report is written from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from rsmkit.design.design import Design
from rsmkit.language.space import Floats, Space
from rsmkit.optimum.optimum import Optimum
from rsmkit.optimum.problem import Function
from rsmkit.report.replay import Replay
from rsmkit.runs.record.run_table import Runs
from rsmkit.surfaces.choose import Choice
from rsmkit.surfaces.fitted_response import FittedResponse
from rsmkit.surfaces.models.surface import Surface
from rsmkit.variation.findings_of_laws import Uncertainty
from rsmkit.verification.refinement.refinement import RefinementRecord
from rsmkit.verification.verification import SpentRuns, Verification

__all__ = ["Findings"]


@dataclass(frozen=True)
class Findings:
    """What a study found, whole.

    Parameters
    ----------
    study_name : str
        Title.
    runs : Runs
        Successful runs the surfaces were fitted to, each once.
    surfaces : mapping of str to FittedResponse
        By response.
    objective_surfaces : mapping of str to FittedResponse
        By objective expression; they give objectives their intervals.
    titles : mapping of str to str
        Wording of the responses for axes (``tip deflection [mm]``).
    design : Design, optional
        Tells what kind of point each run is.
    optima : sequence of Optimum
    verification : Verification, optional
    tolerance_pct : float
        What its verdicts allow.
    choices : mapping of str to Choice
        By response, why it has this kind of surface and what else was tried.
    labels : sequence of str
        What people call each run; when left out, its row in the design.
    refinements : mapping of str to RefinementRecord
        By search, what ``refinement.json`` holds.
    functions : mapping of str to Function
        Cheap quantities that constraints use, of natural points (n, k).
    failed : int
        Runs that ended badly.
    failed_points : array, shape (m, k)
        Where.
    spent : SpentRuns, optional
        What all runs on record were made for; counted from the above when left out.
    uncertainty : Uncertainty, optional
        What the laws of service do.
    settings : mapping
        The simulator's constant settings, handed to the scene.
    scene : str
        JavaScript text that defines ``draw(canvas, factors, frame)``; see ``docs/explorer.md``.
    replays : sequence of Replay
        Time tables of verified designs.
    """

    study_name: str
    runs: Runs
    surfaces: Mapping[str, FittedResponse[Surface]]
    objective_surfaces: Mapping[str, FittedResponse[Surface]] = field(default_factory=dict)
    titles: Mapping[str, str] = field(default_factory=dict)
    design: Design | None = None
    optima: Sequence[Optimum] = ()
    verification: Verification | None = None
    tolerance_pct: float = 2.0
    choices: Mapping[str, Choice] = field(default_factory=dict)
    labels: Sequence[str] = ()
    refinements: Mapping[str, RefinementRecord] = field(default_factory=dict)
    functions: Mapping[str, Function] = field(default_factory=dict)
    failed: int = 0
    failed_points: Sequence[Sequence[float]] | Floats = ()
    spent: SpentRuns | None = None
    uncertainty: Uncertainty | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)
    scene: str = ""
    replays: Sequence[Replay] = ()

    @property
    def cost(self) -> SpentRuns:
        """What the runs were made for."""
        if self.spent:
            return self.spent
        checks = self.verification.simulator_runs.verification if self.verification else 0
        return SpentRuns(len(self.runs), checks, len(self.runs) + checks + self.failed)

    @property
    def space(self) -> Space:
        """The factors."""
        return self.runs.space

    @property
    def by_hand(self) -> bool:
        """Whether people made the runs."""
        return all(run is not None and run.by_hand for run in self.runs.runs)

    def title(self, response: str) -> str:
        """Wording of a response."""
        return self.titles.get(response) or response
