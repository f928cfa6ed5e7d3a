"""Shear stress and heat flux of a surface element, from the laws of ``viscous`` and ``heating``.

A :class:`Film` is the boundary layer of one inclination at one wall temperature; :func:`film_fluxes`
evaluates it at one running length.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sim.aero.gas import (
    GAMMA,
    HEAT_CAPACITY,
    PRANDTL,
    normal_shock_total_pressure_ratio,
    total_pressure_ratio,
    viscosity,
)
from sim.aero.wall.heating import (
    STEFAN_BOLTZMANN,
    detra_kemp_riddell,
    fay_riddell,
    radiative_equilibrium,
    sutton_graves,
)
from sim.aero.wall.viscous import (
    RECOVERY_LAMINAR,
    RECOVERY_TURBULENT,
    capped,
    edge_state,
    free_molecular_flux,
    reference_temperature_ratio,
    spalding_chi_factors,
    transition_weight,
)
from sim.core.compiled import compiled, inlined

__all__ = [
    "Bounds",
    "Edge",
    "Film",
    "Layers",
    "Station",
    "Stream",
    "balanced_wall",
    "bounds",
    "conical_total_pressure",
    "edge",
    "element_fluxes",
    "film",
    "film_fluxes",
    "radiating_nose",
    "stagnation_heat_flux",
    "strip_fluxes",
    "strip_wall",
    "turbulent_share",
]

_COLBURN = PRANDTL ** (-2.0 / 3.0)
_LEE_SHARE = 0.3
_LEE_RAMP = 0.05


class Layers(NamedTuple):
    """Options of the boundary layer, by number where they choose a law: see :class:`.methods.Methods`."""

    conical_edge: int
    transition: int
    transition_reynolds: float
    reference_turbulence: int
    stagnation_law: int
    nose_radius_m: float
    wall_radiative: int
    wall_K: float
    emissivity: float
    """Of a radiative wall; 0 leaves it adiabatic."""


class Stream(NamedTuple):
    """Free stream in physical units."""

    speed_m_s: float
    mach: float
    pressure_Pa: float
    density_kg_m3: float
    temperature_K: float
    total_K: float
    pitot_Pa: float


class Edge(NamedTuple):
    """Gas at the edge of the boundary layer."""

    mach: float
    temperature_K: float
    density_kg_m3: float
    speed_m_s: float
    viscosity_Pa_s: float


class Film(NamedTuple):
    """Boundary layer over a wall of given temperature, without the running length."""

    laminar: float
    """Laminar shear stress of a flat plate times the square root of the running length."""
    turbulent: float
    """Turbulent shear stress of a flat plate is this over (log_scale + log10(running length))^power."""
    log_scale: float
    power: float
    unit_reynolds: float
    adiabatic_laminar_K: float
    adiabatic_turbulent_K: float


class Bounds(NamedTuple):
    """Free-molecular limits of shear stress and heat flux; the share that separation leaves of both."""

    shear_Pa: float
    heat_W_m2: float
    attached: float


class Station(NamedTuple):
    """Place along the body: running length, its logarithm, and the factors of :class:`AeroModel`."""

    run_m: float
    log_run: float
    laminar: float
    turbulent: float


@compiled
def conical_total_pressure(sin_inclination: float, stream: Stream) -> float:
    """Total pressure behind the shock of the local tangent cone, Pa (shock angle of Hammitt and Murthy)."""
    s = min(max(sin_inclination, 1e-3), 0.7)
    m2 = stream.mach * stream.mach
    h2 = (GAMMA - 1.0) * s * s + 2.0 / m2
    h1 = 2.0 - (GAMMA + 5.0) * s * s
    sin_2d = 2.0 * s * math.sqrt(1.0 - s * s)
    root = math.sqrt(max(1.0 + h1 * h2 / (sin_2d * sin_2d), 0.0))
    shock_angle = math.asin(s) + h2 / (sin_2d * (1.0 + root))
    normal_mach = stream.mach * math.sin(min(shock_angle, 0.5 * math.pi))
    loss = normal_shock_total_pressure_ratio(max(normal_mach, 1.0), GAMMA)
    return stream.pressure_Pa * total_pressure_ratio(stream.mach, GAMMA) * loss


@inlined
def edge(cp: float, sin_inclination: float, conical: int, stream: Stream) -> Edge:
    """Edge of the boundary layer under a pressure coefficient (at least 0.2 of the free-stream pressure)."""
    dynamic = 0.5 * stream.density_kg_m3 * stream.speed_m_s**2
    pressure = max(stream.pressure_Pa + dynamic * cp, 0.2 * stream.pressure_Pa)
    total = conical_total_pressure(sin_inclination, stream) if conical else stream.pitot_Pa
    mach, temperature, density, speed = edge_state(pressure, total, stream.total_K)
    return Edge(mach, temperature, density, speed, viscosity(temperature))


@inlined
def turbulent_share(unit_reynolds: float, run_m: float, layers: Layers) -> float:
    """Share of the turbulent boundary layer at a running length, by the chosen criterion."""
    if layers.transition == 0:
        return transition_weight(unit_reynolds * run_m, layers.transition_reynolds)
    return 1.0 if layers.transition == 2 else 0.0


@inlined
def film(outer: Edge, wall_K: float, shortest_run_m: float, longest_run_m: float, layers: Layers) -> Film:
    """Laminar film by reference enthalpy; turbulent by Spalding-Chi or by reference enthalpy.

    Only what occurs between the two running lengths is evaluated; the rest is zero.
    """
    te = outer.temperature_K
    wall_ratio = wall_K / te
    heating = 0.5 * (GAMMA - 1.0) * outer.mach * outer.mach
    momentum = outer.density_kg_m3 * outer.speed_m_s
    unit_reynolds = momentum / outer.viscosity_Pa_s
    laminar = turbulent = power = 0.0
    log_scale = 2.0
    if turbulent_share(unit_reynolds, shortest_run_m, layers) < 1.0:
        ratio = reference_temperature_ratio(outer.mach, wall_ratio, RECOVERY_LAMINAR)
        laminar = 0.332 * math.sqrt(viscosity(ratio * te) / ratio * momentum) * outer.speed_m_s
    if turbulent_share(unit_reynolds, longest_run_m, layers) > 0.0:
        dynamic = 0.5 * momentum * outer.speed_m_s
        if layers.reference_turbulence:
            ratio = reference_temperature_ratio(outer.mach, wall_ratio, RECOVERY_TURBULENT)
            stretch = outer.viscosity_Pa_s / (ratio * viscosity(ratio * te))
            turbulent, power = 0.370 * dynamic / ratio, 2.584
        else:
            compression, stretch = spalding_chi_factors(outer.mach, wall_ratio, RECOVERY_TURBULENT)
            turbulent, power = 0.225 * dynamic / compression, 2.32
        log_scale = math.log10(unit_reynolds * stretch)
    return Film(
        laminar,
        turbulent,
        log_scale,
        power,
        unit_reynolds,
        te * (1.0 + RECOVERY_LAMINAR * heating),
        te * (1.0 + RECOVERY_TURBULENT * heating),
    )


@inlined
def film_fluxes(layer: Film, outer: Edge, station: Station, layers: Layers) -> tuple[float, float, float]:
    """Shear stress, heat conductance and adiabatic-wall temperature at one station.

    Returns
    -------
    shear_Pa, conductance_W_m2_K, adiabatic_wall_K : float
        The heat flux is the conductance times the adiabatic-wall temperature less the wall's.
    """
    weight = turbulent_share(layer.unit_reynolds, station.run_m, layers)
    shear = (1.0 - weight) * layer.laminar * station.laminar
    adiabatic = layer.adiabatic_laminar_K
    if weight > 0.0:
        # a Reynolds number below 100 only occurs when the layer is declared turbulent everywhere
        turbulent = weight * station.turbulent * layer.turbulent
        turbulent *= max(layer.log_scale + station.log_run, 2.0) ** -layer.power
        shear += turbulent
        adiabatic += turbulent / (shear + 1e-300) * (layer.adiabatic_turbulent_K - adiabatic)
    return shear, shear / (outer.speed_m_s + 1e-12) * _COLBURN * HEAT_CAPACITY, adiabatic


@compiled
def stagnation_heat_flux(law: int, stream: Stream, nose_radius_m: float, wall_K: float) -> float:
    """Heat flux at the stagnation point by the chosen correlation, W/m2; infinite on a sharp nose."""
    density, speed, temperature = stream.density_kg_m3, stream.speed_m_s, stream.temperature_K
    if law == 1:
        return detra_kemp_riddell(density, speed, nose_radius_m, temperature, wall_K)
    if law == 2:
        return fay_riddell(density, speed, nose_radius_m, temperature, wall_K)
    return sutton_graves(density, speed, nose_radius_m, temperature, wall_K)


@compiled
def radiating_nose(share: float, stream: Stream, layers: Layers, radius_m: float) -> float:
    """Radiative-equilibrium temperature at ``share`` of the flux into a sphere of this radius, K."""
    if layers.emissivity == 0.0:
        return stream.total_K
    wall = new = min(1000.0, 0.5 * stream.total_K)
    for _ in range(30):
        flux = share * stagnation_heat_flux(layers.stagnation_law, stream, radius_m, wall)
        new = radiative_equilibrium(flux / (stream.total_K - wall), stream.total_K, layers.emissivity)
        if abs(new - wall) < 1e-9 * wall:
            break
        wall = new
    return new


@compiled
def radiating_element(
    nose_share: float, stream: Stream, outer: Edge, station: Station, layers: Layers
) -> tuple[float, float, float]:
    """Shear stress, heat flux and wall temperature of an element whose wall is in radiative equilibrium."""
    if nose_share > 0.0:
        wall = radiating_nose(nose_share, stream, layers, layers.nose_radius_m)
        layer = film(outer, wall, station.run_m, station.run_m, layers)
        flux = 0.0
        if layers.emissivity > 0.0:
            flux = stagnation_heat_flux(layers.stagnation_law, stream, layers.nose_radius_m, wall)
        return film_fluxes(layer, outer, station, layers)[0], nose_share * flux, wall
    wall = layers.wall_K
    shear = conductance = adiabatic = 0.0
    for _ in range(30):
        layer = film(outer, wall, station.run_m, station.run_m, layers)
        shear, conductance, adiabatic = film_fluxes(layer, outer, station, layers)
        before = wall
        wall = adiabatic
        if layers.emissivity > 0.0:
            wall = radiative_equilibrium(conductance, adiabatic, layers.emissivity)
        if abs(wall - before) < 1e-9 * wall:
            break
    return shear, conductance * (adiabatic - wall), wall


@inlined
def balanced_wall(
    start_K: float, conductance: float, adiabatic_K: float, layers: Layers, steps: int = 2
) -> float:
    """Wall temperature in radiative equilibrium, K: two steps of Halley's method from a neighbour's.

    Cubic convergence leaves 1e-6 of the temperature from 30 % away, and always the same two steps make a
    smooth function; a tolerance would make it jump. One step does from 1 % away.
    """
    if layers.emissivity == 0.0:
        return adiabatic_K
    radiation = layers.emissivity * STEFAN_BOLTZMANN
    wall = start_K
    for _ in range(steps):
        cube = radiation * wall * wall * wall
        excess = cube * wall + conductance * (wall - adiabatic_K)
        slope = 4.0 * cube + conductance
        bend = 12.0 * radiation * wall * wall
        wall -= 2.0 * excess * slope / (2.0 * slope * slope - excess * bend)
    return wall


@inlined
def strip_wall(start_K: float, layer: Film, outer: Edge, middle: Station, layers: Layers) -> float:
    """Wall temperature in radiative equilibrium at the middle station of a strip of constant inclination, K.

    The friction law feels the wall's temperature weakly: a step of the fixed-point iteration leaves some -5 %
    of the error, and one step that allows for it, from a neighbour's temperature, about 0.2 %. ``layer`` is
    the film over the start.
    """
    _, conductance, adiabatic = film_fluxes(layer, outer, middle, layers)
    return start_K + (balanced_wall(start_K, conductance, adiabatic, layers) - start_K) / 1.05


@inlined
def strip_fluxes(
    nose_share: float,
    stagnation_flux: float,
    wall_K: float,
    outer: Edge,
    layer: Film,
    station: Station,
    limits: Bounds,
    layers: Layers,
    steps: int,
) -> tuple[float, float]:
    """Shear stress (Pa) and heat flux (W/m2) of one element of a strip, whose film is that over `wall_K`.

    On the spherical nose the heat flux is ``nose_share`` of the stagnation point's (Lees) with this wall;
    elsewhere that share is 0 and the flux follows from friction, with a radiating wall's own temperature.
    """
    shear, conductance, adiabatic = film_fluxes(layer, outer, station, layers)
    if nose_share > 0.0:
        flux = nose_share * stagnation_flux
    elif layers.wall_radiative:
        flux = conductance * (adiabatic - balanced_wall(wall_K, conductance, adiabatic, layers, steps))
    else:
        flux = conductance * (adiabatic - wall_K)
    return limits.attached * capped(shear, limits.shear_Pa), limits.attached * capped(flux, limits.heat_W_m2)


@inlined
def bounds(sin_inclination: float, stream: Stream) -> Bounds:
    """Free-molecular limits of an inclination, and what separation leaves of friction and heating.

    In the separated flow of the shadow both fall to 0.3 of the attached boundary layer's: an engineering
    guess.
    """
    s = sin_inclination
    momentum = free_molecular_flux(s, stream.mach) * stream.density_kg_m3 * stream.speed_m_s**2
    attached = 1.0
    if s < 0.0:
        attached -= (1.0 - _LEE_SHARE) * s * s / (s * s + _LEE_RAMP * _LEE_RAMP)
    return Bounds(math.sqrt(max(1.0 - s * s, 1e-12)) * momentum, 0.5 * momentum * stream.speed_m_s, attached)


@inlined
def element_fluxes(
    nose_share: float,
    stagnation_flux: float,
    stream: Stream,
    outer: Edge,
    layer: Film,
    station: Station,
    limits: Bounds,
    layers: Layers,
) -> tuple[float, float, float]:
    """Shear stress (Pa), heat flux (W/m2) and wall temperature (K) of one surface element.

    On the spherical nose the heat flux is ``nose_share`` of the stagnation point's (Lees); elsewhere that
    share is 0 and the flux follows from friction.

    Parameters
    ----------
    stagnation_flux : float
        At the fixed wall temperature; with a radiating wall it is evaluated afresh.
    outer, layer : Edge, Film
        The edge, and the film at the fixed wall temperature.
    """
    if layers.wall_radiative:
        shear, flux, wall = radiating_element(nose_share, stream, outer, station, layers)
    else:
        wall = layers.wall_K
        shear, conductance, adiabatic = film_fluxes(layer, outer, station, layers)
        flux = nose_share * stagnation_flux if nose_share > 0.0 else conductance * (adiabatic - wall)
    return (
        limits.attached * capped(shear, limits.shear_Pa),
        limits.attached * capped(flux, limits.heat_W_m2),
        wall,
    )
