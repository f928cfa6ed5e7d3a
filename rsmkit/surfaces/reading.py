"""How surfaces stand in ``model.json``: what all their forms share, and statistics as JSON numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self, TypeVar

import numpy as np

from rsmkit.errors import DamagedError
from rsmkit.io.json_codec import Document, from_json
from rsmkit.language.equalities import Equality, Mixture
from rsmkit.language.space import Factor, Floats, Space, Value
from rsmkit.surfaces.estimation.coordinates import Coordinates

__all__ = [
    "FactorForm",
    "LimitForm",
    "ModelDocument",
    "fail",
    "number",
    "numbers",
    "read_coordinates",
    "read_form",
    "read_space",
    "write_limits",
    "write_space",
]

REMEDY = "Fit the surface again."

T = TypeVar("T")


def number(value: float) -> float | None:
    """JSON number, None for nan and infinities."""
    return float(value) if math.isfinite(value) else None


def numbers(values: Floats) -> list[float | None]:
    """JSON numbers, None for nan and infinities."""
    return [number(v) for v in np.asarray(values).tolist()]


def fail(message: str) -> DamagedError:
    """Make the error for a model that cannot be read."""
    return DamagedError("surface model", [message], REMEDY)


def read_form(form: type[T], document: Any) -> T:
    """Read JSON values into the class that shows how a surface is written.

    Raises
    ------
    DamagedError
        With every mistake.
    """
    return from_json(form, document, "surface model", REMEDY)


class ModelDocument(Document):
    """What is written in ``model.json``."""

    @classmethod
    def from_json(cls, document: Any) -> Self:
        """Read what :meth:`to_json` wrote, checking that it belongs together."""
        return read_form(cls, document)


@dataclass(frozen=True)
class FactorForm:
    """How a factor is written."""

    name: str
    low: float
    high: float
    label: str
    unit: str
    integer: bool
    levels: tuple[Value, ...]


def write_space(space: Space) -> tuple[FactorForm, ...]:
    """Give the forms of the factors."""
    return tuple(
        FactorForm(f.name, f.low, f.high, f.label, f.unit, f.integer, tuple(f.levels)) for f in space
    )


@dataclass(frozen=True)
class LimitForm:
    """How a mixture or a linear equality of factors is written."""

    coefficients: dict[str, float]
    value: float
    mixture: bool


def write_limits(space: Space) -> tuple[LimitForm, ...] | None:
    """Give the forms of the sums that the factors keep to; None without any."""
    forms = (
        LimitForm(dict(limit.equality.terms), limit.equality.value, isinstance(limit, Mixture))
        for limit in space.limits
    )
    return tuple(forms) or None


def read_space(factors: Sequence[FactorForm], limits: Sequence[LimitForm] | None = None) -> Space:
    """Inverse of :func:`write_space` and :func:`write_limits`."""
    space = Space(Factor(f.name, f.low, f.high, f.label, f.unit, f.integer, f.levels) for f in factors)  # type: ignore[arg-type]
    return space.limited(
        Mixture(tuple(form.coefficients), form.value)
        if form.mixture
        else Equality.of(form.coefficients, form.value)
        for form in limits or ()
    )


def read_coordinates(low: Floats, high: Floats, space: Space) -> Coordinates:
    """Make the working coordinates of a model, which span a range in every factor."""
    if len(low) != len(space) or len(high) != len(space) or not (low < high).all():
        raise fail("low should lie below high in every factor")
    return Coordinates(tuple(low.tolist()), tuple(high.tolist()))
