"""Many flights at once: dispersions, Monte Carlo, many vehicles."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from sim.aero.aerodynamics import CA, CN, STAGNATION_HEAT_FLUX
from sim.aero.tables.table import NO_TABLE
from sim.aero.tabulated import tabulated as with_table
from sim.air.atmosphere import GRAVITY, Floats
from sim.core.checks import check_kinds
from sim.core.errors import FlightError, InputError
from sim.flight.columns import flight_columns
from sim.flight.dynamics import ALPHA, DYNAMIC_PRESSURE, STATIC_MARGIN
from sim.flight.history import History
from sim.flight.trajectory import Body, Environment, InitialState, Integration, fly_body

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["Flights", "fly_many", "summary", "tabulated"]

Measure = Callable[[History], Mapping[str, float]]
T = TypeVar("T")

_WORTH_A_TABLE = 10  # flights of one body; to fill its table costs some three

_AT_THE_END = (
    "time_s",
    "altitude_m",
    "latitude_deg",
    "longitude_deg",
    "speed_m_s",
    "path_angle_deg",
    "downrange_m",
    "crossrange_m",
    "axial_integral_s",
    "drag_integral_s",
    "stagnation_heat_load_J_m2",
    "stagnation_heat_inflow_J_m2",
    "surface_heat_J",
    "surface_heat_inflow_J",
    "margin_integral_s",
    "absolute_margin_integral_s",
)


@dataclass(frozen=True)
class Flights:
    """What many flights measured.

    Attributes
    ----------
    values : dict of (n,) arrays
        Every measure, by name, one number a flight; NaN where a flight failed.
    failures : dict
        Index of a flight that has no end, and why.
    checked : tuple of int
        Flights that were flown a second time, with the laws in place of the tables.
    deviations : dict
        Of every measure the largest difference, absolute and in its unit, that the tables made to a checked
        flight; empty when none was.
    """

    values: dict[str, Floats]
    failures: dict[int, str]
    checked: tuple[int, ...]
    deviations: dict[str, float]

    def __len__(self) -> int:
        return next((column.size for column in self.values.values()), len(self.failures))

    def __getitem__(self, name: str) -> Floats:
        if name not in self.values:
            known = ", ".join(self.values) or "none, for every flight failed"
            raise KeyError(f"no measure '{name}'; there are {known}")
        return self.values[name]

    def to_frame(self) -> pd.DataFrame:
        """All measures as a pandas table, a row a flight."""
        import pandas as pd

        return pd.DataFrame(self.values, index=range(len(self)))


def tabulated(body: Body) -> Body:
    """Make the same body with loads from a table, which its flights fill and share.

    Loads are interpolated over Mach number, incidence, Knudsen number and temperature between knots at which
    the body's own laws are evaluated when a flight first comes near. A flight through a filled table takes a
    tenth of the time or less; docs/flight.md says what it is off by. The table takes up to some 100 MB. It
    belongs to this body: one made anew, or sent to another process, starts from an empty one.

    Parameters
    ----------
    body : Body
        With a surface (:func:`sim.surface_body`); given coefficients are tables already.

    Returns
    -------
    Body

    Raises
    ------
    InputError
        For a body without a surface.

    Examples
    --------
    >>> from sim import InitialState, fly_body, reference_vehicle, surface_body, tabulated
    >>> quick = tabulated(surface_body(reference_vehicle(7.5, 12.5, 0.225)))
    >>> flown = fly_body(quick, InitialState.entry(60_000.0, 4300.0, -40.0))
    >>> round(flown.final("time_s"), 1)
    28.8
    """
    check_kinds(body=(body, Body))
    if body.surface is None:
        raise InputError("a body with given coefficients has no laws to tabulate: fly it as it is")
    return body if body.surface.table.exists else replace(body, surface=with_table(body.surface))


def summary(history: History) -> dict[str, float]:
    """Measure a flight: columns at its end by their names, and its peaks.

    Peaks are those of the parabola through the highest step and its neighbours: of load factor, stagnation
    heat flux (W/m2), dynamic pressure (Pa), total incidence (deg); and the smallest static margin.
    """
    path, body = history.path, history.flight.body
    last = slice(-1, None)
    rows = (path.time_s[last], path.states[last], path.conditions[last], path.loads[last])
    end = flight_columns(history.flight, *rows, path.states[0])
    pressure = path.conditions[:, DYNAMIC_PRESSURE]
    force = pressure * body.reference_area_m2 * np.hypot(path.loads[:, CA], path.loads[:, CN])
    peaks = {
        "peak_load_g": force / (body.mass_kg * GRAVITY),
        "peak_heat_flux_W_m2": path.loads[:, STAGNATION_HEAT_FLUX],
        "peak_dynamic_pressure_Pa": pressure,
        "largest_incidence_deg": np.degrees(path.conditions[:, ALPHA]),
    }
    return {
        **{name: float(end[name][0]) for name in _AT_THE_END},
        **{name: _peak(path.time_s, values) for name, values in peaks.items()},
        "smallest_static_margin": -_peak(path.time_s, -path.conditions[:, STATIC_MARGIN]),
    }


def _peak(time_s: Floats, values: Floats) -> float:
    """Height of the parabola through the largest of the values and its neighbours."""
    i = int(np.argmax(values))
    highest = float(values[i])
    if not 0 < i < values.size - 1:
        return highest
    before, after = time_s[i] - time_s[i - 1], time_s[i + 1] - time_s[i]
    down, up = (values[i] - values[i - 1]) / before, (values[i + 1] - values[i]) / after
    bend = (up - down) / (before + after)
    slope = (down * after + up * before) / (before + after)
    return float(highest - 0.25 * slope * slope / bend) if bend < 0.0 else highest


def fly_many(
    bodies: Body | Sequence[Body],
    starts: InitialState | Sequence[InitialState],
    environments: Environment | Sequence[Environment] | None = None,
    integration: Integration | None = None,
    *,
    measure: Measure = summary,
    tables: bool = True,
    checks: int = 3,
) -> Flights:
    """Fly many flights and keep a few numbers of each.

    Parameters
    ----------
    bodies, starts, environments
        Of each either one for all flights, or a sequence with one a flight.
    integration : Integration, optional
        Accuracy and end of all flights.
    measure : callable
        What to keep of a flight: a function of its :class:`sim.History` that returns numbers by name.
        :func:`summary` unless given.
    tables : bool
        Whether bodies with a surface that make ten flights or more fly through tables of their own laws
        (:func:`tabulated`). One that is tabulated already does so in any case, and keeps what it learns.
    checks : int
        How many of the flights through tables, spread over the batch, are flown by the laws as well, for
        :attr:`Flights.deviations`.

    Returns
    -------
    Flights
        A flight that does not end, or leaves the atmosphere, is a failure with a reason; the others go on.

    Raises
    ------
    InputError
        For sequences of different lengths, what is of the wrong kind, and starts outside the atmosphere.

    Examples
    --------
    >>> from sim import InitialState, fly_many, reference_vehicle, surface_body
    >>> body = surface_body(reference_vehicle(7.5, 12.5, 0.225))
    >>> starts = [InitialState.entry(60_000.0, 4300.0, angle) for angle in (-40.0, -50.0)]
    >>> fly_many(body, starts)["speed_m_s"].round()
    array([564., 840.])
    """
    rows = _rows(
        _column("bodies", bodies, Body),
        _column("starts", starts, InitialState),
        _column("environments", Environment() if environments is None else environments, Environment),
    )
    if isinstance(checks, bool) or not isinstance(checks, int) or checks < 0:
        raise InputError(f"checks must be a whole number, not negative; got {checks!r}")
    quick = _with_tables([body for body, _, _ in rows]) if tables else {}
    measured: list[Mapping[str, float] | str] = [
        _measured(quick.get(id(body), body), start, air, integration, measure) for body, start, air in rows
    ]
    flown = [i for i, found in enumerate(measured) if not isinstance(found, str)]
    tabled = [i for i in flown if _plain(quick.get(id(rows[i][0]), rows[i][0])) is not None]
    spread = np.linspace(0, len(tabled) - 1, min(checks, len(tabled))).round().astype(int)
    checked = tuple(tabled[i] for i in spread)
    deviations: dict[str, float] = {}
    for i in checked:
        body, start, air = rows[i]
        true = _measured(_plain(body) or body, start, air, integration, measure)
        mine = measured[i]
        if isinstance(true, str) or isinstance(mine, str):
            continue
        for name, value in true.items():
            deviations[name] = max(deviations.get(name, 0.0), abs(mine[name] - value))
    names = list(dict.fromkeys(name for found in measured if not isinstance(found, str) for name in found))
    return Flights(
        {
            name: np.array(
                [np.nan if isinstance(found, str) else found.get(name, np.nan) for found in measured]
            )
            for name in names
        },
        {i: found for i, found in enumerate(measured) if isinstance(found, str)},
        checked,
        deviations,
    )


def _column(name: str, given: Any, kind: type[T]) -> list[T]:
    """A list of parts of flights, from one or from a sequence of them."""
    parts = [given] if isinstance(given, kind) else given
    if isinstance(parts, str) or not isinstance(parts, Sequence) or not parts:
        raise InputError(f"{name} must be of type {kind.__name__}, or a sequence of them; not {given!r}")
    for i, part in enumerate(parts):
        check_kinds(**{f"{name}[{i}]": (part, kind)})
    return list(parts)


def _rows(
    bodies: list[Body], starts: list[InitialState], environments: list[Environment]
) -> list[tuple[Body, InitialState, Environment]]:
    """Parts of every flight; where there is one alone, it is everybody's."""
    columns: dict[str, list[Any]] = {"bodies": bodies, "starts": starts, "environments": environments}
    flights = max(len(column) for column in columns.values())
    if any(len(column) not in (1, flights) for column in columns.values()):
        lengths = ", ".join(f"{len(column)} {name}" for name, column in columns.items())
        raise InputError(f"give one of each for all flights, or one a flight; got {lengths}")
    shared = [column * flights if len(column) == 1 else column for column in columns.values()]
    return list(zip(*shared, strict=True))


def _with_tables(bodies: list[Body]) -> dict[int, Body]:
    """Of bodies that fly often enough for a table, by identity, the same with one."""
    often: dict[int, int] = {}
    for body in bodies:
        often[id(body)] = often.get(id(body), 0) + 1
    return {
        id(body): tabulated(body)
        for body in {id(body): body for body in bodies}.values()
        if body.surface is not None and often[id(body)] >= _WORTH_A_TABLE
    }


def _plain(body: Body) -> Body | None:
    """The body without its table; none for one that has none."""
    if body.surface is None or not body.surface.table.exists:
        return None
    return replace(body, surface=body.surface._replace(table=NO_TABLE))


def _measured(
    body: Body, start: InitialState, air: Environment, integration: Integration | None, measure: Measure
) -> Mapping[str, float] | str:
    try:
        return measure(fly_body(body, start, air, integration))
    except FlightError as error:
        return str(error)
