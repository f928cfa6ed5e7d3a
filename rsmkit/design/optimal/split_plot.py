"""Optimal split-plot designs: some factors are hard to change and keep one setting in each whole plot.

The information on the model is ``M = X' V^-1 X`` with ``V = I + ratio Z Z'``: runs of a plot share an error
whose variance is `ratio` times that of a run. Coordinates are exchanged at both levels, an easy factor's run
by run, a hard factor's for all runs of a plot at once (Goos & Vandebroek, J. Quality Technology 35, 2003;
Jones & Goos, J. Royal Statistical Society C 56, 2007). An easy exchange changes M by rank two, for which the
criterion is known in closed form (:mod:`rsmkit.design.optimal.exchange`); a plot's is computed anew.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rsmkit.design.design import Design, Found
from rsmkit.design.optimal.criteria import Criterion, aim_for
from rsmkit.design.optimal.split_plot_climb import PlotClimb
from rsmkit.design.region import Region, box, placed
from rsmkit.errors import RsmkitError, one_of
from rsmkit.io.arguments import checked
from rsmkit.language.space import Floats, Space
from rsmkit.language.space_terms import space_terms
from rsmkit.language.terms import Terms

__all__ = ["check_plots", "plot_sizes", "split_plot_design", "whole_plot_columns"]

EFFORT = 2.5e6
"""Starts times coordinates times squares of coefficients: some seconds at most."""
FEWEST, MOST, INTERPRETED = 10, 400, 30
"""Starts; the last where only interpreted code knows the constraints and sums."""
SURE_HITS = 6
"""The search ends when so many starts found the best value."""


@checked
def split_plot_design(
    space: Space,
    plots: Sequence[int],
    hard: Sequence[str],
    *,
    given: Design | None = None,
    terms: Terms | int = 2,
    criterion: Criterion = "D",
    ratio: float = 1.0,
    region: Region | None = None,
    starts: int | None = None,
    seed: int = 1,
) -> Design:
    """Find the points and plots that are best for estimating a polynomial.

    Parameters
    ----------
    space : Space
    plots : sequence of int
        Runs of every whole plot; given plots come first.
    hard : sequence of str
        Factors that keep one setting in each plot.
    given : Design, optional
        Plots that are kept, with their ``blocks``.
    terms : Terms or int
        The model, or its order.
    criterion : {"D", "A", "I", "bayesian-D"}
        As for :func:`rsmkit.design.optimal.optimal_design.optimal_design`.
    ratio : float
        Variance of a plot over that of a run.
    region : Region, optional
        The bounds by default; constraints hold for every run.
    starts : int, optional
        Random starts; chosen from the size of the problem.
    seed : int

    Returns
    -------
    Design
        In random order of plots, and of runs within each; ``blocks`` are the plots, ``block_ratio`` is the
        ratio.

    Raises
    ------
    RsmkitError
        When plots or runs are too few for the model, or what is asked for makes no sense.
    """
    region = box(space) if region is None else region
    terms = terms if isinstance(terms, Terms) else space_terms(space, terms)
    held = np.array([name in hard for name in space.names])
    sizes = tuple(int(size) for size in plots)
    given = Design(space, np.empty((0, len(space))), ()) if given is None else given
    _refuse(space, sizes, hard, given, terms, criterion, ratio, region)
    check_plots(given, hard)
    climb = PlotClimb(aim_for(criterion, terms, region), region, held, sizes, ratio, given)
    coordinates = (climb.n - len(given)) * int((~held).sum()) + len(climb.free_plots) * int(held.sum())
    most = starts or int(np.clip(EFFORT / (max(coordinates, 1) * climb.p**2), FEWEST, MOST))
    most = starts or (min(most, INTERPRETED) if climb.by_numpy else most)
    rng = np.random.default_rng(seed)
    results: list[tuple[float, Floats]] = []
    for _ in range(most):
        results.append(climb.from_points(climb.random_points(rng)))
        best = max(value for value, _ in results)
        if sum(value > best - climb.tolerance(best) for value, _ in results) >= SURE_HITS:
            break
    order = np.argsort([-value for value, _ in results], kind="stable")
    refined = [climb.refined(results[i][1]) for i in order[:3]]
    value, points = max(refined, key=lambda item: item[0])
    if not np.isfinite(value):
        raise RsmkitError(
            f"no non-singular design was found in {most} starts: the region or the factors' levels leave too "
            "few different points for the model"
        )
    hits = sum(found > value - climb.tolerance(value, 1e-3) for found, _ in results)
    found = Found(criterion, value if not len(climb.aim.weights) else -value, len(results), max(hits, 1))
    natural = placed(space, points[len(given) :])
    return _in_random_order(
        Design(
            space,
            np.vstack([given.points, natural]),
            given.kinds + ("augmented" if len(given) else "optimal",) * len(natural),
            tuple((climb.plot_of + 1).tolist()),
            found,
            block_ratio=ratio,
        ),
        len(given),
        rng,
    )


def whole_plot_columns(terms: Terms, held: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which columns of a model are the same for all runs of a plot, shape (p,): in hard factors alone."""
    of_term = np.array([not any(e and not h for e, h in zip(x, held, strict=True)) for x in terms.exponents])
    return np.asarray(of_term[list(terms.column_terms)])


def _whole_plot_dimension(terms: Terms, held: NDArray[np.bool_], region: Region) -> int:
    """How many combinations of the coefficients are the same for all runs of a plot.

    Without sums they are those of :func:`whole_plot_columns`; with a mixture the constant is the sum of its
    linear terms, and a process factor by itself that of its products with them.
    """
    if not region.flat:
        return int(whole_plot_columns(terms, held).sum())
    one, other = region.sample(4 * terms.p + 64, 1), region.sample(4 * terms.p + 64, 2)
    other[:, held] = one[:, held]
    kept = region.contains(other)
    changes = terms.matrix(one[kept]) - terms.matrix(other[kept])
    return int(terms.p - np.linalg.matrix_rank(changes, tol=1e-8 * np.linalg.norm(changes)))


def plot_sizes(runs: int, plots: int) -> tuple[int, ...]:
    """Runs of every plot, as equal as can be, larger ones first.

    Raises
    ------
    RsmkitError
        For more plots than runs.
    """
    if not 1 <= plots <= runs:
        raise RsmkitError(f"design.whole_plots: {plots} plots cannot hold {runs} runs; ask for 1 to {runs}")
    return tuple(runs // plots + (i < runs % plots) for i in range(plots))


def check_plots(design: Design, hard: Sequence[str]) -> None:
    """Refuse a design in which a hard factor changes within a plot.

    Raises
    ------
    RsmkitError
        Naming factor and plot.
    """
    blocks = np.array(design.blocks)
    if len(design) and not len(blocks):
        raise RsmkitError(
            f"{', '.join(hard)} is hard to change: the design needs a column block with the whole plot of "
            "each run"
        )
    for name in hard:
        column = design.points[:, design.space.names.index(name)]
        for block in dict.fromkeys(design.blocks):
            values = column[blocks == block]
            if np.ptp(values) > 1e-9 * max(1.0, float(np.abs(values).max())):
                raise RsmkitError(
                    f"whole plot {block}: {name} is hard to change, but takes {len(np.unique(values))} "
                    "values there; give it one value in each plot"
                )


def _refuse(
    space: Space,
    sizes: tuple[int, ...],
    hard: Sequence[str],
    given: Design,
    terms: Terms,
    criterion: str,
    ratio: float,
    region: Region,
) -> None:
    for name in hard:
        one_of("hard-to-change factor", name, space.names)
    if not hard:
        raise RsmkitError("no factor is hard to change: say which, or take an ordinary optimal design")
    if not sizes or min(sizes) < 1:
        raise RsmkitError("whole plots: every plot needs at least one run")
    if not ratio > 0 or not np.isfinite(ratio):
        raise RsmkitError(f"the ratio of variances must be positive, got {ratio:g}")
    for equality in space.equalities:
        apart = [name for name in equality.names if name not in hard]
        if apart and len(apart) < len(equality.names):
            raise RsmkitError(
                f"'{equality.text}' ties factors that are hard to change with {', '.join(apart)}, which is "
                "not: either all factors of a sum keep their setting in a plot, or none"
            )
    for group in region.groups if region.flat else ():
        easy = [space.names[j] for j in group.columns if space.names[j] not in hard]
        if len(group.polytope.rhs) and easy and len(easy) < len(group.columns):
            raise RsmkitError(
                f"a limit ties a sum to {', '.join(easy)}, of which not all are hard to change; leave that "
                "limit out, or make all of them hard or easy to change"
            )
    if criterion == "G":
        raise RsmkitError("criterion G is not offered for whole plots; I lowers the average variance instead")
    if region.candidates is not None:
        raise RsmkitError(
            "a list of candidate points does not go with hard-to-change factors, whose settings the search "
            "must be free to combine; use subject_to, or levels of the factors"
        )
    blocks = tuple(given.blocks)
    expected = tuple(np.repeat(np.arange(len(sizes)) + 1, sizes).tolist())[: len(given)]
    if blocks and blocks != expected:
        raise RsmkitError(
            f"the given runs lie in plots {list(dict.fromkeys(blocks))}, which are not the first of the "
            f"sizes {list(sizes)}: number given plots from 1, whole and in order"
        )
    held = np.array([name in hard for name in space.names])
    columns = _whole_plot_dimension(terms, held, region)
    if len(sizes) < columns:
        raise RsmkitError(
            f"{len(sizes)} whole plots cannot estimate the {columns} coefficients that are the same for all "
            f"runs of a plot (the constant and those of {', '.join(hard)}): ask for at least {columns + 1} "
            "plots, one more than that, so that there is something to test them against, or a smaller model"
        )
    if sum(sizes) < terms.p:
        raise RsmkitError(
            f"{sum(sizes)} runs cannot estimate the {terms.p} coefficients of the model: ask for at least "
            f"{terms.p} runs or a smaller model"
        )


def _in_random_order(design: Design, given: int, rng: np.random.Generator) -> Design:
    """New plots in random order, and runs in random order within each; plots are numbered in their order."""
    blocks = np.array(design.blocks)
    kept = blocks[:given]
    fresh = rng.permutation([b for b in np.unique(blocks) if b not in kept])
    rows = list(range(given))
    rows += [i for b in np.unique(kept) for i in rng.permutation(np.nonzero(blocks == b)[0]) if i >= given]
    for plot in fresh:
        rows += rng.permutation(np.nonzero(blocks == plot)[0]).tolist()
    ordered = design.select([int(i) for i in rows])
    numbers = {block: i + 1 for i, block in enumerate(dict.fromkeys(ordered.blocks))}
    return replace(ordered, blocks=tuple(numbers[block] for block in ordered.blocks), found=design.found)
