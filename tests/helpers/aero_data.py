"""Reference tables of the aerothermodynamics tests (tests/data/aero/README.md says where they come from)."""

import csv
from pathlib import Path

import numpy as np

from sim.aero.coefficients import Air
from sim.body.vehicle import reference_vehicle

FOLDER = Path(__file__).parents[1] / "data" / "aero"


def rows(name):
    """Rows of a table: numbers where the cell is one, text elsewhere, NaN where it is empty."""
    with (FOLDER / f"{name}.csv").open() as file:
        return [{key: number(cell) for key, cell in row.items()} for row in csv.DictReader(file)]


def number(cell):
    try:
        return float(cell) if cell else np.nan
    except ValueError:
        return cell


# The paper's Table 8, genetic-algorithm row, in radians and metres.
PAPER_OPTIMUM = {
    "theta_c1_deg": np.degrees(0.155727),
    "theta_c2_deg": np.degrees(0.191795),
    "nose_radius_m": 0.20638,
}

# U.S. Standard Atmosphere 1962 (pressure, density, temperature) at the altitudes of the paper's Tables 4-6.
ATMOSPHERE = {
    8.0: Air(35651.6, 0.525786, 236.2151),
    10.0: Air(26499.87, 0.4135102, 223.2521),
    60.0: Air(22.46063, 3.059188e-4, 255.772),
}


def paper_vehicle():
    """The vehicle whose layout was fitted to the paper's Tables 4-6."""
    return reference_vehicle(**PAPER_OPTIMUM)
