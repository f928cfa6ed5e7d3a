"""Free-molecular loads and heating against facets of Schaaf and Chambre's formulas, summed here.

Schaaf and Chambre, Flow of Rarefied Gases (Princeton, 1961): diffuse reflection, full accommodation. The
facets are independent of the program's quadrature; 300 rings a part and 360 meridians err by below 1e-4.
"""

import math

import numpy as np
import pytest

from sim.aero.coefficients import Air, coefficients
from sim.aero.methods import Resolution, Wall
from sim.aero.thin_air.rarefied import free_molecular_wall, knudsen_number, molecules, rarefaction
from sim.air.standards import us1976
from sim.body.geometry import BodyShape, sphere_cone
from sim.body.vehicle import reference_vehicle

ERF = np.vectorize(math.erf)
SPEED_M_S = 7800.0
WALL_K = 500.0


def air_at(height_m):
    state = us1976()(height_m)
    return Air(float(state.pressure_Pa), float(state.density_kg_m3), float(state.temperature_K))


AIR = air_at(200e3)
RATIO = SPEED_M_S / math.sqrt(2.0 * AIR.pressure_Pa / AIR.density_kg_m3)
SHAPES = {
    "slender blunt cone": sphere_cone(9.0, 0.3, 1.0),
    "capsule": sphere_cone(60.0, 0.2286, 0.4064),
    "hemisphere": BodyShape(1.0, cap_angle_deg=0.0),
    "sphere-cone-cylinder-flare": reference_vehicle(7.5, 12.5, 0.225).shape,
}


def facets(shape, alpha):
    """Force over q and frontal area (x aft, z away from the wind), heat over rho V^3 / 2 and that area."""
    stream = np.array([math.cos(alpha), 0.0, math.sin(alpha)])
    hot = WALL_K / AIR.temperature_K
    phi = (np.arange(360) + 0.5) * math.pi / 180.0
    x, r = shape.outline(300)
    force, heat = np.zeros(3), 0.0
    across = np.stack([np.sin(phi), np.cos(phi)])
    strips = []
    for dx, dr, middle in zip(np.diff(x), np.diff(r), 0.5 * (r[1:] + r[:-1]), strict=True):
        length = math.hypot(dx, dr)
        normal = np.stack([np.full(360, -dr / length), *(dx / length * across)], axis=1)
        strips.append((middle * length * math.pi / 180.0, normal))
    strips.append((shape.base_area_m2, np.array([[1.0, 0.0, 0.0]])))
    for area, normal in strips:
        sine = -(normal @ stream)
        n = RATIO * sine
        exponential, facing = np.exp(-(n**2)), 1.0 + ERF(n)
        pressure = (n / math.sqrt(math.pi) + 0.5 * math.sqrt(hot)) * exponential
        pressure += (0.5 + n**2 + 0.5 * math.sqrt(math.pi * hot) * n) * facing
        along = stream + sine[:, None] * normal
        flux = exponential + math.sqrt(math.pi) * n * facing
        stress = (
            along * (flux / (RATIO * math.sqrt(math.pi)))[:, None] - normal * (pressure / RATIO**2)[:, None]
        )
        force += area * stress.sum(axis=0)
        energy = (RATIO**2 + 3.5 - 3.0 * hot) * flux - 0.5 * exponential
        heat += area * energy.sum() / (2.0 * math.sqrt(math.pi) * RATIO**3)
    frontal = math.pi * shape.largest_radius_m**2
    return force[0] / frontal, force[2] / frontal, heat / frontal


@pytest.mark.parametrize("alpha_deg", [0.0, 25.0, 80.0, 160.0])
@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("preset", ["paper", "best"])
def test_loads_and_heat_at_200_km_are_those_of_free_molecules(name, preset, alpha_deg):
    shape = SHAPES[name]
    mach = SPEED_M_S / AIR.sound_speed_m_s
    got = coefficients(shape, mach, alpha_deg, preset, air=AIR, wall=Wall(temperature_K=WALL_K))
    axial, normal, heat = facets(shape, math.radians(alpha_deg))
    size = math.hypot(axial, normal)
    assert pytest.approx(axial, abs=1e-3 * size) == got.CA
    assert pytest.approx(normal, abs=1e-3 * size) == got.CN
    flux = 0.5 * AIR.density_kg_m3 * SPEED_M_S**3 * math.pi * shape.largest_radius_m**2
    assert float(got.surface_heat_rate_W) / flux == pytest.approx(heat, rel=2e-3)


def test_the_flights_own_quadrature_keeps_half_a_per_cent():
    mach = SPEED_M_S / AIR.sound_speed_m_s
    for shape in SHAPES.values():
        for alpha_deg in (0.0, 30.0):
            fine = coefficients(shape, mach, alpha_deg, "paper", air=AIR)
            coarse = coefficients(shape, mach, alpha_deg, "paper", air=AIR, resolution=Resolution())
            assert float(coarse.CA) == pytest.approx(float(fine.CA), rel=5e-3)


def test_dense_air_feels_nothing_of_it_and_the_bridge_is_smooth():
    assert rarefaction(0.01) == 0.0
    assert rarefaction(10.0) == 1.0
    # sin^2 of the logarithm: half way between 0.01 and 10 half of each
    assert rarefaction(math.sqrt(0.1)) == pytest.approx(0.5, rel=1e-12)
    shares = [rarefaction(k) for k in np.geomspace(0.005, 20.0, 400)]
    assert np.all(np.diff(shares) >= 0.0)
    assert max(np.diff(shares)) < 0.02
    # US Standard Atmosphere 1976, table I: mean free path 4.4 mm at 80 km, 142 mm at 100 km. It counts
    # molecules of 3.65e-10 m, not viscosity: for hard spheres of that size the two differ by 10 to 20 %.
    for height_m, free_path_m in ((80e3, 4.4e-3), (100e3, 0.142)):
        air = air_at(height_m)
        found = knudsen_number(air.pressure_Pa, air.density_kg_m3, air.temperature_K, 1.0)
        assert found == pytest.approx(free_path_m, rel=0.2)


def test_a_radiating_wall_in_thin_air_is_cooler_than_a_hot_one_and_takes_more_heat():
    shape, mach = SHAPES["capsule"], SPEED_M_S / AIR.sound_speed_m_s
    radiating = coefficients(shape, mach, 0.0, "paper", air=AIR, wall=Wall("radiative"))
    hot = coefficients(shape, mach, 0.0, "paper", air=AIR, wall=Wall(temperature_K=2000.0))
    assert radiating.surface_heat_rate_W > hot.surface_heat_rate_W
    assert radiating.CA < hot.CA
    adiabatic = coefficients(shape, mach, 0.0, "paper", air=AIR, wall=Wall("adiabatic"))
    assert abs(adiabatic.surface_heat_rate_W) < 1e-9 * radiating.surface_heat_rate_W


@pytest.mark.parametrize(
    ("speed_ratio", "sine", "adiabatic_K"),
    # T/3 (s^2 + 7/2 - exp(-n^2)/(2 (exp(-n^2) + sqrt(pi) n erfc(-n)))) at 200 K, with 50 digits
    [
        (10.0, -0.5, 5136.86262707188),
        (12.0, -1.0, 134.01145326637422),
        (25.0, -0.999, 216.78442792698118),
        (40.0, -1.0, 133.3956970341252),
    ],
)
def test_a_wall_in_the_deepest_shadow_has_a_temperature(speed_ratio, sine, adiabatic_K):
    density = 1e-7
    pressure = density * 287.053 * 200.0
    stream = molecules(speed_ratio * math.sqrt(2.0 * pressure / density), pressure, density, 200.0)
    # beyond n = -20 the series leaves out 10.5/n^4 and less, times a sixth of 200 K: 2.2e-3 K at most
    assert free_molecular_wall(sine, 0.0, stream) == pytest.approx(adiabatic_K, abs=2.2e-3)
    assert 0.0 <= free_molecular_wall(sine, 0.8, stream) <= adiabatic_K


@pytest.mark.parametrize("preset", ["physics", "best"])
def test_the_fastest_entries_have_loads_in_thin_air_at_every_incidence(preset):
    mach = np.array([[8.0], [11.1], [25.0], [33.0], [45.0]])
    alpha = np.linspace(0.0, 180.0, 32)
    for wall in (Wall("adiabatic"), Wall("radiative")):
        found = coefficients(
            SHAPES["capsule"], mach, alpha, preset, air=air_at(110e3), wall=wall, resolution=Resolution()
        )
        for column in (found.CA, found.CN, found.CM_nose, found.surface_heat_rate_W, found.CA_base):
            assert np.all(np.isfinite(column))
    # fast molecules hit a 60 deg cone with cold walls by next to 2 (sin^2 + cos^2)
    assert found.CA[-1, 0] == pytest.approx(2.0, rel=0.1)


def test_axial_force_of_huygens_in_free_molecular_flow():
    """2.09 as the reconstruction of its entry took it, 6 km/s into Titan's nitrogen.

    Text kernel SPACECR_148.TXT of HP-SSA-DTWG-6-TRAJECTORY-V1.0 (ESA's Planetary Science Archive). Front
    shield: 60 deg, nose radius 1.25 m, diameter 2.7 m. Gas and wall temperature are not given: from a wall
    as cold as the gas (170 K) to one of 300 K the closed form gives 2.085 to 2.113, the last digit 0.005.
    """
    nitrogen, temperature_K, pressure_Pa = 296.8, 170.0, 1e-6
    air = Air(pressure_Pa, pressure_Pa / (nitrogen * temperature_K), temperature_K)
    mach = 6000.0 / math.sqrt(1.4 * nitrogen * temperature_K)
    for wall_K, off in ((170.0, 0.01), (300.0, 0.03)):
        got = coefficients(
            sphere_cone(60.0, 1.25, 1.35), mach, 0.0, "physics", air=air, wall=Wall("fixed", wall_K)
        )
        assert pytest.approx(2.09, abs=off) == got.CA
