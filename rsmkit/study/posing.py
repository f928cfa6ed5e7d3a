"""A search of the study file as a problem, whoever gives the responses: surfaces or the simulator."""

from __future__ import annotations

from rsmkit.optimum.options import SearchOptions
from rsmkit.optimum.problem import Evaluator, Problem, build_problem
from rsmkit.optimum.robust import robust_problem
from rsmkit.study.file import Study
from rsmkit.study.user_functions import cheap_functions

__all__ = ["noise_means", "pose", "search_options"]


def search_options(study: Study, name: str) -> SearchOptions:
    """What the study file says of one search."""
    return next(item for item in study.searches if item.name == name)


def pose(study: Study, name: str, evaluator: Evaluator) -> Problem:
    """One search of the study on the whole space; a robust one takes its noise factors as they vary."""
    options = search_options(study, name)
    problem = build_problem(
        study.space,
        options.objectives,
        evaluator,
        responses=study.responses,
        subject_to=options.subject_to,
        functions=cheap_functions(study),
    )
    return robust_problem(problem, options.robust) if options.robust else problem


def noise_means(study: Study, name: str) -> dict[str, float]:
    """Means of the factors that a robust search leaves to chance; empty for any other search."""
    robust = search_options(study, name).robust
    return {factor: noise.mean for factor, noise in robust.noise.items()} if robust else {}
