"""From the ``[design]`` table of a study file to the design: the plan stage calls this."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rsmkit.design.composite import ccd
from rsmkit.design.optimal import augment
from rsmkit.design.options import DesignOptions
from rsmkit.design.region import Margin, Region, box
from rsmkit.design.table import Design
from rsmkit.errors import RsmkitError
from rsmkit.space import Space

__all__ = ["build_design"]

MIN_DISTANCE = 0.2
"""Distance that keeps the points of a design for a deterministic simulator apart, coded."""


def build_design(
    space: Space,
    options: DesignOptions,
    *,
    order: int = 2,
    constraints: Sequence[Margin] = (),
    workers: int = 1,
) -> Design:
    """Make the starting design and augment it.

    Parameters
    ----------
    space : Space
    options : DesignOptions
    order : int
        Order of the model the augmentation is optimal for.
    constraints : sequence of callable
        Margins: natural points, shape (n, k), to shape (n,); where any is negative no point is placed. Points
        of the starting design that break one are left out.
    workers : int
        Threads of the search; the design does not depend on it.

    Raises
    ------
    RsmkitError
        When the options contradict each other or the constraints leave no room.
    """
    if options.kind != "ccd":
        raise RsmkitError(f"design.kind: '{options.kind}' is not known; use 'ccd'")
    start = ccd(
        space,
        star=options.star,
        alpha=options.alpha,
        center=options.center,
        center_axial=options.center_axial,
    )
    start = _allowed(start, constraints)
    if options.augment_to is None:
        return start
    if options.criterion not in ("D", "A", "I"):
        raise RsmkitError(f"design.criterion: '{options.criterion}' cannot augment a design; use D, A or I")
    return augment(
        start,
        options.augment_to,
        terms=order,
        criterion=options.criterion,
        region=_region(start, options, constraints),
        min_distance=_min_distance(options),
        starts=options.starts,
        seed=options.seed,
        workers=workers,
    )


def _allowed(design: Design, constraints: Sequence[Margin]) -> Design:
    keep = np.ones(len(design), bool)
    for constraint in constraints:
        keep &= np.asarray(constraint(design.points)) >= -1e-9
    if not keep.any():
        raise RsmkitError("design: no point of the starting design satisfies the constraints (subject_to)")
    return design if keep.all() else design.select(keep)


def _region(design: Design, options: DesignOptions, constraints: Sequence[Margin]) -> Region:
    reach = 1.0
    if options.region == "stars":
        reach = max(1.0, float(np.abs(design.coded[:, design.space.numeric]).max()))
    return box(design.space, reach, constraints)


def _min_distance(options: DesignOptions) -> float:
    if options.min_distance is not None:
        return options.min_distance
    return 0.0 if options.replicates else MIN_DISTANCE
