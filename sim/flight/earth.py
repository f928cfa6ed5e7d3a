"""The planet: shape, rotation and gravity.

Positions and velocities are inertial, in axes that coincide with the Earth-fixed ones at t = 0 (x through the
Greenwich meridian, z through the north pole). A flat Earth (x north, y east, z down, constant gravity) serves
closed-form checks.

Sources: WGS 84 (NIMA TR8350.2) for a, 1/f, GM, omega; J2 = 1.08262982e-3 is the value of NASA's atmospheric
check cases (NASA/TM-2015-218675). Geodetic latitude: Bowring, Survey Review 23 (1976) 323-327.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sim.core.compiled import compiled
from sim.core.errors import InputError

__all__ = ["EARTHS", "ROUND", "ROUND_ROTATING", "WGS84", "Earth", "check_earth", "flat_earth", "named_earth"]

GM = 3.986004418e14  # m3/s2
OMEGA = 7.292115e-5  # rad/s
MEAN_RADIUS = 6_371_000.0  # m


class Earth(NamedTuple):
    """Shape, gravity and rotation, as the compiled integrator reads them.

    Attributes
    ----------
    radius_m : float
        Equatorial radius.
    flattening : float
        0 for a sphere.
    gm_m3_s2, j2 : float
        Central gravity and its oblateness term.
    rotation_rad_s : float
        About the polar axis; the atmosphere turns with the planet.
    flat_gravity_m_s2 : float
        Constant gravity of a flat Earth, used when `radius_m` is infinite.
    """

    radius_m: float = MEAN_RADIUS
    flattening: float = 0.0
    gm_m3_s2: float = GM
    j2: float = 0.0
    rotation_rad_s: float = 0.0
    flat_gravity_m_s2: float = 0.0


ROUND = Earth()
ROUND_ROTATING = Earth(rotation_rad_s=OMEGA)
WGS84 = Earth(6_378_137.0, 1.0 / 298.257223563, GM, 1.08262982e-3, OMEGA)
EARTHS = {"round": ROUND, "round-rotating": ROUND_ROTATING, "wgs84": WGS84}


def check_earth(earth: Earth) -> Earth:
    """The same Earth as plain floats; refuses one that no planet is."""
    try:
        checked = Earth(*(float(value) for value in earth))
    except (TypeError, ValueError):
        raise InputError(f"an Earth model is made of numbers, not {tuple(earth)!r}") from None
    numbers = {**checked._asdict(), "radius_m": 0.0 if math.isinf(checked.radius_m) else checked.radius_m}
    for name, value in numbers.items():
        if not math.isfinite(value):
            raise InputError(f"{name} of the Earth must be a finite number, not {value}")
    if not (checked.radius_m > 0.0 and checked.gm_m3_s2 >= 0.0 and 0.0 <= checked.flattening < 1.0):
        raise InputError(
            "an Earth needs a positive radius, gm_m3_s2 >= 0 and a flattening from 0 to 1; got "
            f"{checked.radius_m:g}, {checked.gm_m3_s2:g} and {checked.flattening:g}"
        )
    return checked


def flat_earth(gravity_m_s2: float = 9.80665) -> Earth:
    """Flat, non-rotating Earth with constant gravity."""
    return Earth(math.inf, 0.0, 0.0, 0.0, 0.0, gravity_m_s2)


def named_earth(name: str) -> Earth:
    """Look an Earth model up by name ('round', 'round-rotating', 'wgs84')."""
    if name not in EARTHS:
        raise InputError(f"unknown Earth model '{name}'; choose one of {', '.join(EARTHS)}")
    return EARTHS[name]


@compiled
def gravity(earth: Earth, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Gravitational acceleration (m/s2): central term and J2."""
    if math.isinf(earth.radius_m):
        return 0.0, 0.0, earth.flat_gravity_m_s2
    r2 = x * x + y * y + z * z
    central = -earth.gm_m3_s2 / (r2 * math.sqrt(r2))
    oblate = 1.5 * earth.j2 * earth.radius_m**2 / r2
    polar = 5.0 * z * z / r2
    equatorial = central * (1.0 + oblate * (1.0 - polar))
    return equatorial * x, equatorial * y, central * (1.0 + oblate * (3.0 - polar)) * z


@compiled
def geodetic(earth: Earth, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Geodetic latitude (rad), longitude in the same axes (rad) and height (m) of a position."""
    if math.isinf(earth.radius_m):
        return 0.0, 0.0, -z
    rho = math.sqrt(x * x + y * y)
    longitude = math.atan2(y, x)
    if earth.flattening == 0.0:
        return math.atan2(z, rho), longitude, math.sqrt(rho * rho + z * z) - earth.radius_m
    a = earth.radius_m
    b = a * (1.0 - earth.flattening)
    e2 = earth.flattening * (2.0 - earth.flattening)
    sine, cosine = z * a, rho * b  # of the parametric latitude, to a common factor
    latitude = 0.0
    for _ in range(3):
        norm = math.sqrt(sine * sine + cosine * cosine)
        sine, cosine = sine / norm, cosine / norm
        up, out = z + e2 / (1.0 - e2) * b * sine**3, rho - e2 * a * cosine**3
        latitude = math.atan2(up, out)
        sine, cosine = (1.0 - earth.flattening) * up, out
    s, c = math.sin(latitude), math.cos(latitude)
    return latitude, longitude, rho * c + z * s - a * math.sqrt(1.0 - e2 * s * s)


@compiled
def altitude(earth: Earth, x: float, y: float, z: float) -> float:
    """Height above the ground (m)."""
    return geodetic(earth, x, y, z)[2]


@compiled
def position(earth: Earth, latitude: float, longitude: float, height_m: float) -> tuple[float, float, float]:
    """Cartesian position (m) of geodetic coordinates (rad, m); the inverse of :func:`geodetic`."""
    if math.isinf(earth.radius_m):
        return 0.0, 0.0, -height_m
    e2 = earth.flattening * (2.0 - earth.flattening)
    s, c = math.sin(latitude), math.cos(latitude)
    normal = earth.radius_m / math.sqrt(1.0 - e2 * s * s)
    equatorial = (normal + height_m) * c
    return (
        equatorial * math.cos(longitude),
        equatorial * math.sin(longitude),
        (normal * (1.0 - e2) + height_m) * s,
    )


@compiled
def geocentric_position(
    earth: Earth, latitude: float, longitude: float, height_m: float
) -> tuple[float, float, float]:
    """Cartesian position (m) of a geocentric latitude (rad) and a height above the ellipsoid (m)."""
    c = math.cos(latitude)
    x, y, z = c * math.cos(longitude), c * math.sin(longitude), math.sin(latitude)
    radius = earth.radius_m + height_m
    for _ in range(4):  # radius and height differ by the flattening, their changes by its square
        radius += height_m - altitude(earth, radius * x, radius * y, radius * z)
    return radius * x, radius * y, radius * z


@compiled
def from_ned(
    earth: Earth, latitude: float, longitude: float, north: float, east: float, down: float
) -> tuple[float, float, float]:
    """Rotate a vector from local north-east-down axes to the axes of `latitude` and `longitude` (rad)."""
    if math.isinf(earth.radius_m):
        return north, east, down
    sp, cp, sl, cl = math.sin(latitude), math.cos(latitude), math.sin(longitude), math.cos(longitude)
    outward = -sp * north - cp * down
    return outward * cl - sl * east, outward * sl + cl * east, cp * north - sp * down


@compiled
def to_ned(
    earth: Earth, latitude: float, longitude: float, x: float, y: float, z: float
) -> tuple[float, float, float]:
    """Rotate a vector to local north-east-down axes; the inverse of :func:`from_ned`."""
    if math.isinf(earth.radius_m):
        return x, y, z
    sp, cp, sl, cl = math.sin(latitude), math.cos(latitude), math.sin(longitude), math.cos(longitude)
    outward = x * cl + y * sl
    return -sp * outward + cp * z, cl * y - sl * x, -cp * outward - sp * z
