"""The plan stage: from ``[factors]`` and ``[design]`` to ``design.csv``.

``plan.json`` beside it says what the design was made from and how good it is.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rsmkit.io.arguments import checked
from rsmkit.io.json_codec import to_json
from rsmkit.io.shown import Shown
from rsmkit.study.file import Study
from rsmkit.study.folder import DESIGN_FILE, Plan, StudyFolder
from rsmkit.study.user_functions import check_functions, design_constraints

if TYPE_CHECKING:
    from rsmkit.design.design import Design
    from rsmkit.design.quality.assessment import Quality
    from rsmkit.language.terms import Terms
    from rsmkit.stages.planning.paid_runs import Stock

__all__ = ["PlanResult", "lost_runs", "model_terms", "plan_design"]


@dataclass(frozen=True)
class PlanResult(Shown):
    """A design and what it can do."""

    design: Design
    path: Path
    quality: Quality
    fresh: bool
    stock: Stock | None = None

    def overview(self) -> dict[str, Any]:
        """What ``--json`` prints."""
        return {
            "stage": "plan",
            "skipped": self.fresh,
            "file": str(self.path),
            "runs": len(self.design),
            "kinds": {kind: self.design.kinds.count(kind) for kind in dict.fromkeys(self.design.kinds)},
            "quality": self.quality.to_json(),
            **({"kept": to_json(self.stock)} if self.stock else {}),
        }


@checked
def plan_design(folder: StudyFolder, *, force: bool = False, replace_lost: bool = False) -> PlanResult:
    """Make the design, unless the one on disk is up to date.

    Runs of an earlier design stay, and only what is missing beside them is planned.

    Parameters
    ----------
    folder : StudyFolder
    force : bool
        Make it anew all the same.
    replace_lost : bool
        Make it anew when runs of it have failed: other points take their place.
    """
    check_functions(folder.study)
    fresh = not force and folder.plan_problem() is None and not (replace_lost and lost_runs(folder))
    plan = folder.plan() if fresh else _made(folder)
    stock = None
    if folder.journal.path.exists() and not (fresh and not folder.standing().missing):
        from rsmkit.stages.planning.paid_runs import look_at_stock

        stock = look_at_stock(folder)
    return PlanResult(plan.design, folder.path / DESIGN_FILE, plan.quality, fresh, stock)


def lost_runs(folder: StudyFolder) -> int:
    """Design points of an up-to-date plan that failed and that no other run stands in for.

    None while no run at all has succeeded, for then it is the simulator that wants looking after.
    """
    from rsmkit.design.around_runs import OUTSIDE

    state = folder.standing()
    if not folder.study.file.design.keep_runs or folder.study.random or not (state.failed and state.done):
        return 0
    plan = folder.plan()
    if plan.kept:
        outside = plan.design.kinds.count(OUTSIDE)
        return max(0, plan.kept.wanted + outside - (state.distinct - state.failed))
    return state.failed


def _made(folder: StudyFolder) -> Plan:
    from rsmkit.design.build import build_design, region_of_interest
    from rsmkit.design.quality.assessment import assess, refuse_singular

    study = folder.study
    options = study.file.design
    terms = model_terms(study)
    constraints = design_constraints(study)
    ideal = build_design(
        study.space, options, terms=terms, constraints=constraints, folder=folder.path, hard=study.hard
    )
    design = counted = ideal
    kept = None
    if options.keep_runs and folder.journal.path.exists() and not study.random:
        from rsmkit.stages.planning.paid_runs import plan_around

        design, counted, kept = plan_around(folder, ideal, terms, constraints)
    region = region_of_interest(study.space, options, constraints, folder.path)
    quality = assess(counted, terms=terms, region=region, deterministic=study.deterministic)
    refuse_singular(quality)
    if counted.block_ratio is not None:
        from rsmkit.stages.planning.plot_outlook import with_plots

        quality = with_plots(quality, counted, terms, region, study.hard)
    return folder.keep_plan(design, quality, kept, around=design is not ideal)


def model_terms(study: Study) -> Terms:
    """Give the model that the design is made and judged for: the surfaces' own terms, or their order."""
    from rsmkit.language.space_terms import read_terms, space_terms

    surface = study.file.surface
    return (
        read_terms(study.space, surface.terms) if surface.terms else space_terms(study.space, surface.order)
    )
