"""Mixtures and linear equalities of continuous factors, and the set of points that satisfy them.

A space whose factors keep to equalities ``A x = b`` is a slice of its box: a polytope of as many dimensions
fewer as there are equalities. :class:`AffineSet` knows that slice: its directions, the bounds it implies, the
nearest of its points to any other. Everything is in natural units; arrays of points are of shape (n, k).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rsmkit.errors import RsmkitError
from rsmkit.geometry.polytope import Polytope
from rsmkit.geometry.tied_groups import Group
from rsmkit.io.shown import Shown
from rsmkit.language.domains import Domain, Floats, unit_to_natural

__all__ = ["AffineSet", "Equality", "Mixture", "check_limits"]

ROUNDING = 1e-12
"""Part of the size of an equality within which it counts as satisfied."""


@dataclass(frozen=True)
class Equality(Shown):
    """A linear equality of continuous factors: ``sum of coefficient * factor == value``.

    Parameters
    ----------
    terms : tuple of (str, float)
        Names of factors and their coefficients, none of them zero.
    value : float

    Examples
    --------
    >>> Equality.of({"a": 1, "b": 2}, 3).text
    'a + 2*b == 3'
    """

    terms: tuple[tuple[str, float], ...]
    value: float

    @classmethod
    def of(cls, coefficients: Mapping[str, float], value: float) -> Equality:
        """Make one of coefficients by name; those that are zero are left out."""
        return cls(tuple((name, float(c)) for name, c in coefficients.items() if c), float(value))

    @property
    def equality(self) -> Equality:
        """Itself."""
        return self

    @property
    def names(self) -> tuple[str, ...]:
        """The factors that take part."""
        return tuple(name for name, _ in self.terms)

    @property
    def text(self) -> str:
        """As a study file says it."""
        parts = [f"{c:+.15g}*{name}" if abs(c) != 1 else f"{'+-'[c < 0]}{name}" for name, c in self.terms]
        spaced = " ".join(f"{part[0]} {part[1:]}" for part in parts).removeprefix("+ ")
        return f"{spaced} == {self.value:.15g}"


@dataclass(frozen=True)
class Mixture(Shown):
    """Components whose amounts add up to a total.

    Parameters
    ----------
    components : tuple of str
        Names of continuous factors, at least two.
    total : float
        Their sum in every run: 1 for fractions, 100 for percent.
    """

    components: tuple[str, ...]
    total: float = 1.0

    def __post_init__(self) -> None:
        if len(self.components) < 2:
            raise RsmkitError(f"mixture: name at least two components, got {list(self.components)}")
        if len(set(self.components)) != len(self.components):
            raise RsmkitError(f"mixture: a component is named twice in {', '.join(self.components)}")
        if not math.isfinite(self.total):
            raise RsmkitError(f"mixture: the total must be a finite number, got {self.total!r}")

    @property
    def equality(self) -> Equality:
        """The sum as an equality."""
        return Equality(tuple((name, 1.0) for name in self.components), float(self.total))

    @property
    def text(self) -> str:
        """The sum as a study file says it."""
        return self.equality.text


def check_limits(limits: Sequence[Mixture | Equality], domains: Mapping[str, Domain]) -> None:
    """Refuse what cannot take part in an equality; `domains` are the factors' by name."""
    used: dict[str, str] = {}
    for limit in limits:
        for name in limit.equality.names:
            where = f"'{limit.text}'"
            if name not in domains:
                raise RsmkitError(f"{where}: {name} is no factor (factors: {', '.join(domains)})")
            if not domains[name].is_continuous:
                raise RsmkitError(
                    f"{where}: {name} is {domains[name].word}, and only continuous factors can give way to "
                    f"keep an equality; give {name} low and high alone, or leave it out of the equality"
                )
            if isinstance(limit, Mixture):
                if name in used:
                    raise RsmkitError(
                        f"{where}: {name} is already a component of '{used[name]}'; a factor belongs to one "
                        "mixture. Write the other sum as an equality: subject_to"
                    )
                used[name] = limit.text


class AffineSet:
    """The points of a box that satisfy linear equalities.

    Parameters
    ----------
    names : sequence of str
        The factors, k of them.
    lows, highs : array, shape (k,)
        Their bounds, natural units.
    equalities : sequence of Equality
        At least one.
    scales : array, shape (k,)
        Lengths that compare, by which distances are measured.

    Raises
    ------
    RsmkitError
        If equalities repeat or contradict each other or the bounds, or leave nothing to vary.
    """

    def __init__(
        self,
        names: Sequence[str],
        lows: Floats,
        highs: Floats,
        equalities: Sequence[Equality],
        scales: Floats | None = None,
    ) -> None:
        self.names, self.lows, self.highs = tuple(names), lows, highs
        self.equalities = tuple(equalities)
        self.scales = highs - lows if scales is None else scales
        self.matrix: Floats = np.array(
            [[dict(e.terms).get(name, 0.0) for name in names] for e in self.equalities]
        )
        """Coefficients, shape (m, k)."""
        self.values: Floats = np.array([e.value for e in self.equalities])
        """Right-hand sides, shape (m,)."""
        _refuse_repeated(self)
        self.low, self.high = _implied_bounds(self)
        """Least and greatest value of every factor on the set, shape (k,) each: the implied bounds."""
        _refuse_fixed(self)

    @property
    def size(self) -> Floats:
        """Scale of each equality, against which its rounding is judged, shape (m,)."""
        largest = np.maximum(np.abs(self.lows), np.abs(self.highs))
        return np.asarray(np.maximum(np.abs(self.matrix) @ largest, np.abs(self.values)))

    @cached_property
    def involved(self) -> NDArray[np.bool_]:
        """Which factors take part in an equality, shape (k,)."""
        return np.asarray((self.matrix != 0).any(axis=0))

    @cached_property
    def blocks(self) -> tuple[tuple[NDArray[np.intp], NDArray[np.intp]], ...]:
        """Equalities that share no factor with others, apart: (rows, columns) of each block."""
        left, found = list(range(len(self.matrix))), []
        while left:
            rows = [left.pop(0)]
            while True:
                columns = (self.matrix[rows] != 0).any(axis=0)
                more = [i for i in left if (self.matrix[i] != 0)[columns].any()]
                if not more:
                    break
                rows += more
                left = [i for i in left if i not in more]
            found.append((np.array(sorted(rows)), np.flatnonzero(columns)))
        return tuple(found)

    @cached_property
    def basis(self) -> Floats:
        """Orthonormal directions that keep the equalities, natural units, shape (k, k - m)."""
        return np.asarray(np.linalg.svd(self.matrix)[2][len(self.matrix) :].T)

    def residuals(self, points: ArrayLike) -> Floats:
        """By how much points miss each equality, shape (n, m)."""
        return np.asarray(np.asarray(points, float) @ self.matrix.T - self.values)

    def holds(self, points: ArrayLike, tolerance: float = 1e-9) -> NDArray[np.bool_]:
        """Whether points satisfy every equality within `tolerance` of its size, shape (...)."""
        return np.asarray((np.abs(self.residuals(points)) <= tolerance * self.size).all(axis=-1))

    @cached_property
    def own_bounds(self) -> tuple[Floats, Floats]:
        """Bounds that the other factors' bounds do not imply, infinite where they do; shape (k,) each.

        Known of factors of a single equality; of several sharing a factor every bound counts as its own.
        """
        low, high = np.array(self.lows), np.array(self.highs)
        for rows, columns in self.blocks:
            if len(rows) == 1:
                reach = _reach(self, rows[0], columns)
                low[columns] = np.where(reach[0] >= self.lows[columns], -np.inf, self.lows[columns])
                high[columns] = np.where(reach[1] <= self.highs[columns], np.inf, self.highs[columns])
        return low, high

    def dependents(self, at: ArrayLike) -> NDArray[np.intp]:
        """One factor per equality that the others determine, far from its own bounds at a point; shape (m,).

        Of all that can be solved for, those with the most room: Gaussian elimination with that choice.
        """
        x, (low, high) = np.asarray(at, float), self.own_bounds
        room = np.minimum(np.minimum(x - low, high - x) / (self.high - self.low), 2.0)
        left, found = np.array(self.matrix * self.scales), list[int]()
        for row in range(len(left)):
            usable = np.abs(left[row]) > 1e-9 * np.abs(left[row]).max()
            found.append(int(np.where(usable, np.maximum(room, 0.0), -1.0).argmax()))
            pivot = left[row] / left[row, found[-1]]
            left[row + 1 :] -= left[row + 1 :, [found[-1]]] * pivot
        return np.array(found)

    def completed(self, points: ArrayLike, dependents: NDArray[np.intp]) -> Floats:
        """Points with the `dependents` solved for, shape (..., k); these may leave their bounds."""
        x = np.array(points, float)
        x[..., dependents] = 0.0
        x[..., dependents] = np.linalg.solve(self.matrix[:, dependents], -self.residuals(x).T).T
        return x

    def project(self, points: ArrayLike) -> Floats:
        """Nearest points of the set, inside the bounds, shape (n, k) in and out.

        Distances are in units of :attr:`scales`. The equalities hold to a rounding error.
        """
        x = np.atleast_2d(np.asarray(points, float))
        made = np.clip(x, self.lows, self.highs)
        for rows, columns in self.blocks:
            given = x[:, columns]
            low, high, weights = self.lows[columns], self.highs[columns], self.scales[columns] ** 2
            a, b = self.matrix[np.ix_(rows, columns)], self.values[rows]
            inside = np.abs(given @ a.T - b) <= 1e-15 * self.size[rows]
            kept = inside.all(axis=1) & (given >= low).all(axis=1) & (given <= high).all(axis=1)
            moved = np.array(given)
            if not kept.all():
                ask = given[~kept]
                near = (
                    _project_one(ask, a[0], b[0], low, high, weights)
                    if len(rows) == 1
                    else _project_many(ask, a, b, low, high, weights)
                )
                moved[~kept] = _exact(near, a, b, low, high)
            made[:, columns] = moved
        return np.asarray(made.reshape(np.shape(points)) + 0.0)  # no -0.0

    @cached_property
    def inner(self) -> Floats:
        """A point well inside the bounds, shape (k,)."""
        made = 0.5 * (self.lows + self.highs)
        for rows, columns in self.blocks:
            low, high = self.low[columns], self.high[columns]
            if len(rows) > 1:
                made[columns] = np.mean(_ends_by_programs(self, rows, columns), axis=(0, 1))
                continue
            a = self.matrix[rows[0], columns]
            start, way = np.where(a > 0, low, high), np.sign(a) * (high - low)
            made[columns] = start + way * (self.values[rows[0]] - a @ start) / (a @ way)
        return made

    @cached_property
    def groups(self) -> tuple[Group, ...]:
        """The slice of the box of each block of :attr:`blocks`, in the columns of that block."""
        return tuple(
            Group(
                columns,
                Polytope(
                    self.lows[columns],
                    self.highs[columns],
                    np.empty((0, len(columns))),
                    np.empty(0),
                    self.matrix[np.ix_(rows, columns)],
                    self.values[rows],
                ),
            )
            for rows, columns in self.blocks
        )

    def spread(self, unit: Floats) -> Floats:
        """Even numbers from 0 to 1, shape (n, k), to points spread evenly over the set, shape (n, k).

        Columns of factors in no equality hold their linear image between the bounds.
        """
        made = unit_to_natural(unit, self.lows, self.highs)
        for group in self.groups:
            own = unit[:, group.columns]
            # where it takes random walks, the first of the numbers seed them all
            made[:, group.columns] = group.points(own, int(own[0, 0] * 2.0**32) if len(own) else 0)
        return self.project(made)


def _refuse_repeated(found: AffineSet) -> None:
    """Refuse equalities that follow from others, or contradict them."""
    scaled = found.matrix * found.scales
    for count in range(2, len(scaled) + 1):
        part = scaled[:count] / np.linalg.norm(scaled[:count], axis=1, keepdims=True)
        if np.linalg.matrix_rank(part, 1e-9) < count:
            earlier = ", ".join(e.text for e in found.equalities[: count - 1])
            raise RsmkitError(
                f"'{found.equalities[count - 1].text}' repeats or contradicts {earlier}; leave it out"
            )


def _implied_bounds(found: AffineSet) -> tuple[Floats, Floats]:
    """Least and greatest value of every factor; refuse bounds that leave nothing."""
    low, high = np.array(found.lows), np.array(found.highs)
    for row, equality in enumerate(found.equalities):
        _refuse_out_of_reach(found, row, equality)
    for rows, columns in found.blocks:
        if len(rows) == 1:
            reach = _reach(found, rows[0], columns)
            low[columns] = np.maximum(low[columns], reach[0])
            high[columns] = np.minimum(high[columns], reach[1])
        else:
            ends = _ends_by_programs(found, rows, columns).diagonal(axis1=1, axis2=2)
            low[columns], high[columns] = ends
    return _tidied(low, found), _tidied(high, found)


def _reach(found: AffineSet, row: int, columns: NDArray[np.intp]) -> Floats:
    """Between what values one equality and the bounds of the others hold each factor, shape (2, q)."""
    a, b = found.matrix[row, columns], found.values[row]
    ends = np.sort([a * found.lows[columns], a * found.highs[columns]], axis=0)
    others = ends.sum(axis=1, keepdims=True) - ends
    return np.sort((b - others) / a, axis=0)


def _tidied(bounds: Floats, found: AffineSet) -> Floats:
    """Bounds that differ from those given, or from a short decimal, by rounding alone are these."""
    size = np.abs(found.lows) + np.abs(found.highs)
    for exact in (np.round(bounds, 12), found.lows, found.highs):
        bounds = np.where(np.abs(bounds - exact) <= 1e-12 * size, exact, bounds)
    return bounds


def _refuse_out_of_reach(found: AffineSet, row: int, equality: Equality) -> None:
    """Refuse bounds between which a sum cannot take its value, naming those that are to blame."""
    coefficients, index = found.matrix[row], np.flatnonzero(found.matrix[row])
    ends = np.sort([coefficients * found.lows, coefficients * found.highs], axis=0)[:, index]
    slack = ROUNDING * found.size[row]
    for sign, sums, word, remedy in (
        (1.0, ends[0], "above", "lower a low"),
        (-1.0, -ends[1], "below", "raise a high"),
    ):
        target = sign * equality.value
        if sums.sum() <= target + slack:
            continue
        chosen = list(range(len(index)))
        for j in sorted(chosen, key=lambda j: sums[j]):  # leave out what is not to blame
            rest = [i for i in chosen if i != j]
            if sums[j] >= 0 and sign > 0 and sums[rest].sum() > target + slack:
                chosen = rest
        bounds = [_bound(found, int(index[j]), sign * coefficients[index[j]] > 0) for j in chosen]
        amount = sign * sums[chosen].sum()
        plain = (coefficients[index] == 1.0).all()
        what, target_word = ("sum", "the total ") if plain else ("part", "")
        way_out = remedy if plain else "widen the bounds"
        raise RsmkitError(
            f"'{equality.text}': {' and '.join(bounds)} leave nothing: their {what} {amount:.6g} is {word} "
            f"{target_word}{equality.value:.6g}; {way_out}, or change the total"
        )


def _bound(found: AffineSet, j: int, lower: bool) -> str:
    name = found.names[j]
    return f"{name} >= {found.lows[j]:.6g}" if lower else f"{name} <= {found.highs[j]:.6g}"


def _ends_by_programs(found: AffineSet, rows: NDArray[np.intp], columns: NDArray[np.intp]) -> Floats:
    """Points of a block where each factor is least, and greatest, by linear programs; shape (2, q, q)."""
    from scipy.optimize import linprog

    a, b = found.matrix[np.ix_(rows, columns)], found.values[rows]
    limits = list(zip(found.lows[columns].tolist(), found.highs[columns].tolist(), strict=True))
    ends = np.empty((2, len(columns), len(columns)))
    for j in range(len(columns)):
        for side, sign in enumerate((1.0, -1.0)):
            answer = linprog(sign * np.eye(len(columns))[j], A_eq=a, b_eq=b, bounds=limits)
            if not answer.success:
                texts = " and ".join(f"'{found.equalities[i].text}'" for i in rows)
                raise RsmkitError(f"{texts} leave no point together within the bounds; widen the bounds")
            ends[side, j] = answer.x
    return ends


def _refuse_fixed(found: AffineSet) -> None:
    """Refuse a set on which a factor cannot vary."""
    width = found.high - found.low
    for j in np.flatnonzero(width <= 1e-9 * (found.highs - found.lows)):
        texts = " and ".join(f"'{e.text}'" for e in found.equalities if found.names[j] in e.names)
        raise RsmkitError(
            f"{texts} and the bounds leave {found.names[j]} the one value {found.low[j]:.6g}; widen the "
            "bounds of the others, or make it a fixed setting instead of a factor"
        )


def _project_one(x: Floats, a: Floats, b: float, low: Floats, high: Floats, weights: Floats) -> Floats:
    """Project onto one equality and bounds: ``clip(x + t * weights * a)`` at the root of a broken line."""
    rate = weights * a
    breaks = np.sort(np.concatenate([(low - x) / rate, (high - x) / rate], axis=1), axis=1)
    sums = np.clip(x[:, None, :] + breaks[:, :, None] * rate, low, high) @ a
    after = np.clip((sums < b).sum(axis=1), 1, breaks.shape[1] - 1)
    rows = np.arange(len(x))
    left, right = breaks[rows, after - 1], breaks[rows, after]
    at, end = sums[rows, after - 1], sums[rows, after]
    rise = np.where(end > at, end - at, 1.0)
    root = left + (right - left) * np.clip((b - at) / rise, 0.0, 1.0)
    return np.asarray(np.clip(x + root[:, None] * rate, low, high))


MOST_STEPS, NEARLY = 100, 1e-11
"""Of Newton's method, and the part of an equality at which it may end: the rest is exact."""


def _project_many(x: Floats, a: Floats, b: Floats, low: Floats, high: Floats, weights: Floats) -> Floats:
    """Project onto several equalities and bounds: Newton's method on the dual, a concave function.

    Semismooth Newton method (Qi & Sun 1993, Mathematical Programming 58, 353-367) with halved steps, for all
    points at once.
    """
    rate = a * weights
    scale = np.trace(rate @ a.T)

    def dual(rows: NDArray[np.intp], t: Floats) -> Floats:
        inside = np.clip(x[rows] + t @ rate, low, high)
        distance = 0.5 * ((inside - x[rows]) ** 2 / weights).sum(axis=1)
        return np.asarray(distance + (t * (b - inside @ a.T)).sum(axis=1))

    t, left = np.zeros((len(x), len(a))), np.arange(len(x))
    size = np.abs(a) @ np.maximum(np.abs(low), np.abs(high)) + np.abs(b)
    for _ in range(MOST_STEPS):
        moved = x[left] + t[left] @ rate
        miss = b - np.clip(moved, low, high) @ a.T
        going = (np.abs(miss) > NEARLY * size).any(axis=1)
        left, moved, miss = left[going], moved[going], miss[going]
        if not len(left):
            break
        free = (moved > low) & (moved < high)
        firm = 1e-12 + 1e-2 * np.minimum(1.0, np.abs(miss / size).max(axis=1))
        curve = np.einsum("ij,nj,kj->nik", rate, free, a) + (firm * scale)[:, None, None] * np.eye(len(a))
        step = np.linalg.solve(curve, miss[:, :, None])[:, :, 0]
        here, slope, length = dual(left, t[left]), (miss * step).sum(axis=1), np.ones(len(left))
        noise = 1e-13 * (np.abs(here) + np.abs(t[left]) @ size)  # of `here`, which hides the last gains
        for _ in range(40):
            rise = dual(left, t[left] + length[:, None] * step) - here
            short = rise < 1e-4 * length * slope - noise
            if not short.any():
                break
            length[short] *= 0.5
        t[left] += length[:, None] * step
    return np.asarray(np.clip(x + t @ rate, low, high))


def _exact(x: Floats, a: Floats, b: Floats, low: Floats, high: Floats) -> Floats:
    """Take the last rounding error out of the coordinates that have room for it."""
    for _ in range(2):
        room = np.minimum(x - low, high - x) ** 2
        curve = np.einsum("ij,nj,kj->nik", a, room, a)
        curve += (1e-300 + 1e-13 * np.einsum("nii->n", curve))[:, None, None] * np.eye(len(a))
        miss = b - x @ a.T
        solved = np.linalg.solve(curve, miss[:, :, None])[:, :, 0]
        x = np.clip(x + np.nan_to_num(room * (solved @ a)), low, high)
    return x
