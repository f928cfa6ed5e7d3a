"""What is to be optimised: objectives and constraints over factors, responses and cheap functions.

The same description serves fitted surfaces and the true simulator; only the evaluator differs. Every
objective is minimised; every constraint holds where its margin is not negative.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.io.shown import Shown
from rsmkit.language.conditions import Constraint, parse_conditions
from rsmkit.language.expression import Expression, parse_expression
from rsmkit.language.space import Floats, Space

__all__ = [
    "FEASIBLE",
    "Archive",
    "Evaluation",
    "Evaluator",
    "Function",
    "Problem",
    "build_problem",
    "joined",
    "least_margins",
]

Evaluator = Callable[[Floats], Mapping[str, Floats]]
"""Responses at points in natural units: ``(n, k)`` in, one array ``(n,)`` per response name out."""

Function = Callable[[Floats], Floats]
"""A quantity that costs nothing (a tangency margin, a mass): ``(n, k)`` natural in, ``(n,)`` out."""

FEASIBLE = 1e-9
"""Largest violation that counts as none, relative to the size of the margin over the box."""

ROUNDING = 1e-6
"""Largest violation of a true run that counts as none, relative to the spread of the margin over the runs."""


@dataclass(frozen=True)
class Evaluation:
    """What is known at `n` points.

    Parameters
    ----------
    points : ndarray, shape (n, k)
        Natural units.
    responses : dict of str to ndarray, shape (n,)
        One entry per response.
    objectives : ndarray, shape (n, m)
        To be minimised; nan where the simulator failed.
    margins : ndarray, shape (n, c)
        Constraint margins, satisfied where >= 0.
    """

    points: Floats
    responses: dict[str, Floats]
    objectives: Floats
    margins: Floats

    def __len__(self) -> int:
        return len(self.points)

    @property
    def succeeded(self) -> NDArray[np.bool_]:
        """Which points have every objective and margin, shape (n,)."""
        values = np.hstack([self.objectives, self.margins])
        return np.asarray(np.isfinite(values).all(axis=1), bool)

    def rows(self, chosen: ArrayLike) -> Evaluation:
        """Pick rows by indices or by a mask."""
        pick = np.asarray(chosen)
        responses = {name: column[pick] for name, column in self.responses.items()}
        return Evaluation(self.points[pick], responses, self.objectives[pick], self.margins[pick])


def joined(first: Evaluation, second: Evaluation) -> Evaluation:
    """Rows of one after those of the other; responses that only one of them knows are left out."""
    return Evaluation(
        np.vstack([first.points, second.points]),
        {
            name: np.r_[column, second.responses[name]]
            for name, column in first.responses.items()
            if name in second.responses
        },
        np.vstack([first.objectives, second.objectives]),
        np.vstack([first.margins, second.margins]),
    )


def least_margins(known: Evaluation) -> Floats:
    """Least margin of each constraint that counts as satisfied, shape (c,).

    A true run at an active constraint misses it by rounding, or by as much as a simulator's own tolerance:
    what counts as nothing is :data:`ROUNDING` of how much the margin varies over the runs.
    """
    if not known.margins.shape[1]:
        return np.empty(0)
    margins = known.margins[np.isfinite(known.margins).all(axis=1)]
    if not len(margins):
        return np.zeros(known.margins.shape[1])
    spread = np.subtract(*np.quantile(margins, [0.75, 0.25], axis=0))
    size = np.abs(margins).max(axis=0)
    return np.asarray(-np.maximum(ROUNDING * spread, FEASIBLE * size))


@dataclass(frozen=True)
class Problem(Shown):
    """Objectives to minimise over the box of a space, subject to margins >= 0.

    Parameters
    ----------
    space : Space
        Factors of any kind; the search stays within ``low..high`` and on the space's equalities.
    objectives : tuple of Expression
        One for a scalar problem, several for a Pareto front.
    evaluator : Evaluator
        Gives the responses; surfaces or the true simulator.
    constraints : tuple of Constraint
        Of factors, functions and responses.
    functions : mapping of str to Function
        Named quantities computed exactly, never modelled.
    """

    space: Space
    objectives: tuple[Expression, ...]
    evaluator: Evaluator
    constraints: tuple[Constraint, ...] = ()
    functions: Mapping[str, Function] = field(default_factory=dict)

    def evaluate(self, points: Floats) -> Evaluation:
        """Evaluate everything at natural points, shape (n, k)."""
        return self.evaluation(points, self.evaluator(points))

    def evaluation(self, points: Floats, responses: Mapping[str, Floats]) -> Evaluation:
        """Objectives and margins that follow from responses already known at `points`, shape (n, k)."""
        known = {name: np.asarray(column, float) for name, column in responses.items()}
        values = {**self.cheap_values(points), **known}
        count = len(points)
        return Evaluation(
            points,
            known,
            _columns([expression(values) for expression in self.objectives], count),
            _columns([constraint.margin(values) for constraint in self.constraints], count),
        )

    def cheap_values(self, points: Floats) -> dict[str, Floats]:
        """Factors and functions at natural points, shape (n, k): all that needs no simulation."""
        factors = dict(zip(self.space.names, np.asarray(points, float).T, strict=True))
        made = {name: np.asarray(function(points), float) for name, function in self.functions.items()}
        return {**factors, **made}

    @property
    def conditions(self) -> tuple[str, ...]:
        """All that points must keep, as texts: constraints, then the equalities of the space."""
        texts = (*(c.text for c in self.constraints), *(e.text for e in self.space.equalities))
        return tuple(dict.fromkeys(texts))

    @property
    def cheap_constraints(self) -> tuple[Constraint, ...]:
        """Constraints that need no response, known exactly before any simulation."""
        free = {*self.space.names, *self.functions}
        return tuple(c for c in self.constraints if c.names <= free)

    def cheap_margins(self, points: Floats) -> Floats:
        """Margins of :attr:`cheap_constraints` at natural points (n, k); shape (n, number of them)."""
        values = self.cheap_values(points)
        return _columns([c.margin(values) for c in self.cheap_constraints], len(points))


@checked
def build_problem(
    space: Space,
    minimize: str | Sequence[str],
    evaluator: Evaluator,
    *,
    responses: Sequence[str],
    subject_to: Sequence[str] = (),
    functions: Mapping[str, Function] | None = None,
) -> Problem:
    """Make a problem from the texts of a study file.

    Parameters
    ----------
    space : Space
        The factors.
    minimize : str or sequence of str
        Expressions of factors, `responses` and `functions`.
    evaluator : Evaluator
        What `responses` are at given points.
    responses : sequence of str
        Names the evaluator provides.
    subject_to : sequence of str
        Constraints such as ``"dp_kpa <= 40"``. Linear equalities of continuous factors narrow the space:
        every point that is ever evaluated lies on them.
    functions : mapping of str to Function, optional
        Cheap named quantities.

    Raises
    ------
    RsmkitError
        For an expression that is malformed or uses an unknown name.
    """
    texts = (minimize,) if isinstance(minimize, str) else tuple(minimize)
    functions = functions or {}
    known = {*space.names, *responses, *functions}
    if len(known) != len(space) + len(responses) + len(functions):
        raise RsmkitError("factors, responses and functions must all have different names")
    objectives = tuple(parse_expression(text, known) for text in texts)
    asked = parse_conditions(subject_to, known, space.categories, space.names)
    held = space.holding(asked.equalities)
    return Problem(held, objectives, evaluator, asked.constraints, functions)


class Archive:
    """Everything a search has evaluated, in order; also the place where it is counted.

    Parameters
    ----------
    problem : Problem
        What is evaluated.
    """

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self._parts: list[Evaluation] = []
        self._scale: Floats | None = None

    def evaluate(self, points: Floats) -> Evaluation:
        """Evaluate natural points, shape (n, k), and remember them."""
        result = self.problem.evaluate(points)
        self._parts.append(result)
        if self._scale is None:
            sizes = np.where(np.isfinite(result.margins), np.abs(result.margins), 0.0)
            largest = sizes.max(axis=0, initial=0.0)
            self._scale = np.where(largest > 0, largest, 1.0)
        return result

    @property
    def first(self) -> Evaluation:
        """The first batch: spread over the box in a search."""
        return self._parts[0]

    @property
    def count(self) -> int:
        """Number of evaluations so far."""
        return sum(len(part) for part in self._parts)

    @property
    def scale(self) -> Floats:
        """Size of each margin in the first batch, shape (c,)."""
        return np.ones(len(self.problem.constraints)) if self._scale is None else self._scale

    def everything(self) -> Evaluation:
        """All evaluations so far, oldest first."""
        parts = self._parts
        names = parts[0].responses
        return Evaluation(
            np.concatenate([p.points for p in parts]),
            {name: np.concatenate([p.responses[name] for p in parts]) for name in names},
            np.concatenate([p.objectives for p in parts]),
            np.concatenate([p.margins for p in parts]),
        )

    def scaled_margins(self, evaluation: Evaluation) -> Floats:
        """Margins over their size in the first batch, so that constraints of different units compare."""
        return np.asarray(evaluation.margins / self.scale)

    def violation(self, evaluation: Evaluation) -> Floats:
        """Largest scaled violation, shape (n,): 0 when feasible, inf when the point could not be run."""
        worst = np.maximum(0.0, -self.scaled_margins(evaluation)).max(axis=1, initial=0.0)
        worst = np.maximum(worst, _outside(self.problem.space, evaluation.points))
        failed = ~(
            np.isfinite(evaluation.objectives).all(axis=1) & np.isfinite(evaluation.margins).all(axis=1)
        )
        return np.where(failed, np.inf, np.where(worst <= FEASIBLE, 0.0, worst))


def _outside(space: Space, points: Floats) -> Floats:
    """By what part of a range points that keep equalities leave the bounds, shape (n,); 0 without any."""
    if space.affine is None:
        return np.zeros(len(points))
    beyond = np.maximum(space.lows - points, points - space.highs) / (space.highs - space.lows)
    return np.asarray(np.maximum(0.0, beyond).max(axis=1, initial=0.0))


def _columns(arrays: Sequence[Floats], count: int) -> Floats:
    """Stack arrays that may be plain numbers (a constant expression) into shape (count, number)."""
    stacked = [np.broadcast_to(array, (count,)) for array in arrays]
    return np.column_stack(stacked) if stacked else np.empty((count, 0))
