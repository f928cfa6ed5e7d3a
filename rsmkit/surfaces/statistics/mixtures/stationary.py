"""Stationary point and principal axes of a quadratic model of a mixture, on the plane where blends lie.

The components move so that their sum stays the total, so gradient and curvature are those along the plane:
with an orthonormal basis Z of its directions (proportions, and coded units of process factors) the stationary
point solves ``Z' grad = 0``, and the axes are eigenvectors of ``Z' H Z / 2`` (Cornell, *Experiments with
Mixtures*, 3rd ed., section 5.11).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rsmkit.language.space import Floats
from rsmkit.surfaces.models.polynomial import PolynomialSurface
from rsmkit.surfaces.reading import numbers
from rsmkit.surfaces.statistics.mixtures.components import places_of
from rsmkit.surfaces.statistics.mixtures.directions import reference_point

__all__ = ["stationary_blend"]

FLAT = 1e-10
"""Curvature, as a share of the largest slope or curvature, below which an axis counts as flat."""


def stationary_blend(surface: PolynomialSurface) -> dict[str, Any]:
    """Stationary point, eigenvalues and axes as JSON values, or in words why there is none."""
    if reason := _refusal(surface):
        return {"stationary_point": {"reason": reason}, **_axes()}
    start = surface.to_units(reference_point(surface.space, None)[None])[0]
    terms, beta = surface.polynomial()
    slope, curvature = terms.slopes(start[None], beta)[0], terms.hessian(start, beta)
    plane = _plane(surface)
    inside = plane.T @ curvature @ plane
    values, vectors = np.linalg.eigh(0.5 * inside)
    values, vectors = values[::-1], plane @ vectors[:, ::-1]
    axes = _axes(values, vectors)
    size = max(float(np.abs(values).max()), float(np.abs(plane.T @ slope).max()))
    if np.abs(values).min() <= FLAT * size:
        reason = "the surface is flat along an axis: any blend of a line is stationary, or none"
        return {"stationary_point": {"reason": reason}, **axes}
    place = start - plane @ np.linalg.solve(inside, plane.T @ slope)
    natural = surface.from_units(place)
    kind = "minimum" if values.min() > 0 else "maximum" if values.max() < 0 else "saddle"
    runs = surface.data.points
    low, high = runs.min(axis=0), runs.max(axis=0)
    slack = 1e-9 * (high - low)
    names = surface.space.names
    point = {
        "coded": dict(zip(names, numbers(place), strict=True)),
        "natural": dict(zip(names, numbers(natural), strict=True)),
        "kind": kind,
        "predicted": float(surface.predict(natural[None])[0]),
        "inside_bounds": bool(surface.space.contains(natural)),
        "inside_runs": bool(((natural >= low - slack) & (natural <= high + slack)).all()),
    }
    return {"stationary_point": point, **axes}


def _axes(values: Floats | None = None, vectors: Floats | None = None) -> dict[str, Any]:
    if values is None or vectors is None:
        return dict.fromkeys(("eigenvalues", "eigenvalue_std_errors", "eigenvectors"))
    return {
        "eigenvalues": values.tolist(),
        "eigenvalue_std_errors": [None] * len(values),
        "eigenvectors": vectors.tolist(),
    }


def _refusal(surface: PolynomialSurface) -> str:
    if not surface.space.numeric.all():
        return "with categorical factors a model of a mixture has no single one; fit one surface for each"
    if len(surface.space.mixtures) > 1:
        return "it is worked out for one mixture, and there are several"
    if surface.terms.order < 2:
        return "linear blending has none: the best blend lies on the edge of the region"
    if surface.terms.order > 2:
        return (
            "it belongs to quadratic models; the highest and lowest predictions below are those of the region"
        )
    return ""


def _plane(surface: PolynomialSurface) -> Floats:
    """Orthonormal directions that keep the sum of the components, shape (k, k - 1)."""
    normal = np.zeros((1, len(surface.space)))
    normal[0, places_of(surface)] = 1.0
    return np.asarray(np.linalg.svd(normal)[2][1:].T)
