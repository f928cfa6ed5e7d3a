"""A problem as smooth local searches see it: free unit coordinates, quantities of order one, differences.

Continuous factors are free, factors with levels keep those of the start. Differences are evaluated in one
batch, so a parallel evaluator runs them side by side.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from rsmkit.language.domains import natural_to_unit, unit_to_natural
from rsmkit.language.space import Floats
from rsmkit.optimum.problem import Archive, Evaluation
from rsmkit.optimum.unit_box import continuous, from_unit, to_unit

__all__ = ["SIMULATOR", "Linearised", "Local", "LocalSearch"]


ON_BOUND = 1e-12
"""Part of a range this close to a bound lies on it."""


@dataclass(frozen=True)
class LocalSearch:
    """How many local searches to run, and how to take differences.

    Parameters
    ----------
    starts : int
        At most so many, from the best point onwards.
    distance : float
        Starts differ by at least this fraction of a range in some factor (or in a level), so that each may
        lie in a valley of its own. On 150 random indefinite quadratics in 3 and in 6 factors the five best
        points missed the global minimum in 6 % and 34 %, 20 starts at a distance of 0.4 in none.
    step : float
        Difference step, as a fraction of each factor's range: tiny on a surface, about 0.02 on a simulator.
    central : bool
        Central differences; forward ones cost half and suit a simulator without noise.
    tolerance : float
        Change of the objective, relative to its range, that ends a gradient search; for COBYQA the final
        trust-region radius as a fraction of the range (at least 1e-3 on a noisy simulator).
    method : {"gradient", "cobyqa"}
        SLSQP (L-BFGS-B without constraints), or the derivative-free COBYQA.
    settle : bool
        Finish with random steps that need no slope, some thousand evaluations, for an optimum on a kink,
        and with the last digits by rule (:mod:`rsmkit.optimum.local.determined`).
    """

    starts: int = 20
    distance: float = 0.4
    step: float = 1e-5
    central: bool = True
    tolerance: float = 1e-15
    method: Literal["gradient", "cobyqa"] = "gradient"
    settle: bool = False


SIMULATOR = LocalSearch(starts=1, method="cobyqa", tolerance=1e-4)
"""For the true simulator: one derivative-free search. With noise raise the tolerance to 1e-3 or more."""


class Linearised(NamedTuple):
    """Scaled quantities and their derivatives by the free unit coordinates.

    ``objectives`` (m,), ``slopes`` (m, f), ``margins`` (c,), ``margin_slopes`` (c, f).
    """

    objectives: Floats
    slopes: Floats
    margins: Floats
    margin_slopes: Floats


class Local:
    """Scaled objectives and margins as functions of the free unit coordinates, each point evaluated once.

    Parameters
    ----------
    archive : Archive
        Problem and memory; what it knows gives the scales.
    base : ndarray, shape (k,)
        Natural point that gives the levels of the factors that are not free.
    settings : LocalSearch
        Differences.
    """

    def __init__(self, archive: Archive, base: Floats, settings: LocalSearch) -> None:
        self.archive = archive
        self.settings = settings
        self._base = base
        self._space = archive.problem.space
        affine = self._space.affine
        self._solved = np.empty(0, int) if affine is None else affine.dependents(base)
        free = continuous(self._space)
        free[self._solved] = False
        self._free = np.flatnonzero(free)
        known = archive.everything().objectives
        known = known[np.isfinite(known).all(axis=1)]
        spread = np.ptp(known, axis=0) if len(known) else np.zeros(known.shape[1])
        self.offset: Floats = known.min(axis=0) if len(known) else np.zeros(known.shape[1])
        self.size: Floats = np.where(spread > 0, spread, 1.0)
        self._last: tuple[bytes, Evaluation] | None = None
        self._slopes: dict[bytes, Linearised] = {}
        self._levels: dict[bytes, tuple[Floats, Floats]] = {}

    @property
    def begin(self) -> Floats:
        """Free coordinates of the base point, shape (f,)."""
        unit: Floats = to_unit(self._space, self._base[None])[0, self._free]
        return unit

    @property
    def constrained(self) -> bool:
        """Whether there are margins to keep, those of solved factors among them."""
        return bool(self.archive.problem.constraints) or len(self._solved) > 0

    def natural(self, free: Floats) -> Floats:
        """Free unit coordinates, shape (n, f), to natural points, shape (n, k), inside the bounds."""
        if self._space.affine is not None:
            return self._space.clip(self._extended(free))
        unit = np.repeat(to_unit(self._space, self._base[None]), len(free), axis=0)
        unit[:, self._free] = np.clip(free, 0.0, 1.0)
        return from_unit(self._space, unit)

    def _extended(self, free: Floats) -> Floats:
        """Natural points that keep the equalities; solved factors may lie beyond their bounds."""
        assert self._space.affine is not None
        points = np.repeat(self._base[None], len(free), axis=0)
        low, high = self._space.lows[self._free], self._space.highs[self._free]
        points[:, self._free] = unit_to_natural(np.clip(free, 0.0, 1.0), low, high)
        return self._space.affine.completed(points, self._solved)

    def rooms(self, free: Floats) -> Floats:
        """Distances of solved factors from their bounds, parts of their ranges, shape (n, 2 m)."""
        if not len(self._solved):
            return np.empty((len(free), 0))
        low, high = self._space.lows[self._solved], self._space.highs[self._solved]
        unit = natural_to_unit(self._extended(free)[:, self._solved], low, high)
        return np.hstack([unit, 1.0 - unit])

    def quantities(self, free: Floats) -> Floats:
        """First objective and all margins at free unit coordinates, shape (n, f); shape (n, 1 + c).

        Smooth also where a solved factor leaves its bounds, which counts as a violation.
        """
        points = self.natural(free) if self._space.affine is None else self._extended(free)
        objectives, margins = self._scale(self.archive.evaluate(points))
        return np.hstack([objectives[:, :1], margins, self.rooms(free)])

    def level(self, free: Floats) -> tuple[Floats, Floats]:
        """Objectives (m,) and margins (c,) at one point, shape (f,)."""
        u = np.clip(free, 0.0, 1.0)
        if u.tobytes() not in self._levels:
            objectives, margins = self._scale(self.archive.evaluate(self.natural(u[None])))
            self._levels[u.tobytes()] = objectives[0], np.r_[margins[0], self.rooms(u[None])[0]]
        return self._levels[u.tobytes()]

    def value(self, free: Floats) -> float:
        """First objective at one point, shape (f,)."""
        return float(self.linearise(free).objectives[0])

    def slope(self, free: Floats) -> Floats:
        """Gradient of the first objective, shape (f,)."""
        gradient: Floats = self.linearise(free).slopes[0]
        return gradient

    def linearise(self, free: Floats) -> Linearised:
        """Values and differences at one point, shape (f,)."""
        u = np.clip(free, 0.0, 1.0)
        if u.tobytes() not in self._slopes:
            count = len(u)
            steps = self.settings.step * np.eye(count)
            if self.settings.central:
                ahead, behind = np.clip(u + steps, 0.0, 1.0), np.clip(u - steps, 0.0, 1.0)
                if not self._smooth_beyond(np.vstack([u, ahead, behind])):
                    ahead, behind = self._kept(ahead, u), self._kept(behind, u)
                batch = np.vstack([u, ahead, behind])
            else:
                ahead = u + np.where(u + self.settings.step > 1.0, -1.0, 1.0) * steps
                behind = np.tile(u, (count, 1))
                batch = np.vstack([u, ahead])
            objectives, margins = self._scale(self._evaluated(batch))
            back = slice(count + 1, None) if self.settings.central else [0] * count
            width = (ahead - behind).diagonal()[:, None]
            width = np.where(width == 0.0, 1.0, width)  # no way to go: no slope
            rooms, step = self.rooms(u[None])[0], 0.5
            inside = np.where(u > step, u - step, u + step)
            room_slopes = (self.rooms(u + np.diag(inside - u)) - rooms) / (inside - u)[:, None]
            self._slopes[u.tobytes()] = Linearised(
                objectives[0],
                ((objectives[1 : count + 1] - objectives[back]) / width).T,
                np.r_[margins[0], rooms],
                np.vstack([((margins[1 : count + 1] - margins[back]) / width).T, room_slopes.T]),
            )
        return self._slopes[u.tobytes()]

    def _smooth_beyond(self, free: Floats) -> bool:
        """Whether differences may leave the bounds of solved factors: on surfaces, where defined."""
        return self.settings.settle and bool(self._evaluated(free).succeeded.all())

    def _evaluated(self, free: Floats) -> Evaluation:
        """What a batch of differences gives, evaluated once; solved factors may leave their bounds."""
        key = free.tobytes()
        if self._last is None or key != self._last[0]:
            beyond = self._space.affine is not None and self.settings.settle
            points = self._extended(free) if beyond else self.natural(free)
            self._last = key, self.archive.evaluate(points)
        return self._last[1]

    def _kept(self, moved: Floats, u: Floats) -> Floats:
        """Points of differences, shape (f, f), those that leave the bounds of a solved factor put back."""
        inside = self.rooms(moved).min(axis=1, initial=0.0) >= -ON_BOUND
        return np.where(inside[:, None], moved, u)

    def _scale(self, result: Evaluation) -> tuple[Floats, Floats]:
        """Objectives and margins of order one; a failed run counts as bad, never as nan."""
        objectives = (result.objectives - self.offset) / self.size
        return (
            np.nan_to_num(objectives, nan=10.0, posinf=10.0),
            np.nan_to_num(self.archive.scaled_margins(result), nan=-10.0),
        )
