"""GRAM-like dispersions: random density and wind around a mean atmosphere, reproducible by seed.

NASA's GRAM-99, which the paper names, is not open. What is offered instead has its structure: a slow and a
fast random component, each a first-order Gauss-Markov process along the flight (Justus & Johnson,
NASA/TM-1999-209630, describe a large-scale wave and a small-scale stochastic part), with standard
deviations that follow altitude as in one published output table of Earth-GRAM2016 (shipped with
AVSLab/basilisk: 40 N, 105 W, 21 September).

    x = sqrt(f) x_slow + sqrt(1 - f) x_fast,   corr(h, h + dh) = exp(-dh/Lz - ds/Ls)

The share f = 0.6 of the slow part and the lengths (vertical 0.6-3 km fast, 6-15 km slow, growing with height;
horizontal 75 times that) are a choice made on the autocorrelation of that table's perturbed density.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from sim.air.altitude_table import table_atmosphere
from sim.air.atmosphere import EARTH_RADIUS, GAS_CONSTANT_AIR, GRAVITY, Atmosphere, Floats
from sim.air.wind import Wind, table_wind
from sim.core.checks import check_numbers, is_number
from sim.core.compiled import compiled
from sim.core.errors import InputError

__all__ = ["DispersedAir", "dispersed", "two_scale_profile"]

SLOW_SHARE = 0.6
_STEP_M = 250.0
_TOP_M = 140_000.0
_HORIZONTAL_OVER_VERTICAL = 75.0

# Height km; standard deviations of density %, of east, north and vertical wind m/s; mean east and north
# wind m/s.
_EARTH_GRAM_2016 = np.array(
    [
        (0, 2.37, 2.31, 3.0, 0.49, 0.63, 0.84),
        (5, 1.12, 5.59, 6.47, 0.97, 7.63, 0.40),
        (10, 1.22, 12.47, 13.01, 0.63, 16.5, 1.61),
        (15, 1.55, 9.06, 9.11, 0.51, 16.76, 0.92),
        (20, 0.97, 3.47, 2.96, 0.42, 1.79, 0.63),
        (30, 1.15, 5.37, 2.93, 0.53, -2.28, -0.17),
        (40, 3.1, 10.7, 4.9, 0.75, 0.03, -0.35),
        (50, 4.2, 14.2, 6.5, 1.15, 1.05, -0.57),
        (60, 5.4, 17.2, 9.3, 1.61, 3.94, -0.75),
        (70, 5.7, 24.2, 15.2, 1.91, 12.26, -1.04),
        (80, 6.1, 32.1, 28.6, 3.3, 26.64, -3.58),
        (90, 9.8, 37.1, 35.6, 4.75, 46.66, -5.92),
        (100, 15.4, 49.5, 45.0, 5.26, 44.57, -4.45),
        (110, 11.7, 53.6, 53.1, 5.95, 15.32, -1.70),
        (120, 7.9, 53.2, 42.7, 6.63, 9.74, -1.03),
        (140, 7.2, 69.0, 69.0, 8.33, 24.94, -3.69),
    ]
)


class DispersedAir(NamedTuple):
    """One random atmosphere: its air and its wind."""

    atmosphere: Atmosphere
    wind: Wind


def dispersed(
    mean: Atmosphere,
    seed: int,
    *,
    scale: float = 1.0,
    wind_scale: float | None = None,
    mean_wind: bool = False,
    path_angle_deg: float = -15.0,
) -> DispersedAir:
    """Draw one atmosphere around a mean profile.

    Parameters
    ----------
    mean : Atmosphere
        Undisturbed density, pressure and temperature.
    seed : int
        Same seed, same profile. Every variable has a random stream of its own under it.
    scale : float
        Multiplies the standard deviations (GRAM's perturbation scale); 0 gives the mean profile.
    wind_scale : float, optional
        The same for the winds; `scale` when None.
    mean_wind : bool
        Add the mean wind of the Earth-GRAM2016 table.
    path_angle_deg : float
        Steepness of the flight, which turns height into distance flown: shallow flights see variations
        sooner.

    Returns
    -------
    DispersedAir
        From the ground (or the mean's lowest altitude) to 140 km (or the mean's highest). Density is
        log-normal with the mean of `mean`; pressure follows from the hydrostatic equation and temperature
        from both.
    """
    check_numbers(
        scale=scale, wind_scale=0.0 if wind_scale is None else wind_scale, path_angle_deg=path_angle_deg
    )
    if not (0 <= scale <= 10 and (wind_scale is None or 0 <= wind_scale <= 10)):
        raise InputError("the scale of a dispersion must lie between 0 and 10")
    if not (is_number(seed) and seed == int(seed) and seed >= 0):
        raise InputError(f"the seed of a dispersion must be a whole number >= 0, not {seed!r}")
    bottom, top = max(mean.model.lowest_m, 0.0), min(mean.model.highest_m, _TOP_M)
    z = np.linspace(bottom, top, max(2, round((top - bottom) / _STEP_M) + 1))
    table = np.array(
        [np.interp(z, _EARTH_GRAM_2016[:, 0] * 1e3, column) for column in _EARTH_GRAM_2016.T[1:]]
    )
    stretch = 1.0 + 1.0 / (_HORIZONTAL_OVER_VERTICAL * max(math.tan(math.radians(abs(path_angle_deg))), 1e-3))
    density_noise, *wind_noise = (
        two_scale_profile(z, np.random.default_rng(stream), stretch)
        for stream in np.random.SeedSequence(int(seed)).spawn(4)
    )

    air = mean(z)
    sigma = scale * table[0] / 100.0
    spread = np.sqrt(np.log1p(sigma**2))
    density = air.density_kg_m3 * np.exp(spread * density_noise - 0.5 * spread**2)
    pressure = _hydrostatic(z, density, float(air.pressure_Pa[-1]))
    # Above 90 km kinetic temperature is less than p/(rho R): keep the mean's ratio.
    lightness = air.temperature_K * air.density_kg_m3 * GAS_CONSTANT_AIR / air.pressure_Pa
    atmosphere = table_atmosphere(
        z,
        density,
        pressure_Pa=pressure,
        temperature_K=lightness * pressure / (density * GAS_CONSTANT_AIR),
        name=f"{mean.name}, dispersed (seed {int(seed)})",
    )
    winds = (scale if wind_scale is None else wind_scale) * table[1:4] * np.array(wind_noise)
    if mean_wind:
        winds[:2] += table[4:6]
    return DispersedAir(atmosphere, table_wind(z, winds[1], winds[0], -winds[2]))


def two_scale_profile(altitude_m: Floats, random: np.random.Generator, stretch: float = 1.0) -> Floats:
    """Standard normal values at ascending altitudes, correlated over a short and a long distance.

    Parameters
    ----------
    altitude_m : (n,) array
    random : numpy.random.Generator
    stretch : float
        By how much the distance flown shortens the correlation over height.
    """
    kilometres = altitude_m / 1e3
    slow = _markov(altitude_m, 1e3 * (6.0 + 9.0 * kilometres / 120.0) / stretch, random)
    fast = _markov(altitude_m, 1e3 * (0.6 + 2.4 * kilometres / 120.0) / stretch, random)
    return math.sqrt(SLOW_SHARE) * slow + math.sqrt(1.0 - SLOW_SHARE) * fast


def _markov(z: Floats, length: Floats, random: np.random.Generator) -> Floats:
    """Stationary first-order Gauss-Markov process with a local correlation length."""
    draws = random.standard_normal(z.size)
    decay = np.exp(-np.diff(z) / (0.5 * (length[1:] + length[:-1])))
    return _chain(draws, decay)


@compiled
def _chain(draws: Floats, decay: Floats) -> Floats:
    values = np.empty(draws.size)
    values[0] = draws[0]
    for i in range(decay.size):
        values[i + 1] = decay[i] * values[i] + math.sqrt(1.0 - decay[i] ** 2) * draws[i + 1]
    return values


def _hydrostatic(z: Floats, density: Floats, top_pressure: float) -> Floats:
    """Pressure under the weight of the air above (density exponential between the rows)."""
    weight = density * GRAVITY * (EARTH_RADIUS / (EARTH_RADIUS + z)) ** 2
    ratio = np.log(weight[:-1] / weight[1:])
    small = np.abs(ratio) < 1e-6
    mean = np.where(
        small, 0.5 * (weight[:-1] + weight[1:]), (weight[:-1] - weight[1:]) / np.where(small, 1.0, ratio)
    )
    return top_pressure + np.append(np.cumsum((mean * np.diff(z))[::-1])[::-1], 0.0)
