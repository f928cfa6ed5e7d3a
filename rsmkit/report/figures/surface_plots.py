"""Figures of fitted surfaces: contours, perspective, perturbation, effects, profiles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from rsmkit.errors import RsmkitError
from rsmkit.language.space import Factor, Floats, Space
from rsmkit.report.figures.axes import BAND, DATA, MODEL, NOW, axes_grid, name_levels, one_axes, wrapped
from rsmkit.surfaces.models.surface import Surface
from rsmkit.surfaces.statistics.mixtures.directions import component_lines, reference_point
from rsmkit.surfaces.statistics.views import contour_grid, perturbation_curves, refuse_mixture

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["contours", "interactions", "main_effects", "perturbation", "profiler", "surface_3d"]

AVERAGED = 512
"""Points of the box over which main effects are averaged."""


def contours(
    surface: Surface,
    across: str,
    up: str,
    *,
    at: ArrayLike | None = None,
    levels: int | Sequence[float] = 12,
    points: ArrayLike | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw lines of equal response over two factors, the others held.

    Parameters
    ----------
    surface : Surface
    across, up : str
        Names of two numeric factors.
    at : array, shape (k,), optional
        Values of the other factors, natural units; the centre by default.
    levels : int or sequence of float
        How many lines, or where.
    points : array, shape (n, k), optional
        Runs to mark.
    """
    ax = one_axes(ax)
    x, y, z = contour_grid(surface, across, up, at)
    filled = ax.contourf(x, y, z, levels=levels, cmap="viridis", alpha=0.9)
    lines = ax.contour(x, y, z, levels=filled.levels, colors="white", linewidths=0.6)
    ax.clabel(lines, fontsize=7, colors="white")
    names = surface.space.names
    if points is not None:
        runs = np.asarray(points, float)[:, [names.index(across), names.index(up)]]
        ends = np.array([[surface.space[name].low, surface.space[name].high] for name in (across, up)])
        inside = runs[((runs >= ends[:, 0]) & (runs <= ends[:, 1])).all(axis=1)]
        ax.plot(*inside.T, "o", ms=4, color="white", mec=DATA, clip_on=False, zorder=3)
    ax.set(xlabel=surface.space[across].title, ylabel=surface.space[up].title, title=surface.response)
    ax.set_xlim(surface.space[across].low, surface.space[across].high)
    ax.set_ylim(surface.space[up].low, surface.space[up].high)
    return ax


def surface_3d(surface: Surface, across: str, up: str, *, at: ArrayLike | None = None, ax: Any = None) -> Any:
    """Draw the response over two factors in perspective; `ax` needs ``projection="3d"``."""
    ax = one_axes(ax, "3d")
    if not hasattr(ax, "plot_surface"):
        raise RsmkitError("surface_3d needs three-dimensional axes: figure.add_subplot(projection='3d')")
    x, y, z = contour_grid(surface, across, up, at, points=41)
    ax.plot_surface(*np.meshgrid(x, y), z, cmap="viridis", linewidth=0.2, edgecolor="white", alpha=0.95)
    ax.set(xlabel=surface.space[across].title, ylabel=surface.space[up].title, zlabel=surface.response)
    ax.set_box_aspect(None, zoom=0.85)
    for axis in (ax.xaxis, ax.yaxis, ax.zaxis):
        axis.get_major_locator().set_params(nbins=5)  # seen from aside, more numbers lie on one another
    return ax


def perturbation(surface: Surface, *, at: ArrayLike | None = None, ax: Axes | None = None) -> Axes:
    """Draw the response along each numeric factor through one point, all on one coded axis."""
    ax = one_axes(ax)
    space = surface.space
    for name, (values, response) in perturbation_curves(surface, at).items():
        factor = space[name]
        if factor.domain.is_numeric:
            ax.plot((values - factor.center) / factor.half_range, response, label=factor.label or name)
    ax.set(xlabel="coded units (-1 low, 1 high)", ylabel=surface.response)
    outside: dict[str, Any] = {"loc": "upper left", "bbox_to_anchor": (1.0, 1.0)} if len(space) > 5 else {}
    ax.legend(frameon=False, fontsize=8, **outside)
    return ax


def main_effects(surface: Surface, *, ax: Any = None) -> Any:
    """Draw the response against each factor, averaged over all others in the box; an array of axes."""
    space = surface.space
    refuse_mixture(space, space.names)
    ax = axes_grid(ax, 1, len(space), sharey=True)
    others = _spread(space)
    for j, factor in enumerate(space):
        panel = ax[0, j]
        values = factor.domain.curve(21)
        averages = [surface.predict(_with_column(others, j, value)).mean() for value in values]
        panel.plot(values, averages, color=MODEL, marker="o" if factor.levels else "")
        name_levels(panel.xaxis, factor)
        panel.set_xlabel(wrapped(factor.title), fontsize=8)
        panel.grid(alpha=0.25)
    ax[0, 0].set_ylabel(wrapped(f"mean {surface.response}", 28))
    return ax


def interactions(
    surface: Surface, across: str, by: str, *, at: ArrayLike | None = None, ax: Axes | None = None
) -> Axes:
    """Draw the response along one factor at the ends (or levels) of another: parallel without interaction."""
    ax = one_axes(ax)
    space = surface.space
    refuse_mixture(space, (across, by))
    reference = _reference(space, at)
    factor, other = space[across], space[by]
    ends = other.domain.curve(2)
    for end, label in zip(ends, _texts(other, ends), strict=True):
        values = factor.domain.curve(41)
        line = np.tile(reference, (len(values), 1))
        line[:, space.names.index(across)] = values
        line[:, space.names.index(by)] = end
        text = label if isinstance(label, str) else f"{label:g} {other.unit}".strip()
        ax.plot(_texts(factor, values), surface.predict(line), label=text)
    ax.legend(title=other.label or by, frameon=False, fontsize=8, title_fontsize=8)
    ax.set(xlabel=factor.title, ylabel=surface.response)
    return ax


def profiler(
    surfaces: Mapping[str, Surface],
    at: ArrayLike | None = None,
    *,
    interval: float = 0.95,
    ax: Any = None,
) -> Any:
    """Draw every response against every factor through one point, with prediction intervals.

    A component of a mixture moves along its Cox direction: the others give way in proportion.

    Parameters
    ----------
    surfaces : mapping of str to Surface
        By response, all of the same factors.
    at : array, shape (k,), optional
        The point, natural units; the centre by default.
    interval : float
        Confidence of the bands.
    ax : array of Axes, optional
        As many as responses times factors.

    Returns
    -------
    array of Axes, shape (responses, factors)
    """
    if not surfaces:
        raise RsmkitError("profiler: there is no surface to draw")
    space = next(iter(surfaces.values())).space
    point = _reference(space, at)
    lines = component_lines(space, point)
    ax = axes_grid(ax, len(surfaces), len(space), sharey="row", sharex="col")
    for row, (name, surface) in zip(ax, surfaces.items(), strict=True):
        now = surface.predict(point[None])[0]
        for j, (panel, factor) in enumerate(zip(row, space, strict=True)):
            values = factor.domain.curve(41)
            line = _with_column(np.tile(point, (len(values), 1)), j, values)
            line = lines.get(factor.name, line)
            values = line[:, j]
            mean, low, high = surface.predict(line, interval)
            panel.fill_between(values, low, high, color=BAND, alpha=0.5, linewidth=0)
            panel.plot(values, mean, color=MODEL)
            panel.axvline(point[j], color=NOW, linewidth=0.9, linestyle="--")
            panel.axhline(now, color=NOW, linewidth=0.9, linestyle="--")
            name_levels(panel.xaxis, factor)
        row[0].set_ylabel(f"{wrapped(name)}\n{now:.4g}", fontsize=8)
    for panel, factor, value in zip(ax[-1], space, point, strict=True):
        text = factor.value(value)
        panel.set_xlabel(
            f"{wrapped(factor.title)}\n{text if isinstance(text, str) else f'{text:.4g}'}", fontsize=8
        )
    return ax


def _reference(space: Space, at: ArrayLike | None) -> Floats:
    if space.mixtures:
        return reference_point(space, at)
    if at is None:
        return space.clip(np.where(space.numeric, 0.5 * (space.lows + space.highs), 0.0))
    point = np.asarray(at, float)
    if point.shape != (len(space),):
        raise RsmkitError(f"the point needs {len(space)} values, one per factor; got shape {point.shape}")
    return point


def _texts(factor: Factor, values: Floats) -> list[Any]:
    """Coordinates as axis values: the texts of categorical levels."""
    return [float(v) if factor.domain.is_numeric else factor.value(v) for v in values]


def _with_column(points: Floats, j: int, values: float | Floats) -> Floats:
    changed = points.copy()
    changed[:, j] = values
    return changed


def _spread(space: Space) -> Floats:
    """Evenly spread points of the box (Sobol), the same every time."""
    from scipy.stats import qmc

    unit = qmc.Sobol(len(space), rng=np.random.default_rng(0)).random(AVERAGED)
    levels = np.array([factor.domain.categories for factor in space])
    natural = np.where(levels > 0, np.floor(unit * levels), space.lows + unit * (space.highs - space.lows))
    return space.clip(space.snap(natural))
