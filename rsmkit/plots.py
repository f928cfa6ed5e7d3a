"""Static figures with matplotlib: one function per figure; each takes ``ax`` and returns what it drew on.

>>> import rsmkit as rk
>>> from rsmkit import plots
>>> from rsmkit.surfaces.polynomial_fit import fit_surface
>>> space = rk.Space(width_mm=(30, 60), height_mm=(90, 120))
>>> x = rk.ccd(space, star="faced", center=1).points
>>> surface = fit_surface(space, x, x[:, 0] * x[:, 1] ** 2, response="section")
>>> plots.contours(surface, "width_mm", "height_mm").figure.savefig("contours.png")

Figures of several panels (:func:`profiler`, :func:`residual_set`) take and return an array of axes.
"""

from rsmkit.report.figures.diagnostic_plots import (
    box_cox,
    half_normal,
    leverage,
    parity,
    residual_set,
    residuals,
)
from rsmkit.report.figures.mixture_plots import ternary, trace
from rsmkit.report.figures.search_plots import design_scatter, fraction_of_design_space, ga_history, pareto
from rsmkit.report.figures.surface_plots import (
    contours,
    interactions,
    main_effects,
    perturbation,
    profiler,
    surface_3d,
)

__all__ = [
    "box_cox",
    "contours",
    "design_scatter",
    "fraction_of_design_space",
    "ga_history",
    "half_normal",
    "interactions",
    "leverage",
    "main_effects",
    "pareto",
    "parity",
    "perturbation",
    "profiler",
    "residual_set",
    "residuals",
    "surface_3d",
    "ternary",
    "trace",
]
