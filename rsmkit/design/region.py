"""Where the points of an optimal design may lie: a box, a ball, a list of candidates, under constraints."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rsmkit.errors import RsmkitError
from rsmkit.geometry.polytope import Polytope
from rsmkit.geometry.tied_groups import Group, groups_of
from rsmkit.io.arguments import checked
from rsmkit.io.shown import Shown
from rsmkit.language.equalities import Equality
from rsmkit.language.space import Floats, Space

__all__ = ["Margin", "Region", "ball", "box", "candidate_list", "placed", "starting_points"]

Margin = Callable[[Floats], Floats]
"""A constraint: natural points, shape (n, k), to margins, shape (n,); where it is >= 0 a point is allowed."""

MOMENT_POINTS = 2**15
MOST_DRAWS = 2**20


@dataclass(frozen=True, eq=False)
class Region(Shown):
    """The set of allowed points, in coded units.

    Made by :func:`box`, :func:`ball` or :func:`candidate_list`.

    Parameters
    ----------
    space : Space
    lows, highs : array, shape (k,)
        Bounds of every factor, coded; a categorical factor runs from 0 to its last level.
    radius : float
        Numeric coordinates lie in the ball of this radius about the centre.
    constraints : tuple of callable
        Margins as functions of natural points. Linear ones are recognised.
    candidates : array, shape (N, k), optional
        The only points allowed, coded.
    """

    space: Space
    lows: Floats
    highs: Floats
    radius: float = math.inf
    constraints: tuple[Margin, ...] = ()
    candidates: Floats | None = field(default=None, repr=False)

    @cached_property
    def levels(self) -> tuple[Floats, ...]:
        """Per factor the coded values it may take; empty for a continuous factor."""
        found = []
        for j, factor in enumerate(self.space):
            values = factor.domain.allowed
            if factor.domain.is_numeric:
                values = (values - factor.center) / factor.half_range
                values = values[(values >= self.lows[j] - 1e-9) & (values <= self.highs[j] + 1e-9)]
            found.append(values)
        return tuple(found)

    @property
    def irregular(self) -> bool:
        """Whether coordinate lines do not explore it: a list, a ball, curved constraints, equalities."""
        return self.flat or self.candidates is not None or math.isfinite(self.radius) or bool(self.nonlinear)

    @property
    def flat(self) -> bool:
        """Whether its points keep equalities: a mixture, or another sum."""
        return bool(self.space.equalities)

    @cached_property
    def equalities(self) -> tuple[Floats, Floats]:
        """``matrix @ x == values`` in coded units, shapes (e, k) and (e,)."""
        affine = self.space.affine
        if affine is None:
            return np.empty((0, len(self.space))), np.empty(0)
        zero = self.space.decode(np.zeros(len(self.space)))
        length = self.space.decode(np.ones(len(self.space))) - zero
        return affine.matrix * np.where(self.space.numeric, length, 0.0), affine.values - affine.matrix @ zero

    @cached_property
    def groups(self) -> tuple[Group, ...]:
        """The continuous factors of a flat region, those that limits and equalities tie together as one.

        Limits with other factors are not in here.
        """
        normals, offsets = self.halfspaces
        matrix, values = self.equalities
        lines = np.array([j for j, levels in enumerate(self.levels) if not len(levels)], dtype=int)
        own = np.delete(normals, lines, axis=1)
        kept = ~(own != 0.0).any(axis=1)
        labels = [*self.space.names, *self._texts(normals[kept], offsets[kept])]
        labels += [equality.text for equality in self.space.equalities]
        whole = Polytope(self.lows, self.highs, normals[kept], offsets[kept], matrix, values, labels)
        return groups_of(whole, lines)

    def _texts(self, normals: Floats, offsets: Floats) -> list[str]:
        """Limits in words, in natural units."""
        zero = self.space.decode(np.zeros(len(self.space)))
        slopes = normals / np.where(
            self.space.numeric, self.space.decode(np.ones(len(self.space))) - zero, 1.0
        )
        found = []
        for row, offset in zip(slopes, offsets + slopes @ zero, strict=True):
            size = np.abs(row).max(initial=0.0) or 1.0
            rounded = np.round(row / size, 9).tolist()
            left = dict(zip(self.space.names, rounded, strict=True))
            found.append(Equality.of(left, round(offset / size, 9)).text.replace("==", "<="))
        return found

    @cached_property
    def _split(self) -> tuple[Floats, Floats, tuple[Margin, ...]]:
        """Linear constraints as normals and offsets (coded), and the rest."""
        k = len(self.space)
        normals, offsets, rest = [], [], []
        probes = self._raw_sample(64 + k, 0)
        design = np.hstack([np.ones((len(probes), 1)), probes])
        for constraint in self.constraints:
            values = self.margin(constraint, probes)
            slopes, *_ = np.linalg.lstsq(design, values, rcond=None)
            rounding = np.abs(slopes) <= 1e-12 * np.abs(slopes[1:]).max(initial=0.0)
            slopes[1:][rounding[1:]] = 0.0  # or it would tie factors that have nothing to do with each other
            scale = np.abs(values).max()
            if np.isfinite(values).all() and np.abs(design @ slopes - values).max() <= 1e-10 * scale:
                normals.append(-slopes[1:] / scale)
                offsets.append(slopes[0] / scale)
            else:
                rest.append(constraint)
        return np.array(normals).reshape(-1, k), np.array(offsets), tuple(rest)

    @property
    def halfspaces(self) -> tuple[Floats, Floats]:
        """The linear constraints, ``normals @ x <= offsets`` in coded units."""
        return self._split[0], self._split[1]

    @property
    def nonlinear(self) -> tuple[Margin, ...]:
        """The constraints that are not linear."""
        return self._split[2]

    def margin(self, constraint: Margin, coded: Floats) -> Floats:
        """Margins of coded points, shape (n,), of one constraint on natural points."""
        values = np.asarray(constraint(self.space.decode(coded)), float)
        if values.shape != (len(coded),):
            raise RsmkitError(
                f"a design constraint must return one margin per point, shape ({len(coded)},), "
                f"got {values.shape}"
            )
        return values

    def contains(self, coded: ArrayLike, tolerance: float = 1e-9) -> NDArray[np.bool_]:
        """Whether each point is allowed; shape (n,)."""
        points = np.atleast_2d(np.asarray(coded, float))
        inside: NDArray[np.bool_] = np.all(points >= self.lows - tolerance, axis=1)
        inside &= (points <= self.highs + tolerance).all(axis=1)
        if math.isfinite(self.radius):
            lengths = np.sqrt((points[:, self.space.numeric] ** 2).sum(axis=1))
            inside &= lengths <= self.radius * (1.0 + tolerance)
        normals, offsets = self.halfspaces
        inside &= (points @ normals.T <= offsets + tolerance).all(axis=1)
        matrix, values = self.equalities
        inside &= (np.abs(points @ matrix.T - values) <= 1e-9).all(axis=1)
        for constraint in self.nonlinear:
            inside &= self.margin(constraint, points) >= -tolerance
        return inside

    def sample(self, count: int, seed: int) -> Floats:
        """Well-spread allowed points, coded, shape (count, k); discrete factors on their levels.

        Raises
        ------
        RsmkitError
            If (nearly) no point satisfies the constraints.
        """
        if self.candidates is not None:
            rng = np.random.default_rng(seed)
            index = rng.permutation(np.resize(np.arange(len(self.candidates)), count))
            return np.array(self.candidates[index])
        if count == 0:
            return np.empty((0, len(self.space)))
        draws, found = max(64, 2 * count), np.empty((0, len(self.space)))
        while len(found) < count:
            if draws > MOST_DRAWS:
                raise RsmkitError(
                    f"only {len(found)} of {draws // 2} points tried satisfy the design's constraints, "
                    f"{count} are needed; widen the constraints or shrink the factor ranges around them"
                )
            points = self._flat_sample(draws, seed) if self.flat else self._raw_sample(draws, seed)
            found = points[self.contains(points)]
            draws *= 2
        return found[:count]

    @cached_property
    def inner_point(self) -> Floats:
        """An allowed point well inside, coded: of a sample, the one nearest to its mean."""
        points = self.sample(256, 0)
        return np.array(points[((points - points.mean(axis=0)) ** 2).sum(axis=1).argmin()])

    def _raw_sample(self, count: int, seed: int) -> Floats:
        """Points of the box or ball, constraints not looked at."""
        from scipy.stats import norm, qmc

        numeric = self.space.numeric
        k = len(self.space)
        power = max(1, math.ceil(math.log2(count)))
        unit = qmc.Sobol(k + 1, rng=np.random.default_rng(seed)).random_base2(power)[:count]
        points = self.lows + (self.highs - self.lows) * unit[:, :k]
        if math.isfinite(self.radius):
            directions = norm.ppf(np.clip(unit[:, :k][:, numeric], 1e-12, 1.0 - 1e-12))
            lengths = np.sqrt((directions**2).sum(axis=1, keepdims=True))
            reach = self.radius * unit[:, k:] ** (1.0 / numeric.sum())
            points[:, numeric] = reach * directions / lengths
        for j, levels in enumerate(self.levels):
            if len(levels):
                points[:, j] = levels[np.minimum((unit[:, j] * len(levels)).astype(int), len(levels) - 1)]
        return points

    def _flat_sample(self, count: int, seed: int) -> Floats:
        """Points of the box that keep the equalities and the limits of continuous factors."""
        points = self._raw_sample(count, seed)
        unit = (points - self.lows) / (self.highs - self.lows)
        for group in self.groups:
            points[:, group.columns] = group.points(unit[:, group.columns], seed)
        return points

    def nodes(self, most: int, seed: int = 0) -> Floats:
        """Corners, centroids of faces and of the whole of a flat region, with levels of the other factors.

        All combinations if they are no more than `most`, else some of them; coded, shape (n, k).
        """
        parts: list[tuple[NDArray[np.int64], Floats]] = [
            (group.columns, group.nodes((1, 2, 3))) for group in self.groups
        ]
        parts += [(np.array([j]), levels[:, None]) for j, levels in enumerate(self.levels) if len(levels)]
        sizes = [len(values) for _, values in parts]
        if math.prod(sizes) <= most:
            index = np.stack(np.meshgrid(*map(np.arange, sizes), indexing="ij"), axis=-1).reshape(
                -1, len(sizes)
            )
        else:
            rng = np.random.default_rng(seed)
            index = np.stack([rng.permutation(np.resize(np.arange(size), most)) for size in sizes], axis=1)
        points = np.empty((len(index), len(self.space)))
        for place, (columns, values) in enumerate(parts):
            points[:, columns] = values[index[:, place]]
        return points[self.contains(points)]

    @cached_property
    def mixed(self) -> tuple[NDArray[np.int64], ...]:
        """The components of every mixture."""
        names = self.space.names
        return tuple(np.array([names.index(c) for c in m.components]) for m in self.space.mixtures)

    @cached_property
    def directions(self) -> Floats:
        """Ways to go from a point of a flat region, coded, shape (n, k)."""
        found = []
        for group in self.groups:
            ways = np.zeros((len(group.directions), len(self.space)))
            ways[:, group.columns] = group.directions
            found.append(ways)
        return np.vstack([np.empty((0, len(self.space))), *found])

    def sample_for_moments(self) -> Floats | None:
        """Points that stand for the region where no exact average exists; None where one does."""
        if self.candidates is not None:
            return self.candidates
        if self.constraints and not (self.flat and self._exact):
            return self.sample(MOMENT_POINTS, 0)
        if self.flat and any(group.simplices is None for group in self.groups):
            return self.sample(MOMENT_POINTS, 0)
        return None

    @property
    def _exact(self) -> bool:
        """Whether the groups are all there is to the constraints."""
        tied = [
            levels for j, levels in enumerate(self.levels) if len(levels) and self.halfspaces[0][:, j].any()
        ]
        return not self.nonlinear and not tied

    def monomial_means(self, powers: NDArray[np.int64]) -> Floats:
        """Average of ``prod x_j^powers_j`` over the unconstrained box or ball; powers (..., k)."""
        if self.flat:
            return self._flat_means(powers)
        numeric = self.space.numeric
        powers = powers[..., numeric]
        if not math.isfinite(self.radius):
            low, high = self.lows[numeric], self.highs[numeric]
            means = (high ** (powers + 1) - low ** (powers + 1)) / ((powers + 1) * (high - low))
            return np.asarray(means.prod(axis=-1))
        from scipy.special import gammaln

        # Folland (2001), Amer. Math. Monthly 108(5), 446-448, "How to integrate a polynomial over a sphere"
        k, total = int(numeric.sum()), powers.sum(axis=-1)
        log_mean = (
            gammaln((powers + 1) / 2).sum(axis=-1)
            - k * gammaln(0.5)
            + gammaln(k / 2)
            - gammaln((total + k) / 2)
            + np.log(k / (k + total))
        )
        even = (powers % 2 == 0).all(axis=-1)
        return np.where(even, np.exp(log_mean) * self.radius ** total.astype(float), 0.0)

    def _flat_means(self, powers: NDArray[np.int64]) -> Floats:
        """Averages over a flat region: of each group by its simplices, of other numbers over their range."""
        means = np.ones(powers.shape[:-1])
        for group in self.groups:
            asked, place = np.unique(
                powers[..., group.columns].reshape(-1, len(group.columns)), axis=0, return_inverse=True
            )
            assert group.simplices is not None
            means *= group.simplices.means(asked)[place.reshape(-1)].reshape(means.shape)
        for j, levels in enumerate(self.levels):
            if len(levels) and self.space.numeric[j]:
                low, high, power = self.lows[j], self.highs[j], powers[..., j]
                means *= (high ** (power + 1) - low ** (power + 1)) / ((power + 1) * (high - low))
        return means


@checked
def box(space: Space, half_width: float = 1.0, constraints: Sequence[Margin] = ()) -> Region:
    """Every numeric factor within ``+-half_width`` coded units: 1 is the bounds of the study."""
    if not half_width > 0:
        raise RsmkitError(f"region: half_width must be positive, got {half_width:g}")
    numeric, mixed = space.numeric, space.components
    low, high = space.encode(space.lows), space.encode(space.highs)
    return Region(
        space,
        np.where(mixed, low, np.where(numeric, -half_width, 0.0)),
        np.where(mixed, high, np.where(numeric, half_width, space.highs)),
        constraints=tuple(constraints),
    )


@checked
def ball(space: Space, radius: float | None = None, constraints: Sequence[Margin] = ()) -> Region:
    """Numeric factors within the ball through the corners of the bounds, or of the given coded radius."""
    count = int(space.numeric.sum())
    if space.equalities:
        raise RsmkitError(
            "region: a ball about the centre is for factors that vary freely, and "
            f"'{space.equalities[0].text}' ties some together; take region = 'bounds'"
        )
    if count == 0:
        raise RsmkitError("region: a ball needs at least one numeric factor")
    reach = math.sqrt(count) if radius is None else radius
    square = box(space, reach)
    return Region(space, square.lows, square.highs, reach, tuple(constraints))


@checked
def candidate_list(space: Space, points: ArrayLike, constraints: Sequence[Margin] = ()) -> Region:
    """Only the given points, natural units, shape (N, k); those that break a constraint are left out."""
    natural = np.atleast_2d(np.asarray(points, float))
    if natural.ndim != 2 or natural.shape[1] != len(space):
        raise RsmkitError(f"region: candidates must have shape (N, {len(space)}), got {natural.shape}")
    coded = space.encode(natural)
    whole = Region(space, coded.min(axis=0), coded.max(axis=0), constraints=tuple(constraints))
    allowed = np.unique(coded[whole.contains(coded)], axis=0)
    if len(allowed) == 0:
        raise RsmkitError("region: no candidate point satisfies the constraints")
    return Region(space, allowed.min(axis=0), allowed.max(axis=0), candidates=allowed)


def starting_points(region: Region, count: int, seed: int) -> Floats:
    """Points for a search of optimal designs to begin from, coded, shape (count, k).

    The best continuous designs on a box sit on points with a few certain numbers of coordinates at the bounds
    and the others at the centre (Farrell, Kiefer & Walbran 1967, Proc. 5th Berkeley Symp. 1, 113-138). Which
    numbers, and how often each, is drawn anew for every seed, so that different searches begin in different
    basins; a little noise keeps points apart. Where such a point is not allowed, an allowed random one is.
    """
    if region.candidates is not None or region.flat:
        return region.sample(count, seed)
    rng = np.random.default_rng(seed)
    lines = np.array([j for j, levels in enumerate(region.levels) if not len(levels)], dtype=int)
    shares = 0.5 * rng.dirichlet(np.full(len(lines) + 1, 0.5))
    shares[-1] += 0.5
    at_bounds = rng.choice(len(lines) + 1, count, p=shares / shares.sum())
    chosen = rng.permuted(np.tile(np.arange(len(lines)), (count, 1)), axis=1) < at_bounds[:, None]
    coded = np.where(chosen, rng.choice([-1.0, 1.0], chosen.shape), 0.0) + 0.1 * rng.normal(size=chosen.shape)
    points = np.empty((count, len(region.levels)))
    for j, levels in enumerate(region.levels):
        if len(levels):
            points[:, j] = rng.choice(levels, count)
    middle, half = 0.5 * (region.highs + region.lows)[lines], 0.5 * (region.highs - region.lows)[lines]
    points[:, lines] = middle + half * np.clip(coded, -1.0, 1.0)
    allowed = region.contains(points)
    if not allowed.all():
        points[~allowed] = region.sample(count, seed)[~allowed]
    return points


def placed(space: Space, coded: Floats) -> Floats:
    """Coded points as ones the factors can take, natural units; equalities hold to rounding."""
    natural = space.snap(space.decode(coded))
    if space.affine is None:
        return natural
    for bound in (space.lows, space.highs):  # the projection leaves what lies on a bound there
        natural = np.where(np.abs(natural - bound) <= 1e-12 * (space.highs - space.lows), bound, natural)
    return space.affine.project(natural)
