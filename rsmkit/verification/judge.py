"""Judge a predicted optimum by its true run.

The prediction interval alone is a lenient judge: with lack of fit in its residual it is wide, and a minimiser
looks for places where the surface is too optimistic. So three things are asked: is the value inside the
interval, is the error within the tolerance, and is the point better than the best run already known?
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.language.space import Floats
from rsmkit.optimum.optimum import Candidate, Optimum
from rsmkit.optimum.pareto_front import nondominated
from rsmkit.optimum.problem import FEASIBLE, Evaluation, Problem
from rsmkit.verification.options import VerifyOptions
from rsmkit.verification.verification import (
    ROUNDING,
    Comparison,
    Confirmation,
    ConstraintCheck,
    SimulatorRuns,
    Verdict,
)

__all__ = ["Predictor", "best_known", "judge_optimum"]


class Predictor(Protocol):
    """A fitted surface, as far as verification needs it."""

    def predict(self, X: Floats, *, interval: float) -> tuple[Floats, Floats, Floats]:
        """Mean, low and high of one run at natural points (n, k), each shape (n,)."""
        ...


@checked
def judge_optimum(
    problem: Problem,
    optimum: Optimum,
    actual: Sequence[Mapping[str, float]],
    *,
    surfaces: Mapping[str, Predictor],
    design: Evaluation,
    objective_surfaces: Mapping[str, Predictor] | None = None,
    options: VerifyOptions | None = None,
) -> Confirmation:
    """Compare one search's optimum with the simulator.

    Parameters
    ----------
    problem : Problem
        The search's problem; its objectives and constraints are evaluated on the true responses.
    optimum : Optimum
        What the search found; ``optimum.candidates`` are the points to run.
    actual : sequence of mapping
        The simulator's responses at those points, in the same order.
    surfaces : mapping of str to Predictor
        Surface of each response; one without is compared with what the search promised, without an interval.
    design : Evaluation
        The runs the surfaces were fitted to: ``problem.evaluation(points, responses)``.
    objective_surfaces : mapping of str to Predictor, optional
        Surfaces fitted to an objective's own values, by expression; they give its interval. The predicted
        value stays the expression of the response surfaces.
    options : VerifyOptions, optional
        Tolerance and confidence.

    Returns
    -------
    Confirmation
        Of the optimum; on a front, of its knee with the lowest point of each objective as ``extremes``.

    Raises
    ------
    RsmkitError
        When a response is missing or not a finite number.
    """
    options = options or VerifyOptions()
    candidates = optimum.candidates
    if len(actual) != len(candidates):
        raise RsmkitError(
            f"search {optimum.name}: {len(candidates)} points to verify but {len(actual)} runs given"
        )
    confirmations = [
        _confirm(problem, optimum, candidate, run, surfaces, objective_surfaces or {}, design, options)
        for candidate, run in zip(candidates, actual, strict=True)
    ]
    first, *rest = confirmations
    spent = SimulatorRuns(len(design), len(confirmations))
    return replace(first, extremes=tuple(rest), simulator_runs=spent)


def best_known(problem: Problem, design: Evaluation) -> Evaluation:
    """Design runs that an optimum competes with: inside the bounds, feasible, not dominated."""
    finite = np.isfinite(design.objectives).all(axis=1)
    allowed = (design.margins >= _slack(design)).all(axis=1)
    inside = design.rows(finite & allowed & problem.space.contains(design.points))
    return inside.rows(nondominated(inside.objectives))


def _slack(design: Evaluation) -> Floats:
    """Least margin that still counts as satisfied, shape (c,): zero but for rounding."""
    slack: Floats = -FEASIBLE * np.abs(design.margins).max(axis=0, initial=0.0)
    return slack


def _confirm(
    problem: Problem,
    optimum: Optimum,
    candidate: Candidate,
    run: Mapping[str, float],
    surfaces: Mapping[str, Predictor],
    objective_surfaces: Mapping[str, Predictor],
    design: Evaluation,
    options: VerifyOptions,
) -> Confirmation:
    point = candidate.point[None]
    for name in (*surfaces, *candidate.responses):
        if not math.isfinite(run.get(name, math.nan)):
            raise RsmkitError(
                f"search {optimum.name}: the run at {optimum.space.values(candidate.point)} gave no {name}"
            )
    responses = {
        name: _compare(surface, point, float(run[name]), options.confidence)
        for name, surface in surfaces.items()
    }
    responses |= {
        name: Comparison(value, float(run[name]))
        for name, value in candidate.responses.items()
        if name not in surfaces
    }
    predicted = problem.evaluation(point, {name: np.array([c.predicted]) for name, c in responses.items()})
    true = problem.evaluation(point, {name: np.array([c.actual]) for name, c in responses.items()})
    objectives: dict[str, Comparison] = {}
    for j, text in enumerate(optimum.minimize):
        own = objective_surfaces.get(text)
        _, low, high = own.predict(point, interval=options.confidence) if own else (None, None, None)
        objectives[text] = Comparison(
            float(predicted.objectives[0, j]),
            float(true.objectives[0, j]),
            None if low is None else _finite(low),
            None if high is None else _finite(high),
        )
    constraints = tuple(
        ConstraintCheck(c.text, float(predicted.margins[0, j]), float(true.margins[0, j]))
        for j, c in enumerate(problem.constraints)
    )
    rivals = best_known(problem, design)
    allowed = options.tolerance_pct / 100 * _sizes(problem, point, run)
    violated = [c for c, room in zip(constraints, allowed, strict=True) if not c.actual >= -room]
    verdict, sentence = _judge(objectives, violated, rivals, true, options, len(design))
    single = len(objectives) == 1 and len(rivals) > 0
    return Confirmation(
        name=optimum.name,
        point=candidate.label,
        factors=optimum.space.values(candidate.point),
        objectives=objectives,
        responses=responses,
        constraints=constraints,
        verdict=verdict,
        sentence=sentence,
        best_design=float(rivals.objectives[0, 0]) if single else None,
        simulator_runs=SimulatorRuns(len(design), 1),
        extremes=(),
    )


def _sizes(problem: Problem, point: Floats, run: Mapping[str, float]) -> Floats:
    """Size of each constraint's largest term at a run, shape (c,): what a tolerance in percent refers to."""
    values = {**problem.cheap_values(point), **{name: np.array([value]) for name, value in run.items()}}
    return np.array(
        [max(float(np.abs(term(values)).max()) for term in c.margin.terms()) for c in problem.constraints]
    )


def _compare(surface: Predictor, point: Floats, actual: float, confidence: float) -> Comparison:
    mean, low, high = surface.predict(point, interval=confidence)
    return Comparison(float(mean[0]), actual, _finite(low), _finite(high))


def _finite(limit: Floats) -> float | None:
    """One end of an interval; none when the fit has no degrees of freedom left to tell."""
    return float(limit[0]) if math.isfinite(limit[0]) else None


def _judge(
    objectives: Mapping[str, Comparison],
    violated: Sequence[ConstraintCheck],
    rivals: Evaluation,
    true: Evaluation,
    options: VerifyOptions,
    design_runs: int,
) -> tuple[Verdict, str]:
    worst = max(objectives.values(), key=lambda c: math.inf if c.error_pct is None else c.error_pct)
    if worst.error_pct is None:
        error = "an undefined error"
    else:
        error = f"{worst.error_pct:.3g} % off" if worst.error_pct > 1e-6 else "the same"
    outside = [c for c in objectives.values() if c.inside is False]
    interval = f"the {100 * options.confidence:g} % prediction interval"
    told = f"predicted {worst.predicted:.6g}, the simulator gives {worst.actual:.6g}, {error}"
    if violated:
        check = violated[0]
        return "NOT CONFIRMED", f"{told}; the true run violates '{check.text}' by {-check.actual:.4g}: refine"
    rounded = rivals.objectives + ROUNDING * np.abs(rivals.objectives)
    dominated = (rivals.objectives <= true.objectives).all(axis=1) & (rounded < true.objectives).any(axis=1)
    if dominated.any():
        what = "is dominated by"
        if len(objectives) == 1:
            best = float(rivals.objectives[0, 0])
            share = f"{100 * (worst.actual - best) / abs(best):.2g} % " if best else ""
            what = f"is {share}worse than"
        return "NOT CONFIRMED", f"{told}; it {what} the best of {design_runs} design runs: refine"
    better = _improvement(objectives, rivals, true, design_runs)
    if not all(c.within(options.tolerance_pct) for c in objectives.values()):
        return (
            "IMPROVED, MODEL POOR",
            f"{told}, more than the {options.tolerance_pct:g} % allowed, yet {better}: refine",
        )
    if outside:
        return "IMPROVED, MODEL POOR", f"{told}, outside {interval}, yet {better}: refine"
    judged = any(c.inside is not None for c in objectives.values())
    return "CONFIRMED", f"{told}{f', inside {interval}' if judged else ''}, and {better}"


def _improvement(
    objectives: Mapping[str, Comparison], rivals: Evaluation, true: Evaluation, design_runs: int
) -> str:
    if not len(rivals):
        return "no design run inside the bounds can be compared with it"
    if len(objectives) > 1:
        return f"no design run of {design_runs} dominates it"
    best, value = float(rivals.objectives[0, 0]), float(true.objectives[0, 0])
    if abs(value - best) <= ROUNDING * abs(best):
        return f"as good as the best of {design_runs} design runs"
    if best == 0.0:
        return f"not worse than the best of {design_runs} design runs ({best:.6g})"
    return f"{100 * (best - value) / abs(best):.3g} % better than the best of {design_runs} design runs"
