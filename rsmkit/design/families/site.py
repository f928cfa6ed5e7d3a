"""Where a family makes its design: what it must respect besides its own options."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rsmkit.design.design import Design
from rsmkit.design.region import Margin
from rsmkit.errors import RsmkitError

__all__ = ["Site", "allowed", "needed_runs"]


@dataclass(frozen=True)
class Site:
    """A study's folder, and the constraints on its points.

    Parameters
    ----------
    folder : path
        Where the user's own tables and modules are.
    constraints : sequence of callable
        Margins: natural points, shape (n, k), to shape (n,); where any is negative no point may lie.
    """

    folder: Path = Path()
    constraints: Sequence[Margin] = ()


def allowed(design: Design, constraints: Sequence[Margin]) -> Design:
    """The design without the points that a constraint forbids.

    Raises
    ------
    RsmkitError
        When it forbids all of them.
    """
    keep = np.ones(len(design), bool)
    for constraint in constraints:
        keep &= np.asarray(constraint(design.points)) >= -1e-9
    if len(design) and not keep.any():
        raise RsmkitError("design: no point of the starting design satisfies the constraints (subject_to)")
    return design if keep.all() else design.select(np.flatnonzero(keep).tolist())


def needed_runs(options: Any) -> int:
    """The number of runs, which some designs cannot do without."""
    if options.runs is None:
        raise RsmkitError(f"design.runs is missing: a design of kind '{options.kind}' takes a number of runs")
    return int(options.runs)
