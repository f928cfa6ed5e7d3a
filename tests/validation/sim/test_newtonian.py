"""Newtonian bodies against closed forms: spheres, sharp cones, blunted cones, the reference vehicle."""

import math
from dataclasses import replace
from itertools import groupby

import numpy as np
import pytest
from aero_data import paper_vehicle, rows

from sim.aero.coefficients import coefficients
from sim.body.geometry import BodyShape, cone, cylinder, sphere_cone
from sim.body.vehicle import vehicle_from_shape

BODIES = [
    (key, list(group))
    for key, group in groupby(rows("newtonian_spherecone"), lambda row: (row["theta_c_deg"], row["Rn_Rb"]))
]


def newtonian(body, alpha_deg, k=2.0):
    return coefficients(body, 10.0, alpha_deg, "newtonian", stagnation_cp=k)


@pytest.mark.parametrize(("body", "table"), BODIES, ids=lambda value: str(value) if len(value) == 2 else "")
def test_sphere_cones(body, table):
    half_angle, bluntness = body
    alpha = np.array([row["alpha_deg"] for row in table])
    got = newtonian(sphere_cone(half_angle, bluntness, 1.0), alpha)
    tolerance = np.where(alpha <= half_angle, 1e-6, 1e-4)
    for column, name in (("CA_K2", "CA"), ("CN_K2", "CN"), ("Cm_nose_K2", "CM_nose")):
        error = np.abs(getattr(got, name) - [row[column] for row in table])
        assert np.all(error <= tolerance), (name, alpha[error > tolerance])
    expected = np.array([row["Xcp_D"] for row in table])
    np.testing.assert_allclose(got.xcp_m[alpha > 0] / 2.0, expected[alpha > 0], rtol=1e-5)


@pytest.mark.parametrize("alpha_deg", [0.0, 3.0, 9.0])
def test_closed_forms_of_sphere_and_cone(alpha_deg):
    # Unshadowed closed forms: frustum from r1 to r2, and sphere cap down to the slope of the cone.
    k, th, a = 1.83, math.radians(9.0), math.radians(alpha_deg)
    rn, rb = 0.3, 1.0
    r1 = rn * math.cos(th)
    cap_ca = (
        k
        * rn**2
        * (0.5 * math.cos(a) ** 2 * (1 - math.sin(th) ** 4) + 0.25 * math.sin(a) ** 2 * math.cos(th) ** 4)
    )
    cap_cn = k * rn**2 * 0.5 * math.sin(a) * math.cos(a) * math.cos(th) ** 4
    ring = k * (rb**2 - r1**2)
    cone_ca = ring * (math.cos(a) ** 2 * math.sin(th) ** 2 + 0.5 * math.sin(a) ** 2 * math.cos(th) ** 2)
    cone_cn = ring * math.sin(a) * math.cos(a) * math.cos(th) ** 2
    x1, x2 = r1 / math.tan(th), rb / math.tan(th)  # from the virtual apex
    apex = rn / math.sin(th) - rn
    xcp = (2 / 3) * (x2**3 - x1**3) / (x2**2 - x1**2) / math.cos(th) ** 2 - apex
    got = newtonian(sphere_cone(9.0, rn, rb), alpha_deg, k)
    assert pytest.approx(cap_ca + cone_ca, abs=1e-8) == got.CA
    assert pytest.approx(cap_cn + cone_cn, abs=1e-8) == got.CN
    assert got.CM_nose == pytest.approx(-(cap_cn * rn + cone_cn * xcp) / 2.0, abs=1e-8)


@pytest.mark.parametrize("alpha_deg", [5.0, 30.0, 90.0])
def test_hemisphere_and_cylinder(alpha_deg):
    # A cylinder across the stream: CN = K sin^2(alpha) (4/3) r L / (pi r^2), at its middle.
    body = BodyShape(0.5, (cylinder(3.0),))
    cap = BodyShape(0.5)
    a = math.radians(alpha_deg)
    cylinder_cn = 2.0 * math.sin(a) ** 2 * (4.0 / 3.0) * 0.5 * 3.0 / (math.pi * 0.25)
    whole, nose = newtonian(body, alpha_deg), newtonian(cap, alpha_deg)
    assert pytest.approx(cylinder_cn, rel=1e-6) == whole.CN - nose.CN
    assert pytest.approx(float(nose.CA), abs=1e-9) == whole.CA
    assert whole.CM_nose - nose.CM_nose == pytest.approx(-cylinder_cn * 2.0, rel=1e-6)
    if alpha_deg == 90.0:  # half a hemisphere seen from the side: by symmetry CA = CN / 2 of a full one
        assert pytest.approx(2.0 * 0.125, abs=1e-4) == nose.CA


def test_sphere_drag_in_air():
    # Modified Newtonian hemisphere, CD = K/2: 0.916 at Mach 10 (NACA 1135 Cp_max); 0.926 with -1/M^2 behind.
    front = coefficients(BodyShape(1.0), 10.0, 0.0, "newtonian")
    assert pytest.approx(1.83167 / 2.0, abs=2e-5) == front.CA
    impact = coefficients(BodyShape(1.0), 10.0, 0.0, "physics", faces="impact")
    assert pytest.approx(0.926, abs=1e-3) == impact.CA


@pytest.mark.parametrize(
    "row", rows("newtonian_reference_vehicle"), ids=lambda row: f"{row['alpha_deg']:g}deg"
)
def test_reference_vehicle(row):
    got = newtonian(paper_vehicle(), row["alpha_deg"])
    assert pytest.approx(row["CA_K2"], abs=2e-6) == got.CA
    assert pytest.approx(row["CN_K2"], abs=1e-5) == got.CN
    assert got.CM_nose == pytest.approx(row["Cm_nose_K2"], abs=2e-5)


def test_published_side_by_side():
    # 9 deg, Rn/Rb = 0.3, Mach 10, 10 deg incidence: exact modified Newtonian, and MC-NEW's Monte Carlo.
    got = coefficients(sphere_cone(9.0, 0.3, 1.0), 10.0, 10.0, "newtonian")
    assert pytest.approx(0.145266, abs=2e-6) == got.CA
    assert pytest.approx(0.292398, abs=2e-6) == got.CN
    assert got.CM_nose == pytest.approx(-0.418989, abs=2e-6)
    assert (got.CA, got.CN, got.CM_nose) == pytest.approx((0.145264, 0.292321, -0.418808), abs=2e-4)


@pytest.mark.parametrize(("body", "table"), BODIES, ids=lambda value: str(value) if len(value) == 2 else "")
def test_pitch_damping_of_sphere_cones(body, table):
    vehicle = vehicle_from_shape(sphere_cone(*body, 1.0))
    length = vehicle.shape.length_m
    for column, fraction in (("Cmq_nose_K2", 0.0), ("Cmq_0p6L_K2", 0.6)):
        moved = replace(vehicle, cg_m=max(fraction * length, 1e-12 * length))
        assert newtonian(moved, 0.0).Cmq == pytest.approx(table[0][column], rel=1e-6)


def test_pitch_damping_against_monte_carlo():
    # MC-NEW: -4.2781 for 9 deg, Rn/Rb = 0.3, K = 1.8317 about the nose; per q D / V.
    vehicle = replace(vehicle_from_shape(sphere_cone(9.0, 0.3, 1.0)), cg_m=1e-12)
    assert newtonian(vehicle, 0.0, 1.8317).Cmq == pytest.approx(-4.2781, abs=3e-4)
    reference = paper_vehicle()
    for fraction, expected in ((0.50, -1.070), (0.55, -0.997), (0.60, -0.974)):
        moved = replace(reference, cg_m=fraction * reference.shape.length_m)
        assert newtonian(moved, 0.0, 1.83).Cmq == pytest.approx(expected, abs=1e-3)


def test_segments_in_any_order_add_up():
    # A cone cut in two is the same body; a flare is a cone further back.
    whole = BodyShape(0.1, (cone(8.0, 1.5),))
    halves = BodyShape(0.1, (cone(8.0, 0.7), cone(8.0, 0.8)))
    alpha = np.array([0.0, 6.0, 20.0, 60.0])
    for name in ("CA", "CN", "CM_nose"):
        np.testing.assert_allclose(
            getattr(newtonian(whole, alpha), name), getattr(newtonian(halves, alpha), name), atol=1e-12
        )
