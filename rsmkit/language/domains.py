"""The kinds of factor: which values a factor takes, and every question whose answer depends on that.

One class per kind, listed in :data:`FACTOR_KINDS`. Nobody else compares the words: a factor's
:attr:`~rsmkit.language.space.Factor.domain` is asked instead.

A *coordinate* is a float in natural units, for a category the index of its level. In *coded* units numeric
factors run from -1 to +1 and a category stays its index. Arrays are of shape ``(n,)``, unless said otherwise.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "FACTOR_KINDS",
    "Categorical",
    "Continuous",
    "Discrete",
    "Domain",
    "Floats",
    "Integer",
    "Levels",
    "Value",
    "coded_to_natural",
    "domain_of",
    "natural_to_coded",
    "natural_to_unit",
    "unit_to_natural",
]

Floats = NDArray[np.float64]
Levels = tuple[float, ...] | tuple[str, ...]
Value = float | int | str

MOST_LISTED = 8
"""Texts list as many levels; of more they show the ends."""


def natural_to_coded(natural: Floats, low: Floats | float, high: Floats | float) -> Floats:
    """Put `low` at -1 and `high` at +1, exactly."""
    return 2.0 * ((natural - low) / (high - low)) - 1.0


def coded_to_natural(coded: Floats, low: Floats | float, high: Floats | float) -> Floats:
    """Inverse of :func:`natural_to_coded`, exact at -1 and +1."""
    return 0.5 * (1.0 - coded) * low + 0.5 * (1.0 + coded) * high


def natural_to_unit(natural: Floats, low: Floats | float, high: Floats | float) -> Floats:
    """Put `low` at 0 and `high` at 1, exactly."""
    return (natural - low) / (high - low)


def unit_to_natural(unit: Floats, low: Floats | float, high: Floats | float) -> Floats:
    """Inverse of :func:`natural_to_unit`, exact at 0 and 1."""
    return (1.0 - unit) * low + unit * high


@dataclass(frozen=True)
class Domain(ABC):
    """The values that one factor takes.

    Parameters
    ----------
    low, high : float
        Least and greatest coordinate.
    levels : tuple of float or of str
        The values the user listed, in the order of their coordinates; empty where a range was given.
    """

    low: float
    high: float
    levels: Levels = ()

    word: ClassVar[str]
    """Name of the kind in texts and files."""
    is_numeric: ClassVar[bool] = True
    """Whether order and distance of the values mean something."""
    is_continuous: ClassVar[bool] = False
    """Whether every coordinate between the bounds is allowed."""

    @property
    def wanted(self) -> str:
        """What :meth:`read` takes, in words."""
        return "a number"

    @property
    @abstractmethod
    def text(self) -> str:
        """The values in words."""

    @property
    @abstractmethod
    def level_count(self) -> int:
        """Number of allowed values; 0 where they cannot be counted."""

    @property
    @abstractmethod
    def allowed(self) -> Floats:
        """Every allowed coordinate in order, shape (level_count,)."""

    @property
    def categories(self) -> int:
        """Number of categories; 0 for a numeric factor."""
        return 0

    @property
    def middle(self) -> float:
        """Where the factor is held while others vary: its centre, or its first category."""
        return 0.5 * (self.low + self.high)

    @abstractmethod
    def write(self, x: float) -> Value:
        """Give the simulator's argument for a coordinate."""

    def read(self, value: Value) -> float:
        """Give the coordinate of a simulator's argument or of a table's cell; inverse of :meth:`write`.

        Raises
        ------
        ValueError
            Saying what is wrong with the value.
        """
        if isinstance(value, str):
            try:
                return float(value)
            except ValueError:
                raise ValueError(f"{value!r} is not a number") from None
        return float(value)

    def cell(self, x: float) -> str:
        """Text of a coordinate in a table; :meth:`read` gives back exactly the same float."""
        return repr(float(x) + 0.0)  # + 0.0 turns -0.0 into 0.0

    @abstractmethod
    def snap(self, x: Floats) -> Floats:
        """Nearest allowed coordinates, any shape; the bounds are not enforced."""

    def encode(self, natural: Floats) -> Floats:
        """Natural to coded units, any shape."""
        return natural_to_coded(natural, self.low, self.high)

    def decode(self, coded: Floats) -> Floats:
        """Coded to natural units, any shape."""
        return coded_to_natural(coded, self.low, self.high)

    @abstractmethod
    def from_unit(self, u: Floats) -> Floats:
        """Numbers from 0 to 1 to allowed coordinates; levels get equal shares of the unit interval."""

    @abstractmethod
    def to_unit(self, x: Floats) -> Floats:
        """Coordinates to numbers from 0 to 1; a level goes to the middle of its share."""

    def curve(self, count: int) -> Floats:
        """Coordinates to draw along: `count` evenly spaced ones, or every category."""
        return np.linspace(self.low, self.high, count)

    @abstractmethod
    def nodes(self, count: int) -> Floats:
        """Allowed coordinates of a grid: at most `count` of a range, every one of listed levels."""

    def coded_levels(self, count: int) -> Floats:
        """Levels of a factorial design, coded: `count` of a range, every one of listed levels."""
        return 2.0 * np.arange(count) / (count - 1) - 1.0

    def indicators(self, x: Floats) -> Floats:
        """One column of zeros and ones per category, shape (n, categories)."""
        hits: NDArray[np.bool_] = np.round(x[:, None]) == np.arange(self.categories)
        return hits.astype(float)

    @abstractmethod
    def neighbours(self, index: int) -> tuple[int, ...]:
        """Indices of the levels one step from the level `index`, ascending; of a category all others."""

    @abstractmethod
    def narrowed(self, x: float, half_width: float) -> Self:
        """The part within `half_width`, as a fraction of the range, of `x`; the next levels stay in it."""


@dataclass(frozen=True)
class Continuous(Domain):
    """Every number between the bounds."""

    word = "continuous"
    is_continuous = True

    @property
    def text(self) -> str:
        """The bounds."""
        return f"{self.low:g} to {self.high:g}"

    @property
    def level_count(self) -> int:
        """There are no levels."""
        return 0

    @property
    def allowed(self) -> Floats:
        """There are no levels."""
        return np.empty(0)

    def write(self, x: float) -> Value:
        """Give a float."""
        return float(x)

    def snap(self, x: Floats) -> Floats:
        """Leave everything where it is."""
        return x

    def from_unit(self, u: Floats) -> Floats:
        """Linear, exact at both ends."""
        return unit_to_natural(u, self.low, self.high)

    def to_unit(self, x: Floats) -> Floats:
        """Linear."""
        return natural_to_unit(x, self.low, self.high)

    def nodes(self, count: int) -> Floats:
        """Evenly spaced."""
        return self.curve(count)

    def neighbours(self, index: int) -> tuple[int, ...]:
        """There are no levels."""
        return ()

    def narrowed(self, x: float, half_width: float) -> Self:
        """Within the bounds."""
        reach = half_width * (self.high - self.low)
        return replace(self, low=max(self.low, x - reach), high=min(self.high, x + reach))


@dataclass(frozen=True)
class Stepped(Domain, ABC):
    """What kinds with countable values share: here evenly spaced ones, a whole number apart."""

    @property
    def level_count(self) -> int:
        """Number of allowed values."""
        return round(self.high - self.low) + 1

    @property
    def allowed(self) -> Floats:
        """Every allowed coordinate in order, shape (level_count,)."""
        return np.arange(self.low, self.high + 1.0)

    def snap(self, x: Floats) -> Floats:
        """Nearest whole numbers."""
        return np.round(x)

    def from_unit(self, u: Floats) -> Floats:
        """Equal shares of the unit interval, so that a random number makes every level equally likely."""
        return self._coordinates(np.minimum((u * self.level_count).astype(int), self.level_count - 1))

    def to_unit(self, x: Floats) -> Floats:
        """Middle of the level's share."""
        return (self._indices(x) + 0.5) / self.level_count

    def neighbours(self, index: int) -> tuple[int, ...]:
        """The level before and the level after."""
        return tuple(i for i in (index - 1, index + 1) if 0 <= i < self.level_count)

    def _coordinates(self, index: NDArray[np.int_]) -> Floats:
        return self.low + index.astype(float)

    def _indices(self, x: Floats) -> Floats:
        return x - self.low


@dataclass(frozen=True)
class Integer(Stepped):
    """Every whole number between the bounds."""

    word = "integer"

    @property
    def text(self) -> str:
        """The bounds."""
        return f"{self.low:g} to {self.high:g} in whole numbers"

    def write(self, x: float) -> Value:
        """Give an int."""
        return round(x)

    def nodes(self, count: int) -> Floats:
        """Evenly spaced, then rounded."""
        return np.unique(np.round(self.curve(count)))

    def narrowed(self, x: float, half_width: float) -> Self:
        """At least one number either side."""
        reach = max(1.0, np.floor(half_width * (self.high - self.low)))
        return replace(self, low=max(self.low, x - reach), high=min(self.high, x + reach))


@dataclass(frozen=True)
class Discrete(Stepped):
    """Only the numbers that were listed, ascending.

    Parameters
    ----------
    whole : bool
        The simulator receives them as ints.
    """

    whole: bool = False

    word = "discrete"

    @property
    def text(self) -> str:
        """The levels."""
        return _listed([f"{level:g}" for level in self.allowed])

    @property
    def level_count(self) -> int:
        """Number of levels."""
        return len(self.levels)

    @property
    def allowed(self) -> Floats:
        """The levels."""
        return np.array(self.levels, float)

    def write(self, x: float) -> Value:
        """Give an int or a float."""
        return round(x) if self.whole else float(x)

    def snap(self, x: Floats) -> Floats:
        """Nearest levels, of two equally near the lower."""
        levels = self.allowed
        nearest: NDArray[np.intp] = np.abs(x[..., None] - levels).argmin(axis=-1)
        return levels[nearest]

    def nodes(self, count: int) -> Floats:
        """Every level."""
        return self.allowed

    def coded_levels(self, count: int) -> Floats:
        """Every level."""
        return self.encode(self.allowed)

    def narrowed(self, x: float, half_width: float) -> Self:
        """Levels within reach, and the next one either side."""
        levels = self.allowed
        here = int(np.abs(levels - x).argmin())
        keep = np.abs(levels - x) <= half_width * (self.high - self.low)
        keep[max(0, here - 1) : here + 2] = True
        kept = tuple(levels[keep].tolist())
        return replace(self, low=kept[0], high=kept[-1], levels=kept)

    def _coordinates(self, index: NDArray[np.int_]) -> Floats:
        return self.allowed[index]

    def _indices(self, x: Floats) -> Floats:
        return np.searchsorted(self.allowed, x).astype(float)


@dataclass(frozen=True)
class Categorical(Stepped):
    """Only the texts that were listed, in the user's order; a coordinate is the index of one."""

    word = "categorical"
    is_numeric = False

    @property
    def wanted(self) -> str:
        """One of the categories."""
        return f"one of {', '.join(map(str, self.levels))}"

    @property
    def text(self) -> str:
        """The categories."""
        return _listed([str(level) for level in self.levels])

    @property
    def categories(self) -> int:
        """Number of levels."""
        return len(self.levels)

    @property
    def middle(self) -> float:
        """The first one."""
        return 0.0

    def write(self, x: float) -> Value:
        """Give the text."""
        return self.levels[round(x)]

    def read(self, value: Value) -> float:
        """Give the index of a text."""
        levels: tuple[Value, ...] = self.levels
        if value not in levels:
            raise ValueError(f"{value!r} is not one of its levels {list(levels)}")
        return float(levels.index(value))

    def cell(self, x: float) -> str:
        """Give the text."""
        return str(self.write(x))

    def encode(self, natural: Floats) -> Floats:
        """Leave the index."""
        return natural

    def decode(self, coded: Floats) -> Floats:
        """Leave the index."""
        return coded

    def curve(self, count: int) -> Floats:
        """Every category."""
        return self.allowed

    def nodes(self, count: int) -> Floats:
        """Every category."""
        return self.allowed

    def coded_levels(self, count: int) -> Floats:
        """Every category."""
        return self.allowed

    def neighbours(self, index: int) -> tuple[int, ...]:
        """All others: categories are equally far apart."""
        return tuple(i for i in range(self.categories) if i != index)

    def narrowed(self, x: float, half_width: float) -> Self:
        """All of it: there is no distance between categories."""
        return self


FACTOR_KINDS: dict[str, type[Domain]] = {
    kind.word: kind for kind in (Continuous, Integer, Discrete, Categorical)
}
"""Every kind of factor by its word."""


def domain_of(low: float, high: float, *, integer: bool, levels: Levels) -> Domain:
    """Tell the kind from what the user gave: a range, a range of whole numbers, numbers or texts."""
    if not levels:
        return Integer(low, high) if integer else Continuous(low, high)
    if isinstance(levels[0], str):
        return Categorical(0.0, len(levels) - 1.0, tuple(levels))
    ordered = tuple(sorted(levels))
    return Discrete(float(ordered[0]), float(ordered[-1]), ordered, whole=integer)


def _listed(texts: Sequence[str]) -> str:
    if len(texts) > MOST_LISTED:
        return f"{texts[0]}, {texts[1]}, ..., {texts[-1]} ({len(texts)} levels)"
    return ", ".join(texts)
