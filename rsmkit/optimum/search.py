"""Global search: genetic algorithm and gradient polish; NSGA-II and its archive on several objectives."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.io.option_fields import given
from rsmkit.language.expression import parse_expression
from rsmkit.language.space import Floats
from rsmkit.optimum.genetic.evolution import Generation, evolve
from rsmkit.optimum.goal_attainment import attain_goals
from rsmkit.optimum.local.determined import centred
from rsmkit.optimum.local.local_search import LocalSearch
from rsmkit.optimum.local.polish import best_row, polish
from rsmkit.optimum.optimum import Candidate, Optimum
from rsmkit.optimum.options import SearchOptions
from rsmkit.optimum.pareto_front import extremes, hypervolume, igd_plus, knee, nondominated, plane_directions
from rsmkit.optimum.problem import FEASIBLE, Archive, Evaluation, Problem

__all__ = ["candidate_at", "search_problem"]

SAME = 1e-7
"""Points of a front nearer than this part of its range, ten times what searches end apart, are one."""
VIOLATION_STARTS = 5
"""Local searches for the least violation where nothing is feasible."""


@checked
def search_problem(problem: Problem, options: SearchOptions, local: LocalSearch | None = None) -> Optimum:
    """Find the best point (one objective) or the Pareto front (several) inside the factor bounds.

    Parameters
    ----------
    problem : Problem
        What to minimise; `options` gives only the method, the problem gives objectives and constraints.
    options : SearchOptions
        Preset, size, polish, seed.
    local : LocalSearch, optional
        How to polish; the default suits surfaces, ``SIMULATOR`` the true simulator.

    Returns
    -------
    Optimum
        Reproducible for the same problem, options and seed. Where no point satisfies every constraint it is
        the point that violates them least, and ``missed`` says by how much.

    Raises
    ------
    RsmkitError
        When no point can be evaluated.
    """
    with threadpool_limits(limits=1):  # many small matrices: threads would only wait for each other
        local = local or LocalSearch(method=options.polish_method, settle=True)
        return _search(Archive(problem), options, local)


def _search(archive: Archive, options: SearchOptions, local: LocalSearch) -> Optimum:
    problem = archive.problem
    generations = evolve(archive, options.size, options.seed)
    _refuse_unevaluable(archive, options.name)
    aside = 0
    front: tuple[Candidate, ...] = ()
    if len(problem.objectives) == 1:
        best = _scalar(archive, options, local)
        history = _history(archive, generations)
    else:
        front, aside = _front(archive, options, local)
        history = _front_history(archive, generations, front)
        best = next((c for c in front if c.label.startswith("knee")), None) or _nearest(archive)
    size = options.size
    return Optimum(
        name=options.name,
        space=problem.space,
        minimize=tuple(objective.text for objective in problem.objectives),
        subject_to=problem.conditions,
        settings={
            "method": "ga" if len(problem.objectives) == 1 else "nsga2",
            "preset": options.preset,
            "population": size.population,
            "generations": size.generations,
            "polish": options.polish,
            **_wishes(options),
        },
        seed=options.seed,
        evaluations=archive.count + aside,
        best=best,
        history=history,
        front=front,
        missed=_missed(archive, best),
    )


def _wishes(options: SearchOptions) -> dict[str, Any]:
    """What the objectives alone do not tell: desirabilities, and what a robust search makes robust."""
    keys = {"desirability", "robust", "service"} | ({"minimize"} if options.robust else set())
    return {key: value for key, value in given(options).items() if key in keys}


def candidate_at(evaluation: Evaluation, row: int, label: str = "") -> Candidate:
    """One row of an evaluation as a candidate."""
    return Candidate(
        evaluation.points[row],
        tuple(evaluation.objectives[row].tolist()),
        {name: float(column[row]) for name, column in evaluation.responses.items()},
        tuple(evaluation.margins[row].tolist()),
        label,
    )


def _scalar(archive: Archive, options: SearchOptions, local: LocalSearch) -> Candidate:
    if not options.polish:
        return _nearest(archive)
    found = polish(archive, local)
    if archive.violation(found)[0] > 0.0:
        _violate_less(archive, local)
        found = polish(archive, local)
    if archive.violation(found)[0] > 0.0:
        return _nearest(archive)
    return candidate_at(centred(archive, found) if local.settle else found, 0, "optimum")


def _nearest(archive: Archive) -> Candidate:
    """The best point so far: of the least violation, and of these the one with the least first objective."""
    known = archive.everything()
    row = best_row(archive, known)
    feasible = archive.violation(known.rows([row]))[0] == 0.0
    return candidate_at(known, row, "optimum" if feasible else "least violation")


def _violate_less(archive: Archive, local: LocalSearch) -> None:
    """Add points to the archive whose largest scaled violation is least, by goal attainment on the margins.

    Only where evaluations are free: on a simulator the runs already made must do.
    """
    if local.starts == 1:
        return
    problem = archive.problem
    names = [f"miss_{j}" for j in range(len(problem.constraints))]

    def misses(points: Floats) -> dict[str, Floats]:
        return dict(zip(names, -problem.evaluate(points).margins.T, strict=True))

    wanted = tuple(map(parse_expression, names))
    aside = Archive(Problem(problem.space, wanted, misses))
    known = archive.everything()
    order = np.lexsort((np.nan_to_num(known.objectives[:, 0], nan=np.inf), archive.violation(known)))
    starts = known.points[order[:VIOLATION_STARTS]]
    aside.evaluate(starts)
    goal = np.zeros(len(wanted))
    reached = [attain_goals(aside, start, goal, archive.scale, local)[0].points for start in starts]
    archive.evaluate(np.vstack(reached))


def _missed(archive: Archive, best: Candidate) -> dict[str, float] | None:
    """What the best point misses of each constraint, the largest violation first; None if nothing."""
    scaled = np.array(best.margins) / archive.scale
    rows = [int(j) for j in np.argsort(scaled, kind="stable") if not scaled[j] >= -FEASIBLE]
    return {archive.problem.constraints[j].text: -best.margins[j] for j in rows} or None


def _front(archive: Archive, options: SearchOptions, local: LocalSearch) -> tuple[tuple[Candidate, ...], int]:
    """Labelled front, empty where nothing is feasible, and the evaluations spent outside the archive."""
    spent = 0
    if options.polish and not len(_nondominated(archive)):
        _violate_less(archive, local)
    known = _nondominated(archive)
    if not len(known):
        return (), spent
    if options.polish:
        spent = _polish_front(archive, known, local)
        known = _nondominated(archive)
    labels: dict[int, list[str]] = {knee(known.objectives): ["knee"]}
    for objective, row in zip(archive.problem.objectives, extremes(known.objectives), strict=True):
        labels.setdefault(row, []).append(f"lowest {objective.text}")
    front = tuple(candidate_at(known, row, ", ".join(labels.get(row, []))) for row in range(len(known)))
    return front, spent


def _nondominated(archive: Archive) -> Evaluation:
    """Feasible points so far that no other dominates, by rising first objective."""
    known = archive.everything()
    known = known.rows(archive.violation(known) == 0.0)
    known = known.rows(nondominated(known.objectives))
    return known.rows(np.lexsort(known.objectives.T[::-1]))


def _polish_front(archive: Archive, front: Evaluation, local: LocalSearch) -> int:
    """Add the true extremes, a better knee and, where evaluations are free, an even spread to the archive.

    Returns the evaluations that led there.
    """
    problem = archive.problem
    spent = 0
    for objective, end in zip(problem.objectives, extremes(front.objectives), strict=True):
        alone = Archive(replace(problem, objectives=(objective,)))
        alone.evaluate(front.points[[end, knee(front.objectives)]])
        front = _joined(front, archive.evaluate(polish(alone, local).points))
        spent += alone.count
    ideal, nadir = front.objectives.min(axis=0), front.objectives.max(axis=0)
    weights = np.where(nadir > ideal, nadir - ideal, 1.0)
    goals = [front.objectives[knee(front.objectives)]]
    if local.starts > 1:
        goals += list(ideal + plane_directions(len(ideal)) * weights)
    aside = Archive(problem)
    aside.evaluate(front.points)
    known = front.objectives
    for goal in goals:
        nearest = int(((front.objectives - goal) / weights).max(axis=1).argmin())
        reached, _ = attain_goals(aside, front.points[nearest], goal, weights, local)
        if np.abs((known - reached.objectives) / weights).max(axis=1).min() > SAME:
            known = np.vstack([known, archive.evaluate(reached.points).objectives])
    return spent + aside.count


def _joined(first: Evaluation, second: Evaluation) -> Evaluation:
    return Evaluation(
        np.vstack([first.points, second.points]),
        {name: np.r_[column, second.responses[name]] for name, column in first.responses.items()},
        np.vstack([first.objectives, second.objectives]),
        np.vstack([first.margins, second.margins]),
    )


def _refuse_unevaluable(archive: Archive, name: str) -> None:
    if not np.isfinite(archive.violation(archive.everything())).any():
        raise RsmkitError(
            f"search {name}: the objective is not a number at any of {archive.count} points; check the "
            "expression for division by zero or a root of a negative number"
        )


def _history(archive: Archive, generations: list[Generation]) -> dict[str, list[Any]]:
    columns: dict[str, list[Any]] = _common_history(generations)
    for name, summary in (("best", np.min), ("mean", np.mean), ("worst", np.max)):
        columns[name] = [
            float(summary(g.objectives[g.feasible])) if g.feasible.any() else None for g in generations
        ]
    return columns


def _front_history(
    archive: Archive, generations: list[Generation], front: tuple[Candidate, ...]
) -> dict[str, list[Any]]:
    """Hypervolume and IGD+ of the archive after each generation, against the final front and its range."""
    columns = _common_history(generations)
    if not front:
        nothing = [None] * len(generations)
        return {**columns, "hypervolume": nothing, "igd_plus": nothing, "front_size": [0] * len(generations)}
    known = archive.everything()
    feasible = archive.violation(known) == 0.0
    final = np.array([candidate.objectives for candidate in front])
    ideal, nadir = final.min(axis=0), final.max(axis=0)
    volumes, sizes, distances = [], [], []
    for generation in generations:
        so_far = known.objectives[: generation.evaluations][feasible[: generation.evaluations]]
        so_far = so_far[nondominated(so_far)]
        volumes.append(hypervolume(so_far, ideal, nadir))
        distances.append(igd_plus(so_far, final))
        sizes.append(len(so_far))
    return {**columns, "hypervolume": volumes, "igd_plus": distances, "front_size": sizes}


def _common_history(generations: list[Generation]) -> dict[str, list[Any]]:
    return {
        "generation": list(range(1, len(generations) + 1)),
        "evaluations": [generation.evaluations for generation in generations],
        "mean_distance": [_mean_distance(generation.unit) for generation in generations],
    }


def _mean_distance(unit: Floats) -> float:
    """Mean distance between pairs of individuals in the unit box."""
    pairs = np.triu_indices(len(unit), 1)
    return float(np.linalg.norm(unit[pairs[0]] - unit[pairs[1]], axis=1).mean())
