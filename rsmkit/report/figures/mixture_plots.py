"""Figures of mixtures: contours on a triangle, and traces of components."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from rsmkit.errors import RsmkitError
from rsmkit.language.space import Floats, Space
from rsmkit.report.figures.axes import DATA, NOW, one_axes
from rsmkit.surfaces.models.surface import Surface
from rsmkit.surfaces.statistics.mixtures.directions import Direction, reference_point, trace_curves

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["ternary", "trace"]

HEIGHT = np.sqrt(0.75)
"""Of a triangle with sides of one."""
STEPS = 100
"""Triangles along each side."""
SAME = 0.02
"""Share of the range of a factor within which a run counts as at the value held."""
GRID = (0.2, 0.4, 0.6, 0.8)
"""Shares at which lines are drawn across the triangle."""


def ternary(
    surface: Surface,
    components: Sequence[str] | None = None,
    *,
    at: ArrayLike | None = None,
    levels: int | Sequence[float] = 12,
    points: ArrayLike | None = None,
    optimum: ArrayLike | None = None,
    whole: bool = False,
    ax: Axes | None = None,
) -> Axes:
    """Draw lines of equal response over three components of a mixture, the others held.

    Colour fills the region that the bounds allow. The corners are blends in which one of the three takes all
    that the least amounts of the others leave, or all there is of them in a whole triangle.

    Parameters
    ----------
    surface : Surface
        Of any kind, on a space with a mixture.
    components : sequence of str, optional
        Three of them; the first three by default. The first is at the top, the second to the left.
    at : array, shape (k,), optional
        Blend and settings that give the amounts of the components held and the values of other factors,
        natural units; the mean of the corners of the region by default.
    levels : int or sequence of float
        How many lines, or where.
    points : array, shape (n, k), optional
        Runs to mark: those with as much of the components held, and other factors at the same values, filled,
        the others empty, by the proportions of the three.
    optimum : array, shape (k,), optional
        Blend to mark with a star.
    whole : bool
        Whether the triangle is drawn down to nothing of a component, whatever its least amount.

    Raises
    ------
    RsmkitError
        If the space has no mixture, or the components are not three of one.
    """
    from matplotlib.patches import Polygon
    from matplotlib.ticker import MaxNLocator
    from matplotlib.tri import Triangulation

    ax = one_axes(ax)
    space = surface.space
    reference = reference_point(space, at)
    triangle = _triangle(space, _three(space, components), reference, whole=whole)
    shares, triangles = _mesh()
    blends = np.tile(reference, (len(shares), 1))
    blends[:, triangle.places] = triangle.amounts(shares)
    region = triangle.region(space)
    values, inside = surface.predict(blends), triangle.holds(space, shares)
    if len(region) and inside.any() and np.ptp(values[inside]) > 0:
        x, y = _flat(shares).T
        mesh = Triangulation(x, y, triangles)
        ends = float(values[inside].min()), float(values[inside].max())
        lines_at = MaxNLocator(levels).tick_values(*ends) if isinstance(levels, int) else list(levels)
        filled = ax.tricontourf(mesh, values, levels=lines_at, cmap="viridis", alpha=0.9)
        lines = ax.tricontour(mesh, values, levels=lines_at, colors="white", linewidths=0.6)
        outline = Polygon(_flat(region), closed=True, transform=ax.transData)
        for drawn in (filled, lines):
            drawn.set_clip_path(outline)
        labels = [
            i for i, level in enumerate(lines.levels) if values[inside].min() < level < values[inside].max()
        ]
        ax.clabel(lines, np.asarray(lines.levels)[labels], fontsize=7, colors="white")
    _frame(ax, space, triangle)
    if len(region):
        ax.fill(*_flat(region).T, fill=False, edgecolor=DATA, linewidth=1.4, zorder=3)
    if points is not None:
        _runs(ax, space, np.asarray(points, float), triangle, reference)
    if optimum is not None:
        best = triangle.shares(np.asarray(optimum, float)[None, triangle.places])
        ax.plot(*_flat(best).T, "*", ms=13, color=NOW, mec="white", zorder=5, clip_on=False)
    ax.set_title(_title(surface, triangle.places, reference), fontsize=9)
    return ax


def trace(
    surface: Surface,
    *,
    at: ArrayLike | None = None,
    direction: Direction = "cox",
    ax: Axes | None = None,
) -> Axes:
    """Draw the response while one component after the other moves and the rest give way.

    Parameters
    ----------
    surface : Surface
        Of any kind, on a space with a mixture.
    at : array, shape (k,), optional
        Reference blend with settings of other factors, natural units; the mean of the corners by default.
    direction : {"cox", "piepel"}
        Whether the others keep the proportions of their amounts, or those of their pseudo-components.
    """
    ax = one_axes(ax)
    space = surface.space
    start = reference_point(space, at)
    for name, (amounts, response) in trace_curves(surface, start, direction).items():
        factor = space[name]
        ax.plot(amounts - start[space.names.index(name)], response, label=factor.label or name)
    ax.axvline(0.0, color=NOW, linewidth=0.9, linestyle="--")
    word = {"cox": "Cox", "piepel": "Piepel"}[direction]
    ax.set(xlabel=f"amount less that of the reference blend ({word} direction)", ylabel=surface.response)
    ax.legend(frameon=False, fontsize=8)
    return ax


@dataclass(frozen=True)
class _Triangle:
    """Three components that share an amount: `base` of each at the sides, `span` more at the corners."""

    places: list[int]
    base: Floats
    span: float

    def amounts(self, shares: Floats) -> Floats:
        """Natural units, shape (n, 3), of shares of the corners."""
        return np.asarray(self.base + shares * self.span)

    def shares(self, amounts: Floats) -> Floats:
        """Shares of the corners, shape (n, 3); other sums are brought to that of the triangle."""
        whole = self.span + self.base.sum()
        return np.asarray((amounts * (whole / amounts.sum(axis=1, keepdims=True)) - self.base) / self.span)

    def holds(self, space: Space, shares: Floats) -> np.ndarray:
        """Whether blends keep to the bounds, shape (n,)."""
        amounts, slack = self.amounts(shares), 1e-9 * self.span
        low, high = space.lows[self.places] - slack, space.highs[self.places] + slack
        return np.asarray(((amounts >= low) & (amounts <= high)).all(axis=1))

    def region(self, space: Space) -> Floats:
        """Corners of the polygon that the bounds leave, as shares, shape (m, 3)."""
        corners = np.eye(3)
        for j, place in enumerate(self.places):
            low, high = (np.array([space.lows[place], space.highs[place]]) - self.base[j]) / self.span
            corners = _cut(_cut(corners, np.eye(3)[j], low), -np.eye(3)[j], -high)
        return corners


def _triangle(space: Space, places: list[int], reference: Floats, *, whole: bool) -> _Triangle:
    shared, base = float(reference[places].sum()), np.maximum(space.lows[places], 0.0)
    if whole or shared - base.sum() <= 0:
        base = np.zeros(3)
    if shared <= 0:
        raise RsmkitError("ternary: the components held leave nothing for these three; choose another blend")
    return _Triangle(places, base, shared - float(base.sum()))


def _three(space: Space, components: Sequence[str] | None) -> list[int]:
    """Columns of three components of one mixture."""
    for mixture in space.mixtures:
        named = list(components or mixture.components[:3])
        if len(set(named)) == 3 and set(named) <= set(mixture.components):
            return [space.names.index(name) for name in named]
    listed = "; ".join(", ".join(mixture.components) for mixture in space.mixtures)
    raise RsmkitError(f"ternary: name three components of one mixture ({listed})")


def _mesh() -> tuple[Floats, np.ndarray]:
    """Shares at the nodes of small triangles, shape (n, 3), and the nodes of each, shape (m, 3)."""
    place: dict[tuple[int, int], int] = {}
    shares: list[tuple[int, int, int]] = []
    for i in range(STEPS + 1):
        for j in range(STEPS + 1 - i):
            place[i, j] = len(shares)
            shares.append((i, j, STEPS - i - j))
    triangles = []
    for i, j in place:
        if i + j < STEPS:
            triangles.append((place[i, j], place[i + 1, j], place[i, j + 1]))
        if i + j < STEPS - 1:
            triangles.append((place[i + 1, j], place[i + 1, j + 1], place[i, j + 1]))
    return np.array(shares) / STEPS, np.array(triangles)


def _flat(shares: Floats) -> Floats:
    """Shares of top, left and right corner to the page, shape (n, 2)."""
    return np.column_stack([0.5 * shares[:, 0] + shares[:, 2], HEIGHT * shares[:, 0]])


def _cut(corners: Floats, normal: Floats, bound: float) -> Floats:
    """Part of a convex polygon with ``normal @ x >= bound`` (Sutherland & Hodgman, *Comm. ACM* 17, 1974)."""
    kept: list[Floats] = []
    room = corners @ normal - bound
    for i in range(len(corners)):
        a, b = corners[i], corners[(i + 1) % len(corners)]
        from_a, from_b = room[i], room[(i + 1) % len(corners)]
        if from_a >= 0:
            kept.append(a)
        if (from_a > 0 > from_b) or (from_a < 0 < from_b):
            kept.append(a + (b - a) * from_a / (from_a - from_b))
    return np.array(kept).reshape(-1, 3)


def _frame(ax: Axes, space: Space, triangle: _Triangle) -> None:
    """The triangle with its lines, amounts along the sides, and the names at the corners."""
    ax.set_aspect("equal")
    ax.axis("off")
    ax.set(xlim=(-0.16, 1.16), ylim=(-0.14, HEIGHT + 0.12))
    ax.fill(*_flat(np.eye(3)).T, fill=False, edgecolor=DATA, linewidth=0.9, zorder=2)
    beside = ((-0.02, 0.0, "right", "center"), (0.0, -0.025, "center", "top"), (0.02, 0.01, "left", "center"))
    for share in GRID:
        for j, (right, up, across, along) in enumerate(beside):
            ends = np.zeros((2, 3))
            ends[:, j] = share
            ends[0, (j + 1) % 3], ends[1, (j + 2) % 3] = 1.0 - share, 1.0 - share
            ax.plot(*_flat(ends).T, color=DATA, linewidth=0.4, alpha=0.3, zorder=2)
            x, y = _flat(ends[:1])[0]
            text = f"{triangle.base[j] + share * triangle.span:.3g}"
            ax.text(x + right, y + up, text, fontsize=7, color=DATA, alpha=0.7, ha=across, va=along)
    spots = ((0.5, HEIGHT + 0.03, "bottom"), (-0.02, -0.06, "top"), (1.02, -0.06, "top"))
    for place, (x, y, along) in zip(triangle.places, spots, strict=True):
        ax.text(x, y, space.factors[place].title, fontsize=9, ha="center", va=along)


def _runs(ax: Axes, space: Space, points: Floats, triangle: _Triangle, reference: Floats) -> None:
    """Mark runs by the proportions of the three; those that the triangle does not pass through are empty."""
    shown = points[points[:, triangle.places].sum(axis=1) > 0]
    shares = triangle.shares(shown[:, triangle.places])
    others = [j for j in range(len(space)) if j not in triangle.places]
    apart = np.abs(shown - reference)[:, others] / (space.highs - space.lows)[others]
    here, seen = (apart <= SAME).all(axis=1), (shares >= -1e-9).all(axis=1)
    for chosen, colour in ((seen & ~here, "none"), (seen & here, "white")):
        ax.plot(*_flat(shares[chosen]).T, "o", ms=4.5, color=colour, mec=DATA, zorder=4, clip_on=False)


def _title(surface: Surface, places: list[int], reference: Floats) -> str:
    held = [
        f"{f.label or f.name} = {value if isinstance(value, str) else format(value, '.4g')}"
        for j, f in enumerate(surface.space)
        if j not in places
        for value in [f.value(float(reference[j]))]
    ]
    return f"{surface.response} at {', '.join(held)}" if held else surface.response
