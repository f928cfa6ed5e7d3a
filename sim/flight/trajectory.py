"""Fly one body through one environment.

>>> from sim.aero.given_coefficients import GivenCoefficients, coefficients_address
>>> from sim.flight.trajectory import Body, Environment, InitialState, fly_body
>>> ball = Body.with_coefficients(14.6, (4.9, 4.9, 4.9), 0.0182, 1.0, GivenCoefficients(drag=0.1))
>>> drop = InitialState(altitude_m=9144.0)
>>> round(float(fly_body(ball, drop, Environment()).time_s[-1]), 2)
46.22
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cache
from typing import Literal

import numpy as np

from sim.aero.aerodynamics import AeroModel, loads_address, prepare
from sim.aero.given_coefficients import GivenCoefficients, coefficients_address
from sim.aero.methods import methods
from sim.aero.tabulated import ready, tabulated_address
from sim.air.atmosphere import Atmosphere, Floats
from sim.air.standards import us1962
from sim.air.wind import CALM, Wind
from sim.body.vehicle import reference_vehicle
from sim.core.checks import (
    check_angles,
    check_fields,
    check_kinds,
    check_numbers,
    check_rates,
    check_speed,
    float_array,
)
from sim.core.errors import FlightError, InputError
from sim.core.quadrature import dot
from sim.flight.dynamics import CONTROLLED, STATES, BodyModel, Flight, derivatives_address
from sim.flight.earth import ROUND, Earth, check_earth, from_ned, geocentric_position, position
from sim.flight.history import History
from sim.flight.integrator import LEFT_RANGE, STEP_UNDERFLOW, TOO_MANY_STEPS, Control, Path, integrate

__all__ = ["Body", "Environment", "InitialState", "Integration", "fly_body"]

_MARGIN_SHARPER = 0.03


@dataclass(frozen=True)
class Environment:
    """Earth, atmosphere and wind of a flight; by default the paper's still US-1962 air over a round Earth."""

    earth: Earth = ROUND
    atmosphere: Atmosphere = field(default_factory=us1962)
    wind: Wind = CALM

    def __post_init__(self) -> None:
        """Refuse what is not of these kinds, and an Earth that cannot be."""
        check_fields(self)
        check_earth(self.earth)


@dataclass(frozen=True)
class InitialState:
    """Where and how a flight starts.

    Attributes
    ----------
    altitude_m, latitude_deg, longitude_deg : float
        Height above the ellipsoid, latitude and longitude at t = 0.
    velocity_ned_m_s : tuple of 3 floats
        North, east, down.
    attitude_deg : tuple of 3 floats
        Yaw, pitch, roll (in this order of rotation) of the body relative to the local north-east-down axes.
    rates_deg_s : tuple of 3 floats
        Body rates p, q, r relative to inertial space, in body axes.
    relative_to : {"earth", "inertial"}
        Whether the velocity is the one over the rotating Earth or the one in inertial space.
    vertical : {"geodetic", "geocentric"}
        What the latitude is and where "down" points: along the normal of the ellipsoid, or to the centre of
        the Earth. Of importance to published entries over the ellipsoid: up to 0.19 deg of path angle.
    """

    altitude_m: float
    latitude_deg: float = 0.0
    longitude_deg: float = 0.0
    velocity_ned_m_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    attitude_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rates_deg_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    relative_to: Literal["earth", "inertial"] = "earth"
    vertical: Literal["geodetic", "geocentric"] = "geodetic"

    def __post_init__(self) -> None:
        """Refuse what is not a place, a motion or an attitude."""
        check_fields(self)
        check_angles(90.0, latitude_deg=self.latitude_deg)
        check_angles(360.0, longitude_deg=self.longitude_deg)
        names = ("yaw of attitude_deg", "pitch of attitude_deg", "roll of attitude_deg")
        check_angles(540.0, **dict(zip(names, self.attitude_deg, strict=True)))
        names = ("p of rates_deg_s", "q of rates_deg_s", "r of rates_deg_s")
        check_rates(**dict(zip(names, self.rates_deg_s, strict=True)))
        check_speed("the speed of velocity_ned_m_s", math.hypot(*self.velocity_ned_m_s))

    @classmethod
    def entry(
        cls,
        altitude_m: float,
        speed_m_s: float,
        path_angle_deg: float,
        *,
        heading_deg: float = 0.0,
        alpha_deg: float = 0.0,
        rates_deg_s: tuple[float, float, float] = (0.0, 0.0, 0.0),
        latitude_deg: float = 0.0,
        longitude_deg: float = 0.0,
        relative_to: Literal["earth", "inertial"] = "earth",
        vertical: Literal["geodetic", "geocentric"] = "geodetic",
    ) -> InitialState:
        """Start from speed, path angle (< 0 descending), heading (from north) and angle of attack (nose up).

        The body lies in the vertical plane of the path, wings level: pitch = path angle + angle of attack.
        Speed, path angle and heading are those over the rotating Earth, or those in inertial space, against
        the horizon that ``vertical`` names.

        Raises
        ------
        InputError
            For a negative speed or a path angle beyond the vertical.
        """
        check_numbers(
            speed_m_s=speed_m_s, path_angle_deg=path_angle_deg, heading_deg=heading_deg, alpha_deg=alpha_deg
        )
        if speed_m_s < 0.0:
            raise InputError(f"speed_m_s must not be negative, got {speed_m_s:g}")
        check_angles(90.0, path_angle_deg=path_angle_deg)
        check_angles(180.0, alpha_deg=alpha_deg)
        check_angles(360.0, heading_deg=heading_deg)
        path, heading = math.radians(path_angle_deg), math.radians(heading_deg)
        along = speed_m_s * math.cos(path)
        velocity = (along * math.cos(heading), along * math.sin(heading), -speed_m_s * math.sin(path))
        attitude = (heading_deg, path_angle_deg + alpha_deg, 0.0)
        return cls(
            altitude_m, latitude_deg, longitude_deg, velocity, attitude, rates_deg_s, relative_to, vertical
        )

    def state(self, earth: Earth) -> Floats:
        """State vector of the equations of motion at t = 0."""
        latitude, longitude = math.radians(self.latitude_deg), math.radians(self.longitude_deg)
        y = np.zeros(STATES)
        place = position if self.vertical == "geodetic" else geocentric_position
        y[0:3] = place(earth, latitude, longitude, float(self.altitude_m))
        y[3:6] = from_ned(earth, latitude, longitude, *(float(v) for v in self.velocity_ned_m_s))
        if self.relative_to == "earth":
            y[3] -= earth.rotation_rad_s * y[1]
            y[4] += earth.rotation_rad_s * y[0]
        local = np.array([from_ned(earth, latitude, longitude, *axis) for axis in np.eye(3)])
        turned = [[dot(axis, column) for column in local.T] for axis in _body_axes(self.attitude_deg)]
        y[6:10] = _quaternion(np.array(turned))
        y[10:13] = np.radians(self.rates_deg_s)
        return y


@dataclass(frozen=True)
class Body:
    """What flies: mass properties, reference quantities and one of the two aerodynamic models."""

    model: BodyModel
    surface: AeroModel | None = None
    coefficients: GivenCoefficients = field(default_factory=GivenCoefficients)

    def __post_init__(self) -> None:
        """Refuse bodies that cannot exist."""
        for name in (
            "mass_kg",
            "ixx_kg_m2",
            "iyy_kg_m2",
            "izz_kg_m2",
            "reference_area_m2",
            "reference_length_m",
        ):
            value = getattr(self.model, name)
            if not 0.0 < value < math.inf:
                raise InputError(f"{name} must be a positive number, not {value}")
        x, y, z = sorted(self.model[1:4])
        if z > (x + y) * (1 + 1e-9):
            raise InputError(
                f"no mass distribution has the moments of inertia {self.model[1:4]}: the largest exceeds "
                "the sum of the others"
            )

    @classmethod
    def with_coefficients(
        cls,
        mass_kg: float,
        inertia_kg_m2: tuple[float, float, float],
        reference_area_m2: float,
        reference_length_m: float,
        coefficients: GivenCoefficients,
    ) -> Body:
        """Body whose aerodynamics are given numbers; moments are about its centre of gravity."""
        check_kinds(coefficients=(coefficients, GivenCoefficients))
        inertia = float_array("inertia_kg_m2", inertia_kg_m2)
        if inertia.shape != (3,):
            raise InputError(f"a body has three principal moments of inertia, not {inertia_kg_m2!r}")
        check_numbers(
            mass_kg=mass_kg, reference_area_m2=reference_area_m2, reference_length_m=reference_length_m
        )
        span = reference_length_m if coefficients.span_m is None else coefficients.span_m
        model = BodyModel(
            float(mass_kg),
            float(inertia[0]),
            float(inertia[1]),
            float(inertia[2]),
            float(reference_area_m2),
            float(reference_length_m),
            float(span),
            0.0,
        )
        return cls(model, None, coefficients)


@dataclass(frozen=True)
class Integration:
    """How accurately and how far to integrate.

    Attributes
    ----------
    rtol : float
        Tolerance per step, relative to each state's own scale; everything scales with it.
    largest_step_s : float
        Upper bound of the step.
    duration_s : float, optional
        Stop here, wherever the body is. When None the flight must end on the ground.
    ground_m : float
        Altitude of the ground.
    longest_s : float
        A flight that has not ended by then is refused.
    most_steps : int
        A flight that needs more steps is refused. A re-entry takes some thousand; 250,000 take 20 s.
    """

    rtol: float = 1e-7
    largest_step_s: float = 10.0
    duration_s: float | None = None
    ground_m: float = 0.0
    longest_s: float = 3600.0
    most_steps: int = 250_000

    def __post_init__(self) -> None:
        """Refuse settings the integrator cannot work with."""
        check_fields(self, unbounded=("ground_m", "longest_s", "largest_step_s"))
        if not 1e-13 <= self.rtol <= 1e-2:
            raise InputError(f"rtol must lie between 1e-13 and 1e-2, not {self.rtol}")
        for name in ("largest_step_s", "duration_s", "longest_s", "most_steps"):
            value = getattr(self, name)
            if value is not None and not value > 0:
                raise InputError(f"{name} must be positive, not {value}")

    def control(self, floor_m: float, ceiling_m: float) -> Control:
        """Tolerances and bounds for the compiled integrator.

        Position is held to an absolute 10 km x rtol (relative to the Earth's radius it would be worthless);
        other states to rtol times their size plus a typical size.
        """
        rtol, atol = np.full(CONTROLLED, self.rtol), np.full(CONTROLLED, self.rtol)
        rtol[0:3], atol[0:3] = 0.0, 1e4 * self.rtol
        atol[3:6] = 1e2 * self.rtol
        atol[6:10] = 0.1 * self.rtol
        # An oscillation of angle a has rates of some 10 a per second.
        rtol[10:13], atol[10:13] = 10.0 * self.rtol, self.rtol
        atol[13:18] = np.array([1.0, 1e6, 1e6, 1.0, 1.0]) * self.rtol
        # The centre of pressure has a kink at zero incidence (a cylinder's impact force grows with sin^2),
        # met hundreds of times per flight; only a tighter tolerance makes the step control see it.
        rtol[16:18] *= _MARGIN_SHARPER
        atol[16:18] *= _MARGIN_SHARPER
        fixed_end = self.duration_s is not None
        return Control(
            rtol,
            atol,
            float(self.longest_s if self.duration_s is None else self.duration_s),
            -math.inf if fixed_end and self.ground_m == -math.inf else float(self.ground_m),
            float(floor_m),
            float(ceiling_m),
            min(1e-3, float(self.largest_step_s)),
            float(self.largest_step_s),
            int(self.most_steps),
        )


def fly_body(
    body: Body,
    initial: InitialState,
    environment: Environment | None = None,
    integration: Integration | None = None,
) -> History:
    """Fly a body from an initial state to the ground (or for a given duration).

    Parameters
    ----------
    body, initial, environment, integration
        What flies, from where, through what and how accurately.

    Returns
    -------
    History

    Raises
    ------
    InputError
        If the start is not inside the atmosphere, or not above the ground (or on it, rising).
    FlightError
        If the flight leaves the atmosphere (skips out), does not end, or the step size collapses; its
        ``history`` is what was flown until then.
    """
    environment = environment or Environment()
    integration = integration or Integration()
    check_kinds(
        body=(body, Body),
        initial=(initial, InitialState),
        environment=(environment, Environment),
        integration=(integration, Integration),
    )
    earth = check_earth(environment.earth)
    air_model = environment.atmosphere.model
    if not air_model.lowest_m <= initial.altitude_m <= air_model.highest_m:
        raise InputError(
            f"the flight starts at {initial.altitude_m:g} m, outside the atmosphere "
            f"'{environment.atmosphere.name}' ({air_model.lowest_m:g} to {air_model.highest_m:g} m)"
        )
    if initial.altitude_m < integration.ground_m:
        raise InputError(
            f"the flight starts at {initial.altitude_m:g} m, below the ground at {integration.ground_m:g} m"
        )
    if initial.altitude_m == integration.ground_m and not initial.velocity_ned_m_s[2] < 0.0:
        raise InputError("the flight starts on the ground and does not rise")
    if initial.vertical == "geocentric" and math.isinf(earth.radius_m):
        raise InputError("a flat Earth has no geocentric vertical")
    start = initial.state(earth)
    surface, surface_loads = _surface(body)
    flight = Flight(
        earth,
        air_model,
        environment.wind,
        body.model,
        surface,
        body.coefficients.model(body.model.reference_length_m),
        surface_loads,
        coefficients_address() if body.surface is None else 0,
    )
    flight = flight._replace(rates=derivatives_address(flight))
    path = integrate(flight, start, integration.control(air_model.lowest_m - 1e-6, air_model.highest_m))
    history = History(flight, path)
    _refuse_unfinished(path, integration, history)
    return history


def _surface(body: Body) -> tuple[AeroModel, int]:
    """Surface of a body and the address of the machine code of its loads; 0 where there are coefficients."""
    if body.surface is None:
        return _unused_surface(), 0
    if body.surface.table.exists:
        return ready(body.surface), tabulated_address(body.surface)
    return body.surface, loads_address(body.surface)


def _refuse_unfinished(path: Path, integration: Integration, history: History) -> None:
    reasons = {
        LEFT_RANGE: "the flight left the altitudes that the atmosphere covers",
        STEP_UNDERFLOW: "the integration step collapsed: the motion or the aerodynamics are singular here",
        TOO_MANY_STEPS: f"the flight needs more than {integration.most_steps} steps",
    }
    reason = reasons.get(path.status)
    if reason is None and integration.duration_s is None and path.time_s[-1] >= integration.longest_s:
        reason = f"the flight has not reached the ground after {integration.longest_s:g} s"
    if reason:
        error = FlightError(reason, float(path.time_s[-1]), float(history.final("altitude_m")))
        error.history = history
        raise error


def _body_axes(attitude_deg: tuple[float, float, float]) -> Floats:
    """Rotation from north-east-down to body axes for yaw, pitch, roll (deg)."""
    yaw, pitch, roll = (math.radians(angle) for angle in attitude_deg)
    cy, sy, cp, sp = math.cos(yaw), math.sin(yaw), math.cos(pitch), math.sin(pitch)
    cr, sr = math.cos(roll), math.sin(roll)
    return np.array(
        [
            [cp * cy, cp * sy, -sp],
            [sr * sp * cy - cr * sy, sr * sp * sy + cr * cy, sr * cp],
            [cr * sp * cy + sr * sy, cr * sp * sy - sr * cy, cr * cp],
        ]
    )


def _quaternion(rotation: Floats) -> Floats:
    """Unit quaternion (scalar first) of a rotation matrix, by its largest component (Shepperd 1978)."""
    m = rotation
    trace = float(np.trace(m))
    squares = np.array([trace, m[0, 0], m[1, 1], m[2, 2]])
    largest = int(np.argmax(squares))
    q = np.empty(4)
    if largest == 0:
        q[:] = 1.0 + trace, m[1, 2] - m[2, 1], m[2, 0] - m[0, 2], m[0, 1] - m[1, 0]
    else:
        i = largest - 1
        j, k = (i + 1) % 3, (i + 2) % 3
        q[0] = m[j, k] - m[k, j]
        q[1 + i] = 1.0 + m[i, i] - m[j, j] - m[k, k]
        q[1 + j] = m[i, j] + m[j, i]
        q[1 + k] = m[i, k] + m[k, i]
    q /= math.sqrt(dot(q, q))
    return q if q[0] >= 0 else -q


@cache
def _unused_surface() -> AeroModel:
    """A surface model for flights that do not use one, so that they share the compiled integrator."""
    return prepare(reference_vehicle(7.5, 12.5, 0.2), methods("newtonian"))
