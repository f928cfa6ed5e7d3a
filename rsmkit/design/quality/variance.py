"""Prediction variance of a design over its region: fraction of design space, and profiles through a point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rsmkit.design.design import Design
from rsmkit.design.optimal.criteria import precision_of
from rsmkit.design.region import Region, box
from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.io.shown import Shown
from rsmkit.language.space import Floats, Space
from rsmkit.language.space_terms import space_terms
from rsmkit.language.terms import Terms

__all__ = [
    "VarianceProfile",
    "coefficient_covariance",
    "design_space_fraction",
    "inverse_information",
    "inverse_of",
    "variance_profile",
]

FDS_POINTS = 2**13


@dataclass(frozen=True)
class VarianceProfile(Shown):
    """Prediction variance along one factor, the others held.

    Parameters
    ----------
    factor : str
    values : array, shape (m,)
        Natural units.
    variances : array, shape (m,)
        For unit error variance.
    """

    factor: str
    values: Floats
    variances: Floats


def coefficient_covariance(design: Design, terms: Terms) -> Floats:
    """Covariance of the coefficients for unit error variance, block effects allowed for, shape (p, p).

    Raises
    ------
    RsmkitError
        If the design cannot estimate the model.
    """
    covariance = design.covariance
    blocks = (design.blocks or None) if covariance is None else None
    return inverse_information(terms.matrix(design.coded), precision_of(len(design), blocks, covariance))


def inverse_information(X: Floats, precision: Floats) -> Floats:
    """Inverse of ``X' precision X``, for independent runs where the precision is empty, shape (p, p).

    Raises
    ------
    RsmkitError
        If it is singular.
    """
    return inverse_of(X.T @ (precision @ X) if len(precision) else X.T @ X)


def inverse_of(information: Floats) -> Floats:
    """Inverse of an information matrix, scaled first.

    Raises
    ------
    RsmkitError
        If it is singular.
    """
    scale = np.sqrt(np.diag(information))
    if not (scale > 0).all() or np.linalg.cond(information / np.outer(scale, scale)) > 1e14:
        raise RsmkitError("the design cannot estimate the model; rk.assess(design) names the terms")
    inverse: Floats = np.linalg.inv(information / np.outer(scale, scale)) / np.outer(scale, scale)
    return inverse


@checked
def design_space_fraction(
    design: Design, *, order: int = 2, terms: Terms | None = None, region: Region | None = None
) -> tuple[Floats, Floats]:
    """Fraction-of-design-space curve (Zahran, Anderson-Cook & Myers 2003, JQT 35(4), 377-386).

    Parameters
    ----------
    design : Design
    order, terms
        The model.
    region : Region, optional
        The bounds by default.

    Returns
    -------
    fractions : array, shape (m,)
        0 to 1.
    variances : array, shape (m,)
        Prediction variance (unit error variance) not exceeded in that fraction of the region.
    """
    terms = space_terms(design.space, order) if terms is None else terms
    points = (box(design.space) if region is None else region).sample(FDS_POINTS, 0)
    variances = np.sort(_variances(terms, points, coefficient_covariance(design, terms)))
    return (np.arange(len(points)) + 0.5) / len(points), variances


@checked
def variance_profile(
    design: Design,
    *,
    at: ArrayLike | None = None,
    order: int = 2,
    terms: Terms | None = None,
    steps: int = 41,
) -> tuple[VarianceProfile, ...]:
    """Prediction variance along every factor through a point, the others held.

    Where a factor takes part in an equality the others give way, those of a mixture in proportion (Cox's
    direction), as far as the bounds allow.

    Parameters
    ----------
    at : array, shape (k,), optional
        Natural units; the centre of the bounds by default.
    steps : int
        Values per numeric factor.
    """
    space = design.space
    terms = space_terms(space, order) if terms is None else terms
    covariance = coefficient_covariance(design, terms)
    point = _middle(space) if at is None else np.asarray(at, float)
    profiles = []
    for j, factor in enumerate(space):
        points = _along(space, point, j, steps)
        values = points[:, j]
        profiles.append(
            VarianceProfile(factor.name, values, _variances(terms, space.encode(points), covariance))
        )
    return tuple(profiles)


def _middle(space: Space) -> Floats:
    middle = np.array([factor.domain.middle for factor in space])
    if space.affine is None:
        return middle
    return np.where(space.affine.involved, space.affine.inner, middle)


def _along(space: Space, point: Floats, j: int, steps: int) -> Floats:
    """Points through `point` with all values of a factor that the others allow, shape (m, k)."""
    affine = space.affine
    if affine is None or not affine.involved[j]:
        values = space.factors[j].domain.curve(steps)
        points = np.tile(point, (len(values), 1))
        points[:, j] = values
        return points
    way = np.zeros(len(space))
    way[j] = 1.0
    mixed = [m for m in space.mixtures if space.names[j] in m.components]
    if mixed and len(affine.blocks) == len(affine.matrix):
        at = np.array([space.names.index(name) for name in mixed[0].components])
        least = affine.low[at]
        rest = np.where(at == j, 0.0, point[at] - least)
        way[at] -= rest / rest.sum()
    else:  # as near to this factor alone as the equalities allow
        scaled = affine.matrix * affine.scales
        way = affine.scales * (way - np.linalg.pinv(scaled) @ scaled @ way)
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.stack([(space.lows - point) / way, (space.highs - point) / way])
    back = np.where(way != 0.0, ends.min(axis=0), -np.inf).max()
    ahead = np.where(way != 0.0, ends.max(axis=0), np.inf).min()
    return affine.project(point + np.linspace(back, ahead, steps)[:, None] * way)


def _variances(terms: Terms, coded: Floats, covariance: Floats) -> Floats:
    rows = terms.matrix(coded)
    return np.asarray(((rows @ covariance) * rows).sum(axis=1))
