"""Re-entry flight simulator: atmosphere, aerothermodynamics and six-degree-of-freedom dynamics."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # for type checkers and editors; the table below is what Python looks up
    from sim.aero.coefficients import Air as Air
    from sim.aero.coefficients import coefficients as coefficients
    from sim.aero.coefficients import surface as surface
    from sim.aero.given_coefficients import GivenCoefficients as GivenCoefficients
    from sim.aero.methods import PRESETS as PRESETS
    from sim.aero.methods import Methods as Methods
    from sim.aero.methods import Resolution as Resolution
    from sim.aero.methods import Wall as Wall
    from sim.aero.methods import methods as methods
    from sim.aero.pressure_laws.laws import PRESSURE_LAWS as PRESSURE_LAWS
    from sim.air.altitude_table import table_atmosphere as table_atmosphere
    from sim.air.atmosphere import Atmosphere as Atmosphere
    from sim.air.atmosphere import exponential as exponential
    from sim.air.dispersion import DispersedAir as DispersedAir
    from sim.air.dispersion import dispersed as dispersed
    from sim.air.gram import read_gram as read_gram
    from sim.air.msis import msis as msis
    from sim.air.standards import standard_atmosphere as standard_atmosphere
    from sim.air.standards import us1962 as us1962
    from sim.air.standards import us1976 as us1976
    from sim.air.wind import CALM as CALM
    from sim.air.wind import Wind as Wind
    from sim.air.wind import sheared_wind as sheared_wind
    from sim.air.wind import steady_wind as steady_wind
    from sim.air.wind import table_wind as table_wind
    from sim.body.geometry import BodyShape as BodyShape
    from sim.body.geometry import cone as cone
    from sim.body.geometry import cylinder as cylinder
    from sim.body.geometry import flare as flare
    from sim.body.geometry import sphere_cone as sphere_cone
    from sim.body.vehicle import Vehicle as Vehicle
    from sim.body.vehicle import VehicleSettings as VehicleSettings
    from sim.body.vehicle import constants_table as constants_table
    from sim.body.vehicle import reference_vehicle as reference_vehicle
    from sim.core.errors import FlightError as FlightError
    from sim.core.errors import InputError as InputError
    from sim.core.errors import SimulationError as SimulationError
    from sim.flight.columns import COLUMNS as COLUMNS
    from sim.flight.earth import OMEGA as OMEGA
    from sim.flight.earth import ROUND as ROUND
    from sim.flight.earth import ROUND_ROTATING as ROUND_ROTATING
    from sim.flight.earth import WGS84 as WGS84
    from sim.flight.earth import Earth as Earth
    from sim.flight.earth import flat_earth as flat_earth
    from sim.flight.history import Event as Event
    from sim.flight.history import History as History
    from sim.flight.many import Flights as Flights
    from sim.flight.many import fly_many as fly_many
    from sim.flight.many import summary as summary
    from sim.flight.many import tabulated as tabulated
    from sim.flight.trajectory import Body as Body
    from sim.flight.trajectory import Environment as Environment
    from sim.flight.trajectory import InitialState as InitialState
    from sim.flight.trajectory import Integration as Integration
    from sim.flight.trajectory import fly_body as fly_body
    from sim.plots import plot_history as plot_history
    from sim.reentry import all_settings as all_settings
    from sim.reentry import evaluate as evaluate
    from sim.reentry import fly as fly
    from sim.reentry import history as history
    from sim.reentry import surface_body as surface_body
    from sim.reentry import tangency_margin_m as tangency_margin_m
    from sim.settings import FlightSettings as FlightSettings
    from sim.settings import MethodSettings as MethodSettings

HOMES = {
    "Air": "sim.aero.coefficients",
    "Atmosphere": "sim.air.atmosphere",
    "Body": "sim.flight.trajectory",
    "BodyShape": "sim.body.geometry",
    "CALM": "sim.air.wind",
    "COLUMNS": "sim.flight.columns",
    "DispersedAir": "sim.air.dispersion",
    "Earth": "sim.flight.earth",
    "Environment": "sim.flight.trajectory",
    "Event": "sim.flight.history",
    "FlightError": "sim.core.errors",
    "FlightSettings": "sim.settings",
    "Flights": "sim.flight.many",
    "GivenCoefficients": "sim.aero.given_coefficients",
    "History": "sim.flight.history",
    "InitialState": "sim.flight.trajectory",
    "InputError": "sim.core.errors",
    "Integration": "sim.flight.trajectory",
    "MethodSettings": "sim.settings",
    "Methods": "sim.aero.methods",
    "OMEGA": "sim.flight.earth",
    "PRESETS": "sim.aero.methods",
    "PRESSURE_LAWS": "sim.aero.pressure_laws.laws",
    "ROUND": "sim.flight.earth",
    "ROUND_ROTATING": "sim.flight.earth",
    "Resolution": "sim.aero.methods",
    "SimulationError": "sim.core.errors",
    "Vehicle": "sim.body.vehicle",
    "VehicleSettings": "sim.body.vehicle",
    "WGS84": "sim.flight.earth",
    "Wall": "sim.aero.methods",
    "Wind": "sim.air.wind",
    "all_settings": "sim.reentry",
    "coefficients": "sim.aero.coefficients",
    "cone": "sim.body.geometry",
    "constants_table": "sim.body.vehicle",
    "cylinder": "sim.body.geometry",
    "dispersed": "sim.air.dispersion",
    "evaluate": "sim.reentry",
    "exponential": "sim.air.atmosphere",
    "flare": "sim.body.geometry",
    "flat_earth": "sim.flight.earth",
    "fly": "sim.reentry",
    "fly_body": "sim.flight.trajectory",
    "fly_many": "sim.flight.many",
    "history": "sim.reentry",
    "methods": "sim.aero.methods",
    "msis": "sim.air.msis",
    "plot_history": "sim.plots",
    "read_gram": "sim.air.gram",
    "reference_vehicle": "sim.body.vehicle",
    "sheared_wind": "sim.air.wind",
    "sphere_cone": "sim.body.geometry",
    "standard_atmosphere": "sim.air.standards",
    "steady_wind": "sim.air.wind",
    "summary": "sim.flight.many",
    "surface": "sim.aero.coefficients",
    "surface_body": "sim.reentry",
    "table_atmosphere": "sim.air.altitude_table",
    "table_wind": "sim.air.wind",
    "tabulated": "sim.flight.many",
    "tangency_margin_m": "sim.reentry",
    "us1962": "sim.air.standards",
    "us1976": "sim.air.standards",
}
"""Every public name and the module it comes from; imported on first use."""

__all__ = [*HOMES]


def __getattr__(name: str) -> Any:
    if name not in HOMES:
        raise AttributeError(_unknown(name))
    return getattr(import_module(HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *HOMES})


def _unknown(name: str) -> str:
    from difflib import get_close_matches

    close = get_close_matches(name, HOMES, n=1)
    return f"module '{__name__}' has no attribute {name!r}" + (f"; did you mean {close[0]}?" if close else "")
