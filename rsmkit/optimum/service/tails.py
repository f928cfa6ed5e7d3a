"""Quantiles and tails of responses from their values at points of the laws, smooth in the design.

Where enough of the points lie in a tail they are counted, by a kernel narrower than their scatter, and
quantiles are weighted averages of ordered values (Harrell and Davis, *Biometrika* 69 (1982) 635). Further out
than the points reach, the tail is that of Pearson's law of type III with the same mean, deviation and
skewness; in between one gives way to the other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Protocol

import numpy as np
from scipy.special import betainc, gammainc, gammaincc, gammaincinv, ndtr, ndtri, owens_t

from rsmkit.language.space import Floats

__all__ = ["Limits", "Served", "outside", "outside_any", "served"]

STRAIGHT = 1e-4
"""Skewness below which a law is normal."""
FEW, ENOUGH = 10.0, 40.0
"""Points in a tail up to which its law is trusted, and from which the points are."""
KERNEL = 0.3
"""Width of the kernel, in standard deviations, for one point in the tail; for more, over their root."""
FAR = 37.0
"""Standard deviations beyond which a normal law holds nothing."""


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


@dataclass(frozen=True, eq=False)
class Served:
    """One response at each design, from its values at points of the laws.

    Parameters
    ----------
    values : array, shape (n, nodes)
    mean, sd, skewness : array, shape (n,)
        The noise of a run included.
    noise_sd : float
        Standard deviation of a repeated run, normal, where `values` are without it.
    """

    values: Floats
    mean: Floats
    sd: Floats
    skewness: Floats
    noise_sd: float = 0.0

    def quantile(self, p: float) -> Floats:
        """Value below which the response is with probability `p`, shape (n,)."""
        nodes = self.values.shape[1]
        trust = float(_trust(np.array(nodes * min(p, 1.0 - p))))
        found = np.zeros(len(self.mean))
        if trust < 1.0:
            found = (1.0 - trust) * (self.mean + self.sd * _quantile(p, self.skewness))
        if trust > 0.0:
            found = found + trust * (self._ordered @ _order_weights(nodes, p))
        return found

    def beyond(self, limit: float, sign: float) -> Floats:
        """Probability of being above a limit (`sign` 1) or below it (-1), shape (n,)."""
        law = self.by_law(limit, sign)
        trust = self.trust(law)
        if not trust.any():
            return law
        return np.asarray((1.0 - trust) * law + trust * self.nodes_beyond(limit, sign).mean(axis=1))

    def by_law(self, limit: float, sign: float) -> Floats:
        """The same by the law of its first three moments, shape (n,)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            z = np.nan_to_num(sign * (limit - self.mean) / self.sd, nan=0.0, posinf=1e6, neginf=-1e6)
        return _above(z, sign * self.skewness)

    def trust(self, chances: Floats) -> Floats:
        """How far points are trusted with a tail of given probability, shape (n,): 0 to 1."""
        return _trust(self.values.shape[1] * chances)

    def nodes_beyond(self, limit: float, sign: float) -> Floats:
        """Whether each point lies beyond a limit, blurred by the kernel, shape (n, nodes)."""
        number = np.maximum(self.values.shape[1] * self.by_law(limit, sign), FEW)
        with np.errstate(divide="ignore", invalid="ignore"):
            width = np.hypot(KERNEL * self.sd / np.sqrt(number), self.noise_sd)
            away = np.nan_to_num(sign * (self.values - limit) / width[:, None], posinf=FAR, neginf=-FAR)
        return np.asarray(ndtr(away))

    @cached_property
    def _ordered(self) -> Floats:
        """The values in order, the noise of a run spread evenly over them, shape (n, nodes)."""
        values, nodes = self.values, self.values.shape[1]
        if self.noise_sd:
            order = np.random.default_rng(nodes).permutation(nodes)
            values = values + self.noise_sd * ndtri((order + 0.5) / nodes)
        return np.sort(values, axis=1)


def served(values: Floats, noise_sd: float = 0.0) -> Served:
    """Summarise values at points of the laws, shape (n, nodes)."""
    mean, own = values.mean(axis=1), values.std(axis=1)
    sd = np.hypot(own, noise_sd)
    third = np.mean((values - mean[:, None]) ** 3, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        skewness = np.where(sd > 0, third / sd**3, 0.0)
    return Served(values, mean, sd, skewness, noise_sd)


def outside(own: Served, limits: Limits) -> Floats:
    """Probability that a response is outside its specification, shape (n,); nan where a run failed."""
    found = np.sum([own.beyond(limit, sign) for limit, sign in _sides(limits)], axis=0)
    return np.where(np.isfinite(own.mean), np.minimum(found, 1.0), np.nan)


def outside_any(responses: Mapping[str, Served], specifications: Mapping[str, Limits]) -> Floats:
    """Probability that any specification is not kept, shape (n,); nan where a run failed.

    Where the points may not be trusted, of normal responses with the correlations that the points have: the
    probabilities of all events less, of each event, the largest that it shares with an earlier one. That is
    exact of two and never too small (Kounias, *Annals of Mathematical Statistics* 39 (1968) 2154).
    """
    events = [
        (responses[name], limit, sign)
        for name, limits in specifications.items()
        for limit, sign in _sides(limits)
    ]
    chances = np.array([own.by_law(limit, sign) for own, limit, sign in events])
    joint = chances[0].copy()
    for i in range(1, len(events)):
        shared = [_both(chances[i], chances[j], _correlation(events[i], events[j])) for j in range(i)]
        joint += chances[i] - np.max(shared, axis=0)
    trust = np.max([own.trust(p) for (own, _, _), p in zip(events, chances, strict=True)], axis=0)
    if trust.any():
        blurred = np.max([own.nodes_beyond(limit, sign) for own, limit, sign in events], axis=0)
        joint = (1.0 - trust) * joint + trust * blurred.mean(axis=1)
    known = np.isfinite(np.sum([own.mean for own in responses.values()], axis=0))
    return np.where(known, np.clip(joint, 0.0, 1.0), np.nan)


Event = tuple[Served, float, float]
"""A response beyond a limit: above it (1) or below it (-1)."""


def _sides(limits: Limits) -> Sequence[tuple[float, float]]:
    both = ((limits.high, 1.0), (limits.low, -1.0))
    return [(limit, sign) for limit, sign in both if limit is not None]


def _correlation(one: Event, other: Event) -> Floats:
    """Of two responses in the directions of their limits, shape (n,)."""
    (first, _, up), (second, _, down) = one, other
    shared = np.mean((first.values - first.mean[:, None]) * (second.values - second.mean[:, None]), axis=1)
    if first is second:
        shared = first.sd**2
    with np.errstate(divide="ignore", invalid="ignore"):
        found = np.nan_to_num(up * down * shared / (first.sd * second.sd))
    return np.asarray(np.clip(found, -1.0 + 1e-12, 1.0 - 1e-12))


def _both(first: Floats, second: Floats, correlation: Floats) -> Floats:
    """Probability of two tails of a bivariate normal law together (Owen 1956), shape (n,)."""
    h, k = (np.clip(-ndtri(p), -FAR, FAR) for p in (first, second))
    h, k = (np.where(x == 0.0, 1e-12, x) for x in (h, k))
    root = np.sqrt((1.0 - correlation) * (1.0 + correlation))
    parts = owens_t(h, (k - correlation * h) / (h * root)) + owens_t(k, (h - correlation * k) / (k * root))
    found = 0.5 * (first + second) - parts - np.where(h * k < 0.0, 0.5, 0.0)
    return np.asarray(np.clip(found, 0.0, np.minimum(first, second)))


@cache
def _order_weights(nodes: int, p: float) -> Floats:
    """What each ordered value counts for in the quantile of Harrell and Davis, shape (nodes,)."""
    ends = betainc((nodes + 1) * p, (nodes + 1) * (1.0 - p), np.arange(nodes + 1) / nodes)
    return np.asarray(np.diff(ends))


def _trust(number: Floats) -> Floats:
    """How far points are trusted of which so many lie in a tail: 0 to 1, smooth."""
    x = np.clip((np.nan_to_num(number) - FEW) / (ENOUGH - FEW), 0.0, 1.0)
    return np.asarray(x * x * (3.0 - 2.0 * x))


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
