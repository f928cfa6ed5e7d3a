"""The fit stage: surfaces of responses and objectives, and the searches on them.

Writes ``model.json`` and ``optimum.json``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rsmkit.design.design import Design
from rsmkit.design.quality.assessment import assess
from rsmkit.errors import RsmkitError, StageError
from rsmkit.io.digests import digest
from rsmkit.io.json_codec import damaged, from_json, read_json, write_json
from rsmkit.io.option_fields import given
from rsmkit.language.expression import parse_expression
from rsmkit.language.space import Floats
from rsmkit.optimum.feasible import feasible_region
from rsmkit.optimum.optimum import Optimum, OptimumForm
from rsmkit.optimum.options import SearchOptions
from rsmkit.optimum.problem import Problem
from rsmkit.optimum.robust import pinned
from rsmkit.optimum.search import search
from rsmkit.optimum.term_shares import dominance_warning, term_shares
from rsmkit.runs.record.run_table import Runs
from rsmkit.stages.evaluate import DesignRuns, load_runs
from rsmkit.stages.plan import load_plan
from rsmkit.stages.posing import noise_means, pose
from rsmkit.stages.user_functions import cheap_functions
from rsmkit.study.changes import changes
from rsmkit.study.file import Study
from rsmkit.surfaces.choose import Choice, choose_surface
from rsmkit.surfaces.models.surface import Surface

__all__ = ["FitResult", "fit_problem", "fit_study", "load_fit", "search_problem"]

MODEL_FILE = "model.json"
OPTIMUM_FILE = "optimum.json"
REDO = "Run: rsmkit fit --force"


@dataclass(frozen=True)
class FitResult:
    """Surfaces and what the searches found on them."""

    runs: Runs
    failed: int
    responses: dict[str, Choice]
    objectives: dict[str, Choice]
    optima: tuple[Optimum, ...]
    folder: Path
    fresh: bool
    cost: str = ""

    def warnings(self) -> list[str]:
        """What to know: what failed runs cost, and objectives of which one term drowns the others."""
        values = {name: self.runs.y(name) for name in self.responses}
        values |= dict(zip(self.runs.space.names, self.runs.points.T, strict=True))
        found = [self.cost] if self.cost else []
        for optimum in self.optima:
            for text in () if "desirability" in optimum.settings else optimum.minimize:
                objective = parse_expression(text)
                if objective.names <= set(values):
                    sentence = dominance_warning(term_shares(objective, values))
                    found += [f"{optimum.name}: {sentence}"] if sentence else []
        return found

    @property
    def surfaces(self) -> dict[str, Surface]:
        """The surface of each response."""
        return {name: choice.surface for name, choice in self.responses.items()}

    @property
    def objective_surfaces(self) -> dict[str, Surface]:
        """The surface of each objective's own values, by expression."""
        return {text: choice.surface for text, choice in self.objectives.items()}

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


def fit_study(study: Study, *, force: bool = False) -> FitResult:
    """Fit and search, unless model and optimum on disk are up to date."""
    evaluation = load_runs(study)
    if not force and fit_problem(study, evaluation) is None:
        return load_fit(study, evaluation)
    runs = evaluation.usable()
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
    optima = tuple(_search(study, surfaces, options) for options in study.searches)
    cost = failure_cost(study, evaluation)
    made_from = fit_record(study, evaluation)
    model = {
        "schema": 1,
        "made_from": made_from,
        "responses": {name: choice.to_json() for name, choice in responses.items()},
        "objectives": {text: choice.to_json() for text, choice in objectives.items()},
        "reports": {name: choice.report() for name, choice in (responses | objectives).items()},
    }
    write_json(study.folder / MODEL_FILE, model)
    write_json(
        study.folder / OPTIMUM_FILE,
        {
            "schema": 1,
            "made_from": search_record(study, made_from),
            "searches": [o.to_json() for o in optima],
        },
    )
    return FitResult(runs, evaluation.failed, responses, objectives, optima, study.folder, False, cost)


def search_problem(study: Study, surfaces: Mapping[str, Surface], name: str) -> Problem:
    """Put one search of the study file on the surfaces."""

    def predict(points: Floats) -> dict[str, Floats]:
        return {response: surface.predict(points) for response, surface in surfaces.items()}

    return pose(study, name, predict)


def _search(study: Study, surfaces: Mapping[str, Surface], options: SearchOptions) -> Optimum:
    problem = search_problem(study, surfaces, options.name)
    means = noise_means(study, options.name)
    found = search(pinned(problem, means) if means else problem, options)
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


def fit_problem(study: Study, evaluation: DesignRuns) -> str | None:
    """Say why the fit stage must run (again), or None when its files are up to date."""
    for file in (MODEL_FILE, OPTIMUM_FILE):
        if not (study.folder / file).is_file():
            return "there is no model yet" if file == MODEL_FILE else "there is no optimum yet"
    model = read_json(study.folder / MODEL_FILE, REDO)
    different = changes(model.get("made_from"), fit_record(study, evaluation))
    if different:
        return f"{MODEL_FILE} is out of date ({'; '.join(different)})"
    optimum = read_json(study.folder / OPTIMUM_FILE, REDO)
    different = changes(optimum.get("made_from"), search_record(study, model["made_from"]))
    return f"{OPTIMUM_FILE} is out of date ({'; '.join(different)})" if different else None


def load_fit(study: Study, evaluation: DesignRuns | None = None) -> FitResult:
    """Read the surfaces and optima of an up-to-date fit stage.

    Raises
    ------
    StageError
        If the stage is missing or out of date.
    """
    evaluation = evaluation or load_runs(study)
    problem = fit_problem(study, evaluation)
    if problem:
        raise StageError(f"{problem}. Run: rsmkit fit")
    model = read_json(study.folder / MODEL_FILE, REDO)
    responses, objectives = (_choices(model, part) for part in ("responses", "objectives"))
    if set(responses) != set(study.responses):
        raise RsmkitError(f"{MODEL_FILE}: damaged (its responses are not those of the study). {REDO}")
    return FitResult(
        evaluation.usable(),
        evaluation.failed,
        responses,
        objectives,
        _optima(study),
        study.folder,
        fresh=True,
        cost=failure_cost(study, evaluation),
    )


def failure_cost(study: Study, evaluation: DesignRuns) -> str:
    """Say what the design has lost by failed runs; nothing when none failed."""
    if not evaluation.failed:
        return ""
    runs, planned = evaluation.usable(), load_plan(study).quality
    left = assess(Design(study.space, runs.points, ("run",) * len(runs)), order=study.file.surface.order)
    text = f"{evaluation.failed} of {evaluation.distinct} runs failed and are left out"
    if left.d_efficiency is None or planned.d_efficiency is None:
        return text
    return (
        f"{text}: D-efficiency {left.d_efficiency:.1f} % instead of {planned.d_efficiency:.1f} %, "
        f"largest leverage {max(left.leverages):.3f} instead of {max(planned.leverages, default=1.0):.3f}"
    )


def _choices(model: dict[str, Any], part: str) -> dict[str, Choice]:
    """Read the surfaces under one key of the model file."""
    documents = model.get(part)
    if not isinstance(documents, dict):
        raise RsmkitError(f"{MODEL_FILE}: damaged (it has no {part}). {REDO}")
    try:
        return {name: Choice.from_json(document) for name, document in documents.items()}
    except RsmkitError as error:
        raise RsmkitError(f"{MODEL_FILE}: damaged ({error}). {REDO}") from None


def _optima(study: Study) -> tuple[Optimum, ...]:
    """Read what the searches found."""
    path = study.folder / OPTIMUM_FILE
    searches = read_json(path, REDO).get("searches")
    forms = from_json(tuple[OptimumForm, ...], searches, path, REDO, at="searches")
    problems = [
        f"searches[{i}]: {text}" for i, form in enumerate(forms) for text in form.problems(study.space)
    ]
    if len(forms) != len(study.searches):
        problems.append("its searches are not those of the study")
    if problems:
        raise damaged(path, problems, REDO)
    return tuple(form.optimum(study.space) for form in forms)


def fit_record(study: Study, evaluation: DesignRuns) -> dict[str, Any]:
    """Everything the surfaces depend on."""
    done = [run for run in evaluation.usable().runs if run is not None]
    return {
        "runs": digest([[run.key, *(run.value(name) for name in study.responses)] for run in done]),
        "surface": given(study.file.surface),
        "responses": list(study.responses),
        "objectives": sorted({text for item in study.searches for text in item.objectives}),
    }


def search_record(study: Study, model: dict[str, Any]) -> dict[str, Any]:
    """Everything the optima depend on."""
    return {
        "model": digest(model),
        "factors": {name: given(options) for name, options in study.file.factors.items()},
        "functions": study.file.functions,
        "search": {options.name: given(options) for options in study.searches},
    }
