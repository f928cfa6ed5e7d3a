"""Equations of motion of a rigid body: 13 states in inertial axes, and the time integrals of the responses.

State vector (``STATES`` numbers):

====== ============================================================================================
0-2    position, m, inertial axes (Earth-fixed at t = 0)
3-5    velocity, m/s, inertial axes
6-9    attitude quaternion, inertial to body, scalar first; normalised wherever it is used
10-12  body rates p, q, r relative to inertial space, rad/s
13-17  integrals over time since the start: CA (s), stagnation heat flux (J/m2), heat flux over the
       surface (J), static margin (s; counted negative base first), absolute static margin (s)
18-20  likewise CD (s), and what flows into the wall, without what it gives back: at the stagnation point
       (J/m2), over the surface (J)
====== ============================================================================================

    r' = v          v' = g(r) + C^T F/m          Q' = 1/2 Q (0, w)          I w' = M - w x I w

with F and M the aerodynamic force and moment in body axes, C the rotation from inertial to body axes and I
the diagonal tensor of inertia (e.g. Stevens & Lewis, Aircraft Control and Simulation, ch. 1). The integrals
are states like the others, so they carry the accuracy of the integrator; the last three ride along: made of
the same loads as those before them, they need no steps of their own.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numba
import numpy as np

from sim.aero.aerodynamics import (
    CA,
    CM_NOSE,
    CMQ,
    CN,
    N_LOADS,
    ROLL_DAMPING,
    STAGNATION_HEAT_FLUX,
    SURFACE_HEAT_INFLOW,
    SURFACE_HEAT_RATE,
    XCP_M,
    YAW_DAMPING,
    AeroModel,
)
from sim.aero.given_coefficients import CoefficientModel
from sim.aero.pressure_laws.inviscid import smooth_step
from sim.air.atmosphere import AirModel, Floats, air
from sim.air.wind import Wind, wind_ned
from sim.core.compiled import MACHINE_CODE, compiled, kernel, part
from sim.core.machine_code import Reference, call, reference
from sim.flight.earth import Earth, from_ned, geodetic, gravity

__all__ = ["BodyModel", "Flight", "derivatives", "derivatives_address", "derivatives_at"]

STATES = 21
CONTROLLED = 18
"""States whose error chooses the step."""
AXIAL_INTEGRAL, STAGNATION_HEAT, SURFACE_HEAT, MARGIN_INTEGRAL, ABS_MARGIN_INTEGRAL = range(13, 18)
DRAG_INTEGRAL, STAGNATION_INFLOW, SURFACE_INFLOW = range(18, 21)

_NOSE_FIRST_END = math.radians(85.0)

# What `conditions` leaves in its scratch array.
CONDITIONS = 15
(
    ALTITUDE, LATITUDE, LONGITUDE, DENSITY, PRESSURE, TEMPERATURE, SOUND_SPEED, AIRSPEED, U, V, W, ALPHA,
    DYNAMIC_PRESSURE, MACH, STATIC_MARGIN,
) = range(CONDITIONS)  # fmt: skip


class BodyModel(NamedTuple):
    """Mass, principal moments of inertia, reference quantities and centre of gravity (aft of the nose)."""

    mass_kg: float
    ixx_kg_m2: float
    iyy_kg_m2: float
    izz_kg_m2: float
    reference_area_m2: float
    reference_length_m: float
    span_m: float
    cg_m: float


class Flight(NamedTuple):
    """Everything the right-hand side needs; either the surface model or the coefficients supply the loads.

    ``surface_loads``, ``coefficient_loads`` and ``rates`` are addresses of machine code: of the two models,
    0 for the one that is not used, and of :func:`derivatives_at`.
    """

    earth: Earth
    air: AirModel
    wind: Wind
    body: BodyModel
    surface: AeroModel
    coefficients: CoefficientModel
    surface_loads: int
    coefficient_loads: int
    rates: int = 0


_SURFACE, _COEFFICIENTS = Flight._fields.index("surface"), Flight._fields.index("coefficients")


class Scratch(NamedTuple):
    """Work space of one evaluation, so that nothing is allocated per step."""

    conditions: Floats
    loads: Floats
    rotation: Floats


def new_scratch() -> Scratch:
    """Allocate the work space, once per flight."""
    return Scratch(np.zeros(CONDITIONS), np.zeros(N_LOADS), np.zeros((3, 3)))


@kernel
def rotation_from_quaternion(y: Floats, rotation: Floats) -> None:
    """Fill the rotation matrix, inertial to body axes, from the quaternion in `y[6:10]` of any norm."""
    a, b, c, d = y[6], y[7], y[8], y[9]
    s = 2.0 / (a * a + b * b + c * c + d * d)
    rotation[0, 0] = 1.0 - s * (c * c + d * d)
    rotation[0, 1] = s * (b * c + a * d)
    rotation[0, 2] = s * (b * d - a * c)
    rotation[1, 0] = s * (b * c - a * d)
    rotation[1, 1] = 1.0 - s * (b * b + d * d)
    rotation[1, 2] = s * (c * d + a * b)
    rotation[2, 0] = s * (b * d + a * c)
    rotation[2, 1] = s * (c * d - a * b)
    rotation[2, 2] = 1.0 - s * (b * b + c * c)


@compiled
def static_margin(centre_of_pressure_m: float, body: BodyModel) -> float:
    """(Xcp - Xcg) over the reference length, within +-10.

    The centre of pressure runs to infinity where the normal force vanishes without the moment, as in flight
    base first; some calibres away its place means nothing, so there the margin levels off smoothly. One below
    1 is changed by less than 3e-5 of itself, one of 0.25 by 1e-7.
    """
    margin = (centre_of_pressure_m - body.cg_m) / body.reference_length_m
    square = (margin / 10.0) ** 2
    return margin / math.sqrt(math.sqrt(1.0 + square * square))


@compiled
def nose_first_margin(margin: float, alpha_rad: float) -> float:
    """Static margin, counted negative base first, whatever its sign: the body is to fly the other way round.

    It passes from the one to the other between 85 and 95 deg of incidence.
    """
    if alpha_rad <= _NOSE_FIRST_END:
        return margin
    turned = smooth_step(alpha_rad, _NOSE_FIRST_END, math.pi - _NOSE_FIRST_END)
    return margin - turned * (margin + abs(margin))


@kernel
def conditions(at: Reference[Flight], y: Floats, scratch: Scratch) -> None:
    """Fill `scratch` with place, air, airspeed, angle of attack and aerodynamic loads of a state."""
    flight = at[0]
    out, rotation = scratch.conditions, scratch.rotation
    earth = flight.earth
    latitude, longitude, height = geodetic(earth, y[0], y[1], y[2])
    density, pressure, temperature, sound = air(flight.air, height)

    # Velocity relative to the air: the atmosphere turns with the planet, the wind moves within it.
    vx = y[3] + earth.rotation_rad_s * y[1]
    vy = y[4] - earth.rotation_rad_s * y[0]
    vz = y[5]
    if flight.wind.breaks_m.size > 0:
        north, east, down = wind_ned(flight.wind, height)
        wx, wy, wz = from_ned(earth, latitude, longitude, north, east, down)
        vx, vy, vz = vx - wx, vy - wy, vz - wz

    rotation_from_quaternion(y, rotation)
    u = rotation[0, 0] * vx + rotation[0, 1] * vy + rotation[0, 2] * vz
    v = rotation[1, 0] * vx + rotation[1, 1] * vy + rotation[1, 2] * vz
    w = rotation[2, 0] * vx + rotation[2, 1] * vy + rotation[2, 2] * vz
    speed = math.sqrt(u * u + v * v + w * w)
    mach = speed / sound
    alpha = math.atan2(math.sqrt(v * v + w * w), u)

    out[ALTITUDE], out[LATITUDE], out[LONGITUDE] = height, latitude, longitude
    out[DENSITY], out[PRESSURE], out[TEMPERATURE], out[SOUND_SPEED] = density, pressure, temperature, sound
    out[AIRSPEED], out[U], out[V], out[W], out[ALPHA], out[MACH] = speed, u, v, w, alpha, mach
    out[DYNAMIC_PRESSURE] = 0.5 * density * speed * speed
    if flight.surface_loads:
        surface, out_loads = part(at, _SURFACE), reference(scratch.loads)
        call(
            flight.surface_loads,
            (surface, speed, mach, alpha, pressure, density, temperature, out_loads),
        )
    else:
        coefficients, out_loads = part(at, _COEFFICIENTS), reference(scratch.loads)
        call(flight.coefficient_loads, (coefficients, speed, mach, alpha, density, out_loads))
    out[STATIC_MARGIN] = static_margin(scratch.loads[XCP_M], flight.body)


@kernel
def derivatives(flight: Flight, y: Floats, dy: Floats, scratch: Scratch) -> None:
    """Fill `dy` with the time derivative of the state `y`."""
    at = reference(flight)
    call(flight.rates, (at, reference(y), reference(dy), reference(scratch)))


def derivatives_address(flight: Flight) -> int:
    """Address of the machine code of :func:`derivatives_at` for flights of this kind."""
    numbers: Any = numba
    pointer, floats = numbers.types.CPointer, numbers.float64[::1]
    kinds = [numbers.typeof(flight), floats, floats, numbers.typeof(new_scratch())]
    return MACHINE_CODE.entry(derivatives_at, *map(pointer, kinds), _nrt=False)


@kernel
def derivatives_at(
    at: Reference[Flight], state: Reference[Floats], rates: Reference[Floats], work: Reference[Scratch]
) -> None:
    """Fill the array of `rates` as :func:`derivatives` does, with everything handed over by reference."""
    flight, y, dy, scratch = at[0], state[0], rates[0], work[0]
    conditions(at, y, scratch)
    out, load, rotation, body = scratch.conditions, scratch.loads, scratch.rotation, flight.body

    force = out[DYNAMIC_PRESSURE] * body.reference_area_m2
    across = math.sqrt(out[V] ** 2 + out[W] ** 2)
    v_part, w_part = (out[V] / across, out[W] / across) if across > 0.0 else (0.0, 0.0)
    pitch_coefficient = load[CM_NOSE] + load[CN] * body.cg_m / body.reference_length_m

    p, q, r = y[10], y[11], y[12]
    spin = flight.earth.rotation_rad_s
    p_rel = p - rotation[0, 2] * spin
    q_rel = q - rotation[1, 2] * spin
    r_rel = r - rotation[2, 2] * spin
    damping = 0.5 * out[DENSITY] * out[AIRSPEED] * body.reference_area_m2  # q S / V
    moment = force * body.reference_length_m * pitch_coefficient
    roll_moment = damping * body.span_m**2 * load[ROLL_DAMPING] * p_rel
    pitch_moment = moment * w_part + damping * body.reference_length_m**2 * load[CMQ] * q_rel
    yaw_moment = -moment * v_part + damping * body.span_m**2 * load[YAW_DAMPING] * r_rel

    fx = -force * load[CA] / body.mass_kg
    fy = -force * load[CN] * v_part / body.mass_kg
    fz = -force * load[CN] * w_part / body.mass_kg
    gx, gy, gz = gravity(flight.earth, y[0], y[1], y[2])
    dy[0], dy[1], dy[2] = y[3], y[4], y[5]
    dy[3] = gx + rotation[0, 0] * fx + rotation[1, 0] * fy + rotation[2, 0] * fz
    dy[4] = gy + rotation[0, 1] * fx + rotation[1, 1] * fy + rotation[2, 1] * fz
    dy[5] = gz + rotation[0, 2] * fx + rotation[1, 2] * fy + rotation[2, 2] * fz

    dy[6] = 0.5 * (-y[7] * p - y[8] * q - y[9] * r)
    dy[7] = 0.5 * (y[6] * p - y[9] * q + y[8] * r)
    dy[8] = 0.5 * (y[9] * p + y[6] * q - y[7] * r)
    dy[9] = 0.5 * (-y[8] * p + y[7] * q + y[6] * r)

    dy[10] = (roll_moment + (body.iyy_kg_m2 - body.izz_kg_m2) * q * r) / body.ixx_kg_m2
    dy[11] = (pitch_moment + (body.izz_kg_m2 - body.ixx_kg_m2) * p * r) / body.iyy_kg_m2
    dy[12] = (yaw_moment + (body.ixx_kg_m2 - body.iyy_kg_m2) * p * q) / body.izz_kg_m2

    dy[AXIAL_INTEGRAL] = load[CA]
    dy[STAGNATION_HEAT] = load[STAGNATION_HEAT_FLUX]
    dy[SURFACE_HEAT] = load[SURFACE_HEAT_RATE]
    dy[MARGIN_INTEGRAL] = nose_first_margin(out[STATIC_MARGIN], out[ALPHA])
    dy[ABS_MARGIN_INTEGRAL] = abs(out[STATIC_MARGIN])
    dy[DRAG_INTEGRAL] = load[CA] * math.cos(out[ALPHA]) + load[CN] * math.sin(out[ALPHA])
    dy[STAGNATION_INFLOW] = max(load[STAGNATION_HEAT_FLUX], 0.0)
    dy[SURFACE_INFLOW] = load[SURFACE_HEAT_INFLOW]
