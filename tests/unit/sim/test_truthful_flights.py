"""Flights outside the study's example: flips, heat with a sign, limits told, attitudes rebuilt."""

import math

import numpy as np
import pytest

from sim.aero.coefficients import Air, coefficients
from sim.aero.given_coefficients import GivenCoefficients
from sim.aero.methods import Wall
from sim.aero.pressure_laws.meeting import meeting, meeting_radius_m
from sim.air.standards import us1962, us1976
from sim.body.geometry import BodyShape, cone, cylinder, flare, sphere_cone
from sim.body.vehicle import reference_vehicle, vehicle_from_shape
from sim.core.errors import FlightError, InputError
from sim.flight.dynamics import nose_first_margin
from sim.flight.earth import ROUND, WGS84
from sim.flight.trajectory import Body, Environment, InitialState, Integration, fly_body
from sim.reentry import evaluate, fly, surface_body
from sim.settings import MethodSettings

FLIPPING = {"cg_fraction": 0.60, "rtol": 1e-5}
"""Behind the centre of pressure of the corner (5, 10, 0.3) of the design box, not of the middle."""
CORNER, CENTRE = (5.0, 10.0, 0.3), (7.5, 12.5, 0.225)


@pytest.fixture(scope="module")
def flipped():
    return fly(*CORNER, **FLIPPING)


@pytest.fixture(scope="module")
def steady():
    return fly(*CENTRE)


def told(flight, word):
    return [note for note in flight.notes if note.startswith(word)]


def test_a_flip_is_reported(flipped, steady):
    events = flipped.events
    assert events["largest_incidence"].value > 170.0
    assert events["smallest_static_margin"].value < 0.0
    turned = events["turned_over"]
    assert flipped.at(turned.time_s)["total_alpha_deg"][0] == pytest.approx(90.0, abs=1e-3)
    before = flipped.at(np.linspace(0.0, turned.time_s, 200)[:-1])["total_alpha_deg"]
    assert before.max() < 90.0
    assert told(flipped, "base first")
    assert told(flipped, "unstable")
    assert "turned_over" not in steady.events
    assert steady.events["largest_incidence"].value == pytest.approx(30.0, abs=0.1)
    assert not told(steady, "base first")
    assert not told(steady, "unstable")


def test_a_flip_wins_by_the_papers_measures_and_loses_by_the_others():
    bad, good = evaluate(*CORNER, **FLIPPING), evaluate(*CENTRE)
    assert bad["axial_integral"] < 0.0 < good["axial_integral"]  # the trap
    assert bad["mean_static_margin"] < 0.0 < good["mean_static_margin"]  # the constraint that shuts it
    assert bad["largest_incidence_deg"] > 90.0 > good["largest_incidence_deg"]
    assert bad["base_first_s"] > 100.0
    assert good["base_first_s"] == 0.0
    honest = {"axial": "drag", "margin": "negated"}
    bad, good = evaluate(*CORNER, **FLIPPING, **honest), evaluate(*CENTRE, **honest)
    assert 0.0 < good["axial_integral"] < bad["axial_integral"]
    assert good["margin_inverse"] < 0.0 < bad["margin_inverse"]


def test_the_margin_counts_negative_base_first():
    assert nose_first_margin(0.3, 1.0) == 0.3
    assert nose_first_margin(-0.3, 1.0) == -0.3
    assert nose_first_margin(0.3, math.pi) == -0.3
    assert nose_first_margin(-0.3, math.pi) == -0.3
    assert nose_first_margin(0.3, 0.5 * math.pi) == pytest.approx(0.0, abs=1e-15)


def test_drag_is_the_force_against_the_stream(steady):
    alpha = np.radians(steady.total_alpha_deg)
    np.testing.assert_allclose(steady.CD, steady.CA * np.cos(alpha) + steady.CN * np.sin(alpha), rtol=1e-12)
    t = np.linspace(0.0, steady.time_s[-1], 20_001)
    assert steady.final("drag_integral_s") == pytest.approx(np.trapezoid(steady.at(t)["CD"], t), rel=1e-4)


def test_stagnation_heat_follows_the_radius_that_meets_the_stream():
    vehicle = reference_vehicle(*CENTRE)
    state = us1962()(40e3)
    air = Air(float(state.pressure_Pa), float(state.density_kg_m3), float(state.temperature_K))
    flux = coefficients(
        vehicle, 12.0, [0.0, 40.0, 82.0, 90.0, 180.0], "paper", air=air
    ).stagnation_heat_flux_W_m2
    # the sphere has a normal into the stream up to 90 - 7.5 deg
    assert flux[1] == pytest.approx(flux[0], rel=1e-12)
    assert flux[2] == pytest.approx(flux[0], rel=1e-12)
    # a side of the same radius has half the mean curvature of the sphere; flux goes with its square root. The
    # smooth minimum with the free-molecular limit (30 times the flux) leaves a thousandth.
    assert flux[3] / flux[0] == pytest.approx(math.sqrt(0.5), rel=2e-3)
    # a flat base: 0.3 of the velocity gradient of a hemisphere of its radius
    expected = math.sqrt(0.3 * CENTRE[2] / vehicle.shape.base_radius_m)
    assert flux[4] / flux[0] == pytest.approx(expected, rel=2e-3)


def test_the_meeting_radius_is_continuous():
    for shape in (
        reference_vehicle(*CENTRE).shape,
        sphere_cone(60.0, 0.2, 0.4),
        sphere_cone(9.0, 0.0, 0.5),
        BodyShape(1.0, cap_angle_deg=65.0),
        BodyShape(0.3, (cone(-5.0, 0.5),)),
    ):
        place = meeting(shape)
        radius = [meeting_radius_m(a, place) for a in np.linspace(0.0, math.pi, 4001)]
        # the narrowest passage, 1 deg in 22 steps, is a cubic whose slope is at most 1.5 times the mean
        decades = np.log10(radius)
        assert max(np.abs(np.diff(decades))) < 1.5 / 22 * np.ptp(decades)
        assert radius[-1] == pytest.approx(shape.base_radius_m / 0.3, rel=1e-12)


def test_what_flows_in_is_never_negative_and_a_hot_wall_gives_back(steady):
    hot = evaluate(*CENTRE)
    assert 0.0 < hot["total_surface_heat_J"] < hot["total_surface_heat_inflow_J"]
    assert evaluate(*CENTRE, heat="surface")["heat_integral"] == hot["total_surface_heat_inflow_J"]
    assert told(steady, "heat given back")
    slow = {"speed_m_s": 900.0, "altitude_m": 30e3, "theta_deg": -45.0, "alpha_deg": 0.0}
    given = evaluate(*CENTRE, **slow)
    assert given["total_surface_heat_J"] < 0.0
    assert given["heat_integral"] < 0.0  # the paper's sum of the flux, with its 1,000 K wall
    assert evaluate(*CENTRE, **slow, heat="surface")["heat_integral"] == 0.0
    assert evaluate(*CENTRE, **slow, heat="stagnation_inflow")["heat_integral"] == 0.0
    cool = evaluate(*CENTRE, **slow, wall="radiative")
    assert cool["heat_integral"] > 0.0
    assert cool["total_surface_heat_J"] == pytest.approx(cool["total_surface_heat_inflow_J"], rel=1e-9)


def test_the_wall_radiates_but_in_the_readings_of_the_paper():
    kinds = {name: MethodSettings(preset=name).walls.kind for name in ("paper", "literal", "physics", "best")}
    assert kinds == {"paper": "fixed", "literal": "fixed", "physics": "radiative", "best": "radiative"}
    assert MethodSettings(preset="best", wall="fixed").walls == Wall("fixed")


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({}, {"Mach numbers below the laws", "heat given back"}),
        (
            {"speed_m_s": 11_000.0, "altitude_m": 115e3},
            {"thin air", "faster than the air model", "heat by radiation left out"},
        ),
        ({"preset": "best"}, {"fitted law out of its range"}),
        ({"alpha_deg": 80.0, "altitude_m": 50e3}, {"incidence beyond the laws"}),
    ],
)
def test_limits_are_told_with_numbers(settings, words):
    notes = fly(*CENTRE, rtol=1e-5, **settings).notes
    assert words <= {note.split(":")[0].split(" (")[0] for note in notes}
    assert all(any(sign.isdigit() for sign in note) for note in notes)


def test_pointed_and_blunt_bodies_are_told():
    start = InitialState.entry(60e3, 4000.0, -30.0)
    brief = Integration(rtol=1e-5, duration_s=2.0)
    sharp = fly_body(surface_body(vehicle_from_shape(sphere_cone(9.0, 0.0, 0.5))), start, None, brief)
    assert told(sharp, "pointed nose")
    capsule = vehicle_from_shape(sphere_cone(60.0, 0.2, 0.4))
    assert told(fly_body(surface_body(capsule), start, None, brief), "blunt face")
    knowing = surface_body(capsule, MethodSettings(preset="physics"))
    assert not told(fly_body(knowing, start, None, brief), "blunt face")


@pytest.mark.parametrize("height_m", [30e3, 150e3])
def test_a_drop_from_rest_begins_as_a_free_fall(height_m):
    body = surface_body(reference_vehicle(*CENTRE))
    start = InitialState(height_m, attitude_deg=(0.0, -60.0, 0.0))
    flown = fly_body(body, start, None, Integration(rtol=1e-6, duration_s=1.0))
    gravity = 3.986004418e14 / (6371e3 + height_m) ** 2  # the round Earth's, docs/flight.md
    assert flown.final("speed_m_s") == pytest.approx(gravity, rel=1e-3)


def test_a_skip_out_keeps_its_history():
    with pytest.raises(FlightError) as caught:
        evaluate(*CENTRE, theta_deg=60.0, speed_m_s=9000.0, rtol=1e-5)
    history = caught.value.history
    assert history.final("time_s") == caught.value.time_s
    assert "skip_out" in history.events
    assert "impact" not in history.events
    assert told(history, "skip-out")


@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        ({"speed_m_s": 1e6}, "speed_m_s must be at most 75000 m/s, not 1e[+]06"),
        ({"alpha_deg": 400.0}, "alpha_deg must lie between -180 and 180, not 400"),
        ({"nu_deg": -1e4}, "nu_deg must lie between -360 and 360"),
        ({"longitude_deg": 1e3}, "longitude_deg must lie between"),
        ({"roll_rate_deg_s": 1e9}, "roll_rate_deg_s must lie within"),
    ],
)
def test_speeds_and_angles_without_meaning_are_refused(settings, reason):
    with pytest.raises(InputError, match=reason):
        evaluate(*CENTRE, **settings)


def test_starts_without_meaning_are_refused():
    with pytest.raises(InputError, match="speed of velocity_ned_m_s must be at most"):
        InitialState(1e5, velocity_ned_m_s=(1e6, 0.0, 0.0))
    with pytest.raises(InputError, match="pitch of attitude_deg must lie between"):
        InitialState(1e5, attitude_deg=(0.0, 1e4, 0.0))
    with pytest.raises(InputError, match="q of rates_deg_s must lie within"):
        InitialState(1e5, rates_deg_s=(0.0, 1e6, 0.0))
    with pytest.raises(InputError, match="alpha_deg must lie between"):
        InitialState.entry(1e5, 7e3, -5.0, alpha_deg=270.0)


def rotation(yaw, pitch, roll):
    """Rotation matrix of yaw, pitch, roll in degrees: elementary rotations multiplied out here."""
    (cy, cp, cr), (sy, sp, sr) = (
        np.cos(np.radians([yaw, pitch, roll])),
        np.sin(np.radians([yaw, pitch, roll])),
    )
    about_x = np.array([[1, 0, 0], [0, cr, sr], [0, -sr, cr]])
    about_y = np.array([[cp, 0, -sp], [0, 1, 0], [sp, 0, cp]])
    about_z = np.array([[cy, sy, 0], [-sy, cy, 0], [0, 0, 1]])
    return about_x @ about_y @ about_z


@pytest.mark.parametrize("earth", [ROUND, WGS84], ids=["round", "wgs84"])
@pytest.mark.parametrize("pitch", [-90.0, 90.0, -89.9999999, 89.99999, -89.0, 20.0])
def test_the_three_angles_rebuild_the_attitude(pitch, earth):
    ball = Body.with_coefficients(100.0, (10.0, 30.0, 30.0), 0.3, 0.6, GivenCoefficients(drag=1.0))
    for yaw, roll in ((0.0, 0.0), (77.0, 0.0), (30.0, 40.0), (-170.0, 160.0)):
        start = InitialState(60e3, 10.0, 10.0, (0.0, 0.0, 3000.0), (yaw, pitch, roll))
        flown = fly_body(ball, start, Environment(earth, us1976()), Integration(duration_s=0.01))
        seen = flown.at(0.0)
        got = rotation(*(float(seen[name][0]) for name in ("yaw_deg", "pitch_deg", "roll_deg")))
        # angles are good to the square root of rounding near the pole, 1e-8 rad, as pitch comes from a cosine
        np.testing.assert_allclose(got, rotation(yaw, pitch, roll), atol=1e-7)


def test_a_straight_dive_has_steady_angles():
    ball = Body.with_coefficients(100.0, (10.0, 30.0, 30.0), 0.3, 0.6, GivenCoefficients(drag=1.0))
    start = InitialState(60e3, 10.0, 10.0, (0.0, 0.0, 3000.0), (0.0, -90.0, 0.0))
    seen = fly_body(ball, start, Environment(ROUND, us1976()), Integration(rtol=1e-9, duration_s=15.0))
    for name in ("yaw_deg", "roll_deg", "heading_deg"):
        np.testing.assert_allclose(seen[name], 0.0, atol=1e-6)


def test_a_boat_tailed_body_refers_to_its_largest_section():
    shape = BodyShape(0.2, (cone(10.0, 1.0), cylinder(0.5), flare(-8.0, 0.6)))
    vehicle = vehicle_from_shape(shape)
    widest = max(part.r1_m for part in shape.frusta)
    assert widest > shape.base_radius_m
    assert vehicle.reference_length_m == 2.0 * widest
    assert vehicle.reference_area_m2 == pytest.approx(math.pi * widest**2, rel=1e-15)
    narrow = reference_vehicle(7.5, -8.0, 0.225, reference="base")
    assert narrow.reference_length_m == 2.0 * narrow.shape.base_radius_m
    ball = BodyShape(0.5, cap_angle_deg=-40.0)  # the sphere goes on behind its equator
    assert vehicle_from_shape(ball).reference_length_m == 1.0
