"""U.S. Standard Atmosphere 1976 from 86 to 1000 km: number densities of six gases in diffusive balance.

Source: U.S. Standard Atmosphere, 1976 (NOAA-S/T 76-1562), part 1: temperature eqs. 25-31, eddy diffusion
eqs. 7, vertical flux eq. 37, tables 6 and 7; equation numbers below are that document's. Integrated by the
trapezoidal rule on a 50 m grid, once per process.
"""

from __future__ import annotations

import numpy as np

from sim.air.atmosphere import EARTH_RADIUS, GRAVITY, AirModel, Floats, table_model

__all__ = ["upper_model"]

_UNIVERSAL = 8314.32  # J/(kmol K)
_BOLTZMANN = 1.380622e-23
_AVOGADRO = 6.022169e26  # 1/kmol
_MEAN_MASS = 28.9644
_STEP_M = 50.0
_EVERY = 20  # the table keeps every kilometre
_BASE_M, _TOP_M = 86_000.0, 1_000_000.0

# Molar mass, number density at 86 km, diffusion coefficients a and b, thermal diffusion alpha, flux Q, U, W.
_N2_MASS, _N2_BASE = 28.0134, 1.129794e20
_GASES = {
    "O": (15.9994, 8.6e16, 6.986e20, 0.750, 0.0, -5.809644e-4, 56.90311, 2.706240e-5),
    "O2": (31.9988, 3.030898e19, 4.863e20, 0.750, 0.0, 1.366212e-4, 86.0, 8.333333e-5),
    "Ar": (39.948, 1.3514e18, 4.487e20, 0.870, 0.0, 9.434079e-5, 86.0, 8.333333e-5),
    "He": (4.0026, 7.5817e14, 1.700e21, 0.691, -0.40, -2.457369e-4, 86.0, 6.666667e-4),
}
_H_MASS, _H_AT_500, _H_FLUX, _H_ALPHA = 1.00797, 8.0e10, 7.2e11, -0.25
_H_A, _H_B = 3.305e21, 0.500


def upper_model() -> AirModel:
    """Table of density, pressure and kinetic temperature every kilometre from 86 to 1000 km."""
    z = np.arange(_BASE_M, _TOP_M + 0.5 * _STEP_M, _STEP_M)
    temperature, slope = _temperature(z)
    gravity = GRAVITY * (EARTH_RADIUS / (EARTH_RADIUS + z)) ** 2
    weight = gravity / (_UNIVERSAL * temperature)  # 1/(m kg/kmol)
    mixed_mass = np.where(z <= 100_000.0, _MEAN_MASS, _N2_MASS)
    eddy = _eddy_diffusion(z / 1e3)

    nitrogen = _N2_BASE * temperature[0] / temperature * np.exp(-_integral(mixed_mass * weight))
    density = {"N2": nitrogen}
    for gas, (mass, base, a, b, alpha, *_) in _GASES.items():
        # Eq. 8; oxygen diffuses through nitrogen, the rarer gases through nitrogen and oxygen.
        others = nitrogen if gas in ("O", "O2") else nitrogen + density["O"] + density["O2"]
        diffusion = a / others * (temperature / 273.15) ** b
        balance = weight * (mass + mixed_mass * eddy / diffusion) + alpha * slope / temperature
        exponent = _integral(balance * diffusion / (diffusion + eddy) + _flux(gas, z / 1e3) / 1e3)
        density[gas] = base * temperature[0] / temperature * np.exp(-exponent)
    density["H"] = _hydrogen(z, temperature, weight, sum(density.values()))

    masses = {"N2": _N2_MASS, "H": _H_MASS, **{gas: row[0] for gas, row in _GASES.items()}}
    mass_density = sum(number * masses[gas] for gas, number in density.items()) / _AVOGADRO
    pressure = sum(density.values()) * _BOLTZMANN * temperature
    kept = slice(None, None, _EVERY)
    return table_model(
        z[kept], np.log(mass_density[kept]), np.log(pressure[kept]), temperature[kept], "smooth"
    )


def _temperature(z: Floats) -> tuple[Floats, Floats]:
    """Kinetic temperature (K) and its slope (K/m), eqs. 25, 27, 29, 31."""
    km = z / 1e3
    radius = EARTH_RADIUS / 1e3
    bend = np.sqrt(np.maximum(1.0 - ((km - 91.0) / 19.9429) ** 2, 1e-12))
    xi = (km - 120.0) * (radius + 120.0) / (radius + km)
    decay = np.exp(-0.01875 * xi)
    regions = [km <= 91.0, km <= 110.0, km <= 120.0]
    temperature = np.select(
        regions, [np.full_like(km, 186.8673), 263.1905 - 76.3232 * bend, 240.0 + 12.0 * (km - 110.0)], 0.0
    )
    slope = np.select(regions, [0.0 * km, 76.3232 * (km - 91.0) / 19.9429**2 / bend, 0.0 * km + 12.0], 0.0)
    high = km > 120.0
    temperature[high] = 1000.0 - 640.0 * decay[high]
    slope[high] = (640.0 * 0.01875 * ((radius + 120.0) / (radius + km)) ** 2 * decay)[high]
    return temperature, slope / 1e3


def _eddy_diffusion(km: Floats) -> Floats:
    """Eddy diffusion coefficient, m2/s (eq. 7)."""
    middle = np.clip(400.0 - (km - 95.0) ** 2, 1e-9, None)
    return np.where(km < 95.0, 120.0, np.where(km < 115.0, 120.0 * np.exp(1.0 - 400.0 / middle), 0.0))


def _flux(gas: str, km: Floats) -> Floats:
    """Vertical transport term of eq. 37, per km."""
    q, u, w = _GASES[gas][5:]
    rise = km - u
    term = q * rise**2 * np.exp(-w * rise**3)
    if gas == "O":
        fall = np.maximum(97.0 - km, 0.0)
        term -= 3.416248e-3 * fall**2 * np.exp(-5.008765e-4 * fall**3)
    return term


def _hydrogen(z: Floats, temperature: Floats, weight: Floats, others: Floats) -> Floats:
    """Atomic hydrogen, counted from 150 km (eq. 39): fixed at 500 km, escaping at constant flux below."""
    reference = int(np.argmin(np.abs(z - 500_000.0)))
    tau = _integral(_H_MASS * weight)
    tau -= tau[reference]
    warmth = (temperature / temperature[reference]) ** (1.0 + _H_ALPHA)
    diffusion = _H_A / others * (temperature / 273.15) ** _H_B
    loss = _integral(np.where(z < 150_000.0, 0.0, _H_FLUX / diffusion * warmth * np.exp(tau)))
    loss = np.where(z < 500_000.0, loss - loss[reference], 0.0)
    return np.where(z < 150_000.0, 0.0, (_H_AT_500 - loss) / warmth * np.exp(-tau))


def _integral(values: Floats) -> Floats:
    """Running integral over height from 86 km."""
    return np.concatenate([[0.0], np.cumsum(0.5 * _STEP_M * (values[1:] + values[:-1]))])
