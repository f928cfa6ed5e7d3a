"""U.S. Standard Atmospheres of 1962 and 1976, from their defining layers.

Sources: U.S. Standard Atmosphere, 1962 (COESA, U.S. Government Printing Office, Washington 1962), tables of
molecular-scale temperature and molecular weight; U.S. Standard Atmosphere, 1976 (NOAA/NASA/USAF, NOAA-S/T
76-1562).
Base pressures are not typed in: they follow from 101 325 Pa by the hydrostatic equation, layer by layer.
"""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np

from sim.air.atmosphere import (
    EARTH_RADIUS,
    H_BASE,
    LAPSE,
    LAYER_COLUMNS,
    M_BASE,
    M_SLOPE,
    MOLAR_MASS,
    P_BASE,
    TM_BASE,
    Z_BASE,
    Atmosphere,
    Floats,
    _within_layer,
    layered_model,
)
from sim.air.us1976_upper import upper_model
from sim.core.errors import InputError

__all__ = ["ATMOSPHERES", "standard_atmosphere", "us1962", "us1976"]

_SEA_LEVEL_PRESSURE = 101_325.0
_SEA_LEVEL_TEMPERATURE = 288.15

# Base of each layer and lapse rate of the molecular-scale temperature, K per km: geopotential km to 90 km ...
_US1962_LOW = ((0, -6.5), (11, 0.0), (20, 1.0), (32, 2.8), (47, 0.0), (52, -2.0), (61, -4.0), (79, 0.0))
# ... and above: geometric km, lapse, molecular weight (linear between the entries).
_US1962_HIGH = (
    (90, 3.0, 28.9644), (100, 5.0, 28.88), (110, 10.0, 28.56), (120, 20.0, 28.07), (150, 15.0, 26.92),
    (160, 10.0, 26.66), (170, 7.0, 26.40), (190, 5.0, 25.85), (230, 4.0, 24.70), (300, 3.3, 22.66),
    (400, 2.6, 19.94), (500, 1.7, 17.94), (600, 1.1, 16.84), (700, 0.0, 16.17),
)  # fmt: skip
_US1976_LOW = ((0, -6.5), (11, 0.0), (20, 1.0), (32, 2.8), (47, 0.0), (51, -2.8), (71, -2.0))

# Mean molecular weight over that at sea level, 80 to 86 km by 0.5 km: what turns TM into kinetic temperature.
_US1976_MASS_RATIO = (
    1.0, 0.999996, 0.999989, 0.999971, 0.999941, 0.999909, 0.999870, 0.999829, 0.999786, 0.999741, 0.999694,
    0.999641, 0.999579,
)  # fmt: skip

_LOWEST_M = -5000.0


@cache
def us1962() -> Atmosphere:
    """U.S. Standard Atmosphere 1962, -5 to 700 km.

    Temperature is linear in geopotential altitude to 90 km and in geometric altitude above, where gravity
    falls with the inverse square and the molecular weight is linear between its tabulated values.
    """
    layers = _geopotential_layers(_US1962_LOW)
    for (z, lapse, molar_mass), (z_next, _, molar_mass_next) in pairwise(_US1962_HIGH):
        layer = np.zeros(LAYER_COLUMNS)
        layer[[Z_BASE, LAPSE, M_BASE]] = z * 1e3, lapse * 1e-3, molar_mass
        layer[M_SLOPE] = (molar_mass_next - molar_mass) / (z_next - z) * 1e-3
        layer[-1] = 1.0
        layer[[TM_BASE, P_BASE]] = _within_layer(layers[-1], layer[Z_BASE])
        layers.append(layer)
    return Atmosphere("us1962", layered_model(np.array(layers), _LOWEST_M, 700e3))


@cache
def us1976() -> Atmosphere:
    """U.S. Standard Atmosphere 1976, -5 to 1000 km.

    Layers linear in geopotential altitude to 86 km, a table of the standard's gas balance above.
    """
    layers = _geopotential_layers(_US1976_LOW)
    lapse = layers[-1][LAPSE]
    for step, (ratio, next_ratio) in enumerate(pairwise(_US1976_MASS_RATIO)):
        z = 80e3 + 500.0 * step
        layer = np.zeros(LAYER_COLUMNS)
        layer[[Z_BASE, H_BASE, LAPSE]] = z, EARTH_RADIUS * z / (EARTH_RADIUS + z), lapse
        layer[[M_BASE, M_SLOPE]] = MOLAR_MASS * ratio, MOLAR_MASS * (next_ratio - ratio) / 500.0
        layer[[TM_BASE, P_BASE]] = _within_layer(layers[-1], z)
        layers.append(layer)
    return Atmosphere("us1976", layered_model(np.array(layers), _LOWEST_M, 1000e3, upper_model()))


def _geopotential_layers(table: tuple[tuple[int, float], ...]) -> list[Floats]:
    layers: list[Floats] = []
    for h_km, lapse in table:
        layer = np.zeros(LAYER_COLUMNS)
        h = h_km * 1e3
        layer[[Z_BASE, H_BASE, LAPSE, M_BASE]] = (
            EARTH_RADIUS * h / (EARTH_RADIUS - h),
            h,
            lapse * 1e-3,
            MOLAR_MASS,
        )
        if layers:
            layer[[TM_BASE, P_BASE]] = _within_layer(layers[-1], layer[Z_BASE])
        else:
            layer[[TM_BASE, P_BASE]] = _SEA_LEVEL_TEMPERATURE, _SEA_LEVEL_PRESSURE
        layers.append(layer)
    return layers


ATMOSPHERES = {"us1962": us1962, "us1976": us1976}


def standard_atmosphere(name: str) -> Atmosphere:
    """Look a standard atmosphere up by name ('us1962', 'us1976')."""
    if name not in ATMOSPHERES:
        raise InputError(f"unknown atmosphere '{name}'; choose one of {', '.join(ATMOSPHERES)}")
    return ATMOSPHERES[name]()
