"""A search of the study file as a problem, whoever gives the responses: surfaces or the simulator."""

from __future__ import annotations

from collections.abc import Mapping

from rsmkit.language.space import Floats
from rsmkit.optimum.options import SearchOptions
from rsmkit.optimum.problem import Evaluator, Problem, build_problem
from rsmkit.optimum.service.in_service import service_names, service_points, service_problem
from rsmkit.optimum.service.robust import robust_problem, spread_points
from rsmkit.study.file import Study
from rsmkit.study.user_functions import cheap_functions

__all__ = ["in_service_names", "node_points", "noise_means", "pose", "runs_each", "search_options"]


def search_options(study: Study, name: str) -> SearchOptions:
    """What the study file says of one search."""
    return next(item for item in study.searches if item.name == name)


def pose(
    study: Study, name: str, evaluator: Evaluator, noise_sd: Mapping[str, float] | None = None
) -> Problem:
    """One search of the study on the whole space; a robust one takes its noise factors as they vary.

    `noise_sd` is the standard deviation of a repeated run of each response, where the evaluator gives means
    of runs: part of what responses do in service.
    """
    options = search_options(study, name)
    problem = build_problem(
        study.space,
        options.objectives,
        evaluator,
        responses=(*study.responses, *in_service_names(study, name)),
        subject_to=options.subject_to,
        functions=cheap_functions(study),
    )
    laws = study.service.of_factors() if options.service else None
    if options.service and laws:
        limits, nodes = study.file.specifications, options.service.nodes
        return service_problem(problem, laws, limits, nodes, problem, noise_sd)
    return robust_problem(problem, options.robust) if options.robust else problem


def in_service_names(study: Study, name: str) -> tuple[str, ...]:
    """Quantities of a search in service that no single run tells; empty for any other search."""
    if search_options(study, name).service is None:
        return ()
    return service_names(study.responses, tuple(study.file.specifications))


def node_points(study: Study, name: str, points: Floats) -> Floats | None:
    """Points that tell what a search asks of each of `points`, as many for each; None for the points."""
    options = search_options(study, name)
    laws = study.service.of_factors() if options.service else None
    if options.service and laws:
        return service_points(laws, points, options.service.nodes)
    return spread_points(study.space, options.robust, points) if options.robust else None


def runs_each(study: Study, name: str) -> int:
    """Runs that tell what a search asks of one design."""
    options = search_options(study, name)
    if options.robust:
        return int(options.robust.nodes ** len(options.robust.noise))
    return options.service.nodes if options.service else 1


def noise_means(study: Study, name: str) -> dict[str, float]:
    """Means of the factors that a robust search leaves to chance; empty for any other search."""
    robust = search_options(study, name).robust
    return {factor: noise.mean for factor, noise in robust.noise.items()} if robust else {}
