"""Numbers behind the pictures of a surface: perturbation curves and contour grids."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import ArrayLike

from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.language.space import Floats, Space
from rsmkit.surfaces.models.surface import Surface
from rsmkit.surfaces.statistics.mixtures.directions import reference_point

__all__ = ["contour_grid", "perturbation_curves", "refuse_mixture"]


@checked
def perturbation_curves(
    surface: Surface, at: ArrayLike | None = None, points: int = 41
) -> Mapping[str, tuple[Floats, Floats]]:
    """Vary one factor at a time through a reference point, between its bounds.

    Parameters
    ----------
    surface : Surface
    at : array, shape (k,), optional
        Reference point, natural units; the centre by default.
    points : int
        Per curve (the levels of a categorical factor instead).

    Returns
    -------
    dict of str to (values, predictions)
        Per factor, two arrays of the same length.
    """
    space = surface.space
    reference = _reference(space, at)
    curves = {}
    refuse_mixture(space, space.names)
    for j, factor in enumerate(space):
        values = factor.domain.curve(points)
        line = np.tile(reference, (len(values), 1))
        line[:, j] = values
        curves[factor.name] = (values, surface.predict(line))
    return curves


@checked
def contour_grid(
    surface: Surface, across: str, up: str, at: ArrayLike | None = None, points: int = 61
) -> tuple[Floats, Floats, Floats]:
    """Predictions on a grid of two numeric factors, the others held.

    Parameters
    ----------
    across, up : str
        Names of the factors.
    at : array, shape (k,), optional
        Values of the other factors, natural units; the centre by default.

    Returns
    -------
    x : array, shape (points,)
    y : array, shape (points,)
    z : array, shape (points, points)
        ``z[i, j]`` belongs to ``x[j]`` and ``y[i]``, as matplotlib's contour expects.
    """
    space = surface.space
    refuse_mixture(space, (across, up))
    for name in (across, up):
        if name not in space.names or not space[name].domain.is_numeric:
            raise RsmkitError(
                f"a contour grid needs two numeric factors of {', '.join(space.names)}; got {name}"
            )
    if across == up:
        raise RsmkitError(f"a contour grid needs two different factors; got {across} twice")
    x = np.linspace(space[across].low, space[across].high, points)
    y = np.linspace(space[up].low, space[up].high, points)
    grid = np.tile(_reference(space, at), (points * points, 1))
    grid[:, space.names.index(across)] = np.tile(x, points)
    grid[:, space.names.index(up)] = np.repeat(y, points)
    return x, y, surface.predict(grid).reshape(points, points)


def refuse_mixture(space: Space, names: Iterable[str]) -> None:
    """Refuse to move components of a mixture one at a time.

    Raises
    ------
    RsmkitError
        If one of the factors is a component, with what shows it instead.
    """
    moved = {*names} & {name for mixture in space.mixtures for name in mixture.components}
    if moved:
        raise RsmkitError(
            f"{', '.join(name for name in space.names if name in moved)} cannot be changed with the other "
            "components held, since these add up to a constant; plots.ternary and plots.trace show mixtures"
        )


def _reference(space: Space, at: ArrayLike | None) -> Floats:
    if at is None and space.mixtures:
        return reference_point(space, None)
    if at is None:
        return space.clip(np.where(space.numeric, 0.5 * (space.lows + space.highs), 0.0))
    reference = np.asarray(at, float)
    if reference.shape != (len(space),):
        raise RsmkitError(f"the reference point needs {len(space)} values, got shape {reference.shape}")
    return reference
