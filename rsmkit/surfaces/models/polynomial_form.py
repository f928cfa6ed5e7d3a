"""How a polynomial surface is written in a file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from rsmkit.io.json_codec import left_out_if_none
from rsmkit.io.strict_types import Shape
from rsmkit.language.space import Floats, Space
from rsmkit.language.terms import Contrasts, Terms, space_levels
from rsmkit.surfaces.estimation.coordinates import Coordinates
from rsmkit.surfaces.estimation.fit_data import FitData
from rsmkit.surfaces.reading import FactorForm, LimitForm, fail, read_coordinates, read_space

__all__ = ["PolynomialForm"]

LARGEST_EXPONENT = 30
"""Of a term in a file; larger ones overflow."""


@dataclass(frozen=True, kw_only=True)
class PolynomialForm:
    """How a polynomial is written: what was fitted to what, and what came out in working coordinates."""

    model: str
    response: str
    factors: tuple[FactorForm, ...]
    terms: tuple[tuple[int, ...], ...]
    low: Annotated[Floats, Shape("factors")]
    high: Annotated[Floats, Shape("factors")]
    coefficients: Annotated[Floats, Shape("coefficients")]
    factor: Annotated[Floats, Shape("coefficients", "coefficients")]
    sigma: float | None
    runs: FitData
    note: str
    contrasts: Contrasts | None = left_out_if_none()
    components: tuple[int, ...] | None = left_out_if_none()
    considered: tuple[tuple[int, ...], ...] | None = left_out_if_none()
    limits: tuple[LimitForm, ...] | None = left_out_if_none()

    def fitted(self) -> tuple[Space, Terms, Coordinates, FitData]:
        """Give the parts that say what was fitted to what."""
        space = read_space(self.factors, self.limits)
        if any(len(row) != len(space) for row in self.terms):
            raise fail(f"terms should hold {len(space)} exponents each")
        if any(abs(exponent) > LARGEST_EXPONENT for row in self.terms for exponent in row):
            raise fail(f"terms should hold exponents of at most {LARGEST_EXPONENT}")
        terms = Terms(self.terms, space_levels(space), self.contrasts or "treatment", self.components or ())
        return space, terms, read_coordinates(self.low, self.high, space), self.runs.checked(space)
