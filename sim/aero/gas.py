"""Perfect-gas relations of compressible flow and the transport properties of air.

Closed forms of NACA Report 1135 (Ames Research Staff, 1953). Scalar, compiled, and valid for any ratio of
specific heats ``gamma`` unless said otherwise.
"""

from __future__ import annotations

import math

from sim.core.compiled import compiled

__all__ = [
    "GAMMA",
    "GAS_CONSTANT",
    "HEAT_CAPACITY",
    "PRANDTL",
    "equilibrium_pressure_increment",
    "max_prandtl_meyer_angle",
    "normal_shock_density_ratio",
    "normal_shock_mach",
    "normal_shock_pressure_ratio",
    "normal_shock_total_pressure_ratio",
    "pitot_pressure_ratio",
    "prandtl_meyer_angle",
    "prandtl_meyer_mach",
    "stagnation_pressure_coefficient",
    "total_pressure_ratio",
    "viscosity",
]

GAMMA = 1.4
GAS_CONSTANT = 287.053
"""J/(kg K)."""
HEAT_CAPACITY = GAMMA / (GAMMA - 1.0) * GAS_CONSTANT
"""At constant pressure, J/(kg K)."""
PRANDTL = 0.72


@compiled
def total_pressure_ratio(mach: float, gamma: float) -> float:
    """Isentropic total over static pressure, p0/p (NACA 1135 eq. 44)."""
    return float((1.0 + 0.5 * (gamma - 1.0) * mach * mach) ** (gamma / (gamma - 1.0)))


@compiled
def pitot_pressure_ratio(mach: float, gamma: float) -> float:
    """Stagnation pressure of a blunt nose over free-stream static pressure, p02/p1.

    Rayleigh's pitot formula (NACA 1135 eq. 100) when supersonic, the isentropic total pressure otherwise; the
    two join with equal value and slope at Mach 1.
    """
    if mach <= 1.0:
        return total_pressure_ratio(mach, gamma)
    m2 = mach * mach
    behind = (gamma + 1.0) ** 2 * m2 / (4.0 * gamma * m2 - 2.0 * (gamma - 1.0))
    return float(behind ** (gamma / (gamma - 1.0)) * (1.0 - gamma + 2.0 * gamma * m2) / (gamma + 1.0))


@compiled
def stagnation_pressure_coefficient(mach: float, gamma: float) -> float:
    """Cp at the stagnation point of a blunt nose, the Cp_max of modified Newtonian theory (Lees, 1955)."""
    half_gamma_m2 = 0.5 * gamma * mach * mach
    if mach < 0.05:  # the difference p02/p1 - 1 would cancel
        return 1.0 + mach * mach * (0.25 + (2.0 - gamma) / 24.0 * mach * mach)
    return (pitot_pressure_ratio(mach, gamma) - 1.0) / half_gamma_m2


@compiled
def equilibrium_pressure_increment(speed_m_s: float, density_kg_m3: float) -> float:
    """What chemical equilibrium of air adds to the stagnation pressure coefficient of a perfect gas.

    Polynomial in the kinetic enthalpy and the logarithm of density, fitted to ten equilibrium normal shocks
    (1.5 to 4.3 km/s, 10 to 80 km, NASA thermodynamic polynomials): within 0.0014 of them, and of each within
    0.002 when it is left out. Held constant above 4.36 km/s, zero at rest. The increment is close to the drop
    of the density ratio across the shock, since Cp_max is nearly 2 - rho1/rho2.
    """
    h = min(0.5e-6 * speed_m_s * speed_m_s, 9.5)  # MJ/kg
    decades = math.log10(density_kg_m3 / 1e-2)
    cubic = 1.07509504e-2 + h * (3.7292449e-4 - 7.46367784e-5 * h - 3.49719659e-5 * decades)
    return max(h * cubic, 0.0)


@compiled
def normal_shock_pressure_ratio(mach: float, gamma: float) -> float:
    """Static pressure ratio p2/p1 across a normal shock (NACA 1135 eq. 93), ``mach`` >= 1."""
    return (2.0 * gamma * mach * mach - (gamma - 1.0)) / (gamma + 1.0)


@compiled
def normal_shock_density_ratio(mach: float, gamma: float) -> float:
    """Density ratio rho2/rho1 across a normal shock (NACA 1135 eq. 94), ``mach`` >= 1."""
    m2 = mach * mach
    return (gamma + 1.0) * m2 / ((gamma - 1.0) * m2 + 2.0)


@compiled
def normal_shock_mach(mach: float, gamma: float) -> float:
    """Mach number behind a normal shock (NACA 1135 eq. 96), ``mach`` >= 1."""
    m2 = mach * mach
    return math.sqrt(((gamma - 1.0) * m2 + 2.0) / (2.0 * gamma * m2 - (gamma - 1.0)))


@compiled
def normal_shock_total_pressure_ratio(mach: float, gamma: float) -> float:
    """Total pressure ratio p02/p01 across a normal shock (NACA 1135 eq. 99); 1 below Mach 1."""
    if mach <= 1.0:
        return 1.0
    return pitot_pressure_ratio(mach, gamma) / total_pressure_ratio(mach, gamma)


@compiled
def max_prandtl_meyer_angle(gamma: float) -> float:
    """Turning angle that expands Mach 1 to vacuum, rad (130.45 deg for gamma 1.4)."""
    return 0.5 * math.pi * (math.sqrt((gamma + 1.0) / (gamma - 1.0)) - 1.0)


@compiled
def prandtl_meyer_angle(mach: float, gamma: float) -> float:
    """Prandtl-Meyer angle nu(M), rad (NACA 1135 eq. 171c), ``mach`` >= 1."""
    root = math.sqrt((gamma + 1.0) / (gamma - 1.0))
    t = math.sqrt(max(mach * mach - 1.0, 0.0))
    return root * math.atan(t / root) - math.atan(t)


@compiled
def prandtl_meyer_mach(angle_rad: float, gamma: float) -> float:
    """Mach number whose Prandtl-Meyer angle is given; 1 for angles <= 0, infinity from the vacuum angle on.

    Halley iteration on t = sqrt(M^2 - 1), started from the rational fit of Hall (Aeronautical Quarterly 26,
    1975); accurate to rounding.
    """
    if angle_rad <= 0.0:
        return 1.0
    fraction = angle_rad / max_prandtl_meyer_angle(gamma)
    if fraction >= 1.0:
        return math.inf
    y = fraction ** (2.0 / 3.0)
    guess = (1.0 + y * (1.3604 + y * (0.0962 - 0.5127 * y))) / (1.0 + y * (-0.6722 - 0.3278 * y))
    root = math.sqrt((gamma + 1.0) / (gamma - 1.0))
    t = math.sqrt(guess * guess - 1.0)
    for _ in range(30):
        a = 1.0 + (t / root) ** 2
        b = 1.0 + t * t
        newton = (root * math.atan(t / root) - math.atan(t) - angle_rad) * a * b / (b - a)
        curvature = 1.0 / t - t / (root * root * a) - t / b
        step = newton / max(1.0 - newton * curvature, 0.5)
        t = max(t - step, 0.1 * t)
        if abs(step) <= 1e-5 * t:  # the next, cubically smaller step would be below rounding
            break
    return math.sqrt(1.0 + t * t)


@compiled
def viscosity(temperature_K: float) -> float:
    """Dynamic viscosity of air, Pa s: Sutherland's law with the constants of the US Standard Atmospheres.

    Linear in temperature below 100 K, where Sutherland's law falls too low; an extrapolation above 2000 K.
    """
    t = max(temperature_K, 100.0)
    return 1.458e-6 * t * math.sqrt(t) / (t + 110.4) * (temperature_K / t)
