"""Pressure laws against independent evaluations and exact solutions."""

import math

import numpy as np
import pytest
from aero_data import rows

from sim.aero import gas
from sim.aero.aerodynamics import prepare
from sim.aero.methods import Laws, methods
from sim.aero.pressure import flow, surface_pressure
from sim.aero.pressure_laws import inviscid
from sim.aero.pressure_laws.laws import PRESSURE_LAWS, Place
from sim.body.vehicle import reference_vehicle

KAUFMAN = rows("kaufman_match")
CONES = rows("taylor_maccoll")


def match(mach, gamma):
    return inviscid.kaufman_match(mach, gamma, *inviscid.kaufman_limit(gamma))


@pytest.mark.parametrize("row", KAUFMAN, ids=lambda row: f"g{row['gamma']:g}-M{row['M']:g}")
def test_kaufman_matching_point(row):
    mach, gamma = row["M"], row["gamma"]
    match_mach, pressure, angle, share = match(mach, gamma)
    assert (share == 1.0) == (row["exists"] == "True")
    if share < 1.0:
        return
    assert match_mach == pytest.approx(row["Mq"], abs=1e-8)
    assert pressure == pytest.approx(row["Q"], abs=1e-8)
    assert math.degrees(angle) == pytest.approx(row["delta_q_deg"], abs=1e-6)
    k = gas.stagnation_pressure_coefficient(mach, gamma)
    nu = gas.prandtl_meyer_angle(match_mach, gamma) + angle
    for column, degrees in (("Cp_m10deg", -10), ("Cp_0deg", 0), ("Cp_9deg", 9), ("Cp_20deg", 20)):
        s = math.sin(math.radians(degrees))
        cp = inviscid.newtonian_prandtl_meyer(s, k, mach, gamma, math.sin(angle), nu)
        assert cp == pytest.approx(row[column], abs=1e-9)


@pytest.mark.parametrize(("gamma", "mach"), [(1.4, 2.8535), (1.3, 2.7106), (1.2, 2.5765)])
def test_kaufman_match_exists_only_above_a_mach_number(gamma, mach):
    assert match(mach - 1e-3, gamma)[3] < 1.0
    assert match(mach + 1e-3, gamma)[3] == 1.0


@pytest.mark.parametrize("regime", ["low", "high"])
def test_matching_point_reaches_the_regime_that_uses_it(regime):
    (row,) = (row for row in KAUFMAN if (row["gamma"], row["M"]) == (1.4, 7.0))
    laws = Laws(cylinder="newtonian_prandtl_meyer")
    chosen = methods("newtonian", switch_mach=9.0 if regime == "low" else 5.0, **{regime: laws})
    stream = flow(7.0, 0.0, 1.0, prepare(reference_vehicle(7.5, 12.5, 0.2), chosen).options)
    law = PRESSURE_LAWS["newtonian_prandtl_meyer"].number
    cp = surface_pressure(law, law, 0.0, Place(0.0, 0.0, 0.0, 0.0), stream, 0.05)
    assert cp == pytest.approx(row["Cp_0deg"], abs=1e-9)


@pytest.mark.parametrize("degrees", [-15.0, 0.0, 9.0, 20.0, 35.0])
def test_newtonian_prandtl_meyer_is_continuous_in_mach(degrees):
    def cp(mach):
        match_mach, _, angle, share = match(mach, 1.4)
        k = gas.stagnation_pressure_coefficient(mach, 1.4)
        nu = gas.prandtl_meyer_angle(match_mach, 1.4) + share * angle
        s = math.sin(math.radians(degrees))
        return inviscid.newtonian_prandtl_meyer(s, k, mach, 1.4, math.sin(angle), nu, share)

    mach = np.linspace(1.5, 5.0, 7001)
    steps = np.abs(np.diff([cp(m) for m in mach]))
    assert steps.max() < 1e-3  # a step of 0.0005 in Mach number


@pytest.mark.parametrize("mach", [1.6, 1.9, 2.4, 2.8, 6.0])
def test_newtonian_prandtl_meyer_is_smooth_at_the_matching_point(mach):
    match_mach, _, angle, share = match(mach, 1.4)
    k = gas.stagnation_pressure_coefficient(mach, 1.4)
    nu = gas.prandtl_meyer_angle(match_mach, 1.4) + share * angle

    def cp(d):
        return inviscid.newtonian_prandtl_meyer(math.sin(d), k, mach, 1.4, math.sin(angle), nu, share)

    h = 1e-5
    before = (cp(angle) - cp(angle - h)) / h
    after = (cp(angle + h) - cp(angle)) / h
    assert cp(angle - 1e-12) == pytest.approx(cp(angle), abs=1e-10)
    assert before == pytest.approx(after, rel=1e-3)


@pytest.mark.parametrize("row", CONES, ids=lambda row: f"{row['cone_deg']:g}deg-M{row['Mach']:g}")
def test_tangent_cones(row):
    s, mach = math.sin(math.radians(row["cone_deg"])), row["Mach"]
    habp3 = inviscid.tangent_cone_habp3(s, mach, 1.4)
    edwards = inviscid.tangent_cone_edwards(s, mach, 1.4)
    improved = inviscid.tangent_cone_hammitt_murthy(s, mach, 1.4)
    # the formulas themselves, evaluated elsewhere ...
    assert habp3 == pytest.approx(row["Cp_tc_shabp_emp"], rel=1e-7)
    assert edwards == pytest.approx(row["Cp_tc_edwards"], rel=1e-7)
    assert improved == pytest.approx(row["Cp_tc_HM"], rel=5e-5)
    # ... and what they are worth against the exact conical flow
    if 3.0 <= mach <= 20.0 and row["cone_deg"] <= 20.0:
        exact = row["Cp_TM"]
        assert abs(edwards / exact - 1.0) < 0.03
        assert abs(improved / exact - 1.0) < 0.01
        rounded = inviscid.tangent_cone_hammitt_murthy(s, mach, 1.4, 0.1)
        assert abs(rounded / exact - 1.0) < 0.01
        assert rounded == pytest.approx(improved, rel=6e-4)
        assert -0.33 < habp3 / exact - 1.0 < 0.0


@pytest.mark.parametrize(("rounding", "change"), [(0.0, 0.15), (0.1, 0.012)])
def test_improved_tangent_cone_is_smooth_along_both_joins(rounding, change):
    for mach in (2.0, 3.0, 3.1, 5.0, 9.0, 12.0):
        s = np.linspace(1e-4, 0.6, 6001)
        cp = np.array([inviscid.tangent_cone_hammitt_murthy(x, mach, 1.4, rounding) for x in s])
        slope = np.diff(cp) / np.diff(s)
        assert np.all(np.diff(cp) > 0.0)
        assert np.abs(np.diff(slope)).max() < change


def test_osu_correlation():
    # p/p02 of the cylinder fit: 1 facing the stream, 0.12 at 90 degrees from it (sums of the coefficients).
    mach, gamma = 10.0, 1.4
    k = gas.stagnation_pressure_coefficient(mach, gamma)
    dynamic = 0.5 * gamma * mach**2
    assert inviscid.osu_blunt_body(1.0, k, mach, gamma) == pytest.approx(k, rel=1e-12)
    at_shoulder = (0.12 * (k * dynamic + 1.0) - 1.0) / dynamic
    assert inviscid.osu_blunt_body(0.0, k, mach, gamma) == pytest.approx(at_shoulder, rel=1e-12)
    at_60 = 0.32 + 0.455 * 0.5 - 0.195 * 0.5 - 0.035 + 0.005 * 0.5
    cp = inviscid.osu_blunt_body(0.5, k, mach, gamma)
    assert (cp * dynamic + 1.0) / (k * dynamic + 1.0) == pytest.approx(at_60, rel=1e-12)


def test_prandtl_meyer_expansion_of_the_free_stream():
    # NACA 1135: nu(3) = 49.7573 deg; 10 deg further is Mach 3.5784 with p/p0 = 0.011784.
    cp = inviscid.prandtl_meyer_expansion(-math.sin(math.radians(10.0)), 3.0, 1.4)
    m2 = gas.prandtl_meyer_mach(math.radians(59.7573467), 1.4)
    ratio = ((1.0 + 0.2 * 9.0) / (1.0 + 0.2 * m2**2)) ** 3.5
    assert m2 == pytest.approx(3.578, abs=2e-3)
    assert cp == pytest.approx((ratio - 1.0) / 6.3, rel=1e-7)
    assert inviscid.prandtl_meyer_expansion(0.1, 3.0, 1.4) == 0.0
    assert inviscid.prandtl_meyer_expansion(-1.0, 20.0, 1.4) == pytest.approx(-2.0 / (1.4 * 400.0), rel=1e-9)


@pytest.mark.parametrize("row", rows("gasdynamics_g1p4"), ids=lambda row: f"M{row['M']:g}")
def test_wake_pressures(row):
    mach = row["M"]
    assert inviscid.vacuum_pressure(mach, 1.4) == pytest.approx(row["Cp_vac"], rel=1e-8)
    assert inviscid.shadow_pressure(mach, 1.4) == pytest.approx(row["Cp_base_70pc"], rel=1e-8)
    assert inviscid.habp_base_pressure(mach, 1.4) == pytest.approx(row["Cp_base_HABP"], rel=1e-8)


def test_local_turn_against_exact_shock_and_expansion():
    # Free stream Mach 5 whose shocked gas runs at Mach 3 along the surface: p/p1 = 32.65347 / 36.73272.
    pressure = 32.65347 / 36.73272
    cp = (pressure - 1.0) / 17.5
    scale = pressure * 9.0 / 25.0  # local over free-stream dynamic pressure
    # NACA 1135: Mach 3 turned by 10 deg, p2/p1 = 2.0545 compressed and 0.4310 expanded.
    compressed = inviscid.local_turn(cp, math.radians(10.0), 5.0, 1.4)
    assert compressed - cp == pytest.approx(scale * (2.0545 - 1.0) / 6.3, rel=0.03)
    expanded = inviscid.local_turn(cp, -math.radians(10.0), 5.0, 1.4)
    assert expanded - cp == pytest.approx(scale * (0.4310 - 1.0) / 6.3, rel=0.10)


def test_blunt_nose_pressure_keeps_its_stagnation_point_and_loses_drag():
    assert inviscid.corrected_newtonian(1.0, 1.83) == 1.83
    s, weight = np.polynomial.legendre.leggauss(8)
    s, weight = 0.5 * (1.0 + s), 0.5 * weight
    drag = sum(w * 2.0 * x * inviscid.corrected_newtonian(x, 1.83) for x, w in zip(s, weight, strict=True))
    # Hemisphere: K/2 less a third of 0.13 of it; Euler solutions lie 4.0 to 4.7 % below K/2.
    assert drag == pytest.approx(0.5 * 1.83 * (1.0 - 0.13 / 3.0), rel=1e-12)


def test_entropy_layer_ends_in_the_sharp_cone():
    s, mach = math.sin(math.radians(9.0)), 10.0
    sharp = inviscid.tangent_cone_hammitt_murthy(s, mach, 1.4)
    assert inviscid.entropy_layer_cone(sharp, math.inf, s, mach) == sharp
    # Pressure at the base of 9 deg sphere-cones, 15 and 25.6 nose radii behind the tangent point, by Euler
    # solutions whose CA, not whose pressures, entered the fit: 0.0356 and 0.0430.
    for distance, exact in ((14.99, 0.0356), (25.65, 0.0430)):
        assert inviscid.entropy_layer_cone(sharp, distance, s, mach) == pytest.approx(exact, rel=0.12)


def test_base_correlation():
    # Fleeman: 0.25 at Mach 1 from both sides, 0.125 at Mach 2, 0.12 at rest.
    assert inviscid.base_correlation(1.0 - 1e-12) == pytest.approx(-0.25, abs=1e-9)
    assert inviscid.base_correlation(1.0) == -0.25
    assert inviscid.base_correlation(2.0) == -0.125
    assert inviscid.base_correlation(0.0) == -0.12
