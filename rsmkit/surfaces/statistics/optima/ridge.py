"""Paths of improvement: ridge analysis, steepest ascent, and the optimum inside the box.

Ridge analysis (Hoerl 1959; Draper, Technometrics 5, 1963): the best point on each sphere around the design
centre solves ``(B - mu I) x = -b/2``, with mu above the largest eigenvalue for a maximum, below the smallest
for a minimum.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Literal

import numpy as np
from scipy.optimize import brentq, minimize

from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.io.shown import Shown
from rsmkit.language.space import Floats, Space
from rsmkit.surfaces.estimation.least_squares import EXACT
from rsmkit.surfaces.models.polynomial import PolynomialSurface
from rsmkit.surfaces.models.surface import Surface
from rsmkit.surfaces.statistics.optima.canonical import Quadratic, quadratic_form
from rsmkit.surfaces.statistics.terms.categories import Category, at_category

__all__ = ["Goal", "Path", "optimum_in_box", "ridge_path", "steepest_path"]

Goal = Literal["maximize", "minimize"]


@dataclass(frozen=True)
class Path(Shown):
    """Points in order of their distance from the design centre.

    Parameters
    ----------
    radii : array, shape (m,)
        Distances in coded units.
    coded, natural : array, shape (m, k)
    predicted : array, shape (m,)
    std_errors : array, shape (m,)
        Of the predicted mean.
    multipliers : array, shape (m,)
        Lagrange multiplier mu of each point of a ridge path, ``(B - mu I) x = -b/2``; nan at the centre and
        on a straight path.
    """

    radii: Floats
    coded: Floats
    natural: Floats
    predicted: Floats
    std_errors: Floats
    multipliers: Floats


@checked
def ridge_path(
    surface: PolynomialSurface,
    radii: Sequence[float] | Floats | None = None,
    goal: Goal = "maximize",
    category: Category | None = None,
) -> Path:
    """Best point of a second-order surface on each sphere around the centre, solved to machine precision.

    Parameters
    ----------
    surface : PolynomialSurface
        Of second order in its numeric factors.
    radii : sequence of float, optional
        Coded units; 0 to 2 in steps of 0.25 by default.
    goal : {"maximize", "minimize"}
    category : mapping of str to str, optional
        Level of each categorical factor, if there are any; the path has a column for each number.
    """
    _, b, curvature = quadratic_form(surface, category)
    sign = 1.0 if goal == "maximize" else -1.0
    distances = np.arange(0.0, 2.01, 0.25) if radii is None else np.asarray(radii, float)
    if (distances < 0).any():
        raise RsmkitError("radii of a ridge path must not be negative")
    best = np.array([_best_on_sphere(sign * b, sign * curvature, r) for r in distances])
    pulls = np.einsum("ij,ij->i", best, best @ curvature + 0.5 * b)
    with np.errstate(invalid="ignore", divide="ignore"):
        multipliers = pulls / np.einsum("ij,ij->i", best, best)
    return _path(at_category(surface, category), distances, best, multipliers)


@checked
def steepest_path(
    surface: PolynomialSurface,
    radii: Sequence[float] | Floats | None = None,
    goal: Goal = "maximize",
    category: Category | None = None,
) -> Path:
    """Straight path along the gradient at the design centre (Box & Wilson 1951).

    Parameters are those of :func:`ridge_path`.
    """
    view = at_category(surface, category)
    terms, beta = view.polynomial()
    slope = terms.slopes(np.zeros((1, terms.k)), beta)[0]
    length = np.linalg.norm(slope)
    if length <= EXACT * np.abs(beta).max(initial=0.0):
        raise RsmkitError(
            f"{surface.response}: the surface is level at the centre, there is no steepest direction"
        )
    distances = np.arange(0.0, 5.01, 0.5) if radii is None else np.asarray(radii, float)
    sign = 1.0 if goal == "maximize" else -1.0
    return _path(view, distances, np.outer(distances, sign * slope / length))


def optimum_in_box(
    surface: Surface, goal: Goal = "maximize", seed: int = 0, *, within: Space | None = None
) -> tuple[Floats, float]:
    """Best point of any surface between the bounds of its space, or of another one.

    Local searches with the exact gradient from the best of 2,048 Sobol points and the corners, for every
    combination of categories. Integer and discrete factors are treated as continuous.

    Parameters
    ----------
    surface : Surface
    goal : {"maximize", "minimize"}
    seed : int
    within : Space, optional
        The same factors with other bounds.

    Returns
    -------
    point : array, shape (k,)
        Natural units.
    value : float
    """
    from scipy.stats import qmc

    space = within or surface.space
    sign = -1.0 if goal == "maximize" else 1.0
    numeric = space.numeric
    counts = [f.domain.categories for f in space if not f.domain.is_numeric]
    free = int(numeric.sum())
    starts = 2.0 * qmc.Sobol(max(free, 1), seed=seed).random(2048)[:, :free] - 1.0
    if free <= 10:
        starts = np.vstack([starts, list(product([-1.0, 1.0], repeat=free)), np.zeros((1, free))])
    half = 0.5 * (space.highs - space.lows)[numeric]
    best_point, best_value = np.empty(0), np.inf
    for levels in product(*(range(count) for count in counts)):
        coded = np.zeros((len(starts), len(space)))
        coded[:, numeric], coded[:, ~numeric] = starts, levels

        def value_and_slope(z: Floats, row: Floats = coded[0]) -> tuple[float, Floats]:
            point = row.copy()
            point[numeric] = z
            natural = space.decode(point)[None]
            return sign * float(surface.predict(natural)[0]), sign * surface.gradient(natural)[0][
                numeric
            ] * half

        values = sign * surface.predict(space.decode(coded))
        if values.min() < best_value:
            best_value, best_point = float(values.min()), space.decode(coded[values.argmin()])
        for start in np.argsort(values)[: 8 if free else 0]:
            found = minimize(
                value_and_slope,
                coded[start][numeric],
                jac=True,
                method="L-BFGS-B",
                bounds=[(-1.0, 1.0)] * free,
            )
            if found.fun < best_value:
                best_value = float(found.fun)
                point = coded[0].copy()
                point[numeric] = found.x
                best_point = space.decode(point)
    return best_point, sign * best_value


def _best_on_sphere(b: Floats, curvature: Floats, radius: float) -> Floats:
    """Maximise ``x'b + x'Bx`` on ``|x| = radius``: the secular equation in the eigenvectors of B."""
    if radius == 0:
        return np.zeros_like(b)
    values, vectors = np.linalg.eigh(curvature)
    g = vectors.T @ b
    top = values[-1]
    scale = max(np.abs(values).max(), np.linalg.norm(b), 1e-300)
    leading = values >= top - 1e-13 * scale
    rest = np.zeros_like(g)
    rest[~leading] = 0.5 * g[~leading] / (top - values[~leading])
    if np.linalg.norm(g[leading]) <= 1e-14 * scale and np.linalg.norm(rest) <= radius:
        rest[-1] = np.sqrt(radius**2 - rest @ rest)  # no pull along the top axis: both directions are as good
        return np.asarray(vectors @ rest)

    def excess(shift: float) -> float:
        """1/|x| - 1/radius, almost linear in the shift of mu above the top eigenvalue."""
        return 1.0 / float(np.linalg.norm(0.5 * g / (top - values + shift))) - 1.0 / radius

    largest = 0.5 * float(np.linalg.norm(g)) / radius
    smallest = 0.5 * float(np.linalg.norm(g[leading])) / radius
    low = max(smallest * (1 - 1e-12), 1e-300)
    while excess(low) > 0:
        low *= 0.5
    shift = brentq(excess, low, largest * (1 + 1e-9) + low, xtol=1e-300, rtol=1e-15, maxiter=500)
    return np.asarray(vectors @ (0.5 * g / (top - values + shift)))


def _path(surface: Quadratic, radii: Floats, coded: Floats, multipliers: Floats | None = None) -> Path:
    natural = surface.from_units(coded)
    return Path(
        radii,
        coded,
        natural,
        surface.predict(natural),
        surface.fit.sigma * np.sqrt(surface.leverage(natural)),
        np.full(len(radii), np.nan) if multipliers is None else multipliers,
    )
