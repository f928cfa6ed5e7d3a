"""Free-molecular forces and heating of a whole body: the laws of ``rarefied``, integrated."""

from __future__ import annotations

import math
from typing import NamedTuple

from sim.aero.aeromodel import AeroModel
from sim.aero.thin_air.rarefied import (
    Molecules,
    free_molecular_heat,
    free_molecular_pressure,
    free_molecular_shear,
    free_molecular_wall,
)
from sim.aero.wall.boundary_layer import Layers
from sim.core.compiled import compiled, kernel
from sim.core.machine_code import Reference

__all__ = ["MolecularLoads", "molecular_loads", "shadow_line"]


class MolecularLoads(NamedTuple):
    """Forces (m2) and moments (m3, nose-down about the nose) over q1, heat (W); base pressure apart."""

    axial: float
    normal: float
    moment: float
    shear_axial: float
    shear_normal: float
    shear_moment: float
    heat: float
    inflow: float
    base_cp: float


@compiled
def shadow_line(a: float, b: float) -> float:
    """Meridian angle, from the windward side, at which sin d = a + b cos(phi) changes sign (b >= 0)."""
    if a >= b:
        return math.pi
    if a <= -b:
        return 0.0
    return math.acos(-a / b)


@compiled
def _wall(sin_inclination: float, layers: Layers, stream: Molecules) -> float:
    if layers.wall_radiative:
        return free_molecular_wall(sin_inclination, layers.emissivity, stream)
    return layers.wall_K


@kernel
def molecular_loads(
    at: Reference[AeroModel], sin_alpha: float, cos_alpha: float, stream: Molecules
) -> MolecularLoads:
    """Integrate pressure, shear and heat flux of free molecules over the rings of friction.

    Both sides of the shadow line are lit by the molecules' own motion; no element shields another, which is
    exact for convex bodies.
    """
    model = at[0]
    axial = normal = moment = shear_axial = shear_normal = shear_moment = heat = inflow = 0.0
    windward = model.film_around.windward_node.size
    for i in range(model.film_sin.size):
        a, b = cos_alpha * model.film_sin[i], sin_alpha * model.film_cos[i]
        border = shadow_line(a, b)
        rest = math.pi - border
        area = area_x = area_r = 0.0
        for station in range(model.film_start[i], model.film_start[i + 1]):
            area += model.station_area[station]
            area_x += model.station_area[station] * model.station_x[station]
            area_r += model.station_area[station] * model.station_r[station]
        for j in range(windward + model.film_around.leeward_node.size):
            if j < windward:
                phi = border * model.film_around.windward_node[j]
                share = 2.0 * border * model.film_around.windward_weight[j]
            else:
                phi = border + rest * model.film_around.leeward_node[j - windward]
                share = 2.0 * rest * model.film_around.leeward_weight[j - windward]
            cos_phi = math.cos(phi)
            s = a + b * cos_phi
            wall = _wall(s, model.layers, stream)
            cp = share * free_molecular_pressure(s, wall, stream)
            axial += cp * model.film_sin[i] * area
            normal += cp * model.film_cos[i] * cos_phi * area
            moment += cp * cos_phi * (model.film_cos[i] * area_x + model.film_sin[i] * area_r)
            cos_d = math.sqrt(max(1.0 - s * s, 1e-12))
            shear = share * free_molecular_shear(s, stream)
            aft = shear * (cos_alpha - s * model.film_sin[i]) / cos_d
            away = shear * (sin_alpha - s * model.film_cos[i] * cos_phi) / cos_d
            shear_axial += aft * area
            shear_normal += away * area
            shear_moment += away * area_x + aft * cos_phi * area_r
            flux = share * free_molecular_heat(s, wall, stream) * area
            heat += flux
            inflow += max(flux, 0.0)
    base_wall = _wall(-cos_alpha, model.layers, stream)
    away = free_molecular_shear(-cos_alpha, stream) * model.base_area_m2
    shear_normal += away
    shear_moment += away * model.length_m
    flux = free_molecular_heat(-cos_alpha, base_wall, stream) * model.base_area_m2
    return MolecularLoads(
        axial,
        normal,
        moment,
        shear_axial,
        shear_normal,
        shear_moment,
        heat + flux,
        inflow + max(flux, 0.0),
        free_molecular_pressure(-cos_alpha, base_wall, stream),
    )
