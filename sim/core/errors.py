"""What the simulator raises on purpose: one base class, two cases."""

from __future__ import annotations

from typing import Any

__all__ = ["FlightError", "InputError", "SimulationError"]


class SimulationError(Exception):
    """Base of everything the simulator refuses or cannot compute; the message says why."""


class InputError(SimulationError, ValueError):
    """A setting, shape or state that makes no physical sense or lies outside a model's range."""


class FlightError(SimulationError):
    """A trajectory that cannot be integrated to its end.

    Parameters
    ----------
    reason : str
        What stopped the integration.
    time_s, altitude_m : float
        Flight time and altitude of the last good state; appended to the message.

    Attributes
    ----------
    history : sim.flight.history.History or None
        The flight until then, with its columns, events and notes; it does not travel between processes.
    """

    history: Any = None

    def __init__(self, reason: str, time_s: float, altitude_m: float) -> None:
        super().__init__(f"{reason} (at t = {time_s:.3f} s, altitude {altitude_m:.1f} m)")
        self.reason = reason
        self.time_s = time_s
        self.altitude_m = altitude_m

    def __reduce__(self) -> tuple[type[FlightError], tuple[str, float, float]]:
        """Survive the trip between worker processes."""
        return type(self), (self.reason, self.time_s, self.altitude_m)
