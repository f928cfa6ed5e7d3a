"""Judge a predicted optimum by its true run, and a refinement by what may still be gained.

The prediction interval alone is a lenient judge: with lack of fit in its residual it is wide, and a minimiser
looks for places where the surface is too optimistic. So three things are asked: is the value inside the
interval, is the error within the tolerance, and is the point better than the best run already known?
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.language.space import Floats, Value
from rsmkit.optimum.optimum import Candidate, Optimum, missed_words
from rsmkit.optimum.problem import Evaluation, Problem, joined, least_margins
from rsmkit.verification.flown import Flown
from rsmkit.verification.options import VerifyOptions
from rsmkit.verification.pure_error import Sampled, merged, pure_error
from rsmkit.verification.refinement.certainty import worth_having
from rsmkit.verification.rivals import Predictor, best_known, find_rivals, spreads
from rsmkit.verification.verdicts import Case, Truth, judge
from rsmkit.verification.verification import (
    BestKnown,
    Comparison,
    Confirmation,
    ConstraintCheck,
    SimulatorRuns,
    place_words,
)

__all__ = ["Predictor", "RefinedVerdict", "best_known", "judge_optimum", "judge_refinement"]


@dataclass(frozen=True)
class RefinedVerdict:
    """What a refinement has settled: the word, and the sentence with its numbers.

    ``SETTLED``: the best point satisfies every constraint, and nothing worth having may still be gained
    anywhere. ``NOT SETTLED``: it satisfies every constraint, but more may be gained, or nothing is known of
    that. ``INFEASIBLE``: no run satisfies every constraint.
    """

    verdict: Literal["SETTLED", "NOT SETTLED", "INFEASIBLE"]
    sentence: str


@checked
def judge_optimum(
    problem: Problem,
    optimum: Optimum,
    actual: Sequence[Any],
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
        The search's problem on the surfaces; its objectives and constraints are evaluated on the true
        responses.
    optimum : Optimum
        What the search found; ``optimum.candidates`` are the points to run.
    actual : sequence of mapping or Flown
        The simulator's responses at those points, in the same order; of a point that was run several times,
        or that failed, a :class:`Flown`.
    surfaces : mapping of str to Predictor
        Surface of each response; one without is compared with what the search promised, without an interval.
    design : Evaluation
        The runs the surfaces were fitted to: ``problem.evaluation(points, responses)``. Repeated points tell
        of noise.
    objective_surfaces : mapping of str to Predictor, optional
        Surfaces fitted to an objective's own values, by expression; they give its interval. The predicted
        value stays the expression of the response surfaces.
    options : VerifyOptions, optional
        Tolerance, confidence, and the stated noise of the objective (``refine.noise_sd``).

    Returns
    -------
    Confirmation
        Of the optimum; on a front, of its knee with the lowest point of each objective as ``extremes``.

    Raises
    ------
    RsmkitError
        When a run lacks a response, or one is not a finite number.
    """
    options = options or VerifyOptions()
    candidates = optimum.candidates
    if len(actual) != len(candidates):
        raise RsmkitError(
            f"search {optimum.name}: {len(candidates)} points to verify but {len(actual)} runs given"
        )
    flown = [item if isinstance(item, Flown) else Flown((item,)) for item in actual]
    for candidate, item in zip(candidates, flown, strict=True):
        _refuse_incomplete(optimum, candidate, item, surfaces)
    case = _case(problem, optimum, flown, surfaces, objective_surfaces or {}, design, options)
    first, *rest = [_confirm(case, *pair) for pair in zip(candidates, flown, strict=True)]
    spent = SimulatorRuns(len(design), sum(max(len(item.runs), 1) for item in flown))
    return replace(first, extremes=tuple(rest), simulator_runs=spent)


def judge_refinement(
    factors: Mapping[str, Value],
    objective: float,
    *,
    remaining_gain: float | None,
    feasible: bool,
    runs: int,
    spread: float = 0.0,
    failed_runs: int = 0,
    missed: Mapping[str, float] | None = None,
    desirability: float | None = None,
    unacceptable: str = "",
    standard_error: float | None = None,
    noise_sd: float = 0.0,
    gap: float | None = None,
    options: VerifyOptions | None = None,
) -> RefinedVerdict:
    """Say what a refinement has settled.

    Parameters
    ----------
    factors : mapping of str to value
        Its best point.
    objective : float
        The true value there.
    remaining_gain : float or None
        By how much at most the objective may still improve anywhere, with the confidence of the options; None
        when nothing is known of that.
    feasible : bool
        Whether the best point satisfies every constraint.
    runs : int
        Runs that the refinement spent.
    spread : float
        Of the objective over the first runs, median less least: a gain within the tolerance of this, or of
        the objective where that is larger, is none.
    failed_runs : int
        How many of the runs failed.
    missed : mapping of str to float, optional
        What an infeasible best point misses, and by how much.
    desirability : float, optional
        Overall desirability of the best point, 0..1, where that is what was searched for.
    unacceptable : str
        What reaches no desirability there, in words.
    standard_error : float, optional
        Of `objective`, when that is what noisy runs together tell of it.
    noise_sd : float
        Standard deviation of the objective at a repeated point: a gain within that cannot be seen in one run.
    gap : float, optional
        Half the width, in ranges of the factors, of the largest cube without a run.
    options : VerifyOptions, optional
        Tolerance and confidence.
    """
    options = options or VerifyOptions()
    failed = f", {failed_runs} of which failed" if failed_runs else ""
    value = f"{objective:.6g}" if desirability is None else f"overall desirability {desirability:.3f}"
    if standard_error is not None and desirability is None:
        value += f" +- {standard_error:.2g} (as all runs together tell it)"
    found = f"{value} at {place_words(factors)} after {runs} more runs{failed}"
    if not feasible:
        which = f"misses {missed_words(missed)}" if missed else "violates one"
        return RefinedVerdict(
            "INFEASIBLE", f"no run satisfies every constraint; the nearest: {found}, {which}"
        )
    if unacceptable:
        return RefinedVerdict(
            "INFEASIBLE", f"no run reaches any desirability; the nearest: {found}, where {unacceptable}"
        )
    if remaining_gain is None:
        return RefinedVerdict(
            "NOT SETTLED", f"{found}; nothing is known of what may still be gained elsewhere"
        )
    sure = f"with {100 * options.confidence:g} % confidence"
    left = f"{sure} at most {remaining_gain:.3g} may still be gained anywhere"
    worth = worth_having(objective, spread, options.tolerance_pct)
    if remaining_gain <= max(worth, noise_sd):
        if remaining_gain > worth:
            left += f", less than the noise of one run (standard deviation {noise_sd:.3g})"
        if gap is not None:
            left += (
                f", dips narrower than the gaps between runs (up to +-{100 * gap:.2g} % of the ranges) apart"
            )
        return RefinedVerdict("SETTLED", f"{found}; {left}")
    scale = worth / (options.tolerance_pct / 100.0)
    return RefinedVerdict(
        "NOT SETTLED",
        f"{found}; {left}, more than the {options.tolerance_pct:g} % allowed ({scale:.3g} is 100 %)",
    )


def _refuse_incomplete(
    optimum: Optimum, candidate: Candidate, item: Flown, surfaces: Mapping[str, Predictor]
) -> None:
    for run in item.runs:
        for name in (*surfaces, *candidate.responses):
            if not math.isfinite(run.get(name, math.nan)):
                where = optimum.space.values(candidate.point)
                raise RsmkitError(f"search {optimum.name}: the run at {where} gave no {name}")


def _case(
    problem: Problem,
    optimum: Optimum,
    flown: Sequence[Flown],
    surfaces: Mapping[str, Predictor],
    objective_surfaces: Mapping[str, Predictor],
    runs: Evaluation,
    options: VerifyOptions,
) -> Case:
    design, counts, repeated = merged(problem, runs)
    names = list(runs.responses)
    groups = [run.responses for run in repeated]
    groups += [
        {name: np.array([run.get(name, math.nan) for run in item.runs]) for name in names} for item in flown
    ]
    sampled = {name: surface for name, surface in surfaces.items() if isinstance(surface, Sampled)}
    noise = pure_error(groups, names, options.refine.noise_sd or 0.0, sampled)
    rivals = find_rivals(problem, design, counts, noise, surfaces, options.confidence)
    return Case(
        problem,
        optimum,
        surfaces,
        objective_surfaces,
        options,
        design,
        len(runs),
        noise,
        rivals,
        *spreads(problem, design),
    )


def _confirm(case: Case, candidate: Candidate, item: Flown) -> Confirmation:
    point = candidate.point[None]
    truth = _truth(case, point, item)
    responses = _compare_responses(case, candidate, truth)
    predicted = case.problem.evaluation(
        point, {name: np.array([c.predicted]) for name, c in responses.items()}
    )
    objectives = _compare_objectives(case, point, predicted, truth)
    constraints = tuple(
        ConstraintCheck(
            c.text, float(predicted.margins[0, j]), float(truth.known.margins[0, j]) if truth else None
        )
        for j, c in enumerate(case.problem.constraints)
    )
    far, near = _missed(case, constraints, truth) if truth else ({}, {})
    verdict, sentence = judge(case, objectives, far, near, truth, item.error)
    rivals = case.rivals.known.objectives
    single = len(objectives) == 1
    return Confirmation(
        name=case.optimum.name,
        point=candidate.label,
        factors=case.optimum.space.values(candidate.point),
        objectives=objectives,
        responses=responses,
        constraints=constraints,
        verdict=verdict,
        sentence=sentence,
        best_design=float(rivals[0, 0]) if single and len(rivals) else None,
        simulator_runs=SimulatorRuns(case.design_runs, max(len(item.runs), 1)),
        extremes=(),
        replicates=len(item.runs),
        missed={text: amount for text, amount in far.items() if math.isfinite(amount)} or None,
        best_known=_wished(case, _best_known(case, truth, {**far, **near})) if single else None,
    )


def _wished(case: Case, found: BestKnown | None) -> BestKnown | None:
    """Say the desirability of a point, where that is what was searched for."""
    return found and replace(found, desirability=case.optimum.as_desirability(found.objective))


def _truth(case: Case, point: Floats, item: Flown) -> Truth | None:
    """What the simulator says of a point; None where every run failed."""
    if not item.runs:
        return None
    names = dict.fromkeys(name for run in item.runs for name in run)
    means = {
        name: np.array([np.mean([run[name] for run in item.runs])])
        for name in names
        if all(name in run for run in item.runs)
    }
    known = case.problem.evaluation(point, means)
    runs = np.array([len(item.runs)])
    errors, margin_errors = case.noise.half_widths(case.problem, known, runs, case.options.confidence)
    return Truth(known, errors[0], margin_errors[0], len(item.runs))


def _compare_responses(case: Case, candidate: Candidate, truth: Truth | None) -> dict[str, Comparison]:
    found = {}
    for name in dict.fromkeys((*case.surfaces, *candidate.responses)):
        low = high = None
        if name in case.surfaces:
            mean, low, high = case.surfaces[name].predict(
                candidate.point[None], interval=case.options.confidence
            )
        found[name] = Comparison(
            float(mean[0]) if name in case.surfaces else candidate.responses[name],
            float(truth.known.responses[name][0]) if truth else None,
            None if low is None else _finite(low),
            None if high is None else _finite(high),
            case.response_spreads.get(name) or None,
        )
    return found


def _compare_objectives(
    case: Case, point: Floats, predicted: Evaluation, truth: Truth | None
) -> dict[str, Comparison]:
    found = {}
    for j, text in enumerate(case.optimum.minimize):
        own = case.objective_surfaces.get(text)
        low = high = None
        if own:
            _, low, high = own.predict(point, interval=case.options.confidence)
        elif len(moved := case.problem.objectives[j].names & set(case.surfaces)) == 1:
            low, high = _ends(case, point, predicted, j, *moved)
        found[text] = Comparison(
            float(predicted.objectives[0, j]),
            float(truth.known.objectives[0, j]) if truth else None,
            None if low is None else _finite(low),
            None if high is None else _finite(high),
            float(case.spreads[j]) or None,
            float(truth.errors[j]) or None if truth else None,
        )
    return found


def _ends(
    case: Case, point: Floats, predicted: Evaluation, j: int, name: str
) -> tuple[Floats, Floats] | tuple[None, None]:
    """Interval of an objective that one response alone moves, when that is a count: its own, put through."""
    surface = case.surfaces[name]
    if not isinstance(surface, Sampled):
        return None, None
    ends = [
        case.problem.evaluation(point, {**predicted.responses, name: end}).objectives[:, j]
        for end in surface.predict(point, interval=case.options.confidence)
    ]
    return np.min(ends, axis=0), np.max(ends, axis=0)


def _finite(limit: Floats) -> float | None:
    """One end of an interval; none when the fit has no degrees of freedom left to tell."""
    return float(limit[0]) if math.isfinite(limit[0]) else None


def _missed(
    case: Case, checks: Sequence[ConstraintCheck], truth: Truth
) -> tuple[dict[str, float], dict[str, float]]:
    """Constraints that the true run misses by more than the tolerance, and those that it misses by less.

    The tolerance is in percent of the constraint's largest term; a limit of zero has no size of its own, so
    there is none. Rounding and noise are forgiven everywhere.
    """
    values = {**case.problem.cheap_values(truth.known.points), **truth.known.responses}
    forgiven = truth.margin_errors - least_margins(case.design)
    far, near = {}, {}
    for check, constraint, room in zip(checks, case.problem.constraints, forgiven.tolist(), strict=True):
        size = max(float(np.abs(term(values)).max()) for term in constraint.margin.terms())
        miss = math.inf if check.actual is None or math.isnan(check.actual) else -check.actual
        if miss > room + case.options.tolerance_pct / 100.0 * size:
            far[check.text] = miss
        elif miss > room:
            near[check.text] = miss
    return far, near


def _best_known(case: Case, truth: Truth | None, missed: Mapping[str, float]) -> BestKnown | None:
    """The best point of which the simulator has been asked; where none is feasible, the nearest."""
    space, rivals = case.problem.space, case.rivals.known
    beaten = truth is not None and case.rivals.beat(truth.known.objectives[0], truth.errors, case.spreads)
    if truth and not missed and not beaten:
        where = space.values(truth.known.points[0])
        return BestKnown("verified optimum", where, float(truth.known.objectives[0, 0]))
    if len(rivals):
        return BestKnown("design run", space.values(rivals.points[0]), float(rivals.objectives[0, 0]))
    return _nearest(case, truth)


def _nearest(case: Case, truth: Truth | None) -> BestKnown | None:
    """The run with the least violation, relative to the sizes of the margins."""
    space = case.problem.space
    inside = case.design.rows(space.contains(case.design.points))
    known = joined(truth.known, inside) if truth else inside
    known = known.rows(np.isfinite(np.hstack([known.objectives, known.margins])).all(axis=1))
    if not len(known):
        return None
    short = np.maximum(0.0, -known.margins)
    sizes = np.abs(known.margins).max(axis=0)
    row = int((short / np.where(sizes > 0, sizes, 1.0)).max(axis=1, initial=0.0).argmin())
    texts = [constraint.text for constraint in case.problem.constraints]
    missed = {text: amount for text, amount in zip(texts, short[row].tolist(), strict=True) if amount > 0}
    source: Literal["verified optimum", "design run"] = "design run"
    if truth and np.array_equal(known.points[row], truth.known.points[0]):
        source = "verified optimum"
    return BestKnown(source, space.values(known.points[row]), float(known.objectives[row, 0]), missed or None)
