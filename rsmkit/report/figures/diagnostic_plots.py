"""Figures that judge a fitted polynomial: residuals, leverage, effects, transformation of the response."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from rsmkit.errors import RsmkitError
from rsmkit.language.space import Floats
from rsmkit.report.figures.axes import DATA, MODEL, NOW, axes_grid, name_levels, one_axes, wrapped
from rsmkit.surfaces.models.polynomial import PolynomialSurface

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["box_cox", "half_normal", "leverage", "parity", "residual_set", "residuals"]


def parity(surface: PolynomialSurface, *, ax: Axes | None = None) -> Axes:
    """Draw observed against fitted values; on the diagonal the surface passes through the run."""
    ax = one_axes(ax)
    fitted, observed = surface.fit.fitted, surface.data.y
    ends = [min(fitted.min(), observed.min()), max(fitted.max(), observed.max())]
    ax.plot(ends, ends, color=DATA, linewidth=0.8, linestyle=":")
    ax.plot(fitted, observed, "o", ms=4.5, color=MODEL, alpha=0.8)
    ax.set(xlabel=f"fitted {surface.response}", ylabel=wrapped(f"observed {surface.response}", 36))
    return ax


def residuals(surface: PolynomialSurface, against: str = "fitted", *, ax: Axes | None = None) -> Axes:
    """Draw studentised residuals.

    Parameters
    ----------
    surface : PolynomialSurface
    against : str
        ``fitted``, ``run`` (the order in which the runs were made, where the data tell it, else that of the
        data), ``normal`` (normal quantiles), or the name of a factor.

    Raises
    ------
    RsmkitError
        For anything else.
    """
    ax = one_axes(ax)
    studentised = surface.fit.studentised
    names = surface.space.names
    if against == "normal":
        x, studentised = _normal_quantiles(len(studentised)), np.sort(studentised)
        ax.plot(x, x, color=DATA, linewidth=0.8, linestyle=":")
        label = "normal quantile"
    elif against in names:
        x, label = surface.data.points[:, names.index(against)], surface.space[against].title
    elif against in ("fitted", "run"):
        x, label = (
            (surface.fit.fitted, f"fitted {surface.response}") if against == "fitted" else _in_time(surface)
        )
    else:
        raise RsmkitError(
            f"residuals go against fitted, run, normal or a factor ({', '.join(names)}), not {against!r}"
        )
    if against != "normal":
        ax.axhline(0.0, color=DATA, linewidth=0.8)
        for limit in (-3.0, 3.0):
            ax.axhline(limit, color=NOW, linewidth=0.8, linestyle="--")
    ax.plot(x, studentised, "o", ms=4.5, color=MODEL, alpha=0.8)
    ax.set(xlabel=wrapped(label, 40), ylabel="studentised residual")
    if against in names:
        name_levels(ax.xaxis, surface.space[against])
    return ax


def residual_set(surface: PolynomialSurface, *, ax: Any = None) -> Any:
    """Draw the four usual checks on a 2 x 2 array of axes: fitted, normal, run order, leverage."""
    ax = axes_grid(ax, 2, 2)
    for panel, against in zip(ax.flat, ("fitted", "normal", "run"), strict=False):
        residuals(surface, against, ax=panel)
    leverage(surface, ax=ax[1, 1])
    for panel in ax.flat:
        panel.grid(alpha=0.25)
        panel.set_xlabel(wrapped(panel.get_xlabel(), 24))
    return ax


def leverage(surface: PolynomialSurface, *, ax: Axes | None = None) -> Axes:
    """Draw the leverage of every run, larger dots for larger Cook's distances; dashed: twice the average."""
    ax = one_axes(ax)
    fit = surface.fit
    cook = np.nan_to_num(fit.cooks_distances)
    sizes = 14.0 + 120.0 * cook / (cook.max() or 1.0)
    places, label = _in_time(surface)
    ax.scatter(places, fit.leverages, s=sizes, color=MODEL, alpha=0.75, linewidths=0)
    ax.axhline(2.0 * fit.p / fit.n, color=NOW, linewidth=0.9, linestyle="--")
    ax.set(xlabel=label, ylabel="leverage", ylim=(0.0, 1.05))
    return ax


def _in_time(surface: PolynomialSurface) -> tuple[Floats, str]:
    """The place of each run in time, or where that is not known in the data; and what it is called."""
    if surface.data.order is None:
        return np.arange(1.0, len(surface.data) + 1), "run"
    return np.asarray(surface.data.order, float), "run order"


def half_normal(surface: PolynomialSurface, *, label: int = 5, ax: Axes | None = None) -> Axes:
    """Draw absolute t values of the terms against half-normal quantiles (Daniel 1959).

    Of a saturated surface, which has no t, the coefficients in units of equal precision (half an effect times
    the root of the number of runs, in a two-level design). Terms without effect lie near the line through the
    origin, whose slope is Lenth's (1989) pseudo standard error; the `label` largest are named.
    """
    ax = one_axes(ax)
    keep = [i for i, group in enumerate(surface.groups) if group not in ("", "block", "stretch")]
    saturated = surface.fit.df == 0
    lengths = np.linalg.norm(surface.coded_factor[keep], axis=1)
    size = np.abs(surface.coefficients[keep]) / lengths if saturated else np.abs(surface.t_values[keep])
    order = np.argsort(size)
    quantiles = _normal_quantiles(2 * len(keep))[len(keep) :]
    ax.plot(quantiles, size[order], "o", ms=5, color=MODEL)
    ax.plot(quantiles, _pseudo_error(size) * quantiles, color=DATA, linewidth=0.8, linestyle=":")
    above = np.inf
    for rank in reversed(range(max(0, len(keep) - label), len(keep))):
        height = float(size[order[rank]])
        is_close = above - height < 0.05 * float(size.max())  # the name above would lie on this one
        beside, side = ((6, -8), "left") if is_close else ((-6, 2), "right")
        ax.annotate(
            surface.names[keep[order[rank]]], (quantiles[rank], height), fontsize=8,
            xytext=beside, textcoords="offset points", ha=side,
        )  # fmt: skip
        above = np.inf if is_close else height
    ylabel = "|coefficient| / (standard error for sigma = 1)" if saturated else "|t|"
    ax.set(xlabel="half-normal quantile", ylabel=ylabel, ylim=(0.0, None), xlim=(0.0, None))
    return ax


def box_cox(surface: PolynomialSurface, *, confidence: float = 0.95, ax: Axes | None = None) -> Axes:
    """Draw the profile log-likelihood of the power of the response, with its interval.

    Raises
    ------
    FitError
        When a response is not positive.
    """
    from scipy.special import chdtri

    from rsmkit.surfaces.models.box_cox import box_cox as estimate

    ax = one_axes(ax)
    found = estimate(surface, confidence)
    powers = np.linspace(-2.0, 2.0, 81)
    powers = np.unique(np.r_[powers, np.linspace(found.power - 0.5, found.power + 0.5, 21)])
    curve = _profile(surface, powers)
    ax.plot(powers, curve, color=MODEL)
    ax.axhline(curve.max() - 0.5 * chdtri(1, 1.0 - confidence), color=DATA, linewidth=0.8, linestyle=":")
    for power, style in ((found.power, "-"), (found.low, "--"), (found.high, "--")):
        if np.isfinite(power):
            ax.axvline(power, color=NOW, linewidth=0.9, linestyle=style)
    ax.axvline(1.0, color=DATA, linewidth=0.6)
    ax.set(xlabel="power of the response", ylabel="log-likelihood")
    return ax


def _profile(surface: PolynomialSurface, powers: Floats) -> Floats:
    """Log-likelihood of Box & Cox (1964), equation 8, up to a constant."""
    from rsmkit.surfaces.models.box_cox import power_transform

    y, weights = surface.data.y, np.sqrt(surface.fit.weights)
    basis = np.linalg.qr(surface.matrix * weights[:, None])[0]
    level = np.exp(np.log(y).mean())
    curve = []
    for power in powers:
        z = weights * power_transform(y, power) / level ** (power - 1.0)
        left = z - basis @ (basis.T @ z)
        curve.append(-0.5 * len(y) * np.log(left @ left / len(y)))
    return np.array(curve)


def _pseudo_error(sizes: Floats) -> float:
    """Standard error from effects most of which are noise (Lenth 1989)."""
    first = 1.5 * np.median(sizes)
    return float(1.5 * np.median(sizes[sizes <= 2.5 * first]))


def _normal_quantiles(count: int) -> Floats:
    """Median positions of ordered normal values (Blom 1958)."""
    from scipy.special import ndtri

    return np.asarray(ndtri((np.arange(1, count + 1) - 0.375) / (count + 0.25)))
