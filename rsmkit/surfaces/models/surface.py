"""What every surface can do, whatever model is behind it."""

from __future__ import annotations

from typing import Any, Literal, Protocol, overload, runtime_checkable

from numpy.typing import ArrayLike

from rsmkit.errors import RsmkitError
from rsmkit.language.space import Floats, Space

__all__ = ["IntervalKind", "Surface", "check_confidence"]

IntervalKind = Literal["prediction", "mean", "jackknife+"]
"""For one new run, for the expected response, or for one new run from errors at runs left out."""


@runtime_checkable
class Surface(Protocol):
    """A response as a function of the factors. Points have shape (n, k), natural units."""

    @property
    def form(self) -> str:
        """What its ``model.json`` calls it; :mod:`rsmkit.surfaces.kinds` knows how to read and report it."""
        ...

    @property
    def space(self) -> Space:
        """Factors the surface is a function of."""
        ...

    @property
    def response(self) -> str:
        """Name of the response."""
        ...

    @overload
    def predict(self, points: ArrayLike, interval: None = None) -> Floats: ...
    @overload
    def predict(
        self, points: ArrayLike, interval: float, kind: IntervalKind = "prediction"
    ) -> tuple[Floats, Floats, Floats]: ...
    def predict(
        self, points: ArrayLike, interval: float | None = None, kind: IntervalKind = "prediction"
    ) -> Floats | tuple[Floats, Floats, Floats]:
        """Predict the response, shape (n,); with `interval` (0.95) return (mean, low, high)."""
        ...

    def gradient(self, points: ArrayLike) -> Floats:
        """Derivatives by the factors in natural units, shape (n, k); zero for categorical factors."""
        ...

    def to_json(self) -> dict[str, Any]:
        """JSON values, with :attr:`form` as ``model``: they make the same surface again, to the last bit."""
        ...


def check_confidence(interval: float) -> None:
    """Refuse a confidence that is none."""
    if not 0.0 < interval < 1.0:
        raise RsmkitError(f"the confidence of an interval lies between 0 and 1, got {interval}")
