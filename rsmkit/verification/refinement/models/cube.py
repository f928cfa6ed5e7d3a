"""Factors as a search moves them: numbers from 0 to 1 between the bounds, categories as an index."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rsmkit.language.space import Floats, Space

__all__ = ["Box", "Cube"]


@dataclass(frozen=True)
class Box:
    """A part of the cube, corners of shape (k,); its categories are fixed.

    Parameters
    ----------
    low, high : array, shape (k,)
        Equal for categories.
    """

    low: Floats
    high: Floats

    def clip(self, unit: Floats) -> Floats:
        """Move points into the box."""
        return np.asarray(np.clip(unit, self.low, self.high))


@dataclass(frozen=True)
class Cube:
    """The space in coordinates that compare.

    Parameters
    ----------
    space : Space
        The factors.
    """

    space: Space

    def __len__(self) -> int:
        return len(self.space)

    @cached_property
    def categorical(self) -> NDArray[np.bool_]:
        """Which coordinates are categories, shape (k,)."""
        return ~self.space.numeric

    @cached_property
    def stepped(self) -> NDArray[np.bool_]:
        """Which coordinates are numbers that take only some values, shape (k,)."""
        return np.array([f.domain.is_numeric and not f.domain.is_continuous for f in self.space])

    def unit(self, natural: Floats) -> Floats:
        """From natural units, shape (n, k) or (k,); outside 0..1 for runs outside the bounds."""
        space = self.space
        return np.asarray(
            np.where(self.categorical, natural, (natural - space.lows) / (space.highs - space.lows))
        )

    def natural(self, unit: Floats) -> Floats:
        """To the nearest allowed natural point inside the bounds."""
        space = self.space
        inside = np.clip(unit, 0.0, self._top)
        wide = np.where(self.categorical, inside, (1.0 - inside) * space.lows + inside * space.highs)
        return space.clip(space.snap(wide))

    def snapped(self, unit: Floats) -> Floats:
        """The nearest allowed points."""
        return self.unit(self.natural(unit))

    def apart(self, a: Floats, b: Floats) -> Floats:
        """Largest difference of a coordinate of points (p, k) and (n, k); inf where a category differs."""
        found = np.zeros((len(a), len(b)))
        for j, categorical in enumerate(self.categorical):
            step = np.abs(a[:, None, j] - b[None, :, j])
            np.maximum(found, np.where(step > 0, np.inf, 0.0) if categorical else step, out=found)
        return found

    def whole(self, center: Floats) -> Box:
        """All numbers, with the categories of a point."""
        return Box(np.where(self.categorical, center, 0.0), np.where(self.categorical, center, 1.0))

    def around(self, center: Floats, half_width: float) -> Box:
        """Within `half_width` of a point; the next levels of stepped factors stay in it."""
        if half_width >= 1:
            return self.whole(center)
        x = self.space.clip(self.natural(center))
        corners = []
        for factor, value, u in zip(self.space, x.tolist(), center.tolist(), strict=True):
            if not factor.domain.is_numeric:
                corners.append((u, u))
            elif factor.domain.is_continuous:
                corners.append((max(0.0, min(u, 1.0) - half_width), min(1.0, max(u, 0.0) + half_width)))
            else:
                part = factor.domain.narrowed(value, half_width)
                width = factor.high - factor.low
                corners.append(((part.low - factor.low) / width, (part.high - factor.low) / width))
        low, high = np.array(corners).T
        return Box(low, high)

    def sample(self, box: Box, count: int, seed: int, *, categories: bool = False) -> Floats:
        """Quasi-random allowed points of a box, with all `categories` or those of the box; (count, k)."""
        from scipy.stats import qmc  # takes half a second to import

        unit = qmc.Sobol(len(self), rng=seed).random_base2(max(1, int(np.ceil(np.log2(count)))))[:count]
        points = box.low + unit * (box.high - box.low)
        if self.space.affine is not None and (box.high - box.low)[self.space.affine.involved].min() >= 1:
            even = self.unit(self.space.spread(unit))  # where projecting would crowd them on the edges
            points = np.where(self.categorical, points, even)
        if categories:
            for j in np.flatnonzero(self.categorical):
                points[:, j] = self.space.factors[j].domain.from_unit(unit[:, j])
        return self.snapped(points)

    @cached_property
    def _top(self) -> Floats:
        return np.where(self.categorical, np.inf, 1.0)
