"""Split-plot designs beside pyoptex, on its own examples: criterion reached, and CPU seconds.

    python benchmarks/split_plot_designs.py

pyoptex runs when it can be imported; it is no dependency of the project. The examples are those that come
with it (one hard and two easy factors in eight plots of four, two-factor interactions or the full second
order, D and A) and two larger ones. Criteria are computed here for both, with the ratio of variances 1.
"""

from __future__ import annotations

import contextlib
import io
import time
import warnings
from dataclasses import dataclass

import numpy as np

import rsmkit as rk
from rsmkit.language.terms import parse_terms

Matrix = np.ndarray


@dataclass(frozen=True)
class Problem:
    """One design: hard and easy factors, plots of equal size, model and criterion."""

    name: str
    hard: int
    easy: int
    plots: int
    runs: int
    model: str
    criterion: str
    ratio: float = 1.0


PROBLEMS = (
    Problem("interactions, 8 plots of 4", 1, 2, 8, 4, "tfi", "D"),
    Problem("the same", 1, 2, 8, 4, "tfi", "A"),
    Problem("second order, 8 plots of 4", 1, 2, 8, 4, "quad", "D"),
    Problem("second order, 5 plots of 4, ratio 0.1", 1, 2, 5, 4, "quad", "D", 0.1),
    Problem("second order, 6 plots of 4", 1, 2, 6, 4, "quad", "D"),
    Problem("second order, 12 plots of 4", 2, 4, 12, 4, "quad", "D"),
)


def names(problem: Problem) -> list[str]:
    """Hard factors first."""
    return [f"x{j + 1}" for j in range(problem.hard + problem.easy)]


def ours(problem: Problem, starts: int | None = None) -> Matrix:
    """The design with default options, or so many starts."""
    space = rk.Space(**dict.fromkeys(names(problem), (-1.0, 1.0)))
    terms = parse_terms(space, ["FO", "TWI"] if problem.model == "tfi" else ["SO"])
    design = rk.split_plot_design(
        space,
        [problem.runs] * problem.plots,
        names(problem)[: problem.hard],
        terms=terms,
        criterion=problem.criterion,
        ratio=problem.ratio,
        starts=starts,
    )
    return design.points[np.argsort(design.blocks, kind="stable")]


def theirs(problem: Problem, tries: int = 10) -> Matrix:
    """Ten tries, which are the default."""
    from pyoptex.doe.fixed_structure import Factor
    from pyoptex.doe.fixed_structure.splitk_plot import (
        Plot,
        create_parameters,
        create_splitk_plot_design,
        default_fn,
    )
    from pyoptex.doe.fixed_structure.splitk_plot.metric import Aopt, Dopt
    from pyoptex.utils.model import model2Y2X, partial_rsm_names

    run, plot = Plot(level=0, size=problem.runs), Plot(level=1, size=problem.plots, ratio=problem.ratio)
    factors = [
        Factor(name, plot if j < problem.hard else run, type="continuous")
        for j, name in enumerate(names(problem))
    ]
    model = model2Y2X(partial_rsm_names({factor.name: problem.model for factor in factors}), factors)
    goal = default_fn(factors, (Aopt if problem.criterion == "A" else Dopt)(), model)
    np.random.seed(1)  # noqa: NPY002 - its generator is the global one
    with contextlib.redirect_stderr(io.StringIO()), warnings.catch_warnings(action="ignore"):
        made = create_splitk_plot_design(create_parameters(factors, goal), n_tries=tries)
    return np.asarray(made[0], float)


def value(problem: Problem, points: Matrix) -> float:
    """Log det of the information (D, more is better), or the trace of its inverse (A, less is)."""
    space = rk.Space(**dict.fromkeys(names(problem), (-1.0, 1.0)))
    terms = parse_terms(space, ["FO", "TWI"] if problem.model == "tfi" else ["SO"])
    x = terms.matrix(points)
    plots = np.repeat(np.eye(problem.plots), problem.runs, axis=0)
    information = x.T @ np.linalg.solve(np.eye(len(x)) + problem.ratio * plots @ plots.T, x)
    if problem.criterion == "A":
        return float(np.trace(np.linalg.inv(information)))
    return float(np.linalg.slogdet(information)[1])


def until(problem: Problem, reached: float) -> float:
    """CPU seconds after which we are as good; nan if not with 128 starts."""
    for starts in (1, 2, 4, 8, 16, 32, 64, 128):
        start = time.process_time()
        found = value(problem, ours(problem, starts))
        spent = time.process_time() - start
        better = found - reached if problem.criterion == "D" else reached - found
        if better >= -1e-9 * abs(reached):
            return spent
    return float("nan")


def main() -> None:
    """Print a line for each problem."""
    ours(PROBLEMS[0])  # compiles
    with contextlib.suppress(ImportError):
        theirs(PROBLEMS[0], 1)
    for problem in PROBLEMS:
        start = time.process_time()
        points = ours(problem)
        own = time.process_time() - start
        told = f"{problem.name}, {problem.criterion}: {value(problem, points):.4f} in {own:.2f} s"
        with contextlib.suppress(ImportError):
            start = time.process_time()
            other = theirs(problem)
            their_time, reached = time.process_time() - start, value(problem, other)
            told += f"; pyoptex {reached:.4f} in {their_time:.2f} s, "
            told += f"which takes us {until(problem, reached):.3f} s"
        print(told, flush=True)


if __name__ == "__main__":
    main()
