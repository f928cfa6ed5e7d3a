"""Radius of the surface where the stream meets the body, on which the stagnation heat flux depends.

Nose first the stream meets the spherical nose head-on somewhere, whatever the incidence, as long as the
sphere has a normal that points into it: up to 90 deg less the slope of what follows. From there to 90 deg it
meets the side, whose only curvature is the one around the body; then the base.

Flux grows with the square root of the mean curvature of the surface, half of the sum of the two principal
ones: a side of radius R is heated like a sphere of radius 2 R. On a face whose sonic line is its rim the
velocity gradient is set by the rim: beta R_b / beta_hemisphere = sqrt(0.09 + 0.82 (R_b/R_n)^2), which is 0.3
on a flat disc (heated with 0.55 of a hemisphere's flux), as measured by Boison and Curtiss (ARS Journal 29,
1959), and joins the sphere at R_b/R_n = sin 45 deg. For Fire II (0.9347 m, base 0.336 m) it gives 0.76 m.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sim.aero.pressure_laws.inviscid import smooth_step
from sim.body.geometry import BodyShape
from sim.core.compiled import compiled

__all__ = ["Meeting", "meeting", "meeting_radius_m", "rim_radius_m"]

_SMALLEST_M = 1e-6  # of a pointed nose: finite, and far beyond what the free-molecular limit lets through
_DISC, _SPHERE = 0.09, 0.82


class Meeting(NamedTuple):
    """Radii of equal heating of nose, side and base (m), and the incidences (rad) that belong to them.

    ``nose_m``, a micrometre for a pointed body, counts up to ``nose_end``; between that, ``side`` and
    ``base`` each passes smoothly into the next.
    """

    nose_m: float
    side_m: float
    base_m: float
    nose_end: float
    side: float
    base: float


def rim_radius_m(rim_m: float, sphere_m: float) -> float:
    """Radius of the sphere heated like a shallow spherical cap or disc (``sphere_m`` infinite), in m."""
    ratio = rim_m / sphere_m
    if ratio >= math.sqrt(0.5):
        return sphere_m
    return rim_m / math.sqrt(_DISC + _SPHERE * ratio * ratio)


def meeting(shape: BodyShape) -> Meeting:
    """Where the stream can meet this body."""
    nose_m = max(shape.nose_radius_m, _SMALLEST_M)
    if not shape.segments:
        nose_m = rim_radius_m(shape.base_radius_m, nose_m)
    nose_end = 0.5 * math.pi - shape.nose_angle_rad
    side = max(0.5 * math.pi, nose_end + math.radians(1.0))
    return Meeting(
        nose_m=nose_m,
        # the side starts where the nose ends, with the nose's radius around the body; a cap has no side
        side_m=2.0 * nose_m if shape.segments else nose_m,
        base_m=rim_radius_m(shape.base_radius_m, math.inf),
        nose_end=nose_end,
        side=side,
        base=side + 0.25 * math.pi,
    )


@compiled
def meeting_radius_m(alpha_rad: float, place: Meeting) -> float:
    """Radius of the sphere with the stagnation heat flux of the body at this incidence, m.

    It passes from one part to the next in the logarithm, for a point and a base are six decades apart.
    """
    if alpha_rad <= place.nose_end:
        return place.nose_m
    beside = smooth_step(alpha_rad, place.nose_end, place.side)
    facing = smooth_step(alpha_rad, place.side, place.base)
    radius = place.nose_m * (place.side_m / place.nose_m) ** beside
    return float(radius * (place.base_m / radius) ** facing)
