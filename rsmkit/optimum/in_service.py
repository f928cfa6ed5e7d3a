"""Searches over what responses do in service: mean, deviation, quantiles, and how often they are outside.

Each point of a search is asked at the same points of its laws (a Sobol sequence), on surfaces and on the
simulator alike. From their mean, deviation and skewness follow quantiles and tails by Pearson's law of type
III, which varies smoothly with the design and is exact for normal and for chi-square responses.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np
from scipy.special import gammainc, gammaincc, gammaincinv, ndtr, ndtri
from scipy.stats import qmc

from rsmkit.language.joint_law import Laws
from rsmkit.language.space import Floats
from rsmkit.optimum.problem import Problem

__all__ = ["QUANTILES", "service_names", "service_points", "service_problem"]

QUANTILES = {"q01": 0.01, "q05": 0.05, "q50": 0.5, "q95": 0.95, "q99": 0.99, "q999": 0.999}
"""Prefixes of quantiles."""
SEED = 20_011
STRAIGHT = 1e-4
"""Skewness below which a law is normal."""


class Limits(Protocol):
    """What a specification is."""

    @property
    def low(self) -> float | None:
        """Least acceptable value."""
        ...

    @property
    def high(self) -> float | None:
        """Largest acceptable value."""
        ...


def service_names(responses: Sequence[str], specifications: Sequence[str]) -> tuple[str, ...]:
    """What a search may use beside the responses, which are their means."""
    of_each = [f"{word}_{name}" for name in responses for word in ("mean", "sd", *QUANTILES)]
    return (*of_each, *(f"out_{name}" for name in specifications), *(["out_any"] if specifications else []))


def service_points(laws: Laws, points: Floats, nodes: int) -> Floats:
    """Every point, shape (n, k) natural, at `nodes` points of the laws about it, in its place."""
    m = len(laws.makers)
    u = qmc.Sobol(m, rng=np.random.default_rng(SEED)).random(nodes)
    return np.vstack([laws.at(point).of_uniform(u) for point in points])


def service_problem(
    problem: Problem, laws: Laws, specifications: Mapping[str, Limits], nodes: int, posed: Problem
) -> Problem:
    """Give a problem the statistics of service as responses.

    Parameters
    ----------
    problem : Problem
        Whose evaluator gives the responses themselves.
    laws : Laws
        About each point in turn.
    specifications : mapping of str to limits
        By response.
    nodes : int
        Points of the laws at which each point is asked, a power of 2.
    posed : Problem
        The same, with objectives and constraints that may use :func:`service_names`.
    """

    def evaluator(points: Floats) -> dict[str, Floats]:
        found = problem.evaluator(service_points(laws, points, nodes))
        made: dict[str, Floats] = {}
        kept = np.ones(len(points))
        for name, column in found.items():
            values = np.asarray(column, float).reshape(len(points), nodes)
            mean, sd = values.mean(axis=1), values.std(axis=1)
            with np.errstate(divide="ignore", invalid="ignore"):
                third = np.mean((values - mean[:, None]) ** 3, axis=1)
                skewness = np.where(sd > 0, third / sd**3, 0.0)
            made |= {name: mean, f"mean_{name}": mean, f"sd_{name}": sd}
            for word, p in QUANTILES.items():
                made[f"{word}_{name}"] = mean + sd * _quantile(p, skewness)
            if name in specifications:
                made[f"out_{name}"] = _outside(mean, sd, skewness, specifications[name])
                kept = kept * (1.0 - made[f"out_{name}"])
        return made | ({"out_any": 1.0 - kept} if specifications else {})

    return replace(posed, evaluator=evaluator)


def _outside(mean: Floats, sd: Floats, skewness: Floats, limits: Limits) -> Floats:
    outside = np.zeros(len(mean))
    with np.errstate(divide="ignore", invalid="ignore"):
        if limits.high is not None:
            above = np.where(sd > 0, (limits.high - mean) / sd, np.sign(limits.high - mean) * np.inf)
            outside = outside + _above(np.nan_to_num(above, posinf=1e6, neginf=-1e6), skewness)
        if limits.low is not None:
            below = np.where(sd > 0, (mean - limits.low) / sd, np.sign(mean - limits.low) * np.inf)
            outside = outside + _above(np.nan_to_num(below, posinf=1e6, neginf=-1e6), -skewness)
    # a failed run leaves nothing known
    return np.where(np.isfinite(mean), np.minimum(outside, 1.0), np.nan)


def _above(z: Floats, skewness: Floats) -> Floats:
    """Probability that a standardised Pearson III number is above z."""
    size = np.where(np.abs(skewness) > STRAIGHT, np.abs(skewness), 1.0)
    shape = 4.0 / size**2
    place = np.maximum(shape + np.sqrt(shape) * z * np.sign(skewness), 0.0)
    skewed = np.where(skewness > 0, gammaincc(shape, place), gammainc(shape, place))
    return np.asarray(np.where(np.abs(skewness) > STRAIGHT, skewed, ndtr(-z)))


def _quantile(p: float, skewness: Floats) -> Floats:
    """Quantile of a standardised Pearson III number."""
    size = np.where(np.abs(skewness) > STRAIGHT, np.abs(skewness), 1.0)
    shape = 4.0 / size**2
    up = (gammaincinv(shape, p) - shape) / np.sqrt(shape)
    down = -(gammaincinv(shape, 1.0 - p) - shape) / np.sqrt(shape)
    skewed = np.where(skewness > 0, up, down)
    return np.asarray(np.where(np.abs(skewness) > STRAIGHT, skewed, ndtri(p)))
