"""Golden point-mass and six-degree-of-freedom entries (SciPy DOP853 at 1e-12, independent formulation)."""

import math

import numpy as np
import pytest
from flight_data import column, rows

from sim.aero.given_coefficients import GivenCoefficients
from sim.air.atmosphere import exponential
from sim.flight.trajectory import Body, Environment, InitialState, Integration, fly_body

ENTRY = (82_000.0, 4300.0, -15.0)


def point_mass(ballistic_coefficient):
    return Body.with_coefficients(
        ballistic_coefficient, (1.0, 1.0, 1.0), 1.0, 1.0, GivenCoefficients(drag=1.0, nose_radius_m=0.2)
    )


# Body B: axial coefficient 0.2, force slope 2, moment slope -0.3, damping -2 per q d/2V.
BODY_B = Body.with_coefficients(
    600.0,
    (70.0, 450.0, 450.0),
    1.0,
    1.12838,
    GivenCoefficients(axial=0.2, normal_slope=2.0, pitch_slope=-0.3, pitch_damping=-2.0, yaw_damping=-2.0),
)


def flown_b(rtol=1e-11):
    return fly_body(BODY_B, InitialState.entry(*ENTRY, alpha_deg=30.0), integration=Integration(rtol=rtol))


@pytest.mark.parametrize("beta", [500, 2000, 5000])
def test_point_mass_entry(beta):
    flown = fly_body(point_mass(beta), InitialState.entry(*ENTRY), integration=Integration(rtol=1e-11))
    expected = [row for row in rows("golden_3dof.csv") if row["beta_kgm2"] == str(beta)]
    at = flown.at(np.minimum(column(expected, "t_s"), flown.time_s[-1]))
    # The times are printed to 10 digits; everything else follows from them.
    np.testing.assert_allclose(at["altitude_m"], column(expected, "alt_m"), atol=2e-4)
    np.testing.assert_allclose(at["speed_m_s"], column(expected, "V_mps"), atol=2e-5)
    np.testing.assert_allclose(at["path_angle_deg"], column(expected, "gamma_deg"), atol=1e-6)
    np.testing.assert_allclose(at["downrange_m"], column(expected, "downrange_m"), atol=1e-3)
    np.testing.assert_allclose(
        at["stagnation_heat_load_J_m2"], column(expected, "stag_heat_load_Jm2"), rtol=2e-8
    )


@pytest.mark.parametrize("beta", [500, 2000, 5000])
def test_point_mass_extremes(beta):
    (expected,) = (row for row in rows("golden_3dof_summary.csv") if row["beta_kgm2"] == str(beta))
    events = fly_body(
        point_mass(beta), InitialState.entry(*ENTRY), integration=Integration(rtol=1e-11)
    ).events
    assert events["impact"].time_s == pytest.approx(float(expected["time_to_ground_s"]), abs=1e-6)
    assert events["impact"].value == pytest.approx(float(expected["V_impact"]), abs=1e-6)
    assert events["impact"].altitude_m == pytest.approx(0.0, abs=1e-6)
    for event, value, height in (
        ("peak_load", "decel_max_g0", "h_decel_max"),
        ("peak_dynamic_pressure", "qbar_max_Pa", "h_qbar_max"),
        ("peak_heating", "qstag_max_Wm2", "h_qstag_max"),
    ):
        # The reference took the largest of dense samples, so its altitudes are good to some metres.
        assert events[event].value == pytest.approx(float(expected[value]), rel=1e-7)
        assert events[event].altitude_m == pytest.approx(float(expected[height]), abs=5.0)


def test_six_degrees_of_freedom_entry():
    flown = flown_b()
    expected = rows("golden_6dof.csv")
    at = flown.at(np.minimum(column(expected, "t_s"), flown.time_s[-1]))
    np.testing.assert_allclose(at["altitude_m"], column(expected, "alt_m"), atol=2e-4)
    np.testing.assert_allclose(at["speed_m_s"], column(expected, "V_mps"), atol=3e-5)
    np.testing.assert_allclose(at["path_angle_deg"], column(expected, "gamma_deg"), atol=3e-6)
    np.testing.assert_allclose(at["downrange_m"], column(expected, "downrange_m"), atol=1e-3)
    np.testing.assert_allclose(at["alpha_deg"], column(expected, "alpha_deg"), atol=3e-4)
    np.testing.assert_allclose(at["pitch_rate_deg_s"], column(expected, "q_deg_s"), atol=3e-3)
    assert flown.time_s[-1] == pytest.approx(99.6761253, abs=1e-6)
    assert flown.final("speed_m_s") == pytest.approx(247.675392, abs=1e-5)
    assert flown.final("downrange_m") == pytest.approx(241_895.766, abs=1e-2)


def test_spinning_entry():
    """The same body released with 10 rad/s of roll: precession carries it sideways."""
    start = InitialState.entry(*ENTRY, alpha_deg=30.0, rates_deg_s=(math.degrees(10.0), 0.0, 0.0))
    flown = fly_body(BODY_B, start, integration=Integration(rtol=1e-10))
    assert flown.time_s[-1] == pytest.approx(99.978819, abs=2e-6)
    assert abs(flown.final("crossrange_m")) == pytest.approx(202.43, abs=5e-3)


def test_planar_motion_stays_planar():
    flown = flown_b()
    assert np.abs(flown.crossrange_m).max() < 1e-6
    assert np.abs(flown.roll_rate_deg_s).max() < 1e-9


def test_quaternion_keeps_its_norm():
    quaternion = flown_b(1e-9).path.states[:, 6:10]
    assert np.abs(np.linalg.norm(quaternion, axis=1) - 1.0).max() < 1e-6


def smooth_flight(**integration):
    """Body B for 30 s through an exponential atmosphere, whose derivatives have no jumps."""
    return fly_body(
        BODY_B,
        InitialState.entry(*ENTRY, alpha_deg=30.0),
        Environment(atmosphere=exponential()),
        Integration(duration_s=30.0, **integration),
    ).path.states[-1]


def test_error_falls_as_the_tolerance_does():
    exact = smooth_flight(rtol=1e-13)
    errors = [np.abs(smooth_flight(rtol=rtol) - exact)[:3].max() for rtol in (1e-5, 1e-7, 1e-9)]
    assert errors[1] < 0.02 * errors[0]
    assert errors[2] < 0.02 * errors[1]


def test_convergence_order_is_five():
    """Halving fixed steps: the tolerance is so loose that only the largest step acts."""
    exact = smooth_flight(rtol=1e-13)
    steps = (0.2, 0.1, 0.05)
    errors = np.array([np.abs(smooth_flight(rtol=1e-2, largest_step_s=step) - exact) for step in steps])
    for states in (slice(0, 3), slice(3, 6), slice(6, 10)):
        error = errors[:, states].max(axis=1)
        assert np.all(np.log2(error[:-1] / error[1:]) > 4.8)
