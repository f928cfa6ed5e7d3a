"""Mass properties: the moments of inertia of a body of uniform density."""

from __future__ import annotations

import math

from sim.body.geometry import BodyShape

__all__ = ["uniform_gyration_radii_m"]


def uniform_gyration_radii_m(shape: BodyShape) -> tuple[float, float]:
    """Radii of gyration of the solid body of uniform density about its own centroid.

    Parameters
    ----------
    shape : BodyShape
        The outline.

    Returns
    -------
    axial_m, transverse_m : float
        About the axis of revolution and about any axis across it; their squares times the mass are the
        moments of inertia.
    """
    centroid = shape.centroid_m
    # A thin disc of radius r at x adds r^2/2 and r^2/4 + (x - centroid)^2 per unit mass.
    axial = shape.integrate(lambda x, r2: 0.5 * math.pi * r2 * r2)
    transverse = shape.integrate(lambda x, r2: math.pi * r2 * (0.25 * r2 + (x - centroid) ** 2))
    return math.sqrt(axial / shape.volume_m3), math.sqrt(transverse / shape.volume_m3)
