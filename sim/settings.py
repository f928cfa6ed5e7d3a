"""Every constant of a re-entry flight that is not a design variable, with its default, unit and meaning.

``evaluate(..., mass_kg=900, atmosphere="us1976")`` accepts the fields of three tables by keyword:
:class:`sim.body.vehicle.VehicleSettings`, and here :class:`MethodSettings` and :class:`FlightSettings`.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Literal

from sim.aero.methods import PRESETS, Methods, Resolution, Wall, WallKind, methods
from sim.air.dispersion import dispersed
from sim.air.gram import read_gram
from sim.air.standards import standard_atmosphere
from sim.air.wind import CALM
from sim.core.checks import check_angles, check_fields, check_rates, check_speed
from sim.core.errors import InputError
from sim.flight.earth import named_earth
from sim.flight.trajectory import Environment, InitialState, Integration

__all__ = ["FlightSettings", "MethodSettings"]


def _setting(default: Any, unit: str, meaning: str) -> Any:
    return field(default=default, metadata={"unit": unit, "note": meaning})


@dataclass(frozen=True)
class MethodSettings:
    """Aerothermodynamic methods of a flight; an option left at none is that of the preset."""

    preset: str = _setting("paper", "", f"which law where: {', '.join(PRESETS)}")
    blend: tuple[float, float] | None = _setting(
        (4.5, 5.5), "", "Mach numbers between which the preset's two sets of laws are mixed; none: a jump"
    )
    shadow_ramp: float | None = _setting(None, "", "sine of inclination over which shadow pressure sets in")
    stagnation_cp: str | float | None = _setting(
        None, "", "perfect_gas, equilibrium_air, real_air (equilibrium above 3 km/s) or a number"
    )
    faces: str | None = _setting(None, "", "steep faces and caps: impact, or subsonic (fitted)")
    edge: str | None = _setting(None, "", "boundary-layer edge: normal_shock or conical")
    transition: str | None = _setting(None, "", "reynolds, laminar or turbulent")
    transition_reynolds: float | None = _setting(None, "", "edge Reynolds number of transition onset")
    turbulence: str | None = _setting(None, "", "spalding_chi or reference_enthalpy")
    stagnation_heating: str | None = _setting(None, "", "sutton_graves, detra_kemp_riddell or fay_riddell")
    wall: WallKind | None = _setting(
        None, "", "wall temperature: fixed, radiative or adiabatic; none: fixed with the paper's presets"
    )
    wall_temperature_K: float = _setting(1000.0, "K", "of a fixed wall")
    emissivity: float = _setting(0.8, "", "of a radiating wall")
    nose_rings: int | None = _setting(None, "", "quadrature of the surface, see Resolution")
    windward: int | None = _setting(None, "", "likewise")
    leeward: int | None = _setting(None, "", "likewise")
    friction_rings: int | None = _setting(None, "", "likewise")
    friction_stations: int | None = _setting(None, "", "likewise")
    friction_windward: int | None = _setting(None, "", "likewise")
    friction_leeward: int | None = _setting(None, "", "likewise")
    quadrature: Literal["even", "fitted"] | None = _setting(
        None,
        "",
        "points: even, or as few as the incidence needs (fitted); none: even with the paper's presets",
    )

    def __post_init__(self) -> None:
        """Refuse what is of the wrong kind; :class:`sim.aero.methods.Methods` judges the rest."""
        check_fields(self)

    @property
    def methods(self) -> Methods:
        """The preset with the options that are set."""
        blend = tuple(self.blend) if self.blend else None
        return methods(self.preset, blend=blend, **self._given(Methods, without=("blend",)))

    @property
    def walls(self) -> Wall:
        """Wall temperature model."""
        return Wall(self.methods.wall, self.wall_temperature_K, self.emissivity)

    @property
    def resolution(self) -> Resolution:
        """Number and places of quadrature points."""
        return replace(self.methods.resolution, **self._given(Resolution))

    def _given(self, table: type, without: tuple[str, ...] = ()) -> dict[str, Any]:
        names = {f.name for f in fields(table)} & {f.name for f in fields(self)} - set(without)
        return {name: getattr(self, name) for name in names if getattr(self, name) is not None}


@dataclass(frozen=True)
class FlightSettings:
    """Start, environment, accuracy and responses of a re-entry flight (the paper's Table 2 by default)."""

    speed_m_s: float = _setting(4300.0, "m/s", "initial speed, relative to the Earth")
    altitude_m: float = _setting(82_000.0, "m", "initial altitude")
    theta_deg: float = _setting(-15.0, "deg", "Table 2's theta: see angles")
    nu_deg: float = _setting(15.0, "deg", "Table 2's nu: heading, clockwise from north")
    alpha_deg: float = _setting(30.0, "deg", "initial angle of attack, nose up")
    angles: Literal["path", "pitch"] = _setting(
        "path", "", "theta is the flight-path angle, or the pitch angle (path angle = theta - alpha)"
    )
    roll_rate_deg_s: float = _setting(0.0, "deg/s", "initial body rate p")
    pitch_rate_deg_s: float = _setting(0.0, "deg/s", "initial body rate q")
    yaw_rate_deg_s: float = _setting(0.0, "deg/s", "initial body rate r")
    latitude_deg: float = _setting(0.0, "deg", "initial latitude")
    longitude_deg: float = _setting(0.0, "deg", "initial longitude")
    atmosphere: str | Path = _setting("us1962", "", "us1962, us1976 or the path of a GRAM output table")
    seed: int | None = _setting(
        None, "", "none: undisturbed air; a number: that random atmosphere and wind, around the mean"
    )
    dispersion: float = _setting(1.0, "", "scale of the random standard deviations; acts with a seed")
    mean_wind: bool = _setting(False, "", "add the mean wind of one Earth-GRAM table; acts with a seed")
    earth: str = _setting("round", "", "round (R 6371 km, not rotating), round-rotating or wgs84 (with J2)")
    rtol: float = _setting(1e-7, "", "tolerance of the integration")
    largest_step_s: float = _setting(10.0, "s", "largest integration step")
    longest_s: float = _setting(3600.0, "s", "a flight that lasts longer is refused")
    axial: Literal["axial_force", "drag"] = _setting(
        "axial_force", "", "F1: integral of CA (the paper's; rewards a vehicle that turned over) or of CD"
    )
    heat: Literal["stagnation", "stagnation_inflow", "surface", "surface_balance"] = _setting(
        "stagnation",
        "",
        "F2: at the stagnation point (J/m2) the balance (the paper's) or the inflow; over the surface (J) "
        "the inflow or the balance",
    )
    margin: Literal["inverse_absolute", "negated"] = _setting(
        "inverse_absolute",
        "",
        "F3: 1 / integral of |st| (the paper's; takes unstable for stable) or minus the integral of st",
    )
    sum_interval_s: float | None = _setting(
        None, "s", "none: integrals over time; a number: the paper's raw sums over samples this far apart"
    )
    scale: float = _setting(1e7, "", "factor of F1 and F3; the paper's 10e6")

    def __post_init__(self) -> None:
        """Refuse choices that do not exist and numbers without meaning."""
        check_fields(self)
        if not 0 <= self.dispersion <= 10:
            raise InputError(f"dispersion must lie between 0 and 10, got {self.dispersion:g}")
        if not self.speed_m_s > 0:
            raise InputError(f"speed_m_s must be positive, not {self.speed_m_s:g}")
        check_speed("speed_m_s", self.speed_m_s)
        check_angles(90.0, theta_deg=self.theta_deg)
        check_angles(180.0, alpha_deg=self.alpha_deg)
        check_angles(360.0, nu_deg=self.nu_deg, longitude_deg=self.longitude_deg)
        check_rates(
            roll_rate_deg_s=self.roll_rate_deg_s,
            pitch_rate_deg_s=self.pitch_rate_deg_s,
            yaw_rate_deg_s=self.yaw_rate_deg_s,
        )
        if self.sum_interval_s is not None and not self.sum_interval_s > 0:
            raise InputError(f"sum_interval_s must be positive, not {self.sum_interval_s:g}")
        if not self.scale > 0:
            raise InputError(f"scale must be positive, not {self.scale:g}")

    @property
    def path_angle_deg(self) -> float:
        """Initial flight-path angle under the chosen reading of Table 2."""
        return self.theta_deg if self.angles == "path" else self.theta_deg - self.alpha_deg

    @property
    def environment(self) -> Environment:
        """Earth, air and wind."""
        earth, wind = named_earth(self.earth), CALM
        if Path(self.atmosphere).suffix:
            run = read_gram(self.atmosphere)[0]
            atmosphere, wind = run.atmosphere, run.wind
        else:
            atmosphere = standard_atmosphere(str(self.atmosphere))
        if self.seed is None:
            return Environment(earth, atmosphere, wind)
        air = dispersed(
            atmosphere,
            self.seed,
            scale=self.dispersion,
            mean_wind=self.mean_wind,
            path_angle_deg=self.path_angle_deg,
        )
        return Environment(earth, air.atmosphere, air.wind)

    @property
    def start(self) -> InitialState:
        """Initial state under the chosen reading of Table 2."""
        return InitialState.entry(
            self.altitude_m,
            self.speed_m_s,
            self.path_angle_deg,
            heading_deg=self.nu_deg,
            alpha_deg=self.alpha_deg,
            rates_deg_s=(self.roll_rate_deg_s, self.pitch_rate_deg_s, self.yaw_rate_deg_s),
            latitude_deg=self.latitude_deg,
            longitude_deg=self.longitude_deg,
        )

    @property
    def integration(self) -> Integration:
        """Accuracy and guards for the integrator."""
        return Integration(rtol=self.rtol, largest_step_s=self.largest_step_s, longest_s=self.longest_s)
