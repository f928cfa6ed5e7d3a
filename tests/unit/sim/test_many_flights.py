"""Flights through tables of the laws, and many of them at once."""

import pickle

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from sim import (
    Body,
    Environment,
    GivenCoefficients,
    InitialState,
    InputError,
    Integration,
    MethodSettings,
    fly_body,
    fly_many,
    reference_vehicle,
    sphere_cone,
    surface_body,
    tabulated,
    us1976,
)
from sim.aero.aerodynamics import CA, CM_NOSE, CN, STAGNATION_HEAT_FLUX, SURFACE_HEAT_RATE
from sim.aero.tables.axes import Axis, ruling
from sim.body.vehicle import vehicle_from_shape
from sim.flight.earth import ROUND
from sim.flight.integrator import evaluated
from sim.flight.many import _peak

QUICK = Integration(rtol=1e-6)
INSTANT = Integration(duration_s=1e-3)
STEEP = InitialState.entry(40_000.0, 3000.0, -60.0, alpha_deg=5.0)


@pytest.fixture(scope="module")
def body():
    return surface_body(reference_vehicle(7.5, 12.5, 0.225))


def test_interpolation_reproduces_parabolas_on_either_side_of_a_kink():
    knots = np.array([0.0, 0.3, 1.0, 1.2, 2.0, 2.5, 3.5, 4.0])
    rules = ruling([Axis(knots, kinks=(2.0,))])

    def true(x):
        return np.where(x < 2.0, 1.0 + 2.0 * x - 0.7 * x**2, 2.2 - 3.0 * (x - 2.0) + 0.4 * (x - 2.0) ** 2)

    for x in np.linspace(0.0, 3.999, 50):
        cell = int(np.searchsorted(knots, x, side="right")) - 1
        t = (x - knots[cell]) / (knots[cell + 1] - knots[cell])
        first = rules.first[0, cell]
        shares = rules.weights[0, cell] @ t ** np.arange(4)
        assert shares @ true(knots[first : first + 4]) == pytest.approx(true(x), abs=1e-13)


def states(rng, number, fastest):
    """States anywhere in the air, at any speed up to this and any incidence up to 60 deg."""
    rows = []
    for _ in range(number):
        height, speed = rng.uniform(0.0, 120e3), rng.uniform(0.05, 1.0) * fastest
        entry = InitialState.entry(height, speed, -30.0, alpha_deg=60.0 * rng.random() ** 2)
        rows.append(entry.state(ROUND))
    return np.array(rows)


@pytest.mark.parametrize(("preset", "fastest"), [("paper", 5e3), ("best", 8e3)])
def test_tabulated_loads_are_those_of_the_laws(preset, fastest):
    # docs/flight.md states 0.5 % of the largest at any one instant: the error goes with the third power of
    # the spacing of the knots where the laws are smooth, with its square where their curvature jumps
    vehicle = reference_vehicle(6.0, 14.0, 0.15)
    laws = surface_body(vehicle, MethodSettings(preset=preset))
    start, air = InitialState.entry(30e3, 2e3, -30.0), Environment(ROUND, us1976())
    asked = states(np.random.default_rng(5), 40, fastest)
    true = evaluated(fly_body(laws, start, air, INSTANT).flight, asked)[1]
    table = evaluated(fly_body(tabulated(laws), start, air, INSTANT).flight, asked)[1]
    for load in (CA, CN, CM_NOSE, STAGNATION_HEAT_FLUX, SURFACE_HEAT_RATE):
        assert_allclose(table[:, load], true[:, load], atol=5e-3 * np.abs(true[:, load]).max(), rtol=0.0)
        assert np.median(np.abs(table[:, load] - true[:, load])) < 1e-4 * np.abs(true[:, load]).max()


def test_a_batch_states_what_its_tables_are_off_by(body):
    starts = [
        InitialState.entry(70e3, 4300.0, angle, alpha_deg=10.0) for angle in np.linspace(-60.0, -40.0, 10)
    ]
    quick = fly_many(body, starts, integration=QUICK)
    laws = fly_many(body, starts, integration=QUICK, tables=False)
    assert len(quick) == 10
    assert quick.checked == (0, 4, 9)
    assert laws.checked == ()
    assert not laws.deviations
    for name, off in quick.deviations.items():
        assert off == np.abs(quick[name] - laws[name])[[0, 4, 9]].max()
    # 0.1 %, as docs/flight.md states, of every integral along the flight
    for name in (
        "axial_integral_s",
        "stagnation_heat_load_J_m2",
        "surface_heat_inflow_J",
        "margin_integral_s",
    ):
        assert_allclose(quick[name], laws[name], rtol=1e-3)
    assert_allclose(quick["time_s"], laws["time_s"], rtol=1e-4)
    assert quick.to_frame().shape == (10, len(quick.values))


def test_a_table_gives_the_same_numbers_whatever_was_flown_before(body):
    first, second = tabulated(body), pickle.loads(pickle.dumps(tabulated(body)))
    assert len(pickle.dumps(first)) < 100_000
    assert tabulated(first) is first
    fly_body(first, InitialState.entry(45e3, 2500.0, -70.0, alpha_deg=15.0), None, QUICK)
    assert_array_equal(
        fly_body(first, STEEP, None, QUICK).path.states, fly_body(second, STEEP, None, QUICK).path.states
    )


def test_outside_its_table_a_body_flies_by_the_laws(body):
    high = InitialState.entry(600e3, 7000.0, -10.0, alpha_deg=20.0)  # 10^4 free paths of molecules
    loads = [fly_body(b, high, None, INSTANT).path.loads for b in (body, tabulated(body))]
    assert_array_equal(*loads)


def test_flights_that_fail_are_told_and_the_others_flown(body):
    up = InitialState.entry(600e3, 9000.0, 30.0)
    found = fly_many([body, body], [STEEP, up], integration=QUICK, measure=lambda h: {"steps": len(h)})
    assert list(found.failures) == [1]
    assert "left the altitudes" in found.failures[1]
    assert found["steps"][0] > 10
    assert np.isnan(found["steps"][1])
    assert found.checked == ()  # two flights are not worth a table


def test_what_does_not_make_a_batch_is_refused(body):
    with pytest.raises(InputError, match="got 1 bodies, 2 starts, 3 environments"):
        fly_many(body, [STEEP] * 2, [Environment()] * 3)
    with pytest.raises(InputError, match=r"starts\[1\] must be of type InitialState, not 7"):
        fly_many(body, [STEEP, 7])
    with pytest.raises(InputError, match="bodies must be of type Body, or a sequence"):
        fly_many([], STEEP)
    with pytest.raises(InputError, match="checks must be a whole number"):
        fly_many(body, STEEP, checks=-1)
    given = Body.with_coefficients(1e3, (1.0, 1.0, 1.0), 1.0, 1.0, GivenCoefficients(drag=1.0))
    with pytest.raises(InputError, match="no laws to tabulate"):
        tabulated(given)
    assert fly_many(given, STEEP)["time_s"].shape == (1,)


def test_at_no_incidence_a_radiating_wall_pushes_to_no_side():
    # Walls that differ by what their iteration leaves would make a force across the axis that does not
    # vanish with the incidence. The slope of a smooth force differs by some 1e-3 of it from 1e-4 to 1e-3 rad.
    shape = sphere_cone(half_angle_deg=9.0, nose_radius_m=0.1, base_radius_m=0.5)
    body = surface_body(vehicle_from_shape(shape), MethodSettings(preset="physics"))
    rows = [InitialState.entry(75e3, 4000.0, 0.0, alpha_deg=np.degrees(a)).state(ROUND) for a in (1e-4, 1e-3)]
    flight = fly_body(body, InitialState.entry(75e3, 4000.0, 0.0), None, INSTANT).flight
    loads = evaluated(flight, np.array(rows))[1]
    slope = loads[:, CN] / np.array([1e-4, 1e-3])
    assert slope[0] == pytest.approx(slope[1], rel=3e-3)


def test_the_peak_of_a_parabola_between_uneven_steps():
    t = np.array([0.0, 0.7, 1.6, 2.0, 3.5])
    assert _peak(t, 5.0 - 2.0 * (t - 1.3) ** 2) == pytest.approx(5.0, abs=1e-13)
    assert _peak(t, t) == 3.5
