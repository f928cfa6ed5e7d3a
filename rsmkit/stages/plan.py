"""The plan stage: from ``[factors]`` and ``[design]`` to ``design.csv``.

``plan.json`` beside it says what the design was made from and how good it is.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rsmkit.errors import RsmkitError, StageError
from rsmkit.io.atomic_files import read_text
from rsmkit.io.digests import digest
from rsmkit.io.json_codec import from_json, read_json, write_json
from rsmkit.io.option_fields import given
from rsmkit.stages.user_functions import design_constraints
from rsmkit.study.changes import changes
from rsmkit.study.file import Study

if TYPE_CHECKING:
    from rsmkit.design.design import Design
    from rsmkit.design.quality.assessment import Quality
    from rsmkit.language.terms import Terms

__all__ = ["PlanResult", "load_plan", "model_terms", "plan_design", "plan_problem"]

DESIGN_FILE = "design.csv"
PLAN_FILE = "plan.json"
REDO = "Run: rsmkit plan --force"


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


def plan_design(study: Study, *, force: bool = False) -> PlanResult:
    """Make the design, unless the one on disk is up to date."""
    if not force and plan_problem(study) is None:
        return load_plan(study)
    from rsmkit.design.build import build_design, region_of_interest
    from rsmkit.design.quality.assessment import assess, refuse_singular

    options = study.file.design
    terms = model_terms(study)
    constraints = design_constraints(study)
    design = build_design(study.space, options, terms=terms, constraints=constraints, folder=study.folder)
    region = region_of_interest(study.space, options, constraints, study.folder)
    quality = assess(design, terms=terms, region=region, deterministic=study.deterministic)
    refuse_singular(quality)
    path = study.folder / DESIGN_FILE
    design.to_csv(path)
    record: dict[str, Any] = {
        "schema": 1,
        "made_from": plan_record(study),
        "design": digest(path.read_text(encoding="utf-8")),
        "quality": quality.to_json(),
    }
    write_json(study.folder / PLAN_FILE, record)
    return PlanResult(design, path, quality, fresh=False)


def plan_problem(study: Study) -> str | None:
    """Say why the plan stage must run (again), or None when ``design.csv`` is up to date."""
    path = study.folder / DESIGN_FILE
    if not path.is_file() or not (study.folder / PLAN_FILE).is_file():
        return "there is no design yet"
    record = read_json(study.folder / PLAN_FILE, REDO)
    different = changes(record.get("made_from"), plan_record(study))
    if different:
        return f"{DESIGN_FILE} was made from another study file ({'; '.join(different)})"
    if record.get("design") != digest(read_text(path, REDO)):
        return f"{DESIGN_FILE} was edited since (to use your own points, set design.kind = 'file')"
    return None


def load_plan(study: Study) -> PlanResult:
    """Read the design of an up-to-date plan stage.

    Raises
    ------
    StageError
        If the stage is missing or out of date.
    """
    problem = plan_problem(study)
    if problem:
        raise StageError(f"{problem}. Run: rsmkit plan {_where(study)}")
    from rsmkit.design.design import Design
    from rsmkit.design.quality.assessment import Quality

    path, plan = study.folder / DESIGN_FILE, study.folder / PLAN_FILE
    design = Design.from_csv(path, study.space)
    quality = from_json(Quality, read_json(plan, REDO).get("quality"), plan, REDO, at="quality")
    return PlanResult(design, path, quality, fresh=True)


def model_terms(study: Study) -> Terms:
    """Give the model that the design is made and judged for: the surfaces' own terms, or their order."""
    from rsmkit.language.terms import full_terms, parse_terms

    surface = study.file.surface
    return (
        parse_terms(study.space, surface.terms) if surface.terms else full_terms(study.space, surface.order)
    )


def plan_record(study: Study) -> dict[str, Any]:
    """Everything in the study file that the design depends on."""
    return {
        "factors": {name: given(options) for name, options in study.file.factors.items()},
        "functions": study.file.functions if study.file.design.subject_to else {},
        "design": study.file.design.record | _file_record(study),
        "surface": {"order": study.file.surface.order}
        | ({"terms": list(study.file.surface.terms)} if study.file.surface.terms else {}),
    }


def _file_record(study: Study) -> dict[str, str]:
    """Hashes of the user's own tables, so that editing one makes the design stale."""
    record = {}
    for key, name in study.file.design.tables.items():
        if name:
            try:
                record[key] = digest((study.folder / name).read_text(encoding="utf-8"))
            except (OSError, UnicodeDecodeError) as error:
                raise RsmkitError(f"design: {study.folder / name} cannot be read: {error}") from None
    return record


def _where(study: Study) -> str:
    return "" if study.folder == Path() else str(study.folder)
