"""The plan stage: from ``[factors]`` and ``[design]`` to ``design.csv``.

``plan.json`` beside it says what the design was made from and how good it is.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rsmkit.io.arguments import checked
from rsmkit.study.file import Study
from rsmkit.study.folder import DESIGN_FILE, Plan, StudyFolder
from rsmkit.study.user_functions import check_functions, design_constraints

if TYPE_CHECKING:
    from rsmkit.design.design import Design
    from rsmkit.design.quality.assessment import Quality
    from rsmkit.language.terms import Terms

__all__ = ["PlanResult", "model_terms", "plan_design"]


@dataclass(frozen=True)
class PlanResult:
    """A design and what it can do."""

    design: Design
    path: Path
    quality: Quality
    fresh: bool

    def overview(self) -> dict[str, Any]:
        """What ``--json`` prints."""
        return {
            "stage": "plan",
            "skipped": self.fresh,
            "file": str(self.path),
            "runs": len(self.design),
            "kinds": {kind: self.design.kinds.count(kind) for kind in dict.fromkeys(self.design.kinds)},
            "quality": self.quality.to_json(),
        }


@checked
def plan_design(folder: StudyFolder, *, force: bool = False) -> PlanResult:
    """Make the design, unless the one on disk is up to date."""
    check_functions(folder.study)
    fresh = not force and folder.plan_problem() is None
    plan = folder.plan() if fresh else _made(folder)
    return PlanResult(plan.design, folder.path / DESIGN_FILE, plan.quality, fresh)


def _made(folder: StudyFolder) -> Plan:
    from rsmkit.design.build import build_design, region_of_interest
    from rsmkit.design.quality.assessment import assess, refuse_singular

    study = folder.study
    options = study.file.design
    terms = model_terms(study)
    constraints = design_constraints(study)
    design = build_design(study.space, options, terms=terms, constraints=constraints, folder=folder.path)
    region = region_of_interest(study.space, options, constraints, folder.path)
    quality = assess(design, terms=terms, region=region, deterministic=study.deterministic)
    refuse_singular(quality)
    return folder.keep_plan(design, quality)


def model_terms(study: Study) -> Terms:
    """Give the model that the design is made and judged for: the surfaces' own terms, or their order."""
    from rsmkit.language.terms import full_terms, parse_terms

    surface = study.file.surface
    return (
        parse_terms(study.space, surface.terms) if surface.terms else full_terms(study.space, surface.order)
    )
