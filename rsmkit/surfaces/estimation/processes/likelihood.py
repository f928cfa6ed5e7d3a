"""Correlation lengths and nugget of a Gaussian process by maximum likelihood.

The gradient is analytic (:attr:`Kriging.deviance_slopes`); mean and, unless the noise is known, variance of
the process are profiled out.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import product

import numpy as np
from numpy.linalg import LinAlgError
from numpy.typing import NDArray
from scipy.optimize import Bounds, minimize

from rsmkit.language.space import Floats
from rsmkit.newton import descended, slopes_changed
from rsmkit.surfaces.estimation.processes.correlation import Kernel, Radial
from rsmkit.surfaces.estimation.processes.kriging import Kriging

__all__ = ["fit_kriging", "fits_without"]

LENGTHS = (0.02, 100.0)
"""Bounds of the correlation lengths, in extents of the runs."""
NUGGET = (1e-10, 10.0)
"""Bounds of the nugget, in units of the process variance.

Rounding moves the eigenvalues of the covariance of n runs by up to n^2 unit roundoffs: at the lower bound
that of 900 runs can still be factorised, at 1e-12 that of 90.
"""
STARTS = tuple(product((0.15, 0.5, 1.5, 5.0), (1e-9, 1e-4, 1e-2, 0.3)))
"""First guesses, the same length for every column, and the nugget."""
SEARCHES = 3
"""How many of them, the likeliest, are improved."""
LEAST_NOISE = 1e-8
"""Least noise variance that can be known, in units of the variance of the runs."""
BEND_STEP = 1e-3
"""Difference of a logarithm for the curvatures of the deviance."""
FLAT = 0.1
"""Least curvature that a descent reckons with."""
UNLIKELY = 10.0
"""Deviance above the least from which a maximum does not count: the others would need to change that much."""
APART = 0.5
"""Logarithms of lengths or nuggets of different maxima differ by more."""
NEAR = 1e-3
"""Last step of a logarithm, which changes the deviance by a millionth."""
FAILED = 1e25
"""Stands for the deviance where the covariance cannot be factorised."""


def fit_kriging(
    kernel: Kernel,
    points: Floats,
    y: Floats,
    noise: Floats | None = None,
    *,
    nuggets: tuple[float, float] = NUGGET,
    noise_variance: float | None = None,
) -> Kriging:
    """Find lengths and nugget by maximum likelihood, from the likeliest of a grid of starts.

    Parameters
    ----------
    kernel, points, y, noise
        As of :class:`Kriging`; at least three different points.
    nuggets : pair of float
        Bounds of the nugget; up to 1e-6, say, for exact values.
    noise_variance : float, optional
        Noise variance of a run, if known, in the unit of `y`, squared; otherwise it is estimated. Taken to be
        at least 1e-8 of the variance of `y`.

    Returns
    -------
    Kriging
        Its process variance is the likeliest; with known noise it is `noise_variance` over the nugget.
    """
    search = _Search(kernel, points, y, noise, nuggets, noise_variance)
    starts = search.starts()
    found = [search.from_afar(start) for start in starts[:SEARCHES]]
    return search.at(min(found, key=lambda result: result[1])[0])


def fits_without(kernel: Kernel, found: Kriging, groups: Iterable[NDArray[np.bool_]]) -> Iterator[Kriging]:
    """Find lengths and nugget again without each of some groups of runs.

    They are near a maximum of the likelihood of all runs, and so are its curvatures: a few steps lead there
    from each maximum there is. Where a start of the grid is likelier than where they end, it is improved
    instead.

    Parameters
    ----------
    kernel : {"matern52", "rbf"}
    found : Kriging
        What :func:`fit_kriging` found for all runs.
    groups : iterable of array of bool, shape (n,)
        The runs that are left out.

    Yields
    ------
    Kriging
        Given the other runs.
    """
    whole = _Search(kernel, found.points, found.y, found.noise)
    modes = [(place, _upwards(whole.curvatures(place))) for place in whole.modes(whole.place(found))]
    for out in groups:
        noise = None if found.noise is None else found.noise[~out]
        search = _Search(kernel, found.points[~out], found.y[~out], noise)
        ends = [search.from_near(place, bend) for place, bend in modes]
        best, begin = min(ends, key=search.value), search.starts()[0]
        if search.value(begin) < search.value(best):
            best = search.from_afar(begin)[0]
        yield search.at(best)


class _Search:
    """The deviance of runs by the logarithms of lengths, in extents of the runs, and nugget."""

    def __init__(
        self,
        kernel: Kernel,
        points: Floats,
        y: Floats,
        noise: Floats | None,
        nuggets: tuple[float, float] = NUGGET,
        noise_variance: float | None = None,
    ) -> None:
        self.kernel, self.points, self.y, self.nuggets = kernel, points, y, nuggets
        self.extents = np.ptp(points, axis=0)
        self.extents[self.extents == 0] = 1.0
        self.scale = float(y.std()) or 1.0
        self.known = None if noise_variance is None else max(noise_variance / self.scale**2, LEAST_NOISE)
        unit = Radial(kernel, np.ones(len(self.extents)))
        self.scaled = Kriging(unit, points / self.extents, (y - y.mean()) / self.scale, 1.0, noise)
        self.low, self.high = np.log([*[LENGTHS] * len(self.extents), nuggets]).T

    def starts(self) -> list[Floats]:
        """Those of the grid, the likeliest first."""
        grid = dict.fromkeys((length, min(nugget, self.nuggets[1])) for length, nugget in STARTS)
        found = (np.log([*[length] * len(self.extents), nugget]) for length, nugget in grid)
        return sorted(found, key=self.value)

    def place(self, model: Kriging) -> Floats:
        """Where a model stands that was found for nearly the same runs."""
        theta = np.log([*np.asarray(model.correlation.lengths) / self.extents, model.nugget])
        return np.asarray(np.clip(theta, self.low, self.high))

    def value(self, theta: Floats) -> float:
        """Deviance."""
        return self._deviance(theta)[0]

    def with_slopes(self, theta: Floats) -> tuple[float, Floats]:
        """Deviance and its derivatives."""
        value, model = self._deviance(theta)
        return value, np.zeros_like(theta) if value == FAILED else _slopes(model, self.known is not None)

    def from_afar(self, start: Floats) -> tuple[Floats, float]:
        """Where a descent ends, and the deviance there."""
        found = minimize(
            self.with_slopes,
            start,
            jac=True,
            bounds=Bounds(self.low, self.high),
            method="L-BFGS-B",
            options={"maxiter": 100},
        )
        return found.x, float(found.fun)

    def from_near(self, start: Floats, bend: Floats) -> Floats:
        """Where a descent ends that begins nearby, with about the given curvatures."""
        start = np.clip(start, self.low, self.high)
        end = descended(self.with_slopes, start, bend, self.low, self.high, NEAR)
        return self.from_afar(start)[0] if end is None else end

    def modes(self, best: Floats) -> list[Floats]:
        """The best place and others where the likelihood has a maximum that counts beside it."""
        found, least = [best], self.value(best)
        for start in self.starts()[:SEARCHES]:
            place, value = self.from_afar(start)
            near = any(np.abs(place - other).max() < APART for other in found)
            if value - least < UNLIKELY and not near:
                found.append(place)
        return found

    def curvatures(self, theta: Floats) -> Floats:
        """Second derivatives of the deviance, shape (m + 1, m + 1)."""
        return slopes_changed(self.with_slopes, theta, self.low, self.high, BEND_STEP)

    def at(self, theta: Floats) -> Kriging:
        """Give the process in the units of the runs."""
        best = _with(self.scaled, self.kernel, theta, self.known)
        return Kriging(
            Radial(self.kernel, self.extents * best.correlation.lengths),
            self.points,
            self.y,
            best.nugget,
            self.scaled.noise,
            known_variance=None if self.known is None else self.scale**2 * self.known / best.nugget,
        )

    def _deviance(self, theta: Floats) -> tuple[float, Kriging]:
        model = _with(self.scaled, self.kernel, theta, self.known)
        try:
            return (model.deviance if model.variance > 0 else FAILED), model
        except LinAlgError:
            return FAILED, model


def _upwards(curvatures: Floats) -> Floats:
    """The same with no direction that bends downwards or hardly at all, as towards an endless length."""
    values, axes = np.linalg.eigh(curvatures)
    return np.asarray((axes * np.maximum(np.abs(values), FLAT)) @ axes.T)


def _with(model: Kriging, kernel: Kernel, theta: Floats, known: float | None) -> Kriging:
    """Change the logarithms of lengths and nugget, keeping a known noise variance."""
    nugget = float(np.exp(theta[-1]))
    return replace(
        model,
        correlation=Radial(kernel, np.exp(theta[:-1])),
        nugget=nugget,
        known_variance=None if known is None else known / nugget,
    )


def _slopes(model: Kriging, noise_is_known: bool) -> Floats:
    """Derivatives of the deviance by the logarithms of lengths and nugget."""
    *found, by_variance = model.deviance_slopes
    if noise_is_known:  # the variance falls as the nugget grows
        found[-1] -= by_variance
    return np.array(found)
