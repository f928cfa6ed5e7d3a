"""The study file's ``[functions]`` and design constraints as array functions."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from rsmkit.errors import RsmkitError
from rsmkit.language.conditions import Constraint
from rsmkit.language.space import Floats, Space
from rsmkit.runs.one_run.simulator import Simulator
from rsmkit.runs.options import SimulatorOptions
from rsmkit.study.file import Study

__all__ = ["cheap_functions", "check_functions", "design_constraints"]

Function = Callable[[Floats], Floats]


def cheap_functions(study: Study) -> dict[str, Function]:
    """Load the study's cheap quantities; each maps natural points, shape (n, k), to values, shape (n,).

    A function receives the factors and the simulator's settings as keywords, like the simulator itself.
    """
    settings = study.file.simulator.settings if study.file.simulator else {}
    return {
        name: _over_points(
            name, Simulator(SimulatorOptions(target), study.folder).load(), study.space, settings
        )
        for name, target in study.file.functions.items()
    }


def check_functions(study: Study) -> dict[str, float]:
    """Evaluate every cheap quantity at the centre, so that a broken one is found before runs are paid for.

    Returns
    -------
    dict of str to float
        Their values there.

    Raises
    ------
    RsmkitError
        If one cannot be loaded or gives no number.
    """
    center = study.space.clip(study.space.snap([factor.center for factor in study.space]))
    return {name: float(function(center)[0]) for name, function in cheap_functions(study).items()}


def design_constraints(study: Study) -> list[Function]:
    """Margins that every design point must keep at or above zero, as functions of natural points."""
    constraints = study.design_constraints()
    used = {name for constraint in constraints for name in constraint.names}
    functions = {name: f for name, f in cheap_functions(study).items() if name in used} if used else {}
    return [_margin(constraint, study.space, functions) for constraint in constraints]


def _margin(constraint: Constraint, space: Space, functions: Mapping[str, Function]) -> Function:
    def margin(points: Floats) -> Floats:
        x = np.atleast_2d(points)
        values = dict(zip(space.names, x.T, strict=True))
        values |= {name: functions[name](x) for name in constraint.names if name in functions}
        return np.broadcast_to(constraint.margin(values), len(x)).astype(float)

    return margin


def _over_points(name: str, call: Callable[..., Any], space: Space, settings: Mapping[str, Any]) -> Function:
    def over(points: Floats) -> Floats:
        return np.array([one(point) for point in np.atleast_2d(points)])

    def one(point: Floats) -> float:
        values = space.values(point)
        try:
            return float(call(**values, **settings))
        except Exception as error:
            raise RsmkitError(
                f"functions.{name} failed at {values}: {type(error).__name__}: {error}. "
                "A function receives every factor and every simulator setting as keywords, and must give one "
                "number for every point of the space."
            ) from None

    return over
