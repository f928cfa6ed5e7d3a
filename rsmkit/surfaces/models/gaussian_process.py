"""Gaussian-process surface: kriging in the coordinates of its runs, with calibrated intervals."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, ClassVar, Literal, overload

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import LinAlgError
from scipy.special import ndtri

from rsmkit.errors import FitError, RsmkitError
from rsmkit.io.json_codec import left_out_if_none
from rsmkit.io.strict_types import Shape
from rsmkit.language.space import Floats, Space
from rsmkit.surfaces.estimation.coordinates import Coordinates, hull
from rsmkit.surfaces.estimation.fit_data import FitData, cells
from rsmkit.surfaces.estimation.jackknife import jackknife_plus
from rsmkit.surfaces.estimation.processes.correlation import Kernel, Radial
from rsmkit.surfaces.estimation.processes.kriging import Kriging
from rsmkit.surfaces.estimation.processes.likelihood import fit_kriging, fits_without
from rsmkit.surfaces.estimation.processes.paths import drawn_paths
from rsmkit.surfaces.models.surface import IntervalKind, check_confidence
from rsmkit.surfaces.reading import (
    FactorForm,
    LimitForm,
    ModelDocument,
    fail,
    read_coordinates,
    read_space,
    write_limits,
    write_space,
)

__all__ = ["GaussianProcessSurface", "fit_gaussian_process", "nested_errors"]

ONE_BY_ONE = 30
"""Most runs that are left out singly when all is found again without them."""
GROUPS = 20
"""In which more of them are left out."""
SMALLEST_VARIANCE = 1e-12
"""In units of the variance of the response, for one that does not vary."""


@dataclass(frozen=True, eq=False)
class GaussianProcessSurface(ModelDocument):
    """A Gaussian process with one correlation length per factor.

    Parameters
    ----------
    space : Space
    response : str
    coordinates : Coordinates
        The hull of the runs on [-1, 1]; categorical factors become indicators beside it.
    data : FitData
    kernel : {"matern52", "rbf"}
    lengths : array, shape (m,)
        Correlation lengths.
    variance : float
        Of the process, in units of the variance of the standardised response.
    nugget : float
        Noise variance as a part of `variance`.
    kriging : {"ordinary", "simple"}
        Whether the mean is estimated, or the average of the runs as if known.
    """

    form: ClassVar[str] = "gaussian process"

    space: Space
    response: str
    coordinates: Coordinates
    data: FitData
    kernel: Kernel
    lengths: Floats
    variance: float
    nugget: float
    kriging: Literal["ordinary", "simple"] = "ordinary"

    @overload
    def predict(self, points: ArrayLike, interval: None = None) -> Floats: ...
    @overload
    def predict(
        self, points: ArrayLike, interval: float, kind: IntervalKind = "prediction"
    ) -> tuple[Floats, Floats, Floats]: ...
    def predict(
        self, points: ArrayLike, interval: float | None = None, kind: IntervalKind = "prediction"
    ) -> Floats | tuple[Floats, Floats, Floats]:
        """Predict the response.

        Intervals are normal, widened where leave-one-out errors show them to be too narrow
        (:attr:`calibration`).

        Parameters
        ----------
        points : array, shape (n, k)
            Natural units.
        interval : float, optional
            Confidence in (0, 1).
        kind : {"prediction", "mean", "jackknife+"}
            With or without the nugget, or from errors at runs left out.
        """
        x = self._points(points)
        if interval is not None:
            check_confidence(interval)
        if interval is not None and kind == "jackknife+":
            return jackknife_plus(self, x, interval)
        columns = _columns(self.space, self.coordinates, x)
        mean = self._process.predict(columns)
        if interval is None:
            return mean
        extra = self._process.noise_variance if kind == "prediction" else 0.0
        sd = np.sqrt(self._process.variances(columns) + extra)
        half = float(ndtri(0.5 + 0.5 * interval)) * self.calibration * sd
        return mean, mean - half, mean + half

    def gradient(self, points: ArrayLike) -> Floats:
        """Derivatives by the factors, natural units, shape (n, k); zero for categorical factors."""
        x = self._points(points)
        slopes, numeric = np.zeros_like(x), self.space.numeric
        by_column = self._process.gradient(_columns(self.space, self.coordinates, x))
        slopes[:, numeric] = by_column[:, : numeric.sum()] * self.coordinates.slopes(x)[:, numeric]
        return slopes

    @property
    def loo_residuals(self) -> Floats:
        """Error of predicting each run from the others, hyper-parameters kept, shape (n,)."""
        return self._process.loo_residuals

    def predictions_without(self, points: ArrayLike) -> Floats:
        """Predict without each of the runs, hyper-parameters kept, shape (m, n)."""
        return self._process.predictions_without(_columns(self.space, self.coordinates, self._points(points)))

    @cached_property
    def press(self) -> float:
        """Sum of squared leave-one-out errors."""
        return float(self.loo_residuals @ self.loo_residuals)

    @cached_property
    def calibration(self) -> float:
        """Root mean square of leave-one-out errors in their own standard deviations, at least 1."""
        squares = self.loo_residuals**2 / self._process.loo_variances
        return max(1.0, float(np.sqrt(np.mean(squares))))

    @property
    def log_likelihood(self) -> float:
        """Of the standardised response under the fitted process."""
        return -0.5 * self._process.deviance + len(self.data) * float(np.log(self._scale))

    @property
    def process_sd(self) -> float:
        """Standard deviation of the process in units of the response."""
        return self._scale * float(np.sqrt(self.variance))

    @property
    def noise_sd(self) -> float:
        """Standard deviation of a repeated run in units of the response."""
        return float(np.sqrt(self._process.noise_variance))

    def drawn_paths(self, count: int, rng: np.random.Generator) -> Callable[[Floats], Floats]:
        """Draw functions of the process given its runs: points (n, k), natural units, to (count, n)."""
        paths = drawn_paths(self._process, self.kernel, count, rng)
        return lambda points: paths(_columns(self.space, self.coordinates, self._points(points)))

    @property
    def column_names(self) -> tuple[str, ...]:
        """What each correlation length belongs to: a numeric factor, or ``tool[A]``, a level of another."""
        return _column_names(self.space)

    def to_form(self) -> ProcessForm:
        """Show how it is written."""
        return ProcessForm(
            model=self.form,
            response=self.response,
            factors=write_space(self.space),
            low=np.array(self.coordinates.low),
            high=np.array(self.coordinates.high),
            kernel=self.kernel,
            lengths=self.lengths,
            variance=self.variance,
            nugget=self.nugget,
            runs=self.data,
            kriging=self.kriging,
            limits=write_limits(self.space),
        )

    @classmethod
    def from_form(cls, form: ProcessForm) -> GaussianProcessSurface:
        """Inverse of :meth:`to_form`."""
        space = read_space(form.factors, form.limits)
        coordinates = read_coordinates(form.low, form.high, space)
        columns = _column_names(space)
        if len(form.lengths) != len(columns):
            raise fail(f"lengths should hold {len(columns)} numbers, for {', '.join(columns)}")
        if not ((form.lengths > 0).all() and form.variance > 0 and form.nugget > 0):
            raise fail("lengths, variance and nugget should be positive")
        runs = form.runs.checked(space)
        if len(runs) < 2:
            raise fail("a Gaussian process needs at least two runs")
        surface = cls(
            space,
            form.response,
            coordinates,
            runs,
            form.kernel,
            form.lengths,
            form.variance,
            form.nugget,
            form.kriging,
        )
        try:
            _ = surface._process.cholesky
        except LinAlgError:
            raise fail(f"the covariance of {surface.response} is singular") from None
        return surface

    def prediction_parts(self) -> dict[str, Any]:
        """Give what predicting needs beyond the parameters, for evaluation outside Python.

        With ``k`` the correlations of a point with the `runs` (in units of the correlation lengths), the
        mean is ``mean + k @ weights``; its standard deviation is ``sd`` times the root of ``nugget`` plus the
        variance that `cholesky` gives (:attr:`Kriging.bordered_cholesky`). `largest` is the most that this
        sum reaches at a run which is left out.
        """
        process = self._process
        return {
            "runs": process.points / self.lengths,
            "weights": process.weights,
            "cholesky": process.bordered_cholesky,
            "mean": process.mean,
            "sd": self.process_sd * self.calibration,
            "largest": float(process.loo_variances.max()) / process.variance,
        }

    # ------------------------------------------------------------------ inside

    @property
    def _scale(self) -> float:
        return float(self.data.y.std()) or 1.0

    @cached_property
    def _process(self) -> Kriging:
        data = self.data
        return Kriging(
            Radial(self.kernel, self.lengths),
            _columns(self.space, self.coordinates, data.points),
            data.y,
            self.nugget,
            _noise(data),
            known_mean=float(data.y.mean()) if self.kriging == "simple" else None,
            known_variance=self.process_sd**2,
        )

    def _points(self, points: ArrayLike) -> Floats:
        x = np.asarray(points, float)
        if x.ndim != 2 or x.shape[1] != len(self.space):
            raise RsmkitError(f"points of {self.response} need shape (n, {len(self.space)}), got {x.shape}")
        return x


@dataclass(frozen=True, kw_only=True)
class ProcessForm:
    """How a Gaussian process is written: its runs and hyper-parameters; all else follows."""

    model: str
    response: str
    factors: tuple[FactorForm, ...]
    low: Annotated[Floats, Shape("factors")]
    high: Annotated[Floats, Shape("factors")]
    kernel: Kernel
    lengths: Annotated[Floats, Shape("columns")]
    variance: float
    nugget: float
    runs: FitData
    kriging: Literal["ordinary", "simple"] = "simple"  # of files that do not say it
    limits: tuple[LimitForm, ...] | None = left_out_if_none()


def fit_gaussian_process(
    space: Space, response: str, data: FitData, kernel: Kernel = "matern52"
) -> GaussianProcessSurface:
    """Find the hyper-parameters by maximum likelihood.

    Raises
    ------
    FitError
        With fewer than three different runs, or with blocks (not modelled).
    """
    if data.blocks is not None:
        raise FitError(f"response {response}: a Gaussian process does not model blocks; fit a polynomial")
    if len(np.unique(cells(data.points))) < 3:
        raise FitError(f"response {response}: a Gaussian process needs at least three different runs")
    coordinates = hull(space, data.points)
    found = fit_kriging(kernel, _columns(space, coordinates, data.points), data.y, _noise(data))
    variance = max(found.variance / (data.y.var() or 1.0), SMALLEST_VARIANCE)
    return GaussianProcessSurface(
        space, response, coordinates, data, kernel, found.correlation.lengths, variance, found.nugget
    )


def nested_errors(surface: GaussianProcessSurface) -> Floats:
    """Error at each run with lengths and nugget, too, found again without it, shape (n,).

    With more than 30 runs they are left out in 20 groups: finding the hyper-parameters takes of the order of
    n^3 operations.
    """
    process, n = surface._process, len(surface.data)
    group = np.random.default_rng(n).permutation(n) % (n if n <= ONE_BY_ONE else GROUPS)
    groups = [group == g for g in range(group.max() + 1)]
    errors = np.empty(n)
    for out, found in zip(groups, fits_without(surface.kernel, process, groups), strict=True):
        errors[out] = process.y[out] - found.predict(process.points[out])
    return errors


def _noise(data: FitData) -> Floats | None:
    return None if data.weights is None else 1.0 / data.weights


def _column_names(space: Space) -> tuple[str, ...]:
    numeric = [f.name for f in space if f.domain.is_numeric]
    indicators = [f"{f.name}[{level}]" for f in space if not f.domain.is_numeric for level in f.levels]
    return (*numeric, *indicators)


def _columns(space: Space, coordinates: Coordinates, points: Floats) -> Floats:
    """Numeric factors on the hull's [-1, 1], then one indicator per level of the categorical ones."""
    z = coordinates.forward(points)
    parts = [z[:, space.numeric]]
    for j, factor in enumerate(space):
        if not factor.domain.is_numeric:
            parts.append(factor.domain.indicators(points[:, j]))
    return np.hstack(parts)
