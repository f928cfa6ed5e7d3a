"""A surface with its statistics: what fitting returns."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from html import escape
from typing import Any, ClassVar, Generic, TypeVar, get_args, overload

from rsmkit.errors import one_of
from rsmkit.io.arguments import checked
from rsmkit.language.space import Floats, Space
from rsmkit.surfaces.kinds import form_of, read_surface
from rsmkit.surfaces.models.surface import IntervalKind, Surface

__all__ = ["FittedResponse", "Surfaces", "surface_from_json", "with_statistics"]

S = TypeVar("S", bound=Surface, covariant=True)


@dataclass(frozen=True, eq=False)
class FittedResponse(Generic[S]):
    """One response as a function of the factors, with all that is known about how well it is described.

    Everything the surface offers can be asked for here: ``fitted.coefficients`` is
    ``fitted.surface.coefficients``.

    Parameters
    ----------
    surface : Surface
        The model: what it predicts, and the runs it was fitted to.
    """

    stands_for: ClassVar[str] = "surface"

    surface: S

    @property
    def form(self) -> str:
        """What ``model.json`` calls the surface."""
        return self.surface.form

    @property
    def space(self) -> Space:
        """Factors."""
        return self.surface.space

    @property
    def response(self) -> str:
        """Name of the response."""
        return self.surface.response

    @overload
    def predict(self, points: Any, interval: None = None) -> Floats: ...
    @overload
    def predict(
        self, points: Any, interval: float, kind: IntervalKind = "prediction"
    ) -> tuple[Floats, Floats, Floats]: ...
    def predict(
        self, points: Any, interval: float | None = None, kind: IntervalKind = "prediction"
    ) -> Floats | tuple[Floats, Floats, Floats]:
        """Predict the response.

        Parameters
        ----------
        points : array of shape (n, k), DataFrame, or mapping of str to values
            Natural units. Named columns are matched by name, whatever their order.
        interval : float, optional
            Confidence in (0, 1), for instance 0.95.
        kind : {"prediction", "mean", "jackknife+"}
            Interval for one new run, for the expected response, or for one new run from errors at runs left
            out.

        Returns
        -------
        mean : array, shape (n,)
        low, high : array, shape (n,)
            Only with `interval`.
        """
        x = self.space.table(points)
        if interval is None:
            return self.surface.predict(x)
        return self.surface.predict(x, interval, one_of("kind", kind, get_args(IntervalKind)))

    def gradient(self, points: Any) -> Floats:
        """Derivatives by the factors, natural units, shape (n, k); zero for categorical factors."""
        return self.surface.gradient(self.space.table(points))

    def report(self) -> dict[str, Any]:
        """All statistics as JSON values; the keys are described in ``docs/surfaces.md``."""
        return dict(self._report)

    def summary(self) -> str:
        """All statistics as text."""
        return form_of(self.surface).summary(self.surface, self._report)

    def to_json(self) -> dict[str, Any]:
        """JSON values of the surface; :func:`surface_from_json` makes the same again, to the last bit."""
        return self.surface.to_json()

    def to_form(self) -> dict[str, Any]:
        """Show how it is written among other things: as its surface alone."""
        return self.to_json()

    @cached_property
    def _report(self) -> dict[str, Any]:
        return form_of(self.surface).report(self.surface)

    def _repr_html_(self) -> str:
        html = form_of(self.surface).html
        return html(self.surface, self._report) if html else f"<pre>{escape(self.summary())}</pre>"

    def __getattr__(self, name: str) -> Any:
        if name == "surface" or name.startswith(
            "__"
        ):  # while it is copied or unpickled it has no surface yet
            raise AttributeError(name)
        return getattr(self.surface, name)


class Surfaces(dict[str, FittedResponse[Surface]]):
    """Fitted responses by name; a name that is none gets the nearest one."""

    def __missing__(self, name: str) -> FittedResponse[Surface]:
        return self[one_of("response", name, tuple(self))]

    def __repr__(self) -> str:
        return f"<Surfaces: {', '.join(self)}>"

    def _repr_html_(self) -> str:
        return "".join(f"<h4>{escape(name)}</h4>{fitted._repr_html_()}" for name, fitted in self.items())


def with_statistics(surface: Surface) -> FittedResponse[Surface]:
    """Give a surface its statistics, unless it has them already."""
    return surface if isinstance(surface, FittedResponse) else FittedResponse(surface)


@checked
def surface_from_json(document: Any) -> FittedResponse[Surface]:
    """Make a surface from what ``to_json`` returned.

    Raises
    ------
    RsmkitError
        If anything is missing, of the wrong type, or does not belong together.
    """
    return FittedResponse(read_surface(document))
