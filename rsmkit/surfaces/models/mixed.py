"""Polynomial surfaces of runs made in groups that are a sample: split plots, random blocks.

The fixed part is a polynomial like any other, estimated by generalised least squares; what it is worth is
judged with the variances of groups and runs (Goos & Jones, *Optimal Design of Experiments*, 2011, ch. 10).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, overload

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import stdtrit

from rsmkit.errors import FitError, one_of
from rsmkit.language.space import Floats
from rsmkit.surfaces.estimation.coordinates import Coordinates
from rsmkit.surfaces.estimation.jackknife import jackknife_plus
from rsmkit.surfaces.estimation.least_squares import LeastSquares, two_sided_p
from rsmkit.surfaces.estimation.mixed.kenward_roger import DfMethod, FixedTest, Inference
from rsmkit.surfaces.estimation.mixed.reml import Reml, random_groups, reml
from rsmkit.surfaces.estimation.mixed.variance_profile import variance_intervals
from rsmkit.surfaces.models.polynomial import PolynomialForm, PolynomialSurface, fit_polynomial
from rsmkit.surfaces.models.surface import IntervalKind, check_confidence
from rsmkit.surfaces.reading import fail, read_form

__all__ = ["MixedSurface", "fit_mixed"]

STEP = 1e-4
"""Relative difference of a variance for derivatives of a prediction's variance."""
LEVEL = 1e-4
"""Slope of the deviance by the logarithm of a variance that is a minimum but for rounding."""


@dataclass(frozen=True, eq=False)
class GeneralisedFit(LeastSquares):
    """Generalised least squares in the words of ordinary ones.

    Parameters
    ----------
    run_variance : float
    errors : array, shape (n,)
        Of the fixed part at each run when it is estimated without it.
    least_df : int
        Smallest degrees of freedom of a coefficient, rounded down: what sums over all terms are judged by.
    """

    run_variance: float
    errors: Floats
    least_df: int

    @property
    def df(self) -> int:
        """Degrees of freedom of the least certain coefficient."""
        return self.least_df

    @cached_property
    def sigma(self) -> float:
        """Standard deviation of a run within its group."""
        return float(np.sqrt(self.run_variance))

    @cached_property
    def loo_residuals(self) -> Floats:
        """Error of the fixed part at each run when it is estimated without the run, shape (n,)."""
        return self.errors


@dataclass(frozen=True, eq=False)
class MixedSurface(PolynomialSurface):
    """A polynomial and groups of runs whose effects are random.

    Parameters
    ----------
    mixed : Reml
        Variances; matrices in working coordinates.
    method : {"kenward-roger", "kenward-roger-observed", "satterthwaite"}
        How degrees of freedom are found.
    """

    form: ClassVar[str] = "mixed"

    mixed: Reml
    method: DfMethod = field(default="kenward-roger", kw_only=True)

    # ------------------------------------------------------------------ coefficients

    @cached_property
    def inference(self) -> Inference:
        """Covariances, degrees of freedom and tests, in working coordinates."""
        return Inference(self.mixed, self.method)

    @cached_property
    def into_coded(self) -> Floats:
        """Matrix from coefficients in working coordinates to those in coded units, shape (p, p)."""
        return self._conversion(self.own_units, self.coordinates).high

    @cached_property
    def coefficients(self) -> Floats:
        """Coefficients in coded units, shape (p,)."""
        return np.asarray(self.into_coded @ self.fit.coefficients)

    def estimates_in(self, units: Coordinates) -> tuple[Floats, Floats]:
        """Coefficients in other units, shape (p,), with their factor as :attr:`coded_factor`."""
        into_units = self._conversion(units, self.coordinates).high
        return np.asarray(into_units @ self.fit.coefficients), np.asarray(into_units @ self.fit.factor)

    @property
    def covariance(self) -> Floats:
        """Covariance of :attr:`coefficients` with the variances taken as known, shape (p, p)."""
        return np.asarray(self.into_coded @ self.mixed.covariance @ self.into_coded.T)

    @cached_property
    def adjusted_covariance(self) -> Floats:
        """The same with the adjustment of Kenward and Roger: what tests and intervals use."""
        return np.asarray(self.into_coded @ self.inference.covariance @ self.into_coded.T)

    @cached_property
    def std_errors(self) -> Floats:
        """Standard errors, shape (p,); nan where they depend on a variance that is unknown."""
        return np.where(np.isnan(self.degrees_of_freedom), np.nan, np.sqrt(np.diag(self.covariance)))

    @cached_property
    def adjusted_std_errors(self) -> Floats:
        """Standard errors that tests and intervals use, shape (p,)."""
        errors = np.sqrt(np.diag(self.adjusted_covariance))
        return np.where(np.isnan(self.degrees_of_freedom), np.nan, errors)

    @cached_property
    def degrees_of_freedom(self) -> Floats:
        """Degrees of freedom of each coefficient, shape (p,); nan where there are none."""
        return self.inference.degrees(self.into_coded)

    @property
    def t_values(self) -> Floats:
        """Coefficients in adjusted standard errors, shape (p,)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return self.coefficients / self.adjusted_std_errors

    @property
    def p_values(self) -> Floats:
        """Two-sided p-values of the coefficients, shape (p,)."""
        pairs = zip(self.t_values, self.degrees_of_freedom, strict=True)
        return np.array([float(two_sided_p(t, df)) if df > 0 else np.nan for t, df in pairs])

    def confidence_intervals(self, confidence: float = 0.95) -> Floats:
        """Confidence limits of the coefficients, shape (p, 2); infinite where nothing is known."""
        half = self._quantiles(self.degrees_of_freedom, confidence) * np.sqrt(
            np.diag(self.adjusted_covariance)
        )
        return np.column_stack([self.coefficients - half, self.coefficients + half])

    @property
    def deviance(self) -> float:
        """Minus twice the restricted log-likelihood, terms in coded units."""
        return self.mixed.deviance - 2.0 * float(np.linalg.slogdet(self.into_coded)[1])

    def judged(self, row: Floats) -> tuple[float, float, float]:
        """Value, adjusted standard error and degrees of freedom of a combination, working coordinates."""
        df = float(self.inference.degrees(row[None])[0])
        error = math.sqrt(row @ self.inference.covariance @ row) if df > 0 else math.nan
        return float(row @ self.fit.coefficients), error, df

    def test(self, rows: Floats) -> FixedTest:
        """F test that combinations of the coefficients in coded units are zero; `rows` has shape (m, p)."""
        return self.inference.test(rows @ self.into_coded)

    def variance_intervals(self, confidence: float = 0.95) -> Floats:
        """Profile limits of the variances of the groups and of a run, shape (r + 1, 2)."""
        return variance_intervals(self.mixed.contrasts, self.mixed.variances, confidence)

    # ------------------------------------------------------------------ prediction

    @overload
    def predict(self, points: ArrayLike, interval: None = None) -> Floats: ...
    @overload
    def predict(
        self, points: ArrayLike, interval: float, kind: IntervalKind = "prediction"
    ) -> tuple[Floats, Floats, Floats]: ...
    def predict(
        self, points: ArrayLike, interval: float | None = None, kind: IntervalKind = "prediction"
    ) -> Floats | tuple[Floats, Floats, Floats]:
        """Predict by the fixed part; a prediction interval is that of a run in new groups.

        Parameters are those of :meth:`PolynomialSurface.predict`.
        """
        mean = super().predict(points)
        if interval is None:
            return mean
        check_confidence(interval)
        if kind == "jackknife+":
            return jackknife_plus(self, self._points(points), interval)
        rows = self.rows(self._points(points))
        value = np.einsum("mp,pq,mq->m", rows, self.inference.covariance, rows)
        extra = np.ones(len(self.mixed.variances)) if kind == "prediction" else None
        value = value + (self.mixed.variances.sum() if kind == "prediction" else 0.0)
        half = self._quantiles(self.inference.degrees(rows, extra), interval) * np.sqrt(value)
        return mean, mean - half, mean + half

    def predict_in(
        self, points: ArrayLike, groups: Mapping[str, str], interval: float | None = None
    ) -> Floats | tuple[Floats, Floats, Floats]:
        """Predict a run in groups of the fit; kinds that are not named are new.

        Parameters
        ----------
        points : array, shape (n, k)
            Natural units.
        groups : mapping of str to str
            Group of each kind, such as ``{"plot": "3"}``.
        interval : float, optional
            Confidence of an interval for one new run.
        """
        wanted = [self._group(name, level) for name, level in groups.items()]
        shift = float(sum(self.mixed.effects[i][j] for i, j in wanted))
        mean: Floats = super().predict(points) + shift
        if interval is None:
            return mean
        check_confidence(interval)
        rows = self.rows(self._points(points))
        value = _variance_in(self.mixed, rows, wanted)
        slopes = np.column_stack(
            [_slope_in(self.mixed, rows, wanted, i) for i in range(len(self.mixed.variances))]
        )
        half = self._quantiles(self.inference.degrees_of(value, slopes), interval) * np.sqrt(value)
        return mean, mean - half, mean + half

    def _group(self, name: str, level: str) -> tuple[int, int]:
        kinds = [group.name for group in self.mixed.groups]
        i = kinds.index(one_of("random groups", name, kinds))
        return i, self.mixed.groups[i].levels.index(one_of(name, level, self.mixed.groups[i].levels))

    @staticmethod
    def _quantiles(degrees: Floats, confidence: float) -> Floats:
        """Of Student's t; infinite without degrees of freedom."""
        known = np.nan_to_num(degrees, nan=1.0, posinf=1e12)
        return np.where(np.isnan(degrees), np.inf, stdtrit(known, 0.5 + 0.5 * confidence))

    def predictions_without(self, points: ArrayLike) -> Floats:
        """Predict by the fixed part without each of the runs, the variances kept, shape (m, n)."""
        moved = self.rows(self._points(points)) @ self.mixed.covariance @ self.mixed.weighted.T
        errors = np.where(np.isfinite(self.mixed.deleted), self.mixed.deleted, 0.0)
        return np.asarray(self.predict(points)[:, None] - moved * errors)

    def refined(self, start: Floats | None = None) -> MixedSurface:
        """The surface as it is: digits beyond those of the variances mean nothing."""
        return self

    # ------------------------------------------------------------------ files

    @classmethod
    def from_json(cls, document: Any) -> MixedSurface:
        """Read what :meth:`to_json` wrote, checking that it belongs together."""
        return cls.from_form(read_form(MixedForm, document))

    def to_form(self) -> MixedForm:
        """Show how it is written."""
        return MixedForm(**self._written(), variances=self.mixed.variances.tolist(), method=self.method)

    @classmethod
    def from_form(cls, form: PolynomialForm) -> MixedSurface:
        """Inverse of :meth:`to_form`."""
        if not isinstance(form, MixedForm):
            raise fail("it has no random groups")
        space, terms, coordinates, runs = form.fitted()
        if not runs.random or len(form.variances) != len(runs.random) + 1:
            raise fail("variances should hold one number per kind of groups and one for the runs")
        if min(form.variances) < 0 or form.variances[-1] <= 0:
            raise fail("variances should not be negative")
        plain = fit_polynomial(space, form.response, runs, terms, coordinates)
        found = fit_mixed(plain, form.method, np.array(form.variances))
        scale = 1e-6 * np.abs(runs.y).max()
        _, slopes = found.mixed.contrasts.deviance(found.mixed.variances)
        if np.abs(slopes * found.mixed.variances).max() > LEVEL:
            raise fail(f"the variances of {form.response} do not follow from the runs beside them")
        if form.coefficients.shape != found.fit.coefficients.shape or not np.allclose(
            form.coefficients, found.fit.coefficients, rtol=1e-6, atol=scale
        ):
            raise fail(f"the coefficients of {form.response} do not follow from the runs beside them")
        return replace(found, note=form.note)


@dataclass(frozen=True, kw_only=True)
class MixedForm(PolynomialForm):
    """How it is written: a polynomial, with the variances of its groups and of a run."""

    variances: list[float]
    method: DfMethod


def fit_mixed(
    plain: PolynomialSurface, method: DfMethod = "kenward-roger", variances: Floats | None = None
) -> MixedSurface:
    """Fit the terms of a polynomial with the random groups of its runs.

    Parameters
    ----------
    plain : PolynomialSurface
        Fitted by ordinary least squares to runs with ``data.random``.
    method : {"kenward-roger", "kenward-roger-observed", "satterthwaite"}
    variances : array, shape (r + 1,), optional
        Of the groups and of a run, where they are known from a fit before.

    Raises
    ------
    FitError
        When groups are none, or nothing is left to estimate variances from.
    """
    data = plain.data
    try:
        mixed = reml(plain.matrix, data.y, random_groups(data.random or {}), data.weights, variances)
    except FitError as error:
        raise FitError(f"response {plain.response}: {error}") from None
    degrees = Inference(mixed, method).degrees(np.eye(plain.fit.p))
    known = degrees[np.isfinite(degrees)]
    weights = np.ones(len(data)) if data.weights is None else data.weights
    spread = mixed.matrix @ mixed.covariance
    fit = GeneralisedFit(
        coefficients=mixed.coefficients,
        factor=mixed.factor,
        y=data.y,
        residuals=data.y - plain.matrix @ mixed.coefficients,
        weights=weights,
        leverages=np.einsum("ij,ij->i", spread, mixed.weighted),
        effects=mixed.variances[-1] * mixed.factor.T @ (mixed.weighted.T @ mixed.y),
        has_constant=plain.fit.has_constant,
        run_variance=float(mixed.variances[-1]),
        errors=mixed.loo_residuals / np.sqrt(weights),
        least_df=max(1, int(known.min() + 1e-6)) if known.size else 1,
    )
    return MixedSurface(
        plain.space, plain.response, plain.terms, plain.coordinates, data, fit, mixed, method=method
    )


def _variance_in(mixed: Reml, rows: Floats, wanted: list[tuple[int, int]]) -> Floats:
    """Mean square error of predicting a new run in given groups, shape (m,).

    With c the covariance of the runs with the groups: ``c0 - c'V^-1c + d'Phi d``, ``d = x - X'V^-1c``.
    """
    shared = np.zeros(len(mixed.y))
    for i, j in wanted:
        shared += mixed.variances[i] * mixed.columns[i][:, j]
    pull = mixed.solve(shared[:, None])[:, 0]
    difference = rows - mixed.matrix.T @ pull
    inner = np.einsum("mp,pq,mq->m", difference, mixed.covariance, difference)
    return np.asarray(mixed.variances.sum() - shared @ pull + inner)


def _slope_in(mixed: Reml, rows: Floats, wanted: list[tuple[int, int]], which: int) -> Floats:
    """Derivative of :func:`_variance_in` by one variance, shape (m,); to one side at zero."""
    value = mixed.variances[which]
    step = STEP * (value or mixed.variances[-1])
    sides = []
    for moved in (value + step, value - step if value else value):
        variances = mixed.variances.copy()
        variances[which] = moved
        sides.append(_variance_in(replace(mixed, variances=variances), rows, wanted))
    return np.asarray((sides[0] - sides[1]) / (step * (2.0 if value else 1.0)))
