"""What a flight's history shows: every column with its unit, from the states and the stored loads."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from sim.aero.aerodynamics import (
    CA,
    CM_NOSE,
    CN,
    STAGNATION_HEAT_FLUX,
    SURFACE_HEAT_INFLOW,
    SURFACE_HEAT_RATE,
)
from sim.air.atmosphere import GRAVITY, Floats
from sim.flight.dynamics import (
    ABS_MARGIN_INTEGRAL,
    AIRSPEED,
    ALPHA,
    ALTITUDE,
    AXIAL_INTEGRAL,
    DENSITY,
    DRAG_INTEGRAL,
    DYNAMIC_PRESSURE,
    LATITUDE,
    LONGITUDE,
    MACH,
    MARGIN_INTEGRAL,
    PRESSURE,
    STAGNATION_HEAT,
    STAGNATION_INFLOW,
    STATIC_MARGIN,
    SURFACE_HEAT,
    SURFACE_INFLOW,
    TEMPERATURE,
    BodyModel,
    Flight,
    U,
    V,
    W,
)

__all__ = ["COLUMNS", "READ_OFF", "Column", "Rows", "flight_columns"]

_LEVEL = 1e-9  # level part of a direction below which rounding decides where it points
_STEEP = 1e-6


class Column(NamedTuple):
    """Unit and meaning of one array of a history."""

    unit: str
    meaning: str


COLUMNS: dict[str, Column] = {
    "time_s": Column("s", "time since the start"),
    "altitude_m": Column("m", "geodetic height"),
    "latitude_deg": Column("deg", "geodetic latitude"),
    "longitude_deg": Column("deg", "Earth-fixed longitude"),
    "speed_m_s": Column("m/s", "speed relative to the (rotating) Earth"),
    "path_angle_deg": Column("deg", "flight-path angle, negative descending"),
    "heading_deg": Column("deg", "direction of the velocity, clockwise from north; 0 straight up or down"),
    "velocity_north_m_s": Column("m/s", "Earth-relative velocity, north"),
    "velocity_east_m_s": Column("m/s", "Earth-relative velocity, east"),
    "velocity_down_m_s": Column("m/s", "Earth-relative velocity, down"),
    "inertial_speed_m_s": Column("m/s", "speed in inertial space"),
    "inertial_path_angle_deg": Column("deg", "angle of the inertial velocity above the horizon"),
    "airspeed_m_s": Column("m/s", "speed relative to the air"),
    "mach": Column("-", "airspeed over speed of sound"),
    "dynamic_pressure_Pa": Column("Pa", "dynamic pressure"),
    "density_kg_m3": Column("kg/m3", "density of the air"),
    "pressure_Pa": Column("Pa", "pressure of the air"),
    "temperature_K": Column("K", "temperature of the air"),
    "alpha_deg": Column("deg", "angle of attack, atan(w/u)"),
    "beta_deg": Column("deg", "sideslip angle, asin(v/V)"),
    "total_alpha_deg": Column("deg", "angle between the body axis and the airflow"),
    "yaw_deg": Column("deg", "body yaw from north; straight up or down that of the wings, with roll 0"),
    "pitch_deg": Column("deg", "body pitch above the horizon"),
    "roll_deg": Column("deg", "body roll"),
    "roll_rate_deg_s": Column("deg/s", "p, relative to inertial space, body axes"),
    "pitch_rate_deg_s": Column("deg/s", "q, likewise"),
    "yaw_rate_deg_s": Column("deg/s", "r, likewise"),
    "quaternion_0": Column("-", "attitude quaternion, inertial to body: scalar part"),
    "quaternion_1": Column("-", "x part"),
    "quaternion_2": Column("-", "y part"),
    "quaternion_3": Column("-", "z part"),
    "CA": Column("-", "axial-force coefficient, positive aft: negative when the air strikes the base"),
    "CN": Column("-", "normal-force coefficient"),
    "CD": Column("-", "drag coefficient, against the air-relative velocity: never negative"),
    "Cm": Column("-", "pitching-moment coefficient about the centre of gravity, nose-up positive"),
    "static_margin": Column("-", "(Xcp - Xcg) over the reference length, > 0 stable; levels off at +-10"),
    "stagnation_heat_flux_W_m2": Column(
        "W/m2", "heat flux where the air strikes the body head-on (nose, side or base); < 0 out of the wall"
    ),
    "surface_heat_rate_W": Column("W", "heat flux integrated over the surface; < 0 out of the wall"),
    "surface_heat_inflow_W": Column("W", "the same over what takes heat in"),
    "load_factor_g": Column("g0", "aerodynamic force over mass, in 9.80665 m/s2"),
    "axial_integral_s": Column("s", "time integral of CA since the start"),
    "drag_integral_s": Column("s", "time integral of CD since the start"),
    "stagnation_heat_load_J_m2": Column("J/m2", "time integral of the stagnation heat flux, both signs"),
    "stagnation_heat_inflow_J_m2": Column("J/m2", "time integral of the stagnation heat flux while > 0"),
    "surface_heat_J": Column("J", "time integral of the surface heat rate, both signs"),
    "surface_heat_inflow_J": Column("J", "time integral of the surface heat inflow"),
    "margin_integral_s": Column("s", "time integral of the static margin, counted negative base first"),
    "absolute_margin_integral_s": Column("s", "time integral of the absolute static margin"),
    "downrange_m": Column("m", "along the ground, in the initial heading"),
    "crossrange_m": Column("m", "along the ground, to the right of the initial heading"),
}


class Rows(NamedTuple):
    """States (n, 21) of a flight with conditions and loads, these turned: a row for each of their numbers."""

    states: Floats
    conditions: Floats
    loads: Floats
    body: BodyModel


READ_OFF: dict[str, Callable[[Rows], Floats]] = {
    "altitude_m": lambda at: at.conditions[ALTITUDE],
    "latitude_deg": lambda at: np.degrees(at.conditions[LATITUDE]),
    "airspeed_m_s": lambda at: at.conditions[AIRSPEED],
    "mach": lambda at: at.conditions[MACH],
    "dynamic_pressure_Pa": lambda at: at.conditions[DYNAMIC_PRESSURE],
    "density_kg_m3": lambda at: at.conditions[DENSITY],
    "pressure_Pa": lambda at: at.conditions[PRESSURE],
    "temperature_K": lambda at: at.conditions[TEMPERATURE],
    "alpha_deg": lambda at: np.degrees(np.arctan2(at.conditions[W], at.conditions[U])),
    "beta_deg": lambda at: np.degrees(
        np.arctan2(at.conditions[V], np.hypot(at.conditions[U], at.conditions[W]))
    ),
    "total_alpha_deg": lambda at: np.degrees(at.conditions[ALPHA]),
    "roll_rate_deg_s": lambda at: np.degrees(at.states[:, 10]),
    "pitch_rate_deg_s": lambda at: np.degrees(at.states[:, 11]),
    "yaw_rate_deg_s": lambda at: np.degrees(at.states[:, 12]),
    "quaternion_0": lambda at: at.states[:, 6],
    "quaternion_1": lambda at: at.states[:, 7],
    "quaternion_2": lambda at: at.states[:, 8],
    "quaternion_3": lambda at: at.states[:, 9],
    "CA": lambda at: at.loads[CA],
    "CN": lambda at: at.loads[CN],
    "CD": lambda at: (
        at.loads[CA] * np.cos(at.conditions[ALPHA]) + at.loads[CN] * np.sin(at.conditions[ALPHA])
    ),
    "Cm": lambda at: at.loads[CM_NOSE] + at.loads[CN] * at.body.cg_m / at.body.reference_length_m,
    "static_margin": lambda at: at.conditions[STATIC_MARGIN],
    "stagnation_heat_flux_W_m2": lambda at: at.loads[STAGNATION_HEAT_FLUX],
    "surface_heat_rate_W": lambda at: at.loads[SURFACE_HEAT_RATE],
    "surface_heat_inflow_W": lambda at: at.loads[SURFACE_HEAT_INFLOW],
    "load_factor_g": lambda at: (
        at.conditions[DYNAMIC_PRESSURE]
        * at.body.reference_area_m2
        * np.hypot(at.loads[CA], at.loads[CN])
        / (at.body.mass_kg * GRAVITY)
    ),
    "axial_integral_s": lambda at: at.states[:, AXIAL_INTEGRAL],
    "drag_integral_s": lambda at: at.states[:, DRAG_INTEGRAL],
    "stagnation_heat_load_J_m2": lambda at: at.states[:, STAGNATION_HEAT],
    "stagnation_heat_inflow_J_m2": lambda at: at.states[:, STAGNATION_INFLOW],
    "surface_heat_J": lambda at: at.states[:, SURFACE_HEAT],
    "surface_heat_inflow_J": lambda at: at.states[:, SURFACE_INFLOW],
    "margin_integral_s": lambda at: at.states[:, MARGIN_INTEGRAL],
    "absolute_margin_integral_s": lambda at: at.states[:, ABS_MARGIN_INTEGRAL],
}
"""Columns that states, conditions and loads hold as they are: to read one off needs none of the others."""


def flight_columns(
    flight: Flight, time_s: Floats, states: Floats, conditions: Floats, loads: Floats, start: Floats
) -> dict[str, Floats]:
    """Every column of ``COLUMNS``, for states (n, 21) with their conditions and loads.

    `start` is the first state of the flight, from which the ranges are counted.
    """
    rows = Rows(states, conditions.T, loads.T, flight.body)
    found = {
        "time_s": time_s,
        **{name: read(rows) for name, read in READ_OFF.items()},
        **_worked_out(flight, time_s, rows, start),
    }
    read_only = {name: found[name].view() for name in COLUMNS}
    for column in read_only.values():
        column.setflags(write=False)
    return read_only


def _worked_out(flight: Flight, time_s: Floats, rows: Rows, start: Floats) -> dict[str, Floats]:
    """Columns of motion over the ground and of attitude, which share local axes and rotations."""
    states, c = rows.states, rows.conditions
    place, velocity = _earth_fixed(states, flight.earth.rotation_rad_s * time_s, flight.earth.rotation_rad_s)
    flat = np.isinf(flight.earth.radius_m)
    longitude = np.zeros_like(time_s) if flat else np.arctan2(place[:, 1], place[:, 0])
    north, east, down = _local_axes(c[LATITUDE], longitude, flat)
    v_north, v_east, v_down = (np.einsum("ij,ij->i", velocity, axis) for axis in (north, east, down))
    along = np.hypot(v_north, v_east)
    # Rows of the rotation to body axes are the body axes; compare them with local axes of the inertial frame.
    inertial_axes = _local_axes(c[LATITUDE], c[LONGITUDE], flat)
    inertial_down = np.einsum("ij,ij->i", states[:, 3:6], inertial_axes[2])
    inertial_speed = np.linalg.norm(states[:, 3:6], axis=1)
    forward, right, below = np.moveaxis(_rotations(states[:, 6:10]), 1, 0)
    f_north, f_east, f_down = (np.einsum("ij,ij->i", forward, axis) for axis in inertial_axes)
    yaw, roll = _yaw_and_roll(forward, right, below, inertial_axes)
    downrange, crossrange = _ranges(flight.earth.radius_m, place, start, flight.earth.rotation_rad_s)
    return {
        "longitude_deg": np.degrees(longitude),
        "speed_m_s": np.hypot(along, v_down),
        "path_angle_deg": -np.degrees(np.arctan2(v_down, along)),
        "heading_deg": np.degrees(
            np.where(along > _LEVEL * np.abs(v_down), np.arctan2(v_east, v_north), 0.0)
        ),
        "velocity_north_m_s": v_north,
        "velocity_east_m_s": v_east,
        "velocity_down_m_s": v_down,
        "inertial_speed_m_s": inertial_speed,
        "inertial_path_angle_deg": -np.degrees(
            np.arctan2(inertial_down, np.sqrt(np.maximum(inertial_speed**2 - inertial_down**2, 0.0)))
        ),
        "yaw_deg": np.degrees(yaw),
        "pitch_deg": -np.degrees(np.arctan2(f_down, np.hypot(f_north, f_east))),
        "roll_deg": np.degrees(roll),
        "downrange_m": downrange,
        "crossrange_m": crossrange,
    }


def _yaw_and_roll(
    forward: Floats, right: Floats, below: Floats, axes: tuple[Floats, Floats, Floats]
) -> tuple[Floats, Floats]:
    """Yaw and roll (rad) of body axes (n, 3) against the local ones.

    Straight up or down the two turn about the same line and only their sum or difference counts: roll is 0
    there. Next to it roll is what is left of the attitude after the yaw, so that the three angles rebuild it.
    """
    north, east, down = axes
    f_north, f_east = (np.einsum("ij,ij->i", forward, axis) for axis in (north, east))
    level = np.hypot(f_north, f_east)
    r_north, r_east, r_down = (np.einsum("ij,ij->i", right, axis) for axis in axes)
    yaw = np.where(level > _LEVEL, np.arctan2(f_east, f_north), np.arctan2(-r_north, r_east))
    wing = np.cos(yaw)[:, None] * east - np.sin(yaw)[:, None] * north
    rest = np.arctan2(-np.einsum("ij,ij->i", below, wing), np.einsum("ij,ij->i", right, wing))
    roll = np.arctan2(r_down, np.einsum("ij,ij->i", below, down))
    return yaw, np.where(level > _STEEP, roll, rest)


def _earth_fixed(states: Floats, turned: Floats, spin: float) -> tuple[Floats, Floats]:
    """Position and Earth-relative velocity in Earth-fixed axes, which have turned by these angles."""
    cosine, sine = np.cos(turned), np.sin(turned)

    def fixed(x: Floats, y: Floats, z: Floats) -> Floats:
        return np.stack([x * cosine + y * sine, y * cosine - x * sine, z], axis=1)

    x, y, z, vx, vy, vz = states[:, :6].T
    return fixed(x, y, z), fixed(vx + spin * y, vy - spin * x, vz)


def _local_axes(latitude: Floats, longitude: Floats, flat: bool) -> tuple[Floats, Floats, Floats]:
    """North, east and down directions (n, 3)."""
    if flat:
        north, east, down = np.eye(3)
        ones = np.ones((latitude.size, 1))
        return ones * north, ones * east, ones * down
    sp, cp, sl, cl = np.sin(latitude), np.cos(latitude), np.sin(longitude), np.cos(longitude)
    north = np.stack([-sp * cl, -sp * sl, cp], axis=1)
    east = np.stack([-sl, cl, np.zeros_like(sl)], axis=1)
    return north, east, np.cross(north, east)


def _rotations(quaternions: Floats) -> Floats:
    """Rotation matrices (n, 3, 3), inertial to body axes."""
    a, b, c, d = (quaternions / np.linalg.norm(quaternions, axis=1)[:, None]).T
    rows = [
        [1 - 2 * (c * c + d * d), 2 * (b * c + a * d), 2 * (b * d - a * c)],
        [2 * (b * c - a * d), 1 - 2 * (b * b + d * d), 2 * (c * d + a * b)],
        [2 * (b * d + a * c), 2 * (c * d - a * b), 1 - 2 * (b * b + c * c)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def _ranges(radius_m: float, place: Floats, start: Floats, spin: float) -> tuple[Floats, Floats]:
    """Down- and crossrange from the start: great-circle arcs on a sphere, plain distances on a flat Earth.

    The sphere has the Earth's (equatorial) radius; directions to the places are geocentric.
    """
    velocity = start[3:6] - spin * np.array([-start[1], start[0], 0.0])
    if np.isinf(radius_m):
        ahead, right = _ahead_and_right(velocity, np.array([0.0, 0.0, -1.0]), np.array([1.0, 0.0, 0.0]))
        return (place - start[:3]) @ ahead, (place - start[:3]) @ right
    up = start[:3] / np.linalg.norm(start[:3])
    ahead, right = _ahead_and_right(velocity, up, np.array([0.0, 0.0, 1.0]))
    direction = place / np.linalg.norm(place, axis=1)[:, None]
    along = np.arctan2(direction @ ahead, direction @ up)
    return radius_m * along, radius_m * np.arcsin(np.clip(direction @ right, -1.0, 1.0))


def _ahead_and_right(velocity: Floats, up: Floats, north: Floats) -> tuple[Floats, Floats]:
    """Horizontal directions along the velocity (northward when it is vertical) and to its right."""
    level = velocity - (velocity @ up) * up
    if np.linalg.norm(level) < 1e-9:
        level = north - (north @ up) * up
    ahead = level / np.linalg.norm(level)
    return ahead, np.cross(ahead, up)
