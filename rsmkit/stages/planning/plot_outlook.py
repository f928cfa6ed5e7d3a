"""What a design in random groups can test: degrees of freedom, power, and how all depends on the ratio."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rsmkit.design.design import Design
from rsmkit.design.families.whole_plots import RATIO
from rsmkit.design.optimal.encoding import encode_model, moments
from rsmkit.design.optimal.split_plot import whole_plot_columns
from rsmkit.design.quality.assessment import Quality
from rsmkit.design.quality.plot_figures import PlotFigures
from rsmkit.design.region import Region
from rsmkit.language.space import Floats
from rsmkit.language.terms import Terms
from rsmkit.study.file import Study
from rsmkit.surfaces.estimation.mixed.error_contrasts import error_contrasts
from rsmkit.surfaces.estimation.mixed.kenward_roger import Inference
from rsmkit.surfaces.estimation.mixed.reml import Reml, random_groups

__all__ = ["RATIOS", "in_groups", "plot_figures", "with_plots"]

RATIOS = (0.1, 1.0, 10.0)
"""Ratios of variances that figures are given for, beside the one the design was made for."""
SIGNAL = 2.0
"""Change of the response from low to high in standard deviations of a run, at which power is given."""
FEW = 3.0
"""Degrees of freedom below which a test finds little."""


def in_groups(study: Study, design: Design) -> Design:
    """A design read from a file, with its blocks taken as the study takes them."""
    if not (study.random and design.blocks):
        return design
    return replace(design, block_ratio=study.file.design.block_variance or RATIO)


def with_plots(
    quality: Quality, design: Design, terms: Terms, region: Region, hard: Sequence[str]
) -> Quality:
    """Add what only designs in random groups have, with warnings about tests that find little."""
    ratio = design.block_ratio or 1.0
    names = terms.names(design.space)
    degrees = _degrees(design, terms, ratio)
    errors = np.array([quality.standard_errors[name] for name in names])
    figures = tuple(plot_figures(design, terms, region, hard, value) for value in sorted({*RATIOS, ratio}))
    known = np.isfinite(degrees)
    return replace(
        quality,
        plots=figures,
        denominator_df={
            name: round(float(df), 2) if ok else None
            for name, df, ok in zip(names, degrees, known, strict=True)
        },
        power=dict(zip(names, _power(errors, degrees), strict=True)),
        warnings=(*quality.warnings, *_warnings(design, terms, hard, degrees)),
    )


def plot_figures(
    design: Design, terms: Terms, region: Region, hard: Sequence[str], ratio: float
) -> PlotFigures:
    """Figures of a design for one ratio of variances, the variance of a run being one."""
    covariance = replace(design, block_ratio=ratio).covariance
    assert covariance is not None  # a ratio was given
    x = terms.matrix(design.coded)
    spread: Floats = np.asarray(np.linalg.inv(x.T @ np.linalg.solve(covariance, x)), float)
    held = np.array([name in hard for name in design.space.names])
    whole = whole_plot_columns(terms, held)
    return PlotFigures(
        ratio=ratio,
        d_efficiency=_efficiency(spread, np.ones(terms.p, bool), len(design)),
        whole_plot_efficiency=_efficiency(spread, whole, len(design)),
        sub_plot_efficiency=_efficiency(spread, ~whole, len(design)),
        average_variance=float((spread * moments(encode_model(terms), region)).sum()),
    )


def _efficiency(spread: Floats, columns: NDArray[np.bool_], runs: int) -> float | None:
    """``100 det(C)^(-1/q) / n`` with C the covariance of some coefficients."""
    if not columns.any():
        return None
    _, log_det = np.linalg.slogdet(spread[np.ix_(columns, columns)])
    return float(100.0 * np.exp(-log_det / columns.sum()) / runs)


def _degrees(design: Design, terms: Terms, ratio: float) -> Floats:
    """Degrees of freedom that each coefficient's test will have, by Kenward and Roger, at this ratio."""
    x = terms.matrix(design.coded)
    groups = random_groups({"plot": [str(block) for block in design.blocks]})
    columns = tuple(group.columns for group in groups)
    y = np.zeros(len(x))
    contrasts = error_contrasts(x, y, columns)
    if contrasts.df == 0:
        return np.full(terms.p, np.nan)
    fit = Reml(x, y, groups, columns, contrasts, np.array([ratio, 1.0]))
    return Inference(fit).degrees(np.eye(terms.p))


def _power(errors: Floats, degrees: Floats) -> list[float | None]:
    """Power of the t tests at the five per cent level; None without degrees of freedom."""
    from scipy.stats import nct, t

    found: list[float | None] = []
    for error, df in zip(errors, degrees, strict=True):
        if not np.isfinite(df):
            found.append(None)
            continue
        limit, shift = float(t.ppf(0.975, df)), 0.5 * SIGNAL / float(error)
        found.append(float(nct.sf(limit, df, shift) + np.nan_to_num(nct.cdf(-limit, df, shift))))
    return found


def _warnings(design: Design, terms: Terms, hard: Sequence[str], degrees: Floats) -> list[str]:
    names = terms.names(design.space)
    plots, what = len(set(design.blocks)), "whole plots" if hard else "blocks"
    none = [name for name, df in zip(names, degrees, strict=True) if not np.isfinite(df) and name != "1"]
    few = [f"{name} {df:.1f}" for name, df in zip(names, degrees, strict=True) if df < FEW and name != "1"]
    if none:
        return [
            f"{plots} {what} leave no degrees of freedom between them, so {', '.join(none)} cannot be "
            f"tested: ask for more {what}, or a smaller model"
        ]
    if few:
        return [
            f"few degrees of freedom between {what}: {', '.join(few)}; a test on fewer than {FEW:g} finds "
            f"large effects only, so ask for more {what} if these terms matter"
        ]
    return []
