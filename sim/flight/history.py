"""A flown trajectory: named columns with units at every step, dense output between them, events, export."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path as FilePath
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from sim.air.atmosphere import Floats, interval
from sim.core.checks import float_array
from sim.core.compiled import kernel
from sim.core.errors import InputError
from sim.flight.columns import COLUMNS, READ_OFF, Rows, flight_columns
from sim.flight.dynamics import ALPHA, STATES, Flight
from sim.flight.integrator import LEFT_RANGE, REACHED_GROUND, Path, evaluated, interpolate
from sim.flight.notes import flight_notes

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["Event", "History"]

_ENDS = {REACHED_GROUND: "impact", LEFT_RANGE: "skip_out"}


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

    :data:`sim.flight.columns.COLUMNS` lists them with units; ``len(history)`` is the number of rows. Rows are
    the accepted steps of the integrator; :meth:`at` gives any other instants from the dense output.
    """

    flight: Flight = field(repr=False)
    path: Path = field(repr=False)

    @cached_property
    def columns(self) -> dict[str, Floats]:
        """Every column, read-only, at the integrator's steps."""
        path = self.path
        return flight_columns(
            self.flight, path.time_s, path.states, path.conditions, path.loads, path.states[0]
        )

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
        return float(self[name][-1])

    def states_at(self, time_s: npt.ArrayLike) -> Floats:
        """State vectors (n, 21) at any instants of the flight, by the integrator's interpolant of order 4."""
        times = np.atleast_1d(float_array("time_s", time_s))
        if times.ndim > 1:
            raise InputError(f"time_s must be a number or a column of numbers, not {times.ndim}-dimensional")
        if times.size and not (times.min() >= 0.0 and times.max() <= self.path.time_s[-1] * (1 + 1e-15)):
            raise InputError(
                f"the flight lasts from 0 to {self.path.time_s[-1]:.6g} s; asked for times outside"
            )
        states = np.empty((times.size, STATES))
        path = self.path
        _interpolate(path.time_s, path.states, path.dense, np.ascontiguousarray(times), states)
        return states

    def at(self, time_s: npt.ArrayLike) -> dict[str, Floats]:
        """All columns at any instants of the flight."""
        states = self.states_at(time_s)
        times = np.atleast_1d(float_array("time_s", time_s))
        return flight_columns(
            self.flight, times, states, *evaluated(self.flight, states), self.path.states[0]
        )

    def _read_off(self, time_s: npt.ArrayLike, *names: str) -> list[Floats]:
        """A few columns at any instants; of those that need no others, no others are worked out."""
        if not READ_OFF.keys() >= set(names):
            seen = self.at(time_s)
            return [seen[name] for name in names]
        states = self.states_at(time_s)
        conditions, loads = evaluated(self.flight, states)
        rows = Rows(states, conditions.T, loads.T, self.flight.body)
        return [READ_OFF[name](rows) for name in names]

    def integral(self, values: Floats) -> float:
        """Integrate numbers at the integrator's steps over time, by the trapezoidal rule."""
        return float(np.trapezoid(values, self.path.time_s))

    def seconds(self, when: npt.NDArray[np.bool_]) -> float:
        """How long something was so, given at the integrator's steps (to within one of them)."""
        return self.integral(when.astype(float))

    def maximum(self, name: str, label: str | None = None) -> Event:
        """Instant of the largest value of a column, refined between the steps on the dense output."""
        return self._extremum(name, label, 1.0)

    def minimum(self, name: str, label: str | None = None) -> Event:
        """Instant of the smallest value of a column, likewise."""
        return self._extremum(name, label, -1.0)

    def _extremum(self, name: str, label: str | None, sign: float) -> Event:
        i = int(np.argmax(sign * self[name]))
        times = self.path.time_s
        low, high = times[max(i - 1, 0)], times[min(i + 1, len(times) - 1)]
        best = float(times[i])
        for _ in range(4):
            grid = np.linspace(low, high, 21)
            j = int(np.argmax(sign * self._read_off(grid, name)[0]))
            best = float(grid[j])
            low, high = grid[max(j - 1, 0)], grid[min(j + 1, 20)]
        height, value = self._read_off(best, "altitude_m", name)
        return Event(label or name, best, float(height[0]), float(value[0]), COLUMNS[name].unit)

    @cached_property
    def events(self) -> dict[str, Event]:
        """What is remarkable, by name.

        ``peak_heating``, ``peak_load``, ``peak_dynamic_pressure``, ``largest_incidence`` (the total one),
        ``smallest_static_margin``; ``turned_over``, when the total incidence first rises through 90 deg (not
        there in a flight that never does); and the end: ``impact`` on the ground, ``skip_out`` at the top of
        the atmosphere's table, ``end`` elsewhere, with the speed.
        """
        found = {
            label: self.maximum(name, label)
            for label, name in (
                ("peak_heating", "stagnation_heat_flux_W_m2"),
                ("peak_load", "load_factor_g"),
                ("peak_dynamic_pressure", "dynamic_pressure_Pa"),
                ("largest_incidence", "total_alpha_deg"),
            )
        }
        found["smallest_static_margin"] = self.minimum("static_margin", "smallest_static_margin")
        turned = self._turned_over_s()
        if turned is not None:
            height = float(self._read_off(turned, "altitude_m")[0][0])
            found["turned_over"] = Event("turned_over", turned, height, 90.0, "deg")
        end = _ENDS.get(self.path.status, "end")
        height, speed = self.final("altitude_m"), self.final("speed_m_s")
        found[end] = Event(end, float(self.path.time_s[-1]), height, speed, "m/s")
        return found

    def _turned_over_s(self) -> float | None:
        """When the total incidence first rises through 90 deg, by bisection on the dense output."""
        beyond = self.path.conditions[:, ALPHA] > 0.5 * np.pi
        rises = np.flatnonzero(~beyond[:-1] & beyond[1:])
        if rises.size == 0:
            return None
        low, high = self.path.time_s[rises[0] : rises[0] + 2]
        while high - low > 1e-9 * high:
            middle = 0.5 * (low + high)
            if not low < middle < high:
                break
            incidence = self._read_off(middle, "total_alpha_deg")[0][0]
            low, high = (low, middle) if incidence > 90.0 else (middle, high)
        return float(high)

    @cached_property
    def notes(self) -> tuple[str, ...]:
        """Where this flight left what the models are good for, in sentences with numbers; none when nowhere.

        :mod:`sim.flight.notes` has the limits.
        """
        return flight_notes(self)

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
        end = self.path.time_s[-1]
        if not every_s > 1e-6 * end:
            raise InputError(
                f"the sampling interval must be positive (a millionth of the flight or more), not {every_s}"
            )
        return self.at(np.append(np.arange(0.0, end, every_s), end))


@kernel
def _interpolate(time_s: Floats, states: Floats, dense: Floats, times: Floats, out: Floats) -> None:
    for i in range(times.size):
        step = interval(time_s, times[i])
        length = time_s[step + 1] - time_s[step]
        interpolate(states[step], dense[step], (times[i] - time_s[step]) / length, out[i])
