"""Outline, sizes and mass of bodies of revolution; shapes that cannot exist."""

import math

import numpy as np
import pytest

from sim.body.geometry import BodyShape, cone, cylinder, flare, sphere_cone
from sim.body.mass import uniform_gyration_radii_m
from sim.body.vehicle import Vehicle, constants_table, reference_vehicle, tangency_margin_m
from sim.core.errors import InputError

OPTIMUM = (math.degrees(0.155727), math.degrees(0.191795), 0.20638)


def test_reference_design():
    vehicle = reference_vehicle(*OPTIMUM)
    shape = vehicle.shape
    assert shape.length_m == pytest.approx(2.874, abs=5e-4)
    assert shape.base_radius_m == pytest.approx(0.5910, abs=5e-5)
    assert vehicle.reference_area_m2 == pytest.approx(1.0973, abs=5e-5)
    assert vehicle.reference_length_m == pytest.approx(1.1820, abs=5e-5)
    assert shape.volume_m3 == pytest.approx(1.4515, abs=5e-5)
    assert shape.centroid_m / shape.length_m == pytest.approx(0.654, abs=5e-4)
    assert vehicle.cg_m == pytest.approx(1.581, abs=5e-4)
    assert vehicle.axial_inertia_kg_m2 == pytest.approx(104.0, abs=0.5)
    assert vehicle.transverse_inertia_kg_m2 == pytest.approx(565.0, abs=0.5)


def test_sizes_over_the_design_box():
    radii, lengths, volumes = [], [], []
    for c1 in (5.0, 10.0):
        for c2 in (10.0, 15.0):
            for rn in (0.15, 0.30):
                shape = reference_vehicle(c1, c2, rn).shape
                radii.append(shape.base_radius_m)
                lengths.append(shape.length_m)
                volumes.append(shape.volume_m3)
    assert (min(radii), max(radii)) == pytest.approx((0.413, 0.765), abs=5e-4)
    assert (min(lengths), max(lengths)) == pytest.approx((2.824, 2.974), abs=1e-3)
    assert (min(volumes), max(volumes)) == pytest.approx((0.64, 2.45), abs=0.02)


def test_closed_forms_of_volume_and_inertia():
    ball = BodyShape(0.7)  # half of one
    assert ball.volume_m3 == pytest.approx(2.0 / 3.0 * math.pi * 0.343, rel=1e-13)
    assert ball.centroid_m == pytest.approx(0.7 * 5.0 / 8.0, rel=1e-13)
    sharp = sphere_cone(20.0, 0.0, 1.0)
    height = 1.0 / math.tan(math.radians(20.0))
    assert sharp.length_m == pytest.approx(height, rel=1e-13)
    assert sharp.volume_m3 == pytest.approx(math.pi * height / 3.0, rel=1e-13)
    assert sharp.centroid_m == pytest.approx(0.75 * height, rel=1e-13)
    axial, transverse = uniform_gyration_radii_m(sharp)
    assert axial**2 == pytest.approx(0.3, rel=1e-12)
    assert transverse**2 == pytest.approx(3.0 / 80.0 * (4.0 + height**2), rel=1e-12)


def test_outline_is_tangent_and_continuous():
    shape = BodyShape(0.2, (cone(8.0, 0.5), cylinder(0.3), flare(12.0, 0.4), cone(-6.0, 0.2)))
    x, r = shape.outline(50)
    assert (x[0], r[0]) == (0.0, 0.0)
    assert (x[-1], r[-1]) == pytest.approx((shape.length_m, shape.base_radius_m))
    assert np.all(np.diff(x) > 0.0)
    assert np.allclose(r, [shape.radius_m(value) for value in x], atol=1e-12)
    xt, rt = shape.tangent_point_m
    h = 1e-6
    before = (rt - shape.radius_m(xt - h)) / h
    after = (shape.radius_m(xt + h) - rt) / h
    assert before == pytest.approx(after, abs=1e-4)
    assert after == pytest.approx(math.tan(math.radians(8.0)), rel=1e-6)


def test_a_cap_ends_where_its_slope_says():
    cap = sphere_cone(30.0, 1.0 / math.cos(math.radians(30.0)), 1.0)
    assert cap.segments == ()
    assert cap.base_radius_m == pytest.approx(1.0)
    assert cap.length_m == pytest.approx(1.1547 * 0.5, abs=1e-4)


def test_tangency_has_a_sign():
    assert tangency_margin_m(*OPTIMUM) == 1.6
    datum = {"length_1_datum": "nose_tip", "length_1_m": 0.2}
    assert tangency_margin_m(5.0, 12.0, 0.15, **datum) == pytest.approx(
        0.2 - 0.15 * (1 - math.sin(math.radians(5)))
    )
    assert tangency_margin_m(5.0, 12.0, 0.30, **datum) < 0.0
    with pytest.raises(InputError, match=r"cannot be tangent.*behind the first crank"):
        reference_vehicle(5.0, 12.0, 0.30, **datum)
    from_tip = reference_vehicle(8.0, 12.0, 0.2, length_1_datum="nose_tip")
    assert from_tip.shape.length_m == pytest.approx(1.6 + 0.4 + 0.7)


@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        ({"mass_kg": -1.0}, "mass_kg must be positive"),
        ({"mass_kg": math.nan}, "mass_kg must be a finite number, not nan"),
        ({"cg_fraction": 1.2}, "centre of gravity must lie on the body"),
        ({"length_2_m": -0.4}, "cylinder length must be positive"),
        ({"length_1_m": -0.4}, "cannot be tangent"),
        ({"axial_inertia_kg_m2": 2000.0}, "no mass distribution"),
        ({"reference": "wing"}, "reference must be one of largest, base, fixed"),
        ({"length_1_datum": "base"}, "length_1_datum"),
        ({"wings": 2}, "unknown vehicle setting wings; known: length_1_m"),
    ],
)
def test_impossible_vehicles_are_refused(settings, reason):
    with pytest.raises(InputError, match=reason):
        reference_vehicle(8.0, 12.0, 0.2, **settings)


@pytest.mark.parametrize(
    ("build", "reason"),
    [
        (lambda: reference_vehicle(8.0, 12.0, 0.0), "nose_radius_m must be positive"),
        (lambda: reference_vehicle(-5.0, -40.0, 0.2), "closes on the axis"),
        (lambda: BodyShape(-0.1), "nose radius must not be negative"),
        (lambda: BodyShape(0.0, (cylinder(1.0),)), "must start with a cone"),
        (lambda: BodyShape(0.1, (cone(90.0, 1.0),)), "half-angle must lie within"),
        (lambda: sphere_cone(0.0, 0.1, 1.0), "between 0 and 90 deg"),
        (lambda: sphere_cone(9.0, 2.0, 1.0), "wider than the base"),
        (lambda: BodyShape(0.2).radius_m(0.3), "outside the body"),
    ],
)
def test_impossible_shapes_are_refused(build, reason):
    with pytest.raises(InputError, match=reason):
        build()


def test_settings_change_the_vehicle():
    heavy = reference_vehicle(
        *OPTIMUM, mass_kg=500.0, cg_fraction=0.5, reference="fixed", transverse_inertia_kg_m2=300.0
    )
    assert (heavy.mass_kg, heavy.transverse_inertia_kg_m2) == (500.0, 300.0)
    assert (heavy.reference_area_m2, heavy.reference_length_m) == (1.0973, 1.1820)
    assert heavy.axial_inertia_kg_m2 == pytest.approx(0.5 * reference_vehicle(*OPTIMUM).axial_inertia_kg_m2)
    assert isinstance(heavy, Vehicle)


def test_every_constant_has_a_status():
    table = constants_table()
    assert {row["status"] for row in table} <= {"fitted", "inferred", "assumed"}
    assert table[0] == {
        "name": "length_1_m",
        "value": 1.6,
        "unit": "m",
        "status": "fitted",
        "note": "axial length of the first cone",
    }
