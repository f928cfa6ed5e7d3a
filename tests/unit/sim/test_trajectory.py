"""Flights that cannot be: refused with the reason, whatever the physical input."""

import math

import pytest

from sim.aero.given_coefficients import GivenCoefficients
from sim.air.altitude_table import table_atmosphere
from sim.air.atmosphere import exponential
from sim.air.dispersion import dispersed
from sim.air.msis import msis
from sim.air.standards import us1962
from sim.air.wind import sheared_wind, steady_wind, table_wind
from sim.core.errors import InputError
from sim.flight.earth import Earth, flat_earth
from sim.flight.trajectory import Body, Environment, InitialState, Integration, fly_body

BALL = {
    "mass_kg": 14.6,
    "inertia_kg_m2": (4.9, 4.9, 4.9),
    "reference_area_m2": 0.018,
    "reference_length_m": 1.0,
    "coefficients": GivenCoefficients(drag=0.1),
}
NUMBERS_THAT_ARE_NONE = (math.nan, math.inf, -math.inf, 1e300, "1", None, True)


@pytest.mark.parametrize("value", [-1.0, 0.0, *NUMBERS_THAT_ARE_NONE])
@pytest.mark.parametrize("name", ["mass_kg", "reference_area_m2", "reference_length_m"])
def test_bodies(name, value):
    with pytest.raises(InputError, match=name):
        Body.with_coefficients(**{**BALL, name: value})


@pytest.mark.parametrize("value", NUMBERS_THAT_ARE_NONE)
@pytest.mark.parametrize("name", ["altitude_m", "latitude_deg", "longitude_deg"])
def test_places(name, value):
    with pytest.raises(InputError, match=name):
        InitialState(**{"altitude_m": 9144.0, name: value})


@pytest.mark.parametrize("value", NUMBERS_THAT_ARE_NONE)
@pytest.mark.parametrize("name", ["speed_m_s", "path_angle_deg", "heading_deg", "alpha_deg"])
def test_entries(name, value):
    start = {"altitude_m": 82_000.0, "speed_m_s": 4300.0, "path_angle_deg": -15.0}
    with pytest.raises(InputError, match=name):
        InitialState.entry(**{**start, name: value})


@pytest.mark.parametrize("value", [-1.0, 0.0, math.nan, "1"])
@pytest.mark.parametrize("name", ["rtol", "largest_step_s", "duration_s", "longest_s", "most_steps"])
def test_integrations(name, value):
    with pytest.raises(InputError, match=name):
        Integration(**{name: value})


@pytest.mark.parametrize(
    ("build", "reason"),
    [
        (lambda: Body.with_coefficients(**{**BALL, "inertia_kg_m2": (1.0, 1.0)}), "three principal moments"),
        (lambda: Body.with_coefficients(**{**BALL, "inertia_kg_m2": (1.0, 1.0, 5.0)}), "exceeds the sum"),
        (lambda: GivenCoefficients(drag=-0.1), "drag must not be negative"),
        (lambda: GivenCoefficients(drag=([1.0, 0.5], [1.0, 1.0])), "Mach increasing"),
        (lambda: GivenCoefficients(drag=([0.0, 1.0], [1.0, math.nan])), "values must be finite"),
        (lambda: GivenCoefficients(pitch_slope="steep"), "pitch_slope must be a number"),
        (lambda: GivenCoefficients(nose_radius_m=-0.2), "nose_radius_m"),
        (lambda: InitialState(9144.0, velocity_ned_m_s=(1.0, 2.0)), "velocity_ned_m_s must be 3 values"),
        (lambda: InitialState(9144.0, rates_deg_s=(1.0, 2.0, math.nan)), "rates_deg_s must be 3 values"),
        (lambda: InitialState(9144.0, latitude_deg=91.0), "latitude_deg must lie between"),
        (lambda: InitialState(9144.0, relative_to="moon"), "relative_to must be one of earth, inertial"),
        (lambda: Environment(Earth(radius_m=-1.0)), "positive radius"),
        (lambda: Environment(Earth(j2=math.nan)), "j2 of the Earth must be a finite number"),
        (lambda: Environment(flat_earth(math.inf)), "flat_gravity_m_s2 of the Earth must be a finite number"),
        (lambda: Environment(atmosphere="us1962"), "atmosphere must be of type Atmosphere"),
        (lambda: exponential(scale_height_m=math.nan), "scale_height_m"),
        (lambda: exponential(scale_height_m=-7200.0), "positive density, scale height"),
        (lambda: table_atmosphere([0.0, 1e4, 2e4], [1.0, 0.4]), "equally long"),
        (lambda: table_atmosphere([0.0, 1e4], [1.0, -0.4]), "positive numbers"),
        (lambda: steady_wind(east_m_s=math.nan), "three finite components"),
        (lambda: sheared_wind((0.0, 1.0, 0.0), (0.0, math.inf, 0.0)), "three finite components"),
        (lambda: table_wind([0.0, 1.0], [1.0, math.nan], [0.0, 0.0]), "finite components"),
        (lambda: dispersed(us1962(), -1), "whole number"),
        (lambda: dispersed(us1962(), 1, scale=math.nan), "scale must be a finite number"),
        (lambda: dispersed(us1962(), 1, scale=-1.0), "between 0 and 10"),
        (lambda: msis("2020-01-01", 0.0, 0.0), "f107, f107a and ap"),
        (lambda: msis("2020-01-01", 0.0, 0.0, f107=150, f107a=150, ap=-4), "no space weather"),
        (lambda: msis("new year", 0.0, 0.0, f107=150, f107a=150, ap=4), "date and time"),
    ],
)
def test_reasons(build, reason):
    with pytest.raises(InputError, match=reason):
        build()


ENTRY = {"altitude_m": 82_000.0, "speed_m_s": 4300.0, "path_angle_deg": -15.0}


@pytest.mark.parametrize(
    ("build", "reason"),
    [
        (lambda: InitialState.entry(**{**ENTRY, "speed_m_s": -4300.0}), "speed_m_s must not be negative"),
        (lambda: InitialState.entry(**{**ENTRY, "path_angle_deg": -95.0}), "path_angle_deg must lie between"),
        (lambda: InitialState.entry(**ENTRY, vertical="up"), "vertical must be one of geodetic, geocentric"),
        (lambda: table_atmosphere([0.0, 1e4], [1.0, 0.4], interpolation="cubic"), "smooth, log-linear"),
        (lambda: table_atmosphere([0.0, math.nan], [1.0, 0.4]), "every row needs an altitude"),
        (lambda: table_atmosphere([0.0, 1e6], [1.0, 1e-12]), "give temperature_K or pressure_Pa"),
    ],
)
def test_entries_and_tables(build, reason):
    with pytest.raises(InputError, match=reason):
        build()


@pytest.mark.parametrize(
    ("initial", "earth", "reason"),
    [
        (InitialState(0.0), flat_earth(), "on the ground and does not rise"),
        (InitialState(0.0, velocity_ned_m_s=(50.0, 0.0, 0.0)), Earth(), "on the ground and does not rise"),
        (InitialState(100.0, vertical="geocentric"), flat_earth(), "no geocentric vertical"),
    ],
)
def test_starts_that_go_nowhere(initial, earth, reason):
    with pytest.raises(InputError, match=reason):
        fly_body(Body.with_coefficients(**BALL), initial, Environment(earth))


@pytest.mark.parametrize(
    ("call", "reason"),
    [
        (lambda body: fly_body(None, InitialState(100.0)), "body must be of type Body"),
        (lambda body: fly_body(body, None), "initial must be of type InitialState"),
        (lambda body: fly_body(body, InitialState(100.0), "wgs84"), "environment must be of type Env"),
        (lambda body: fly_body(body, InitialState(100.0), None, 1e-7), "integration must be of type Integ"),
        (lambda body: Body.with_coefficients(**{**BALL, "coefficients": 0.1}), "of type GivenCoefficients"),
    ],
)
def test_arguments_of_another_kind(call, reason):
    with pytest.raises(InputError, match=reason):
        call(Body.with_coefficients(**BALL))


def test_a_hop_from_the_ground_ends_on_it():
    hop = InitialState(0.0, velocity_ned_m_s=(0.0, 0.0, -1e-4))
    flown = fly_body(Body.with_coefficients(**BALL), hop, Environment(flat_earth(10.0)))
    assert flown.time_s[-1] == pytest.approx(2e-5, rel=1e-6)
    assert flown.final("altitude_m") == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("times", ["noon", [[1.0, 2.0]], -1.0, math.nan])
def test_times_outside_a_flight(times):
    flown = fly_body(Body.with_coefficients(**BALL), InitialState(100.0))
    with pytest.raises(InputError, match="time"):
        flown.at(times)


@pytest.mark.parametrize(
    ("altitude_m", "reason"),
    [(2e6, "outside the atmosphere"), (-6000.0, "outside the atmosphere"), (-100.0, "below the ground")],
)
def test_starts(altitude_m, reason):
    with pytest.raises(InputError, match=reason):
        fly_body(Body.with_coefficients(**BALL), InitialState(altitude_m))
