"""The re-entry design problem: three design variables in, the paper's responses out.

>>> from sim.reentry import evaluate
>>> round(evaluate(7.5, 12.5, 0.225)["time_of_flight_s"], 1)
94.4

Every constant of the vehicle, the methods and the flight is a keyword; :func:`all_settings` lists them.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import asdict, fields
from functools import cache
from typing import Any

from sim.aero.aerodynamics import loads_address, loads_at, prepare
from sim.aero.given_coefficients import GivenCoefficients
from sim.air.atmosphere import Floats
from sim.body import vehicle as vehicles
from sim.core.compiled import MACHINE_CODE
from sim.core.errors import InputError, SimulationError
from sim.flight.dynamics import MARGIN_INTEGRAL, BodyModel
from sim.flight.history import History
from sim.flight.integrator import advance
from sim.flight.trajectory import Body, InitialState, Integration, fly_body
from sim.objectives import WEIGHTS, objectives, totals, weighted
from sim.settings import FlightSettings, MethodSettings

__all__ = ["all_settings", "evaluate", "fly", "history", "tangency_margin_m", "warm_up"]


def evaluate(
    theta_c1_deg: float, theta_c2_deg: float, nose_radius_m: float, **settings: Any
) -> dict[str, float]:
    """Fly one design and return its responses.

    Parameters
    ----------
    theta_c1_deg, theta_c2_deg : float
        Half-angles of the first cone and of the flare.
    nose_radius_m : float
        Radius of the spherical nose.
    **settings
        Overrides of the constants in :func:`all_settings`.

    Returns
    -------
    dict
        Responses. The first five follow the paper (its Tables 1 and 9) unless ``axial``, ``heat`` and
        ``margin`` choose others from the registers of :mod:`sim.objectives`.

        ``axial_integral`` (F1)
            1e7 times the integral of CA, s. Positive nose first; base first CA is negative, so that a flip
            looks like a gain: see ``mean_static_margin``.
        ``heat_integral`` (F2)
            Integral of the heat flux where the stream meets the body, J/m2, less what a hot wall gives back.
            Convection in a perfect gas (:mod:`sim.aero.wall.heating` names the sources), up to some 4.4 km/s.
        ``margin_inverse`` (F3)
            1e7 over the integral of the absolute static margin, 1/s, positive; blind to its sign.
        ``objective_table1``, ``objective_table9``
            The three, weighted 0.2, 0.7, 0.1 and 0.1, 0.7, 0.2.
        ``total_...``
            Every integral of :class:`sim.objectives.Totals`, unscaled.
        ``time_of_flight_s``, ``impact_speed_m_s``, ``impact_path_angle_deg``, ``downrange_m``
            End of the flight; speed and path angle (negative descending) over the Earth.
        ``peak_load_g``, ``peak_heat_flux_W_m2``, ``peak_dynamic_pressure_Pa``
            Largest along the flight: aerodynamic force over weight, stagnation heat flux, dynamic pressure.
        ``mean_static_margin``, ``smallest_static_margin``
            (Xcp - Xcg) over the reference length, its mean over the flight's time (counted negative base
            first) and its smallest; positive when stable, within +-10.
        ``largest_incidence_deg``, ``base_first_s``
            Between the body's axis and the airflow, 0 to 180; the time spent above 90.
        ``steps``
            Of the integrator.

        :attr:`sim.flight.history.History.notes` of :func:`fly` says where a flight left the models' range.

    Raises
    ------
    SimulationError
        ``InputError`` for an impossible design or setting, ``FlightError`` for a flight that does not end.
    """
    flight_settings = _split(settings)[2]
    flown = fly(theta_c1_deg, theta_c2_deg, nose_radius_m, **settings)
    total = totals(flown, sum_interval_s=flight_settings.sum_interval_s)
    scores = objectives(
        total,
        heat=flight_settings.heat,
        scale=flight_settings.scale,
        axial=flight_settings.axial,
        margin=flight_settings.margin,
    )
    events = flown.events
    return {
        "axial_integral": scores.axial,
        "heat_integral": scores.heat,
        "margin_inverse": scores.margin_inverse,
        "objective_table1": weighted(scores, WEIGHTS["table1"]),
        "objective_table9": weighted(scores, WEIGHTS["table9"]),
        **{f"total_{name}": value for name, value in asdict(total).items()},
        "time_of_flight_s": events["impact"].time_s,
        "impact_speed_m_s": events["impact"].value,
        "impact_path_angle_deg": flown.final("path_angle_deg"),
        "downrange_m": flown.final("downrange_m"),
        "peak_load_g": events["peak_load"].value,
        "peak_heat_flux_W_m2": events["peak_heating"].value,
        "peak_dynamic_pressure_Pa": events["peak_dynamic_pressure"].value,
        "mean_static_margin": float(flown.path.states[-1, MARGIN_INTEGRAL]) / events["impact"].time_s,
        "smallest_static_margin": events["smallest_static_margin"].value,
        "largest_incidence_deg": events["largest_incidence"].value,
        "base_first_s": flown.seconds(flown["total_alpha_deg"] > 90.0),
        "steps": float(len(flown) - 1),
    }


def fly(theta_c1_deg: float, theta_c2_deg: float, nose_radius_m: float, **settings: Any) -> History:
    """Fly one design from the paper's initial conditions to the ground and return the whole flight."""
    vehicle_settings, method_settings, flight_settings = _split(settings)
    vehicle = vehicles.reference_vehicle(theta_c1_deg, theta_c2_deg, nose_radius_m, **vehicle_settings)
    body = surface_body(vehicle, method_settings)
    return fly_body(body, flight_settings.start, flight_settings.environment, flight_settings.integration)


def surface_body(vehicle: vehicles.Vehicle, methods: MethodSettings | None = None) -> Body:
    """Give a vehicle aerodynamics computed from the pressure and friction on its surface."""
    model = BodyModel(
        float(vehicle.mass_kg),
        float(vehicle.axial_inertia_kg_m2),
        float(vehicle.transverse_inertia_kg_m2),
        float(vehicle.transverse_inertia_kg_m2),
        float(vehicle.reference_area_m2),
        float(vehicle.reference_length_m),
        float(vehicle.reference_length_m),
        float(vehicle.cg_m),
    )
    chosen = methods or MethodSettings()
    return Body(model, prepare(vehicle, chosen.methods, chosen.walls, chosen.resolution))


def history(
    theta_c1_deg: float,
    theta_c2_deg: float,
    nose_radius_m: float,
    *,
    every_s: float | None = None,
    **settings: Any,
) -> dict[str, Floats]:
    """Columns of the flight (name -> array), at the integrator's steps or every `every_s` seconds."""
    flown = fly(theta_c1_deg, theta_c2_deg, nose_radius_m, **settings)
    return flown.sampled(every_s)


def tangency_margin_m(
    theta_c1_deg: float, theta_c2_deg: float, nose_radius_m: float, **settings: Any
) -> float:
    """Room between the nose's tangent point and the first crank (m); a design below zero is refused.

    Takes the same settings as :func:`evaluate`, of which only the vehicle's matter.
    """
    return vehicles.tangency_margin_m(theta_c1_deg, theta_c2_deg, nose_radius_m, **_by_table(settings)[0])


def warm_up(**settings: Any) -> None:
    """Compile or load everything that flights with these settings need, by a flight nobody counts.

    Two processes that warm up together compile half of it each. A flight that cannot be flown is left to the
    runs, which say why.
    """
    vehicle = vehicles.reference_vehicle(7.5, 12.5, 0.225)
    ball = Body.with_coefficients(1.0, (1.0, 1.0, 1.0), 1.0, 1.0, GivenCoefficients())
    instant = Integration(duration_s=1e-3)
    MACHINE_CODE.share(
        {
            loads_at: lambda: loads_address(prepare(vehicle, MethodSettings().methods)),
            advance: lambda: fly_body(ball, InitialState(altitude_m=1000.0), None, instant),
        }
    )
    with suppress(SimulationError):
        evaluate(7.5, 12.5, 0.225, **settings)


def all_settings() -> list[dict[str, Any]]:
    """Every setting: table it belongs to, name, default, unit, meaning."""
    return [
        {"table": table.__name__, "name": f.name, "value": f.default, **f.metadata}
        for table in (vehicles.VehicleSettings, MethodSettings, FlightSettings)
        for f in fields(table)
    ]


def _split(settings: dict[str, Any]) -> tuple[dict[str, Any], MethodSettings, FlightSettings]:
    """Hand every keyword to the table that has it."""
    vehicle, method, flight = _by_table(settings)
    return vehicle, MethodSettings(**method), FlightSettings(**flight)


def _by_table(settings: dict[str, Any]) -> list[dict[str, Any]]:
    known = _known_settings()
    unknown = sorted(set(settings).difference(*known))
    if unknown:
        raise InputError(
            f"unknown setting {', '.join(unknown)}; known are {', '.join(sorted(set().union(*known)))}"
        )
    return [{name: value for name, value in settings.items() if name in own} for own in known]


@cache
def _known_settings() -> tuple[set[str], ...]:
    tables = (vehicles.VehicleSettings, MethodSettings, FlightSettings)
    return tuple({field.name for field in fields(table)} for table in tables)
