"""Analysis of variance by groups of terms, and lack of fit against pure error.

Groups are those of Myers, Montgomery & Anderson-Cook (2016), section 6: blocks, first order (FO), two-way
interactions (TWI), pure quadratic (PQ), cubic. Weights enter every sum of squares.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import fdtrc

from rsmkit.io.shown import Shown
from rsmkit.language.space import Floats
from rsmkit.surfaces.estimation.fit_data import cells
from rsmkit.surfaces.estimation.least_squares import ALIASED, EXACT
from rsmkit.surfaces.models.polynomial import PolynomialSurface

__all__ = [
    "LINEAR",
    "LackOfFit",
    "Row",
    "equal_blending",
    "lack_of_fit",
    "overall_test",
    "partial_anova",
    "sequential_anova",
    "tested",
]


LINEAR = "linear blending"
"""Group of the components themselves in a model of a mixture."""
ROUNDING = 1e-10
"""Share of a column's length by which repeated values differ through rounding."""


@dataclass(frozen=True)
class Row(Shown):
    """One line of an analysis of variance; `f` and `p` are nan where no test applies."""

    source: str
    df: int
    ss: float
    f: float = math.nan
    p: float = math.nan

    @property
    def ms(self) -> float:
        """Mean square; nan without degrees of freedom."""
        return self.ss / self.df if self.df else math.nan


@dataclass(frozen=True)
class LackOfFit:
    """The residual split into what replicates show to be noise and what the terms do not describe.

    ``absent`` says why there is no test. The rows are None when there is no pure error at all.
    """

    lack: Row | None = None
    pure: Row | None = None
    absent: str = ""


def sequential_anova(surface: PolynomialSurface) -> list[Row]:
    """Sums of squares of each group of terms after the groups before it, then the residual.

    F compares with the residual mean square, as R's ``anova``.
    """
    found = _group_columns(surface)
    squares, df = surface.fit.effects**2, np.ones(surface.fit.p, int)
    if _constant_is_implied(surface):
        squares, df = _squares_about_mean(surface)
    rows = [
        tested(surface, name, int(df[columns].sum()), float(squares[columns].sum()))
        for name, columns in found
    ]
    return [*rows, Row("residual", surface.fit.df, surface.fit.rss)]


def overall_test(surface: PolynomialSurface) -> Row:
    """Test all blocks and terms but the constant at once, as the last line of R's ``summary(lm)``."""
    if _constant_is_implied(surface):
        return tested(surface, "model", surface.fit.p - 1, surface.fit.tss - surface.fit.rss)
    effects = surface.fit.effects[[group != "" for group in surface.groups]]
    return tested(surface, "model", len(effects), float(effects @ effects))


def partial_anova(surface: PolynomialSurface) -> list[Row]:
    """Sums of squares of each group of terms after all others, then the residual."""
    rows = [
        equal_blending(surface)
        if name == LINEAR
        else tested(surface, name, len(columns), surface.group_squares(columns.tolist()))
        for name, columns in _group_columns(surface)
    ]
    return [*rows, Row("residual", surface.fit.df, surface.fit.rss)]


def equal_blending(surface: PolynomialSurface) -> Row:
    """Test, after all other terms, that the linear blending coefficients of a mixture are all the same."""
    columns = [i for i, group in enumerate(surface.groups) if group == LINEAR]
    apart = np.eye(len(columns))[1:] - np.eye(len(columns))[0]
    factor, estimates = apart @ surface.coded_factor[columns], apart @ surface.coefficients[columns]
    solved = np.linalg.lstsq(factor, estimates, rcond=None)[0]
    return tested(surface, LINEAR, len(apart), float(solved @ solved))


def lack_of_fit(surface: PolynomialSurface, within: float = 0.0) -> LackOfFit:
    """Test the residual against pure error: runs with the same factor values, blocks taken out additively.

    Parameters
    ----------
    surface : PolynomialSurface
    within : float
        Share of the range of each number within which runs count as near replicates. What the model says of
        their differences is taken out, so the test is exact where the model holds: it compares the model with
        the model plus a mean for each group (Christensen, *Technometrics* 31 (1989), 101-103).
    """
    data, fit = surface.data, surface.fit
    if data.duplicates:
        return LackOfFit(
            absent=f"the response is deterministic ({data.duplicates} repeated runs agree exactly and were "
            "left out), so there is no pure error: all of the residual is lack of fit"
        )
    index = cells(data.points, within)
    count = int(index.max()) + 1
    if count == len(data) and within:
        return LackOfFit(absent="no two runs are that near")
    if count == len(data):
        return LackOfFit(
            absent="no run is repeated, so pure error cannot be told from lack of fit; for a deterministic "
            "simulator all of the residual is lack of fit"
        )
    columns = surface.matrix if within else data.block_columns()
    deviations = _within_cells(np.column_stack([data.y, columns]), index, fit.weights)
    root = np.sqrt(fit.weights)
    target, model = deviations[:, 0] * root, deviations[:, 1:] * root[:, None]
    if within:
        model = _scaled(model, columns * root[:, None])
    solution, _, rank, _ = np.linalg.lstsq(model, target, rcond=1e-9)
    target = target - model @ solution
    pure_df = len(data) - count - int(rank)
    if pure_df == 0:
        return LackOfFit(absent="runs are repeated only across blocks: no degrees of freedom for pure error")
    pure = Row("pure error", pure_df, float(target @ target))
    lack_df = fit.df - pure_df
    difference = root * fit.residuals - target
    lack = Row("lack of fit", lack_df, float(difference @ difference) if lack_df else 0.0)
    if lack_df == 0:
        absent = "there are as many terms as different points: no lack of fit can be seen"
        return LackOfFit(lack, pure, absent)
    if fit.exact:
        absent = "the residuals are rounding errors: there is neither lack of fit nor pure error"
        return LackOfFit(lack, pure, absent)
    if pure.ss <= EXACT**2 * max(float((fit.weights * fit.y**2).sum()), 1e-300):
        absent = "repeated runs agree exactly, so there is no pure error: the residual is lack of fit"
        return LackOfFit(lack, pure, absent)
    f = lack.ms / pure.ms
    return LackOfFit(replace(lack, f=f, p=float(fdtrc(lack_df, pure_df, f))), pure)


def _scaled(deviations: Floats, columns: Floats) -> Floats:
    """Deviations of unit length, and none where they are rounding."""
    lengths = np.linalg.norm(deviations, axis=0)
    real = lengths > ROUNDING * np.linalg.norm(columns, axis=0)
    return np.asarray(deviations[:, real] / lengths[real])


def _constant_is_implied(surface: PolynomialSurface) -> bool:
    """Whether the terms add up to a constant that is none of them, as those of mixtures do."""
    return surface.fit.has_constant and not surface.terms.has_constant


def _squares_about_mean(surface: PolynomialSurface) -> tuple[Floats, np.ndarray]:
    """Sequential sums of squares after an implied constant, and degrees of freedom, of each column.

    The column with which the others first add up to the constant has none. Those of linear blending stand
    together, so that proportions that add up to one but for the digits printed do no harm.
    """
    if surface.terms.components:
        linear = np.array([group == LINEAR for group in surface.groups])
        squares = np.where(linear, 0.0, surface.fit.effects**2)
        squares[0] = max(0.0, surface.fit.tss - surface.fit.rss - float(squares.sum()))
        return squares, np.arange(len(squares)).astype(bool).astype(int)
    root = np.sqrt(surface.fit.weights)
    columns = np.column_stack([root, surface.matrix * root[:, None]])
    columns = columns / np.linalg.norm(columns, axis=0)
    last = int(np.argmin(np.abs(np.diag(np.linalg.qr(columns, mode="r"))) > ALIASED))
    q = np.linalg.qr(np.delete(columns, last, axis=1))[0]
    squares = np.insert((q.T @ (surface.fit.y * root)) ** 2, last, 0.0)[1:]
    return squares, (np.arange(1, len(squares) + 1) != last).astype(int)


def _group_columns(surface: PolynomialSurface) -> list[tuple[str, np.ndarray]]:
    """Groups in the order of the columns, the constant left out."""
    names = list(dict.fromkeys(group for group in surface.groups if group))
    groups = np.array(surface.groups)
    return [(name, np.nonzero(groups == name)[0]) for name in names]


def tested(surface: PolynomialSurface, name: str, df: int, ss: float) -> Row:
    """Compare a sum of squares with the residual mean square; F and p are nan where there is none."""
    fit = surface.fit
    if df == 0 or fit.df == 0 or fit.rss <= 0 or fit.exact:
        return Row(name, df, ss)
    f = (ss / df) / fit.sigma**2
    return Row(name, df, ss, f, float(fdtrc(df, fit.df, f)))


def _within_cells(columns: Floats, index: np.ndarray, weights: Floats) -> Floats:
    """Deviations from the weighted mean of the cell, shape (n, m)."""
    total = np.bincount(index, weights=weights)
    means = np.stack([np.bincount(index, weights=weights * c) / total for c in columns.T], axis=1)
    deviations: Floats = columns - means[index]
    return deviations
