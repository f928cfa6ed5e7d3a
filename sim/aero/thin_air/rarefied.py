"""Free-molecular flow, and the bridge to it from the continuum.

Stresses and heat flux are those of a convex body that reflects every molecule diffusely, with the wall's
temperature (Schaaf and Chambre, Flow of Rarefied Gases, 1961, with accommodation coefficients 1). The
coefficients of a body pass from the continuum's to these with sin^2 of the logarithm of the Knudsen number,
as Wilmoth and others did for Stardust (Journal of Spacecraft and Rockets 36, 1999), here between the
customary ends of continuum and transitional flow, 0.01 and 10, so that denser air feels nothing of it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sim.aero.gas import GAMMA, viscosity
from sim.aero.wall.heating import STEFAN_BOLTZMANN
from sim.core.compiled import compiled

__all__ = [
    "CONTINUUM_END",
    "FREE_MOLECULAR_START",
    "Molecules",
    "free_molecular_heat",
    "free_molecular_pressure",
    "free_molecular_shear",
    "free_molecular_wall",
    "knudsen_number",
    "molecules",
    "rarefaction",
]

CONTINUUM_END = 0.01
FREE_MOLECULAR_START = 10.0
_ROOT_PI = math.sqrt(math.pi)
_DEEP = -20.0  # speed ratio times sine: of 1e-177 arrivals nothing is left to compute with soon after


class Molecules(NamedTuple):
    """The stream as molecules: speed ratio, dynamic pressure, energy flux and temperature."""

    speed_ratio: float
    """Speed over the molecules' most probable one, sqrt(2 p/rho)."""
    dynamic_Pa: float
    energy_W_m2: float
    """p sqrt(p / (2 pi rho)): p times a quarter of the molecules' mean speed."""
    temperature_K: float


@compiled
def knudsen_number(pressure_Pa: float, density_kg_m3: float, temperature_K: float, length_m: float) -> float:
    """Mean free path mu/p sqrt(pi p / (2 rho)) over a length."""
    free_path = (
        viscosity(temperature_K) / pressure_Pa * math.sqrt(0.5 * math.pi * pressure_Pa / density_kg_m3)
    )
    return free_path / length_m


@compiled
def rarefaction(knudsen: float) -> float:
    """Share of free-molecular flow: 0 up to Knudsen number 0.01, 1 from 10 on, sin^2 of its logarithm."""
    if knudsen <= CONTINUUM_END:
        return 0.0
    if knudsen >= FREE_MOLECULAR_START:
        return 1.0
    x = math.log(knudsen / CONTINUUM_END) / math.log(FREE_MOLECULAR_START / CONTINUUM_END)
    return float(math.sin(0.5 * math.pi * x) ** 2)


@compiled
def molecules(speed_m_s: float, pressure_Pa: float, density_kg_m3: float, temperature_K: float) -> Molecules:
    """Describe a stream by its molecules."""
    probable = math.sqrt(2.0 * pressure_Pa / density_kg_m3)
    return Molecules(
        max(speed_m_s / probable, 1e-6),
        0.5 * density_kg_m3 * speed_m_s * speed_m_s,
        pressure_Pa * probable / (2.0 * _ROOT_PI),
        temperature_K,
    )


@compiled
def free_molecular_pressure(sin_inclination: float, wall_K: float, stream: Molecules) -> float:
    """Cp = (p - p1)/q1 of an element that reflects diffusely."""
    s = stream.speed_ratio
    normal = s * sin_inclination
    rebound = math.sqrt(wall_K / stream.temperature_K)
    arriving = math.exp(-normal * normal)
    facing = math.erfc(-normal)  # 1 + erf, which loses all digits in the shadow
    total = (normal / _ROOT_PI + 0.5 * rebound) * arriving
    total += (normal * normal + 0.5 + 0.5 * _ROOT_PI * rebound * normal) * facing
    return (total - 1.0) / (s * s)


@compiled
def free_molecular_shear(sin_inclination: float, stream: Molecules) -> float:
    """Shear stress over q1, in the direction of the stream along the surface."""
    s = stream.speed_ratio
    normal = s * sin_inclination
    cosine = math.sqrt(max(1.0 - sin_inclination * sin_inclination, 0.0))
    facing = math.erfc(-normal)
    return cosine / (s * _ROOT_PI) * (math.exp(-normal * normal) + _ROOT_PI * normal * facing)


@compiled
def free_molecular_heat(sin_inclination: float, wall_K: float, stream: Molecules) -> float:
    """Heat flux of a diatomic gas into an element with full accommodation, W/m2."""
    s = stream.speed_ratio
    normal = s * sin_inclination
    arriving = math.exp(-normal * normal)
    flux = arriving + _ROOT_PI * normal * math.erfc(-normal)
    energy = s * s + GAMMA / (GAMMA - 1.0)
    energy -= 0.5 * (GAMMA + 1.0) / (GAMMA - 1.0) * wall_K / stream.temperature_K
    return stream.energy_W_m2 * (energy * flux - 0.5 * arriving)


@compiled
def free_molecular_wall(sin_inclination: float, emissivity: float, stream: Molecules) -> float:
    """Temperature at which an element radiates what molecules bring it (adiabatic without emissivity), K.

    Deep in the shadow next to no molecules arrive, and the adiabatic wall tends to a limit: with n the speed
    ratio times the sine, exp(-n^2) over what arrives tends to 2 n^2 + 3 - 3/n^2 (asymptotic series of erfc).
    """
    s = stream.speed_ratio
    normal = s * sin_inclination
    square = normal * normal
    if normal > _DEEP:
        arriving = math.exp(-square)
        spread = arriving / (arriving + _ROOT_PI * normal * math.erfc(-normal))
    else:
        spread = 2.0 * square + 3.0 - 3.0 / square
    carried = 0.5 * (GAMMA + 1.0) / (GAMMA - 1.0)  # by a molecule that leaves, in k T
    wall = (s * s + GAMMA / (GAMMA - 1.0) - 0.5 * spread) / carried * stream.temperature_K
    if emissivity == 0.0:
        return wall
    cold = max(free_molecular_heat(sin_inclination, 0.0, stream), 0.0)
    if cold == 0.0:
        return 0.0
    slope = cold / wall
    radiation = emissivity * STEFAN_BOLTZMANN
    wall = min(wall, (cold / radiation) ** 0.25)
    for _ in range(8):  # Newton from above on a convex, increasing function
        wall -= (radiation * wall**4 + slope * wall - cold) / (4.0 * radiation * wall**3 + slope)
    return float(wall)
