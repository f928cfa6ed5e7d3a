"""Geodesy, gravity and wind."""

import math

import numpy as np
import pytest

from sim.air.wind import sheared_wind, steady_wind, table_wind, wind_ned
from sim.core.errors import InputError
from sim.flight.earth import (
    GM,
    ROUND,
    WGS84,
    flat_earth,
    from_ned,
    geodetic,
    gravity,
    named_earth,
    position,
    to_ned,
)


@pytest.mark.parametrize("earth", [ROUND, WGS84], ids=["round", "wgs84"])
def test_geodetic_coordinates_round_trip(earth):
    for latitude in np.radians([-90.0, -89.9, -45.0, 0.0, 30.0, 89.999, 90.0]):
        for height in (-100.0, 0.0, 9144.0, 82_000.0, 700_000.0):
            found = geodetic(earth, *position(earth, latitude, 1.2, height))
            assert found[0] == pytest.approx(latitude, abs=1e-12)
            assert found[2] == pytest.approx(height, abs=5e-9)


def test_wgs84_has_its_published_derived_constants():
    # NIMA TR8350.2: polar radius 6 356 752.3142 m; meridian radius of curvature at the pole 6 399 593.6258 m
    assert position(WGS84, math.pi / 2, 0.0, 0.0)[2] == pytest.approx(6_356_752.3142, abs=1e-4)
    step = 1e-4
    arc = math.dist(
        position(WGS84, math.pi / 2 - step, 0.0, 0.0), position(WGS84, math.pi / 2 - 2 * step, 0.0, 0.0)
    )
    assert arc / step == pytest.approx(6_399_593.6258, rel=1e-6)


def test_gravity_is_the_gradient_of_its_potential():
    def potential(r):
        distance = np.linalg.norm(r)
        legendre = 0.5 * (3 * (r[2] / distance) ** 2 - 1)
        return GM / distance * (1 - WGS84.j2 * (WGS84.radius_m / distance) ** 2 * legendre)

    r = np.array([4.0e6, -2.5e6, 4.4e6])
    steps = 10.0 * np.eye(3)
    gradient = [(potential(r + step) - potential(r - step)) / 20.0 for step in steps]
    np.testing.assert_allclose(gravity(WGS84, *r), gradient, rtol=1e-7)


def test_normal_gravity_with_rotation_is_close_to_the_published_values():
    # WGS 84 theoretical gravity, m/s2, at the equator and the poles; J2 alone comes within 2e-5 of it.
    x, y, z = position(WGS84, 0.0, 0.0, 0.0)
    assert -gravity(WGS84, x, y, z)[0] - WGS84.rotation_rad_s**2 * x == pytest.approx(9.7803253359, abs=1e-4)
    assert -gravity(WGS84, *position(WGS84, math.pi / 2, 0.0, 0.0))[2] == pytest.approx(9.8321849, abs=2e-4)


def test_local_axes_are_orthonormal_and_point_the_right_way():
    axes = np.array([from_ned(WGS84, 0.5, 2.0, *unit) for unit in np.eye(3)])
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-15)
    assert np.cross(axes[0], axes[1]) == pytest.approx(axes[2])
    assert to_ned(WGS84, 0.5, 2.0, *from_ned(WGS84, 0.5, 2.0, 1.0, 2.0, 3.0)) == pytest.approx(
        (1.0, 2.0, 3.0)
    )
    assert from_ned(ROUND, 0.0, 0.0, 0.0, 0.0, 1.0) == pytest.approx((-1.0, 0.0, 0.0))
    assert from_ned(ROUND, 0.0, 0.0, 0.0, 1.0, 0.0) == pytest.approx((0.0, 1.0, 0.0))


def test_flat_earth_pulls_down_evenly():
    earth = flat_earth(9.80665)
    assert gravity(earth, 1e5, -2e5, -3e4) == (0.0, 0.0, 9.80665)
    assert geodetic(earth, 1e5, -2e5, -3e4)[2] == 3e4


def test_unknown_earth_is_refused():
    with pytest.raises(InputError, match="wgs84"):
        named_earth("pear")


def test_winds():
    assert wind_ned(steady_wind(1.0, 2.0, 3.0), 12_345.0) == (1.0, 2.0, 3.0)
    assert wind_ned(sheared_wind((0.0, -6.096, 0.0), (0.0, 0.003, 0.0)), 9144.0) == pytest.approx(
        (0.0, 21.336, 0.0)
    )
    table = table_wind([0.0, 1e3, 3e3], [0.0, 5.0, 6.0], [1.0, 1.0, -1.0])
    assert wind_ned(table, 1e3) == pytest.approx((5.0, 1.0, 0.0))
    assert wind_ned(table, -500.0) == pytest.approx((0.0, 1.0, 0.0))
    assert wind_ned(table, 1e5) == pytest.approx((6.0, -1.0, 0.0))


@pytest.mark.parametrize(
    "columns",
    [
        ([0.0], [0.0], [0.0]),
        ([0.0, 0.0], [0.0, 1.0], [0.0, 1.0]),
        ([0.0, 1.0], [0.0, 1.0, 2.0], [0.0, 1.0]),
        ([0.0, 1.0], [0.0, math.nan], [0.0, 1.0]),
    ],
)
def test_bad_wind_tables_are_refused(columns):
    with pytest.raises(InputError, match="wind table"):
        table_wind(*columns)
