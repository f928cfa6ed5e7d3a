"""Heat flux: stagnation-point correlations, distribution over a blunted cone, and the wall's answer.

SI units throughout; ``wall`` arguments are wall temperatures. Air is calorically perfect, so enthalpies are
``HEAT_CAPACITY`` times temperature.
"""

from __future__ import annotations

import math

from sim.aero.gas import (
    GAMMA,
    GAS_CONSTANT,
    HEAT_CAPACITY,
    PRANDTL,
    normal_shock_total_pressure_ratio,
    total_pressure_ratio,
    viscosity,
)
from sim.core.compiled import compiled

__all__ = [
    "STEFAN_BOLTZMANN",
    "detra_kemp_riddell",
    "fay_riddell",
    "lees_cone",
    "lees_sphere",
    "radiative_equilibrium",
    "stanton_number",
    "sutton_graves",
]

STEFAN_BOLTZMANN = 5.670374419e-8
"""W/(m2 K4), CODATA 2018."""


@compiled
def stanton_number(friction: float) -> float:
    """Stanton number from skin friction by Colburn's analogy, St = (cf/2) Pr^(-2/3)."""
    return float(0.5 * friction * PRANDTL ** (-2.0 / 3.0))


@compiled
def sutton_graves(
    density_kg_m3: float, speed_m_s: float, nose_radius_m: float, temperature_K: float, wall_K: float
) -> float:
    """Stagnation heat flux of Sutton and Graves (NASA TR R-376, 1971), W/m2.

    q = 1.7415e-4 sqrt(rho/Rn) V^3 (1 - h_w/h_0) with h_0 = cp T + V^2/2.
    """
    total = HEAT_CAPACITY * temperature_K + 0.5 * speed_m_s**2
    cold = 1.7415e-4 * math.sqrt(density_kg_m3 / nose_radius_m) * speed_m_s**3
    return cold * (1.0 - HEAT_CAPACITY * wall_K / total)


@compiled
def detra_kemp_riddell(
    density_kg_m3: float, speed_m_s: float, nose_radius_m: float, temperature_K: float, wall_K: float
) -> float:
    """Stagnation heat flux of Detra, Kemp and Riddell (Jet Propulsion 27, 1957), W/m2.

    q = 1.1035e8 / sqrt(Rn) (rho/1.225)^0.5 (V/7925)^3.15 (h_0 - h_w) / (h_0 - 3.015e5).
    """
    total = HEAT_CAPACITY * temperature_K + 0.5 * speed_m_s**2
    cold = (
        1.1035e8 / math.sqrt(nose_radius_m) * math.sqrt(density_kg_m3 / 1.225) * (speed_m_s / 7925.0) ** 3.15
    )
    return float(cold * (total - HEAT_CAPACITY * wall_K) / (total - 3.015e5))


@compiled
def fay_riddell(
    density_kg_m3: float, speed_m_s: float, nose_radius_m: float, temperature_K: float, wall_K: float
) -> float:
    """Stagnation heat flux of Fay and Riddell (Journal of the Aeronautical Sciences 25, 1958), W/m2.

    q = 0.763 Pr^-0.6 (rho_e mu_e)^0.4 (rho_w mu_w)^0.1 sqrt(du/ds) (h_0 - h_w) with their Pr = 0.71 and the
    Newtonian velocity gradient sqrt(2 (p02 - p1)/rho_e)/Rn, in perfect air: within 2.5 % of equilibrium air
    up to 4.3 km/s.
    """
    pressure = density_kg_m3 * GAS_CONSTANT * temperature_K
    mach = speed_m_s / math.sqrt(GAMMA * GAS_CONSTANT * temperature_K)
    pitot = pressure * total_pressure_ratio(mach, GAMMA) * normal_shock_total_pressure_ratio(mach, GAMMA)
    total_K = temperature_K * (1.0 + 0.5 * (GAMMA - 1.0) * mach * mach)
    edge_density = pitot / (GAS_CONSTANT * total_K)
    wall_density = pitot / (GAS_CONSTANT * wall_K)
    gradient = math.sqrt(2.0 * (pitot - pressure) / edge_density) / nose_radius_m
    transport = (edge_density * viscosity(total_K)) ** 0.4 * (wall_density * viscosity(wall_K)) ** 0.1
    driving = HEAT_CAPACITY * (total_K - wall_K)
    return float(0.763 * 0.71**-0.6 * transport * math.sqrt(gradient) * driving)


@compiled
def _sphere_integral(angle_rad: float, sin_angle: float, cos_angle: float, e: float) -> float:
    """Lees's integral over the sphere, D(theta); the series keeps full accuracy near the stagnation point."""
    t = angle_rad
    if t < 0.02:
        t2 = t * t
        return 4.0 * t2 * t2 * (1.0 - t2 * (8.0 - 6.0 * e) / 9.0 + t2 * t2 * (16.0 - 15.0 * e) / 45.0)
    sin_2 = 2.0 * sin_angle * cos_angle
    cos_2 = 1.0 - 2.0 * sin_angle * sin_angle
    # with sin 4t = 2 sin 2t cos 2t and 1 - cos 4t = 2 sin^2 2t
    d = (1.0 - e) * (t * t - t * sin_2 * cos_2 + 0.25 * sin_2 * sin_2)
    return d + 4.0 * e * (t * t - t * sin_2 + sin_angle * sin_angle)


@compiled
def lees_sphere(angle_rad: float, mach: float, gamma: float) -> float:
    """Laminar heat flux on a sphere over that at its stagnation point (Lees, Jet Propulsion 26, 1956).

    Parameters
    ----------
    angle_rad : float
        Angle from the stagnation point as seen from the centre, 0 to pi/2.
    """
    if angle_rad < 1e-6:
        return 1.0
    e = 1.0 / (gamma * mach * mach)
    sin_angle, cos_angle = math.sin(angle_rad), math.cos(angle_rad)
    local = (1.0 - e) * cos_angle * cos_angle + e
    integral = _sphere_integral(angle_rad, sin_angle, cos_angle, e)
    return 2.0 * angle_rad * sin_angle * local / math.sqrt(integral)


@compiled
def lees_cone(distance: float, half_angle_rad: float, mach: float, gamma: float) -> float:
    """Laminar heat flux on a blunted cone over that at its stagnation point (Lees, 1956).

    Parameters
    ----------
    distance : float
        Distance along the surface from the cone's virtual apex over the nose radius; the tangent point has
        cot(half-angle).
    half_angle_rad : float
        Half-angle of the cone.
    """
    e = 1.0 / (gamma * mach * mach)
    sin2 = math.sin(half_angle_rad) ** 2
    pressure = (1.0 - e) * sin2 + e
    t = 0.5 * math.pi - half_angle_rad
    a = 0.5 * math.sqrt(3.0 * pressure * t)
    b = (
        3.0
        / 16.0
        * _sphere_integral(t, math.cos(half_angle_rad), math.sin(half_angle_rad), e)
        / (t * pressure * sin2)
        - math.tan(half_angle_rad) ** -3.0
    )
    return float(a * distance / math.sqrt(b + distance**3))


@compiled
def radiative_equilibrium(conductance: float, adiabatic_wall_K: float, emissivity: float) -> float:
    """Wall temperature at which radiation balances convection: eps sigma T^4 = h (T_aw - T), K.

    Parameters
    ----------
    conductance : float
        h = St rho_e u_e cp, W/(m2 K).
    """
    radiation = emissivity * STEFAN_BOLTZMANN
    # Newton from above on a convex, increasing function: monotone and quadratic.
    t = min(adiabatic_wall_K, (conductance * adiabatic_wall_K / radiation) ** 0.25)
    for _ in range(40):
        step = (radiation * t**4 - conductance * (adiabatic_wall_K - t)) / (
            4.0 * radiation * t**3 + conductance
        )
        t -= step
        if abs(step) < 1e-10 * t:
            break
    return float(t)
