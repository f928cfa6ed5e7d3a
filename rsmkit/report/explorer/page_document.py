"""The data of the explorer page as one JSON document."""

from __future__ import annotations

import ast
import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from rsmkit.design.design import Design
from rsmkit.errors import RsmkitError
from rsmkit.io.json_codec import to_json
from rsmkit.language.browser_formula import browser_formula
from rsmkit.language.conditions import Constraint, parse_conditions
from rsmkit.language.expression import parse_expression, parse_tree
from rsmkit.language.space import Floats, Space
from rsmkit.optimum.optimum import Optimum
from rsmkit.optimum.problem import Function
from rsmkit.report.explorer.fit_scene import fit_scene
from rsmkit.report.explorer.run_labels import rows_of, run_labels
from rsmkit.report.explorer.trade_off import trade_off
from rsmkit.report.findings import Findings
from rsmkit.report.replay import Replay
from rsmkit.runs.record.run_table import Runs
from rsmkit.surfaces.fitted_response import FittedResponse
from rsmkit.surfaces.kinds import page_model
from rsmkit.surfaces.models.surface import Surface
from rsmkit.surfaces.statistics.mixtures.directions import reference_point

__all__ = ["page_document", "stride"]

GRID_NODES = 4_000
"""Largest number of points at which a cheap function is tabulated for the page."""
MOST_NODES = 41
"""Nodes along one continuous factor of such a table."""
LOOKS = 200
"""Points at which it is looked whether a function depends on a factor."""
SHOWN_RUNS = 2_000
"""Runs that the page draws; of more, every so manieth is taken."""
_RELATIONS = (ast.LtE, ast.Lt, ast.GtE, ast.Gt)
NOT_SHOWN = (
    "diagnostics",
    "intervals",
    "terms_natural",
    "anova_terms",
    "equations",
    "ascent",
    "descent",
    "eigenvectors",
)
"""Parts of a surface's report that are large and that no view shows from there."""
REPLAY_ROWS = 600
"""Rows of a time table that the page keeps: a few per pixel of its chart."""


def stride(findings: Findings) -> int:
    """The page draws every so manieth run."""
    return max(1, math.ceil(len(findings.runs) / SHOWN_RUNS))


def page_document(findings: Findings) -> dict[str, Any]:
    """Collect everything the page shows as JSON values."""
    runs, surfaces, optima = findings.runs, findings.surfaces, findings.optima
    space = findings.space
    both = {**surfaces, **findings.objective_surfaces}
    packed: dict[str, int] = {}
    return {
        "study": findings.study_name,
        "factors": [_factor(space, j) for j in range(len(space))],
        "responses": [
            {
                "key": name,
                "title": findings.title(name),
                "model": _shared(page_model(surface), packed),
                "observed": _numbers(runs.y(name)[:: stride(findings)]),
            }
            for name, surface in surfaces.items()
        ],
        "objectives": [
            {
                "key": text,
                "title": _objective_title(text, optima),
                "formula": browser_formula(parse_expression(text)),
                "model": _shared(page_model(both[text]), packed) if text in both else None,
            }
            for text in dict.fromkeys(text for optimum in optima for text in _shown_objectives(optimum))
            if text not in surfaces
        ],
        "constraints": [
            {"text": text, "limits": list(_limits(text, space))}
            for text in dict.fromkeys(text for optimum in optima for text in _shown_constraints(optimum))
            if _constraints(text, space)
        ],
        "equalities": [
            {
                "text": equality.text,
                "terms": [[space.names.index(name), coefficient] for name, coefficient in equality.terms],
                "value": equality.value,
            }
            for equality in space.equalities
        ],
        "mixtures": [
            {
                "components": [space.names.index(name) for name in mixture.components],
                "total": mixture.total,
            }
            for mixture in space.mixtures
        ],
        "centre": _centre(space),
        "functions": {
            name: _table(space, function)
            for name, function in findings.functions.items()
            if any(name in names for names in _names_used(optima, space))
        },
        "points": runs.points[:: stride(findings)].tolist(),
        "kinds": _kinds(runs, findings.design)[:: stride(findings)],
        "searches": [optimum.to_json() for optimum in optima],
        "verification": to_json(findings.verification) if findings.verification else None,
        "uncertainty": to_json(findings.uncertainty) if findings.uncertainty else None,
        "refinements": to_json(findings.refinements),
        "reports": {name: _report(surface) for name, surface in both.items()},
        "trade_offs": {
            optimum.name: found
            for optimum in optima
            if (found := trade_off(findings, optimum, stride(findings))) is not None
        },
        "failed": [
            findings.space.values(point) for point in np.asarray(findings.failed_points, float).tolist()
        ],
        "run_labels": run_labels(findings)[:: stride(findings)],
        "fits": {name: _fit(findings, name, surface) for name, surface in both.items()},
        "settings": dict(findings.settings),
        "replays": [_replay(replay) for replay in findings.replays],
        "packed": list(packed),
    }


def _shared(model: dict[str, Any] | None, packed: dict[str, int]) -> dict[str, Any] | None:
    """Put the place among all packed factors for the factor of a model: the same runs and terms share one."""
    if model is None:
        return None
    if "inner" in model:
        return {**model, "inner": _shared(model["inner"], packed)}
    if "factor" not in model:
        return model
    place = packed.setdefault(model["factor"]["packed"], len(packed))
    return {**model, "factor": {**model["factor"], "packed": place}}


def _shown_objectives(optimum: Optimum) -> tuple[str, ...]:
    """Objectives among the page's quantities.

    A robust one is an average over points that the page does not visit; desirabilities are its goals.
    """
    return () if {"robust", "service", "desirability"} & set(optimum.settings) else optimum.minimize


def _shown_constraints(optimum: Optimum) -> tuple[str, ...]:
    """Constraints that the page can evaluate: those of a search in service are averages too."""
    return () if "service" in optimum.settings else optimum.subject_to


def _limits(text: str, space: Space) -> Iterator[dict[str, Any]]:
    """What each relation of a constraint limits, on which side, and where, so that the page can move it."""
    tree = parse_tree(text)
    sides, operators = [], []
    if isinstance(tree, ast.Compare) and all(isinstance(op, _RELATIONS) for op in tree.ops):
        sides, operators = [ast.unparse(side) for side in (tree.left, *tree.comparators)], tree.ops
    for i, constraint in enumerate(_constraints(text, space)):
        whole = {"subject": text, "formula": browser_formula(constraint.margin), "side": "low", "limit": 0.0}
        if not operators:  # a rule for categories: no number limits it
            yield whole
            continue
        is_rising = isinstance(operators[i], ast.LtE | ast.Lt)
        small, big = sides[i : i + 2] if is_rising else sides[i : i + 2][::-1]
        yield (
            _moved(big, "low", small)
            or _moved(small, "high", big)
            or {**whole, "subject": f"{big} - ({small})"}
        )


def _moved(subject: str, side: str, limit: str) -> dict[str, Any] | None:
    """Describe a subject between its limit and infinity; None where the limit is no number."""
    bound = parse_expression(limit)
    if bound.names:
        return None
    formula = browser_formula(parse_expression(subject))
    return {"subject": subject, "formula": formula, "side": side, "limit": float(bound({}))}


def _objective_title(text: str, optima: Sequence[Optimum]) -> str:
    """Name an objective after the first search for it alone, which is shorter than its formula."""
    return next((o.name for o in optima if o.minimize == (text,)), text)


def _constraints(text: str, space: Space) -> tuple[Constraint, ...]:
    """Inequalities of a text; none of an equality, which the space itself keeps."""
    return parse_conditions([text], categories=space.categories).constraints


def _names_used(optima: Sequence[Optimum], space: Space) -> Iterator[frozenset[str]]:
    """Names in each objective and constraint."""
    for optimum in optima:
        yield from (parse_expression(text).names for text in _shown_objectives(optimum))
        yield from (c.names for text in _shown_constraints(optimum) for c in _constraints(text, space))


def _factor(space: Space, j: int) -> dict[str, Any]:
    factor = space.factors[j]
    low, high = factor.low, factor.high
    if space.affine is not None:  # what the equalities leave of the bounds
        low, high = float(space.affine.low[j]), float(space.affine.high[j])
    return {
        "name": factor.name,
        "title": factor.title,
        "label": factor.label or factor.name,
        "unit": factor.unit,
        "numeric": factor.domain.is_numeric,
        "continuous": factor.domain.is_continuous,
        "low": low,
        "high": high,
        "levels": list(factor.levels),
    }


def _centre(space: Space) -> list[float] | None:
    """The middle of a space with equalities: the reference blend of its mixtures; None of a box."""
    if not space.equalities:
        return None
    middle = np.where(space.numeric, 0.5 * (space.lows + space.highs), 0.0)
    if space.mixtures:
        middle = reference_point(space, None)
    return [float(v) for v in space.clip(space.snap(middle[None]))[0]]


def _kinds(runs: Runs, design: Design | None) -> list[str]:
    known = {} if design is None else dict(zip(map(tuple, design.points.tolist()), design.kinds, strict=True))
    return [known.get(tuple(point), "run") for point in runs.points.tolist()]


def _table(space: Space, function: Function) -> dict[str, Any] | None:
    """Tabulate a function over the factors it depends on, row-major; None when they are too many.

    None as well where it cannot be had away from the equalities of the space, as a table has it.

    Categorical, integer and discrete factors get one node per value; the page interpolates between nodes.
    """
    try:
        return _tabulated(space, function)
    except RsmkitError:
        if space.affine is None:
            raise
        return None


def _tabulated(space: Space, function: Function) -> dict[str, Any] | None:
    used = _used_factors(space, function)
    per_axis = int(GRID_NODES ** (1.0 / max(1, len(used))))
    axes = [space.factors[j].domain.nodes(min(per_axis, MOST_NODES)) for j in used]
    if math.prod(map(len, axes)) > GRID_NODES or per_axis < 3:
        return None
    mesh = np.meshgrid(*axes, indexing="ij")
    grid = (
        np.stack(mesh, axis=-1).reshape(-1, len(used)) if used else np.empty((1, 0))
    )  # a constant: one node
    points = np.tile(_middle(space), (len(grid), 1))
    points[:, used] = grid
    return {"factors": used, "axes": [axis.tolist() for axis in axes], "values": _numbers(function(points))}


def _middle(space: Space) -> Floats:
    middle: Floats = space.clip(space.snap(0.5 * (space.lows + space.highs)[None]))[0]
    return middle


def _used_factors(space: Space, function: Function) -> list[int]:
    """Factors that make a difference to a function, as far as points spread over the box can tell."""
    spread = np.random.default_rng(0)
    points = space.snap(spread.uniform(space.lows, space.highs, (LOOKS, len(space))))
    other = space.snap(spread.uniform(space.lows, space.highs, (LOOKS, len(space))))
    before = np.asarray(function(points), float)
    used = []
    for j in range(len(space)):
        moved = points.copy()
        moved[:, j] = other[:, j]
        if not np.array_equal(before, np.asarray(function(moved), float), equal_nan=True):
            used.append(j)
    return used


def _measured(findings: Findings, name: str) -> list[bool]:
    """Which runs a surface was fitted to: by hand, not every response of a run is always measured."""
    of_table = name in findings.surfaces  # whose name may be any text
    needed = {name} if of_table else parse_expression(name).names & set(findings.surfaces)
    known = [np.isfinite(findings.runs.y(response)) for response in needed]
    return np.logical_and.reduce(known).tolist() if known else [True] * len(findings.runs)


def _report(surface: FittedResponse[Surface]) -> dict[str, Any]:
    """Statistics of a surface that the page shows; what is known of each run is in the Fit view's columns."""
    return {key: value for key, value in surface.report().items() if key not in NOT_SHOWN}


def _fit(findings: Findings, name: str, surface: FittedResponse[Surface]) -> dict[str, Any]:
    """What the Fit view shows of a surface."""
    every, labels = stride(findings), run_labels(findings)
    rows = rows_of(surface, findings.runs.points, _measured(findings, name))
    named = [labels[row] if row >= 0 else "–" for row in rows]
    drawn = [row // every if row >= 0 and row % every == 0 else -1 for row in rows]
    return fit_scene(surface, findings.choices.get(name), named, drawn)


def _replay(replay: Replay) -> dict[str, Any]:
    """Give at most about REPLAY_ROWS rows with the digits a picture needs."""
    rows = len(next(iter(replay.columns.values()), []))
    stride = max(1, math.ceil(rows / REPLAY_ROWS))
    kept = sorted({*range(0, rows, stride), max(0, rows - 1)})
    columns = {
        name: [None if values[i] is None else float(f"{values[i]:.7g}") for i in kept]
        for name, values in replay.columns.items()
    }
    return {"name": replay.name, "factors": dict(replay.factors), "columns": columns}


def _numbers(values: Floats) -> list[float | None]:
    return [value if math.isfinite(value) else None for value in np.asarray(values, float).tolist()]
