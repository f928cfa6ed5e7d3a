"""Canonical analysis of a second-order surface ``y = b0 + x'b + x'Bx`` in coded units.

Box & Wilson (1951); Myers, Montgomery & Anderson-Cook (2016), section 6.3.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from rsmkit.errors import RsmkitError
from rsmkit.space import Floats
from rsmkit.surfaces.polynomial import PolynomialSurface

__all__ = ["Canonical", "canonical_analysis", "quadratic_form"]

Kind = Literal["minimum", "maximum", "saddle", "ridge"]

FLAT = 1e-10
"""Ratio of eigenvalues below which a direction counts as flat and the stationary point as undefined."""


@dataclass(frozen=True)
class Canonical:
    """Stationary point and principal axes.

    Parameters
    ----------
    stationary : array, shape (k,)
        Coded units, or nan when a direction is flat.
    eigenvalues : array, shape (k,)
        Decreasing.
    eigenvectors : array, shape (k, k)
        One column per eigenvalue, largest component positive.
    kind : {"minimum", "maximum", "saddle", "ridge"}
    """

    stationary: Floats
    eigenvalues: Floats
    eigenvectors: Floats
    kind: Kind


def quadratic_form(surface: PolynomialSurface) -> tuple[float, Floats, Floats]:
    """Constant ``b0``, vector ``b`` (k,) and symmetric matrix ``B`` (k, k) in coded units.

    Raises
    ------
    RsmkitError
        If the surface has categorical factors or terms above the second order.
    """
    terms, beta = surface.polynomial()
    if terms.order > 2:
        raise RsmkitError(
            f"{surface.response}: canonical analysis is defined for second-order surfaces, this one is of "
            f"order {terms.order}; search it for its optimum instead"
        )
    if any(terms.levels):
        raise RsmkitError(
            f"{surface.response}: canonical analysis needs numeric factors; fit one surface per category"
        )
    origin = np.zeros(terms.k)
    return (
        float(terms.evaluate(origin[None], beta)[0]),
        terms.slopes(origin[None], beta)[0],
        0.5 * terms.hessian(origin, beta),
    )


def canonical_analysis(surface: PolynomialSurface) -> Canonical:
    """Find the stationary point and the curvature along the principal axes."""
    _, b, curvature = quadratic_form(surface)
    values, vectors = np.linalg.eigh(curvature)
    values, vectors = values[::-1].astype(float), vectors[:, ::-1].astype(float)
    vectors = vectors * np.where(vectors[np.abs(vectors).argmax(axis=0), np.arange(len(b))] < 0, -1.0, 1.0)
    if np.abs(values).min() <= FLAT * max(np.abs(values).max(), np.abs(b).max()):
        return Canonical(np.full(len(b), np.nan), values, vectors, "ridge")
    kind: Kind = "minimum" if values[-1] > 0 else "maximum" if values[0] < 0 else "saddle"
    return Canonical(np.asarray(-0.5 * np.linalg.solve(curvature, b), float), values, vectors, kind)
