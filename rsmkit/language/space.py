"""Factors and the design space they span; natural and coded units.

Points are float arrays of shape ``(n, k)``, one column per factor, in *natural* units. A categorical
factor's column holds the index of its level. *Coded* units put ``low`` at -1 and ``high`` at +1 for every
numeric factor (the convention of every response-surface text); a categorical column stays a level index.
"""

from __future__ import annotations

import html
import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rsmkit.errors import RsmkitError, one_of
from rsmkit.language.conditions import parse_equality
from rsmkit.language.domains import (
    Domain,
    Floats,
    Levels,
    Value,
    coded_to_natural,
    domain_of,
    natural_to_coded,
    unit_to_natural,
)
from rsmkit.language.equalities import AffineSet, Equality, Mixture, check_limits

__all__ = ["Factor", "Floats", "Space", "Value", "place_of"]


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
    levels: Levels = ()

    def __post_init__(self) -> None:
        problem = self._problem()
        if problem:
            raise RsmkitError(f"factor {self.name}: {problem}")
        for key in ("low", "high", "levels"):
            object.__setattr__(self, key, getattr(self.domain, key))

    def _problem(self) -> str:
        if not self.name.strip():
            return "a name must not be empty"
        if self.levels:
            return self._problem_of_levels()
        if not (_is_finite(self.low) and _is_finite(self.high)):
            return "give low and high (finite numbers), or levels"
        if not self.low < self.high:
            return f"low ({self.low:g}) must be less than high ({self.high:g})"
        if self.integer and not (float(self.low).is_integer() and float(self.high).is_integer()):
            return "an integer factor needs whole numbers for low and high"
        return ""

    def _problem_of_levels(self) -> str:
        given: Any = self.levels
        if isinstance(given, str):
            return f"levels must be a list of texts or numbers, got the text {given!r}"
        texts = [isinstance(level, str) for level in self.levels]
        if any(texts) != all(texts):
            return "levels must be all numbers or all texts"
        if not (all(texts) or all(map(_is_finite, self.levels))):
            return f"levels must be finite numbers or texts, got {list(self.levels)}"
        if len(set(self.levels)) != len(self.levels) or len(self.levels) < 2:
            return f"levels must be at least two different values, got {list(self.levels)}"
        if self.integer and not all(texts) and any(float(level) % 1 for level in self.levels):
            return f"an integer factor needs whole numbers for levels, got {list(self.levels)}"
        return ""

    def __repr__(self) -> str:
        bounds = [] if self.levels else [repr(self.low), repr(self.high)]
        rest = {"label": self.label, "unit": self.unit, "integer": self.integer, "levels": self.levels}
        given = [f"{key}={value!r}" for key, value in rest.items() if value]
        return f"Factor({', '.join([repr(self.name), *bounds, *given])})"

    def _repr_html_(self) -> str:
        return Space((self,))._repr_html_()

    @cached_property
    def domain(self) -> Domain:
        """The values it takes, and everything that depends on their kind."""
        return domain_of(self.low, self.high, integer=self.integer, levels=self.levels)

    @property
    def kind(self) -> str:
        """What values it takes, in a word: a key of :data:`rsmkit.language.domains.FACTOR_KINDS`."""
        return self.domain.word

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
        return self.domain.write(x)

    def coordinate(self, value: Value) -> float:
        """Give the natural coordinate of a simulator argument; inverse of :meth:`value`."""
        try:
            return self.domain.read(value)
        except ValueError as error:
            raise RsmkitError(f"factor {self.name}: {error}") from None

    def narrowed(self, x: float, half_width: float) -> Factor:
        """The factor within `half_width`, as a fraction of its range, of the coordinate `x`."""
        part = self.domain.narrowed(x, half_width)
        return replace(self, low=part.low, high=part.high, levels=part.levels)


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
        made = [_short_form(name, spec) for name, spec in ranges.items()]
        self.factors: tuple[Factor, ...] = (*factors, *made)
        if not self.factors:
            raise RsmkitError("a design space needs at least one factor")
        if len(set(self.names)) != len(self.factors):
            raise RsmkitError(f"factor names must differ, got {list(self.names)}")
        self.limits: tuple[Mixture | Equality, ...] = ()

    def __len__(self) -> int:
        return len(self.factors)

    def __iter__(self) -> Iterator[Factor]:
        return iter(self.factors)

    def __getitem__(self, name: str) -> Factor:
        return self.factors[self.names.index(one_of("factor", name, self.names))]

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Space):
            return False
        return self.factors == other.factors and self.limits == other.limits

    def __hash__(self) -> int:
        return hash((self.factors, self.limits)) if self.limits else hash(self.factors)

    def __repr__(self) -> str:
        parts = [" ".join(filter(None, (f.name, f.domain.text, f.unit))) for f in self]
        inside = "; ".join([*parts, *(limit.text for limit in self.limits)])
        return f"<Space: {len(self)} factor{'s' if len(self) > 1 else ''} ({inside})>"

    def _repr_html_(self) -> str:
        rows = [["factor", "kind", "values"], *([f.title, f.kind, f.domain.text] for f in self)]
        lines = []
        for tag, row in zip(["th", *["td"] * len(self)], rows, strict=True):
            cells = "".join(f"<{tag}>{html.escape(cell)}</{tag}>" for cell in row)
            lines.append(f"<tr>{cells}</tr>")
        return f"<table>{''.join(lines)}</table>"

    @property
    def names(self) -> tuple[str, ...]:
        """Factor names in order."""
        return tuple(f.name for f in self.factors)

    @cached_property
    def lows(self) -> Floats:
        """Lower bounds, natural units, shape (k,); read-only."""
        return _read_only([f.low for f in self.factors])

    @cached_property
    def highs(self) -> Floats:
        """Upper bounds, natural units, shape (k,); read-only."""
        return _read_only([f.high for f in self.factors])

    @cached_property
    def numeric(self) -> NDArray[np.bool_]:
        """Which factors are numbers rather than categories, shape (k,); read-only."""
        return _read_only([f.domain.is_numeric for f in self.factors])

    def mixture(self, *components: str, total: float = 1.0) -> Space:
        """The same factors where the amounts of `components` add up to `total`.

        Parameters
        ----------
        *components : str
            Names of continuous factors. Called again, it adds another mixture of other factors.
        total : float
            1 for fractions, 100 for percent.

        Raises
        ------
        RsmkitError
            If a component cannot be one, or the bounds contradict the total.

        Examples
        --------
        >>> Space(a=(0, 1), b=(0.2, 1), c=(0, 1)).mixture("a", "b", "c")
        <Space: 3 factors (a 0 to 1; b 0.2 to 1; c 0 to 1; a + b + c == 1)>
        """
        return self.limited([*self.limits, Mixture(components, float(total))])

    def limited(self, limits: Iterable[Mixture | Equality]) -> Space:
        """The same factors under these mixtures and equalities, and no others.

        Raises
        ------
        RsmkitError
            If a factor that takes part is not continuous or unknown, or the limits and bounds contradict each
            other.
        """
        made = Space(self.factors)
        made.limits = tuple(dict.fromkeys(limits))
        check_limits(made.limits, {f.name: f.domain for f in made})
        if made.limits:
            made.__dict__["affine"] = made._affine()
        return made

    def subject_to(self, *texts: str) -> Space:
        """The same factors, kept to further linear equalities such as ``"a + 2*b == 3"``.

        Raises
        ------
        RsmkitError
            If a text is no equality that is linear in continuous factors, or the bounds contradict it.

        Examples
        --------
        >>> Space(a=(0, 1), b=(0, 1)).subject_to("a + 2*b == 1.5")
        <Space: 2 factors (a 0 to 1; b 0 to 1; a + 2*b == 1.5)>
        """
        return self.holding(parse_equality(text, self.names) for text in texts)

    def holding(self, equalities: Iterable[Equality]) -> Space:
        """The same factors under further equalities; those it keeps already are no further ones."""
        more = [e for e in equalities if e not in self.equalities]
        return self.limited([*self.limits, *more]) if more else self

    def with_factors(self, factors: Iterable[Factor]) -> Space:
        """Other factors, under those mixtures and equalities that they leave whole."""
        made = Space(factors)
        kept = [limit for limit in self.limits if {*limit.equality.names} <= {*made.names}]
        return made.limited(kept) if kept else made

    @property
    def mixtures(self) -> tuple[Mixture, ...]:
        """Groups of components that add up to a total; empty in most studies."""
        return tuple(limit for limit in self.limits if isinstance(limit, Mixture))

    @property
    def equalities(self) -> tuple[Equality, ...]:
        """Every linear equality that points keep to, those of mixtures among them."""
        return tuple(limit.equality for limit in self.limits)

    @property
    def categories(self) -> dict[str, tuple[str, ...]]:
        """Levels of every categorical factor by its name."""
        return {f.name: tuple(map(str, f.levels)) for f in self if f.domain.categories}

    @cached_property
    def affine(self) -> AffineSet | None:
        """The set of points that satisfy the equalities; None without any."""
        return self._affine() if self.limits else None

    def _affine(self) -> AffineSet:
        scales = np.where(self.components, 1.0, self.highs - self.lows)
        return AffineSet(self.names, self.lows, self.highs, self.equalities, scales)

    @cached_property
    def components(self) -> NDArray[np.bool_]:
        """Which factors are components of a mixture, shape (k,); read-only."""
        inside = {name for mixture in self.mixtures for name in mixture.components}
        return _read_only([name in inside for name in self.names])

    @cached_property
    def _pseudo(self) -> tuple[Floats, Floats]:
        """Where components are 0 and how far it is to 1 in pseudo-components; 0 and 1 for others."""
        zero, length = np.zeros(len(self)), np.ones(len(self))
        if self.affine is not None:
            for mixture in self.mixtures:
                at = [self.names.index(name) for name in mixture.components]
                zero[at] = self.affine.low[at]
                length[at] = mixture.total - zero[at].sum()
        return zero, length

    def encode(self, natural: ArrayLike) -> Floats:
        """Natural to coded units; shape ``(..., k)`` in and out; exact at the bounds.

        Components of a mixture become pseudo-components: 0 at the least amount there can be, 1 where the
        others are at theirs; those of a mixture add up to 1.
        """
        x: Floats = np.asarray(natural, float)
        coded = natural_to_coded(x, self.lows, self.highs)
        if self.mixtures:
            zero, length = self._pseudo
            coded = np.where(self.components, (x - zero) / length, coded)
        return np.asarray(np.where(self.numeric, coded, x))

    def decode(self, coded: ArrayLike) -> Floats:
        """Coded to natural units; shape ``(..., k)`` in and out; exact at coded -1 and +1."""
        c = np.asarray(coded, float)
        blend = coded_to_natural(c, self.lows, self.highs)
        if self.mixtures:
            zero, length = self._pseudo
            blend = np.where(self.components, zero + length * c, blend)
        return np.asarray(np.where(self.numeric, blend, c))

    def spread(self, unit: ArrayLike) -> Floats:
        """Numbers from 0 to 1, shape (n, k), to natural points as evenly spread over the space.

        Levels get equal shares; under equalities the points are even on the set that satisfies them.
        """
        u = np.asarray(unit, float)
        points = unit_to_natural(u, self.lows, self.highs) if self.affine is None else self.affine.spread(u)
        for j, factor in enumerate(self.factors):
            if not factor.domain.is_continuous:
                points[:, j] = factor.domain.from_unit(u[:, j])
        return points

    def snap(self, natural: ArrayLike) -> Floats:
        """Move each coordinate to the nearest value its factor can take (bounds are not enforced)."""
        x = np.array(natural, float)
        for j, factor in enumerate(self.factors):
            if not factor.domain.is_continuous:
                x[..., j] = factor.domain.snap(x[..., j])
        return x

    def clip(self, natural: ArrayLike) -> Floats:
        """Move points outside the bounds onto them; under equalities to the nearest point that keeps both."""
        x = np.asarray(natural, float)
        return np.asarray(
            np.clip(x, self.lows, self.highs) if self.affine is None else self.affine.project(x)
        )

    def contains(self, natural: ArrayLike, tolerance: float = 1e-9) -> NDArray[np.bool_]:
        """Whether each point lies in the box, within `tolerance` of the range; shape ``(...)``.

        Under equalities it must satisfy them too, within `tolerance` of their size.
        """
        slack = tolerance * (self.highs - self.lows)
        x = np.asarray(natural, float)
        inside = np.all((x >= self.lows - slack) & (x <= self.highs + slack), axis=-1)
        return np.asarray(inside if self.affine is None else inside & self.affine.holds(x, tolerance))

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

    def table(self, points: Any) -> Floats:
        """Points by name: a table with a column per factor, in any order, as natural coordinates.

        Parameters
        ----------
        points : DataFrame, mapping of str to values, or array of shape (n, k)
            Named columns are matched by name; single values hold for every row. An array has its columns in
            the order of the factors.

        Returns
        -------
        array, shape (n, k)

        Raises
        ------
        RsmkitError
            If a factor is missing, a column is none, or the columns differ in length.
        """
        if hasattr(points, "columns") and hasattr(points, "to_dict"):
            columns = {str(name): points[name].tolist() for name in points.columns}
        elif isinstance(points, Mapping):
            columns = {name: _listed(values) for name, values in points.items()}
        else:
            return np.asarray(points, float)
        self._check_names(columns)
        count = max(map(len, columns.values()))
        uneven = [name for name, values in columns.items() if len(values) not in (1, count)]
        if uneven:
            raise RsmkitError(f"points: {', '.join(uneven)} should have {count} values as the others, or one")
        rows = [columns[f.name] * (count if len(columns[f.name]) == 1 else 1) for f in self.factors]
        made = [[f.coordinate(x) for x in row] for f, row in zip(self.factors, rows, strict=True)]
        return np.array(made, float).T

    def _check_names(self, values: Collection[str]) -> None:
        missing = [name for name in self.names if name not in values]
        unknown = [name for name in values if name not in self.names]
        if missing or unknown:
            parts = [f"missing {', '.join(missing)}"] if missing else []
            parts += [f"unknown {', '.join(unknown)}"] if unknown else []
            raise RsmkitError(f"factors: {'; '.join(parts)} (the factors are {', '.join(self.names)})")


def place_of(point: Iterable[float]) -> tuple[float, ...]:
    """A point as something that can be looked up; -0.0 is the same place as 0.0."""
    return tuple(float(x) + 0.0 for x in point)


def _listed(values: Any) -> list[Any]:
    """One value or several as a list."""
    if isinstance(values, str) or not isinstance(values, Iterable):
        return [values]
    return values.tolist() if isinstance(values, np.ndarray) else list(values)


def _short_form(name: str, spec: Any) -> Factor:
    """Make a factor of ``name=(low, high)`` or ``name=[level, ...]``."""
    if isinstance(spec, tuple):
        if len(spec) != 2 or not all(map(_is_finite, spec)):
            raise RsmkitError(
                f"factor {name}: {spec} is not a range; write a range as two finite numbers, "
                f"{name}=(low, high), and given levels as a list, {name}={list(spec)}"
            )
        return Factor(name, float(spec[0]), float(spec[1]))
    if isinstance(spec, str | bytes | Mapping) or not isinstance(spec, Iterable):
        raise RsmkitError(
            f"factor {name}: {spec!r} is neither a range nor levels; write {name}=(1, 3) for every number "
            f"from 1 to 3, {name}=[1, 2, 3] or {name}=['a', 'b'] for given levels"
        )
    return Factor(name, levels=tuple(spec))


def _is_finite(value: Any) -> bool:
    return isinstance(value, int | float | np.number) and type(value) is not bool and math.isfinite(value)


def _read_only(values: Sequence[float]) -> NDArray[Any]:
    array = np.array(values)
    array.setflags(write=False)
    return array
