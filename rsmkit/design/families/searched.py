"""Designs without a starting design: every point is searched for, by a criterion or for its distance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from rsmkit.design.design import Design
from rsmkit.design.families.site import Site
from rsmkit.design.options import Problems, SearchedOptions
from rsmkit.language.space import Space

__all__ = ["MaximinOptions", "OptimalOptions", "no_points"]


@dataclass(frozen=True, kw_only=True)
class OptimalOptions(SearchedOptions):
    """All points are the best for estimating the model, by the criterion."""


@dataclass(frozen=True, kw_only=True)
class MaximinOptions(SearchedOptions):
    """All points are spread, each as far from the others as can be."""

    spreads: ClassVar[bool] = True
    fills: ClassVar[bool] = True

    def problems(self) -> Problems:
        """Report what is wrong beyond types."""
        found = super().problems()
        if self.criterion not in ("D", "maximin"):
            found.append(("criterion", f"'{self.criterion}' goes with kind = 'optimal', not with 'maximin'"))
        return found


def no_points(space: Space, options: SearchedOptions, site: Site) -> Design:
    """The empty design that a search begins from."""
    return Design(space, np.empty((0, len(space))), ())
