"""The part of the space that a refinement looks at: how it moves, shrinks, and is left for another."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from rsmkit.language.space import Floats
from rsmkit.verification.refinement.models.cube import Cube

__all__ = ["Basins", "Region"]

FIRST, LARGEST, SMALLEST = 0.25, 0.5, 5e-4
SECOND = 0.125
"""Of a region around a run that is not the best."""
BASIN = 0.15
"""Runs within this distance of a closed basin belong to it."""


@dataclass(frozen=True)
class Region:
    """Around the best run, half as wide as `half_width`, in ranges of the factors; 1 is the whole box."""

    half_width: float = 1.0
    secondary: bool = False

    def after(
        self, *, step: float, gain: float, promised: float, enough: bool, tried: bool, batch: int
    ) -> tuple[Region, str]:
        """Apply the rules.

        Parameters
        ----------
        step : float
            From the old centre to the new.
        gain, promised : float
            True and predicted; the latter nan when nothing feasible was predicted.
        enough : bool
            Whether the region holds enough runs for its models to be trusted.
        tried : bool
            Whether a local model's proposal was run.
        batch : int
            Runs in the wave.
        """
        width = self.half_width
        if width >= 1:
            return replace(self, half_width=FIRST), "now around the best point"
        if gain > 0:
            if step > 1.05 * width:
                return Region(max(width, SECOND)), "region moved to another place"
            if promised > 0 and gain > 0.75 * promised and step > 0.9 * width:
                return replace(self, half_width=min(LARGEST, 1.6 * width)), "region moved and enlarged"
            if step < 0.5 * width and not gain >= 0.5 * promised:
                return replace(self, half_width=max(SMALLEST, 0.5 * width)), "region moved and halved"
            return self, "region moved"
        if not tried:
            return self, "kept"
        if not enough:
            return self, "kept, too few points in it to trust a model"
        return replace(self, half_width=max(SMALLEST, width * (0.6 if batch == 1 else 0.4))), "region shrunk"

    def gain(self, cube: Cube, unit: Floats, merit: Floats, row: int, noise: float) -> float:
        """By how much the best run within the region is better than that of a row, its centre before.

        Parameters
        ----------
        cube : Cube
            Coordinates.
        unit, merit : arrays, shapes (n, k) and (n,)
            Runs and what they are worth: less is better.
        row : int
            Of the centre.
        noise : float
            A gain within that is none.
        """
        near = cube.apart(unit, unit[[row]])[:, 0] <= max(1.05 * self.half_width, 1e-9)
        gain = float(merit[row]) - float(merit[near].min())
        return gain if math.isfinite(gain) and gain > noise else 0.0


@dataclass
class Basins:
    """Places where the models promise nothing more, waves in a row.

    Parameters
    ----------
    cube : Cube
        Coordinates.
    """

    cube: Cube
    closed: list[Floats] = field(default_factory=list)

    def close(self, center: Floats) -> None:
        """Leave a place alone from now on."""
        self.closed.append(center)

    def open_rows(self, unit: Floats) -> NDArray[np.bool_]:
        """Which points, shape (n, k), belong to none; shape (n,)."""
        if not self.closed:
            return np.ones(len(unit), bool)
        return np.asarray(self.cube.apart(unit, np.array(self.closed)).min(axis=1) > BASIN, bool)
