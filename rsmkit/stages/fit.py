"""The fit stage: surfaces of responses and objectives, and the searches on them.

Writes ``model.json`` and ``optimum.json``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rsmkit.design.build import region_of_interest
from rsmkit.design.design import Design
from rsmkit.design.quality.assessment import assess
from rsmkit.io.arguments import checked
from rsmkit.language.expression import parse_expression
from rsmkit.language.space import Floats
from rsmkit.optimum.feasible import feasible_region
from rsmkit.optimum.optimum import Optimum
from rsmkit.optimum.options import SearchOptions
from rsmkit.optimum.problem import Problem
from rsmkit.optimum.robust import pinned
from rsmkit.optimum.search import search_problem
from rsmkit.optimum.term_shares import dominance_warning, term_shares
from rsmkit.runs.record.design_runs import DesignRuns
from rsmkit.runs.record.run_table import Runs
from rsmkit.stages.plan import lost_runs, model_terms
from rsmkit.study.file import Study
from rsmkit.study.folder import MODEL_FILE, OPTIMUM_FILE, Fitted, StudyFolder
from rsmkit.study.posing import noise_means, pose
from rsmkit.study.user_functions import cheap_functions, design_constraints
from rsmkit.surfaces.choose import Choice, choose_surface
from rsmkit.surfaces.models.surface import Surface
from rsmkit.verification.failing import avoiding_failures, failing_rule, without_margin

__all__ = ["FitResult", "fit_study", "surface_problem"]


@dataclass(frozen=True)
class FitResult(Fitted):
    """What the fit stage found, and whether it had to work for it."""

    folder: Path
    fresh: bool
    cost: str = ""

    def warnings(self) -> list[str]:
        """What to know: what failed runs cost, searches without a result worth having, drowned terms."""
        values = {name: self.runs.y(name) for name in self.responses}
        values |= dict(zip(self.runs.space.names, self.runs.points.T, strict=True))
        found = [self.cost] if self.cost else []
        for optimum in self.optima:
            found += [f"{optimum.name}: {optimum.obstacles}"] if optimum.obstacles else []
            for text in () if "desirability" in optimum.settings else optimum.minimize:
                objective = parse_expression(text)
                if objective.names <= set(values):
                    sentence = dominance_warning(term_shares(objective, values))
                    found += [f"{optimum.name}: {sentence}"] if sentence else []
        return found

    def overview(self) -> dict[str, Any]:
        """What ``--json`` prints."""
        return {
            "stage": "fit",
            "skipped": self.fresh,
            "files": [str(self.folder / MODEL_FILE), str(self.folder / OPTIMUM_FILE)],
            "runs": {"done": len(self.runs), "failed": self.failed},
            "surfaces": {name: choice.report() for name, choice in self.responses.items()},
            "objectives": {text: choice.report() for text, choice in self.objectives.items()},
            "searches": [optimum.to_json() for optimum in self.optima],
            "warnings": self.warnings(),
        }


@checked
def fit_study(folder: StudyFolder, *, force: bool = False) -> FitResult:
    """Fit and search, unless model and optimum on disk are up to date."""
    evaluation = folder.fit_runs()
    fresh = not force and folder.fit_problem() is None
    if fresh:
        found = folder.fitted()
    else:
        found = _fit(folder.study, evaluation)
        folder.keep_fit(found)
    return FitResult(**vars(found), folder=folder.path, fresh=fresh, cost=failure_cost(folder))


def _fit(study: Study, evaluation: DesignRuns) -> Fitted:
    runs = evaluation.usable
    functions = cheap_functions(study)
    values = dict(zip(study.space.names, runs.points.T, strict=True))
    values |= {name: runs.y(name) for name in study.responses}
    values |= {name: function(runs.points) for name, function in functions.items()}
    responses = {name: _choose(study, runs.points, values[name], name) for name in study.responses}
    plain = [item for item in study.searches if not item.desirability and not item.robust]
    expressions = {text: parse_expression(text) for item in plain for text in item.objectives}
    objectives = {
        text: _choose(study, runs.points, expression(values), text)
        for text, expression in expressions.items()
        if text not in responses and not expression.names.isdisjoint(responses)
    }
    surfaces = {name: choice.surface for name, choice in responses.items()}
    optima = tuple(_search(study, surfaces, options, evaluation.runs) for options in study.searches)
    return Fitted(runs, evaluation.failed, responses, objectives, optima)


def surface_problem(study: Study, surfaces: Mapping[str, Surface], name: str) -> Problem:
    """Put one search of the study file on the surfaces."""

    def predict(points: Floats) -> dict[str, Floats]:
        return {response: surface.predict(points) for response, surface in surfaces.items()}

    return pose(study, name, predict)


def _search(study: Study, surfaces: Mapping[str, Surface], options: SearchOptions, runs: Runs) -> Optimum:
    """Search where the simulator should not fail."""
    problem = surface_problem(study, surfaces, options.name)
    means = noise_means(study, options.name)
    made = runs.done | runs.failed
    safe = avoiding_failures(problem, runs.points[made], runs.failed[made])
    found = without_margin(search_problem(pinned(safe, means) if means else safe, options))
    region = feasible_region(problem) if problem.constraints else None
    return replace(found.completed(study.space, means), region=region)


def _choose(study: Study, points: Floats, y: Floats, response: str) -> Choice:
    return choose_surface(
        study.space,
        points,
        y,
        response=response,
        options=study.file.surface,
        deterministic=study.deterministic,
    )


def failure_cost(folder: StudyFolder) -> str:
    """Say what the design has lost by failed runs; nothing when none failed.

    Judged as the plan was: by the study's own model, over its own region.
    """
    evaluation = folder.fit_runs()
    if not evaluation.failed:
        return ""
    study, runs, planned = folder.study, evaluation.usable, folder.plan().quality
    design = Design(study.space, runs.points, ("run",) * len(runs))
    region = region_of_interest(study.space, study.file.design, design_constraints(study), folder.path)
    left = assess(design, terms=model_terms(study), region=region, deterministic=study.deterministic)
    text = f"{evaluation.failed} of {evaluation.distinct} runs failed and are left out"
    made = evaluation.runs
    if rule := failing_rule(study.space, made.points, made.failed):
        text = f"{text} ({rule})"
    if left.d_efficiency is None or planned.d_efficiency is None:
        return text
    return (
        f"{text}: D-efficiency {left.d_efficiency:.1f} % instead of {planned.d_efficiency:.1f} %, "
        f"largest leverage {max(left.leverages):.3f} instead of {max(planned.leverages, default=1.0):.3f}"
        f"{'; rsmkit plan replaces them' if lost_runs(folder) else ''}"
    )
