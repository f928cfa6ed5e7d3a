"""The flying vehicle: shape, mass, centre of gravity, inertia and reference lengths.

:func:`reference_vehicle` builds the paper's vehicle from its three design variables. The paper prints neither
its lengths nor its mass; :class:`VehicleSettings` holds what was put in their place, each constant with its
status, and every one can be overridden by keyword.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from functools import lru_cache
from typing import Any, Literal

from sim.body.geometry import BodyShape, cone, cylinder, flare
from sim.body.mass import uniform_gyration_radii_m
from sim.core.checks import check_fields, check_numbers
from sim.core.errors import InputError

__all__ = ["Vehicle", "VehicleSettings", "constants_table", "reference_vehicle", "tangency_margin_m"]


@dataclass(frozen=True)
class Vehicle:
    """A rigid body of revolution.

    Parameters
    ----------
    shape : BodyShape
        Outline.
    mass_kg : float
        Constant during the flight, > 0.
    cg_m : float
        Centre of gravity aft of the nose tip, on the axis and within the body.
    axial_inertia_kg_m2, transverse_inertia_kg_m2 : float
        Moments of inertia about the axis of revolution and about any axis across it through the centre of
        gravity.
    reference_area_m2, reference_length_m : float
        What aerodynamic coefficients refer to.

    Raises
    ------
    InputError
        A value that no rigid body can have, with the reason.
    """

    shape: BodyShape
    mass_kg: float
    cg_m: float
    axial_inertia_kg_m2: float
    transverse_inertia_kg_m2: float
    reference_area_m2: float
    reference_length_m: float

    def __post_init__(self) -> None:
        check_fields(self)
        for name in (
            "mass_kg",
            "axial_inertia_kg_m2",
            "transverse_inertia_kg_m2",
            "reference_area_m2",
            "reference_length_m",
        ):
            value = getattr(self, name)
            if not value > 0.0:
                raise InputError(f"{name} must be positive, got {value:g}")
        if not 0.0 < self.cg_m < self.shape.length_m:
            raise InputError(
                f"the centre of gravity must lie on the body: {self.cg_m:.4g} m is not between the nose tip "
                f"and the base at {self.shape.length_m:.4g} m"
            )
        if self.axial_inertia_kg_m2 > 2.0 * self.transverse_inertia_kg_m2:
            raise InputError(
                "no mass distribution has an axial inertia above twice the transverse one: "
                f"{self.axial_inertia_kg_m2:g} against {self.transverse_inertia_kg_m2:g} kg m2"
            )


def _constant(default: Any, unit: str, status: str, note: str) -> Any:
    return field(default=default, metadata={"unit": unit, "status": status, "note": note})


@dataclass(frozen=True)
class VehicleSettings:
    """Constants of the reference vehicle that the paper does not print.

    Layout and lengths were found by fitting the paper's Tables 4-6 (see ``docs/aerothermodynamics.md``); the
    mass properties are assumptions. :func:`constants_table` lists them with their status.
    """

    length_1_m: float = _constant(1.60, "m", "fitted", "axial length of the first cone")
    length_2_m: float = _constant(0.40, "m", "fitted", "axial length of the cylinder")
    length_3_m: float = _constant(0.70, "m", "fitted", "axial length of the flare")
    length_1_datum: Literal["tangent_point", "nose_tip"] = _constant(
        "tangent_point", "", "inferred", "where length_1_m starts; nose_tip makes tangency a real constraint"
    )
    mass_kg: float = _constant(1000.0, "kg", "assumed", "ballistic coefficient near 5.4e3 kg/m2")
    cg_fraction: float = _constant(0.55, "", "assumed", "centre of gravity over total length, from the nose")
    axial_inertia_kg_m2: float | None = _constant(
        None, "kg m2", "assumed", "none: a uniform solid of this mass"
    )
    transverse_inertia_kg_m2: float | None = _constant(
        None, "kg m2", "assumed", "none: a uniform solid of this mass"
    )
    reference: Literal["largest", "base", "fixed"] = _constant(
        "largest",
        "",
        "inferred",
        "coefficients refer to the largest section, to the base, or to the two values below",
    )
    reference_area_m2: float = _constant(1.0973, "m2", "fitted", "used with reference = fixed")
    reference_length_m: float = _constant(1.1820, "m", "fitted", "used with reference = fixed")

    def __post_init__(self) -> None:
        check_fields(self)
        if not 0.0 < self.cg_fraction < 1.0:
            raise InputError(
                f"the centre of gravity must lie on the body: cg_fraction {self.cg_fraction:g} is not "
                "between 0 (nose tip) and 1 (base)"
            )


def constants_table() -> list[dict[str, Any]]:
    """Name, value, unit, status (fitted, inferred or assumed) and meaning of every constant, in order."""
    return [{"name": f.name, "value": f.default, **f.metadata} for f in fields(VehicleSettings)]


def tangency_margin_m(
    theta_c1_deg: float, theta_c2_deg: float, nose_radius_m: float, **settings: Any
) -> float:
    """Axial distance from the nose's tangent point to the first crank; negative when the shape is impossible.

    The paper's inequality constraint. With lengths counted from the tangent point it equals ``length_1_m``;
    with ``length_1_datum = "nose_tip"`` it is length_1_m - Rn (1 - sin theta_c1).

    Parameters
    ----------
    theta_c1_deg, theta_c2_deg, nose_radius_m : float
        The design variables.
    **settings
        Overrides of :class:`VehicleSettings`.
    """
    constants = _settings(settings)
    check_numbers(theta_c1_deg=theta_c1_deg, theta_c2_deg=theta_c2_deg, nose_radius_m=nose_radius_m)
    if constants.length_1_datum == "tangent_point":
        return constants.length_1_m
    return constants.length_1_m - nose_radius_m * (1.0 - math.sin(math.radians(theta_c1_deg)))


def reference_vehicle(
    theta_c1_deg: float, theta_c2_deg: float, nose_radius_m: float, **settings: Any
) -> Vehicle:
    """Sphere-cone-cylinder-flare of the paper's Figure 1.

    Parameters
    ----------
    theta_c1_deg, theta_c2_deg : float
        Half-angles of the first cone and of the flare.
    nose_radius_m : float
        Radius of the spherical nose.
    **settings
        Overrides of :class:`VehicleSettings`.

    Returns
    -------
    Vehicle

    Raises
    ------
    InputError
        For a shape that cannot exist, with its reason, and for an unknown setting.
    """
    constants = _settings(settings)
    margin = tangency_margin_m(theta_c1_deg, theta_c2_deg, nose_radius_m, **settings)
    if not margin > 0.0:
        raise InputError(
            f"the spherical nose cannot be tangent to the first cone: with radius {nose_radius_m:g} m and "
            f"half-angle {theta_c1_deg:g} deg its tangent point lies {-margin:.4g} m behind the first crank"
        )
    if not nose_radius_m > 0.0:
        raise InputError(f"nose_radius_m must be positive, got {nose_radius_m:g}")
    shape = BodyShape(
        nose_radius_m,
        (
            cone(theta_c1_deg, margin),
            cylinder(constants.length_2_m),
            flare(theta_c2_deg, constants.length_3_m),
        ),
    )
    return vehicle_from_shape(shape, constants)


def vehicle_from_shape(shape: BodyShape, constants: VehicleSettings | None = None) -> Vehicle:
    """Give any shape the mass model and references of ``constants`` (its lengths are not used)."""
    c = constants or VehicleSettings()
    axial_m, transverse_m = uniform_gyration_radii_m(shape)
    axial = c.axial_inertia_kg_m2
    transverse = c.transverse_inertia_kg_m2
    radius_m = shape.base_radius_m if c.reference == "base" else shape.largest_radius_m
    fixed = c.reference == "fixed"
    return Vehicle(
        shape=shape,
        mass_kg=c.mass_kg,
        cg_m=c.cg_fraction * shape.length_m,
        axial_inertia_kg_m2=c.mass_kg * axial_m**2 if axial is None else axial,
        transverse_inertia_kg_m2=c.mass_kg * transverse_m**2 if transverse is None else transverse,
        reference_area_m2=c.reference_area_m2 if fixed else math.pi * radius_m**2,
        reference_length_m=c.reference_length_m if fixed else 2.0 * radius_m,
    )


def _settings(overrides: dict[str, Any]) -> VehicleSettings:
    """Check the overrides once for each set of them: a search asks for a margin 100,000 times."""
    try:
        return _checked_once(**overrides)
    except TypeError:  # one of them cannot be looked up, a list for example: the check says which
        return _checked_once.__wrapped__(**overrides)


@lru_cache(maxsize=64, typed=True)
def _checked_once(**overrides: Any) -> VehicleSettings:
    unknown = sorted(set(overrides) - {f.name for f in fields(VehicleSettings)})
    if unknown:
        known = ", ".join(f.name for f in fields(VehicleSettings))
        raise InputError(f"unknown vehicle setting {', '.join(unknown)}; known: {known}")
    return VehicleSettings(**overrides)
