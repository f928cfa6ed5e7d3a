"""Blunt faces: bodies whose flow is subsonic up to the rim, and the corrections to impact pressure there.

Impact laws know the local slope alone. Where the bow shock stands off and the sonic line sits at the rim, the
pressure is evener than that on the face and falls towards the rim, and a body without a forebody to speak of
has a weaker wake. With s the sine of the inclination and y the radius over the rim's,

    Cp = Cp_law + K [ flat (1 - s^2) - drop 3 y^4 - relief s^2 (1 - s^2) ]

flat evens out, drop is the mean loss towards the rim, relief what a real gas takes off a sphere. Their values
are fitted to published drag (``docs/validation/aero-blunt.md``): perfect gas and equilibrium air for cones,
spherical caps, a flat disc, spheres. The form of the rim's loss is that of Love's and Kaattari's corrections
of Newtonian pressure for the sonic shoulder (AIAA Paper 69-181, 1969; NASA TN D-4961, 1968).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sim.aero.pressure_laws.inviscid import smooth_step
from sim.body.geometry import BodyShape
from sim.core.compiled import compiled, inlined

__all__ = ["NO_FACE", "Face", "blunt_base_pressure", "face_increment", "face_of", "rim_shape"]


class Face(NamedTuple):
    """What the blunt face of a body adds to impact pressure; all zero for a body that has none.

    ``*_air`` hold in equilibrium air; ``base`` is the share of :func:`blunt_base_pressure` in the wake.
    """

    flat: float
    flat_air: float
    drop: float
    drop_air: float
    relief_air: float
    base: float


NO_FACE = Face(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""Of a slender body, and of methods that know impact laws alone."""


def face_of(shape: BodyShape) -> Face:
    """Face of a body: by the slope of the nose's end, of a bare spherical cap or of the first cone."""
    slope_deg = math.degrees(shape.nose_angle_rad)
    if shape.segments:
        weight = smooth_step(slope_deg, 50.0, 60.0)
        values = (0.522, 0.180, 0.075, 0.0305, 0.0, 1.0)
        return Face(*(weight * value for value in values))
    weight = smooth_step(slope_deg, 45.0, 62.0)
    drop = weight * (0.145 - 0.060 * smooth_step(slope_deg, 69.0, 90.0))
    flat = weight * 0.292
    return Face(flat, flat, drop, drop, 0.13 * (1.0 - weight), 1.0 - weight)


def rim_shape(radius_m: float, rim_m: float) -> float:
    """3 y^4: how the loss towards the rim is spread over the face; its mean over the area is 1."""
    return 3.0 * (radius_m / rim_m) ** 4


@inlined
def face_increment(
    sin_inclination: float, rim: float, k: float, flat: float, drop: float, relief: float
) -> float:
    """Increment of Cp on an element of a face; it fades where the stream strikes obliquely."""
    s2 = sin_inclination * sin_inclination
    even = smooth_step(sin_inclination, 0.2, 0.55) * (flat * (1.0 - s2) - drop * rim)
    return k * (even - relief * s2 * (1.0 - s2))


@compiled
def blunt_base_pressure(mach: float, slow: float) -> float:
    """Base pressure coefficient of spheres and capsules: -0.7/M^2 from Mach 2 on, ``slow`` up to Mach 1.

    What measured drag of spheres (Charters and Thomas, Journal of the Aeronautical Sciences 12, 1945) leaves
    beside the impact pressure.
    """
    fast = smooth_step(mach, 1.0, 2.0)
    return slow if fast == 0.0 else slow + fast * (-0.7 / (mach * mach) - slow)
