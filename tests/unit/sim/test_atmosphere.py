"""Standard atmospheres against independently recomputed and published values."""

import csv
from decimal import Decimal
from pathlib import Path

import numpy as np
import pytest

from sim.air.altitude_table import table_atmosphere
from sim.air.atmosphere import exponential, viscosity
from sim.air.standards import standard_atmosphere, us1962, us1976
from sim.core.errors import InputError

DATA = Path(__file__).parents[2] / "data" / "flight"


def read(name):
    with (DATA / name).open() as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize(
    ("column", "attribute"),
    [
        ("T_K", "temperature_K"),
        ("p_Pa", "pressure_Pa"),
        ("rho_kgm3", "density_kg_m3"),
        ("a_mps", "speed_of_sound_m_s"),
        ("mu_Pa_s", "viscosity_Pa_s"),
    ],
)
def test_us1962_agrees_to_the_last_printed_digit_from_minus_2_to_700_km(column, attribute):
    rows = read("us_standard_1962_1976.csv")
    values = getattr(us1962()([float(row["Z_geom_m"]) for row in rows]), attribute)
    for row, value in zip(rows, values, strict=True):
        unit_of_last_digit = 10.0 ** Decimal(row[column]).as_tuple().exponent
        assert abs(value - float(row[column])) <= 0.500001 * unit_of_last_digit, row["Z_geom_m"]


def test_us1962_base_pressures_agree_with_nasa_at62():
    rows = [row for row in read("us_standard_1962_bases.csv") if row["p_Pa_NASA_AT62"]]
    geopotential = np.array([float(row["base_H_geopot_m"]) for row in rows])
    pressure = us1962()(6_356_766.0 * geopotential / (6_356_766.0 - geopotential)).pressure_Pa
    np.testing.assert_allclose(pressure, [float(row["p_Pa_NASA_AT62"]) for row in rows], rtol=1.2e-7)


def test_density_and_pressure_are_continuous_at_every_layer_of_both_standards():
    for atmosphere in (us1962(), us1976()):
        bases = atmosphere.model.layers[1:, 0]
        below, above = atmosphere(bases - 1e-6), atmosphere(bases + 1e-6)
        np.testing.assert_allclose(above.pressure_Pa, below.pressure_Pa, rtol=1e-9)
        np.testing.assert_allclose(above.density_kg_m3, below.density_kg_m3, rtol=1e-9)


def test_pressure_obeys_the_hydrostatic_equation_between_the_layer_bases():
    atmosphere = us1962()
    bases = atmosphere.model.layers[:, 0]
    z = np.linspace(-4e3, 699e3, 2001)
    z = z[np.min(np.abs(z[:, None] - bases), axis=1) > 50.0]
    step = 5.0
    gravity = 9.80665 * (6_356_766.0 / (6_356_766.0 + z)) ** 2
    slope = (atmosphere(z + step).pressure_Pa - atmosphere(z - step).pressure_Pa) / (2 * step)
    np.testing.assert_allclose(slope, -gravity * atmosphere(z).density_kg_m3, rtol=2e-6)


def test_us1976_agrees_to_86_km():
    rows = [row for row in read("us_standard_1962_1976.csv") if row["p76_Pa"]]
    air = us1976()([float(row["Z_geom_m"]) for row in rows])
    np.testing.assert_allclose(air.pressure_Pa, [float(row["p76_Pa"]) for row in rows], rtol=2.5e-5)
    np.testing.assert_allclose(air.density_kg_m3, [float(row["rho76_kgm3"]) for row in rows], rtol=2.5e-5)
    low = [row for row in rows if row["T76_K"]]
    temperature = us1976()([float(row["Z_geom_m"]) for row in low]).temperature_K
    np.testing.assert_allclose(temperature, [float(row["T76_K"]) for row in low], rtol=3e-6)


@pytest.mark.parametrize(
    # U.S. Standard Atmosphere 1976 (NOAA-S/T 76-1562), table I: kinetic temperature, pressure, density
    ("altitude_km", "temperature", "pressure", "density"),
    [
        (86, 186.87, 3.7338e-1, 6.958e-6),
        (100, 195.08, 3.2011e-2, 5.604e-7),
        (120, 360.00, 2.5382e-3, 2.222e-8),
        (150, 634.39, 4.5422e-4, 2.076e-9),
        (200, 854.56, 8.4736e-5, 2.541e-10),
        (300, 976.01, 8.7704e-6, 1.916e-11),
        (400, 995.83, 1.4518e-6, 2.803e-12),
        (500, 999.24, 3.0236e-7, 5.215e-13),
        (700, 999.97, 3.1908e-8, 3.070e-14),
        (1000, 1000.00, 7.5138e-9, 3.561e-15),
    ],
)
def test_us1976_has_the_published_values_above_86_km(altitude_km, temperature, pressure, density):
    air = us1976()(1e3 * altitude_km)
    assert air.temperature_K == pytest.approx(temperature, abs=6e-3)
    assert air.pressure_Pa == pytest.approx(pressure, rel=1e-3)
    assert air.density_kg_m3 == pytest.approx(density, rel=1e-3)


def test_sutherland_viscosity_has_the_standards_sea_level_value():
    assert viscosity(288.15) == pytest.approx(1.7894e-5, rel=2e-5)


def test_exponential_atmosphere_is_exact():
    air = exponential(1.225, 7200.0)([0.0, 30_000.0, 82_000.0])
    np.testing.assert_allclose(
        air.density_kg_m3, 1.225 * np.exp(-np.array([0.0, 30_000.0, 82_000.0]) / 7200.0), rtol=1e-13
    )


def test_table_reproduces_its_rows_and_interpolates_the_logarithm():
    z = np.array([0.0, 10e3, 25e3, 60e3])
    density = us1962()(z).density_kg_m3
    straight = table_atmosphere(z, density, interpolation="log-linear")
    np.testing.assert_allclose(straight(z).density_kg_m3, density, rtol=1e-12)
    assert straight(5e3).density_kg_m3 == pytest.approx(np.sqrt(density[0] * density[1]), rel=1e-12)
    descending = table_atmosphere(z[::-1], density[::-1])
    np.testing.assert_allclose(descending(z).density_kg_m3, density, rtol=1e-12)


def test_smooth_table_has_a_continuous_slope():
    z = np.linspace(0.0, 80e3, 17)
    table = table_atmosphere(z, us1962()(z).density_kg_m3)
    step = 1e-2

    def slope(altitude, side):
        low, high = sorted([altitude, altitude + side * step])
        return np.log(table(high).density_kg_m3 / table(low).density_kg_m3) / step

    for node in z[1:-1]:
        assert slope(node, -1) == pytest.approx(slope(node, 1), rel=1e-5)


@pytest.mark.parametrize("altitude_m", [-6e3, 700_001.0, np.nan])
def test_altitudes_outside_the_standard_are_refused(altitude_m):
    with pytest.raises(InputError, match="outside atmosphere 'us1962'"):
        us1962()(altitude_m)


@pytest.mark.parametrize(
    ("z", "density", "reason"),
    [
        ([0.0, 1e3, 1e3], [1.0, 0.9, 0.8], "altitudes must increase"),
        ([0.0, 1e3], [1.0, -0.9], "must be positive"),
        ([0.0, 1e3], [1.0, 0.9, 0.8], "equally long"),
        ([0.0], [1.0], "two rows"),
    ],
)
def test_bad_tables_are_refused_with_the_reason(z, density, reason):
    with pytest.raises(InputError, match=reason):
        table_atmosphere(z, density, temperature_K=[250.0] * len(density))


def test_unknown_standard_is_refused():
    with pytest.raises(InputError, match="us1962"):
        standard_atmosphere("us1492")
