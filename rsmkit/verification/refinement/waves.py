"""Trust-region refinement: a few more true runs, where models promise most, until nothing is left to gain.

Each wave fits polynomials and Gaussian processes around the best run, ranks them by leave-one-out, and runs
the minimiser of each. The region follows the ratio of true to promised gain. Two rules keep it from stalling:
it never shrinks before it holds enough points to determine a quadratic, and leave-one-out is judged at points
of the region only.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.language.expression import Constraint
from rsmkit.language.space import Floats
from rsmkit.optimum.problem import FEASIBLE, Evaluation, Problem
from rsmkit.verification.options import RefineOptions
from rsmkit.verification.refinement.local_models import LocalModel, fit_polynomial, fit_process
from rsmkit.verification.refinement.refinement import Refinement, Wave
from rsmkit.verification.refinement.trust_region import TrustRegion, fill, minimise_model, scaled

__all__ = ["refine_problem"]

FIRST_HALF_WIDTH = 0.25
LARGEST_HALF_WIDTH = 0.5
SMALLEST_HALF_WIDTH = 2e-4


@checked
def refine_problem(
    problem: Problem,
    start: Evaluation,
    options: RefineOptions | None = None,
    *,
    on_wave: Callable[[Wave], None] | None = None,
) -> Refinement:
    """Refine the optimum of a scalar problem on the true simulator.

    Deterministic given the runs and the seed, so with an evaluator that remembers its runs (a journal) an
    interrupted refinement continues where it stopped when it is simply started again.

    Parameters
    ----------
    problem : Problem
        With the true simulator as evaluator; nan marks a failed run.
    start : Evaluation
        Runs already known: the design, the verified optima.
    options : RefineOptions, optional
        Batch, budget, noise, seed.
    on_wave : callable, optional
        Called after every wave.

    Returns
    -------
    Refinement
        Its best point satisfies every constraint unless no run ever did.

    Raises
    ------
    RsmkitError
        For several objectives, or too few runs to begin with.
    """
    options = options or RefineOptions()
    if len(problem.objectives) != 1:
        raise RsmkitError(
            "refinement takes one objective; choose a point of the front by a weighted sum first"
        )
    with threadpool_limits(limits=1):  # many small matrices: threads would only wait for each other
        return _refine(problem, start, options, on_wave)


def _refine(
    problem: Problem, start: Evaluation, options: RefineOptions, on_wave: Callable[[Wave], None] | None
) -> Refinement:
    state = _begin(problem, start, options)
    waves: list[Wave] = []
    reason = ""
    while not reason:
        wave, state = _wave(state, len(waves) + 1, min(options.batch, options.max_runs - state.spent))
        if wave is None:
            reason = "no further point could be proposed"
            break
        waves.append(wave)
        if on_wave:
            on_wave(wave)
        if state.quiet_waves >= 2 and state.quiet_runs >= _coefficients(problem):
            reason = f"the models promised no further gain in {state.quiet_waves} waves in a row"
        elif state.half_width < SMALLEST_HALF_WIDTH:
            reason = "the region has shrunk to nothing"
        elif state.spent >= options.max_runs:
            reason = f"the budget of {options.max_runs} runs is spent"
    return Refinement(problem.space, state.known.rows([state.best]), len(start), tuple(waves), reason)


@dataclass(frozen=True)
class _State:
    problem: Problem
    options: RefineOptions
    known: Evaluation
    merit: Floats
    best: int
    half_width: float
    tolerance: float
    spent: int = 0
    quiet_waves: int = 0
    quiet_runs: int = 0

    @property
    def center(self) -> Floats:
        point: Floats = self.known.points[self.best]
        return point


def _begin(problem: Problem, start: Evaluation, options: RefineOptions) -> _State:
    usable = np.isfinite(start.objectives[:, 0]) & np.isfinite(start.margins).all(axis=1)
    known = start.rows(usable)
    if options.noise_sd == 0:  # a repeated run of a deterministic simulator says nothing new
        known = known.rows(np.sort(np.unique(known.points, axis=0, return_index=True)[1]))
    if len(known) < len(problem.space) + 2 or not problem.space.contains(known.points).any():
        raise RsmkitError(
            f"refinement needs at least {len(problem.space) + 2} successful runs, one of them inside the "
            "bounds. Run: rsmkit evaluate"
        )
    objective = known.objectives[:, 0]
    tolerance = options.gain_tolerance * float(np.median(objective) - objective.min())
    merit = _merit(problem, known, options.noise_sd)
    return _State(problem, options, known, merit, int(merit.argmin()), 1.0, tolerance)


def _merit(problem: Problem, known: Evaluation, noise_sd: float) -> Floats:
    """Objective of feasible runs inside the bounds; all others rank behind, by violation.

    With noise the lowest value is mostly a lucky one, so the best runs are compared by their smoothed values.
    """
    objective = known.objectives[:, 0].copy()
    if noise_sd > 0:
        best = np.argsort(objective, kind="stable")[:80]
        unit = scaled(problem.space, known.points[best])
        model = fit_process(unit, objective[best], "rbf", noisy=True)
        if model is not None:
            objective[best] = model.predict(unit)
    size = np.maximum(np.abs(known.margins).max(axis=0, initial=0.0), 1e-300)
    violation = np.maximum(0.0, -known.margins / size).max(axis=1, initial=0.0)
    behind = objective.max() + (1.0 + violation) * (float(np.ptp(objective)) or 1.0)
    inside = problem.space.contains(known.points)
    merit: Floats = np.where(violation <= FEASIBLE, objective, behind)
    merit[~inside] = np.inf
    return merit


def _wave(state: _State, number: int, batch: int) -> tuple[Wave | None, _State]:
    """Propose, run and judge one batch."""
    problem, options = state.problem, state.options
    seed = options.seed + 1000 * number
    region = TrustRegion(problem, state.center, state.half_width)
    ranked = _ranked_models(state, region)
    proposals: list[Floats] = []
    promised = np.nan
    trusted = ranked[0][0].name if ranked else "no model"
    for objective, margins in ranked:
        found = minimise_model(region, objective, margins, seed)
        if found is None:
            continue
        point, value = found
        if np.isnan(promised):
            at_center = float(objective.predict(scaled(problem.space, state.center[None]))[0])
            promised = at_center - value
        proposals.append(point)
    well_poised = _coefficients(problem) + 6
    inside = int(region.contains(state.known.points).sum())
    chosen = _distinct(problem, state.known.points, proposals, 2e-3 * state.half_width)[:batch]
    taken = np.vstack([state.known.points, *[p[None] for p in chosen]])
    extra = fill(region, taken, batch - len(chosen), seed, well_poised=well_poised)
    points = np.vstack([*[p[None] for p in chosen], extra]) if len(chosen) or len(extra) else np.empty((0, 0))
    if not len(points):
        return None, state
    runs = problem.evaluate(points)
    trustworthy = inside >= _coefficients(problem) + 2
    after = _learn(state, runs)
    if not promised > state.tolerance:
        after = replace(after, quiet_waves=state.quiet_waves + 1, quiet_runs=state.quiet_runs + len(runs))
    else:
        after = replace(after, quiet_waves=0, quiet_runs=0)
    gain = float(state.merit[state.best] - after.merit[after.best])
    after, action = _resize(state, after, gain, promised, trustworthy)
    best = float(after.known.objectives[after.best, 0])
    wave = Wave(
        number, points, runs.objectives[:, 0], state.half_width, trusted, promised, gain, best, action
    )
    return wave, after


def _coefficients(problem: Problem) -> int:
    """Number of coefficients of a full quadratic in the numeric factors."""
    k = int(problem.space.numeric.sum())
    return (k + 1) * (k + 2) // 2


def _ranked_models(
    state: _State, region: TrustRegion
) -> list[tuple[LocalModel, dict[Constraint, LocalModel]]]:
    """Fit every competitor to the objective and the expensive constraints; the most credible first."""
    problem, known = state.problem, state.known
    same = region.contains(known.points, np.inf)
    unit = scaled(problem.space, known.points[same])
    center = scaled(problem.space, state.center[None])[0]
    distance = np.abs(unit - center).max(axis=1)
    inside = distance <= 1.25 * state.half_width
    expensive = [j for j, c in enumerate(problem.constraints) if c not in problem.cheap_constraints]
    values = np.column_stack([known.objectives[same], known.margins[same][:, expensive]])
    ranked: list[tuple[float, LocalModel, dict[Constraint, LocalModel]]] = []
    for fit, used in _competitors(state, unit, distance, inside):
        models = [fit(unit[used], column[used]) for column in values.T]
        good = [model for model in models if model is not None]
        judged = inside[used]
        if len(good) < len(models) or not judged.any():
            continue
        score = float(np.sqrt(np.mean(good[0].residuals[judged] ** 2)))
        margins = {problem.constraints[j]: model for j, model in zip(expensive, good[1:], strict=True)}
        ranked.append((score, good[0], margins))
    return [(objective, margins) for _, objective, margins in sorted(ranked, key=lambda item: item[0])]


Fit = Callable[[Floats, Floats], LocalModel | None]


def _competitors(
    state: _State, unit: Floats, distance: Floats, inside: NDArray[np.bool_]
) -> list[tuple[Fit, NDArray[np.intp]]]:
    """Ways to fit, each with the points it uses."""
    center = scaled(state.problem.space, state.center[None])[0]
    count = min(80, max(25, int((distance <= 3 * state.half_width).sum())))
    near = np.argsort(distance, kind="stable")[:count]
    everything = np.arange(len(unit))
    noisy = state.options.noise_sd > 0
    whole = state.half_width >= 1
    weights = (
        np.ones(len(unit)) if whole else np.maximum(1 - (distance / (1.6 * state.half_width)) ** 3, 0.05)
    )
    found: list[tuple[Fit, NDArray[np.intp]]] = [
        (lambda x, y: fit_process(x, y, "rbf", noisy=noisy), near),
        (lambda x, y: fit_process(x, y, "matern52", noisy=noisy), near),
    ]
    if inside.sum() > _coefficients(state.problem):
        found.append((lambda x, y: fit_polynomial(x, y, center, weights), everything))
    found.append((lambda x, y: fit_polynomial(x, y, center, weights, order=3), everything))
    return found


def _distinct(problem: Problem, known: Floats, proposals: Sequence[Floats], distance: float) -> list[Floats]:
    """Drop proposals that repeat a run or each other."""
    kept: list[Floats] = []
    for point in proposals:
        others = scaled(problem.space, np.vstack([known, *[p[None] for p in kept]]))
        if np.abs(others - scaled(problem.space, point[None])).max(axis=1).min() > distance:
            kept.append(point)
    return kept


def _learn(state: _State, runs: Evaluation) -> _State:
    """Add the successful runs and find the best point again."""
    good = runs.rows(np.isfinite(runs.objectives[:, 0]) & np.isfinite(runs.margins).all(axis=1))
    old = state.known
    known = Evaluation(
        np.vstack([old.points, good.points]),
        {name: np.r_[column, good.responses[name]] for name, column in old.responses.items()},
        np.vstack([old.objectives, good.objectives]),
        np.vstack([old.margins, good.margins]),
    )
    merit = _merit(state.problem, known, state.options.noise_sd)
    return replace(state, known=known, merit=merit, best=int(merit.argmin()), spent=state.spent + len(runs))


def _resize(
    before: _State, after: _State, gain: float, promised: float, trustworthy: bool
) -> tuple[_State, str]:
    """Apply the rules of the trust region; return the new state and the rule in words."""
    width = before.half_width
    if width >= 1:
        return replace(after, half_width=FIRST_HALF_WIDTH), "now around the best point"
    if gain > before.options.noise_sd:
        space = before.problem.space
        step = np.abs(scaled(space, after.center[None]) - scaled(space, before.center[None])).max()
        if promised > 0 and gain > 0.75 * promised and step > 0.9 * width:
            return replace(
                after, half_width=min(LARGEST_HALF_WIDTH, 1.6 * width)
            ), "region moved and enlarged"
        if step < 0.5 * width:
            return replace(after, half_width=0.5 * width), "region moved and halved"
        return after, "region moved"
    if not trustworthy:
        return after, "kept, too few points in it to trust a model"
    return replace(after, half_width=0.4 * width), "region shrunk"
