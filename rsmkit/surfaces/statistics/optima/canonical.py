"""Canonical analysis of a second-order surface ``y = b0 + x'b + x'Bx`` in coded units.

Box & Wilson (1951); Myers, Montgomery & Anderson-Cook (2016), section 6.3. Standard errors of the
eigenvalues by Bisgaard & Ankenman, Technometrics 38 (1996); confidence region of the stationary point by Box
& Hunter, Biometrika 41 (1954).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import fdtri

from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.io.shown import Shown
from rsmkit.language.space import Floats
from rsmkit.language.terms import Terms
from rsmkit.surfaces.models.polynomial import PolynomialSurface
from rsmkit.surfaces.statistics.terms.categories import Category, CategorySlice, at_category

__all__ = [
    "Canonical",
    "StationaryRegion",
    "canonical_analysis",
    "quadratic_form",
    "stationary_region",
    "stationary_statistic",
]

Quadratic = PolynomialSurface | CategorySlice
"""What has a polynomial of numbers alone."""
Kind = Literal["minimum", "maximum", "saddle", "ridge"]

CHUNK = 512

FLAT = 1e-10
"""Share of the largest slope or curvature across the runs below which an axis counts as flat, and the
stationary point as undefined."""
SINGULAR = 1e-10
"""Singular value of the gradient's spread, as a share of the largest, that is rounding and nothing else."""
ROUNDING = 1e-14
"""Curvature across the runs, as a share of the largest response, that is rounding and nothing else."""


@dataclass(frozen=True)
class Canonical(Shown):
    """Stationary point and principal axes.

    Parameters
    ----------
    stationary : array, shape (k,)
        Coded units, or nan when a direction is flat.
    eigenvalues : array, shape (k,)
        Decreasing.
    eigenvectors : array, shape (k, k)
        One column per eigenvalue, largest component positive.
    std_errors : array, shape (k,)
        Of the eigenvalues: the curvature along each axis as a linear function of the coefficients, the axis
        taken as it was found; nan without degrees of freedom.
    kind : {"minimum", "maximum", "saddle", "ridge"}
    """

    stationary: Floats
    eigenvalues: Floats
    eigenvectors: Floats
    std_errors: Floats
    kind: Kind


@dataclass(frozen=True)
class StationaryRegion(Shown):
    """Points that the data do not exclude as the stationary point, inside the box of the runs.

    Parameters
    ----------
    confidence : float
    threshold : float
        Points with :func:`stationary_statistic` below it belong to the region.
    share : float
        Part of the box of the runs that the region fills: near 1 the stationary point is unknown.
    low, high : array, shape (k,)
        Extent of the region inside that box in coded units; nan where the region misses the box.
    """

    confidence: float
    threshold: float
    share: float
    low: Floats
    high: Floats


def quadratic_form(
    surface: PolynomialSurface, category: Category | None = None
) -> tuple[float, Floats, Floats]:
    """Constant ``b0``, vector ``b`` (k,) and symmetric matrix ``B`` (k, k) in coded units.

    Parameters
    ----------
    surface : PolynomialSurface
    category : mapping of str to str, optional
        Level of each categorical factor, if there are any; k counts the numeric ones.

    Raises
    ------
    RsmkitError
        If a category is not given, or if there are terms above the second order in the numbers.
    """
    return _quadratic_form(at_category(surface, category))


def _quadratic_form(surface: Quadratic) -> tuple[float, Floats, Floats]:
    terms, beta = surface.polynomial()
    if terms.order > 2:
        raise RsmkitError(
            f"{surface.response}: canonical analysis is defined for second-order surfaces, this one is of "
            f"order {terms.order}; search it for its optimum instead"
        )
    origin = np.zeros(terms.k)
    return (
        float(terms.evaluate(origin[None], beta)[0]),
        terms.slopes(origin[None], beta)[0],
        0.5 * terms.hessian(origin, beta),
    )


@checked
def canonical_analysis(surface: PolynomialSurface, category: Category | None = None) -> Canonical:
    """Find the stationary point and the curvature along the principal axes.

    Parameters
    ----------
    surface : PolynomialSurface
        Of second order in its numeric factors, which alone have axes.
    category : mapping of str to str, optional
        Level of each categorical factor, if there are any: ``{"tool": "A"}``.
    """
    view = at_category(surface, category)
    _, b, curvature = _quadratic_form(view)
    values, vectors = np.linalg.eigh(curvature)
    values, vectors = values[::-1].astype(float), vectors[:, ::-1].astype(float)
    vectors = vectors * np.where(vectors[np.abs(vectors).argmax(axis=0), np.arange(len(b))] < 0, -1.0, 1.0)
    errors = _eigenvalue_errors(view, vectors)
    if _has_flat_axis(view, b, curvature):
        return Canonical(np.full(len(b), np.nan), values, vectors, errors, "ridge")
    kind: Kind = "minimum" if values[-1] > 0 else "maximum" if values[0] < 0 else "saddle"
    stationary = np.asarray(-0.5 * np.linalg.solve(curvature, b), float)
    return Canonical(stationary, values, vectors, errors, kind)


def stationary_statistic(surface: Quadratic, coded: ArrayLike) -> Floats:
    """How strongly the data speak against each point being stationary (Box & Hunter).

    With ``d`` the gradient of the surface there, ``d' cov(d)^-1 d / k``: an F statistic with k and the
    residual degrees of freedom. Where a model without all linear terms gives the gradient fewer than k
    directions to vary in, the inverse is the pseudo-inverse: k times the statistic is then a sum of fewer
    squares, so that a region with the limit for k holds with more than its confidence.

    Parameters
    ----------
    coded : array, shape (n, k)

    Returns
    -------
    array, shape (n,)
    """
    points = np.atleast_2d(np.asarray(coded, float))
    terms, beta = surface.polynomial()
    factor = surface.fit.sigma * surface.term_factor
    values = np.empty(len(points))
    for start in range(0, len(points), CHUNK):
        part = slice(start, start + CHUNK)
        rows = terms.gradient(points[part])
        slopes = np.einsum("npk,p->nk", rows, beta)
        spread = np.swapaxes(rows, 1, 2) @ factor
        if _free_gradient(terms):
            solved = np.linalg.solve(spread @ np.swapaxes(spread, 1, 2), slopes[:, :, None])[:, :, 0]
            values[part] = np.einsum("nk,nk->n", slopes, solved) / terms.k
        else:
            solved = (np.linalg.pinv(spread, rcond=SINGULAR) @ slopes[:, :, None])[:, :, 0]
            values[part] = np.einsum("np,np->n", solved, solved) / terms.k
    return values


@checked
def stationary_region(
    surface: PolynomialSurface,
    confidence: float = 0.95,
    points: int = 4096,
    category: Category | None = None,
) -> StationaryRegion:
    """Summarise the Box-Hunter region over the box of the runs, on Sobol points there and near the estimate.

    Parameters
    ----------
    surface : PolynomialSurface
    confidence : float
    points : int
        Sobol points.
    category : mapping of str to str, optional
        Level of each categorical factor, if there are any.

    Raises
    ------
    RsmkitError
        Without residual degrees of freedom, or when the surface is not of second order.
    """
    from scipy.stats import qmc

    point = canonical_analysis(surface, category).stationary
    view = at_category(surface, category)
    if surface.fit.df == 0 or surface.fit.rss <= 0 or surface.fit.exact:
        raise RsmkitError(f"{surface.response}: no residual to judge by, so no region can be given")
    k = len(view.space)
    threshold = float(fdtri(k, surface.fit.df, confidence))
    unit = 2.0 * qmc.Sobol(k, scramble=False).random(points) - 1.0
    box = view.to_units(view.box_of_runs.backward(unit))
    found = box[stationary_statistic(view, box) <= threshold]
    share = len(found) / points
    near = point + 2.0 * np.sqrt(k * threshold) * _stationary_errors(view, point) * unit
    near = near[((near >= box.min(axis=0)) & (near <= box.max(axis=0))).all(axis=1)]
    found = np.vstack([found, near[stationary_statistic(view, near) <= threshold]])
    if not len(found):
        return StationaryRegion(confidence, threshold, share, np.full(k, np.nan), np.full(k, np.nan))
    return StationaryRegion(confidence, threshold, share, found.min(axis=0), found.max(axis=0))


def _free_gradient(terms: Terms) -> bool:
    """Whether every factor has its linear term, so that the gradient's covariance is never singular."""
    return all(tuple(int(i == j) for i in range(terms.k)) in terms.exponents for j in range(terms.k))


def _has_flat_axis(surface: Quadratic, b: Floats, curvature: Floats) -> bool:
    """Judge on the box of the runs, because a coded unit may be far larger or smaller than it."""
    box = surface.box_of_runs
    low, high = (surface.to_units(np.array(end)) for end in (box.low, box.high))
    center, half = 0.5 * (low + high), 0.5 * (high - low)
    slopes = np.abs(half * (b + 2.0 * curvature @ center))
    sizes = np.abs(np.linalg.eigvalsh(np.outer(half, half) * curvature))
    smallest = max(FLAT * max(sizes.max(), slopes.max()), ROUNDING * np.abs(surface.data.y).max())
    return bool(sizes.min() <= smallest)


def _stationary_errors(surface: Quadratic, point: Floats) -> Floats:
    """Standard errors of the stationary point to first order, shape (k,): where to look closely."""
    if np.isnan(point).any():
        return np.zeros_like(point)
    terms, beta = surface.polynomial()
    spread = surface.fit.sigma * terms.gradient(point[None])[0].T @ surface.term_factor
    moved = np.linalg.solve(terms.hessian(point, beta), spread)
    return np.asarray(np.sqrt(np.einsum("ij,ij->i", moved, moved)))


def _eigenvalue_errors(surface: Quadratic, vectors: Floats) -> Floats:
    """Standard errors of ``m'Bm`` for each column m of `vectors`."""
    terms, _ = surface.polynomial()
    squares = np.array([sum(e) == 2 for e in terms.exponents])
    weights = np.where(squares, terms.matrix(vectors.T), 0.0)
    return np.asarray(surface.fit.sigma * np.linalg.norm(weights @ surface.term_factor, axis=1))
