"""Where a simulator fails, as a rule in words, and a search that keeps away from there."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations, pairwise

import numpy as np
from numpy.typing import NDArray

from rsmkit.language.conditions import Constraint
from rsmkit.language.expression import parse_expression
from rsmkit.language.space import Floats, Space
from rsmkit.optimum.optimum import Optimum
from rsmkit.optimum.problem import Problem
from rsmkit.verification.refinement.models.cube import Cube
from rsmkit.verification.refinement.models.failures import fit_failures

__all__ = ["avoiding_failures", "failing_rule", "without_margin"]

NAME = "latent_success"
"""What the added constraint is about; no factor, response or function can be called so twice."""
CLEAR = 0.75
"""Share of the failures that a rule must cover, and of the runs it covers that must have failed."""
FEW = 2


def avoiding_failures(problem: Problem, points: Floats, failed: NDArray[np.bool_]) -> Problem:
    """Add the constraint that a run should rather succeed than fail; nothing without failures.

    Parameters
    ----------
    problem : Problem
        On surfaces.
    points : array, shape (n, k)
        Runs, natural units.
    failed : array of bool, shape (n,)
        Which of them failed.
    """
    cube = Cube(problem.space)
    failures = fit_failures(cube.unit(points), ~failed, cube.categorical)
    if failures is None or failed.all():
        return problem
    expression = parse_expression(NAME)
    return replace(
        problem,
        constraints=(*problem.constraints, Constraint(NAME, expression)),
        functions={**problem.functions, NAME: lambda x: failures.latent(cube.unit(np.asarray(x, float)))},
    )


def without_margin(optimum: Optimum) -> Optimum:
    """Take what :func:`avoiding_failures` added out of what was found."""
    if NAME not in optimum.subject_to:
        return optimum
    missed = {text: miss for text, miss in (optimum.missed or {}).items() if text != NAME}
    return replace(
        optimum,
        subject_to=tuple(text for text in optimum.subject_to if text != NAME),
        best=replace(optimum.best, margins=optimum.best.margins[:-1]),
        front=tuple(replace(candidate, margins=candidate.margins[:-1]) for candidate in optimum.front),
        missed=missed or None,
    )


@dataclass(frozen=True)
class _Rule:
    text: str
    covers: NDArray[np.bool_]


def failing_rule(space: Space, points: Floats, failed: NDArray[np.bool_]) -> str:
    """Say where runs fail, by limits of one or two factors; empty when no such rule is clear.

    Parameters
    ----------
    space : Space
        The factors.
    points : array, shape (n, k)
        Runs, natural units.
    failed : array of bool, shape (n,)
        Which of them failed.
    """
    points, first = np.unique(points, axis=0, return_index=True)
    failed = failed[first]
    if failed.sum() < FEW or failed.all():
        return ""
    single = list(_limits(space, points))
    pairs = (_Rule(f"{a.text} and {b.text}", a.covers & b.covers) for a, b in combinations(single, 2))
    best = max(single, key=lambda rule: _quality(rule, failed))
    if _quality(best, failed) < 1.0:
        other = max(pairs, key=lambda rule: _quality(rule, failed), default=best)
        best = other if _quality(other, failed) > _quality(best, failed) else best
    inside = int(best.covers.sum())
    hits = int((best.covers & failed).sum())
    if not inside or hits < CLEAR * failed.sum() or hits < CLEAR * inside:
        return ""
    elsewhere = int(failed.sum()) - hits
    return (
        f"the simulator fails where {best.text} ({hits} of {inside} runs there, {elsewhere} of "
        f"{len(failed) - inside} elsewhere)"
    )


def _limits(space: Space, points: Floats) -> Iterator[_Rule]:
    """Every limit of one factor between its runs, both ways; every category."""
    for factor, column in zip(space, points.T, strict=True):
        values = np.unique(column)
        if not factor.domain.is_numeric:
            for value in values.tolist():
                yield _Rule(f"{factor.name} = {factor.value(value)}", column == value)
            continue
        for low, high in pairwise(values.tolist()):
            middle = 0.5 * (low + high)
            yield _Rule(f"{factor.name} > {middle:.4g}", column > middle)
            yield _Rule(f"{factor.name} < {middle:.4g}", column < middle)


def _quality(rule: _Rule, failed: NDArray[np.bool_]) -> float:
    """Youden's index: the share of failures covered minus the share of successes covered."""
    return float(rule.covers[failed].mean() - rule.covers[~failed].mean())
