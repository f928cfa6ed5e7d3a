"""What a design has lost, or gained, by runs that were not made as planned."""

from __future__ import annotations

import numpy as np

from rsmkit.design.build import region_of_interest
from rsmkit.design.design import Design
from rsmkit.design.quality.assessment import assess
from rsmkit.language.space import Floats
from rsmkit.runs.record.design_runs import DesignRuns
from rsmkit.stages.planning.plan import lost_runs, model_terms
from rsmkit.study.folder import StudyFolder
from rsmkit.study.user_functions import design_constraints
from rsmkit.verification.failing import failing_rule

__all__ = ["design_cost", "excluded_words"]


def design_cost(folder: StudyFolder) -> tuple[str, ...]:
    """Say what became of the plan and what that costs; nothing when all runs were made as planned.

    Judged as the plan was: by the study's own model, over its own region.
    """
    evaluation = folder.fit_runs()
    runs = evaluation.usable
    told = _departures(folder, evaluation)
    remedy = "; rsmkit plan replaces those that failed" if lost_runs(folder) else ""
    found = [f"{'; '.join(told)}{_efficiency(folder, runs.points)}{remedy}"] if told else []
    for name in folder.study.responses if runs.partial.any() else ():
        known = np.isfinite(runs.y(name))
        if not known.all():
            text = f"{name} was measured in {known.sum()} of {len(runs)} runs"
            found.append(f"{text}{_efficiency(folder, runs.points[known])}")
    return tuple(found)


def _efficiency(folder: StudyFolder, points: Floats) -> str:
    """What the points that are left, shape (n, k), are worth beside those that were planned."""
    study, planned = folder.study, folder.plan().quality
    design = Design(study.space, points, ("run",) * len(points))
    region = region_of_interest(study.space, study.file.design, design_constraints(study), folder.path)
    left = assess(design, terms=model_terms(study), region=region, deterministic=study.deterministic)
    if left.d_efficiency is None or planned.d_efficiency is None:
        return ""
    return (
        f": D-efficiency {left.d_efficiency:.1f} % instead of {planned.d_efficiency:.1f} %, "
        f"largest leverage {max(left.leverages):.3f} instead of {max(planned.leverages, default=1.0):.3f}"
    )


def excluded_words(evaluation: DesignRuns) -> list[str]:
    """Each excluded run of a design with its reason."""
    return [
        f"run {row + 1} ({run.excluded})"
        for row, run in enumerate(evaluation.runs.runs)
        if run is not None and run.excluded
    ]


def _departures(folder: StudyFolder, evaluation: DesignRuns) -> list[str]:
    """How the runs differ from the plan, in words."""
    told, made = [], evaluation.runs
    if evaluation.failed:
        text = f"{evaluation.failed} of {evaluation.distinct} runs failed and are left out"
        rule = failing_rule(folder.study.space, made.points, made.failed)
        text = f"{text} ({rule})" if rule else text
        told.append(text)
    if excluded := excluded_words(evaluation):
        told.append(f"excluded: {', '.join(excluded)}")
    drifted = sum(run is not None and run.made_at != run.factors for run in evaluation.usable.runs)
    if drifted:
        told.append(f"not made as planned, and fitted where they were made: {drifted} of the runs")
    if evaluation.added is not None:
        told.append(f"added to the plan: {len(evaluation.added.finished())} of the runs")
    return told
