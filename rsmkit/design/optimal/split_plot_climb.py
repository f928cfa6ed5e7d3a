"""Climbs to optimal split-plot designs from random ones: see :mod:`rsmkit.design.optimal.split_plot`.

Compiled code climbs where constraints are linear; what it does not know, curved constraints, those that name
categories, mixtures and other sums, is minded by the same exchange in numpy. The factors of a sum move
together, towards corners, centroids and along edges of their polytope.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rsmkit.design.design import Design
from rsmkit.design.optimal.criteria import Aim
from rsmkit.design.optimal.encoding import Lines, Model, encode_model, model_rows
from rsmkit.design.region import Region
from rsmkit.language.space import Floats

if TYPE_CHECKING:
    from rsmkit.design.optimal.split_plot_exchange import PlotState, PlotWork

__all__ = ["PlotClimb"]

STEPS = 11
"""Values of a continuous coordinate that a climb tries; the best designs are then refined between them."""
FINE = (0.1, 0.03, 0.01, 0.003)
"""Half widths, coded, of the steps of that refinement."""
GAIN = 1e-9
"""Relative gain that counts."""
PASSES = 60

_Columns = NDArray[np.int64]
_Values = Callable[[_Columns, Floats], Floats]
"""Coded settings to try for factors that move together, shape (m, g), from their present ones, shape (g,)."""
SHARES = (0.25, 0.5, 0.75, 1.0)
"""Of the way to a corner or a centroid that a climb tries."""


@dataclass(frozen=True, eq=False)
class PlotClimb:
    """One problem, and the climbs in it; points are coded, rows in the order of the plots.

    Parameters
    ----------
    aim : Aim
        The criterion.
    region : Region
    held : array, shape (k,)
        Factors that keep one setting in a plot.
    sizes : tuple of int
        Runs of each plot.
    ratio : float
        Variance of a plot over that of a run.
    given : Design
        Runs that are kept, first.
    """

    aim: Aim
    region: Region
    held: NDArray[np.bool_]
    sizes: tuple[int, ...]
    ratio: float
    given: Design

    @cached_property
    def model(self) -> Model:
        """The model as the exchange wants it."""
        return encode_model(self.aim.terms)

    @cached_property
    def plot_of(self) -> NDArray[np.intp]:
        """Plot of every run, from 0, shape (n,)."""
        return np.repeat(np.arange(len(self.sizes)), self.sizes)

    @property
    def n(self) -> int:
        """Number of runs."""
        return len(self.plot_of)

    @property
    def p(self) -> int:
        """Number of coefficients, potential ones included."""
        return len(self.aim.prior)

    @cached_property
    def free_plots(self) -> tuple[int, ...]:
        """Plots without given runs."""
        used = set(self.plot_of[: len(self.given)].tolist())
        return tuple(plot for plot in range(len(self.sizes)) if plot not in used)

    @cached_property
    def shrinks(self) -> Floats:
        """``c`` of every plot: its block of ``V^-1`` is ``I - c 1 1'``."""
        sizes = np.array(self.sizes, float)
        return np.asarray(self.ratio / (1.0 + self.ratio * sizes))

    @cached_property
    def values(self) -> tuple[Floats, ...]:
        """Coded values that a climb tries, factor by factor."""
        ends = zip(self.region.levels, self.region.lows, self.region.highs, strict=True)
        return tuple(levels if len(levels) else np.linspace(low, high, STEPS) for levels, low, high in ends)

    @cached_property
    def moves(self) -> tuple[_Columns, ...]:
        """Factors that move together: those of a sum, and each of the others by itself."""
        tied = [group.columns for group in self.region.groups if len(group.polytope.rhs)] if self.flat else []
        taken = {int(j) for columns in tied for j in columns}
        single = [np.array([j]) for j in range(len(self.held)) if j not in taken]
        return (*tied, *single)

    @property
    def flat(self) -> bool:
        """Whether runs keep sums."""
        return self.region.flat

    @property
    def by_numpy(self) -> bool:
        """Whether compiled code cannot climb here."""
        return self.flat or bool(self.region.nonlinear)

    @cached_property
    def nodes(self) -> dict[int, Floats]:
        """Corners and centroids of the polytope of each sum, by the first of its factors."""
        groups = self.region.groups if self.flat else ()
        return {int(g.columns[0]): g.nodes((1, 2)) for g in groups if len(g.polytope.rhs)}

    @cached_property
    def ways(self) -> dict[int, Floats]:
        """Directions within it, likewise."""
        groups = self.region.groups if self.flat else ()
        return {int(g.columns[0]): g.directions for g in groups if len(g.polytope.rhs)}

    def tolerance(self, value: float, relative: float = 1e-5) -> float:
        """What two values of the criterion may differ by and be the same."""
        return relative * (abs(value) if len(self.aim.weights) else self.p)

    # ------------------------------------------------------------------ criterion

    def information(self, rows: Floats) -> Floats:
        """``M`` of model rows."""
        total = self.aim.prior + rows.T @ rows
        for plot, shrink in enumerate(self.shrinks):
            sums = rows[self.plot_of == plot].sum(axis=0)
            total = total - shrink * np.outer(sums, sums)
        return np.asarray(total)

    def worth(self, information: Floats) -> Floats:
        """The criterion of information matrices, shape (..., p, p) to (...), larger is better."""
        sign, log_det = np.linalg.slogdet(information)
        sound = (sign > 0) & (log_det > -60.0 * np.log(10))
        if not len(self.aim.weights):
            return np.where(sound, log_det, -np.inf)
        safe = np.where(sound[..., None, None], information, np.eye(self.p))
        inverse = np.linalg.inv(safe)
        return np.where(sound, -(inverse * self.aim.weights).sum(axis=(-2, -1)), -np.inf)

    def value(self, points: Floats) -> float:
        """The criterion of a design; minus infinity when it is singular for all practical purposes."""
        information = self.information(model_rows(self.model, points))
        scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
        if np.linalg.eigvalsh(information / np.outer(scale, scale))[0] < 1e-10:
            return -np.inf
        return float(self.worth(information))

    # ------------------------------------------------------------------ climbing

    def random_points(self, rng: np.random.Generator) -> Floats:
        """A random design of the given and of allowed new runs."""
        points = np.empty((self.n, len(self.held)))
        points[: len(self.given)] = self.given.coded
        pool = self.region.sample(max(256, 4 * self.n), int(rng.integers(2**31)))
        pool = pool[rng.permutation(len(pool))]
        for plot in range(len(self.sizes)):
            rows = np.nonzero((self.plot_of == plot) & (np.arange(self.n) >= len(self.given)))[0]
            kept = np.nonzero(self.plot_of[: len(self.given)] == plot)[0]
            first = points[kept[0]] if len(kept) else pool[int(rng.integers(len(pool)))]
            others = pool.copy()
            others[:, self.held] = first[self.held]
            others = others[self.region.contains(others)]
            if not len(others):
                others = first[None]
            points[rows] = others[rng.integers(len(others), size=len(rows))]
        return points

    def from_points(self, points: Floats) -> tuple[float, Floats]:
        """Climb until a pass over all coordinates gains nothing."""
        if not self.by_numpy:
            return self._compiled(points, 0.0)
        return self._climb(points, self._coarse)

    def _coarse(self, columns: _Columns, present: Floats) -> Floats:
        """Settings that a climb tries."""
        if int(columns[0]) not in self.nodes:
            return np.asarray(self.values[columns[0]][:, None])
        nodes = self.nodes[int(columns[0])]
        return np.vstack([present + share * (nodes - present) for share in SHARES])

    def _compiled(self, points: Floats, width: float) -> tuple[float, Floats]:
        """Climb in compiled code, which knows linear constraints and balls alone."""
        from rsmkit.design.optimal.split_plot_exchange import climb

        state = self.state._replace(points=points.copy())
        climb(self.model, self.lines, state, self.work, width, 0.0 if width else 1e-8 * self.n)
        return self.value(state.points), state.points

    @cached_property
    def state(self) -> PlotState:
        """The problem as compiled code wants it, without its points."""
        from rsmkit.design.optimal.split_plot_exchange import PlotState

        free = np.zeros(len(self.sizes), bool)
        free[list(self.free_plots)] = True
        return PlotState(
            np.zeros((self.n, len(self.held))),
            np.zeros((self.n, self.p)),
            np.r_[0, np.cumsum(self.sizes)].astype(np.int64),
            self.shrinks,
            self.held,
            len(self.given),
            free,
            self.aim.prior,
            self.aim.weights,
        )

    @cached_property
    def work(self) -> PlotWork:
        """Its working space."""
        from rsmkit.design.optimal.split_plot_exchange import plot_work

        return plot_work(self.n, len(self.held), self.p)

    @cached_property
    def lines(self) -> Lines:
        """Where points may lie; counts of values are negative for continuous factors."""
        region = self.region
        table = np.zeros((len(self.values), max(map(len, self.values))))
        for j, values in enumerate(self.values):
            table[j, : len(values)] = values
        counts = [
            len(v) if len(levels) else -len(v) for v, levels in zip(self.values, region.levels, strict=True)
        ]
        normals, offsets = region.halfspaces
        return Lines(
            np.array(region.lows, float),
            np.array(region.highs, float),
            table,
            np.array(counts, np.int64),
            np.ascontiguousarray(normals),
            np.ascontiguousarray(offsets),
            float(region.radius),
            0.0,
        )

    def refined(self, points: Floats) -> tuple[float, Floats]:
        """Move continuous coordinates between the values that were tried."""
        value = self.value(points)
        for width in FINE:

            def near(columns: _Columns, x: Floats, width: float = width) -> Floats:
                j, steps = int(columns[0]), width * np.linspace(-1.0, 1.0, 7)
                if len(self.region.levels[j]):
                    return self.values[j][:, None]
                if j in self.ways:
                    along = self.ways[j] / np.abs(self.ways[j]).max(axis=1, keepdims=True)
                    return np.asarray(x + np.multiply.outer(steps, along).reshape(-1, len(x)))
                tried = np.r_[x + steps, x]
                return np.unique(np.clip(tried, self.region.lows[j], self.region.highs[j]))[:, None]

            climbed, moved = self._climb(points, near) if self.by_numpy else self._compiled(points, width)
            if climbed > value:
                value, points = climbed, moved
        return value, points

    def _climb(self, start: Floats, values: _Values) -> tuple[float, Floats]:
        points = start.copy()
        rows = model_rows(self.model, points)
        information = self.information(rows)
        ridge = 1e-8 * np.eye(self.p) * max(float(np.trace(information)) / self.p, 1.0)
        singular = not np.isfinite(self.value(points))
        information = information + ridge * singular
        value = float(self.worth(information))
        for _ in range(PASSES):
            before = value
            for plot in self.free_plots:
                for columns in self.moves:
                    if self.held[columns[0]]:
                        value, information = self._move_plot(
                            points, rows, information, value, plot, columns, values
                        )
            for i in range(len(self.given), self.n):
                value, information = self._move_run(points, rows, information, value, i, values)
            if value - before <= GAIN * max(1.0, abs(value)):
                if not singular:
                    break
                singular = False  # what the ridge helped through stands by itself now, or never
                information = self.information(rows)
                value = float(self.worth(information))
        return self.value(points), points

    def _move_plot(
        self,
        points: Floats,
        rows: Floats,
        information: Floats,
        value: float,
        plot: int,
        columns: _Columns,
        values: _Values,
    ) -> tuple[float, Floats]:
        """Give a hard factor, or those of a sum, their best setting in a plot."""
        members = np.nonzero(self.plot_of == plot)[0]
        tried = values(columns, points[members[0], columns])
        moved = np.repeat(points[None, members], len(tried), axis=0)
        moved[:, :, columns] = tried[:, None]
        flat = moved.reshape(-1, points.shape[1])
        allowed = self.region.contains(flat).reshape(len(tried), -1).all(axis=1)
        if not allowed.any():
            return value, information
        new = model_rows(self.model, flat).reshape(len(tried), len(members), -1)
        shrink = self.shrinks[plot]
        others = information - self._part(rows[members], shrink)
        sums = new.sum(axis=1)
        parts = np.swapaxes(new, 1, 2) @ new - shrink * sums[:, :, None] * sums[:, None, :]
        worths = np.where(allowed, self.worth(others + parts), -np.inf)
        best = int(np.argmax(worths))
        if worths[best] <= value + GAIN * max(1.0, abs(value)):
            return value, information
        points[np.ix_(members, columns)] = tried[best]
        rows[members] = new[best]
        return float(worths[best]), np.asarray(others + parts[best])

    def _move_run(
        self, points: Floats, rows: Floats, information: Floats, value: float, i: int, values: _Values
    ) -> tuple[float, Floats]:
        """Give the easy factors of a run their best values, one after the other."""
        members = self.plot_of == self.plot_of[i]
        shrink = float(self.shrinks[self.plot_of[i]])
        inverse = np.linalg.inv(information)
        for columns in self.moves:
            if self.held[columns[0]]:
                continue
            tried = values(columns, points[i, columns])
            moved = np.repeat(points[i][None], len(tried), axis=0)
            moved[:, columns] = tried
            allowed = self.region.contains(moved)
            if not allowed.any():
                continue
            change = model_rows(self.model, moved) - rows[i]
            pull = rows[i] - shrink * rows[members].sum(axis=0)
            worths = np.where(
                allowed, self._changed(np.asarray(inverse, float), change, pull, 1.0 - shrink, value), -np.inf
            )
            best = int(np.argmax(worths))
            if worths[best] <= value + GAIN * max(1.0, abs(value)):
                continue
            step = change[best]
            cross = np.outer(step, pull)
            information = information + cross + cross.T + (1.0 - shrink) * np.outer(step, step)
            points[i, columns] = tried[best]
            rows[i] += step
            value = float(self.worth(information))
            inverse = np.linalg.inv(information)
        return value, information

    def _changed(self, inverse: Floats, change: Floats, pull: Floats, own: float, value: float) -> Floats:
        """The criterion after ``M + d g' + g d' + own d d'``, for every row d of `change`."""
        moved = change @ inverse
        gvg, gvd = float(pull @ inverse @ pull), moved @ pull
        dvd = np.einsum("ij,ij->i", moved, change)
        ratio = (1.0 + gvd) ** 2 + (own - gvg) * dvd
        sound = ratio > 1e-12
        safe = np.where(sound, ratio, 1.0)
        if not len(self.aim.weights):
            return np.where(sound, value + np.log(safe), -np.inf)
        other = inverse @ self.aim.weights @ inverse
        dad = np.einsum("ij,jk,ik->i", change, other, change)
        gad, gag = change @ (other @ pull), float(pull @ other @ pull)
        falls = ((gvg - own) * dad - 2.0 * (1.0 + gvd) * gad + dvd * gag) / safe
        return np.where(sound, value - falls, -np.inf)

    @staticmethod
    def _part(rows: Floats, shrink: float) -> Floats:
        sums = rows.sum(axis=0)
        return np.asarray(rows.T @ rows - shrink * np.outer(sums, sums))
