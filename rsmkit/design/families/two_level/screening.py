"""Screening designs: Plackett-Burman and definitive screening, both from orthogonal matrices."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rsmkit.design.design import Design, classical
from rsmkit.design.families.site import Site
from rsmkit.design.families.two_level.hadamard import conference, next_size, plackett_burman_columns
from rsmkit.design.options import MOST_RUNS, DesignOptions, Problems, counts
from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.io.option_fields import doc
from rsmkit.language.space import Floats, Space

__all__ = [
    "ScreeningOptions",
    "definitive_screening",
    "make_definitive_screening",
    "make_plackett_burman",
    "plackett_burman",
]


@dataclass(frozen=True, kw_only=True)
class ScreeningOptions(DesignOptions):
    """Screening design from an orthogonal matrix."""

    center: int = doc("centre points", 3)
    runs: int | None = doc("number of runs; the smallest possible by default", None)

    def problems(self) -> Problems:
        """Report what is wrong beyond types."""
        found = super().problems() + counts(self, 0, MOST_RUNS, "center")
        return found + counts(self, 1, MOST_RUNS, "runs")


def make_plackett_burman(space: Space, options: ScreeningOptions, site: Site) -> Design:
    """The design of the study file; a categorical factor has no centre."""
    center = options.center if space.numeric.all() else 0
    return plackett_burman(space, runs=options.runs, center=center)


def make_definitive_screening(space: Space, options: ScreeningOptions, site: Site) -> Design:
    """The design of the study file."""
    return definitive_screening(space, runs=options.runs, center=options.center)


@checked
def plackett_burman(space: Space, *, runs: int | None = None, center: int = 0) -> Design:
    """Orthogonal two-level design for main effects (Plackett & Burman 1946, Biometrika 33(4), 305-325).

    Parameters
    ----------
    space : Space
        Numeric factors and categorical ones of two levels, fewer than `runs`.
    runs : int, optional
        Multiple of four; the smallest that holds all factors by default.
    center : int
        Centre points.

    Notes
    -----
    Every multiple of four up to 100 as published, and most above: by cyclic shifts of a row, by Paley's two
    constructions over a finite field, by doubling (Sylvester), or from four circulants (Williamson; 92 runs
    by Baumert, Golomb & Hall 1962, Bull. Amer. Math. Soc. 68(3), 237-238). 4, 8, 16 and 32 runs are regular:
    some two-factor interactions equal a main effect. So it is with the last column of 40, 56, 64, 88 and 96
    runs, which is the last to be used; in the others no interaction equals a main effect.
    """
    k = len(space)
    size = 4 * (k // 4 + 1) if runs is None else runs
    if size % 4 or size <= k:
        raise RsmkitError(f"Plackett-Burman: runs must be a multiple of 4 above the {k} factors, got {size}")
    whole = plackett_burman_columns(size)
    if whole is None:
        raise RsmkitError(
            f"no Plackett-Burman design of {size} runs is known here; set runs = {next_size(size)}"
        )
    columns = whole[:, :k]
    coded = columns.copy()
    for j, factor in enumerate(space):
        if not factor.domain.is_numeric:
            if len(factor.levels) != 2:
                raise RsmkitError(f"Plackett-Burman: {factor.name} must have two levels")
            coded[:, j] = (columns[:, j] + 1.0) / 2.0
    if center and not space.numeric.all():
        raise RsmkitError("Plackett-Burman: a categorical factor has no centre; set center = 0")
    coded = np.vstack([coded, np.zeros((center, k))])
    kinds = ["factorial"] * size + ["center"] * center
    return classical(space, coded, kinds, "a Plackett-Burman design", categorical=True)


@checked
def definitive_screening(space: Space, *, runs: int | None = None, center: int = 1) -> Design:
    """Definitive screening design: 2 k + 1 runs in fold-over pairs.

    Main effects are clear of all two-factor interactions and squares (Jones & Nachtsheim 2011, Journal of
    Quality Technology 43(1), 1-15). For an even number of factors with a conference matrix they are
    orthogonal too (Xiao, Lin & Bai 2012, same journal 44(1), 2-8); otherwise the matrix of largest
    determinant found by exchange of signs takes its place.

    Parameters
    ----------
    space : Space
        Three or more factors; categorical ones must have two levels.
    runs : int, optional
        More runs than 2 k + centre points: two more for every column of the design that no factor uses. An
        odd number of factors becomes orthogonal with two runs more.
    center : int
        Centre points, at least one; two at least beside categorical factors.

    Notes
    -----
    Categorical factors as in Jones & Nachtsheim (2013), Journal of Quality Technology 45(2), 121-129: the
    number of columns is even; where a categorical one has its zeros the two runs of the pair take opposite
    levels, and so do the centre points; the signs are those of the largest determinant for the main effects.
    """
    k = len(space)
    categorical = ~space.numeric
    least = 2 if categorical.any() else 1
    if k < 3 or center < least:
        raise RsmkitError(
            f"definitive screening needs at least three factors and {least} centre "
            f"point{'s' if least > 1 else ''}, got {k} and {center}"
        )
    for factor in space:
        if not factor.domain.is_numeric and len(factor.levels) != 2:
            raise RsmkitError(
                f"definitive screening: {factor.name} has {len(factor.levels)} levels; two are possible, or "
                "use an optimal design"
            )
    columns = k + (k % 2 if categorical.any() else 0)
    columns = columns if runs is None else (runs - center) // 2
    if columns < k or (runs is not None and 2 * columns + center != runs):
        raise RsmkitError(
            f"definitive screening of {k} factors with {center} centre points has {2 * k + center} runs, or "
            f"an even number more, got {runs}"
        )
    half = conference(columns)[:, :k]
    pairs = np.stack([half, -half], axis=1).reshape(-1, k)
    coded = np.vstack([pairs, np.zeros((center, k))])
    if categorical.any():
        coded = _without_zeros(coded, np.flatnonzero(categorical))
        coded[:, categorical] = (coded[:, categorical] + 1.0) / 2.0
    kinds = ["screening"] * len(pairs) + ["center"] * center
    return classical(space, coded, kinds, "a definitive screening design", categorical=True)


def _without_zeros(coded: Floats, columns: NDArray[np.int64]) -> Floats:
    """Replace zeros of some columns by opposite signs in runs 2i and 2i + 1, for the largest determinant."""
    coded = coded.copy()
    places = [(i, j) for j in columns for i in range(0, len(coded), 2) if coded[i, j] == 0.0]

    def put(i: int, j: int, sign: float) -> float:
        coded[i : i + 2, j] = [sign, -sign][: len(coded) - i]
        design = np.hstack([np.ones((len(coded), 1)), coded])
        return float(np.linalg.slogdet(design.T @ design)[1])

    for i, j in places:
        put(i, j, 1.0)
    value, improved = put(*places[0], 1.0), True
    while improved:
        improved = False
        for i, j in places:
            sign = coded[i, j]
            trial = put(i, j, -sign)
            if trial > value + 1e-9:
                value, improved = trial, True
            else:
                put(i, j, sign)
    return coded
