"""Perfect-gas relations against tables at the level of NACA Report 1135."""

import math
from decimal import Decimal, localcontext

import pytest
from aero_data import rows

from sim.aero import gas

TABLE = rows("gasdynamics_g1p4")


@pytest.mark.parametrize("row", TABLE, ids=lambda row: f"M{row['M']:g}")
def test_normal_shock_pitot_and_expansion(row):
    mach = row["M"]
    assert gas.pitot_pressure_ratio(mach, 1.4) == pytest.approx(row["p02_p1_pitot"], rel=2e-8)
    assert gas.stagnation_pressure_coefficient(mach, 1.4) == pytest.approx(row["Cpmax"], rel=2e-8)
    assert gas.normal_shock_pressure_ratio(mach, 1.4) == pytest.approx(row["p2_p1"], rel=2e-8)
    assert gas.normal_shock_density_ratio(mach, 1.4) == pytest.approx(row["rho2_rho1"], rel=2e-8)
    assert gas.normal_shock_mach(mach, 1.4) == pytest.approx(row["M2"], rel=2e-8)
    assert gas.normal_shock_total_pressure_ratio(mach, 1.4) == pytest.approx(row["p02_p01"], rel=2e-8)
    assert math.degrees(gas.prandtl_meyer_angle(mach, 1.4)) == pytest.approx(row["nu_deg"], rel=2e-8)
    assert gas.prandtl_meyer_mach(math.radians(row["nu_deg"]), 1.4) == pytest.approx(mach, rel=1e-6)


@pytest.mark.parametrize("mach", [1.0, 1.5, 3.0, 8.0, 20.0])
def test_the_papers_equation_5_inverts_the_pitot_relation(mach):
    gamma = 1.4
    p = (2.0 / ((gamma + 1.0) * mach**2)) ** (gamma / (gamma - 1.0))
    p *= ((2.0 * gamma * mach**2 - (gamma - 1.0)) / (gamma + 1.0)) ** (1.0 / (gamma - 1.0))
    assert p * gas.pitot_pressure_ratio(mach, gamma) == pytest.approx(1.0, abs=1e-13)


@pytest.mark.parametrize(("mach", "expected"), [(1.0, 1.2756), (2.0, 1.6573), (5.0, 1.8088), (1e4, 1.8394)])
def test_stagnation_pressure_coefficient_reaches_its_limits(mach, expected):
    assert gas.stagnation_pressure_coefficient(mach, 1.4) == pytest.approx(expected, abs=5e-5)


@pytest.mark.parametrize("mach", ["0.001", "0.02", "0.049", "0.051", "0.2", "0.45"])
def test_stagnation_pressure_coefficient_below_the_speed_of_sound(mach):
    """NACA 1135 eq. 44 with fifty digits; the series that is taken below 0.05 leaves M^6 / 120 out."""
    with localcontext() as context:
        context.prec = 50
        square = Decimal(mach) ** 2
        exact = ((1 + Decimal("0.2") * square) ** Decimal("3.5") - 1) / (Decimal("0.7") * square)
    assert gas.stagnation_pressure_coefficient(float(mach), 1.4) == pytest.approx(float(exact), rel=5e-10)


def test_stagnation_pressure_coefficient_is_smooth_where_formulas_meet():
    for mach in (0.05, 1.0):
        below = gas.stagnation_pressure_coefficient(mach * (1 - 1e-9), 1.4)
        assert gas.stagnation_pressure_coefficient(mach * (1 + 1e-9), 1.4) == pytest.approx(below, rel=1e-7)


def test_vacuum_turning_angle():
    assert math.degrees(gas.max_prandtl_meyer_angle(1.4)) == pytest.approx(130.4541, abs=1e-4)
    assert gas.prandtl_meyer_mach(3.0, 1.4) == math.inf
    assert gas.prandtl_meyer_mach(-0.1, 1.4) == 1.0


@pytest.mark.parametrize(
    "row", rows("stagnation_heating"), ids=lambda row: f"{row['alt_km']:g}km-{row['V']:g}"
)
def test_equilibrium_air(row):
    density = 0.2 * (row["q_SG_V3"] / 1.7415e-4 / row["V"] ** 3) ** 2
    k = row["Cpmax_pg"] + gas.equilibrium_pressure_increment(row["V"], density)
    assert k == pytest.approx(row["Cpmax_eq"], abs=1.5e-3)


def test_equilibrium_air_is_a_perfect_gas_at_rest():
    assert gas.equilibrium_pressure_increment(0.0, 1.0) == 0.0
    assert gas.equilibrium_pressure_increment(300.0, 1.2) < 1e-3


def test_viscosity_of_the_standard_atmosphere():
    # U.S. Standard Atmosphere 1962, sea level and 10 km.
    assert gas.viscosity(288.15) == pytest.approx(1.7894e-5, rel=1e-4)
    assert gas.viscosity(223.2521) == pytest.approx(1.4577e-5, rel=1e-4)
    assert gas.viscosity(50.0) == pytest.approx(0.5 * gas.viscosity(100.0), rel=1e-12)
