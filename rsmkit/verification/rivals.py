"""The design runs that a verified optimum competes with."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from rsmkit.language.space import Floats
from rsmkit.optimum.pareto_front import nondominated
from rsmkit.optimum.problem import Evaluation, Problem, least_margins
from rsmkit.surfaces.models.surface import IntervalKind
from rsmkit.verification.pure_error import PureError
from rsmkit.verification.verification import ROUNDING

__all__ = ["Predictor", "Rivals", "best_known", "find_rivals", "spreads"]


class Predictor(Protocol):
    """A fitted surface, as far as verification needs it."""

    def predict(
        self, points: Floats, *, interval: float, kind: IntervalKind = "prediction"
    ) -> tuple[Floats, Floats, Floats]:
        """Mean, low and high at natural points (n, k), each shape (n,); kind ``mean`` only with noise."""
        ...


@dataclass(frozen=True)
class Rivals:
    """Feasible design runs inside the bounds that no other dominates.

    Parameters
    ----------
    known : Evaluation
        Their values; with noise as the surfaces smooth them, for the best of many noisy runs was lucky.
    errors : ndarray, shape (n, m)
        Half widths of the confidence intervals of the objectives; 0 without noise.
    raw, raw_errors : ndarray, shape (n', m)
        With noise also the runs of all feasible points as they are, with half widths that hold for all of
        them at once (Bonferroni): a run far below all else counts even where the surface smooths it away.
    """

    known: Evaluation
    errors: Floats
    raw: Floats
    raw_errors: Floats

    def __len__(self) -> int:
        return len(self.known)

    def beat(self, objectives: Floats, errors: Floats, scale: Floats) -> bool:
        """Whether one of them is better than `objectives`, shape (m,), beyond rounding and noise.

        Parameters
        ----------
        objectives, errors : ndarray, shape (m,)
            True values of a point and the half widths of their confidence intervals.
        scale : ndarray, shape (m,)
            Spread of each objective; a difference of 1e-6 of it, or of the value, is rounding.
        """
        pairs = ((self.known.objectives, self.errors), (self.raw, self.raw_errors))
        return any(_dominates(values, own, objectives, errors, scale) for values, own in pairs)


def _dominates(values: Floats, own: Floats, objectives: Floats, errors: Floats, scale: Floats) -> bool:
    room = ROUNDING * np.maximum(np.abs(values), scale) + np.hypot(own, errors)
    better = (values <= objectives).all(axis=1) & (values + room < objectives).any(axis=1)
    return bool(better.any())


def find_rivals(
    problem: Problem,
    design: Evaluation,
    runs: NDArray[np.int_],
    noise: PureError,
    surfaces: Mapping[str, Predictor],
    confidence: float,
) -> Rivals:
    """Choose them among the design points, each given once with its mean responses and its number of runs."""
    eligible = _eligible(problem, design)
    none = np.empty((0, design.objectives.shape[1]))
    if not noise.present or not eligible.any():
        known = best_known(problem, design)
        return Rivals(known, np.zeros_like(known.objectives), none, none)
    smooth = problem.evaluate(design.points[eligible])
    kept = (smooth.margins >= least_margins(design)).all(axis=1)
    smooth = smooth.rows(kept)
    smooth = smooth.rows(nondominated(smooth.objectives))
    feasible = design.rows(eligible)
    widths, _ = noise.half_widths(problem, feasible, runs[eligible], confidence)
    if noise.df:
        tail = 0.5 * (1.0 - confidence)
        widths = widths * float(stdtrit(noise.df, 1.0 - tail / len(feasible)) / stdtrit(noise.df, 1.0 - tail))
    return Rivals(smooth, _surface_errors(problem, smooth, surfaces, confidence), feasible.objectives, widths)


def best_known(problem: Problem, design: Evaluation) -> Evaluation:
    """Design runs that an optimum competes with: inside the bounds, feasible, not dominated."""
    inside = design.rows(_eligible(problem, design))
    return inside.rows(nondominated(inside.objectives))


def spreads(problem: Problem, design: Evaluation) -> tuple[Floats, dict[str, float]]:
    """Median less least of the objectives, shape (m,), and of each response over the design runs.

    Objectives that no single run tells, as those of a robust search, are taken from the surfaces.
    """
    objectives = design.objectives
    if len(design) and not np.isfinite(objectives).any():
        objectives = problem.evaluate(design.points).objectives
    each = np.array([_spread(column) for column in objectives.T])
    return each, {name: _spread(column) for name, column in design.responses.items()}


def _spread(values: Floats) -> float:
    finite = values[np.isfinite(values)]
    if not len(finite):
        return 0.0
    return float(np.median(finite) - finite.min()) or float(np.ptp(finite))


def _eligible(problem: Problem, design: Evaluation) -> NDArray[np.bool_]:
    finite = np.isfinite(design.objectives).all(axis=1)
    allowed = (design.margins >= least_margins(design)).all(axis=1)
    return np.asarray(finite & allowed & problem.space.contains(design.points))


def _surface_errors(
    problem: Problem, smooth: Evaluation, surfaces: Mapping[str, Predictor], confidence: float
) -> Floats:
    """Half widths of the objectives, shape (n, m), from those of the responses, as if independent."""
    squares = np.zeros_like(smooth.objectives)
    for name, surface in surfaces.items():
        mean, _, high = surface.predict(smooth.points, interval=confidence, kind="mean")
        half = np.where(np.isfinite(high), high - mean, 0.0)
        both = []
        for shift in (half, -half):  # a distance from a target may change in one direction only
            moved = {**smooth.responses, name: smooth.responses[name] + shift}
            both.append(problem.evaluation(smooth.points, moved).objectives - smooth.objectives)
        squares += np.nan_to_num(np.abs(both).max(axis=0)) ** 2
    return np.asarray(np.sqrt(squares))
