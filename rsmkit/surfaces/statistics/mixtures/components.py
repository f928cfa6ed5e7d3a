"""The mixture a surface is a model of: its components, their region, and pseudo-components."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from rsmkit.errors import RsmkitError
from rsmkit.language.equalities import Mixture
from rsmkit.language.scheffe import movable
from rsmkit.language.space import Floats, Space
from rsmkit.surfaces.estimation.coordinates import Coordinates
from rsmkit.surfaces.models.polynomial import PolynomialSurface

__all__ = [
    "Pseudo",
    "component_bounds",
    "mixture_of",
    "places_of",
    "pseudo_components",
    "pseudo_coordinates",
    "reference_blend",
]

ROUNDING = 1e-9
"""Share of the total that bounds of components differ by through rounding."""
MOST_COMPONENTS = 8
"""Up to so many components the mean of the corners of their region is the reference; of more, a middle."""


@dataclass(frozen=True)
class Pseudo:
    """Pseudo-components, in which a restricted region fills a simplex (Crosier, *Technometrics* 26, 1984).

    Parameters
    ----------
    kind : {"L", "U"}
        ``L``: zero at the least amount of each component, one where the others are at theirs. ``U``: zero at
        the greatest amount, one where the others are at theirs; the region stands upside down in it.
    bounds : array, shape (q,)
        Least or greatest amounts, natural units.
    length : float
        Amount that is one in pseudo-components; negative for U.
    """

    kind: Literal["L", "U"]
    bounds: Floats
    length: float


def mixture_of(surface: PolynomialSurface) -> Mixture:
    """The mixture of a surface with Scheffe terms.

    Raises
    ------
    RsmkitError
        If the surface is no model of a mixture.
    """
    names = {surface.space.names[j] for j in surface.terms.components}
    for mixture in surface.space.mixtures:
        if set(mixture.components) == names:
            return mixture
    raise RsmkitError(f"{surface.response}: the surface is no model of a mixture")


def places_of(surface: PolynomialSurface) -> list[int]:
    """Columns of the components, in the order of the mixture."""
    return [surface.space.names.index(name) for name in mixture_of(surface).components]


def component_bounds(space: Space, places: list[int]) -> tuple[Floats, Floats]:
    """Least and greatest amount that each component can have, shape (q,) each."""
    affine = space.affine
    low, high = (space.lows, space.highs) if affine is None else (affine.low, affine.high)
    return low[places], high[places]


def pseudo_components(surface: PolynomialSurface) -> Pseudo | None:
    """Pseudo-components of the bounds of a surface's space; None where they are the proportions.

    Of the two simplexes, about the region and upside down, the smaller one.
    """
    total = mixture_of(surface).total
    low, high = component_bounds(surface.space, places_of(surface))
    lower, upper = total - float(low.sum()), float(high.sum()) - total
    if low.max() <= ROUNDING * total and lower <= upper * (1 + ROUNDING):
        return None
    if upper > ROUNDING * total and upper < lower * (1 - ROUNDING):
        return Pseudo("U", high, -upper)
    return Pseudo("L", low, lower)


def pseudo_coordinates(surface: PolynomialSurface, pseudo: Pseudo) -> Coordinates | None:
    """Units of coefficients in pseudo-components; None where the model would be another one in them."""
    places = places_of(surface)
    if not movable(surface.terms)[places[0]]:
        return None
    low, high = np.array(surface.own_units.low), np.array(surface.own_units.high)
    low[places], high[places] = pseudo.bounds - pseudo.length, pseudo.bounds + pseudo.length
    return Coordinates(tuple(low.tolist()), tuple(high.tolist()))


def reference_blend(space: Space, places: list[int]) -> Floats:
    """Overall centroid: the mean of the corners of the region of the components, shape (q,)."""
    affine = space.affine
    if affine is None:
        return np.full(len(places), 1.0 / len(places))
    for group in affine.groups:
        columns = group.columns.tolist()
        if set(columns) == set(places) and len(places) <= MOST_COMPONENTS:
            return np.asarray(group.corners.mean(axis=0)[[columns.index(j) for j in places]])
    return np.asarray(affine.inner[places])
