"""A flown trajectory: named columns with units at every step, dense output between them, events, export."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from sim.aerodynamics import CA, CM_NOSE, CN, STAGNATION_HEAT_FLUX, SURFACE_HEAT_RATE, XCP_M
from sim.atmosphere import GRAVITY, Floats, interval
from sim.compiled import compiled
from sim.dynamics import (
    AIRSPEED,
    ALPHA,
    ALTITUDE,
    DENSITY,
    DYNAMIC_PRESSURE,
    LATITUDE,
    LONGITUDE,
    MACH,
    PRESSURE,
    STATES,
    TEMPERATURE,
    Flight,
    U,
    V,
    W,
    conditions,
    new_scratch,
    static_margin,
)
from sim.earth import Earth, from_ned, to_ned
from sim.errors import InputError
from sim.integrator import Path, interpolate

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

__all__ = ["COLUMNS", "Column", "Event", "History"]


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
    "heading_deg": Column("deg", "direction of the velocity, clockwise from north"),
    "velocity_north_m_s": Column("m/s", "Earth-relative velocity, north"),
    "velocity_east_m_s": Column("m/s", "Earth-relative velocity, east"),
    "velocity_down_m_s": Column("m/s", "Earth-relative velocity, down"),
    "airspeed_m_s": Column("m/s", "speed relative to the air"),
    "mach": Column("-", "airspeed over speed of sound"),
    "dynamic_pressure_Pa": Column("Pa", "dynamic pressure"),
    "density_kg_m3": Column("kg/m3", "density of the air"),
    "pressure_Pa": Column("Pa", "pressure of the air"),
    "temperature_K": Column("K", "temperature of the air"),
    "alpha_deg": Column("deg", "angle of attack, atan(w/u)"),
    "beta_deg": Column("deg", "sideslip angle, asin(v/V)"),
    "total_alpha_deg": Column("deg", "angle between the body axis and the airflow"),
    "yaw_deg": Column("deg", "body yaw from north"),
    "pitch_deg": Column("deg", "body pitch above the horizon"),
    "roll_deg": Column("deg", "body roll"),
    "roll_rate_deg_s": Column("deg/s", "p, relative to inertial space, body axes"),
    "pitch_rate_deg_s": Column("deg/s", "q, likewise"),
    "yaw_rate_deg_s": Column("deg/s", "r, likewise"),
    "quaternion_0": Column("-", "attitude quaternion, inertial to body: scalar part"),
    "quaternion_1": Column("-", "x part"),
    "quaternion_2": Column("-", "y part"),
    "quaternion_3": Column("-", "z part"),
    "CA": Column("-", "axial-force coefficient"),
    "CN": Column("-", "normal-force coefficient"),
    "Cm": Column("-", "pitching-moment coefficient about the centre of gravity, nose-up positive"),
    "static_margin": Column("-", "(Xcp - Xcg) over the reference length, > 0 stable; levels off at +-10"),
    "stagnation_heat_flux_W_m2": Column("W/m2", "heat flux at the nose stagnation point"),
    "surface_heat_rate_W": Column("W", "heat flux integrated over the surface"),
    "load_factor_g": Column("g0", "aerodynamic force over mass, in 9.80665 m/s2"),
    "axial_integral_s": Column("s", "time integral of CA since the start"),
    "stagnation_heat_load_J_m2": Column("J/m2", "time integral of the stagnation heat flux"),
    "surface_heat_J": Column("J", "time integral of the surface heat rate"),
    "margin_integral_s": Column("s", "time integral of the static margin"),
    "absolute_margin_integral_s": Column("s", "time integral of the absolute static margin"),
    "downrange_m": Column("m", "along the ground, in the initial heading"),
    "crossrange_m": Column("m", "along the ground, to the right of the initial heading"),
}

_OBSERVED = len(COLUMNS) - 2  # the ranges need the first row


@dataclass(frozen=True)
class Event:
    """One remarkable instant: its time and altitude, and the value of what was remarkable."""

    name: str
    time_s: float
    altitude_m: float
    value: float
    unit: str


@dataclass(frozen=True)
class History:
    """A flight, step by step. Columns are attributes (``history.altitude_m``) or items (``history["mach"]``).

    :data:`COLUMNS` lists them with units; ``len(history)`` is the number of rows. The rows are the accepted
    steps of the integrator; :meth:`at` gives any other instants from the dense output.
    """

    flight: Flight = field(repr=False)
    path: Path = field(repr=False)

    @cached_property
    def columns(self) -> dict[str, Floats]:
        """Every column, read-only, at the integrator's steps."""
        return self._columns(self.path.time_s, self.path.states)

    def __getitem__(self, name: str) -> Floats:
        if name not in COLUMNS:
            raise KeyError(f"no column '{name}'; the history has {', '.join(COLUMNS)}")
        return self.columns[name]

    def __getattr__(self, name: str) -> Floats:
        if name in COLUMNS:
            return self.columns[name]
        raise AttributeError(f"a History has no '{name}'; its columns are {', '.join(COLUMNS)}")

    def __dir__(self) -> Iterator[str]:
        yield from super().__dir__()
        yield from COLUMNS

    def __len__(self) -> int:
        return self.path.time_s.size

    def final(self, name: str) -> float:
        """Value of a column at the end of the flight."""
        return float(self._columns(self.path.time_s[-1:], self.path.states[-1:])[name][0])

    def states_at(self, time_s: npt.ArrayLike) -> Floats:
        """State vectors (n, 18) at any instants of the flight, by the integrator's interpolant of order 4."""
        times = np.atleast_1d(np.asarray(time_s, dtype=float))
        if times.size and not (times.min() >= 0.0 and times.max() <= self.path.time_s[-1] * (1 + 1e-15)):
            raise InputError(
                f"the flight lasts from 0 to {self.path.time_s[-1]:.6g} s; asked for times outside"
            )
        return _interpolated(self.path, np.ascontiguousarray(times))

    def at(self, time_s: npt.ArrayLike) -> dict[str, Floats]:
        """All columns at any instants of the flight."""
        times = np.atleast_1d(np.asarray(time_s, dtype=float))
        return self._columns(times, self.states_at(times))

    def _columns(self, times: Floats, states: Floats) -> dict[str, Floats]:
        rows = _observed(self.flight, times, states)
        table = dict(zip(COLUMNS, rows.T, strict=False))
        first = _observed(self.flight, self.path.time_s[:1], self.path.states[:1])[0]
        names = list(COLUMNS)
        start = {name: first[names.index(name)] for name in ("latitude_deg", "longitude_deg", "heading_deg")}
        table["downrange_m"], table["crossrange_m"] = _ranges(
            self.flight.earth, table, states, self.path.states[0], start
        )
        for column in table.values():
            column.setflags(write=False)
        return table

    def maximum(self, name: str, label: str | None = None) -> Event:
        """Instant of the largest value of a column, refined between the steps on the dense output."""
        values = self[name]
        i = int(np.argmax(values))
        times = self.path.time_s
        low, high = times[max(i - 1, 0)], times[min(i + 1, len(times) - 1)]
        best = float(times[i])
        for _ in range(4):
            grid = np.linspace(low, high, 21)
            j = int(np.argmax(self.at(grid)[name]))
            best = float(grid[j])
            low, high = grid[max(j - 1, 0)], grid[min(j + 1, 20)]
        row = self.at(best)
        return Event(
            label or name, best, float(row["altitude_m"][0]), float(row[name][0]), COLUMNS[name].unit
        )

    @cached_property
    def events(self) -> dict[str, Event]:
        """Peak heating, peak load factor, maximum dynamic pressure and the end of the flight."""
        end = Event(
            "impact", float(self.path.time_s[-1]), self.final("altitude_m"), self.final("speed_m_s"), "m/s"
        )
        return {
            "peak_heating": self.maximum("stagnation_heat_flux_W_m2", "peak_heating"),
            "peak_load": self.maximum("load_factor_g", "peak_load"),
            "peak_dynamic_pressure": self.maximum("dynamic_pressure_Pa", "peak_dynamic_pressure"),
            "impact": end,
        }

    def to_frame(self, every_s: float | None = None) -> pd.DataFrame:
        """All columns as a pandas table, at the integrator's steps or every `every_s` seconds."""
        import pandas as pd

        return pd.DataFrame(self.sampled(every_s))

    def to_csv(self, path: str | os.PathLike[str], every_s: float | None = None) -> FilePath:
        """Write all columns; the first line names them, and their names carry the units."""
        columns = self.sampled(every_s)
        target = FilePath(path)
        unfinished = target.with_name(target.name + ".part")
        with unfinished.open("w", encoding="utf-8") as file:
            file.write(",".join(columns) + "\n")
            for row in zip(*columns.values(), strict=True):
                file.write(",".join(repr(float(value)) for value in row) + "\n")
            file.flush()
            os.fsync(file.fileno())
        os.replace(unfinished, target)
        return target

    def sampled(self, every_s: float | None = None) -> dict[str, Floats]:
        """All columns at the integrator's steps, or every `every_s` seconds and at the end."""
        if every_s is None:
            return self.columns
        if not every_s > 0:
            raise InputError(f"the sampling interval must be positive, not {every_s}")
        end = self.path.time_s[-1]
        return self.at(np.append(np.arange(0.0, end, every_s), end))

    def plot(self) -> Figure:
        """Draw the paper's Figure 3: the flight in twelve panels over time."""
        from sim.plots import plot_history

        return plot_history(self)


@compiled
def _observed(flight: Flight, times: Floats, states: Floats) -> Floats:
    """Rows of the columns, in the order of ``COLUMNS``, without the two ranges."""
    rows = np.empty((times.size, 41))
    scratch = new_scratch()
    degree = 180.0 / math.pi
    earth, body = flight.earth, flight.body
    for i in range(times.size):
        y, row = states[i], rows[i]
        conditions(flight, y, scratch)
        c, load, rotation = scratch.conditions, scratch.loads, scratch.rotation
        latitude, longitude = c[LATITUDE], c[LONGITUDE]
        north, east, down = to_ned(
            earth,
            latitude,
            longitude,
            y[3] + earth.rotation_rad_s * y[1],
            y[4] - earth.rotation_rad_s * y[0],
            y[5],
        )
        along = math.sqrt(north * north + east * east)
        row[0] = times[i]
        row[1] = c[ALTITUDE]
        row[2] = latitude * degree
        turned = longitude - earth.rotation_rad_s * times[i]
        row[3] = math.atan2(math.sin(turned), math.cos(turned)) * degree
        row[4] = math.sqrt(along * along + down * down)
        row[5] = -math.atan2(down, along) * degree
        row[6] = math.atan2(east, north) * degree
        row[7], row[8], row[9] = north, east, down
        row[10], row[11], row[12] = c[AIRSPEED], c[MACH], c[DYNAMIC_PRESSURE]
        row[13], row[14], row[15] = c[DENSITY], c[PRESSURE], c[TEMPERATURE]
        row[16] = math.atan2(c[W], c[U]) * degree
        row[17] = math.atan2(c[V], math.sqrt(c[U] ** 2 + c[W] ** 2)) * degree
        row[18] = c[ALPHA] * degree
        nx, ny, nz = from_ned(earth, latitude, longitude, 1.0, 0.0, 0.0)
        ex, ey, ez = from_ned(earth, latitude, longitude, 0.0, 1.0, 0.0)
        dx, dy, dz = from_ned(earth, latitude, longitude, 0.0, 0.0, 1.0)
        b_n = rotation[0, 0] * nx + rotation[0, 1] * ny + rotation[0, 2] * nz
        b_e = rotation[0, 0] * ex + rotation[0, 1] * ey + rotation[0, 2] * ez
        b_d = rotation[0, 0] * dx + rotation[0, 1] * dy + rotation[0, 2] * dz
        right_d = rotation[1, 0] * dx + rotation[1, 1] * dy + rotation[1, 2] * dz
        below_d = rotation[2, 0] * dx + rotation[2, 1] * dy + rotation[2, 2] * dz
        row[19] = math.atan2(b_e, b_n) * degree
        row[20] = -math.atan2(b_d, math.sqrt(b_n * b_n + b_e * b_e)) * degree
        row[21] = math.atan2(right_d, below_d) * degree
        row[22], row[23], row[24] = y[10] * degree, y[11] * degree, y[12] * degree
        row[25], row[26], row[27], row[28] = y[6], y[7], y[8], y[9]
        row[29], row[30] = load[CA], load[CN]
        row[31] = load[CM_NOSE] + load[CN] * body.cg_m / body.reference_length_m
        row[32] = static_margin(load[XCP_M], body)
        row[33], row[34] = load[STAGNATION_HEAT_FLUX], load[SURFACE_HEAT_RATE]
        force = c[DYNAMIC_PRESSURE] * body.reference_area_m2 * math.sqrt(load[CA] ** 2 + load[CN] ** 2)
        row[35] = force / (body.mass_kg * GRAVITY)
        for j in range(5):
            row[36 + j] = y[13 + j]
    return rows


@compiled
def _interpolated(path: Path, times: Floats) -> Floats:
    out = np.empty((times.size, STATES))
    for i in range(times.size):
        step = interval(path.time_s, times[i])
        length = path.time_s[step + 1] - path.time_s[step]
        interpolate(path.states[step], path.dense[step], (times[i] - path.time_s[step]) / length, out[i])
    return out


def _ranges(
    earth: Earth, table: dict[str, Floats], states: Floats, first_state: Floats, start: dict[str, Any]
) -> tuple[Floats, Floats]:
    """Down- and crossrange: great-circle arcs on a sphere of the equatorial radius; plain on a flat Earth."""
    heading = math.radians(start["heading_deg"])
    if math.isinf(earth.radius_m):
        north, east = states[:, 0] - first_state[0], states[:, 1] - first_state[1]
        cosine, sine = math.cos(heading), math.sin(heading)
        return north * cosine + east * sine, east * cosine - north * sine
    latitude, longitude = math.radians(start["latitude_deg"]), math.radians(start["longitude_deg"])
    up = np.array(from_ned(earth, latitude, longitude, 0.0, 0.0, -1.0))
    ahead = np.array(from_ned(earth, latitude, longitude, math.cos(heading), math.sin(heading), 0.0))
    phi, lam = np.radians(table["latitude_deg"]), np.radians(table["longitude_deg"])
    place = np.stack([np.cos(phi) * np.cos(lam), np.cos(phi) * np.sin(lam), np.sin(phi)], axis=1)
    right = np.cross(ahead, up)
    along = earth.radius_m * np.arctan2(place @ ahead, place @ up)
    return along, earth.radius_m * np.arcsin(np.clip(place @ right, -1.0, 1.0))
