"""Factors and the design space they span; natural and coded units.

Points are float arrays of shape ``(n, k)``, one column per factor, in *natural* units. A categorical
factor's column holds the index of its level. *Coded* units put ``low`` at -1 and ``high`` at +1 for every
numeric factor (the convention of every response-surface text); a categorical column stays a level index.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rsmkit.errors import RsmkitError

__all__ = ["Factor", "Floats", "Space", "Value"]

Floats = NDArray[np.float64]
Value = float | int | str
Kind = Literal["continuous", "integer", "discrete", "categorical"]


@dataclass(frozen=True)
class Factor:
    """One input of the simulator that the study varies.

    Parameters
    ----------
    name : str
        Keyword the simulator receives; carries its unit (``nose_radius_m``).
    low, high : float
        Bounds in natural units; coded -1 and +1. Set from ``levels`` when those are given.
    label, unit : str
        Wording for tables and plots.
    integer : bool
        Only whole numbers between the bounds.
    levels : tuple of float or of str
        The only values allowed: numbers make a discrete factor, texts a categorical one.
    """

    name: str
    low: float = math.nan
    high: float = math.nan
    label: str = ""
    unit: str = ""
    integer: bool = False
    levels: tuple[float, ...] | tuple[str, ...] = ()

    def __post_init__(self) -> None:
        problem = self._problem()
        if problem:
            raise RsmkitError(f"factor {self.name}: {problem}")
        if self.levels:
            numeric = self.kind == "discrete"
            object.__setattr__(self, "levels", tuple(sorted(self.levels)) if numeric else tuple(self.levels))
            object.__setattr__(self, "low", float(self.levels[0]) if numeric else 0.0)
            object.__setattr__(self, "high", float(self.levels[-1]) if numeric else len(self.levels) - 1.0)

    def _problem(self) -> str:
        if not self.name.strip():
            return "a name must not be empty"
        if self.levels:
            if len(set(self.levels)) != len(self.levels) or len(self.levels) < 2:
                return f"levels must be at least two different values, got {list(self.levels)}"
            if len({isinstance(level, str) for level in self.levels}) != 1:
                return "levels must be all numbers or all texts"
            return ""
        if not (math.isfinite(self.low) and math.isfinite(self.high)):
            return "give low and high (finite numbers), or levels"
        if not self.low < self.high:
            return f"low ({self.low:g}) must be less than high ({self.high:g})"
        if self.integer and not (float(self.low).is_integer() and float(self.high).is_integer()):
            return "an integer factor needs whole numbers for low and high"
        return ""

    @property
    def kind(self) -> Kind:
        """What values the factor takes."""
        if self.levels:
            return "categorical" if isinstance(self.levels[0], str) else "discrete"
        return "integer" if self.integer else "continuous"

    @property
    def center(self) -> float:
        """Natural value at coded 0."""
        return 0.5 * (self.low + self.high)

    @property
    def half_range(self) -> float:
        """Natural length of one coded unit."""
        return 0.5 * (self.high - self.low)

    @property
    def title(self) -> str:
        """Label with unit, for axes and table heads."""
        text = self.label or self.name
        return f"{text} [{self.unit}]" if self.unit else text

    def value(self, x: float) -> Value:
        """Give the simulator's argument for the natural coordinate `x` (a level's text, an int, a float)."""
        if self.kind == "categorical":
            return self.levels[round(x)]
        return round(x) if self.integer else float(x)

    def coordinate(self, value: Value) -> float:
        """Give the natural coordinate of a simulator argument; inverse of :meth:`value`."""
        if self.kind == "categorical":
            levels: tuple[Value, ...] = self.levels
            if value not in levels:
                raise RsmkitError(f"factor {self.name}: {value!r} is not one of its levels {list(levels)}")
            return float(levels.index(value))
        if isinstance(value, str):
            try:
                return float(value)
            except ValueError:
                raise RsmkitError(f"factor {self.name}: {value!r} is not a number") from None
        return float(value)


class Space:
    """The box of all factors, in a fixed order.

    Parameters
    ----------
    factors : iterable of Factor
        Factors in order.
    **ranges
        Short form: ``name=(low, high)`` for a continuous factor, ``name=[level, ...]`` for given levels.

    Examples
    --------
    >>> space = Space(theta_deg=(5, 10), radius_m=(0.1, 0.3))
    >>> space.encode([[7.5, 0.3]])
    array([[0., 1.]])
    """

    def __init__(
        self,
        factors: Iterable[Factor] = (),
        /,
        **ranges: tuple[float, float] | list[float] | list[str],
    ) -> None:
        made = [
            Factor(name, float(spec[0]), float(spec[1]))
            if isinstance(spec, tuple)
            else Factor(name, levels=tuple(spec))  # type: ignore[arg-type]
            for name, spec in ranges.items()
        ]
        self.factors: tuple[Factor, ...] = (*factors, *made)
        if not self.factors:
            raise RsmkitError("a design space needs at least one factor")
        if len(set(self.names)) != len(self.factors):
            raise RsmkitError(f"factor names must differ, got {list(self.names)}")

    def __len__(self) -> int:
        return len(self.factors)

    def __iter__(self) -> Iterator[Factor]:
        return iter(self.factors)

    def __getitem__(self, name: str) -> Factor:
        return self.factors[self.names.index(name)]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Space) and self.factors == other.factors

    def __hash__(self) -> int:
        return hash(self.factors)

    def __repr__(self) -> str:
        inside = ", ".join(
            f"{f.name}={list(f.levels)}" if f.levels else f"{f.name}=({f.low:g}, {f.high:g})" for f in self
        )
        return f"Space({inside})"

    @property
    def names(self) -> tuple[str, ...]:
        """Factor names in order."""
        return tuple(f.name for f in self.factors)

    @property
    def lows(self) -> Floats:
        """Lower bounds, natural units, shape (k,)."""
        return np.array([f.low for f in self.factors])

    @property
    def highs(self) -> Floats:
        """Upper bounds, natural units, shape (k,)."""
        return np.array([f.high for f in self.factors])

    @property
    def numeric(self) -> NDArray[np.bool_]:
        """Which factors are numbers rather than categories, shape (k,)."""
        return np.array([f.kind != "categorical" for f in self.factors])

    def encode(self, natural: ArrayLike) -> Floats:
        """Natural to coded units; shape ``(..., k)`` in and out; exact at the bounds."""
        x: Floats = np.asarray(natural, float)
        coded = 2.0 * ((x - self.lows) / (self.highs - self.lows)) - 1.0
        return np.asarray(np.where(self.numeric, coded, x))

    def decode(self, coded: ArrayLike) -> Floats:
        """Coded to natural units; shape ``(..., k)`` in and out; exact at coded -1 and +1."""
        c = np.asarray(coded, float)
        blend = 0.5 * (1.0 - c) * self.lows + 0.5 * (1.0 + c) * self.highs
        return np.asarray(np.where(self.numeric, blend, c))

    def snap(self, natural: ArrayLike) -> Floats:
        """Move each coordinate to the nearest value its factor can take (bounds are not enforced)."""
        x = np.array(natural, float)
        for j, factor in enumerate(self.factors):
            if factor.kind == "discrete":
                levels = np.array(factor.levels, float)
                x[..., j] = levels[np.abs(x[..., j, None] - levels).argmin(axis=-1)]
            elif factor.kind != "continuous":
                x[..., j] = np.round(x[..., j])
        return x

    def clip(self, natural: ArrayLike) -> Floats:
        """Move points outside the bounds onto them."""
        return np.asarray(np.clip(np.asarray(natural, float), self.lows, self.highs))

    def contains(self, natural: ArrayLike, tolerance: float = 1e-9) -> NDArray[np.bool_]:
        """Whether each point lies in the box, within `tolerance` of the range; shape ``(...)``."""
        slack = tolerance * (self.highs - self.lows)
        x = np.asarray(natural, float)
        return np.asarray(np.all((x >= self.lows - slack) & (x <= self.highs + slack), axis=-1))

    def values(self, point: ArrayLike) -> dict[str, Value]:
        """One point, shape (k,), as the keyword arguments the simulator receives."""
        coordinates = np.asarray(point, float)
        return {f.name: f.value(float(x)) for f, x in zip(self.factors, coordinates, strict=True)}

    def point(self, values: Mapping[str, Value]) -> Floats:
        """Keyword arguments back to a point, shape (k,); missing and unknown names are refused."""
        self._check_names(values)
        return np.array([f.coordinate(values[f.name]) for f in self.factors])

    def points(self, rows: Sequence[Mapping[str, Value]]) -> Floats:
        """Stack many rows of keyword arguments into shape ``(n, k)``."""
        return np.array([self.point(row) for row in rows]).reshape(len(rows), len(self))

    def _check_names(self, values: Mapping[str, Value]) -> None:
        missing = [name for name in self.names if name not in values]
        unknown = [name for name in values if name not in self.names]
        if missing or unknown:
            parts = [f"missing {', '.join(missing)}"] if missing else []
            parts += [f"unknown {', '.join(unknown)}"] if unknown else []
            raise RsmkitError(f"factors: {'; '.join(parts)} (the factors are {', '.join(self.names)})")
