"""Refinement on the true simulator, wave by wave, until nothing is left to gain or the budget is spent."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits

from rsmkit.io.arguments import checked
from rsmkit.optimum.problem import Evaluation, Problem
from rsmkit.verification.options import RefineOptions
from rsmkit.verification.refinement.front_search import FrontSearch
from rsmkit.verification.refinement.models.cube import Cube
from rsmkit.verification.refinement.noise import fitted_sd, repeated_sd
from rsmkit.verification.refinement.refinement import Refinement, Wave
from rsmkit.verification.refinement.trust_search import TrustSearch

__all__ = ["refine_problem"]


@checked
def refine_problem(
    problem: Problem,
    start: Evaluation,
    options: RefineOptions | None = None,
    *,
    cost: int = 1,
    tolerance_pct: float = 2.0,
    deterministic: bool = True,
    on_wave: Callable[[Wave], None] | None = None,
) -> Refinement:
    """Refine an optimum, or a Pareto front, on the true simulator.

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
    cost : int
        Simulator runs that the evaluation of one point takes.
    tolerance_pct : float
        It goes on while more than so many percent of the objective or, where that is larger, of its spread
        over the first runs cannot be excluded with confidence as a further gain.
    deterministic : bool
        Whether the simulator repeats itself; if not, and where no point is repeated, noise is what no
        process explains.
    on_wave : callable, optional
        Called after every wave.

    Returns
    -------
    Refinement
        Its best point, of a front the knee, satisfies every constraint unless no run ever did.

    Raises
    ------
    RsmkitError
        Without any run to begin with.
    """
    options = options or RefineOptions()
    points = replace(options, max_runs=options.max_runs // cost)
    with threadpool_limits(limits=1):  # many small matrices: threads would only wait for each other
        if not deterministic and options.noise_sd is None and not repeated_sd(start):
            points = replace(points, noise_sd=fitted_sd(Cube(problem.space), start))
        search: TrustSearch | FrontSearch
        if len(problem.objectives) == 1:
            search = TrustSearch(problem, start, points, tolerance_pct)
        else:
            search = FrontSearch(problem, start, points)
        return _refine(search, options, len(start), cost, on_wave)


def _refine(
    search: TrustSearch | FrontSearch,
    options: RefineOptions,
    start_runs: int,
    cost: int,
    on_wave: Callable[[Wave], None] | None,
) -> Refinement:
    problem = search.problem
    waves: list[Wave] = []
    spent = 0
    reason = ""
    while not reason:
        left = (options.max_runs - spent) // cost
        points = search.ask(min(max(1, options.batch // cost), left)) if left else np.empty((0, 0))
        if not left:
            reason = f"the budget of {options.max_runs} runs is spent"
        elif not len(points):
            reason = "no further point could be proposed"
        else:
            waves.append(search.tell(problem.evaluate(points)))
            spent += cost * len(points)
            if on_wave:
                on_wave(waves[-1])
            reason = search.finished
    minimize = tuple(objective.text for objective in problem.objectives)
    subject_to = tuple(constraint.text for constraint in problem.constraints)
    settled = bool(search.finished)
    return Refinement(
        problem.space, minimize, subject_to, search.result, start_runs, tuple(waves), reason, settled, cost
    )
