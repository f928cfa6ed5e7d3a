"""Figures of designs and searches: points, prediction variance, progress, Pareto front."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rsmkit.design.design import Design
from rsmkit.errors import RsmkitError
from rsmkit.language.terms import full_terms
from rsmkit.optimum.optimum import Optimum
from rsmkit.report.figures.axes import DATA, MODEL, NOW, name_levels, one_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["design_scatter", "fraction_of_design_space", "ga_history", "pareto"]

SAMPLE = 8192
"""Points of the box behind the fraction of design space."""


def design_scatter(design: Design, across: str, up: str, *, ax: Axes | None = None) -> Axes:
    """Draw the points of a design over two factors, by kind, with the bounds of the space."""
    ax = one_axes(ax)
    names = design.space.names
    i, j = names.index(across), names.index(up)
    for kind in dict.fromkeys(design.kinds):
        rows = [row for row, other in enumerate(design.kinds) if other == kind]
        ax.plot(design.points[rows, i], design.points[rows, j], "o", ms=6, alpha=0.75, label=kind)
    a, b = design.space[across], design.space[up]
    ax.plot([a.low, a.high, a.high, a.low, a.low], [b.low, b.low, b.high, b.high, b.low], color=DATA, lw=0.8)
    ax.legend(frameon=False, fontsize=8)
    ax.set(xlabel=a.title, ylabel=b.title)
    name_levels(ax.xaxis, a)
    name_levels(ax.yaxis, b)
    return ax


def fraction_of_design_space(
    design: Design, *, order: int = 2, label: str = "", seed: int = 0, ax: Axes | None = None
) -> Axes:
    """Draw the scaled prediction variance that each share of the box stays below.

    Zahran, Anderson-Cook & Myers (2003): ``n x'(X'X)^-1 x`` at random points of the box, sorted.

    Raises
    ------
    RsmkitError
        If the design cannot estimate the model.
    """
    ax = one_axes(ax)
    space = design.space
    terms = full_terms(space, order)
    matrix = terms.matrix(design.coded)
    if np.linalg.matrix_rank(matrix) < terms.p:
        raise RsmkitError(
            f"this design cannot estimate the model of order {order}: add points or lower the order"
        )
    rng = np.random.default_rng(seed)
    coded = rng.uniform(-1.0, 1.0, (SAMPLE, len(space)))
    for j, factor in enumerate(space):
        if not factor.domain.is_numeric:
            coded[:, j] = rng.integers(0, factor.domain.categories, SAMPLE)
    spread = terms.matrix(coded) @ np.linalg.inv(np.linalg.qr(matrix)[1])
    variance = np.sort(len(design) * np.einsum("ij,ij->i", spread, spread))
    ax.plot((np.arange(SAMPLE) + 0.5) / SAMPLE, variance, label=label or None)
    ax.set(xlabel="fraction of the design space", ylabel="scaled prediction variance", xlim=(0.0, 1.0))
    if label:
        ax.legend(frameon=False, fontsize=8)
    return ax


def ga_history(optimum: Optimum, *, ax: Axes | None = None) -> Axes:
    """Draw the objective (or the dominated volume of a front) over the generations.

    Raises
    ------
    RsmkitError
        If the search kept no history.
    """
    ax = one_axes(ax)
    history = optimum.history
    if not history.get("generation"):
        raise RsmkitError(f"the search {optimum.name} kept no history")
    shown = [key for key in ("best", "mean", "worst", "hypervolume") if key in history]
    for key, colour in zip(shown, (MODEL, "#9a6700", "#8c959f"), strict=False):
        values = np.array(history[key], float)
        ax.plot(history["generation"], values, color=colour, label=key)
    ax.legend(frameon=False, fontsize=8)
    title = "dominated volume" if "hypervolume" in history else optimum.minimize[0]
    ax.set(xlabel="generation", ylabel=title)
    return ax


def pareto(optimum: Optimum, across: int = 0, up: int = 1, *, ax: Axes | None = None) -> Axes:
    """Draw two objectives of a Pareto front; a third one as colour, the knee as a star.

    Raises
    ------
    RsmkitError
        If the search has no front.
    """
    if not optimum.front:
        raise RsmkitError(f"the search {optimum.name} has one objective, so there is no Pareto front")
    ax = one_axes(ax)
    values = np.array([candidate.objectives for candidate in optimum.front])
    others = [i for i in range(values.shape[1]) if i not in (across, up)]
    if others:
        dots = ax.scatter(values[:, across], values[:, up], c=values[:, others[0]], cmap="viridis", s=22)
        ax.figure.colorbar(dots, ax=ax, label=optimum.minimize[others[0]])
    else:
        ax.plot(values[:, across], values[:, up], "o", ms=4.5, color=MODEL)
    best = optimum.best.objectives
    ax.plot(best[across], best[up], "*", ms=15, color=NOW, mec="white")
    ax.set(xlabel=optimum.minimize[across], ylabel=optimum.minimize[up])
    return ax
