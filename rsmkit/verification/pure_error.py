"""How far repeated runs of one point differ: pure error, and what it leaves open about a mean."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri, stdtrit

from rsmkit.language.space import Floats
from rsmkit.optimum.problem import Evaluation, Problem

__all__ = ["FEW", "PureError", "Sampled", "merged", "pure_error"]

FEW = 3
"""Degrees of freedom below which a stated standard deviation is believed instead."""


@runtime_checkable
class Sampled(Protocol):
    """A surface that knows the noise of runs that are not repeated, as the distribution of counts does."""

    def sampling_sd(self, points: Floats) -> Floats:
        """Standard deviation of what the runs at natural points (n, k) say together, shape (n,)."""
        ...


@dataclass(frozen=True)
class PureError:
    """Noise of the simulator.

    Parameters
    ----------
    residuals : dict of str to ndarray, shape (n,)
        Deviations of repeated runs from the mean of their point, by response; one row is one run.
    df : int
        Degrees of freedom: repeated runs less their points.
    objective_sd : float
        Standard deviation of the objective at a repeated point, as stated; 0 where none is.
    sampled : dict of str to Sampled
        Responses whose noise follows from their mean: it is never taken to be less.
    """

    residuals: dict[str, Floats]
    df: int
    objective_sd: float = 0.0
    sampled: dict[str, Sampled] = field(default_factory=dict)

    @property
    def present(self) -> bool:
        """Whether there is any noise."""
        stated = self.objective_sd > 0 or bool(self.sampled)
        return stated or any(column.any() for column in self.residuals.values())

    def half_widths(
        self, problem: Problem, known: Evaluation, runs: NDArray[np.int_], confidence: float
    ) -> tuple[Floats, Floats]:
        """Half widths of two-sided confidence intervals of means of runs.

        Each mean is shifted by every residual over the root of the number of runs; the mean square of what an
        objective or a margin changes by is its variance, whatever function of the responses it is.

        Parameters
        ----------
        problem : Problem
            Gives objectives and margins of responses.
        known : Evaluation
            n points with the mean responses there.
        runs : ndarray of int, shape (n,)
            Runs behind each mean.
        confidence : float
            Such as 0.95.

        Returns
        -------
        objectives : ndarray, shape (n, m)
        margins : ndarray, shape (n, c)
        """
        root = np.sqrt(runs)
        count = max(map(len, self.residuals.values()), default=0)
        repeated = [
            {name: column[row] / root for name, column in self.residuals.items()} for row in range(count)
        ]
        told = [{name: surface.sampling_sd(known.points)} for name, surface in self.sampled.items()]
        wide = 0.5 + 0.5 * confidence
        factor = float(stdtrit(self.df, wide)) / math.sqrt(self.df) if self.df else 0.0
        objectives, margins = (
            np.maximum(factor * by_runs, float(ndtri(wide)) * by_law)
            for by_runs, by_law in zip(
                _moved(problem, known, repeated), _moved(problem, known, told), strict=True
            )
        )
        if self.objective_sd > 0 and self.df < FEW:
            stated = float(ndtri(wide)) * self.objective_sd / root
            objectives = np.repeat(stated[:, None], objectives.shape[1], axis=1)
        return objectives, margins


def _moved(
    problem: Problem, known: Evaluation, shifts: Iterable[Mapping[str, Floats]]
) -> tuple[Floats, Floats]:
    """Roots of the sums of squares by which shifted responses move the objectives and the margins."""
    squares = [np.zeros_like(known.objectives), np.zeros_like(known.margins)]
    for shift in shifts:
        moved = {name: column + shift.get(name, 0.0) for name, column in known.responses.items()}
        there = problem.evaluation(known.points, moved)
        squares[0] += np.nan_to_num(there.objectives - known.objectives) ** 2
        squares[1] += np.nan_to_num(there.margins - known.margins) ** 2
    return np.sqrt(squares[0]), np.sqrt(squares[1])


def pure_error(
    groups: Iterable[Mapping[str, Floats]],
    names: Sequence[str],
    objective_sd: float = 0.0,
    sampled: Mapping[str, Sampled] | None = None,
) -> PureError:
    """Pool the deviations within groups of repeated runs.

    Parameters
    ----------
    groups : iterable of mapping of str to ndarray
        The runs of one point, by response; those of which a response is not finite are left out.
    names : sequence of str
        Responses that count.
    objective_sd : float
        As stated by the user.
    sampled : mapping of str to Sampled, optional
        Responses whose noise follows from their mean.
    """
    parts, df = [], 0
    for group in groups:
        values = np.column_stack([group[name] for name in names]) if names else np.empty((0, 0))
        values = values[np.isfinite(values).all(axis=1)]
        if len(values) > 1:
            parts.append(values - values.mean(axis=0))
            df += len(values) - 1
    rows = np.vstack(parts) if parts else np.empty((0, len(names)))
    return PureError(dict(zip(names, rows.T, strict=True)), df, objective_sd, dict(sampled or {}))


def merged(problem: Problem, runs: Evaluation) -> tuple[Evaluation, NDArray[np.int_], list[Evaluation]]:
    """Replace repeated points by one with the mean responses.

    Returns
    -------
    Evaluation
        Each point once, in the order of their first runs.
    ndarray of int
        Runs of each.
    list of Evaluation
        The runs of the repeated points.
    """
    places: dict[bytes, list[int]] = {}
    for row, point in enumerate(runs.points + 0.0):  # -0.0 is the same place as 0.0
        places.setdefault(point.tobytes(), []).append(row)
    groups = list(places.values())
    counts = np.array([len(group) for group in groups], int)
    repeated = [runs.rows(group) for group in groups if len(group) > 1]
    if not repeated:
        return runs, counts, []
    points = runs.points[[group[0] for group in groups]]
    means = {
        name: np.array([_mean(column[group]) for group in groups]) for name, column in runs.responses.items()
    }
    return problem.evaluation(points, means), counts, repeated


def _mean(values: Floats) -> float:
    """Of those that were measured; nan where none was."""
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else math.nan
