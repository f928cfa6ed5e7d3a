"""Surfaces of counts and of yes/no: generalised linear models, predicted as rates and probabilities."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Annotated, Any, ClassVar, overload

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtri, ndtr, ndtri

from rsmkit.errors import FitError, RsmkitError
from rsmkit.io.strict_types import Shape
from rsmkit.language.space import Floats
from rsmkit.surfaces.estimation.coordinates import Coordinates
from rsmkit.surfaces.estimation.counts.bias_reduced import penalised_score
from rsmkit.surfaces.estimation.counts.count_limits import count_limits
from rsmkit.surfaces.estimation.counts.scoring import (
    DISTRIBUTIONS,
    Distribution,
    DistributionName,
    score,
    separated,
    wrong_count,
)
from rsmkit.surfaces.estimation.jackknife import jackknife_plus
from rsmkit.surfaces.models.polynomial import PolynomialForm, PolynomialSurface, fit_polynomial
from rsmkit.surfaces.models.surface import IntervalKind, check_confidence
from rsmkit.surfaces.reading import fail, read_form

__all__ = ["GlmSurface", "checked_sizes", "fit_glm", "no_estimate"]


@dataclass(frozen=True, eq=False)
class GlmSurface(PolynomialSurface):
    """A polynomial in the scale of the link: logit of a probability, logarithm of a rate.

    Parameters
    ----------
    distribution : {"binomial", "poisson"}
    size : array, shape (n,)
        Trials, or exposure, of each run.
    bias_reduced : bool
        Whether the estimates maximise the penalised likelihood of Firth; tests and intervals then compare its
        maxima, the penalty always that of all terms.
    """

    form: ClassVar[str] = "glm"
    normal: ClassVar[bool] = False

    distribution: DistributionName
    size: Annotated[Floats, Shape("runs")]
    bias_reduced: bool = field(default=False, kw_only=True)

    @property
    def family(self) -> Distribution:
        """Link, variance and deviance."""
        return DISTRIBUTIONS[self.distribution]

    @property
    def link_words(self) -> str:
        """The scale of the coefficients, for a title."""
        return f"{self.family.link} of the {'probability' if self.distribution == 'binomial' else 'rate'}"

    @cached_property
    def means(self) -> Floats:
        """Fitted probabilities or rates at the runs, shape (n,)."""
        return self.family.mean(self.matrix @ self.fit.coefficients)

    @cached_property
    def coefficients(self) -> Floats:
        """Coefficients in coded units, shape (p,)."""
        return np.asarray(self.coded_factor @ np.linalg.solve(self.fit.factor, self.fit.coefficients))

    def estimates_in(self, units: Coordinates) -> tuple[Floats, Floats]:
        """Coefficients in other units, shape (p,), with their factor as :attr:`coded_factor`."""
        into_units = self._conversion(units, self.coordinates).high
        return np.asarray(into_units @ self.fit.coefficients), np.asarray(into_units @ self.fit.factor)

    @property
    def covariance(self) -> Floats:
        """Inverse of the information about :attr:`coefficients`, shape (p, p)."""
        return np.asarray(self.coded_factor @ self.coded_factor.T)

    @property
    def std_errors(self) -> Floats:
        """Standard errors of :attr:`coefficients`, the variance that of the distribution, shape (p,)."""
        return np.asarray(np.linalg.norm(self.coded_factor, axis=1))

    @property
    def p_values(self) -> Floats:
        """Two-sided p-values of the coefficients by the normal distribution (Wald), shape (p,)."""
        return np.asarray(2.0 * ndtr(-np.abs(self.t_values)))

    def judged(self, row: Floats) -> tuple[float, float, float]:
        """Value, standard error and degrees of freedom of a combination, in the scale of the link."""
        return float(row @ self.fit.coefficients), float(np.linalg.norm(row @ self.fit.factor)), 1e12

    # ------------------------------------------------------------------ deviance

    @cached_property
    def deviances(self) -> Floats:
        """Contribution of each run to the deviance, shape (n,)."""
        return self.family.deviance(self.data.y, self.size, self.means)

    @property
    def deviance(self) -> float:
        """Residual deviance."""
        return float(self.deviances.sum())

    @cached_property
    def pearson(self) -> Floats:
        """Pearson residuals, shape (n,)."""
        spread = np.sqrt(self.size * self.family.spread(self.means))
        return np.asarray((self.data.y - self.size * self.means) / np.maximum(spread, 1e-150))

    @property
    def dispersion(self) -> float:
        """Pearson statistic per degree of freedom; near one when the distribution is right."""
        return float((self.pearson**2).sum() / self.fit.df) if self.fit.df else float("nan")

    def deviance_of(self, columns: Sequence[int]) -> float:
        """Deviance of a model with some of the columns alone, penalised where the estimates are."""
        return self.least_deviance(self.matrix[:, list(columns)])

    def least_deviance(self, free: Floats, offset: Floats | float = 0.0) -> float:
        """Least deviance of a linear predictor of given columns, penalised where the estimates are."""
        y, size = self.data.y, self.size
        if self.bias_reduced:
            return penalised_score(self.family, self.matrix, y, size, free)[1]
        return score(self.family, free, y, size, offset)[1]

    def confidence_intervals(self, confidence: float = 0.95) -> Floats:
        """Limits of the coefficients in coded units, shape (p, 2).

        By the profiled likelihood; of bias-reduced estimates by their standard errors.
        """
        check_confidence(confidence)
        if self.bias_reduced:
            half = float(ndtri(0.5 + 0.5 * confidence)) * self.std_errors
            return np.column_stack([self.coefficients - half, self.coefficients + half])
        rise, matrix = float(chdtri(1, 1.0 - confidence)), self.coded_matrix
        limits = np.empty((self.fit.p, 2))
        for j, (best, error) in enumerate(zip(self.coefficients, self.std_errors, strict=True)):
            others = np.delete(matrix, j, axis=1)

            def above(value: float, j: int = j, others: Floats = others) -> float:
                return self.least_deviance(others, matrix[:, j] * value) - self.deviance - rise

            limits[j] = [_limit(above, float(best), sign * float(error)) for sign in (-1.0, 1.0)]
        return limits

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
        """Predict the probability, or the rate per unit of exposure.

        Parameters are those of :meth:`PolynomialSurface.predict`. The interval of the mean is one in the
        scale of the link, turned back; the one for a new run is :meth:`predict_runs` with as many trials or
        as much exposure as the average run.
        """
        mean = self.family.mean(super().predict(points))
        if interval is None:
            return mean
        check_confidence(interval)
        if kind == "jackknife+":
            return jackknife_plus(self, self._points(points), interval)
        if kind == "prediction":
            return self.predict_runs(points, interval)
        eta, error = self._in_link(points)
        half = float(ndtri(0.5 + 0.5 * interval)) * error
        return mean, self.family.mean(eta - half), self.family.mean(eta + half)

    def predict_runs(
        self, points: ArrayLike, interval: float, size: Floats | None = None
    ) -> tuple[Floats, Floats, Floats]:
        """Predict the share or the rate that runs of given sizes will show.

        The limits are those of a count (:func:`rsmkit.surfaces.estimation.counts.count_limits.count_limits`)
        over its size, and never inside the interval of the mean.

        Parameters
        ----------
        points : array, shape (n, k)
        interval : float
            Confidence.
        size : array, shape (n,), optional
            Trials or exposure at each point; nan, or left out, for that of the average run.

        Returns
        -------
        mean, low, high : array, shape (n,)
        """
        mean, low, high = self.predict(points, interval, "mean")
        eta, error = self._in_link(points)
        given = np.full(len(mean), np.nan) if size is None else size
        sizes = np.where(np.isfinite(given), given, self.size.mean())
        if self.distribution == "binomial":
            sizes = np.maximum(np.round(sizes), 1.0)
        least, most = count_limits(self.distribution, eta, error, sizes, interval)
        return mean, np.minimum(low, least / sizes), np.maximum(high, most / sizes)

    def sampling_sd(self, points: ArrayLike, size: Floats | None = None) -> Floats:
        """Standard deviation of the share or the rate that runs of given sizes show, shape (n,).

        That of the distribution at the predicted mean; `size` as of :meth:`predict_runs`.
        """
        mean = self.predict(points)
        given = np.full(len(mean), np.nan) if size is None else size
        sizes = np.where(np.isfinite(given), given, self.size.mean())
        return np.asarray(np.sqrt(self.family.spread(mean) / sizes))

    def _in_link(self, points: ArrayLike) -> tuple[Floats, Floats]:
        """Linear predictor and its standard error at points, shape (n,) each."""
        rows = self.rows(self._points(points))
        return rows @ self.fit.coefficients, np.linalg.norm(rows @ self.fit.factor, axis=1)

    def gradient(self, points: ArrayLike) -> Floats:
        """Derivatives of the predicted mean by the factors, natural units, shape (n, k)."""
        slope = self.family.spread(self.predict(points))
        return np.asarray(slope[:, None] * super().gradient(points))

    @cached_property
    def loo_residuals(self) -> Floats:
        """Share or rate of each run minus its prediction without the run, shape (n,); one step of scoring."""
        return np.asarray(self.data.y / self.size - np.diag(self.predictions_without(self.data.points)))

    def predictions_without(self, points: ArrayLike) -> Floats:
        """Predict without each of the runs, by one step of scoring, shape (m, n)."""
        raw = self.data.y - self.size * self.means
        moved = self.rows(self._points(points)) @ self.fit.factor @ (self.matrix @ self.fit.factor).T
        eta = super().predict(points)[:, None] - moved * (raw / (1.0 - np.minimum(self.fit.leverages, 0.999)))
        return self.family.mean(eta)

    def refined(self, start: Floats | None = None) -> GlmSurface:
        """The surface as it is."""
        return self

    # ------------------------------------------------------------------ files

    @classmethod
    def from_json(cls, document: Any) -> GlmSurface:
        """Read what :meth:`to_json` wrote, checking that it belongs together."""
        return cls.from_form(read_form(GlmForm, document))

    def to_form(self) -> GlmForm:
        """Show how it is written."""
        return GlmForm(
            **self._written(),
            distribution=self.distribution,
            size=self.size,
            bias_reduced=self.bias_reduced,
        )

    @classmethod
    def from_form(cls, form: PolynomialForm) -> GlmSurface:
        """Inverse of :meth:`to_form`."""
        if not isinstance(form, GlmForm):
            raise fail("it has no distribution")
        space, terms, coordinates, runs = form.fitted()
        plain = fit_polynomial(space, form.response, runs, terms, coordinates)
        found = fit_glm(plain, form.distribution, form.size, bias_reduced=form.bias_reduced)
        same = form.coefficients.shape == found.fit.coefficients.shape
        if not same or not np.allclose(form.coefficients, found.fit.coefficients, rtol=1e-5, atol=1e-6):
            raise fail(f"the coefficients of {form.response} do not follow from the runs beside them")
        fit = replace(found.fit, coefficients=form.coefficients, factor=form.factor)
        return replace(found, fit=fit, note=form.note)


@dataclass(frozen=True, kw_only=True)
class GlmForm(PolynomialForm):
    """How it is written: a polynomial, with the distribution and the sizes of the runs."""

    distribution: DistributionName
    size: Annotated[Floats, Shape("sizes")]
    bias_reduced: bool = False


def fit_glm(
    plain: PolynomialSurface, distribution: DistributionName, size: Floats, *, bias_reduced: bool = False
) -> GlmSurface:
    """Fit the terms of a polynomial to counts; the estimates are those of statsmodels.

    Parameters
    ----------
    plain : PolynomialSurface
        Fitted to the counts by ordinary least squares.
    distribution : {"binomial", "poisson"}
    size : array, shape (n,)
        Trials, or exposure, of each run.
    bias_reduced : bool
        Maximise the penalised likelihood of Firth, which has a finite maximum whatever the runs show, see
        :func:`rsmkit.surfaces.estimation.counts.bias_reduced.penalised_score`.

    Raises
    ------
    FitError
        When every run is alike, or when the runs are separated, naming the terms.
    """
    matrix, y, family = plain.matrix, plain.data.y, DISTRIBUTIONS[distribution]
    if bias_reduced:
        beta, _ = penalised_score(family, matrix, y, size)
    elif why := no_estimate(plain, distribution, size):
        remedy = "Leave terms out, add runs near the border, or take bias-reduced estimates (--bias-reduced)"
        raise FitError(f"response {plain.response}: {why}. {remedy}")
    else:
        beta = _likeliest(distribution, matrix, y, size)
    mean = family.mean(matrix @ beta)
    root = np.sqrt(size * family.spread(mean))
    q, r = np.linalg.qr(matrix * root[:, None])
    fit = replace(
        plain.fit,
        coefficients=beta,
        factor=np.linalg.inv(r),
        residuals=y - size * mean,
        leverages=np.einsum("ij,ij->i", q, q),
    )
    return GlmSurface(
        plain.space,
        plain.response,
        plain.terms,
        plain.coordinates,
        plain.data,
        fit,
        distribution,
        size,
        bias_reduced=bias_reduced,
    )


def _likeliest(distribution: DistributionName, matrix: Floats, y: Floats, size: Floats) -> Floats:
    """Estimates of largest likelihood, which must exist, shape (p,)."""
    from statsmodels.genmod.families import Binomial, Poisson
    from statsmodels.genmod.generalized_linear_model import GLM

    start, _ = score(DISTRIBUTIONS[distribution], matrix, y, size)
    if distribution == "binomial":
        model = GLM(y / size, matrix, Binomial(), var_weights=size)
    else:
        model = GLM(y, matrix, Poisson(), offset=np.log(size))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of separation, which was looked for, or of runs fitted exactly
        return np.asarray(model.fit(start_params=start, tol=1e-12, maxiter=100).params)


def no_estimate(plain: PolynomialSurface, distribution: DistributionName, size: Floats) -> str:
    """Why the likelihood of counts has no maximum: all runs alike, or separated; empty where it has one."""
    y = plain.data.y
    every = distribution == "binomial" and bool((y == size).all())
    if every or not y.any():
        none = f"not one {'success' if distribution == 'binomial' else 'event'} in {len(y)} runs"
        told = f"every trial of {len(y)} runs a success" if every else none
        return f"{told}, so nothing tells how it depends on the factors"
    lost = separated(distribution, plain.matrix, y, size, plain.names)
    if not lost:
        return ""
    what = "only yes or only no" if distribution == "binomial" else "no event at all"
    return (
        f"the runs are separated: a combination of {', '.join(lost)} tells runs with {what} from the others "
        "without exception, so these coefficients have no finite estimate"
    )


def checked_sizes(
    response: str,
    distribution: DistributionName,
    y: Floats,
    size: Floats | None,
    rows: Sequence[int] | None = None,
) -> Floats:
    """Trials or exposures of the runs, found to go with their counts; one each where nothing is said.

    Parameters
    ----------
    response : str
    distribution : {"binomial", "poisson"}
    y : array, shape (n,)
        Counts.
    size : array, shape (n,), optional
    rows : sequence of int, optional
        Row of each run in the table that the counts are from.

    Raises
    ------
    RsmkitError
        Naming the first count or size that cannot be.
    """
    sizes = np.ones(len(y)) if size is None else size
    what, places = ("run", range(1, len(y) + 1)) if rows is None else ("row", rows)
    for place, count, own in zip(places, y.tolist(), sizes.tolist(), strict=True):
        if wrong := wrong_count(distribution, count, own, stated=size is not None):
            raise RsmkitError(f"response {response}, {what} {place}: {wrong}")
    return sizes


def _limit(above: Any, best: float, step: float) -> float:
    """Where the profiled deviance has risen enough, going from the estimate by `step`."""
    from scipy.optimize import brentq

    inside, outside = best, best + step
    for _ in range(40):
        if above(outside) > 0:
            low, high = min(inside, outside), max(inside, outside)
            return float(brentq(above, low, high, xtol=1e-10 + 1e-9 * abs(step)))
        inside, outside = outside, outside + 2.0 * (outside - best)
    return float(np.copysign(np.inf, step))
