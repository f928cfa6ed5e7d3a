"""Forces, moment and heating of the whole vehicle: which law where, integrated over the surface.

:func:`prepare` turns a vehicle and a choice of methods into an :class:`AeroModel`, a named tuple of plain
arrays; the compiled :func:`loads` evaluates it at one flight condition without allocating, and
:func:`surface_elements` gives pressure, friction and heat flux panel by panel. From Python use
:func:`sim.aero.coefficients.coefficients` and :func:`sim.aero.coefficients.surface`.

Indices of the array that ``loads`` fills (all per the vehicle's reference area and length):

==================== =======================================================================
CA                   axial force, positive aft, with base pressure and skin friction
CN                   normal force, positive away from the windward side
CM_NOSE              pitching moment about the nose tip, positive nose-up (< 0 when stable)
XCP_M                centre of pressure aft of the nose tip, m (its limit at zero incidence)
CMQ                  pitch damping about the centre of gravity, per q D / V
STAGNATION_HEAT_FLUX heat flux where the stream meets the body head-on (nose, side or base), W/m2
SURFACE_HEAT_RATE    heat flux integrated over the surface, W; the base counts when it faces the stream
CA_FRICTION          the skin-friction part of CA
CN_FRICTION          the skin-friction part of CN
CA_BASE              the base-pressure part of CA
SURFACE_HEAT_INFLOW  the surface heat rate of those elements alone that take heat in, W
ROLL_DAMPING         roll damping, per p b / V; an axisymmetric surface has none
YAW_DAMPING          yaw damping about the centre of gravity, per r b / V
==================== =======================================================================
"""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from sim.aero.aeromodel import AeroModel, prepare
from sim.aero.around import chosen, meridian
from sim.aero.gas import GAMMA, pitot_pressure_ratio
from sim.aero.pressure import base_pressure, flow, pressure_in, surface_pressure
from sim.aero.pressure_laws.laws import UPSTREAM, Flow, Place, source_pressure
from sim.aero.pressure_laws.meeting import meeting_radius_m
from sim.aero.thin_air.molecular_loads import molecular_loads, shadow_line
from sim.aero.thin_air.rarefied import knudsen_number, molecules, rarefaction
from sim.aero.wall.boundary_layer import (
    Layers,
    Station,
    Stream,
    balanced_wall,
    bounds,
    edge,
    element_fluxes,
    film,
    radiating_nose,
    stagnation_heat_flux,
    strip_fluxes,
    strip_wall,
)
from sim.aero.wall.heating import lees_sphere
from sim.aero.wall.viscous import capped
from sim.core.compiled import MACHINE_CODE, compiled, inlined, kernel
from sim.core.machine_code import Reference, reference

__all__ = [
    "CA",
    "CA_BASE",
    "CA_FRICTION",
    "CMQ",
    "CM_NOSE",
    "CN",
    "CN_FRICTION",
    "N_LOADS",
    "ROLL_DAMPING",
    "STAGNATION_HEAT_FLUX",
    "SURFACE_HEAT_INFLOW",
    "SURFACE_HEAT_RATE",
    "XCP_M",
    "YAW_DAMPING",
    "AeroModel",
    "inviscid_loads",
    "loads",
    "loads_address",
    "loads_at",
    "prepare",
    "surface_elements",
]

Floats = NDArray[np.float64]

CA = 0
CN = 1
CM_NOSE = 2
XCP_M = 3
CMQ = 4
STAGNATION_HEAT_FLUX = 5
SURFACE_HEAT_RATE = 6
CA_FRICTION = 7
CN_FRICTION = 8
CA_BASE = 9
SURFACE_HEAT_INFLOW = 10
ROLL_DAMPING = 11
YAW_DAMPING = 12
N_LOADS = 13

# This close to 0 and 180 deg CN and CM are linear in the incidence; the centre of pressure keeps its limit.
_SMALL_ANGLE = 1e-4
# Laws over Mach number have no value at rest, where their forces vanish with the dynamic pressure anyway.
_REST = 1e-3


@compiled
def free_stream(speed_m_s: float, mach: float, p_Pa: float, rho_kg_m3: float, T_K: float) -> Stream:
    """Free stream with its total temperature and pitot pressure."""
    total_K = T_K * (1.0 + 0.5 * (GAMMA - 1.0) * mach * mach)
    return Stream(speed_m_s, mach, p_Pa, rho_kg_m3, T_K, total_K, p_Pa * pitot_pressure_ratio(mach, GAMMA))


@kernel
def inviscid_loads(model: AeroModel, mach: float, alpha_rad: float, out: Floats) -> None:
    """Pressure alone: fills CA, CN, CM_NOSE, XCP_M, CMQ and CA_BASE of ``out``, zeros elsewhere."""
    alpha = min(max(alpha_rad, _SMALL_ANGLE), math.pi - _SMALL_ANGLE)
    linear = math.sin(alpha_rad) / math.sin(alpha)
    stream = flow(mach, 0.0, 1.0, model.options)
    axial, normal, moment = _pressure_sums(reference(model), math.sin(alpha), math.cos(alpha), stream)
    area, length = model.reference_area_m2, model.reference_length_m
    out[:] = 0.0
    out[CA_BASE] = (
        -base_pressure(-math.cos(alpha), stream, model.options.shadow_ramp) * model.base_area_m2 / area
    )
    out[CA] = axial / area + out[CA_BASE]
    out[CN] = linear * normal / area
    out[CM_NOSE] = -linear * moment / (area * length)
    out[XCP_M] = moment / normal
    out[CMQ] = out[YAW_DAMPING] = model.damping * stream.k


@kernel
def loads(
    model: AeroModel,
    speed_m_s: float,
    mach: float,
    alpha_rad: float,
    p_Pa: float,
    rho_kg_m3: float,
    T_K: float,
    out: Floats,
) -> None:
    """Aerodynamic loads at one flight condition.

    Parameters
    ----------
    model : AeroModel
        From :func:`prepare`.
    speed_m_s, mach : float
        Speed relative to the air and its Mach number.
    alpha_rad : float
        Total angle of attack, 0 to pi.
    p_Pa, rho_kg_m3, T_K : float
        Free-stream pressure, density and temperature.
    out : ndarray, shape (N_LOADS,)
        Filled; the indices are constants of this module.
    """
    loads_at(reference(model), speed_m_s, mach, alpha_rad, p_Pa, rho_kg_m3, T_K, reference(out))


@kernel
def loads_at(
    at: Reference[AeroModel],
    speed_m_s: float,
    mach: float,
    alpha_rad: float,
    p_Pa: float,
    rho_kg_m3: float,
    T_K: float,
    place: Reference[Floats],
) -> None:
    """Fill the array in its `place` as :func:`loads` does; everything of size is handed over by reference."""
    model, out = at[0], place[0]
    mach, speed_m_s = max(mach, _REST), max(speed_m_s, _REST)
    alpha = min(max(alpha_rad, _SMALL_ANGLE), math.pi - _SMALL_ANGLE)
    linear = math.sin(alpha_rad) / math.sin(alpha)
    sin_alpha, cos_alpha = math.sin(alpha), math.cos(alpha)
    stream = flow(mach, speed_m_s, rho_kg_m3, model.options)
    axial, normal, moment = _pressure_sums(at, sin_alpha, cos_alpha, stream)
    base = base_pressure(-cos_alpha, stream, model.options.shadow_ramp)
    air = free_stream(speed_m_s, mach, p_Pa, rho_kg_m3, T_K)
    friction_axial, friction_normal, friction_moment, heat, inflow = _film_sums(
        at, sin_alpha, cos_alpha, stream, air
    )
    if cos_alpha < 0.0:
        flux = _flux_into(model.layers, air, model.meeting.base_m, -cos_alpha) * model.base_area_m2
        heat += flux
        inflow += max(flux, 0.0)
    area, length = model.reference_area_m2, model.reference_length_m
    dynamic = max(0.5 * rho_kg_m3 * speed_m_s**2, 1e-300)
    thin = rarefaction(knudsen_number(p_Pa, rho_kg_m3, T_K, model.knudsen_length_m))
    if thin > 0.0:
        free = molecular_loads(at, sin_alpha, cos_alpha, molecules(speed_m_s, p_Pa, rho_kg_m3, T_K))
        axial += thin * (free.axial - axial)
        normal += thin * (free.normal - normal)
        moment += thin * (free.moment - moment)
        base += thin * (free.base_cp - base)
        friction_axial += thin * (dynamic * free.shear_axial - friction_axial)
        friction_normal += thin * (dynamic * free.shear_normal - friction_normal)
        friction_moment += thin * (dynamic * free.shear_moment - friction_moment)
        heat += thin * (free.heat - heat)
        inflow += thin * (free.inflow - inflow)
    out[CA_BASE] = -base * model.base_area_m2 / area
    out[CA_FRICTION] = friction_axial / (dynamic * area)
    out[CN_FRICTION] = linear * friction_normal / (dynamic * area)
    out[CA] = axial / area + out[CA_FRICTION] + out[CA_BASE]
    out[CN] = linear * normal / area + out[CN_FRICTION]
    out[CM_NOSE] = -linear * (moment + friction_moment / dynamic) / (area * length)
    out[XCP_M] = (moment * dynamic + friction_moment) / (normal * dynamic + friction_normal)
    out[CMQ] = out[YAW_DAMPING] = model.damping * stream.k
    out[ROLL_DAMPING] = 0.0
    out[STAGNATION_HEAT_FLUX] = _flux_into(model.layers, air, meeting_radius_m(alpha, model.meeting), 1.0)
    out[SURFACE_HEAT_RATE] = heat
    out[SURFACE_HEAT_INFLOW] = inflow


@compiled
def _flux_into(layers: Layers, air: Stream, radius_m: float, share: float) -> float:
    """`share` of the heat flux where the stream meets a surface of this radius, within its limit, W/m2."""
    limit = 0.5 * air.density_kg_m3 * air.speed_m_s**3 * share
    if layers.wall_radiative and layers.emissivity == 0.0:
        return 0.0
    wall = layers.wall_K
    if layers.wall_radiative:
        wall = radiating_nose(share, air, layers, radius_m)
    return capped(share * stagnation_heat_flux(layers.stagnation_law, air, radius_m, wall), limit)


def loads_address(model: AeroModel) -> int:
    """Address of the machine code of :func:`loads_at` for models of this kind."""
    numbers: Any = numba
    number, pointer = numbers.float64, numbers.types.CPointer
    kinds = (pointer(numbers.typeof(model)), *[number] * 6, pointer(number[::1]))
    return MACHINE_CODE.entry(loads_at, *kinds, _nrt=False)


@kernel
def _pressure_sums(
    at: Reference[AeroModel], sin_alpha: float, cos_alpha: float, stream: Flow
) -> tuple[float, float, float]:
    """Axial force, normal force (over q1, m2) and nose-down moment about the nose (m3) of the pressure."""
    model = at[0]
    axial = normal = moment = 0.0
    ramp, points = model.options.shadow_ramp, model.around
    source_a, source_b = cos_alpha * model.cone_sin, sin_alpha * model.cone_cos
    known, known_lit, known_border = model.source, -1, -1.0
    in_stream = reference(stream)
    for i in range(model.ring_sin.size):
        first, second = model.ring_laws[i, stream.first], model.ring_laws[i, stream.second]
        upstream = first == UPSTREAM or second == UPSTREAM
        recovery, trace = model.ring_recovery[i], model.ring_trace[i]
        turn, rim = model.ring_turn[i], model.ring_rim[i]
        a = cos_alpha * model.ring_sin[i]
        b = sin_alpha * model.ring_cos[i]
        border = shadow_line(a, b)
        lit, lee, rule = chosen(a, b, border, points)
        around = across = 0.0  # integrals of Cp and of Cp cos(phi) over half the circle
        place_of = 0
        if upstream:
            place_of, known_lit, known_border = _meridians_known(known, border, lit, known_lit, known_border)
        for j in range(lit + lee):
            cos_phi, share = meridian(j, lit, rule, border, points)
            source, source_cp = source_a + source_b * cos_phi, -1.0
            if upstream:
                if known[place_of + j] < 0.0:
                    known[place_of + j] = source_pressure(source, stream)
                source_cp = known[place_of + j]
            place = Place(source, recovery, trace, turn, rim, source_cp)
            cp = share * pressure_in(first, second, a + b * cos_phi, place, in_stream, ramp)
            around += cp
            across += cp * cos_phi
        axial += 2.0 * around * model.ring_sin[i] * model.ring_area[i]
        normal += 2.0 * across * model.ring_cos[i] * model.ring_area[i]
        moment += 2.0 * across * model.ring_moment[i]
    return axial, normal, moment


@inlined
def _meridians_known(
    known: Floats, border: float, lit: int, known_lit: int, known_border: float
) -> tuple[int, int, float]:
    """Where this ring's points lie in the work space, emptied if it is not theirs; whose it is now.

    One half is for rings that are lit all around, the other for those with a shadow line.
    """
    half = known.size // 2
    if border == math.pi:
        if lit != known_lit:
            for j in range(half):
                known[j] = -1.0
        return 0, lit, known_border
    if border != known_border:
        for j in range(half, known.size):
            known[j] = -1.0
    return half, known_lit, border


@kernel
def _film_sums(
    at: Reference[AeroModel], sin_alpha: float, cos_alpha: float, stream: Flow, air: Stream
) -> tuple[float, float, float, float, float]:
    """Axial and normal force (N), nose-down moment (N m) of the skin friction, heat rate and inflow (W)."""
    model = at[0]
    axial = normal = moment = heat = inflow = 0.0
    ramp, layers = model.options.shadow_ramp, model.layers
    stagnation = stagnation_heat_flux(layers.stagnation_law, air, layers.nose_radius_m, layers.wall_K)
    neighbour, conductance = layers.wall_K, 0.0
    if layers.wall_radiative:
        neighbour = 0.25 * air.total_K
    if layers.wall_radiative and layers.nose_radius_m > 0.0:
        # the flux falls linearly with the wall's temperature (Fay and Riddell's nearly so)
        cold = stagnation_heat_flux(layers.stagnation_law, air, layers.nose_radius_m, neighbour)
        conductance = cold / (air.total_K - neighbour)
        for _ in range(4):
            neighbour = balanced_wall(neighbour, conductance, air.total_K, layers)
    points = model.film_around
    source_a, source_b = cos_alpha * model.cone_sin, sin_alpha * model.cone_cos
    run, log_run = model.station_run, model.station_log_run
    laminar, turbulent = model.station_laminar, model.station_turbulent
    known, known_lit, known_border = model.film_source, -1, -1.0
    in_stream = reference(stream)
    settled = False
    for i in range(model.film_sin.size):
        first, second = model.film_laws[i, stream.first], model.film_laws[i, stream.second]
        upstream = first == UPSTREAM or second == UPSTREAM
        recovery, trace = model.film_recovery[i], model.film_trace[i]
        turn, rim = model.film_turn[i], model.film_rim[i]
        start, end = model.film_start[i], model.film_start[i + 1]
        shortest, longest, half = run[start], run[end - 1], (start + end) // 2
        middle = Station(run[half], log_run[half], laminar[half], turbulent[half])
        a = cos_alpha * model.film_sin[i]
        b = sin_alpha * model.film_cos[i]
        border = shadow_line(a, b)
        lit, lee, rule = chosen(a, b, border, points)
        before = neighbour
        place_of = 0
        if upstream:
            place_of, known_lit, known_border = _meridians_known(known, border, lit, known_lit, known_border)
        for j in range(lit + lee):
            cos_phi, half_share = meridian(j, lit, rule, border, points)
            share = 2.0 * half_share
            if share == 0.0:
                continue
            s = a + b * cos_phi
            source, source_cp = source_a + source_b * cos_phi, -1.0
            if upstream:
                if known[place_of + j] < 0.0:
                    known[place_of + j] = source_pressure(source, stream)
                source_cp = known[place_of + j]
            place = Place(source, recovery, trace, turn, rim, source_cp)
            cp = pressure_in(first, second, s, place, in_stream, ramp)
            outer = edge(cp, s, layers.conical_edge, air)
            nose_share = lees_sphere(math.acos(max(s, 0.0)), air.mach, GAMMA) if model.film_nose[i] else 0.0
            wall, steps = layers.wall_K, 0
            if layers.wall_radiative:
                if nose_share > 0.0:
                    wall = neighbour = balanced_wall(neighbour, nose_share * conductance, air.total_K, layers)
                    stagnation = conductance * (air.total_K - wall)
                else:
                    # equal meridians of a body at no incidence must have equal walls: all start alike
                    wall, steps = before, 1 if settled else 2
            while True:  # a loop, for the film is compiled into it
                layer = film(outer, wall, shortest, longest, layers)
                if steps == 0:
                    break
                before = wall
                wall = strip_wall(wall, layer, outer, middle, layers)
                if j == 0:
                    neighbour, settled = wall, True
                steps -= 1
            limits = bounds(s, air)
            force = force_x = force_r = 0.0
            for station in range(start, end):
                shear, flux = strip_fluxes(
                    nose_share,
                    stagnation,
                    wall,
                    outer,
                    layer,
                    Station(run[station], log_run[station], laminar[station], turbulent[station]),
                    limits,
                    layers,
                    1 if end - start == 1 else 2,
                )
                area = share * model.station_area[station]
                force += shear * area
                force_x += shear * area * model.station_x[station]
                force_r += shear * area * model.station_r[station]
                heat += flux * area
                inflow += max(flux, 0.0) * area
            # direction of the stream along the surface: aft, and away from the windward side
            cos_d = math.sqrt(max(1.0 - s * s, 1e-12))
            aft = (cos_alpha - s * model.film_sin[i]) / cos_d
            away = (sin_alpha - s * model.film_cos[i] * cos_phi) / cos_d
            axial += force * aft
            normal += force * away
            moment += force_x * away + force_r * cos_phi * aft
    return axial, normal, moment, heat, inflow


@kernel
def surface_elements(
    model: AeroModel,
    speed_m_s: float,
    mach: float,
    alpha_rad: float,
    p_Pa: float,
    rho_kg_m3: float,
    T_K: float,
    phi_rad: Floats,
    out: Floats,
) -> None:
    """Pressure coefficient, shear stress, heat flux and wall temperature of every surface element.

    Parameters
    ----------
    phi_rad : ndarray, shape (m,)
        Meridian angles, 0 on the windward side.
    out : ndarray, shape (4, stations, m)
        Filled, one row for every station of ``model`` (see :func:`sim.aero.aeromodel.prepare`).
    """
    stream = flow(mach, speed_m_s, rho_kg_m3, model.options)
    layers = model.layers
    air = free_stream(speed_m_s, mach, p_Pa, rho_kg_m3, T_K)
    stagnation = stagnation_heat_flux(layers.stagnation_law, air, layers.nose_radius_m, layers.wall_K)
    run, log_run = model.station_run, model.station_log_run
    laminar, turbulent = model.station_laminar, model.station_turbulent
    for i in range(model.film_sin.size):
        first, second = model.film_laws[i, stream.first], model.film_laws[i, stream.second]
        start, end = model.film_start[i], model.film_start[i + 1]
        shortest, longest = run[start], run[end - 1]
        for j in range(phi_rad.size):
            lift = math.sin(alpha_rad) * math.cos(phi_rad[j])
            s = math.cos(alpha_rad) * model.film_sin[i] + lift * model.film_cos[i]
            source = math.cos(alpha_rad) * model.cone_sin + lift * model.cone_cos
            place = Place(
                source,
                model.film_recovery[i],
                model.film_trace[i],
                model.film_turn[i],
                model.film_rim[i],
                -1.0,
            )
            cp = surface_pressure(first, second, s, place, stream, model.options.shadow_ramp)
            outer = edge(cp, s, layers.conical_edge, air)
            layer = film(outer, layers.wall_K, shortest, longest, layers)
            limits = bounds(s, air)
            nose_share = lees_sphere(math.acos(max(s, 0.0)), air.mach, GAMMA) if model.film_nose[i] else 0.0
            for station in range(start, end):
                out[0, station, j] = cp
                out[1, station, j], out[2, station, j], out[3, station, j] = element_fluxes(
                    nose_share,
                    stagnation,
                    air,
                    outer,
                    layer,
                    Station(run[station], log_run[station], laminar[station], turbulent[station]),
                    limits,
                    layers,
                )
