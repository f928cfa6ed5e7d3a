"""How often responses leave their specifications under given laws, on surfaces and what these leave open."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr
from scipy.stats import qmc

from rsmkit.language.joint_law import JointLaw
from rsmkit.language.space import Floats
from rsmkit.surfaces.posterior import Posterior
from rsmkit.variation.sensitivity.decomposition import Interval
from rsmkit.variation.sensitivity.sampled_indices import law_points

__all__ = ["ALL", "Cloud", "Fraction", "Limits", "fractions", "make_cloud"]

ALL = "all"
"""Stands for any specification that is not kept."""
PILOT = 1 << 13
POOL = 1 << 17
DEEP = 1 << 20
"""Points of the law at which surfaces are asked: first, where few of these fail, and where very few do."""
FEW = 200
"""Failing points that a fraction needs before a larger sample is not worth it."""
PART = 1 << 15
DOUBT = 5.0
"""Standard deviations of a surface from a limit beyond which no drawn one is asked."""
TAIL_SAMPLES = 20_000
"""Points near a limit at which every drawn surface is asked."""


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


def excess(values: Floats, limits: Limits) -> Floats:
    """How far values lie outside, any shape; negative inside."""
    found = np.full(np.shape(values), -np.inf)
    if limits.high is not None:
        found = np.maximum(found, values - limits.high)
    if limits.low is not None:
        found = np.maximum(found, limits.low - values)
    return found


def probability_outside(values: Floats, limits: Limits, sd: Floats | float) -> Floats:
    """Probability that normal numbers about `values` are outside, any shape; `sd` may be 0."""
    if not np.any(sd):
        return np.asarray(excess(values, limits) > 0.0, float)
    spread = np.maximum(sd, np.finfo(float).tiny)
    found = np.zeros(np.shape(values))
    with np.errstate(over="ignore"):  # an infinity is as far off as it should be
        if limits.high is not None:
            found = found + ndtr((values - limits.high) / spread)
        if limits.low is not None:
            found = found + ndtr((limits.low - values) / spread)
    return np.minimum(found, 1.0)


@dataclass(frozen=True, eq=False)
class Cloud:
    """Points of a law and the surfaces there.

    Parameters
    ----------
    points : array, shape (n, k)
    values : dict of str to array, shape (n,)
        Of each response's surface.
    draws : dict of str to array, shape (count, n)
        Of drawn surfaces.
    """

    points: Floats
    values: dict[str, Floats]
    draws: dict[str, Floats]

    @cached_property
    def draw_sd(self) -> dict[str, Floats]:
        """What each surface leaves open at each point, shape (n,)."""
        return {name: rows.std(axis=0) for name, rows in self.draws.items()}


def make_cloud(posteriors: Mapping[str, Posterior], law: JointLaw, seed: int, count: int = PILOT) -> Cloud:
    """Ask all surfaces at points of the law."""
    points = law.of_uniform(law_points(law, count, seed)[0])
    return Cloud(
        points,
        {name: own.predict(points) for name, own in posteriors.items()},
        {name: own.draw(points) for name, own in posteriors.items()},
    )


@dataclass(frozen=True, eq=False)
class Fraction:
    """How often a specification is not kept.

    Parameters
    ----------
    value : float
        On the surface itself.
    draws : array, shape (count,)
        On drawn surfaces, with the error of sampling.
    """

    value: float
    draws: Floats

    def interval(self, confidence: float) -> Interval:
        """Interval that holds what the surface leaves open and the error of sampling."""
        tail = 0.5 * (1.0 - confidence)
        low, high = np.quantile(self.draws, [tail, 1.0 - tail])
        return min(float(low), self.value), max(float(high), self.value)


def fractions(
    posteriors: Mapping[str, Posterior],
    law: JointLaw,
    specifications: Mapping[str, Limits],
    *,
    seed: int,
    cloud: Cloud | None = None,
) -> dict[str, Fraction]:
    """Find how often each specification is not kept, and any of them (:data:`ALL`).

    Where few points of a first sample fail a larger one is taken, of which drawn surfaces are only asked
    where they may differ.

    Parameters
    ----------
    posteriors : mapping of str to Posterior
        By response.
    law : JointLaw
    specifications : mapping of str to limits
        By response.
    seed : int
    cloud : Cloud, optional
        The first sample, if there is one already.
    """
    asked = {name: posteriors[name] for name in specifications}
    first = cloud or make_cloud(asked, law, seed)
    found = _on_cloud(asked, specifications, first.values, first.draws, len(first.points), seed)
    for key, usual in found.items():
        if key == ALL and len(specifications) == 1:
            found[ALL] = next(iter(found.values()))
            break
        which = specifications if key == ALL else {key: specifications[key]}
        polynomial = all(asked[name].polynomials is not None for name in which)
        count, fraction = len(first.points), usual
        for size in (POOL, DEEP) if polynomial else (POOL,):
            if max(fraction.value, float(fraction.draws.mean())) * count < FEW:
                fraction, count = _on_tail(asked, law, which, first, size, seed)[key], size
        found[key] = fraction
    return found


def _on_cloud(
    posteriors: Mapping[str, Posterior],
    specifications: Mapping[str, Limits],
    values: Mapping[str, Floats],
    draws: Mapping[str, Floats],
    count: int,
    seed: int,
    share: float = 1.0,
) -> dict[str, Fraction]:
    """Count what fails; the points are `share` of a sample of which nothing else does."""
    rng = np.random.default_rng(seed + 17)
    size = min(len(rows) for rows in draws.values())
    kept: Floats | float = 1.0
    kept_draws: Floats | float = 1.0
    found = {}
    for name, limits in specifications.items():
        posterior = posteriors[name]
        noises: Floats | float = posterior.noise_sd
        if posterior.noise_draws is not None:
            noises = posterior.noise_draws[:size, None]
        own = probability_outside(values[name], limits, posterior.noise_sd)
        drawn = probability_outside(draws[name][:size], limits, noises)
        kept, kept_draws = kept * (1.0 - own), kept_draws * (1.0 - drawn)
        found[name] = _fraction(share * own.mean(), share * drawn.mean(axis=1), count, rng)
    drawn = share * np.mean(1.0 - np.asarray(kept_draws), axis=1)
    return {**found, ALL: _fraction(share * float(np.mean(1.0 - kept)), drawn, count, rng)}


def _fraction(value: float, draws: Floats, count: int, rng: np.random.Generator) -> Fraction:
    """Add the error of sampling to each draw: Jeffreys' interval of a proportion."""
    hits = np.clip(draws, 0.0, 1.0) * count
    return Fraction(float(value), rng.beta(hits + 0.5, count - hits + 0.5))


def _on_tail(
    posteriors: Mapping[str, Posterior],
    law: JointLaw,
    specifications: Mapping[str, Limits],
    pilot: Cloud,
    size: int,
    seed: int,
) -> dict[str, Fraction]:
    """The same on a large sample: drawn surfaces are asked near the limits alone."""
    reach = {
        name: DOUBT * float(np.hypot(np.quantile(pilot.draw_sd[name], 0.999), posteriors[name].noise_sd))
        for name in specifications
    }
    sequence = qmc.Sobol(len(law), rng=np.random.default_rng(seed + 29))
    parts = []
    for _ in range(0, size, PART):
        points = law.of_uniform(np.clip(sequence.random(min(PART, size)), 2.0**-33, 1.0 - 2.0**-33))
        beyond = [
            excess(posteriors[name].predict(points), s) + reach[name] for name, s in specifications.items()
        ]
        parts.append(points[np.max(beyond, axis=0) > 0.0])
    points = np.vstack(parts)
    rng = np.random.default_rng(seed + 31)
    if len(points) == 0:
        return {name: _fraction(0.0, np.zeros(1000), size, rng) for name in (*specifications, ALL)}
    chosen = points
    if len(points) > TAIL_SAMPLES:
        chosen = points[rng.choice(len(points), TAIL_SAMPLES, replace=False)]
    share = len(points) / size
    values = {name: posteriors[name].predict(points) for name in specifications}
    draws = {name: _in_parts(posteriors[name], chosen) for name in specifications}
    # what was left out for its number is as likely to fail as what was kept
    effective = int(size * len(chosen) / len(points))
    return _on_cloud(posteriors, specifications, values, draws, effective, seed, share)


def _in_parts(posterior: Posterior, points: Floats) -> Floats:
    parts = [posterior.draw(points[start : start + PART]) for start in range(0, len(points), PART)]
    return np.hstack(parts)


def outside_any(values: Mapping[str, Floats], specifications: Mapping[str, Limits]) -> NDArray[np.bool_]:
    """Whether any specification is not kept, shape (n,)."""
    rows: Sequence[Floats] = [excess(values[name], limits) for name, limits in specifications.items()]
    return np.asarray(np.max(rows, axis=0) > 0.0)
