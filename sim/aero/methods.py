"""Which aerothermodynamic law where, as data: the named presets and the options around them.

The paper's Table 3 numbers the inviscid methods 1 blunt body (OSU), 2 modified Newtonian, 3 modified
Newtonian plus Prandtl-Meyer, 4 tangent cone, 5 high Mach number (shadow and base), and switches between sets
of them at Mach 5. Its sentence about which set serves where contradicts its own Tables 4-6, hence several
presets.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

from sim.aero.pressure_laws.laws import PRESSURE_LAWS, Role, check_law
from sim.core.checks import check_fields
from sim.core.errors import InputError

__all__ = [
    "EVEN",
    "FITTED",
    "PARTS",
    "PRESETS",
    "ROLES",
    "SLOW_END",
    "STAGNATION_LAWS",
    "Laws",
    "Methods",
    "Resolution",
    "Wall",
    "methods",
]

StagnationLaw = Literal["sutton_graves", "detra_kemp_riddell", "fay_riddell"]
Transition = Literal["reynolds", "laminar", "turbulent"]
Edge = Literal["normal_shock", "conical"]
Turbulence = Literal["spalding_chi", "reference_enthalpy"]
StagnationCp = Literal["perfect_gas", "equilibrium_air", "real_air"]
STAGNATION_LAWS = ("perfect_gas", "equilibrium_air", "real_air")
"""Words of ``stagnation_cp`` in the order of their numbers."""
Faces = Literal["impact", "subsonic"]
Quadrature = Literal["even", "fitted"]
WallKind = Literal["fixed", "radiative", "adiabatic"]


PARTS = ("nose", "cone", "cylinder", "flare")
"""Parts of the surface that the stream can hit, in the order of the model's law numbers."""
ROLES: dict[str, Role] = {**dict.fromkeys(PARTS, "impact"), "shadow": "shadow", "base": "base"}
"""What a law has to do on every part of the body."""


@dataclass(frozen=True)
class Laws:
    """Pressure law of every part of the body in one Mach regime: words of :data:`.laws.PRESSURE_LAWS`."""

    nose: str = "modified_newtonian"
    cone: str = "modified_newtonian"
    cylinder: str = "modified_newtonian"
    flare: str = "modified_newtonian"
    shadow: str = "zero"
    base: str = "zero"

    def __post_init__(self) -> None:
        for part, word in vars(self).items():
            check_law(word, ROLES[part], part)


@dataclass(frozen=True)
class Resolution:
    """Quadrature of the surface integrals.

    Pressure on a conical segment does not vary along it, so only the nose needs rings (but for laws that
    know what lies upstream). Around the body both sides of the shadow line have Gauss-Legendre points of
    their own: convergence is spectral at any incidence.

    Parameters
    ----------
    nose_rings, windward, leeward : int
        For pressure: rings on the nose; points from the windward meridian to the shadow line and on to the
        leeward meridian.
    friction_rings, friction_stations : int
        For friction and heat flux: rings on the nose, stations along every segment.
    friction_windward, friction_leeward : int
        Points around the body for friction and heat flux.
    quadrature : {"even", "fitted"}
        Where the points lie: evenly, the same at every incidence; or around the body as few as the incidence
        needs, at most the numbers above (:mod:`sim.aero.around`), and stations even in the root of the
        running length.
    """

    nose_rings: int = 6
    windward: int = 8
    leeward: int = 4
    friction_rings: int = 4
    friction_stations: int = 4
    friction_windward: int = 4
    friction_leeward: int = 3
    quadrature: Quadrature = "even"

    def __post_init__(self) -> None:
        check_fields(self)
        for name, value in self.__dict__.items():
            if name != "quadrature" and not 1 <= value <= 1000:
                raise InputError(f"{name} must lie between 1 and 1000, got {value}")


EVEN = Resolution()
FITTED = Resolution(friction_stations=3, quadrature="fitted")
"""Default quadratures: of the readings of the paper, whose numbers rest on it, and of all others."""


SLOW_END = 3.0
"""Mach number from which the laws for slow flight have no share."""


@dataclass(frozen=True)
class Methods:
    """A complete choice of aerothermodynamic methods.

    Parameters
    ----------
    name : str
        Name of the preset it came from.
    low, high : Laws
        Pressure laws up to ``switch_mach`` and above.
    slow : Laws
        Laws up to Mach 1.5, mixed smoothly into ``low`` until Mach 3. None of the paper's methods is meant
        for such speeds: its base vacuum alone would exceed the drag of a real body there.
    switch_mach : float
        Mach number of the switch; at exactly this one the low set holds.
    blend : (float, float) or None
        Mach numbers between which the two sets are mixed by a smooth step instead of being switched. The
        switch makes CA of the reference vehicle jump by 42 % with the ``paper`` laws.
    shadow_ramp : float
        Sine of the inclination over which the pressure falls from its value at grazing incidence to the
        shadow law. 0 lets it jump there, which adaptive integration does not survive.
    stagnation_cp : {"perfect_gas", "equilibrium_air", "real_air"} or float
        Cp_max: Rayleigh's pitot relation, or of air in chemical equilibrium, or the former up to 2.5 km/s and
        the latter from 3.5 km/s on (where the speed is not known, the former), or this number (2 for plain
        Newtonian).
    faces : {"impact", "subsonic"}
        Whether steep faces, shallow caps and bare spheres have the impact laws alone, or also what
        :mod:`sim.aero.pressure_laws.faces` adds for subsonic flow.
    edge : {"normal_shock", "conical"}
        Total pressure of the boundary-layer edge: behind the normal shock, or behind the conical shock of the
        local tangent cone.
    transition : {"reynolds", "laminar", "turbulent"}
        By the edge Reynolds number of the running length, or everywhere the same.
    transition_reynolds : float
        Onset; turbulent from twice that value on.
    turbulence : {"spalding_chi", "reference_enthalpy"}
        Turbulent skin friction; laminar is always by reference enthalpy.
    stagnation_heating : {"sutton_graves", "detra_kemp_riddell", "fay_riddell"}
        Heat flux at the stagnation point.
    wall : {"fixed", "radiative", "adiabatic"}
        The wall where none is asked for. Fixed at 1000 K in the readings of the paper, which does not say its
        own and whose Tables 4-6 fit it; such a wall gives heat back to air that it is hotter than, below
        Mach 4. In radiative equilibrium otherwise.
    resolution : Resolution
        The quadrature of the surface where none is asked for.
    """

    name: str
    low: Laws
    high: Laws
    slow: Laws = Laws(shadow="base_correlation", base="base_correlation")
    switch_mach: float = 5.0
    blend: tuple[float, float] | None = None
    shadow_ramp: float = 0.05
    stagnation_cp: StagnationCp | float = "perfect_gas"
    faces: Faces = "impact"
    edge: Edge = "normal_shock"
    transition: Transition = "reynolds"
    transition_reynolds: float = 1e6
    turbulence: Turbulence = "spalding_chi"
    stagnation_heating: StagnationLaw = "sutton_graves"
    wall: WallKind = "fixed"
    resolution: Resolution = FITTED

    def __post_init__(self) -> None:
        check_fields(self)
        supersonic = [word for word in vars(self.slow).values() if PRESSURE_LAWS[word].lowest_mach > 0.0]
        if supersonic:
            raise InputError(f"the slow laws serve down to rest; {min(supersonic)} needs supersonic flow")
        if not isinstance(self.stagnation_cp, str) and not self.stagnation_cp > 0.0:
            raise InputError(f"stagnation_cp must be positive, got {self.stagnation_cp:g}")
        if self.blend is not None and not SLOW_END <= self.blend[0] < self.blend[1]:
            raise InputError(f"blend must be two rising Mach numbers from {SLOW_END:g} on, got {self.blend}")
        if not self.switch_mach >= SLOW_END:
            raise InputError(f"switch_mach must be at least {SLOW_END:g}, got {self.switch_mach:g}")
        if not self.shadow_ramp >= 0.0:
            raise InputError(f"shadow_ramp must not be negative, got {self.shadow_ramp:g}")
        if not self.transition_reynolds > 0.0:
            raise InputError(f"transition_reynolds must be positive, got {self.transition_reynolds:g}")


@dataclass(frozen=True)
class Wall:
    """Wall temperature: fixed, or on every panel in radiative equilibrium, or adiabatic (no heat flux)."""

    kind: WallKind = "fixed"
    temperature_K: float = 1000.0
    emissivity: float = 0.8

    def __post_init__(self) -> None:
        check_fields(self)
        if not self.temperature_K > 0.0:
            raise InputError(f"wall temperature must be positive, got {self.temperature_K:g} K")
        if not 0.0 < self.emissivity <= 1.0:
            raise InputError(f"emissivity must lie in (0, 1], got {self.emissivity:g}")


_IMPACT_ONLY = Laws()
_TANGENT_CONE = Laws(
    cone="tangent_cone_hammitt_murthy",
    cylinder="tangent_cone_hammitt_murthy",
    flare="tangent_cone_hammitt_murthy",
    shadow="shadow_pressure",
    base="shadow_pressure",
)
_EULER = Laws(
    nose="corrected_newtonian",
    cone="entropy_layer",
    cylinder="entropy_layer",
    flare="entropy_layer",
    shadow="shadow_pressure",
    base="habp_base_pressure",
)
_NEWTONIAN = Laws(shadow="shadow_pressure", base="shadow_pressure")

PRESETS: dict[str, Methods] = {
    "paper": Methods(
        name="paper",
        resolution=EVEN,
        low=Laws(
            nose="osu_blunt_body",
            cone="newtonian_prandtl_meyer",
            cylinder="newtonian_prandtl_meyer",
            flare="tangent_cone_hammitt_murthy",
            shadow="shadow_pressure",
            base="vacuum_pressure",
        ),
        high=_IMPACT_ONLY,
    ),
    "literal": Methods(
        name="literal",
        resolution=EVEN,
        low=_TANGENT_CONE,
        high=Laws(nose="osu_blunt_body", base="shadow_pressure"),
    ),
    "physics": Methods(
        name="physics",
        low=_NEWTONIAN,
        high=_NEWTONIAN,
        stagnation_cp="real_air",
        faces="subsonic",
        wall="radiative",
    ),
    "best": Methods(
        name="best",
        low=_EULER,
        high=_EULER,
        stagnation_cp="real_air",
        faces="subsonic",
        wall="radiative",
    ),
    "newtonian": Methods(name="newtonian", low=_IMPACT_ONLY, high=_IMPACT_ONLY, slow=_IMPACT_ONLY),
}
"""``paper`` reproduces the subroutine columns of the paper's Tables 4-6; ``literal`` follows its sentence;
``physics`` is modified Newtonian with wake pressure at every Mach number; ``best`` is fitted to Euler
solutions of blunt bodies, with the overexpansion behind the nose and the entropy layer on what follows;
``newtonian`` is impact pressure alone, for comparison with closed forms."""


def methods(preset: str | Methods, **changes: Any) -> Methods:
    """A preset by name, with any field of :class:`Methods` replaced.

    Raises
    ------
    InputError
        For an unknown preset or field.
    """
    if not isinstance(preset, Methods):
        if not isinstance(preset, str) or preset not in PRESETS:
            raise InputError(f"unknown aerodynamic preset {preset!r}; known: {', '.join(PRESETS)}")
        preset = PRESETS[preset]
    unknown = sorted(set(changes) - set(Methods.__dataclass_fields__))
    if unknown:
        raise InputError(f"unknown method option {', '.join(unknown)}")
    return replace(preset, **changes)
