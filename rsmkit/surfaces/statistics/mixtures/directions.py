"""What a component does while the others give way: Cox's and Piepel's directions, effects and traces.

Along the Cox direction of a component the others keep their proportions to each other as they are in a
reference blend; along Piepel's they keep those of the pseudo-components, so that the path leads from a wall
of a restricted region to the corner across. Cox, *Biometrika* 58 (1971), 155-159; Piepel, *Technometrics* 24
(1982), 29-39.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.io.shown import Shown
from rsmkit.language.space import Floats, Space
from rsmkit.surfaces.estimation.least_squares import two_sided_p
from rsmkit.surfaces.models.polynomial import PolynomialSurface
from rsmkit.surfaces.models.surface import Surface
from rsmkit.surfaces.statistics.mixtures.components import component_bounds, reference_blend

__all__ = [
    "ComponentEffect",
    "Direction",
    "component_effects",
    "component_lines",
    "reference_point",
    "trace_curves",
]

Direction = Literal["cox", "piepel"]

EDGE = 1e-12
"""Room left to a bound, as a share of the total, that is rounding."""


@dataclass(frozen=True)
class ComponentEffect(Shown):
    """What one component does along its direction.

    Parameters
    ----------
    component : str
    low, high : float
        Amounts between which the path stays inside the bounds, natural units.
    gradient : float
        Change of the response per proportion of one (per total) at the reference blend; of counts on the
        scale of the link.
    std_error, t, p : float
        Of the gradient.
    effect : float
        Prediction at `high` minus that at `low`.
    """

    component: str
    low: float
    high: float
    gradient: float
    std_error: float
    t: float
    p: float
    effect: float


@checked
def component_effects(
    surface: PolynomialSurface, reference: ArrayLike | None = None, direction: Direction = "cox"
) -> list[ComponentEffect]:
    """Effect of every component of a mixture.

    Parameters
    ----------
    surface : PolynomialSurface
        With Scheffe terms.
    reference : array, shape (k,), optional
        Blend, and settings of other factors, natural units; by default the mean of the corners of the region
        with other factors at their centres.
    direction : {"cox", "piepel"}

    Raises
    ------
    RsmkitError
        If the surface is no model of a mixture, or the reference is none.
    """
    found = []
    start = reference_point(surface.space, reference)
    for place, total, along in _directions(surface.space, start, direction):
        low, high = _reach(surface.space, start, along)
        step = total * along
        slopes = surface.coordinates.slopes(start[None])[0] * step
        row = surface.terms.gradient(surface.coordinates.forward(start[None]))[0] @ slopes
        gradient, error, df = surface.judged(row)
        t = gradient / error if error > 0 and not surface.fit.exact else float("nan")
        ends = surface.predict(np.array([start + low * along, start + high * along]))
        found.append(
            ComponentEffect(
                surface.space.names[place],
                float(start[place] + low),
                float(start[place] + high),
                gradient,
                error,
                t,
                float(two_sided_p(np.array([t]), df)[0]),
                float(ends[1] - ends[0]),
            )
        )
    return found


@checked
def trace_curves(
    surface: Surface,
    reference: ArrayLike | None = None,
    direction: Direction = "cox",
    points: int = 41,
) -> Mapping[str, tuple[Floats, Floats]]:
    """Predictions while one component after the other moves and the rest give way, inside the bounds.

    Parameters
    ----------
    surface : Surface
        Of any kind, on a space with a mixture.
    reference, direction
        See :func:`component_effects`.
    points : int
        Per curve.

    Returns
    -------
    dict of str to (amounts, predictions)
        Per component, two arrays of shape (points,); natural units.
    """
    space = surface.space
    lines = component_lines(space, reference_point(space, reference), direction, points)
    return {name: (line[:, space.names.index(name)], surface.predict(line)) for name, line in lines.items()}


def component_lines(
    space: Space, start: Floats, direction: Direction = "cox", points: int = 41
) -> dict[str, Floats]:
    """Blends along the direction of each component, inside the bounds, shape (points, k) each.

    Parameters
    ----------
    space : Space
    start : array, shape (k,)
        Where the lines cross, natural units.
    direction : {"cox", "piepel"}
    points : int
        Per line.
    """
    lines = {}
    for place, _, along in _directions(space, start, direction):
        low, high = _reach(space, start, along)
        lines[space.names[place]] = start + np.linspace(low, high, points)[:, None] * along
    return lines


def reference_point(space: Space, reference: ArrayLike | None) -> Floats:
    """The reference blend with other factors at their centres, shape (k,), or the one given.

    Raises
    ------
    RsmkitError
        If there is no mixture, or the reference does not add up.
    """
    if not space.mixtures:
        raise RsmkitError("there is no mixture among these factors: its components trade off, others do not")
    if reference is None:
        point = np.where(space.numeric, 0.5 * (space.lows + space.highs), 0.0)
        for mixture in space.mixtures:
            places = [space.names.index(name) for name in mixture.components]
            point[places] = reference_blend(space, places)
        return point
    point = np.asarray(reference, float)
    if point.shape != (len(space),):
        raise RsmkitError(f"the reference needs {len(space)} values, got shape {point.shape}")
    for mixture in space.mixtures:
        amount = float(sum(point[space.names.index(name)] for name in mixture.components))
        if abs(amount - mixture.total) > 1e-6 * abs(mixture.total):
            raise RsmkitError(
                f"the reference has {', '.join(mixture.components)} add up to {amount:g}, not to "
                f"{mixture.total:g}"
            )
    return point


def _directions(space: Space, start: Floats, direction: Direction) -> list[tuple[int, float, Floats]]:
    """Per component its column, the total, and the change of every factor as it grows by one; shape (k,)."""
    found = []
    for mixture in space.mixtures:
        places = [space.names.index(name) for name in mixture.components]
        parts = np.array(start[places])
        if direction == "piepel":
            parts -= component_bounds(space, places)[0]
        for i, place in enumerate(places):
            rest = np.delete(parts, i)
            shares = (
                rest / rest.sum() if rest.sum() > EDGE * mixture.total else np.full(len(rest), 1 / len(rest))
            )
            along = np.zeros(len(space))
            along[places] = np.insert(-shares, i, 1.0)
            found.append((place, mixture.total, along))
    return found


def _reach(space: Space, start: Floats, along: Floats) -> tuple[float, float]:
    """How far a line can go back and forth before a bound is met."""
    moved = np.abs(along) > EDGE
    slopes = along[moved]
    low, high = component_bounds(space, np.flatnonzero(moved).tolist())
    ends = np.sort([(low - start[moved]) / slopes, (high - start[moved]) / slopes], axis=0)
    return min(0.0, float(ends[0].max())), max(0.0, float(ends[1].min()))
