"""What the runs leave open of a surface: surfaces drawn from what is known after them.

Coefficients follow a multivariate t distribution about their estimates (a flat prior; Box & Tiao, *Bayesian
Inference in Statistical Analysis*, 1973, section 2.7), functions of a process the process given its runs.

The responses of a deterministic simulator have no noise: what a polynomial misses of them is an error of the
surface, alike at points near each other. Each drawn surface is then off by a wave of that size, whose length
is random and about a quarter of the range of each factor.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ndtr, ndtri

from rsmkit.language.space import Floats, Space
from rsmkit.surfaces.estimation.coordinates import Coordinates

if TYPE_CHECKING:
    from rsmkit.language.terms import Terms
    from rsmkit.surfaces.models.box_cox import BoxCoxSurface
    from rsmkit.surfaces.models.gaussian_process import GaussianProcessSurface
    from rsmkit.surfaces.models.polynomial import PolynomialSurface
    from rsmkit.surfaces.models.surface import Surface

__all__ = [
    "DrawnPolynomials",
    "Misses",
    "Posterior",
    "box_cox_posterior",
    "interval_posterior",
    "polynomial_posterior",
    "process_posterior",
]

ONE_SD = float(2.0 * ndtr(1.0) - 1.0)
"""Probability within one standard deviation of a normal law."""
MISS_LENGTH = 0.25
"""Length of what a polynomial misses, as a part of the range: one of second order can bend once."""
MOST_COSTLY = 120
"""Surfaces drawn of a kind of which each takes as long to ask as the surface itself."""


@dataclass(frozen=True, eq=False)
class DrawnPolynomials:
    """Polynomials drawn, as coefficients.

    Parameters
    ----------
    terms : Terms
    coordinates : Coordinates
        Those of the surface itself.
    coefficients : array, shape (p,)
        Of the surface itself, in these coordinates.
    drawn : array, shape (p, count)
        Of each drawn one.
    drawn_coordinates : tuple of Coordinates
        Of each drawn one, where a stretch is uncertain too; else empty.
    """

    terms: Terms
    coordinates: Coordinates
    coefficients: Floats
    drawn: Floats
    drawn_coordinates: tuple[Coordinates, ...] = ()


@dataclass(frozen=True, eq=False)
class Misses:
    """What each drawn surface misses of a deterministic response: ``sqrt(2) sd cos(frequencies x + phase)``.

    Parameters
    ----------
    sds : array, shape (count,)
    frequencies : array, shape (count, k)
        In natural units; zero for categories.
    phases : array, shape (count,)
    """

    sds: Floats
    frequencies: Floats
    phases: Floats

    def values(self, points: Floats) -> Floats:
        """At points (n, k), shape (count, n)."""
        if not self.sds.any():
            return np.zeros((len(self.sds), len(points)))
        waves = np.cos(self.frequencies @ points.T + self.phases[:, None])
        return np.asarray(np.sqrt(2.0) * self.sds[:, None] * waves)

    def slopes(self, point: Floats) -> Floats:
        """Derivatives at one point (k,), shape (count, k)."""
        steep = -np.sqrt(2.0) * self.sds * np.sin(self.frequencies @ point + self.phases)
        return np.asarray(steep[:, None] * self.frequencies)


def _misses(space: Space, sds: Floats, rng: np.random.Generator) -> Misses:
    lengths = MISS_LENGTH * (space.highs - space.lows)
    frequencies = rng.standard_normal((len(sds), len(space))) / lengths * space.numeric
    return Misses(sds, frequencies, rng.uniform(0.0, 2.0 * np.pi, len(sds)))


@dataclass(frozen=True, eq=False)
class Posterior:
    """Surfaces drawn from what is known of a response.

    Parameters
    ----------
    predict : callable
        The surface itself: points (n, k), natural units, to values (n,).
    draw : callable
        Points to the expected response on each drawn surface, shape (count, n).
    count : int
        Number of drawn surfaces; at most as many as were asked for.
    misses : Misses, optional
        What `draw` adds to `polynomials`.
    noise_sd : float
        Standard deviation of a run that is repeated; 0 for a deterministic simulator.
    noise_draws : array, shape (count,), optional
        The same with each drawn surface, where it is uncertain too.
    polynomials : DrawnPolynomials, optional
        The same surfaces (without `misses`) as coefficients, where they are polynomials.
    known : bool
        Whether the runs tell how wrong the surface may be; not so with as many terms as runs.
    """

    predict: Callable[[Floats], Floats]
    draw: Callable[[Floats], Floats]
    count: int
    misses: Misses | None = None
    noise_sd: float = 0.0
    polynomials: DrawnPolynomials | None = None
    known: bool = True
    noise_draws: Floats | None = None


def polynomial_posterior(
    surface: PolynomialSurface, count: int, rng: np.random.Generator, deterministic: bool
) -> Posterior:
    """Draw the coefficients, and stretch parameters where there are any."""
    known = surface.fit.df > 0
    count = min(count, MOST_COSTLY) if surface.coordinates.stretches else count
    noise = surface.fit.sigma if known and not deterministic else 0.0
    drawn, sigmas, others = surface.drawn(count, rng)
    misses = _misses(surface.space, sigmas if deterministic else np.zeros(count), rng)
    polynomials = DrawnPolynomials(
        surface.terms, surface.coordinates, surface.working_coefficients, drawn, others
    )

    def draw(points: Floats) -> Floats:
        if not others:
            values = surface.terms.evaluate(surface.coordinates.forward(points), drawn).T
        else:
            values = np.stack(
                [surface.terms.evaluate(c.forward(points), drawn[:, i]) for i, c in enumerate(others)]
            )
        return np.asarray(values + misses.values(points))

    noises = None if deterministic else sigmas
    return Posterior(surface.predict, draw, count, misses, noise, polynomials, known, noises)


def box_cox_posterior(
    surface: BoxCoxSurface, count: int, rng: np.random.Generator, deterministic: bool
) -> Posterior:
    """Draw the power and the surface of the transformed response; the noise is that in its middle.

    The power moves a prediction as it does in the intervals of the surface, to first order.
    """
    from rsmkit.surfaces.models.box_cox import power_inverse

    inner = polynomial_posterior(surface.inner, min(count, MOST_COSTLY), rng, deterministic)
    middle = float(np.exp(np.log(surface.y).mean()))
    powers = surface.power_error * np.random.default_rng(rng.integers(2**63)).standard_normal(inner.count)

    def draw(points: Floats) -> Floats:
        moved = np.outer(powers, surface.moved_by_power(points))
        return power_inverse(inner.draw(points) + moved, surface.power)

    noise = inner.noise_sd * middle ** (1.0 - surface.power)
    return replace(
        inner, predict=surface.predict, draw=draw, noise_sd=noise, polynomials=None, noise_draws=None
    )


def process_posterior(
    surface: GaussianProcessSurface, count: int, rng: np.random.Generator, deterministic: bool
) -> Posterior:
    """Draw functions of the process, as far from its mean as left-out runs show it to be.

    Sums of cosines know how functions hang together; mean and deviation at each point are exact.
    """
    count = min(count, MOST_COSTLY)
    paths = surface.drawn_paths(count, rng)

    def draw(points: Floats) -> Floats:
        mean, low, high = surface.predict(points, ONE_SD, "mean")
        values = paths(points)
        away = values - values.mean(axis=0)
        spread = away.std(axis=0)
        scale = np.divide(0.5 * (high - low), spread, out=np.zeros_like(spread), where=spread > 0)
        return np.asarray(mean + scale * away)

    noise = surface.calibration * surface.noise_sd
    return Posterior(surface.predict, draw, count, noise_sd=0.0 if deterministic else noise)


def interval_posterior(
    surface: Surface, count: int, rng: np.random.Generator, deterministic: bool
) -> Posterior:
    """Of a kind that draws nothing itself: its whole surface is as far off as its interval tells, or not."""
    numbers = rng.standard_normal(count)
    width = float(ndtri(0.975))

    def half(points: Floats, kind: str) -> Floats:
        _, low, high = surface.predict(points, 0.95, kind)  # type: ignore[call-overload]
        return np.asarray(np.where(np.isfinite(high - low), (high - low) / (2.0 * width), 0.0))

    def draw(points: Floats) -> Floats:
        sd = half(points, "prediction" if deterministic else "mean")
        return np.asarray(surface.predict(points) + numbers[:, None] * sd)

    def noise() -> float:
        space = surface.space
        middle = space.clip([[f.domain.middle for f in space]])
        both = half(middle, "prediction") ** 2 - half(middle, "mean") ** 2
        return float(np.sqrt(max(both[0], 0.0)))

    return Posterior(surface.predict, draw, count, noise_sd=0.0 if deterministic else noise())
