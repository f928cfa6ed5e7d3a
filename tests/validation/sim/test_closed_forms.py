"""Closed-form flights: Allen-Eggers, Kepler, Euler, Allen's incidence convergence, a falling body."""

import math

import numpy as np
import pytest
from flight_data import closed_form
from scipy.special import j0, j1, y0, y1

from sim.aero.given_coefficients import GivenCoefficients
from sim.air.atmosphere import exponential
from sim.flight.earth import flat_earth
from sim.flight.trajectory import Body, Environment, InitialState, Integration, fly_body

ENTRY = (82_000.0, 4300.0, -15.0)
WEIGHTLESS = Environment(flat_earth(0.0), exponential(1.225, 7200.0))
SINE = math.sin(math.radians(15.0))


def allen_eggers(beta, **integration):
    body = Body.with_coefficients(
        float(beta), (1.0, 1.0, 1.0), 1.0, 1.0, GivenCoefficients(drag=1.0, nose_radius_m=0.2)
    )
    return fly_body(body, InitialState.entry(*ENTRY), WEIGHTLESS, Integration(rtol=1e-11, **integration))


@pytest.mark.parametrize("beta", [500, 2000, 3317])
def test_allen_eggers_peaks(beta):
    flown = allen_eggers(beta, duration_s=100.0)
    # The closed forms start at infinity; flying from 82 km instead multiplies V by this factor's root.
    start = math.exp(1.225 * math.exp(-82_000 / 7200) * 7200 / (beta * SINE))

    def expected(quantity):
        return closed_form(f"Allen-Eggers beta={beta}", quantity)

    load, heat = flown.maximum("load_factor_g"), flown.maximum("stagnation_heat_flux_W_m2")
    assert load.value == pytest.approx(start * expected("peak decel"), rel=1e-8)
    assert load.altitude_m == pytest.approx(expected("altitude of peak decel"), abs=0.3)
    assert heat.value == pytest.approx(start**1.5 * expected("peak stag heat flux"), rel=1e-8)
    assert heat.altitude_m == pytest.approx(expected("altitude of peak stag heating"), abs=0.3)
    for event, quantity in ((load, "V at peak decel"), (heat, "V at peak heating")):
        speed = flown.at(event.time_s)["speed_m_s"][0]
        assert speed == pytest.approx(math.sqrt(start) * expected(quantity), rel=2e-5)


def test_allen_eggers_speed_of_the_light_body():
    """It would reach the ground at 7e-12 m/s after 1e14 s; flown to 12 km it follows the same formula."""
    entry = 1.225 * math.exp(-82_000 / 7200)

    def speed(height_m):
        density = 1.225 * np.exp(-height_m / 7200)
        return 4300.0 * np.exp(-(density - entry) * 7200 / (2 * 500 * SINE))

    assert speed(0.0) == pytest.approx(closed_form("Allen-Eggers beta=500", "V at ground"), rel=1e-9)
    flown = allen_eggers(500, duration_s=2000.0)
    assert flown.final("altitude_m") < 13e3
    assert flown.final("speed_m_s") < 5.0
    np.testing.assert_allclose(flown["speed_m_s"], speed(flown["altitude_m"]), rtol=2e-7)


@pytest.mark.parametrize("beta", [2000, 3317])
def test_allen_eggers_at_the_ground(beta):
    flown = allen_eggers(beta, longest_s=1e6, largest_step_s=1e3)
    case = f"Allen-Eggers beta={beta}"
    assert flown.final("speed_m_s") == pytest.approx(closed_form(case, "V at ground"), rel=1e-7)
    assert flown.final("stagnation_heat_load_J_m2") == pytest.approx(
        closed_form(case, "heat load to ground"), rel=1e-9
    )


def test_allen_eggers_heat_load_of_the_light_body():
    flown = allen_eggers(500, duration_s=1e5)  # by then it hangs in the air
    assert flown.final("stagnation_heat_load_J_m2") == pytest.approx(
        closed_form("Allen-Eggers beta=500", "heat load to ground"), rel=1e-7
    )


def test_vacuum_kepler_arc():
    body = Body.with_coefficients(100.0, (1.0, 1.0, 1.0), 1.0, 1.0, GivenCoefficients())
    flown = fly_body(body, InitialState.entry(*ENTRY), integration=Integration(rtol=1e-12))
    case = "vacuum Kepler arc"
    assert flown.time_s[-1] == pytest.approx(closed_form(case, "time to ground"), abs=1e-8)
    assert flown.final("speed_m_s") == pytest.approx(closed_form(case, "impact speed"), abs=1e-6)
    assert math.degrees(flown.final("downrange_m") / 6_371_000) == pytest.approx(
        closed_form(case, "downrange angle"), abs=2e-9
    )
    assert flown.final("path_angle_deg") == pytest.approx(closed_form(case, "impact flight-path"), abs=1e-8)
    r, v = flown.path.states[:, :3], flown.path.states[:, 3:6]
    energy = 0.5 * np.sum(v**2, axis=1) - 3.986004418e14 / np.linalg.norm(r, axis=1)
    momentum = np.linalg.norm(np.cross(r, v), axis=1)
    np.testing.assert_allclose(energy, closed_form(case, "specific energy"), rtol=1e-9)
    np.testing.assert_allclose(momentum, closed_form(case, "specific angular momentum"), rtol=1e-9)
    np.testing.assert_allclose(energy, energy[0], rtol=1e-12)


def spinning(inertia, rates_deg_s, duration):
    body = Body.with_coefficients(1.0, inertia, 1.0, 1.0, GivenCoefficients())
    return fly_body(
        body,
        InitialState(9144.0, rates_deg_s=rates_deg_s),
        Environment(flat_earth(0.0)),
        Integration(rtol=1e-12, duration_s=duration),
    )


def test_torque_free_symmetric_body():
    case = "torque-free symmetric"
    flown = spinning((70.0, 450.0, 450.0), tuple(np.degrees([10.0, 1.0, 0.0])), 10.0)
    p, q, r = flown.path.states[-1, 10:13]
    assert p == pytest.approx(10.0, abs=1e-12)
    assert q == pytest.approx(closed_form(case, "q at t=10"), abs=1e-8)
    assert r == pytest.approx(closed_form(case, "r at t=10"), abs=1e-8)
    phase = np.unwrap(np.arctan2(-flown.path.states[:, 12], flown.path.states[:, 11]))
    turning = (phase[-1] - phase[0]) / flown.time_s[-1]
    assert turning == pytest.approx(closed_form(case, "body-frame transverse rate"), rel=1e-8)
    # The angular momentum is fixed in space; the body axis cones around it at H/It.
    momentum = flown.path.states[:, 10:13] * np.array([70.0, 450.0, 450.0])
    cone = np.degrees(np.arctan2(np.hypot(momentum[:, 1], momentum[:, 2]), momentum[:, 0]))
    np.testing.assert_allclose(cone, closed_form(case, "coning half-angle"), rtol=1e-9)
    inertial = np.array([rotation(y).T @ h for y, h in zip(flown.path.states, momentum, strict=True)])
    np.testing.assert_allclose(inertial, np.tile(inertial[0], (len(inertial), 1)), atol=1e-6)
    axis = np.array([rotation(y)[0] for y in flown.path.states])
    direction = inertial[0] / np.linalg.norm(inertial[0])
    side = np.cross(direction, axis[0])
    side /= np.linalg.norm(side)
    turned = np.unwrap(np.arctan2(axis @ side, axis @ np.cross(side, direction)))
    rate = (turned[-1] - turned[0]) / flown.time_s[-1]
    assert rate == pytest.approx(closed_form(case, "inertial precession"), rel=1e-8)


def rotation(state):
    a, b, c, d = state[6:10] / np.linalg.norm(state[6:10])
    return np.array(
        [
            [a * a + b * b - c * c - d * d, 2 * (b * c + a * d), 2 * (b * d - a * c)],
            [2 * (b * c - a * d), a * a - b * b + c * c - d * d, 2 * (c * d + a * b)],
            [2 * (b * d + a * c), 2 * (c * d - a * b), a * a - b * b - c * c + d * d],
        ]
    )


def test_torque_free_asymmetric_body_follows_the_elliptic_functions():
    brick = (0.00256821750, 0.00842101104, 0.00975465594)
    flown = spinning(brick, (10.0, 20.0, 30.0), 30.0)
    case = "NESC brick torque-free"
    at = flown.at([10.0, 20.0, 30.0])
    for index, time in enumerate((10, 20, 30)):
        for letter, name in zip("pqr", ("roll", "pitch", "yaw"), strict=True):
            expected = closed_form(case, f"{letter} at t={time}")
            assert at[f"{name}_rate_deg_s"][index] == pytest.approx(expected, abs=2e-6)
    period = closed_form(case, "period of body rates")
    state = flown.states_at(period)[0]
    np.testing.assert_allclose(np.degrees(state[10:13]), (10.0, 20.0, 30.0), atol=2e-6)
    inertia = np.array(brick)
    energy = flown.path.states[:, 10:13] ** 2 @ inertia
    np.testing.assert_allclose(energy, energy[0], rtol=1e-10)


# Constant speed on a straight line: a body too heavy to be slowed, and a linear restoring moment.
SPEED, SLOPE, INERTIA = 4300.0, -0.269, 450.0
# Its base: nose radius 0.2 m, cones of 9 and 11 deg, 1.2 m each (printed rounded as 1.21096 m2, 1.24171 m).
LENGTH = 2 * (0.2 * math.cos(math.radians(9)) + 1.2 * sum(math.tan(math.radians(a)) for a in (9, 11)))
AREA = math.pi * LENGTH**2 / 4
HEAVY = Body.with_coefficients(
    1e15, (INERTIA, INERTIA, INERTIA), AREA, LENGTH, GivenCoefficients(pitch_slope=SLOPE)
)
HEIGHTS = (70, 60, 50, 40, 30)


def incidence(start_ratio, rate_ratio, heights_km):
    """alpha/alpha0 at some heights; `rate_ratio` is the initial d(alpha)/dt over alpha0."""
    alpha0 = 1e-2  # deg: small enough for sin(alpha) = alpha to eight digits
    start = InitialState.entry(
        *ENTRY, alpha_deg=alpha0 * start_ratio, rates_deg_s=(0.0, alpha0 * rate_ratio, 0.0)
    )
    flown = fly_body(HEAVY, start, WEIGHTLESS, Integration(rtol=1e-12, longest_s=80.0))
    times = (82_000.0 - 1e3 * np.array(heights_km)) / (SPEED * SINE)
    return flown.at(times)["alpha_deg"] / alpha0


def test_allen_incidence_convergence():
    pressure = 0.5 * 1.225 * math.exp(-82_000 / 7200) * SPEED**2
    frequency = math.sqrt(pressure * AREA * LENGTH * -SLOPE / INERTIA)
    x = 2 * 7200 * frequency / (SPEED * SINE)
    assert j0(x) == pytest.approx(closed_form("Allen J0 (", "alpha/alpha0 at h=82 km"), abs=3e-9)
    expected = [closed_form("Allen J0 (", f"alpha/alpha0 at h={h} km") for h in HEIGHTS]
    np.testing.assert_allclose(incidence(j0(x), -j1(x) * frequency, HEIGHTS), expected, atol=2e-7)


def test_allen_incidence_released_at_rest():
    case = "Allen Bessel, released"
    heights = (75, *HEIGHTS)
    expected = [closed_form(case, f"alpha/alpha0 at h={h} km") for h in heights]
    np.testing.assert_allclose(incidence(1.0, 0.0, heights), expected, atol=2e-7)


def argument(height_km):
    """Argument of the Bessel functions, 2 H w/(V sin gamma), at some heights; and w itself."""
    pressure = 0.5 * 1.225 * np.exp(-1e3 * np.asarray(height_km) / 7200) * SPEED**2
    frequency = np.sqrt(pressure * AREA * LENGTH * -SLOPE / INERTIA)
    return 2 * 7200 * frequency / (SPEED * SINE), frequency


def test_constants_of_the_release_at_rest():
    """c1 and c2 from what was flown: two heights decide them."""
    flown = incidence(1.0, 0.0, (60, 40))
    x, _ = argument((60, 40))
    c1, c2 = np.linalg.solve(np.stack([j0(x), y0(x)], axis=1), flown)
    case = "Allen Bessel, released"
    assert c1 == pytest.approx(closed_form(case, "c1"), abs=2e-6)
    assert c2 == pytest.approx(closed_form(case, "c2"), abs=2e-6)


def test_envelope_of_the_incidence():
    """Two flights a quarter period apart span the envelope: J0^2 + Y0^2 = 2/(pi x) (1 - 1/(8 x^2) + ...)."""
    heights = (60, 40, 30)
    x0, frequency = argument(82)
    first = incidence(j0(x0), -j1(x0) * frequency, heights)
    second = incidence(y0(x0), -y1(x0) * frequency, heights)
    x, _ = argument(heights)
    flown = np.hypot(first, second) * (1 + 1 / (16 * x**2))
    expected = [closed_form("Allen J0", f"envelope at {h} km") for h in heights]
    np.testing.assert_allclose(flown, expected, rtol=2e-6)


def test_tricyclic_frequency_of_a_spinning_body():
    """Fire II's spin, dynamic pressure and frequency; the published number fixes k for any inertia ratio."""
    case = "Fire II tricyclic"
    spin, expected = 17.907, closed_form(case, "body-axis freq")
    axial, transverse, pressure = 90.0, 100.0, 117_344.0
    a = axial * spin / (2 * transverse)
    stiffness = ((expected - spin + a) ** 2 - a**2) / pressure  # -Cma S d / I
    body = Body.with_coefficients(
        1e15,
        (axial, transverse, transverse),
        1.0,
        1.0,
        GivenCoefficients(pitch_slope=-stiffness * transverse),
    )
    speed, alpha = 6000.0, 1e-5
    density = 2 * pressure / speed**2
    # the backward mode alone: the axis circles the airflow against the spin
    rate = a - math.sqrt(a**2 + pressure * stiffness)
    start = InitialState.entry(
        40e3,
        speed,
        0.0,
        alpha_deg=math.degrees(alpha),
        rates_deg_s=(math.degrees(spin), 0.0, math.degrees(alpha * rate)),
    )
    still = Environment(flat_earth(0.0), exponential(density, 1e15))
    flown = fly_body(body, start, still, Integration(rtol=1e-12, duration_s=5.0))
    radians = np.radians([flown["alpha_deg"], flown["beta_deg"]])
    assert np.ptp(np.hypot(*radians)) < 1e-4 * alpha
    phase = np.unwrap(np.arctan2(radians[1], radians[0]))
    turning = (phase[-1] - phase[0]) / flown.time_s[-1]
    assert abs(turning) == pytest.approx(expected, rel=1e-6)


def test_vertical_fall_with_quadratic_drag():
    density, gravity, terminal = 1.2, 9.80665, 50.0
    mass = 0.5 * density * terminal**2 / gravity
    body = Body.with_coefficients(mass, (1.0, 1.0, 1.0), 1.0, 1.0, GivenCoefficients(drag=1.0))
    uniform = Environment(flat_earth(gravity), exponential(density, 1e15))
    flown = fly_body(body, InitialState(1000.0), uniform, Integration(rtol=1e-12, duration_s=5.0))
    assert flown.final("speed_m_s") == pytest.approx(closed_form("vertical fall", "V at 5 s"), abs=1e-7)
    fallen = 1000.0 - flown.final("altitude_m")
    assert fallen == pytest.approx(closed_form("vertical fall", "distance at 5 s"), abs=1e-6)
