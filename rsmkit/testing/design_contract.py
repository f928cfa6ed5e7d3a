"""The contract of a design family: what the stages rely on, whatever the points are."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from rsmkit.design.build import build_design
from rsmkit.design.design import Design
from rsmkit.design.families.registry import design_options
from rsmkit.design.options import DesignOptions
from rsmkit.errors import RsmkitError
from rsmkit.language.space import Floats, Space

__all__ = ["check_design_family"]

OUTSIDE = ("axial", "given")
"""Kinds of points that may lie outside the bounds: stars on purpose, the user's own as they are."""
HOSTILE = (
    Space(a=(0.0, 1.0)),
    Space(tool=["A", "B", "C"]),
    Space(tool=["A", "B", "C"], size=[1.0, 2.0, 4.0], a=(0.0, 1.0)),
    Space(**{f"x{i}": (0.0, 1.0) for i in range(20)}),
)
"""Spaces that many families cannot serve: they may say so, in words."""


def check_design_family(
    kind: str,
    keys: Mapping[str, Any],
    space: Space,
    *,
    runs: int | None = None,
    folder: str | Path = ".",
) -> Design:
    """Assert that a design family keeps the contract of the register.

    Its options describe themselves and come back from the record of a plan. Its design is the same again for
    the same options, lies within the bounds (but for star points and the user's own), on the values that each
    factor can take, and in the part that a constraint leaves; it survives its table. A space that it cannot
    serve, and a number of runs that it cannot make, are refused with a message and nothing else.

    Parameters
    ----------
    kind : str
        What ``[design] kind`` would say; its family stands in the register
        (:data:`rsmkit.design.families.registry.FAMILIES`).
    keys : mapping
        What the table would say besides, for a design of `space`.
    space : Space
        Factors that the family can serve; mixed kinds make a sharper check.
    runs : int, optional
        Number of runs that must come out; what the options plan by default, if they do.
    folder : path
        Where the user's own files are that the options name.

    Returns
    -------
    Design

    Raises
    ------
    AssertionError
        Saying which part of the contract is broken.
    """
    options = design_options(kind, **keys)
    _check_options(options)
    design = build_design(space, options, folder=folder)
    again = build_design(space, options, folder=folder)
    assert design.points.tobytes() == again.points.tobytes(), "the same options give another design"
    assert (design.kinds, design.blocks) == (again.kinds, again.blocks), "the same options label it otherwise"
    expected = options.planned_runs if runs is None else runs
    assert expected is None or len(design) == expected, f"{len(design)} runs instead of {expected}"
    _check_points(design)
    _check_table(design)
    _check_constraint(space, options, design, folder)
    _check_refusals(options, space, folder)
    return design


def _check_options(options: DesignOptions) -> None:
    """Frozen, documented, sound, and the same again from the record of a plan."""
    kind = type(options)
    assert issubclass(kind, DesignOptions), f"{kind.__name__} is no class of options"
    parameters: Any = vars(kind)["__dataclass_params__"]
    assert parameters.frozen, f"{kind.__name__} is not frozen"
    undocumented = [item.name for item in fields(kind) if not item.metadata.get("doc")]
    assert not undocumented, f"keys without a line in the reference: {', '.join(undocumented)}"
    assert options.problems() == [], f"the options are refused: {options.problems()}"
    record = json.loads(json.dumps(options.record))
    kept: dict[str, Any] = {
        key: tuple(value) if isinstance(value, list) else value for key, value in record.items()
    }
    assert design_options(**kept) == options, f"the record loses options: {record}"
    found = replace(options, seed=-1).problems()
    assert any(key == "seed" for key, _ in found), "problems() leaves out those that all kinds have"


def _check_points(design: Design) -> None:
    """Inside the bounds, and on the values that each factor can take."""
    for point, kind in zip(design.points, design.kinds, strict=True):
        if kind not in OUTSIDE:
            assert design.space.contains(point[None, :]).all(), f"a {kind} point lies outside: {point}"
    inside = np.array([kind not in OUTSIDE for kind in design.kinds])
    snapped = design.space.snap(design.points)
    wrong = inside & ~np.isclose(snapped, design.points, rtol=1e-12, atol=1e-12).all(axis=1)
    assert not wrong.any(), f"a point that its factors cannot take: {design.points[wrong][0]}"


def _check_table(design: Design) -> None:
    """Written and read again, not a bit is lost."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "design.csv"
        design.to_csv(path)
        read = Design.from_csv(path, design.space)
    assert read.points.tobytes() == design.points.tobytes(), "points are lost in the table"
    assert (read.kinds, read.blocks) == (design.kinds, design.blocks), "labels are lost in the table"


def _check_constraint(space: Space, options: DesignOptions, design: Design, folder: str | Path) -> None:
    """No point where a constraint forbids it; here the first factor's upper part."""
    limit = float(np.median(design.points[:, 0]))

    def margin(points: Floats) -> Floats:
        return limit - points[:, 0]

    def nothing(points: Floats) -> Floats:
        return np.full(len(points), -1.0)

    part = _attempt(space, options, folder, margin)
    if part is not None:
        assert (margin(part.points) >= -1e-8).all(), "a point lies where a constraint forbids it"
    assert _attempt(space, options, folder, nothing) is None, "a design where no point is allowed"


def _check_refusals(options: DesignOptions, space: Space, folder: str | Path) -> None:
    """A space or a number of runs that cannot be served ends in an RsmkitError, never in another."""
    for hostile in HOSTILE:
        design = _attempt(hostile, options, folder)
        if design is not None:
            _check_points(design)
    if hasattr(options, "runs"):
        known: Any = options
        for runs in (1, 2, 3, 7):
            _attempt(space, replace(known, runs=runs), folder)


def _attempt(space: Space, options: DesignOptions, folder: str | Path, *constraints: Any) -> Design | None:
    """Make the design, or None when it is refused in words."""
    try:
        return build_design(space, options, constraints=constraints, folder=folder)
    except RsmkitError:
        return None
