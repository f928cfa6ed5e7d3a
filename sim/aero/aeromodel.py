"""A vehicle and its methods turned into plain arrays for the compiled kernels."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.aero.boundary_layer import Layers
from sim.aero.gas import GAMMA
from sim.aero.inviscid import kaufman_limit
from sim.aero.methods import DEFAULT_RESOLUTION, DEFAULT_WALL, Laws, Methods, Resolution, Wall
from sim.aero.pressure import IMPACT_LAWS, WAKE_LAWS, Options
from sim.aero.viscous import CONE_LAMINAR, CONE_TURBULENT
from sim.body.geometry import BodyShape
from sim.body.vehicle import Vehicle
from sim.core.quadrature import apply, dot, gauss_legendre

__all__ = ["AeroModel", "prepare"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


class AeroModel(NamedTuple):
    """Everything :func:`sim.aero.aerodynamics.loads` needs, as arrays and numbers.

    A *ring* is a part of the surface of constant slope: a whole conical segment, or one Gauss point of the
    nose. ``ring_*`` hold its slope, the integrals of r, r x and r^2 over its arc length, and the numbers of
    its pressure laws for slow, low and high Mach numbers. ``film_*`` are the coarser rings of friction and
    heat flux, each with stations ``film_start[i]:film_start[i + 1]`` along it; ``station_*`` hold area per
    radian, position, running length (with its logarithm) and the factors from flat plate to body, the laminar
    one over the square root of the running length.
    """

    reference_area_m2: float
    reference_length_m: float
    cg_m: float
    base_area_m2: float
    damping: float
    options: Options
    layers: Layers
    ring_sin: Floats
    ring_cos: Floats
    ring_area: Floats
    ring_moment: Floats
    ring_laws: Integers
    ring_distance: Floats
    ring_turn: Floats
    cone_sin: float
    cone_cos: float
    full_circle: Floats
    windward_node: Floats
    windward_weight: Floats
    leeward_node: Floats
    leeward_weight: Floats
    film_sin: Floats
    film_cos: Floats
    film_nose: Integers
    film_laws: Integers
    film_distance: Floats
    film_turn: Floats
    film_start: Integers
    station_area: Floats
    station_x: Floats
    station_r: Floats
    station_run: Floats
    station_log_run: Floats
    station_laminar: Floats
    station_turbulent: Floats
    film_full_circle: Floats
    film_windward_node: Floats
    film_windward_weight: Floats
    film_leeward_node: Floats
    film_leeward_weight: Floats


@dataclass(frozen=True)
class _Ring:
    """A strip of the surface: part (0 nose, then cone, cylinder, flare), slope, and quadrature along it."""

    part: int
    angle_rad: float
    x: Floats
    r: Floats
    s: Floats
    arc: Floats


_PARTS = ("nose", "cone", "cylinder", "flare")


def prepare(
    vehicle: Vehicle, methods: Methods, wall: Wall = DEFAULT_WALL, resolution: Resolution = DEFAULT_RESOLUTION
) -> AeroModel:
    """Precompute what depends on the vehicle and on the methods only.

    Parameters
    ----------
    vehicle : Vehicle
        Shape, centre of gravity and references.
    methods : Methods
        Pressure laws, boundary-layer and heating options.
    wall : Wall
        Wall temperature.
    resolution : Resolution
        Number of quadrature points.

    Returns
    -------
    AeroModel
        Named tuple for :func:`sim.aero.aerodynamics.loads`.
    """
    shape = vehicle.shape
    laws = np.array([_law_numbers(regime) for regime in (methods.slow, methods.low, methods.high)]).T
    # Along a conical segment r, r x and r^2 are integrated exactly by two Gauss points.
    # Where it does vary, every station becomes a ring of its own.
    varies = bool(np.any(laws == IMPACT_LAWS.index("entropy_layer")))
    rings = _rings(shape, resolution.nose_rings, resolution.friction_stations if varies else 2, varies)
    films = _rings(shape, resolution.friction_rings, resolution.friction_stations, varies)
    first_angle = shape.nose_angle_rad
    start_m = shape.nose_radius_m * (0.5 * math.pi - first_angle)
    limit_mach, limit_pressure_ratio = kaufman_limit(GAMMA)
    start, end = methods.blend or (methods.switch_mach, methods.switch_mach)
    cp = methods.stagnation_cp
    windward = gauss_legendre(resolution.windward)
    leeward = gauss_legendre(resolution.leeward)
    film_windward = gauss_legendre(resolution.friction_windward)
    film_leeward = gauss_legendre(resolution.friction_leeward)
    on_cone = np.concatenate([np.full(len(f.x), f.part != 2) for f in films])
    run = np.concatenate([film.s for film in films])
    return AeroModel(
        reference_area_m2=float(vehicle.reference_area_m2),
        reference_length_m=float(vehicle.reference_length_m),
        cg_m=float(vehicle.cg_m),
        base_area_m2=float(shape.base_area_m2),
        damping=float(_newtonian_damping(vehicle)),
        options=Options(
            shadow_slow=WAKE_LAWS.index(methods.slow.shadow),
            shadow_low=WAKE_LAWS.index(methods.low.shadow),
            shadow_high=WAKE_LAWS.index(methods.high.shadow),
            base_slow=WAKE_LAWS.index(methods.slow.base),
            base_low=WAKE_LAWS.index(methods.low.base),
            base_high=WAKE_LAWS.index(methods.high.base),
            matching_end=_matching_end(laws, float(end)),
            shadow_ramp=max(float(methods.shadow_ramp), 1e-150),
            blend_start=float(start),
            blend_end=float(end),
            stagnation_cp=0.0 if isinstance(cp, str) else float(cp),
            equilibrium=int(cp == "equilibrium_air"),
            limit_mach=limit_mach,
            limit_pressure_ratio=limit_pressure_ratio,
        ),
        layers=Layers(
            nose_radius_m=float(shape.nose_radius_m),
            conical_edge=int(methods.edge == "conical"),
            transition=("reynolds", "laminar", "turbulent").index(methods.transition),
            transition_reynolds=float(methods.transition_reynolds),
            reference_turbulence=int(methods.turbulence == "reference_enthalpy"),
            stagnation_law=("sutton_graves", "detra_kemp_riddell", "fay_riddell").index(
                methods.stagnation_heating
            ),
            wall_radiative=int(wall.kind != "fixed"),
            wall_K=float(wall.temperature_K),
            emissivity=0.0 if wall.kind == "adiabatic" else float(wall.emissivity),
        ),
        ring_sin=np.array([math.sin(ring.angle_rad) for ring in rings]),
        ring_cos=np.array([math.cos(ring.angle_rad) for ring in rings]),
        ring_area=np.array([dot(ring.arc, ring.r) for ring in rings]),
        ring_moment=np.array(
            [
                dot(
                    ring.arc, ring.r * (ring.x * math.cos(ring.angle_rad) + ring.r * math.sin(ring.angle_rad))
                )
                for ring in rings
            ]
        ),
        ring_laws=np.array([laws[ring.part] for ring in rings]),
        ring_distance=np.array([_distance(ring, start_m, shape) for ring in rings]),
        ring_turn=np.array([ring.angle_rad - first_angle for ring in rings]),
        cone_sin=math.sin(first_angle),
        cone_cos=math.cos(first_angle),
        full_circle=apply(math.cos, math.pi * windward[0]),
        windward_node=windward[0],
        windward_weight=windward[1],
        leeward_node=leeward[0],
        leeward_weight=leeward[1],
        film_sin=np.array([math.sin(film.angle_rad) for film in films]),
        film_cos=np.array([math.cos(film.angle_rad) for film in films]),
        film_nose=np.array([int(film.part == 0) for film in films]),
        film_laws=np.array([laws[film.part] for film in films]),
        film_distance=np.array([_distance(film, start_m, shape) for film in films]),
        film_turn=np.array([film.angle_rad - first_angle for film in films]),
        film_start=np.cumsum([0] + [len(film.x) for film in films]),
        station_area=np.concatenate([film.arc * film.r for film in films]),
        station_x=np.concatenate([film.x for film in films]),
        station_r=np.concatenate([film.r for film in films]),
        station_run=run,
        station_log_run=apply(math.log10, run),
        station_laminar=np.where(on_cone, CONE_LAMINAR, 1.0) / np.sqrt(run),
        station_turbulent=np.where(on_cone, CONE_TURBULENT, 1.0),
        film_full_circle=apply(math.cos, math.pi * film_windward[0]),
        film_windward_node=film_windward[0],
        film_windward_weight=film_windward[1],
        film_leeward_node=film_leeward[0],
        film_leeward_weight=film_leeward[1],
    )


def _matching_end(laws: Integers, blend_end: float) -> float:
    """Highest Mach number at which Kaufman's matching point is needed by (part, slow-low-high) laws."""
    needed = np.any(laws == IMPACT_LAWS.index("newtonian_prandtl_meyer"), axis=0)
    if needed[2]:
        return math.inf
    return blend_end if np.any(needed) else 0.0


def _law_numbers(laws: Laws) -> list[int]:
    return [IMPACT_LAWS.index(getattr(laws, part)) for part in _PARTS]


def _distance(ring: _Ring, start_m: float, shape: BodyShape) -> float:
    """Way behind the spherical nose over its radius; a sharp body has recovered everywhere."""
    if shape.nose_radius_m == 0.0:
        return math.inf
    return max(float(np.mean(ring.s)) - start_m, 0.0) / shape.nose_radius_m


def _rings(shape: BodyShape, nose_rings: int, stations: int, split: bool) -> list[_Ring]:
    """Strips of the surface; ``split`` makes every station of a segment a strip of its own."""
    rings = []
    if shape.nose_radius_m > 0.0:
        radius, end = shape.nose_radius_m, shape.nose_angle_rad
        nodes, weights = gauss_legendre(nose_rings)
        span = 0.5 * math.pi - end
        for slope, weight in zip(end + span * nodes, weights, strict=True):
            rings.append(
                _Ring(
                    part=0,
                    angle_rad=float(slope),
                    x=np.array([radius * (1.0 - math.sin(slope))]),
                    r=np.array([radius * math.cos(slope)]),
                    s=np.array([radius * (0.5 * math.pi - slope)]),
                    arc=np.array([radius * span * weight]),
                )
            )
    nodes, weights = gauss_legendre(stations)
    for part in shape.frusta:
        whole = _Ring(
            part=_PARTS.index(part.kind),
            angle_rad=part.angle_rad,
            x=part.x0_m + (part.x1_m - part.x0_m) * nodes,
            r=part.r0_m + (part.r1_m - part.r0_m) * nodes,
            s=part.s0_m + (part.s1_m - part.s0_m) * nodes,
            arc=(part.s1_m - part.s0_m) * weights,
        )
        for cut in np.arange(stations).reshape(-1, 1) if split else [np.arange(stations)]:
            rings.append(replace(whole, x=whole.x[cut], r=whole.r[cut], s=whole.s[cut], arc=whole.arc[cut]))
    return rings


def _newtonian_damping(vehicle: Vehicle) -> float:
    """Cmq per unit of Cp_max, about the centre of gravity and per q D / V.

    Quasi-steady Newtonian theory at zero incidence: -(2/(S D^2)) times the integral of
    pi r sin(th) cos(th) [(x - xcg) + r tan(th)]^2 over the axis, for every part that faces the stream.
    """
    shape, cg = vehicle.shape, vehicle.cg_m
    end = max(shape.nose_angle_rad, 0.0)
    integral = 0.25 * math.pi * shape.nose_radius_m**2 * math.cos(end) ** 4 * (shape.nose_radius_m - cg) ** 2
    nodes, weights = gauss_legendre(3)
    for part in shape.frusta:
        if part.angle_rad <= 0.0:
            continue
        x = part.x0_m + (part.x1_m - part.x0_m) * nodes
        r = part.r0_m + (part.r1_m - part.r0_m) * nodes
        lever = x - cg + r * math.tan(part.angle_rad)
        factor = math.pi * math.sin(part.angle_rad) * math.cos(part.angle_rad) * (part.x1_m - part.x0_m)
        integral += factor * dot(weights, r * lever**2)
    return -2.0 * integral / (vehicle.reference_area_m2 * vehicle.reference_length_m**2)
