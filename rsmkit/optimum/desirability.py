"""Desirability after Derringer and Suich (Journal of Quality Technology 12, 1980).

Each response gets a desirability from 0 (unacceptable) to 1 (as good as it need be); the whole is their
weighted geometric mean, which is to be maximised. One unacceptable response makes the whole unacceptable.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from rsmkit.errors import RsmkitError
from rsmkit.expression import parse_expression
from rsmkit.optimum.problem import Evaluation, Problem
from rsmkit.space import Floats

__all__ = ["Desire", "desirability_problem", "overall_desirability", "overlay"]


@dataclass(frozen=True)
class Desire:
    """What is wanted of one response.

    Parameters
    ----------
    response : str
        Name of a response, function or factor.
    goal : {"maximise", "minimise", "target"}
        ``maximise`` rises from 0 at `low` to 1 at `high`, ``minimise`` falls, ``target`` is 1 at `target` and
        0 at both ends.
    low, high : float
        Ends of the scale.
    target : float, optional
        For ``target``.
    weight, weight_above : float
        Exponents: above 1 only values near the goal please. `weight_above` is that of the falling side of a
        target, by default `weight`.
    importance : float
        Exponent in the geometric mean.
    """

    response: str
    goal: Literal["maximise", "minimise", "target"]
    low: float
    high: float
    target: float | None = None
    weight: float = 1.0
    weight_above: float | None = None
    importance: float = 1.0

    def __post_init__(self) -> None:
        middle = self.target if self.target is not None else 0.5 * (self.low + self.high)
        if not self.low < middle < self.high or (self.goal == "target") != (self.target is not None):
            raise RsmkitError(
                f"desirability of {self.response}: give low < high, and a target between them if wanted"
            )
        if min(self.weight, self.importance, self.weight_above or self.weight) <= 0:
            raise RsmkitError(f"desirability of {self.response}: weights and importance must be positive")

    def __call__(self, values: Floats) -> Floats:
        """Individual desirability, 0..1, of values of any shape."""
        if self.target is None:
            share = np.clip((values - self.low) / (self.high - self.low), 0.0, 1.0)
            rising: Floats = (share if self.goal == "maximise" else 1.0 - share) ** self.weight
            return rising
        below = np.clip((values - self.low) / (self.target - self.low), 0.0, 1.0) ** self.weight
        above = np.clip((self.high - values) / (self.high - self.target), 0.0, 1.0)
        sided: Floats = np.where(values <= self.target, below, above ** (self.weight_above or self.weight))
        return sided


def overall_desirability(desires: tuple[Desire, ...], values: dict[str, Floats]) -> Floats:
    """Geometric mean of the individual desirabilities, weighted by importance; shape of the values."""
    total = sum(desire.importance for desire in desires)
    product: Floats = np.prod(
        [desire(values[desire.response]) ** (desire.importance / total) for desire in desires], axis=0
    )
    return product


def desirability_problem(problem: Problem, desires: tuple[Desire, ...]) -> Problem:
    """The same problem with the loss ``1 - D`` as its objective, named ``undesirability``.

    Where some response is unacceptable ``D`` is flat at zero; there the loss exceeds 1 by how far the
    responses are from acceptable, so that a search finds its way.
    """

    def evaluator(points: Floats) -> dict[str, Floats]:
        responses = dict(problem.evaluator(points))
        values = {**problem.cheap_values(points), **responses}
        loss = 1.0 - overall_desirability(desires, values)
        return {**responses, "undesirability": loss + sum(_distance(desire, values) for desire in desires)}

    return replace(problem, objectives=(parse_expression("undesirability"),), evaluator=evaluator)


def _distance(desire: Desire, values: dict[str, Floats]) -> Floats:
    """How far values lie beyond the unacceptable end, in lengths of the scale."""
    x = values[desire.response]
    distance: Floats = np.zeros_like(x)
    if desire.goal != "minimise":
        distance = distance + np.maximum(desire.low - x, 0.0)
    if desire.goal != "maximise":
        distance = distance + np.maximum(x - desire.high, 0.0)
    return distance / (desire.high - desire.low)


def overlay(problem: Problem, points: Floats) -> tuple[Evaluation, NDArray[np.bool_]]:
    """Evaluate a grid, shape (n, k), and say where all constraints hold: the overlaid contour plot."""
    evaluation = problem.evaluate(points)
    return evaluation, np.asarray((evaluation.margins >= 0).all(axis=1))
