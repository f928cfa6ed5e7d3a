"""A vehicle and its methods turned into plain arrays for the compiled kernels."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.aero.around import Around, around, room
from sim.aero.gas import GAMMA
from sim.aero.methods import PARTS, STAGNATION_LAWS, Methods, Resolution, Wall
from sim.aero.pressure import Options
from sim.aero.pressure_laws.faces import NO_FACE, Face, face_of, rim_shape
from sim.aero.pressure_laws.inviscid import kaufman_limit, nose_trace, recovery
from sim.aero.pressure_laws.laws import PRESSURE_LAWS, PressureLaw
from sim.aero.pressure_laws.meeting import Meeting, meeting
from sim.aero.tables.table import NO_TABLE, LoadsTable
from sim.aero.wall.boundary_layer import Layers
from sim.aero.wall.viscous import CONE_LAMINAR, CONE_TURBULENT
from sim.body.geometry import BodyShape
from sim.body.vehicle import Vehicle
from sim.core.quadrature import apply, dot, gauss_legendre

__all__ = ["AeroModel", "prepare"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

_SHORT_RADII = 3.5


class AeroModel(NamedTuple):
    """Everything :func:`sim.aero.aerodynamics.loads` needs, as arrays and numbers.

    A *ring* is a part of the surface of constant slope: a whole conical segment, or one Gauss point of the
    nose. ``ring_*`` hold its slope, the integrals of r, r x and r^2 over its arc length, and the numbers of
    its pressure laws for slow, low and high Mach numbers. ``film_*`` are the coarser rings of friction and
    heat flux, each with stations ``film_start[i]:film_start[i + 1]`` along it; ``station_*`` hold area per
    radian, position, running length (with its logarithm) and the factors from flat plate to body, the laminar
    one over the square root of the running length. ``source`` and ``film_source`` are work space: pressures
    on the meridians, which rings with the same points share. ``table`` has room for tabulated loads.
    """

    reference_area_m2: float
    reference_length_m: float
    cg_m: float
    base_area_m2: float
    length_m: float
    knudsen_length_m: float
    damping: float
    options: Options
    layers: Layers
    meeting: Meeting
    ring_sin: Floats
    ring_cos: Floats
    ring_area: Floats
    ring_moment: Floats
    ring_laws: Integers
    ring_recovery: Floats
    ring_trace: Floats
    ring_turn: Floats
    ring_rim: Floats
    cone_sin: float
    cone_cos: float
    around: Around
    source: Floats
    film_sin: Floats
    film_cos: Floats
    film_nose: Integers
    film_laws: Integers
    film_recovery: Floats
    film_trace: Floats
    film_turn: Floats
    film_rim: Floats
    film_start: Integers
    station_area: Floats
    station_x: Floats
    station_r: Floats
    station_run: Floats
    station_log_run: Floats
    station_laminar: Floats
    station_turbulent: Floats
    film_around: Around
    film_source: Floats
    table: LoadsTable = NO_TABLE


@dataclass(frozen=True)
class _Ring:
    """A strip of the surface: which of the parts, slope, and quadrature along it."""

    part: int
    angle_rad: float
    x: Floats
    r: Floats
    s: Floats
    arc: Floats


def prepare(
    vehicle: Vehicle,
    methods: Methods,
    wall: Wall | None = None,
    resolution: Resolution | None = None,
) -> AeroModel:
    """Precompute what depends on the vehicle and on the methods only.

    Parameters
    ----------
    vehicle : Vehicle
        Shape, centre of gravity and references.
    methods : Methods
        Pressure laws, boundary-layer and heating options.
    wall : Wall
        Wall temperature; none: that of the methods.
    resolution : Resolution
        Number and places of quadrature points; none: those of the methods.

    Returns
    -------
    AeroModel
        Named tuple for :func:`sim.aero.aerodynamics.loads`.
    """
    shape, resolution = vehicle.shape, resolution or methods.resolution
    regimes = (methods.slow, methods.low, methods.high)
    laws = [[PRESSURE_LAWS[getattr(regime, part)] for part in PARTS] for regime in regimes]
    # Along a conical segment r, r x and r^2 are integrated exactly by two Gauss points.
    # Where the pressure does vary, every station becomes a ring of its own.
    face = face_of(shape) if methods.faces == "subsonic" else NO_FACE
    # a body that is all sphere has none of the overexpansion that a fitted nose law allows for
    if face != NO_FACE and not shape.segments:
        laws = [[PRESSURE_LAWS["modified_newtonian"], *regime[1:]] for regime in laws]
    varies = face.drop > 0.0 or any(law.upstream for regime in laws for law in regime)
    fitted = resolution.quadrature == "fitted"
    few = fitted and varies and face.drop == 0.0
    rings = _rings(
        shape, resolution.nose_rings, resolution.friction_stations if varies else 2, split=varies, few=few
    )
    films = _rings(
        shape,
        resolution.friction_rings,
        resolution.friction_stations,
        split=varies,
        few=few,
        root=fitted,
    )
    numbers = np.array([[law.number for law in regime] for regime in laws]).T
    first_angle = shape.nose_angle_rad
    ramp = max(float(methods.shadow_ramp), 1e-150)
    points = around(resolution.windward, resolution.leeward, fitted, ramp)
    film_points = around(resolution.friction_windward, resolution.friction_leeward, fitted, ramp)
    # A cone's layer is thinner than a plate's, for it spreads; a cylinder's is like a plate's.
    on_cone = np.concatenate([np.full(len(film.x), PARTS[film.part] != "cylinder") for film in films])
    run = np.concatenate([film.s for film in films])
    return AeroModel(
        reference_area_m2=float(vehicle.reference_area_m2),
        reference_length_m=float(vehicle.reference_length_m),
        cg_m=float(vehicle.cg_m),
        base_area_m2=float(shape.base_area_m2),
        length_m=float(shape.length_m),
        knudsen_length_m=2.0 * float(shape.largest_radius_m),
        damping=float(_newtonian_damping(vehicle)),
        options=_options(methods, laws, face, ramp),
        layers=_layers(shape, methods, wall or Wall(methods.wall)),
        meeting=meeting(shape),
        ring_sin=_each(rings, lambda ring: math.sin(ring.angle_rad)),
        ring_cos=_each(rings, lambda ring: math.cos(ring.angle_rad)),
        ring_area=_each(rings, lambda ring: dot(ring.arc, ring.r)),
        ring_moment=_each(rings, _moment),
        ring_laws=np.array([numbers[ring.part] for ring in rings]),
        ring_recovery=_each(rings, lambda ring: recovery(_distance(ring, shape), math.sin(first_angle))),
        ring_trace=_each(rings, lambda ring: nose_trace(_distance(ring, shape))),
        ring_turn=_each(rings, lambda ring: ring.angle_rad - first_angle),
        ring_rim=_each(rings, lambda ring: _rim(ring, shape, face)),
        cone_sin=math.sin(first_angle),
        cone_cos=math.cos(first_angle),
        around=points,
        source=np.empty(2 * room(points)),
        film_sin=_each(films, lambda film: math.sin(film.angle_rad)),
        film_cos=_each(films, lambda film: math.cos(film.angle_rad)),
        film_nose=np.array([int(PARTS[film.part] == "nose") for film in films]),
        film_laws=np.array([numbers[film.part] for film in films]),
        film_recovery=_each(films, lambda film: recovery(_distance(film, shape), math.sin(first_angle))),
        film_trace=_each(films, lambda film: nose_trace(_distance(film, shape))),
        film_turn=_each(films, lambda film: film.angle_rad - first_angle),
        film_rim=_each(films, lambda film: _rim(film, shape, face)),
        film_start=np.cumsum([0] + [len(film.x) for film in films]),
        station_area=np.concatenate([film.arc * film.r for film in films]),
        station_x=np.concatenate([film.x for film in films]),
        station_r=np.concatenate([film.r for film in films]),
        station_run=run,
        station_log_run=apply(math.log10, run),
        station_laminar=np.where(on_cone, CONE_LAMINAR, 1.0) / np.sqrt(run),
        station_turbulent=np.where(on_cone, CONE_TURBULENT, 1.0),
        film_around=film_points,
        film_source=np.empty(2 * room(film_points)),
    )


def _options(methods: Methods, laws: list[list[PressureLaw]], face: Face, ramp: float) -> Options:
    """Options of the pressure laws, given those of (slow-low-high, part)."""
    start, end = methods.blend or (methods.switch_mach, methods.switch_mach)
    limit_mach, limit_pressure_ratio = kaufman_limit(GAMMA)
    cp = methods.stagnation_cp
    return Options(
        shadow_slow=PRESSURE_LAWS[methods.slow.shadow].number,
        shadow_low=PRESSURE_LAWS[methods.low.shadow].number,
        shadow_high=PRESSURE_LAWS[methods.high.shadow].number,
        base_slow=PRESSURE_LAWS[methods.slow.base].number,
        base_low=PRESSURE_LAWS[methods.low.base].number,
        base_high=PRESSURE_LAWS[methods.high.base].number,
        matching_end=_needed_end(laws, float(end), "matching_point"),
        cones_end=_needed_end(laws, float(end), "cone_curve"),
        upstream_end=_needed_end(laws, float(end), "upstream"),
        shadow_ramp=ramp,
        blend_start=float(start),
        blend_end=float(end),
        stagnation_cp=0.0 if isinstance(cp, str) else float(cp),
        equilibrium=STAGNATION_LAWS.index(cp) if isinstance(cp, str) else 0,
        face=face,
        limit_mach=limit_mach,
        limit_pressure_ratio=limit_pressure_ratio,
    )


def _layers(shape: BodyShape, methods: Methods, wall: Wall) -> Layers:
    """Options of the boundary layer."""
    stagnation_laws = ("sutton_graves", "detra_kemp_riddell", "fay_riddell")
    return Layers(
        nose_radius_m=float(meeting(shape).nose_m) if shape.nose_radius_m > 0.0 else 0.0,
        conical_edge=int(methods.edge == "conical"),
        transition=("reynolds", "laminar", "turbulent").index(methods.transition),
        transition_reynolds=float(methods.transition_reynolds),
        reference_turbulence=int(methods.turbulence == "reference_enthalpy"),
        stagnation_law=stagnation_laws.index(methods.stagnation_heating),
        wall_radiative=int(wall.kind != "fixed"),
        wall_K=float(wall.temperature_K),
        emissivity=0.0 if wall.kind == "adiabatic" else float(wall.emissivity),
    )


def _needed_end(laws: list[list[PressureLaw]], blend_end: float, need: str) -> float:
    """Highest Mach number at which any of the (slow-low-high, part) laws has this need; 0 where none has."""
    slow, low, high = (any(getattr(law, need) for law in regime) for regime in laws)
    if high:
        return math.inf
    return blend_end if slow or low else 0.0


def _each(rings: list[_Ring], number: Callable[[_Ring], float]) -> Floats:
    return np.array([number(ring) for ring in rings])


def _moment(ring: _Ring) -> float:
    """Integral of r (x cos + r sin) along a ring: the lever of the pressure about the nose tip."""
    return dot(ring.arc, ring.r * (ring.x * math.cos(ring.angle_rad) + ring.r * math.sin(ring.angle_rad)))


def _distance(ring: _Ring, shape: BodyShape) -> float:
    """Way behind the spherical nose over its radius; a sharp body has recovered everywhere."""
    if shape.nose_radius_m == 0.0:
        return math.inf
    start_m = shape.nose_radius_m * (0.5 * math.pi - shape.nose_angle_rad)
    return max(float(np.mean(ring.s)) - start_m, 0.0) / shape.nose_radius_m


def _rim(ring: _Ring, shape: BodyShape, face: Face) -> float:
    """Where on the blunt face a ring lies; -1 when it is not on one."""
    on_nose = PARTS[ring.part] == "nose"
    on_face = face != NO_FACE and (on_nose or ring.angle_rad == shape.nose_angle_rad)
    return rim_shape(float(np.mean(ring.r)), shape.largest_radius_m) if on_face else -1.0


def _rings(
    shape: BodyShape, nose_rings: int, stations: int, *, split: bool, few: bool, root: bool = False
) -> list[_Ring]:
    """Strips of the surface; ``split`` makes every station of a segment a strip of its own.

    ``few`` spares one station where a segment is so short that the pressure falls by little along it (the
    nose's decays over 2.8 of its radii); ``root`` spaces the stations in the root of the running length, in
    which laminar friction is a polynomial.
    """
    rings = []
    if shape.nose_radius_m > 0.0:
        radius, end = shape.nose_radius_m, shape.nose_angle_rad
        nodes, weights = gauss_legendre(nose_rings)
        span = 0.5 * math.pi - end
        for slope, weight in zip(end + span * nodes, weights, strict=True):
            rings.append(
                _Ring(
                    part=PARTS.index("nose"),
                    angle_rad=float(slope),
                    x=np.array([radius * (1.0 - math.sin(slope))]),
                    r=np.array([radius * math.cos(slope)]),
                    s=np.array([radius * (0.5 * math.pi - slope)]),
                    arc=np.array([radius * span * weight]),
                )
            )
    for part in shape.frusta:
        short = few and part.s1_m - part.s0_m <= _SHORT_RADII * shape.nose_radius_m
        nodes, weights = gauss_legendre(max(stations - 1, 1) if short else stations)
        if root:
            start, end = math.sqrt(part.s0_m), math.sqrt(part.s1_m)
            along = start + (end - start) * nodes
            nodes = (along**2 - part.s0_m) / (part.s1_m - part.s0_m)
            weights = weights * 2.0 * along / (start + end)
        whole = _Ring(
            part=PARTS.index(part.kind),
            angle_rad=part.angle_rad,
            x=part.x0_m + (part.x1_m - part.x0_m) * nodes,
            r=part.r0_m + (part.r1_m - part.r0_m) * nodes,
            s=part.s0_m + (part.s1_m - part.s0_m) * nodes,
            arc=(part.s1_m - part.s0_m) * weights,
        )
        for cut in np.arange(nodes.size).reshape(-1, 1) if split else [np.arange(nodes.size)]:
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
