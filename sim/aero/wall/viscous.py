"""Boundary-layer edge, skin friction and transition: one pure function per published method.

Friction coefficients refer to the edge dynamic pressure and are those of a flat plate; on a cone they are
multiplied by ``CONE_LAMINAR`` or ``CONE_TURBULENT``. Perfect air, gamma 1.4.
"""

from __future__ import annotations

import math

from sim.aero.gas import GAMMA, GAS_CONSTANT, PRANDTL, viscosity
from sim.core.compiled import compiled, inlined

__all__ = [
    "CONE_LAMINAR",
    "CONE_TURBULENT",
    "RECOVERY_LAMINAR",
    "RECOVERY_TURBULENT",
    "adiabatic_wall_ratio",
    "capped",
    "edge_state",
    "free_molecular_flux",
    "laminar_friction",
    "reference_temperature_ratio",
    "spalding_chi_factors",
    "spalding_chi_friction",
    "spalding_chi_law",
    "transition_weight",
    "turbulent_reference_friction",
]

RECOVERY_LAMINAR = math.sqrt(PRANDTL)
RECOVERY_TURBULENT = PRANDTL ** (1.0 / 3.0)
CONE_LAMINAR = math.sqrt(3.0)
"""Cone over plate at the same running length (Mangler, 1948)."""
CONE_TURBULENT = 1.176
"""Cone over plate at the same running length, 2.25^0.2: d(r theta)/ds = r cf/2 with cf ~ Re_theta^(-1/4)."""


@inlined
def edge_state(
    pressure_Pa: float, total_pressure_Pa: float, total_temperature_K: float
) -> tuple[float, float, float, float]:
    """Gas at the edge of the boundary layer, expanded isentropically from its total state.

    With the pitot pressure as total pressure the edge gas is the one that crossed the normal part of the bow
    shock ("normal-shock entropy"), which a blunt nose feeds to most of a short body.

    Returns
    -------
    mach, temperature_K, density_kg_m3, speed_m_s : float
    """
    ratio = max(total_pressure_Pa / pressure_Pa, 1.0 + 1e-12) ** ((GAMMA - 1.0) / GAMMA)
    temperature = total_temperature_K / ratio
    mach = math.sqrt(2.0 / (GAMMA - 1.0) * (ratio - 1.0))
    density = pressure_Pa / (GAS_CONSTANT * temperature)
    return mach, temperature, density, mach * math.sqrt(GAMMA * GAS_CONSTANT * temperature)


@compiled
def adiabatic_wall_ratio(mach: float, recovery: float) -> float:
    """Adiabatic-wall over edge temperature, 1 + r (gamma - 1)/2 M^2."""
    return 1.0 + recovery * 0.5 * (GAMMA - 1.0) * mach * mach


@compiled
def reference_temperature_ratio(mach: float, wall_ratio: float, recovery: float) -> float:
    """Reference over edge temperature, T*/Te = (1 + Tw/Te)/2 + 0.22 (Taw/Te - 1).

    Eckert (Journal of the Aeronautical Sciences 22, 1955): his reference enthalpy at constant specific heats.
    """
    return 0.5 * (1.0 + wall_ratio) + 0.22 * (adiabatic_wall_ratio(mach, recovery) - 1.0)


@compiled
def laminar_friction(reynolds: float, mach: float, edge_temperature_K: float, wall_ratio: float) -> float:
    """Local laminar skin friction of a flat plate by the reference-enthalpy method (Eckert, 1955).

    cf = 0.664 sqrt(C*/Re_x), C* = rho* mu* / (rho_e mu_e).
    """
    ratio = reference_temperature_ratio(mach, wall_ratio, RECOVERY_LAMINAR)
    chapman = viscosity(ratio * edge_temperature_K) / (ratio * viscosity(edge_temperature_K))
    return 0.664 * math.sqrt(chapman / reynolds)


@compiled
def turbulent_reference_friction(
    reynolds: float, mach: float, edge_temperature_K: float, wall_ratio: float
) -> float:
    """Local turbulent skin friction of a flat plate by the reference-enthalpy method (Eckert, 1955).

    Schultz-Grunow's incompressible law cf* = 0.370 / log10(Re*)^2.584 with properties at T*.
    """
    ratio = reference_temperature_ratio(mach, wall_ratio, RECOVERY_TURBULENT)
    reference = reynolds * viscosity(edge_temperature_K) / (ratio * viscosity(ratio * edge_temperature_K))
    return float(0.370 / math.log10(max(reference, 100.0)) ** 2.584 / ratio)


@compiled
def spalding_chi_factors(mach: float, wall_ratio: float, recovery: float) -> tuple[float, float]:
    """Coupling parameters F_c and F_Rx that turn compressible friction into an incompressible law.

    F_c = (Taw/Te - 1) / (asin A + asin B)^2 in closed form (Spalding and Chi, Journal of Fluid Mechanics 18,
    1964), F_Rtheta = (Taw/Tw)^0.772 (Tw/Te)^-0.702 (Hopkins and Inouye, NASA TN D-6353 for the form),
    F_Rx = F_Rtheta / F_c.
    """
    adiabatic = adiabatic_wall_ratio(mach, recovery)
    m = adiabatic - 1.0
    if m < 1e-8:
        compression = (0.5 * (1.0 + math.sqrt(wall_ratio))) ** 2
    else:
        a2 = m / wall_ratio
        b = adiabatic / wall_ratio - 1.0
        root = math.sqrt(4.0 * a2 + b * b)
        compression = m / (math.asin((2.0 * a2 - b) / root) + math.asin(b / root)) ** 2
    theta = (adiabatic / wall_ratio) ** 0.772 * wall_ratio**-0.702
    return compression, float(theta / compression)


@compiled
def spalding_chi_friction(reynolds: float, mach: float, wall_ratio: float, recovery: float) -> float:
    """Local turbulent skin friction of a flat plate by the method of Spalding and Chi (1964).

    Explicit form cf F_c = 0.225 / log10(Re_x F_Rx)^2.32 (White and Christoph), within 1 % of the exact law
    :func:`spalding_chi_law` for Re_x F_Rx from 1.6e4 to 2e10.
    """
    compression, stretch = spalding_chi_factors(mach, wall_ratio, recovery)
    return float(0.225 / math.log10(max(reynolds * stretch, 100.0)) ** 2.32 / compression)


@compiled
def spalding_chi_law(friction: float) -> tuple[float, float]:
    """Incompressible universal law: Re_x F_Rx and Re_theta F_Rtheta at which cf F_c has the given value.

    Spalding's law of the wall with von Karman's constant 0.4 and E = 12, integrated in closed form.
    """
    kappa, e = 0.4, 12.0
    u = math.sqrt(2.0 / friction)
    z = kappa * u
    exp = math.exp(z)
    theta_series = (
        (1.0 - 2.0 / z) * exp + 2.0 / z + 1.0 - z**2 / 6.0 - z**3 / 12.0 - z**4 / 40.0 - z**5 / 180.0
    )
    x_series = (6.0 - 4.0 * z + z * z) * exp - 6.0 - 2.0 * z
    x_series -= z**4 / 12.0 + z**5 / 20.0 + z**6 / 60.0 + z**7 / 252.0
    reynolds_theta = u * u / 6.0 + theta_series / (kappa * e)
    reynolds_x = u**4 / 12.0 + x_series / (kappa**3 * e)
    return reynolds_x, reynolds_theta


@compiled
def transition_weight(value: float, onset: float) -> float:
    """Turbulent share of the boundary layer: 0 up to the onset of transition, 1 from twice that value on."""
    x = min(max(value / onset - 1.0, 0.0), 1.0)
    return x * x * (3.0 - 2.0 * x)


@compiled
def free_molecular_flux(sin_inclination: float, mach: float) -> float:
    """Molecules that reach a surface element, over those that reach one facing a fast stream.

    (s + sqrt(s^2 + 1/(pi S^2)))/2 with the speed ratio S = M sqrt(gamma/2): exact at grazing incidence and
    for fast elements on either side, algebraic instead of the error function between (Schaaf and Chambre,
    Flow of Rarefied Gases, 1961, for the exact form). With diffuse reflection and full accommodation the
    shear stress is 2 cos(d) times this (over q1) and the heat flux this times rho V^3/2: the upper bounds
    that rarefaction puts on continuum friction and heating.
    """
    random = 2.0 / (math.pi * GAMMA * mach * mach)
    return 0.5 * (sin_inclination + math.sqrt(sin_inclination * sin_inclination + random))


@compiled
def capped(continuum: float, limit: float) -> float:
    """Smooth minimum of a continuum and a free-molecular value, x y / sqrt(x^2 + y^2)."""
    return continuum * limit / math.sqrt(continuum * continuum + limit * limit + 1e-300)
