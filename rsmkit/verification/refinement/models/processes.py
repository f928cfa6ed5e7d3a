"""Gaussian processes that compete to describe one quantity over the whole space.

They differ in smoothness, in whether sums over factors and pairs of factors are looked for, and in whether
the logarithm of the quantity is modelled. The penalised likelihood decides: leave-one-out errors would be
those of the cluster of runs around the best one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np
from numpy.linalg import LinAlgError
from numpy.typing import NDArray
from scipy.optimize import minimize

from rsmkit.language.space import Floats
from rsmkit.surfaces.estimation.processes.correlation import Kernel, Separable, squared_differences
from rsmkit.surfaces.estimation.processes.deviance import Deviance
from rsmkit.surfaces.estimation.processes.kriging import Kriging

__all__ = ["EXACT", "NOISY", "Competition", "Form", "Process", "all_forms", "fit_process"]

EXACT, NOISY = (1e-11, 1e-6), (1e-8, 1.0)
"""Bounds of the nugget for a simulator that repeats itself, and for one that does not."""
LENGTHS = (-3.2, 4.0)
"""Bounds of the logarithms of correlation lengths; the bounds of a factor are 1 apart."""
PARTS = (-7.0, 5.0)
"""Bounds of the logits of sums over factors and pairs."""
STEPS = 30
"""Of the likelihood's descent."""
KNEE = 0.03
"""Distance from the best value, in spreads, below which the logarithm becomes linear."""
GROWN = 1.2
"""All forms are tried again when so many times as many runs are known."""
KEPT = 2
"""Forms that are kept up to date meanwhile."""
FAILED = 1e25


@dataclass(frozen=True)
class Form:
    """How a quantity is modelled.

    Parameters
    ----------
    kernel : {"rbf", "matern52"}
        Smoothness.
    nested : bool
        Whether sums over factors and over pairs of factors are mixed in.
    warped : bool
        Whether its logarithm is modelled.
    """

    kernel: Kernel
    nested: bool = False
    warped: bool = False

    @property
    def text(self) -> str:
        """In words."""
        name = "Gaussian process" if self.kernel == "rbf" else "Matern process"
        return f"{name}{' of sums' if self.nested else ''}{' of the logarithm' if self.warped else ''}"


@dataclass(frozen=True)
class _Scale:
    """Values as a process sees them: centred, in units of their spread, perhaps after a logarithm."""

    center: float
    size: float
    lowest: float = 0.0
    knee: float = 0.0

    def forward(self, y: Floats) -> Floats:
        if self.knee:
            y = np.log1p(np.maximum((y - self.lowest) / self.knee, -0.999))
        return (y - self.center) / self.size

    def back(self, w: Floats) -> Floats:
        w = self.center + self.size * w
        return self.lowest + self.knee * np.expm1(np.minimum(w, 500.0)) if self.knee else w

    def slope(self, w: Floats) -> Floats:
        """Of :meth:`back`."""
        if not self.knee:
            return np.full_like(w, self.size)
        return self.knee * self.size * np.exp(np.minimum(self.center + self.size * w, 500.0))


@dataclass(frozen=True, eq=False)
class Process:
    """A fitted form.

    Parameters
    ----------
    form : Form
        What was fitted.
    kriging : Kriging
        Of the scaled values.
    scale : object
        From scaled values to those of the quantity and back.
    theta : array
        Logarithms of lengths, logits, logarithm of the nugget.
    score : float
        Penalised deviance in the units of the quantity: lower is better.
    """

    form: Form
    kriging: Kriging
    scale: _Scale
    theta: Floats
    score: float

    @property
    def name(self) -> str:
        """In words."""
        return self.form.text

    def mean(self, unit: Floats) -> Floats:
        """Predict, shape (q,)."""
        return self.scale.back(self.kriging.predict(unit))

    def gradient(self, unit: Floats) -> Floats:
        """Derivatives of the prediction by the coordinates, shape (q, k)."""
        slope = self.scale.slope(self.kriging.predict(unit))
        return slope[:, None] * self.kriging.gradient(unit)

    @property
    def noise_sd(self) -> float:
        """Standard deviation of the noise of one run, in the units of the quantity; of no logarithm."""
        return self.scale.size * math.sqrt(self.kriging.nugget * self.kriging.variance)

    def normal(self, unit: Floats) -> tuple[Floats, Floats]:
        """Mean and standard deviation in scaled values, without the noise of a run."""
        return self.kriging.predict(unit), np.sqrt(self.kriging.variances(unit))

    @cached_property
    def residuals(self) -> Floats:
        """Leave-one-out errors in the units of the quantity, shape (n,)."""
        left_out = self.kriging.y - self.kriging.loo_residuals
        return self.scale.back(self.kriging.y) - self.scale.back(left_out)

    def covariance(self, unit: Floats, boldness: float) -> Floats:
        """Of scaled values without the noise of runs, deviations taken larger, shape (q, q).

        Leave-one-out errors tell how much larger at least. The likelihood may be too sure of the lengths,
        hence `boldness`; what noise leaves unknown does not depend on them, so that much is not enlarged:
        it is what the runs as if without noise do not leave unknown.
        """
        least = self.calibration
        most = max(least, boldness)
        whole = self.kriging.covariance(unit)
        if not self.kriging.nugget > EXACT[1]:
            return np.asarray(most**2 * whole)
        alike = replace(self.kriging, nugget=EXACT[1], known_variance=self.kriging.variance)
        between = _factorised(alike).covariance(unit)
        return np.asarray(least**2 * whole + (most**2 - least**2) * between)

    @cached_property
    def calibration(self) -> float:
        """Root mean square of leave-one-out errors in their standard deviations, at least 1."""
        ratio = self.kriging.loo_residuals / np.sqrt(self.kriging.loo_variances)
        return max(1.0, float(np.sqrt(np.mean(ratio**2))))


def fit_process(
    form: Form,
    unit: Floats,
    y: Floats,
    categorical: NDArray[np.bool_],
    *,
    nugget: tuple[float, float] = EXACT,
    start: Floats | None = None,
    spread: float = 0.0,
    differences: Floats | None = None,
) -> Process | None:
    """Fit one form by penalised likelihood.

    Parameters
    ----------
    form : Form
        What.
    unit, y : arrays, shapes (n, k) and (n,)
        Runs.
    categorical : array of bool, shape (k,)
        Columns of categories.
    nugget : tuple of float
        Bounds, in process variances.
    start : array, optional
        Earlier optimum; instead of the usual first guesses.
    spread : float
        Median minus least value, by which a logarithm is scaled.
    differences : array, optional
        :func:`squared_differences` of the runs.

    Returns
    -------
    Process or None
        None when the values do not vary or no covariance can be factorised.
    """
    if not np.ptp(y) > 0:
        return None
    scale = _scale_of(y, form, spread)
    w = scale.forward(y)
    m = unit.shape[1]
    parts = min(2, m - 1) if form.nested else 0
    apart = squared_differences(unit, categorical) if differences is None else differences
    prior = -0.7 if form.nested else 0.5 * np.log(m)

    deviance = Deviance(form.kernel, apart, w, parts)

    def objective(theta: Floats) -> tuple[float, Floats]:
        away = (theta[:m] - prior) / 1.5
        shares = theta[m:-1] / 5.0
        penalty = float(away @ away + shares @ shares) + parts
        value, slopes = deviance(np.exp(theta[:m]), theta[m:-1], math.exp(theta[-1]))
        if not value < FAILED:
            return FAILED, np.zeros_like(theta)
        slopes[:m] += 2.0 * away / 1.5
        slopes[m:-1] += 2.0 * shares / 5.0
        return value + penalty, slopes

    bounds = [*[LENGTHS] * m, *[PARTS] * parts, tuple(np.log(nugget))]
    starts = [start] if start is not None else _starts(form, m, parts, nugget)
    found = [
        minimize(objective, first, jac=True, bounds=bounds, method="L-BFGS-B", options={"maxiter": STEPS})
        for first in starts
    ]
    best = min(found, key=lambda result: float(result.fun))
    if not float(best.fun) < FAILED:
        return None
    jacobian = 2.0 * float(np.log(scale.slope(w)).sum())
    law = Separable(form.kernel, np.exp(best.x[:m]), categorical, best.x[m:-1])
    kriging = _factorised(Kriging(law, unit, w, math.exp(best.x[-1])))
    return Process(form, kriging, scale, best.x, float(best.fun) + jacobian)


def _factorised(kriging: Kriging) -> Kriging:
    """With as much more nugget as its factor takes: where the likelihood's could just be had, it may not."""
    while kriging.nugget < 1.0:
        try:
            kriging.cholesky  # noqa: B018 - kept by the object
        except LinAlgError:
            kriging = replace(kriging, nugget=10.0 * kriging.nugget)
        else:
            break
    return kriging


def _scale_of(y: Floats, form: Form, spread: float) -> _Scale:
    if not form.warped:
        return _Scale(float(y.mean()), float(y.std()))
    lowest, knee = float(y.min()), KNEE * spread
    w = np.log1p((y - lowest) / knee)
    return _Scale(float(w.mean()), float(w.std()), lowest, knee)


def _starts(form: Form, m: int, parts: int, nugget: tuple[float, float]) -> list[Floats]:
    """Short and long lengths; with sums also a large share of the means, without which they are not found."""
    log_nugget = float(np.log(max(nugget[0] * 10.0, nugget[1] * 1e-2)))
    if not form.nested:
        guesses: list[tuple[float, tuple[float, ...]]] = [(length, ()) for length in (0.25, 1.2)]
    else:
        lengths = (0.12, 0.4) if form.kernel == "rbf" else (0.2, 0.6)
        guesses = [(length, (4.0, -3.0)[:parts]) for length in lengths]
        if parts > 1:
            guesses.append((0.4, (-1.0, 2.0)))
    return [np.array([*[np.log(length)] * m, *logits, log_nugget]) for length, logits in guesses]


class Competition:
    """The forms of one quantity, fitted again as runs come in.

    Parameters
    ----------
    forms : sequence of Form
        What competes.
    categorical : array of bool, shape (k,)
        Columns of categories.
    nugget : tuple of float
        Bounds of the nugget.
    """

    def __init__(
        self, forms: Sequence[Form], categorical: NDArray[np.bool_], nugget: tuple[float, float] = EXACT
    ) -> None:
        self._forms = list(forms)
        self._categorical = categorical
        self._nugget = nugget
        self._thetas: dict[Form, Floats] = {}
        self._ranking: list[Form] = []
        self._counted = 0

    def fit(self, unit: Floats, y: Floats, spread: float) -> list[Process]:
        """Fit to runs, shapes (n, k) and (n,), and rank; empty when nothing varies."""
        everything = len(y) >= GROWN * self._counted
        forms = self._forms if everything else self._ranking[:KEPT]
        apart = squared_differences(unit, self._categorical)

        def fitted(form: Form, start: Floats | None) -> Process | None:
            return fit_process(
                form,
                unit,
                y,
                self._categorical,
                nugget=self._nugget,
                start=start,
                spread=spread,
                differences=apart,
            )

        found: list[Process] = []
        for form in forms:
            if form.warped and not spread > 0:
                continue
            start = self._thetas.get(form)
            tries = [fitted(form, start)] if start is not None else []
            if everything:
                tries.append(fitted(form, None))
            good = [one for one in tries if one is not None]
            if good:
                found.append(min(good, key=lambda one: one.score))
        found.sort(key=lambda one: one.score)
        self._thetas |= {one.form: one.theta for one in found}
        if everything:
            self._counted = len(y)
            self._ranking = [one.form for one in found]
        return found


def all_forms(*, warped: bool, nested: bool) -> list[Form]:
    """Both kernels, with and without sums, with and without a logarithm."""
    kernels: tuple[Kernel, ...] = ("rbf", "matern52")
    return [
        Form(kernel, sums, log)
        for kernel, sums, log in product(kernels, (False, True)[: 1 + nested], (False, True)[: 1 + warped])
    ]
