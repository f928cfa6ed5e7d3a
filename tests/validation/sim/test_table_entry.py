"""A ballistic entry over the rotating ellipsoid through a given density table and wind, drag constant.

Against a point mass in Earth-fixed axes (``point_mass.py``). The capsule and its start are those of a super-
orbital entry experiment in round numbers; the table is made up, rough on purpose.
"""

import numpy as np
import point_mass
import pytest
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq

from sim.aero.given_coefficients import GivenCoefficients
from sim.air.altitude_table import table_atmosphere
from sim.air.wind import CALM, table_wind
from sim.flight.earth import OMEGA, WGS84
from sim.flight.trajectory import Body, Environment, InitialState, Integration, fly_body

HEIGHTS = 1e3 * np.array([0, 10, 20, 30, 40, 50, 60, 70, 80, 90, 100, 110, 121.92])
DENSITIES = np.array(
    [1.2, 0.43, 0.093, 0.0181, 4.1e-3, 1.01e-3, 3.0e-4, 8.5e-5, 1.8e-5, 3.3e-6, 5.2e-7, 9.1e-8, 2.4e-8]
)
WIND_HEIGHTS = 1e3 * np.array([0, 20, 50, 90, 130])
NORTH, EAST = np.array([5.0, -20.0, 30.0, 60.0, 10.0]), np.array([10.0, 40.0, -50.0, 80.0, 0.0])
DRAG_AREA_OVER_MASS = 6.1e-3


def geodetic_latitude(geocentric, height_m):
    """Geodetic latitude (rad) of the place at this height that has this geocentric latitude."""
    e2 = WGS84.flattening * (2 - WGS84.flattening)

    def miss(phi):
        normal = WGS84.radius_m / np.sqrt(1 - e2 * np.sin(phi) ** 2)
        up, out = (normal * (1 - e2) + height_m) * np.sin(phi), (normal + height_m) * np.cos(phi)
        return np.arctan2(up, out) - geocentric

    return brentq(miss, geocentric - 0.01, geocentric + 0.01, xtol=1e-15)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("relative_to", "vertical", "speed", "path_angle", "heading", "latitude", "longitude", "windy"),
    [
        ("earth", "geodetic", 11_350.0, -14.7, 104.0, -4.6, -23.5, False),
        ("inertial", "geodetic", 11_570.0, -14.5, 102.0, -4.6, -23.5, False),
        ("earth", "geodetic", 7_000.0, -12.0, 320.0, 51.0, 179.9, True),
        ("earth", "geocentric", 11_350.0, -14.7, 40.0, 44.0, -23.5, False),
    ],
)
def test_against_an_independent_integration(
    relative_to, vertical, speed, path_angle, heading, latitude, longitude, windy
):
    wind = table_wind(WIND_HEIGHTS, NORTH, EAST) if windy else CALM
    body = Body.with_coefficients(
        86.6, (1.0, 1.0, 1.0), 86.6 * DRAG_AREA_OVER_MASS, 0.67, GivenCoefficients(drag=1.0)
    )
    start = InitialState.entry(
        121_920.0,
        speed,
        path_angle,
        heading_deg=heading,
        latitude_deg=latitude,
        longitude_deg=longitude,
        relative_to=relative_to,
        vertical=vertical,
    )
    air = table_atmosphere(HEIGHTS, DENSITIES, interpolation="log-linear")
    flown = fly_body(body, start, Environment(WGS84, air, wind), Integration(rtol=1e-9, duration_s=70.0))

    climb, course, phi = np.radians([path_angle, heading, latitude])
    velocity = speed * np.array(
        [np.cos(climb) * np.cos(course), np.cos(climb) * np.sin(course), -np.sin(climb)]
    )
    if vertical == "geocentric":
        centric, phi = phi, geodetic_latitude(phi, 121_920.0)
        tilt = phi - centric  # by which the ellipsoid's vertical leans towards the pole
        velocity[[0, 2]] = (
            velocity[0] * np.cos(tilt) + velocity[2] * np.sin(tilt),
            velocity[2] * np.cos(tilt) - velocity[0] * np.sin(tilt),
        )
    if relative_to == "inertial":  # the ground moves east
        e2 = WGS84.flattening * (2 - WGS84.flattening)
        normal = WGS84.radius_m / np.sqrt(1 - e2 * np.sin(phi) ** 2)
        velocity[1] -= OMEGA * (normal + 121_920.0) * np.cos(phi)
    towards = [PchipInterpolator(WIND_HEIGHTS, column, extrapolate=True) for column in (NORTH, EAST)]
    blowing = (lambda h: [float(f(h)) for f in towards]) if windy else (lambda h: (0.0, 0.0))
    times = np.arange(0.0, 70.5, 10.0)
    expected = point_mass.flown(
        WGS84,
        (phi, np.radians(longitude), 121_920.0),
        velocity,
        0.5 * DRAG_AREA_OVER_MASS,
        lambda h: np.exp(np.interp(h, HEIGHTS, np.log(DENSITIES))),
        blowing,
        times,
        rtol=1e-9,
        atol=1e-5,
        max_step=0.25,
    )
    at = flown.at(times)
    north, east, down = expected.T[3:]
    np.testing.assert_allclose(at["altitude_m"], expected[:, 2], atol=0.02)
    np.testing.assert_allclose(at["latitude_deg"], np.degrees(expected[:, 0]), atol=1e-6)
    turned = (at["longitude_deg"] - np.degrees(expected[:, 1]) + 180.0) % 360.0 - 180.0
    np.testing.assert_allclose(turned, 0.0, atol=1e-6)
    np.testing.assert_allclose(at["speed_m_s"], np.sqrt(north**2 + east**2 + down**2), atol=0.01)
    angle = -np.degrees(np.arctan2(down, np.hypot(north, east)))
    np.testing.assert_allclose(at["path_angle_deg"], angle, atol=2e-5)
    if relative_to == "inertial":
        assert at["inertial_speed_m_s"][0] == pytest.approx(speed, rel=1e-12)
        assert at["inertial_path_angle_deg"][0] == pytest.approx(path_angle, abs=1e-10)
