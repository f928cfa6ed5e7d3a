"""The air a vehicle flies through: one interface for every atmosphere, compiled inside the integrator.

An :class:`Atmosphere` is either a standard made of layers with closed-form pressure
(:mod:`sim.air.standards`), or a table interpolated by smooth piecewise cubics of ln(density), ln(pressure)
and temperature (:mod:`sim.air.altitude_table`), or layers below and a table above. :func:`air` evaluates it
in machine code; calling the object evaluates it over an array.

Constants are those of the U.S. Standard Atmospheres of 1962 and 1976, which share them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from sim.core.checks import check_numbers
from sim.core.compiled import compiled, kernel
from sim.core.errors import InputError

__all__ = ["AirModel", "AirState", "Atmosphere", "air", "exponential", "viscosity"]

Floats = npt.NDArray[np.float64]

GRAVITY = 9.80665  # g0, m/s2
EARTH_RADIUS = 6_356_766.0  # r0 of the geopotential, m
GAS_CONSTANT_AIR = 8314.32 / 28.9644  # R*/M0, J/(kg K)
MOLAR_MASS = 28.9644  # M0 at sea level, kg/kmol
HEAT_RATIO = 1.4
SUTHERLAND_BETA = 1.458e-6  # kg/(s m K^0.5)
SUTHERLAND_S = 110.4  # K

LAYER_COLUMNS = 8
Z_BASE, H_BASE, TM_BASE, LAPSE, P_BASE, M_BASE, M_SLOPE, GEOMETRIC = range(LAYER_COLUMNS)
LN_RHO, LN_P, TEMPERATURE = range(3)

Interpolation = Literal["smooth", "log-linear"]


class AirModel(NamedTuple):
    """An atmosphere as the compiled integrator reads it.

    Attributes
    ----------
    lowest_m, highest_m : float
        Geometric altitudes between which the model is valid.
    layers : (n, 8) array
        Closed-form layers from the ground up; used below the table.
    breaks_m : (m + 1,) array
        Interval ends of the table; empty when there is none.
    cubics : (m, 3, 4) array
        Coefficients (constant first) of ln rho, ln p and T over each interval, in metres above its lower end.
    """

    lowest_m: float
    highest_m: float
    layers: Floats
    breaks_m: Floats
    cubics: Floats


@kernel
def interval(breaks: Floats, x: float) -> int:
    """Index i of the interval breaks[i] <= x < breaks[i + 1], the first or last one beyond the ends."""
    low, high = 0, breaks.size - 1
    while high - low > 1:
        middle = (low + high) // 2
        if x < breaks[middle]:
            high = middle
        else:
            low = middle
    return low


@kernel
def air(model: AirModel, altitude_m: float) -> tuple[float, float, float, float]:
    """Density (kg/m3), pressure (Pa), kinetic temperature (K), speed of sound (m/s) at a geometric altitude.

    The speed of sound is sqrt(1.4 p/rho), which equals the standards' sqrt(gamma R* TM/M0). Outside the
    model's range its first or last piece is continued; the integrator refuses to *end* a step there.
    """
    if model.breaks_m.size > 0 and (altitude_m >= model.breaks_m[0] or model.layers.shape[0] == 0):
        i = interval(model.breaks_m, altitude_m)
        x = altitude_m - model.breaks_m[i]
        c = model.cubics
        density = math.exp(c[i, 0, 0] + x * (c[i, 0, 1] + x * (c[i, 0, 2] + x * c[i, 0, 3])))
        pressure = math.exp(c[i, 1, 0] + x * (c[i, 1, 1] + x * (c[i, 1, 2] + x * c[i, 1, 3])))
        temperature = c[i, 2, 0] + x * (c[i, 2, 1] + x * (c[i, 2, 2] + x * c[i, 2, 3]))
        return density, pressure, temperature, math.sqrt(HEAT_RATIO * pressure / density)

    i = model.layers.shape[0] - 1
    while i > 0 and altitude_m < model.layers[i, Z_BASE]:
        i -= 1
    layer = model.layers[i]
    temperature, pressure = _within_layer(layer, altitude_m)
    density = pressure / (GAS_CONSTANT_AIR * temperature)
    sound = math.sqrt(HEAT_RATIO * GAS_CONSTANT_AIR * temperature)
    molar_mass = layer[M_BASE] + layer[M_SLOPE] * (altitude_m - layer[Z_BASE])
    return density, pressure, temperature * molar_mass / MOLAR_MASS, sound


@kernel
def _within_layer(layer: Floats, altitude_m: float) -> tuple[float, float]:
    """Molecular-scale temperature and pressure from the hydrostatic equation, integrated in closed form."""
    lapse = layer[LAPSE]
    if layer[GEOMETRIC] == 0.0:
        rise = EARTH_RADIUS * altitude_m / (EARTH_RADIUS + altitude_m) - layer[H_BASE]
        temperature = layer[TM_BASE] + lapse * rise
        if lapse == 0.0:
            exponent = -GRAVITY * rise / (GAS_CONSTANT_AIR * temperature)
        else:
            exponent = -GRAVITY / (GAS_CONSTANT_AIR * lapse) * math.log(temperature / layer[TM_BASE])
    else:
        # TM = lapse (u - c) with u = r0 + Z, and gravity g0 (r0/u)^2.
        temperature = layer[TM_BASE] + lapse * (altitude_m - layer[Z_BASE])
        u, base = EARTH_RADIUS + altitude_m, EARTH_RADIUS + layer[Z_BASE]
        c = base - layer[TM_BASE] / lapse
        integral = math.log((u - c) * base / (u * (base - c))) / c**2 + (1.0 / u - 1.0 / base) / c
        exponent = -GRAVITY * EARTH_RADIUS**2 / (GAS_CONSTANT_AIR * lapse) * integral
    return temperature, layer[P_BASE] * math.exp(exponent)


@compiled
def viscosity(temperature_K: float) -> float:
    """Sutherland's law with the standards' constants, Pa s (defined by them up to 90 km)."""
    return SUTHERLAND_BETA * temperature_K * math.sqrt(temperature_K) / (temperature_K + SUTHERLAND_S)


@compiled
def _air_over(model: AirModel, altitude_m: Floats) -> Floats:
    rows = np.empty((5, altitude_m.size))
    for i in range(altitude_m.size):
        rows[0, i], rows[1, i], rows[2, i], rows[3, i] = air(model, altitude_m[i])
        rows[4, i] = viscosity(rows[2, i])
    return rows


@dataclass(frozen=True)
class AirState:
    """State of the air at the altitudes asked for; arrays of their shape."""

    density_kg_m3: Floats
    pressure_Pa: Floats
    temperature_K: Floats
    speed_of_sound_m_s: Floats
    viscosity_Pa_s: Floats


@dataclass(frozen=True)
class Atmosphere:
    """A named atmosphere. Call it with geometric altitudes in metres to get the :class:`AirState` there."""

    name: str
    model: AirModel

    def __call__(self, altitude_m: npt.ArrayLike) -> AirState:
        """Evaluate at geometric altitudes (m).

        Raises
        ------
        InputError
            If an altitude lies outside the atmosphere's range.
        """
        altitude = np.asarray(altitude_m, dtype=float)
        outside = (altitude < self.model.lowest_m) | (altitude > self.model.highest_m) | np.isnan(altitude)
        if np.any(outside):
            worst = float(np.atleast_1d(altitude)[np.atleast_1d(outside)][0])
            raise InputError(
                f"altitude {worst:g} m is outside atmosphere '{self.name}', which covers "
                f"{self.model.lowest_m:g} to {self.model.highest_m:g} m"
            )
        rows = _air_over(self.model, np.ascontiguousarray(altitude.ravel()))
        return AirState(*(row.reshape(altitude.shape) for row in rows))


def layered_model(
    layers: Floats, lowest_m: float, highest_m: float, above: AirModel | None = None
) -> AirModel:
    """Join closed-form layers with an optional table above them."""
    empty = AirModel(0.0, 0.0, np.empty((0, LAYER_COLUMNS)), np.empty(0), np.empty((0, 3, 4)))
    top = above or empty
    return AirModel(lowest_m, highest_m, np.ascontiguousarray(layers), top.breaks_m, top.cubics)


def exponential(
    sea_level_density_kg_m3: float = 1.225,
    scale_height_m: float = 7200.0,
    temperature_K: float = 250.0,
    highest_m: float = 1.0e6,
) -> Atmosphere:
    """Isothermal-looking atmosphere rho = rho0 exp(-h/H), exact at every altitude (closed-form entry theory).

    Pressure follows from the perfect-gas law at the given constant temperature.
    """
    numbers = {
        "sea_level_density_kg_m3": sea_level_density_kg_m3,
        "scale_height_m": scale_height_m,
        "temperature_K": temperature_K,
        "highest_m": highest_m,
    }
    check_numbers(**numbers)
    if min(numbers.values()) <= 0:
        raise InputError("an exponential atmosphere needs a positive density, scale height and temperature")
    cubics = np.zeros((1, 3, 4))
    cubics[0, LN_RHO, :2] = np.log(sea_level_density_kg_m3), -1.0 / scale_height_m
    cubics[0, LN_P, :2] = cubics[0, LN_RHO, :2]
    cubics[0, LN_P, 0] += np.log(GAS_CONSTANT_AIR * temperature_K)
    cubics[0, TEMPERATURE, 0] = temperature_K
    # The single cubic is anchored at altitude 0 and continued below it.
    model = AirModel(-5000.0, highest_m, np.empty((0, LAYER_COLUMNS)), np.array([0.0, highest_m]), cubics)
    return Atmosphere("exponential", model)


def table_model(
    altitude_m: Floats,
    ln_density: Floats,
    ln_pressure: Floats,
    temperature_K: Floats,
    interpolation: Interpolation,
) -> AirModel:
    """Piecewise cubics through the rows of an ascending table."""
    columns = [ln_density, ln_pressure, temperature_K]
    cubics = np.stack([piecewise_cubic(altitude_m, column, interpolation) for column in columns], axis=1)
    return AirModel(
        float(altitude_m[0]),
        float(altitude_m[-1]),
        np.empty((0, LAYER_COLUMNS)),
        np.ascontiguousarray(altitude_m),
        np.ascontiguousarray(cubics),
    )


def piecewise_cubic(x: Floats, y: Floats, interpolation: Interpolation) -> Floats:
    """Coefficients (intervals, 4), constant first, of straight lines or monotone C1 cubics through (x, y)."""
    if interpolation == "log-linear" or len(x) == 2:
        zero = np.zeros(len(x) - 1)
        return np.stack([y[:-1], np.diff(y) / np.diff(x), zero, zero], axis=1)
    from scipy.interpolate import PchipInterpolator

    return np.asarray(PchipInterpolator(x, y).c[::-1].T, dtype=float)
