"""The rules by which one true run is judged, and the words for what comes out."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from rsmkit.language.expression import parse_expression
from rsmkit.language.space import Floats
from rsmkit.optimum.desirability import Desire
from rsmkit.optimum.optimum import Optimum, missed_words
from rsmkit.optimum.problem import Evaluation, Problem
from rsmkit.verification.options import VerifyOptions
from rsmkit.verification.pure_error import PureError
from rsmkit.verification.rivals import Predictor, Rivals
from rsmkit.verification.verification import ROUNDING, Comparison, Verdict

__all__ = ["Case", "Truth", "judge", "unacceptable"]

SMALL = 1e-3
"""A value below this share of the spread is too near zero for percentages of it."""


@dataclass(frozen=True)
class Case:
    """What all points of one search are judged by."""

    problem: Problem
    optimum: Optimum
    surfaces: Mapping[str, Predictor]
    objective_surfaces: Mapping[str, Predictor]
    options: VerifyOptions
    design: Evaluation
    design_runs: int
    noise: PureError
    rivals: Rivals
    spreads: Floats
    response_spreads: Mapping[str, float]


@dataclass(frozen=True)
class Truth:
    """The simulator's answer at one point: means of its runs, with half widths of their intervals."""

    known: Evaluation
    errors: Floats
    margin_errors: Floats
    runs: int


def judge(
    case: Case,
    objectives: Mapping[str, Comparison],
    missed: Mapping[str, float],
    nearly: Mapping[str, float],
    truth: Truth | None,
    error: str,
) -> tuple[Verdict, str]:
    """Give a point its verdict, and the sentence with its numbers.

    Parameters
    ----------
    case : Case
        The search, the runs it competes with, and the noise.
    objectives : mapping of str to Comparison
        Predicted against true.
    missed : mapping of str to float
        Constraints that the true run violates, and by how much.
    nearly : mapping of str to float
        Those that it misses by no more than the tolerance.
    truth : Truth or None
        None where the simulator failed.
    error : str
        Why it failed.
    """
    worst = max(
        objectives.values(), key=lambda c: math.inf if c.scaled_error_pct is None else c.scaled_error_pct
    )
    if truth is None:
        reason = f" ({error})" if error else ""
        return (
            "FAILED",
            f"the simulator fails at the predicted optimum{reason}; predicted {worst.predicted:.6g}",
        )
    told = _told(worst, truth.runs, case.optimum)
    if nearly:
        told += f", {missed_words(nearly)} missed, within the tolerance"
    if missed and case.optimum.missed:
        return "INFEASIBLE", f"{case.optimum.obstacles}; there the true run misses {missed_words(missed)}"
    if missed:
        return "NOT CONFIRMED", f"{told}; the true run violates {missed_words(missed)}"
    unwanted = _unwanted(case, truth)
    if unwanted and not (case.rivals.known.objectives < 0.0).any():
        if case.optimum.obstacles:
            told = "agrees" if unwanted in case.optimum.obstacles else f"says {unwanted}"
            return "INFEASIBLE", f"{case.optimum.obstacles}; the true run {told}"
        return "NOT CONFIRMED", f"the true run reaches no desirability: {unwanted}"
    if case.rivals.beat(truth.known.objectives[0], truth.errors, case.spreads):
        return "NOT CONFIRMED", f"{told}; {_how_much_worse(case, worst)}"
    better = _improvement(case, truth)
    return _confirmed_or_poor(case, objectives, told, better)


def _confirmed_or_poor(
    case: Case, objectives: Mapping[str, Comparison], told: str, better: str
) -> tuple[Verdict, str]:
    options = case.options
    interval = f"the {100 * options.confidence:g} % prediction interval"
    outside = any(c.inside is False for c in objectives.values())
    poor = ""
    if not all(c.within(options.tolerance_pct) for c in objectives.values()):
        poor = f", more than the {options.tolerance_pct:g} % allowed"
    elif not all(c.inside is not False or c.near(options.tolerance_pct) for c in objectives.values()):
        poor = f", outside {interval}"
    elif case.optimum.missed:
        poor = f", and feasible, where the surfaces miss {missed_words(case.optimum.missed)}"
    if poor:
        return "IMPROVED, MODEL POOR", f"{told}{poor}, yet {better}"
    judged = any(c.inside is not None for c in objectives.values())
    noise = any((c.scaled_error_pct or 0.0) > options.tolerance_pct for c in objectives.values())
    held = ", within the noise" if noise else ""
    held += f", {'outside' if outside else 'inside'} {interval}" if judged else ""
    return "CONFIRMED", f"{told}{held}, and {better}"


def _told(worst: Comparison, runs: int, optimum: Optimum) -> str:
    """Predicted, actual and how far apart, in words."""
    promised = optimum.as_desirability(worst.predicted)
    if promised is not None:
        found = optimum.as_desirability(worst.actual or 0.0)
        return f"predicted overall desirability {promised:.3f}, the true runs give {found:.3f} (0 to 1)"
    noise = ""
    if worst.margin_of_error:
        of = f"mean of {runs} runs" if runs > 1 else "one run"
        noise = f" +- {worst.margin_of_error:.2g} ({of})"
    actual = 0.0 if worst.actual is None else worst.actual
    return f"predicted {worst.predicted:.6g}, the simulator gives {actual:.6g}{noise}, {_error_words(worst)}"


def _error_words(worst: Comparison) -> str:
    scaled, spread = worst.scaled_error_pct, worst.spread or 0.0
    if scaled is None:
        return "an undefined error"
    if scaled <= 100 * ROUNDING:
        return "the same"
    of_spread = f"{scaled:.3g} % of the spread of the design runs"
    if abs(worst.actual or 0.0) >= spread:
        return f"{worst.error_pct:.3g} % off"
    if abs(worst.actual or 0.0) < SMALL * spread:
        return f"{of_spread} off"
    return f"{worst.error_pct:.3g} % off ({of_spread})"


def _how_much_worse(case: Case, worst: Comparison) -> str:
    best_of = f"the best of {case.design_runs} design runs"
    if len(case.optimum.minimize) > 1:
        return f"it is dominated by {best_of}"
    if not len(case.rivals):
        return f"it is worse than {best_of}"
    best, smoothed = float(case.rivals.known.objectives[0, 0]), _smoothed(case)
    if (raw := case.rivals.raw).size and raw.min() < best:  # one run far below what the surface says of it
        best, smoothed = float(raw.min()), ""
    share = _share((worst.actual or 0.0) - best, best, worst.spread or 0.0)
    return f"it is {share} worse than {best_of}{smoothed}"


def _improvement(case: Case, truth: Truth) -> str:
    if not len(case.rivals):
        return "no design run inside the bounds can be compared with it"
    if len(case.optimum.minimize) > 1:
        return f"no design run of {case.design_runs} dominates it"
    best, value = float(case.rivals.known.objectives[0, 0]), float(truth.known.objectives[0, 0])
    of = f"the best of {case.design_runs} design runs{_smoothed(case)}"
    spread = float(case.spreads[0])
    noise = math.hypot(float(case.rivals.errors[0, 0]), float(truth.errors[0]))
    if abs(value - best) <= ROUNDING * max(abs(best), spread) or (noise and abs(value - best) <= noise):
        return f"as good as {of}{', within the noise' if noise else ''}"
    if best == 0.0 and spread == 0.0:
        return f"not worse than {of} ({best:.6g})"
    return f"{_share(best - value, best, spread)} better than {of}"


def _smoothed(case: Case) -> str:
    return " as the surfaces smooth them" if case.noise.present else ""


def _share(difference: float, value: float, spread: float) -> str:
    """A difference in percent of a value, or of the spread where the value is nothing beside it."""
    if abs(value) < SMALL * spread or value == 0.0:
        return f"{100 * difference / spread:.3g} % of the spread" if spread else f"{difference:.3g}"
    return f"{100 * difference / abs(value):.3g} %"


def _unwanted(case: Case, truth: Truth) -> str:
    """Responses that are unacceptable in the true run, in words; empty without wishes or where all please."""
    return unacceptable(case.problem, case.optimum, truth.known)


def unacceptable(problem: Problem, optimum: Optimum, known: Evaluation) -> str:
    """Say which responses of the first run reach no desirability; empty where there are none."""
    values = {**problem.cheap_values(known.points), **known.responses}
    told = []
    for name, wish in optimum.settings.get("desirability", {}).items():
        desire = Desire(**wish)
        if name in values and float(parse_expression(desire.text(name))(values)[0]) == 0.0:
            told.append(desire.obstacle(name, float(values[name][0])))
    return " and ".join(told)
