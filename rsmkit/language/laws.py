"""Laws of what varies in service: normal, uniform, triangular, lognormal, truncated, a sample, levels.

A law answers three questions: which value belongs to a probability, what its mean and standard deviation are,
and at which nodes, with which weights, the mean of a smooth function is a sum (exact to rounding for
polynomials up to the degree that surfaces have).
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import ClassVar

import numpy as np
from scipy.special import log_ndtr, ndtr, ndtri, ndtri_exp

from rsmkit.errors import RsmkitError
from rsmkit.language.domains import Domain, Floats

__all__ = ["Law", "Levels", "Lognormal", "Normal", "Sample", "Triangular", "Truncated", "Uniform"]

NODES = 32
"""Of a Gauss rule on one smooth piece: exact up to degree 63."""
HERMITE = 24
"""Of a Gauss rule over a normal law: exact up to degree 47, and no node beyond nine standard deviations."""
REACH = 9.0
"""Standard deviations beyond which a normal law holds less than 1e-18."""
HIGHEST_MOMENT = 12
"""Powers of a lognormal value whose mean is exact to rounding."""

Rule = tuple[Floats, Floats]


class Law(ABC):
    """A distribution of one number, natural units."""

    @property
    @abstractmethod
    def mean(self) -> float:
        """Its mean."""

    @property
    @abstractmethod
    def sd(self) -> float:
        """Its standard deviation."""

    @property
    @abstractmethod
    def text(self) -> str:
        """The law in words."""

    @abstractmethod
    def quantile(self, probability: Floats) -> Floats:
        """Value below which the law has that probability, shape (n,) in and out."""

    @abstractmethod
    def rule(self, breaks: Sequence[float] = ()) -> Rule:
        """Nodes in natural units and weights that sum to 1, each shape (m,).

        Parameters
        ----------
        breaks : sequence of float
            Where the function to be averaged is not smooth.
        """

    def of_normal(self, z: Floats) -> Floats:
        """Value at the probability of a standard normal number, shape (n,) in and out."""
        return self.quantile(np.asarray(ndtr(z)))

    def outside(self, low: float, high: float) -> float:
        """Probability of the two tails beyond `low` and `high`, by bisection on the quantiles."""
        grid = np.linspace(0.0005, 0.9995, 1999)
        values = self.quantile(grid)
        return float(np.mean((values < low) | (values > high)))


@dataclass(frozen=True)
class _OfNormal(Law):
    """Given by its own mean and standard deviation, its values being those of a normal number."""

    at: float
    spread: float
    word: ClassVar[str]

    def __post_init__(self) -> None:
        _positive("the standard deviation", self.spread)

    @property
    def mean(self) -> float:
        """See :class:`Law`."""
        return self.at

    @property
    def sd(self) -> float:
        """See :class:`Law`."""
        return self.spread

    @property
    def text(self) -> str:
        """See :class:`Law`."""
        return f"{self.word}, mean {self.at:g}, sd {self.spread:g}"

    def quantile(self, probability: Floats) -> Floats:
        """See :class:`Law`."""
        return self.of_normal(np.asarray(ndtri(probability)))


@dataclass(frozen=True)
class Normal(_OfNormal):
    """Normal with a mean and a standard deviation."""

    word: ClassVar[str] = "normal"

    def of_normal(self, z: Floats) -> Floats:
        """See :class:`Law`."""
        return self.at + self.spread * z

    def rule(self, breaks: Sequence[float] = ()) -> Rule:
        """Gauss and Hermite; with breaks Gauss and Legendre between them."""
        low, high = self.at - REACH * self.spread, self.at + REACH * self.spread
        if any(low < place < high for place in breaks):
            return Truncated(self.at, self.spread, low, high).rule(breaks)
        x, weight = _hermite()
        return self.at + self.spread * x, weight


@dataclass(frozen=True)
class Uniform(Law):
    """Every value between two limits alike."""

    low: float
    high: float

    def __post_init__(self) -> None:
        _ascending(self.low, self.high)

    @property
    def mean(self) -> float:
        """See :class:`Law`."""
        return 0.5 * (self.low + self.high)

    @property
    def sd(self) -> float:
        """See :class:`Law`."""
        return (self.high - self.low) / math.sqrt(12.0)

    @property
    def text(self) -> str:
        """See :class:`Law`."""
        return f"uniform, {self.low:g} to {self.high:g}"

    def quantile(self, probability: Floats) -> Floats:
        """See :class:`Law`."""
        return self.low + probability * (self.high - self.low)

    def rule(self, breaks: Sequence[float] = ()) -> Rule:
        """Gauss and Legendre."""
        return _gauss(np.ones_like, [self.low, self.high], breaks)


@dataclass(frozen=True)
class Triangular(Law):
    """Likeliest at a mode, impossible beyond two limits, linear between."""

    low: float
    mode: float
    high: float

    def __post_init__(self) -> None:
        _ascending(self.low, self.high)
        if not self.low <= self.mode <= self.high:
            raise RsmkitError(f"the mode ({self.mode:g}) must lie between {self.low:g} and {self.high:g}")

    @property
    def mean(self) -> float:
        """See :class:`Law`."""
        return (self.low + self.mode + self.high) / 3.0

    @property
    def sd(self) -> float:
        """See :class:`Law`."""
        a, m, b = self.low - self.mean, self.mode - self.mean, self.high - self.mean
        return math.sqrt((a * a + m * m + b * b - a * m - a * b - m * b) / 18.0)

    @property
    def text(self) -> str:
        """See :class:`Law`."""
        return f"triangular, {self.low:g} to {self.high:g}, mode {self.mode:g}"

    def quantile(self, probability: Floats) -> Floats:
        """See :class:`Law`."""
        width, rise = self.high - self.low, self.mode - self.low
        left = self.low + np.sqrt(probability * width * rise)
        right = self.high - np.sqrt((1.0 - probability) * width * (self.high - self.mode))
        return np.asarray(np.where(probability * width < rise, left, right))

    def rule(self, breaks: Sequence[float] = ()) -> Rule:
        """Gauss and Legendre on both sides of the mode."""
        peak = self.mode

        def density(x: Floats) -> Floats:
            with np.errstate(divide="ignore", invalid="ignore"):
                left, right = (x - self.low) / (peak - self.low), (self.high - x) / (self.high - peak)
            return np.where(x < peak, left, right)

        return _gauss(density, [self.low, peak, self.high], breaks)


@dataclass(frozen=True)
class Lognormal(_OfNormal):
    """Positive, its logarithm normal; given by its own mean and standard deviation."""

    word: ClassVar[str] = "lognormal"

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.at > 0:
            raise RsmkitError(f"a lognormal law needs a positive mean, got {self.at:g}")

    @property
    def log_sd(self) -> float:
        """Standard deviation of the logarithm."""
        return math.sqrt(math.log1p((self.spread / self.at) ** 2))

    def of_normal(self, z: Floats) -> Floats:
        """See :class:`Law`."""
        return np.asarray(self.at * np.exp(self.log_sd * (z - 0.5 * self.log_sd)))

    def rule(self, breaks: Sequence[float] = ()) -> Rule:
        """Sum over even steps of the logarithm, which converges faster than any power for a normal law."""
        reach = REACH + HIGHEST_MOMENT * self.log_sd
        z = np.linspace(-reach, reach, 2 * math.ceil(8 * reach) + 1)
        weight = np.exp(-0.5 * z * z)
        return self.of_normal(z), weight / weight.sum()


@dataclass(frozen=True)
class Truncated(Law):
    """A normal law of which only what lies between two limits occurs (parts that pass an inspection)."""

    at: float
    spread: float
    low: float
    high: float

    def __post_init__(self) -> None:
        _positive("the standard deviation", self.spread)
        _ascending(self.low, self.high)
        nearest = min(abs(end - self.at) for end in (self.low, self.high)) / self.spread
        if not self.low <= self.at <= self.high and nearest > 30.0:
            raise RsmkitError(
                f"the limits {self.low:g} to {self.high:g} lie {nearest:.3g} standard deviations from the "
                f"mean {self.at:g}: nothing is left"
            )

    @cached_property
    def _moments(self) -> tuple[float, float]:
        x, weight = self.rule()
        mean = float(weight @ x)
        return mean, math.sqrt(float(weight @ (x - mean) ** 2))

    @property
    def mean(self) -> float:
        """See :class:`Law`."""
        return self._moments[0]

    @property
    def sd(self) -> float:
        """See :class:`Law`."""
        return self._moments[1]

    @property
    def text(self) -> str:
        """See :class:`Law`."""
        return f"normal, mean {self.at:g}, sd {self.spread:g}, cut at {self.low:g} and {self.high:g}"

    def quantile(self, probability: Floats) -> Floats:
        """See :class:`Law`."""
        a, b = (self.low - self.at) / self.spread, (self.high - self.at) / self.spread
        flip = a > -b  # the tail in which logarithms keep their digits
        if flip:
            a, b, probability = -b, -a, 1.0 - np.asarray(probability)
        low, high = log_ndtr(a), log_ndtr(b)
        with np.errstate(divide="ignore"):
            logs = np.logaddexp(low + np.log1p(-probability), high + np.log(probability))
        z = np.clip(ndtri_exp(np.minimum(logs, -1e-300)), a, b)
        return np.clip(self.at + self.spread * np.asarray(-z if flip else z), self.low, self.high)

    def rule(self, breaks: Sequence[float] = ()) -> Rule:
        """Gauss and Legendre on pieces of at most one standard deviation."""
        middle = min(max(self.at, self.low), self.high)
        low, high = max(self.low, middle - REACH * self.spread), min(self.high, middle + REACH * self.spread)
        pieces = max(1, math.ceil((high - low) / self.spread))
        offset = (middle - self.at) / self.spread

        def density(x: Floats) -> Floats:
            z = (x - self.at) / self.spread
            return np.asarray(np.exp(-0.5 * (z - offset) * (z + offset)))

        return _gauss(density, np.linspace(low, high, pieces + 1).tolist(), breaks)


@dataclass(frozen=True, eq=False)
class Sample(Law):
    """Measured values, each as likely as the others."""

    values: Floats

    def __post_init__(self) -> None:
        values = np.sort(np.asarray(self.values, float))
        if values.ndim != 1 or len(values) < 2:
            raise RsmkitError(f"a sample needs a list of at least two numbers, got shape {values.shape}")
        if not np.isfinite(values).all():
            raise RsmkitError("a sample needs finite numbers, and not all are")
        if values[0] == values[-1]:
            raise RsmkitError(f"a sample needs values that differ, all are {values[0]:g}")
        object.__setattr__(self, "values", values)

    @property
    def mean(self) -> float:
        """See :class:`Law`."""
        return float(self.values.mean())

    @property
    def sd(self) -> float:
        """See :class:`Law`."""
        return float(self.values.std())

    @property
    def text(self) -> str:
        """See :class:`Law`."""
        return f"a sample of {len(self.values)}, mean {self.mean:g}, sd {self.sd:g}"

    def quantile(self, probability: Floats) -> Floats:
        """See :class:`Law`."""
        index = (np.asarray(probability) * len(self.values)).astype(int)
        return np.asarray(self.values[np.clip(index, 0, len(self.values) - 1)])

    def rule(self, breaks: Sequence[float] = ()) -> Rule:
        """The values themselves."""
        return self.values, np.full(len(self.values), 1.0 / len(self.values))


@dataclass(frozen=True)
class Levels(Law):
    """Every level of an integer, discrete or categorical factor alike."""

    domain: Domain

    @property
    def mean(self) -> float:
        """See :class:`Law`; of a category it means nothing."""
        return float(self.domain.allowed.mean())

    @property
    def sd(self) -> float:
        """See :class:`Law`; of a category it means nothing."""
        return float(self.domain.allowed.std())

    @property
    def text(self) -> str:
        """See :class:`Law`."""
        return f"each level alike, {self.domain.text}"

    def quantile(self, probability: Floats) -> Floats:
        """See :class:`Law`."""
        return self.domain.from_unit(np.asarray(probability, float))

    def rule(self, breaks: Sequence[float] = ()) -> Rule:
        """The levels."""
        levels = self.domain.allowed
        return levels, np.full(len(levels), 1.0 / len(levels))


@cache
def _hermite() -> Rule:
    x, weight = np.polynomial.hermite_e.hermegauss(HERMITE)
    return x, weight / weight.sum()


@cache
def _legendre() -> Rule:
    x, weight = np.polynomial.legendre.leggauss(NODES)
    return np.asarray(x), np.asarray(weight)


def _gauss(density: Callable[[Floats], Floats], ends: Sequence[float], breaks: Sequence[float]) -> Rule:
    """Gauss and Legendre between ends and breaks, weighted by a density that need not be scaled."""
    inside = [place for place in breaks if min(ends) < place < max(ends)]
    cuts = np.unique([*ends, *inside])
    x, weight = _legendre()
    halves, centres = 0.5 * np.diff(cuts), 0.5 * (cuts[1:] + cuts[:-1])
    nodes = (centres[:, None] + halves[:, None] * x).ravel()
    weights = (halves[:, None] * weight).ravel() * density(nodes)
    return nodes, weights / weights.sum()


def _positive(what: str, value: float) -> None:
    if not (value > 0 and math.isfinite(value)):
        raise RsmkitError(f"{what} must be positive, got {value:g}")


def _ascending(low: float, high: float) -> None:
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise RsmkitError(f"low ({low:g}) must be less than high ({high:g})")
