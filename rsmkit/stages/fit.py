"""The fit stage: surfaces of responses and objectives, and the searches on them.

Writes ``model.json`` and ``optimum.json``.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rsmkit.io.arguments import checked
from rsmkit.language.expression import parse_expression
from rsmkit.language.space import Floats
from rsmkit.optimum.feasible import feasible_region
from rsmkit.optimum.optimum import Optimum
from rsmkit.optimum.options import SearchOptions
from rsmkit.optimum.problem import Problem
from rsmkit.optimum.search import search_problem
from rsmkit.optimum.service.robust import pinned
from rsmkit.optimum.term_shares import dominance_warning, term_shares
from rsmkit.runs.record.design_runs import DesignRuns
from rsmkit.runs.record.run_table import Runs
from rsmkit.stages.confirmations import ConfirmationRun, confirmation_runs, overview
from rsmkit.stages.planning.design_cost import design_cost
from rsmkit.study.counts import as_rates, run_sizes
from rsmkit.study.file import Study
from rsmkit.study.folder import MODEL_FILE, OPTIMUM_FILE, Fitted, StudyFolder
from rsmkit.study.groups import places_in_time, random_labels
from rsmkit.study.posing import noise_means, pose, search_options
from rsmkit.study.user_functions import cheap_functions
from rsmkit.surfaces.choose import Choice, choose_surface
from rsmkit.surfaces.estimation.counts.scoring import Counts
from rsmkit.surfaces.kinds import posterior_of
from rsmkit.surfaces.models.surface import Surface
from rsmkit.verification.failing import avoiding_failures, without_margin

__all__ = ["FitResult", "fit_study", "surface_problem"]


@dataclass(frozen=True)
class FitResult(Fitted):
    """What the fit stage found, and whether it had to work for it."""

    folder: Path
    fresh: bool
    cost: tuple[str, ...] = ()
    confirmations: tuple[ConfirmationRun, ...] = ()

    def warnings(self) -> list[str]:
        """What to know: what failed runs cost, searches without a result worth having, drowned terms."""
        values = {name: self.runs.y(name) for name in self.responses}
        values |= dict(zip(self.runs.space.names, self.runs.points.T, strict=True))
        found = [*self.cost, *self._left_out()]
        for optimum in self.optima:
            found += [f"{optimum.name}: {optimum.obstacles}"] if optimum.obstacles else []
            for text in () if "desirability" in optimum.settings else optimum.minimize:
                objective = parse_expression(text)
                if objective.names <= set(values):
                    sentence = dominance_warning(term_shares(objective, values))
                    found += [f"{optimum.name}: {sentence}"] if sentence else []
        return found

    def _left_out(self) -> list[str]:
        """Terms that the surfaces do not have because runs have failed, each sentence once."""
        choices = [*self.responses.items(), *self.objectives.items()]
        told: dict[str, list[str]] = {}
        for name, choice in choices:
            if choice.left_out:
                told.setdefault(choice.left_out, []).append(name)
        return [f"{', '.join(names)}: {sentence}" for sentence, names in told.items()]

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
            **overview(self.confirmations),
        }


@checked
def fit_study(
    folder: StudyFolder, *, force: bool = False, on_step: Callable[[str], None] | None = None
) -> FitResult:
    """Fit and search, unless model and optimum on disk are up to date.

    Parameters
    ----------
    folder : StudyFolder
    force : bool
        Fit and search in any case.
    on_step : callable, optional
        Told in words of every surface and every search that is begun.
    """
    evaluation = folder.fit_runs()
    fresh = not force and folder.fit_problem() is None
    if fresh:
        found = folder.fitted()
    else:
        groups = random_labels(folder.study, folder.plan().design, evaluation)
        places = places_in_time(folder.study, evaluation, folder.journal.load())
        found = _fit(folder.study, evaluation, groups, places, on_step or (lambda step: None))
        folder.keep_fit(found)
    return FitResult(
        **vars(found),
        folder=folder.path,
        fresh=fresh,
        cost=design_cost(folder),
        confirmations=confirmation_runs(folder, found),
    )


def _fit(
    study: Study,
    evaluation: DesignRuns,
    groups: Mapping[str, Sequence[str]],
    places: Mapping[str, int],
    on_step: Callable[[str], None],
) -> Fitted:
    counted, runs = evaluation.usable, as_rates(study, evaluation.usable)
    ended = as_rates(study, evaluation.ended)
    functions = cheap_functions(study)
    values = dict(zip(study.space.names, runs.points.T, strict=True))
    values |= {name: runs.y(name) for name in study.responses}
    values |= {name: function(runs.points) for name, function in functions.items()}
    told = _told(on_step, "fitting", study.responses)
    responses = {
        name: _count(study, ended if name in study.failures else counted, name, places)
        if name in study.counts
        else _choose(study, runs, values, name, {name}, groups, places, evaluation.failed)
        for name in told
    }
    plain = [item for item in study.searches if not (item.desirability or item.robust or item.service)]
    expressions = {text: parse_expression(text) for item in plain for text in item.objectives}
    own = [  # of counts there are no least squares
        text
        for text, e in expressions.items()
        if text not in responses and e.names & set(responses) and not e.names & set(study.counts)
    ]
    objectives = {
        text: _choose(
            study,
            runs,
            values | {text: expressions[text](values)},
            text,
            expressions[text].names,
            groups,
            places,
            evaluation.failed,
        )
        for text in _told(on_step, "fitting", own)
    }
    surfaces = {name: choice.surface for name, choice in responses.items()}
    searches = {options.name: options for options in study.searches}
    optima = tuple(
        _search(study, surfaces, searches[name], evaluation.runs)
        for name in _told(on_step, "searching", searches)
    )
    return Fitted(runs, evaluation.failed, responses, objectives, optima)


def _told(on_step: Callable[[str], None], what: str, names: Iterable[str]) -> Iterator[str]:
    """Give the names one by one, telling of each: ``fitting sag_mm (2 of 3)``."""
    every = list(names)
    for number, name in enumerate(every, start=1):
        on_step(f"{what} {name}{f' ({number} of {len(every)})' if len(every) > 1 else ''}")
        yield name


def surface_problem(study: Study, surfaces: Mapping[str, Surface], name: str) -> Problem:
    """Put one search of the study file on the surfaces."""

    def predict(points: Floats) -> dict[str, Floats]:
        return {response: surface.predict(points) for response, surface in surfaces.items()}

    return pose(study, name, predict, _noise_sd(study, surfaces, name))


def _noise_sd(study: Study, surfaces: Mapping[str, Surface], name: str) -> dict[str, float]:
    """Standard deviation of a repeated run of each response, for searches in service."""
    if study.deterministic or search_options(study, name).service is None:
        return {}
    return {
        response: posterior_of(surface, 20, np.random.default_rng(1), deterministic=False).noise_sd
        for response, surface in surfaces.items()
    }


def _search(study: Study, surfaces: Mapping[str, Surface], options: SearchOptions, runs: Runs) -> Optimum:
    """Search where the simulator should not fail."""
    problem = surface_problem(study, surfaces, options.name)
    means = noise_means(study, options.name)
    made = runs.usable | runs.failed
    safe = avoiding_failures(problem, runs.points[made], runs.failed[made])
    found = without_margin(search_problem(pinned(safe, means) if means else safe, options))
    region = feasible_region(problem) if problem.constraints else None
    return replace(found.completed(study.space, means), region=region)


def _count(study: Study, runs: Runs, response: str, places: Mapping[str, int]) -> Choice:
    """Fit a count to the runs in which it was made."""
    sizes = run_sizes(study, runs)[response]
    kept = np.isfinite(sizes)
    distribution = study.counts[response].distribution
    assert distribution is not None
    return choose_surface(
        study.space,
        runs.points[kept],
        runs.y(response)[kept],
        response=response,
        options=study.file.surface,
        counts=Counts(distribution, sizes[kept]),
        run_order=_places_of(runs, kept, places),
    )


def _choose(
    study: Study,
    runs: Runs,
    values: Mapping[str, Floats],
    response: str,
    needed: Collection[str],
    groups: Mapping[str, Sequence[str]],
    places: Mapping[str, int],
    failed: int,
) -> Choice:
    """Fit one response to the runs in which what it is made of was measured."""
    known = [np.isfinite(runs.y(name)) for name in needed if name in runs.responses]
    kept = np.logical_and.reduce(known) if known else np.ones(len(runs), bool)
    return choose_surface(
        study.space,
        runs.points[kept],
        values[response][kept],
        response=response,
        options=study.file.surface,
        random={name: np.array(labels)[kept].tolist() for name, labels in groups.items()},
        deterministic=study.deterministic,
        failed_runs=failed,
        run_order=_places_of(runs, kept, places),
    )


def _places_of(runs: Runs, kept: NDArray[np.bool_], places: Mapping[str, int]) -> list[int] | None:
    """When each of the runs kept was made; None where that means nothing."""
    if not places:
        return None
    return [places[run.key] for run, ok in zip(runs.runs, kept, strict=True) if ok and run is not None]
