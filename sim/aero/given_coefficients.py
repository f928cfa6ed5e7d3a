"""Aerodynamics given as numbers: constant coefficients or tables over Mach number.

The alternative to the surface methods of :mod:`sim.aero.aerodynamics` for bodies whose coefficients are
known: check cases, other people's vehicles, a point mass with a constant drag area.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cache
from typing import Any, NamedTuple

import numba
import numpy as np

from sim.aero.aerodynamics import (
    CA,
    CM_NOSE,
    CMQ,
    CN,
    ROLL_DAMPING,
    STAGNATION_HEAT_FLUX,
    XCP_M,
    YAW_DAMPING,
)
from sim.air.atmosphere import Floats, interval, piecewise_cubic
from sim.core.checks import is_number
from sim.core.compiled import MACHINE_CODE, kernel
from sim.core.errors import InputError
from sim.core.machine_code import Reference

__all__ = ["CoefficientModel", "GivenCoefficients", "coefficient_loads", "coefficients_address"]

Coefficient = float | tuple[Sequence[float], Sequence[float]]

SUTTON_GRAVES = 1.7415e-4  # kg^0.5/m, Earth


@dataclass(frozen=True)
class GivenCoefficients:
    """Aerodynamic coefficients; each a number, or a pair (Mach numbers, values) joined by smooth cubics.

    Moments are about the centre of gravity and use the reference length; slopes multiply the sine of the
    total angle of attack, so that a body force linear in the crosswind is exact.

    Attributes
    ----------
    drag : Coefficient
        CD, against the air-relative velocity.
    axial : Coefficient
        CA, along the body axis, positive aft.
    normal_slope, pitch_slope : Coefficient
        CN/sin(alpha) and Cm/sin(alpha), nose-up positive: a stable body has a negative pitch slope.
    roll_damping, pitch_damping, yaw_damping : Coefficient
        Per p b/2V, q c/2V, r b/2V, with the body rates relative to the rotating Earth.
    span_m : float, optional
        Length b of the roll and yaw terms; the reference length when None.
    nose_radius_m : float
        Gives the stagnation heat flux by Sutton-Graves (NASA TR R-376), cold wall; 0 for none.
    """

    drag: Coefficient = 0.0
    axial: Coefficient = 0.0
    normal_slope: Coefficient = 0.0
    pitch_slope: Coefficient = 0.0
    roll_damping: Coefficient = 0.0
    pitch_damping: Coefficient = 0.0
    yaw_damping: Coefficient = 0.0
    span_m: float | None = None
    nose_radius_m: float = 0.0

    def __post_init__(self) -> None:
        """Refuse what is not a coefficient."""
        for name in _TABULATED:
            _table(name, getattr(self, name))
        if np.any(_table("drag", self.drag)[1] < 0.0):
            raise InputError(f"drag must not be negative, got {self.drag!r}")
        for name in ("span_m", "nose_radius_m"):
            value = getattr(self, name)
            if not (is_number(value) and value >= 0.0) and not (name == "span_m" and value is None):
                raise InputError(f"{name} must be a number, not negative; got {value!r}")

    def model(self, reference_length_m: float) -> CoefficientModel:
        """Arrange the coefficients for the compiled integrator."""
        machs = {0.0, 100.0}
        for name in _TABULATED:
            machs |= {float(mach) for mach in _table(name, getattr(self, name))[0]}
        breaks = np.array(sorted(machs))
        cubics = np.empty((breaks.size - 1, len(_TABULATED), 4))
        for column, name in enumerate(_TABULATED):
            cubics[:, column, :] = _on_breaks(breaks, *_table(name, getattr(self, name)))
        span = reference_length_m if self.span_m is None else self.span_m
        return CoefficientModel(
            breaks, cubics, float(span), float(reference_length_m), float(self.nose_radius_m)
        )


_TABULATED = tuple(field.name for field in fields(GivenCoefficients))[:7]


class CoefficientModel(NamedTuple):
    """Coefficients as the compiled integrator reads them: cubics (m, 7, 4) of Mach between the breaks."""

    mach: Floats
    cubics: Floats
    span_m: float
    length_m: float
    nose_radius_m: float


def _table(name: str, value: Coefficient) -> tuple[Floats, Floats]:
    try:
        if isinstance(value, tuple):
            mach, values = (np.asarray(column, dtype=float) for column in value)
        else:
            mach, values = np.empty(0), np.array([float(value)])
    except (TypeError, ValueError):
        raise InputError(f"{name} must be a number, or (Mach numbers, values); not {value!r}") from None
    if isinstance(value, tuple) and not (
        mach.shape == values.shape and mach.ndim == 1 and mach.size >= 2 and np.all(np.diff(mach) > 0)
    ):
        raise InputError(f"{name}: give (Mach numbers, values) with Mach increasing and as many values")
    if not np.all(np.isfinite(values)) or not np.all((mach >= 0) & (mach <= 100)):
        raise InputError(f"{name}: values must be finite and Mach numbers between 0 and 100")
    return mach, values


def _on_breaks(breaks: Floats, mach: Floats, values: Floats) -> Floats:
    """Express one table on the union of all tables' Mach numbers; constant beyond its own ends."""
    cubics = np.zeros((breaks.size - 1, 4))
    if mach.size == 0:
        cubics[:, 0] = values[0]
        return cubics
    own = piecewise_cubic(mach, values, "smooth")
    for row, start in enumerate(breaks[:-1]):
        if start < mach[0] or start >= mach[-1]:
            cubics[row, 0] = values[0] if start < mach[0] else values[-1]
        else:
            i = int(np.searchsorted(mach, start, side="right")) - 1
            shifted = np.polynomial.Polynomial(own[i])(np.polynomial.Polynomial([start - mach[i], 1.0]))
            cubics[row, : shifted.coef.size] = shifted.coef
    return cubics


@kernel
def coefficient_loads(
    at: Reference[CoefficientModel],
    speed_m_s: float,
    mach: float,
    alpha_rad: float,
    density_kg_m3: float,
    place: Reference[Floats],
) -> None:
    """Fill the array in its `place` as :func:`.aerodynamics.loads_at` does."""
    model, out = at[0], place[0]
    i = interval(model.mach, mach)
    x = mach - model.mach[i]
    c = model.cubics[i]
    drag = c[0, 0] + x * (c[0, 1] + x * (c[0, 2] + x * c[0, 3]))
    axial = c[1, 0] + x * (c[1, 1] + x * (c[1, 2] + x * c[1, 3]))
    normal = c[2, 0] + x * (c[2, 1] + x * (c[2, 2] + x * c[2, 3]))
    pitch = c[3, 0] + x * (c[3, 1] + x * (c[3, 2] + x * c[3, 3]))
    roll_damping = c[4, 0] + x * (c[4, 1] + x * (c[4, 2] + x * c[4, 3]))
    pitch_damping = c[5, 0] + x * (c[5, 1] + x * (c[5, 2] + x * c[5, 3]))
    yaw_damping = c[6, 0] + x * (c[6, 1] + x * (c[6, 2] + x * c[6, 3]))
    sine, cosine = math.sin(alpha_rad), math.cos(alpha_rad)
    out[:] = 0.0
    out[CA] = axial + drag * cosine
    out[CN] = (normal + drag) * sine
    out[CM_NOSE] = pitch * sine
    out[XCP_M] = -pitch / (normal + drag) * model.length_m if normal + drag != 0.0 else 0.0
    out[CMQ] = 0.5 * pitch_damping
    out[ROLL_DAMPING], out[YAW_DAMPING] = 0.5 * roll_damping, 0.5 * yaw_damping
    if model.nose_radius_m > 0.0:
        out[STAGNATION_HEAT_FLUX] = (
            SUTTON_GRAVES * math.sqrt(density_kg_m3 / model.nose_radius_m) * speed_m_s**3
        )


@cache
def coefficients_address() -> int:
    """Address of the machine code of :func:`coefficient_loads`."""
    numbers: Any = numba
    number, pointer = numbers.float64, numbers.types.CPointer
    model = GivenCoefficients().model(1.0)
    kinds = (pointer(numbers.typeof(model)), *[number] * 4, pointer(number[::1]))
    return MACHINE_CODE.entry(coefficient_loads, *kinds, _nrt=False)
