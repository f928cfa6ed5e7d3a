"""Figures of a design in whole plots or random blocks, which depend on a ratio nobody knows beforehand."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["PlotFigures"]


@dataclass(frozen=True)
class PlotFigures:
    """Figures for one ratio of variances, the variance of a run being one, in coded units.

    Parameters
    ----------
    ratio : float
        Variance of a plot over that of a run.
    d_efficiency : float
        ``100 det(X' V^-1 X)^(1/p) / n``.
    whole_plot_efficiency, sub_plot_efficiency : float or None
        ``100 det(C)^(-1/q) / n`` with C the covariance of the q coefficients that are the same for all runs
        of a plot, and of the others; None where there are none.
    average_variance : float
        Prediction variance averaged over the region.
    """

    ratio: float
    d_efficiency: float | None
    whole_plot_efficiency: float | None
    sub_plot_efficiency: float | None
    average_variance: float
