"""Gaussian-process surface: scikit-learn finds the hyper-parameters, everything else is written out here.

Rasmussen & Williams, *Gaussian Processes for Machine Learning* (2006): equations 2.25-2.26 (prediction), 4.17
(Matern 5/2), 5.10-5.12 (leave-one-out from the inverse of K, exact for given hyper-parameters).
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Any, ClassVar, Literal, overload

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import LinAlgError, cho_factor, cho_solve, solve_triangular
from scipy.special import ndtri

from rsmkit.errors import FitError, RsmkitError
from rsmkit.io.json_codec import to_json
from rsmkit.io.strict_types import Shape
from rsmkit.language.space import Floats, Space
from rsmkit.surfaces.estimation.coordinates import Coordinates, hull
from rsmkit.surfaces.estimation.fit_data import FitData, cells
from rsmkit.surfaces.estimation.jackknife import jackknife_plus
from rsmkit.surfaces.models.surface import IntervalKind, check_confidence
from rsmkit.surfaces.reading import (
    FactorForm,
    fail,
    read_coordinates,
    read_form,
    read_space,
    write_space,
)

__all__ = ["GaussianProcessSurface", "Kernel", "fit_gaussian_process"]

Kernel = Literal["matern52", "rbf"]

CHUNK = 4096
NUGGET = (1e-10, 1e-1)
"""Bounds of the nugget, in units of the process variance."""
LENGTHS = (5e-2, 50.0)
"""Bounds of the correlation lengths; the runs span a length of 2."""
RESTARTS = 10


@dataclass(frozen=True, eq=False)
class GaussianProcessSurface:
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
        mean, variance = np.empty(len(x)), np.empty(len(x))
        for start in range(0, len(x), CHUNK):
            part = slice(start, start + CHUNK)
            across = self._correlation(self._scaled(x[part]), self._runs)
            mean[part] = across @ self._weights
            if interval is not None:
                spread = solve_triangular(self._cholesky, across.T, lower=True)
                variance[part] = 1.0 - np.einsum("ij,ij->j", spread, spread)
        mean = self._center + self._scale * mean
        if interval is None:
            return mean
        extra = self.nugget if kind == "prediction" else 0.0
        sd = self._scale * np.sqrt(self.variance * (np.maximum(variance, 0.0) + extra))
        half = float(ndtri(0.5 + 0.5 * interval)) * self.calibration * sd
        return mean, mean - half, mean + half

    def gradient(self, points: ArrayLike) -> Floats:
        """Derivatives by the factors, natural units, shape (n, k); zero for categorical factors."""
        x = self._points(points)
        slopes = np.zeros((len(x), len(self.space)))
        numeric = np.nonzero(self.space.numeric)[0]
        steps = self.coordinates.slopes(x)
        for start in range(0, len(x), CHUNK):
            part = slice(start, start + CHUNK)
            scaled = self._scaled(x[part])
            factor = self._slope_factor(scaled) * self._weights
            for c, j in enumerate(numeric):
                difference = scaled[:, c, None] - self._runs[None, :, c]
                by_z = -np.einsum("ij,ij->i", factor, difference) / self.lengths[c]
                slopes[part, j] = self._scale * by_z * steps[part, j]
        return slopes

    @cached_property
    def loo_residuals(self) -> Floats:
        """Error of predicting each run from the others, hyper-parameters kept, shape (n,)."""
        return self._scale * self._weights / self._inverse_diagonal

    def predictions_without(self, points: ArrayLike) -> Floats:
        """Predict without each of the runs, hyper-parameters kept, shape (m, n)."""
        x = self._points(points)
        across = self._correlation(self._scaled(x), self._runs)
        moved = cho_solve((self._cholesky, True), across.T).T * self._weights / self._inverse_diagonal
        return np.asarray(self.predict(x)[:, None] - self._scale * moved)

    @cached_property
    def press(self) -> float:
        """Sum of squared leave-one-out errors."""
        return float(self.loo_residuals @ self.loo_residuals)

    @cached_property
    def calibration(self) -> float:
        """Root mean square of leave-one-out errors in their own standard deviations, at least 1."""
        sd = self._scale * np.sqrt(self.variance / self._inverse_diagonal)
        return max(1.0, float(np.sqrt(np.mean((self.loo_residuals / sd) ** 2))))

    @property
    def log_likelihood(self) -> float:
        """Of the standardised response under the fitted process."""
        y = (self.data.y - self._center) / self._scale
        logs = 2.0 * np.log(np.diag(self._cholesky)).sum() + len(y) * np.log(2 * np.pi * self.variance)
        return float(-0.5 * (y @ self._weights / self.variance + logs))

    @property
    def process_sd(self) -> float:
        """Standard deviation of the process in units of the response."""
        return self._scale * float(np.sqrt(self.variance))

    @property
    def column_names(self) -> tuple[str, ...]:
        """What each correlation length belongs to: a numeric factor, or ``tool[A]``, a level of another."""
        return _column_names(self.space)

    def to_json(self) -> dict[str, Any]:
        """JSON values; inverse of :meth:`from_json`."""
        document: dict[str, Any] = to_json(self.to_form())
        return document

    @classmethod
    def from_json(cls, data: Any) -> GaussianProcessSurface:
        """Read what :meth:`to_json` wrote."""
        return cls.from_form(read_form(ProcessForm, data))

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
        )

    @classmethod
    def from_form(cls, form: ProcessForm) -> GaussianProcessSurface:
        """Inverse of :meth:`to_form`."""
        space = read_space(form.factors)
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
            space, form.response, coordinates, runs, form.kernel, form.lengths, form.variance, form.nugget
        )
        try:
            _ = surface._cholesky
        except LinAlgError:
            raise fail(f"the covariance of {surface.response} is singular") from None
        return surface

    def prediction_parts(self) -> dict[str, Any]:
        """Give what predicting needs beyond the parameters, for evaluation outside Python.

        With ``k`` the correlations of a point with the `runs` (in units of the correlation lengths), the
        mean is ``mean + scale * k @ weights``; its standard deviation is ``sd`` times the root of ``nugget``
        plus one minus the squared norm of ``solve(cholesky, k)``. `largest` is the most that this sum reaches
        at a run which is left out.
        """
        return {
            "runs": self._runs,
            "weights": self._weights,
            "cholesky": self._cholesky,
            "mean": self._center,
            "scale": self._scale,
            "sd": self.process_sd * self.calibration,
            "largest": float((1.0 / self._inverse_diagonal).max()),
        }

    # ------------------------------------------------------------------ inside

    @cached_property
    def _center(self) -> float:
        return float(self.data.y.mean())

    @cached_property
    def _scale(self) -> float:
        return float(self.data.y.std()) or 1.0

    @cached_property
    def _runs(self) -> Floats:
        return self._scaled(self.data.points)

    @cached_property
    def _cholesky(self) -> Floats:
        matrix = self._correlation(self._runs, self._runs)
        weights = np.ones(len(self.data)) if self.data.weights is None else self.data.weights
        matrix[np.diag_indices_from(matrix)] += self.nugget / weights
        return np.asarray(np.linalg.cholesky(matrix), float)

    @cached_property
    def _weights(self) -> Floats:
        y = (self.data.y - self._center) / self._scale
        return np.asarray(cho_solve((self._cholesky, True), y))

    @cached_property
    def _inverse_diagonal(self) -> Floats:
        inverse = solve_triangular(self._cholesky, np.eye(len(self.data)), lower=True)
        return np.asarray(np.einsum("ij,ij->j", inverse, inverse))

    def _scaled(self, points: Floats) -> Floats:
        return _columns(self.space, self.coordinates, points) / self.lengths

    def _correlation(self, a: Floats, b: Floats) -> Floats:
        squares = _squares(a, b)
        if self.kernel == "rbf":
            return np.asarray(np.exp(-0.5 * squares))
        r = np.sqrt(5.0 * squares)
        return np.asarray((1.0 + r + r * r / 3.0) * np.exp(-r))

    def _slope_factor(self, a: Floats) -> Floats:
        """-dk/d(difference)/difference: the kernel itself, or (5/3)(1 + r) e^-r."""
        squares = _squares(a, self._runs)
        if self.kernel == "rbf":
            return np.asarray(np.exp(-0.5 * squares))
        r = np.sqrt(5.0 * squares)
        return np.asarray(5.0 / 3.0 * (1.0 + r) * np.exp(-r))

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


def fit_gaussian_process(
    space: Space, response: str, data: FitData, kernel: Kernel = "matern52", *, seed: int = 0
) -> GaussianProcessSurface:
    """Find the hyper-parameters by maximum likelihood with scikit-learn, from eleven starts.

    Raises
    ------
    FitError
        With fewer than three different runs, or with blocks (not modelled).
    """
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, Matern, WhiteKernel

    if data.blocks is not None:
        raise FitError(f"response {response}: a Gaussian process does not model blocks; fit a polynomial")
    if len(np.unique(cells(data.points))) < 3:
        raise FitError(f"response {response}: a Gaussian process needs at least three different runs")
    coordinates = hull(space, data.points)
    columns = _columns(space, coordinates, data.points)
    scale = float(data.y.std()) or 1.0
    shape: Any = RBF if kernel == "rbf" else Matern
    options: dict[str, Any] = {} if kernel == "rbf" else {"nu": 2.5}
    start = np.ones(columns.shape[1])
    model = ConstantKernel(1.0, (1e-3, 1e4)) * shape(start, LENGTHS, **options) + WhiteKernel(
        1e-6, (1e-10, 1.0)
    )
    regressor = GaussianProcessRegressor(model, n_restarts_optimizer=RESTARTS, random_state=seed, alpha=1e-12)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        regressor.fit(columns, (data.y - data.y.mean()) / scale)
    found = regressor.kernel_
    variance = float(found.k1.k1.constant_value)
    nugget = float(np.clip(found.k2.noise_level / variance, *NUGGET))
    lengths = np.atleast_1d(np.asarray(found.k1.k2.length_scale, float))
    surface = GaussianProcessSurface(space, response, coordinates, data, kernel, lengths, variance, nugget)
    for _ in range(9):
        try:
            cho_factor(surface._correlation(surface._runs, surface._runs) + nugget * np.eye(len(data)))
            return surface
        except LinAlgError:
            nugget *= 10.0
            surface = replace(surface, nugget=nugget)
    raise FitError(
        f"response {response}: the covariance of the Gaussian process is singular; runs are too close"
    )


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


def _squares(a: Floats, b: Floats) -> Floats:
    """Squared distances, shape (len(a), len(b))."""
    from scipy.spatial.distance import cdist

    return np.asarray(cdist(a, b, "sqeuclidean"))
