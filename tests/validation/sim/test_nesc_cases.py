"""NASA's atmospheric check cases 1-10 (NASA/TM-2015-218675), 30 s each.

Cases 1-5 against first-principles reference solutions, 4-10 also against a point mass integrated here in
Earth-fixed axes with SciPy: other axes, other formulas, another integrator.
"""

import numpy as np
import point_mass
import pytest
from flight_data import column, rows

from sim.aero.given_coefficients import GivenCoefficients
from sim.air.standards import us1976
from sim.air.wind import CALM, sheared_wind, steady_wind
from sim.flight.earth import OMEGA, WGS84, Earth
from sim.flight.trajectory import Body, Environment, InitialState, Integration, fly_body

FOOT = 0.3048
EARTHS = {"04": Earth(6_371_007.1809), "05": Earth(6_371_007.1809, rotation_rad_s=OMEGA)}
WINDS = {
    "07": steady_wind(east_m_s=20 * FOOT),
    "08": sheared_wind((0.0, -20 * FOOT, 0.0), (0.0, 0.003, 0.0)),
}
COLUMNS = {
    "alt_m": "altitude_m",
    "lat_deg": "latitude_deg",
    "lon_deg": "longitude_deg",
    "vN_mps": "velocity_north_m_s",
    "vE_mps": "velocity_east_m_s",
    "vD_mps": "velocity_down_m_s",
    "yaw_deg": "yaw_deg",
    "pitch_deg": "pitch_deg",
    "roll_deg": "roll_deg",
    "p_deg_s": "roll_rate_deg_s",
    "q_deg_s": "pitch_rate_deg_s",
    "r_deg_s": "yaw_rate_deg_s",
}


def definition(case):
    (row,) = (row for row in rows("nesc_cases.csv") if row["case"] == case)
    return {
        name: float(value)
        for name, value in row.items()
        if name.endswith(("_m", "_m2", "_kg", "_kgm2", "_deg", "_mps", "_deg_s", "CD"))
        and ";" not in value
        and value.replace("-", "").replace(".", "").isdigit()
    }


def flown(case):
    d = definition(case)
    if case in ("02", "03"):
        damping = -1.0 if case == "03" else 0.0
        aerodynamics = GivenCoefficients(
            roll_damping=damping, pitch_damping=damping, yaw_damping=damping, span_m=0.33333 * FOOT
        )
        area, length = 0.22222 * FOOT**2, 0.66667 * FOOT
    else:
        aerodynamics = GivenCoefficients(drag=d["CD"])
        area, length = 0.1963495 * FOOT**2, 1.0
    body = Body.with_coefficients(
        d["mass_kg"], (d["Ixx_kgm2"], d["Iyy_kgm2"], d["Izz_kgm2"]), area, length, aerodynamics
    )
    start = InitialState(
        d["alt0_m"],
        d["lat0_deg"],
        d["lon0_deg"],
        (d["vN_mps"], d["vE_mps"], d["vD_mps"]),
        (d["yaw_deg"], d["pitch_deg"], d["roll_deg"]),
        (d["p_inertial_deg_s"], d["q_inertial_deg_s"], d["r_inertial_deg_s"]),
    )
    environment = Environment(EARTHS.get(case, WGS84), us1976(), WINDS.get(case, CALM))
    return fly_body(body, start, environment, Integration(rtol=1e-12, duration_s=30.0))


@pytest.mark.parametrize(
    # bars of position (m) and of angles and rates (deg, deg/s); the reference prints nine digits
    ("case", "position", "angle"),
    [("01", 1e-5, 1e-5), ("02", 1e-5, 1e-5), ("03", 1e-5, 1e-5), ("04", 1e-5, 1e-6), ("05", 1e-5, 1e-6)],
)
def test_reference_solutions(case, position, angle):
    expected = [row for row in rows("nesc_reference.csv") if row["case"] == case]
    at = flown(case).at(column(expected, "t_s"))
    for reference, name in COLUMNS.items():
        difference = at[name] - column(expected, reference)
        if name in ("yaw_deg", "roll_deg"):
            difference = (difference + 180.0) % 360.0 - 180.0
        metres = {"lat_deg": 111e3, "lon_deg": 111e3}.get(reference, 1.0)
        bar = angle if name.endswith(("yaw_deg", "pitch_deg", "roll_deg", "deg_s")) else position
        assert np.abs(metres * difference).max() < bar, name


def independent_point_mass(case, times):
    """Latitude, longitude and altitude of the point mass of a case."""
    d = definition(case)
    winds = {"07": lambda h: (0.0, 20 * FOOT), "08": lambda h: (0.0, -20 * FOOT + 0.003 * h)}
    rows = point_mass.flown(
        EARTHS.get(case, WGS84),
        (*np.radians([d["lat0_deg"], d["lon0_deg"]]), d["alt0_m"]),
        (d["vN_mps"], d["vE_mps"], d["vD_mps"]),
        0.5 * 0.1963495 * FOOT**2 * d["CD"] / d["mass_kg"],
        lambda h: us1976()(h).density_kg_m3,
        winds.get(case, lambda h: (0.0, 0.0)),
        times,
    )
    return rows.T[:3]


@pytest.mark.parametrize("case", ["04", "05", "06", "07", "08", "09", "10"])
def test_against_an_independent_earth_fixed_point_mass(case):
    times = np.arange(0.0, 31.0, 5.0)
    latitude, longitude, height = independent_point_mass(case, times)
    at = flown(case).at(times)
    np.testing.assert_allclose(at["altitude_m"], height, atol=2e-6)
    np.testing.assert_allclose(np.radians(at["latitude_deg"]), latitude, atol=1e-13)
    np.testing.assert_allclose(np.radians(at["longitude_deg"]), longitude, atol=1e-13)
