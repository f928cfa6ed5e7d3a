"""Polynomial response surfaces: first, second, third order or any subset of terms.

Myers, Montgomery & Anderson-Cook, *Response Surface Methodology*, 4th ed., chapters 2, 6 and 7.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, Self, overload

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import stdtrit

from rsmkit.errors import FitError, RsmkitError
from rsmkit.language.space import Floats, Space
from rsmkit.language.terms import Terms
from rsmkit.surfaces.estimation.coordinates import Coordinates, conversion, hull, reported, working
from rsmkit.surfaces.estimation.double_double import DoubleDouble, double_double
from rsmkit.surfaces.estimation.fit_data import FitData
from rsmkit.surfaces.estimation.jackknife import jackknife_plus
from rsmkit.surfaces.estimation.least_squares import LeastSquares, least_squares, two_sided_p
from rsmkit.surfaces.estimation.refining import precise_columns, precise_residuals, refined
from rsmkit.surfaces.models.polynomial_form import PolynomialForm
from rsmkit.surfaces.models.surface import IntervalKind, check_confidence
from rsmkit.surfaces.reading import (
    ModelDocument,
    fail,
    write_limits,
    write_space,
)

__all__ = ["PolynomialForm", "PolynomialSurface", "fit_polynomial", "with_blocks"]

CHUNK = 8192


@dataclass(frozen=True, eq=False)
class PolynomialSurface(ModelDocument):
    """A polynomial fitted by least squares.

    Parameters
    ----------
    space : Space
    response : str
    terms : Terms
        Of the polynomial; block effects come on top.
    coordinates : Coordinates
        In which the polynomial is evaluated; see :mod:`rsmkit.surfaces.estimation.coordinates`.
    data : FitData
        Runs it was fitted to.
    fit : LeastSquares
        Columns: the constant, the blocks after the first, the other terms.
    note : str
        What a reader of the statistics should know about how the model was chosen.
    considered : Terms, optional
        All terms that these were chosen from with the same runs: intervals of predictions take the error and
        the leverage of that model, because those of the terms kept cover 77-84 % instead of 95 %.
    """

    form: ClassVar[str] = "polynomial"
    normal: ClassVar[bool] = True
    """Whether runs are taken as normal with one variance, so that residuals tell outliers."""

    space: Space
    response: str
    terms: Terms
    coordinates: Coordinates
    data: FitData
    fit: LeastSquares
    note: str = field(default="", kw_only=True)
    considered: Terms | None = field(default=None, kw_only=True)

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
        """Predict the response, on average over the blocks.

        Parameters
        ----------
        points : array, shape (n, k)
            Natural units.
        interval : float, optional
            Confidence in (0, 1), for instance 0.95.
        kind : {"prediction", "mean", "jackknife+"}
            Interval for one new run, for the expected response, or for one new run from errors at runs left
            out (:mod:`rsmkit.surfaces.estimation.jackknife`).

        Returns
        -------
        mean : array, shape (n,)
        low, high : array, shape (n,)
            Only with `interval`; infinite when the fit has no degrees of freedom left.
        """
        x = self._points(points)
        mean = self.terms.evaluate(self.coordinates.forward(x), self.working_coefficients)
        if interval is None:
            return mean
        check_confidence(interval)
        judge = self.judge
        if kind == "jackknife+":
            return mean, *jackknife_plus(judge, x, interval)[1:]
        if judge.fit.df == 0:
            return mean, np.full_like(mean, -np.inf), np.full_like(mean, np.inf)
        variance = judge.leverage(points) + (kind == "prediction")
        half = float(stdtrit(judge.fit.df, 0.5 + 0.5 * interval)) * judge.fit.sigma * np.sqrt(variance)
        return mean, mean - half, mean + half

    @cached_property
    def judge(self) -> PolynomialSurface:
        """The model whose error and leverage make the intervals: with all terms considered."""
        if self.considered is None:
            return self
        return fit_polynomial(self.space, self.response, self.data, self.considered, self.coordinates)

    def gradient(self, points: ArrayLike) -> Floats:
        """Derivatives of the prediction by the factors, natural units, shape (n, k)."""
        x = self._points(points)
        z = self.coordinates.forward(x)
        return self.terms.slopes(z, self.working_coefficients) * self.coordinates.slopes(x)

    def leverage(self, points: ArrayLike) -> Floats:
        """Variance of the predicted mean in units of sigma squared, shape (n,)."""
        x = self._points(points)
        values = np.empty(len(x))
        for start in range(0, len(x), CHUNK):
            part = slice(start, start + CHUNK)
            spread = self.rows(x[part]) @ self.fit.factor
            values[part] = np.einsum("ij,ij->i", spread, spread)
        return values

    @property
    def box_of_runs(self) -> Coordinates:
        """Coordinates that put the ends of the runs at -1 and 1 (with the stretches of the surface)."""
        return self.coordinates if self.terms.hierarchical else hull(self.space, self.data.points)

    def smoothed(self, points: ArrayLike, values: Floats) -> Floats:
        """Fit other values at the runs, shape (n,), with the same columns and predict them, shape (m,)."""
        coefficients = self.fit.factor @ (self.fit.factor.T @ (self.matrix.T @ (self.fit.weights * values)))
        return np.asarray(self.rows(self._points(points)) @ coefficients)

    @property
    def loo_residuals(self) -> Floats:
        """Error of predicting each run from the others, shape (n,)."""
        return self.fit.loo_residuals

    def predictions_without(self, points: ArrayLike) -> Floats:
        """Predict without each of the runs, exact without refitting, shape (m, n)."""
        x = self._points(points)
        moved = self.rows(x) @ self.fit.factor @ (self.matrix @ self.fit.factor).T
        errors = np.where(np.isfinite(self.loo_residuals), self.loo_residuals, 0.0)
        return np.asarray(self.predict(x)[:, None] - moved * (self.fit.weights * errors))

    # ------------------------------------------------------------------ units of the report

    @property
    def units(self) -> str:
        """Units of :attr:`coefficients`.

        ``coded``; ``proportions`` of the components of a mixture, other factors coded; ``stretched``.
        """
        return "proportions" if self.terms.components else "coded"

    @cached_property
    def own_units(self) -> Coordinates:
        """Units of :attr:`coefficients` as coordinates, unstretched."""
        return reported(self.space, self.terms)

    def to_units(self, natural: Floats) -> Floats:
        """Natural units to those of the coefficients, shape (..., k)."""
        return self.own_units.forward(natural)

    def from_units(self, values: Floats) -> Floats:
        """Inverse of :meth:`to_units`."""
        return self.own_units.backward(values)

    # ------------------------------------------------------------------ coefficients

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the coefficients: the constant ``1``, blocks ``block[2]``, then the terms."""
        return (*_names(self.terms, self.space, self.data), *self._extra_names())

    @cached_property
    def groups(self) -> tuple[str, ...]:
        """Group of each coefficient: ``""`` (constant), ``block``, ``FO``, ``TWI``, ``PQ``, ``cubic``."""
        groups, extra = self.terms.groups, ("stretch",) * self._extra_count
        return (*groups[:1], *(("block",) * self._block_count), *groups[1:], *extra)

    @cached_property
    def coefficients(self) -> Floats:
        """Coefficients in coded units, shape (p,): those of :meth:`refined`, converted before rounding."""
        return self.estimates_in(self.own_units)[0]

    @cached_property
    def coded_factor(self) -> Floats:
        """Like :attr:`LeastSquares.factor`, for the coefficients in coded units."""
        return np.asarray(self._conversion(self.own_units, self.coordinates).high @ self.fit.factor)

    def estimates_in(self, units: Coordinates) -> tuple[Floats, Floats]:
        """Coefficients in other units, shape (p,), with their factor as :attr:`coded_factor`, unstretched."""
        into_units = self._conversion(units, self.coordinates)
        found = (into_units.T * self._refined_coefficients[:, None]).total().high
        return found, np.asarray(into_units.high @ self.fit.factor)

    def rows_in(self, units: Coordinates) -> Floats:
        """Coefficients in other units as combinations of those in working coordinates, shape (p, p)."""
        return self._conversion(units, self.coordinates).high

    @property
    def covariance(self) -> Floats:
        """Covariance of :attr:`coefficients`, shape (p, p)."""
        return self.fit.sigma**2 * self.coded_factor @ self.coded_factor.T

    @property
    def std_errors(self) -> Floats:
        """Standard errors of :attr:`coefficients`, shape (p,)."""
        lengths = np.sqrt(np.einsum("ij,ij->i", self.coded_factor, self.coded_factor))
        return np.asarray(self.fit.sigma * lengths)

    @property
    def t_values(self) -> Floats:
        """Coefficients in standard errors, shape (p,); nan where residuals are rounding errors."""
        if self.fit.exact:
            return np.full(len(self.coefficients), np.nan)
        with np.errstate(divide="ignore", invalid="ignore"):
            return self.coefficients / self.std_errors

    @property
    def p_values(self) -> Floats:
        """Two-sided p-values of the coefficients, shape (p,)."""
        return two_sided_p(self.t_values, self.fit.df)

    def judged(self, row: Floats) -> tuple[float, float, float]:
        """Value, standard error and df of a combination of coefficients in working coordinates."""
        error = self.fit.sigma * np.linalg.norm(row @ self.fit.factor)
        return float(row @ self.fit.coefficients), float(error), float(self.fit.df)

    def group_squares(self, columns: Sequence[int]) -> float:
        """Sum of squares of several coefficients after all others.

        ``b' (F F')^-1 b`` with F the rows of :attr:`coded_factor` (a Wald test, exact for linear models). In
        coded units, because a lower group left out of a centred polynomial is a different polynomial in
        other units.
        """
        b, factor = self.coefficients[list(columns)], self.coded_factor[list(columns)]
        solved = np.linalg.lstsq(factor, b, rcond=None)[0]
        return float(solved @ solved)

    def confidence_intervals(self, confidence: float = 0.95) -> Floats:
        """Confidence limits of the coefficients, shape (p, 2); nan where the same runs chose the terms."""
        if self.considered is not None:
            return np.full((self.fit.p, 2), np.nan)
        if self.fit.df == 0:
            return np.tile([-np.inf, np.inf], (self.fit.p, 1))
        half = float(stdtrit(self.fit.df, 0.5 + 0.5 * confidence)) * self.std_errors
        return np.column_stack([self.coefficients - half, self.coefficients + half])

    @cached_property
    def coded_matrix(self) -> Floats:
        """Design matrix of the runs in coded units, columns as in :attr:`names`, shape (n, p)."""
        coded = self.to_units(self.data.points)
        return with_blocks(self.terms.matrix(coded), self.data.block_columns())

    def polynomial(self) -> tuple[Terms, Floats]:
        """Terms and coefficients in coded units of the predicted surface (blocks averaged)."""
        return self.terms, self.over_blocks(self.coefficients)

    @cached_property
    def matrix(self) -> Floats:
        """Design matrix of the runs in working coordinates, columns as in :attr:`names`, shape (n, p)."""
        return self._columns(self.data.points, self.data.block_columns())

    def with_estimates(self, coefficients: Floats, factor: Floats | None = None) -> Self:
        """Same model with coefficients (working coordinates) estimated elsewhere."""
        fit = replace(
            self.fit,
            coefficients=coefficients,
            factor=self.fit.factor if factor is None else factor,
            residuals=self._residuals(coefficients),
        )
        return replace(self, fit=fit)

    def refined(self, start: Floats | None = None) -> Self:
        """Same model with coefficients and residuals that are right to the last bit.

        Parameters
        ----------
        start : array, shape (p,), optional
            First estimate, working coordinates; the model's own by default.
        """
        start = self.fit.coefficients if start is None else start
        return self.with_estimates(refined(self._precise_columns, self.data, start, self.fit.factor).high)

    def drawn(self, count: int, rng: np.random.Generator) -> tuple[Floats, Floats, tuple[Coordinates, ...]]:
        """Draw coefficients from what the runs leave open: a multivariate t distribution (flat prior).

        Returns
        -------
        coefficients : array, shape (terms, count)
            Of the terms, working coordinates; those of the surface itself without degrees of freedom.
        sigmas : array, shape (count,)
            Standard deviation of a run in each draw.
        coordinates : tuple of Coordinates
            Of each draw where they are uncertain too (a stretch); else empty.
        """
        df = self.fit.df
        sigmas = self.fit.sigma * np.sqrt(df / rng.chisquare(df, count)) if df else np.zeros(count)
        steps = self.fit.factor @ rng.standard_normal((self.fit.factor.shape[1], count)) * sigmas
        return self.over_blocks(self.fit.coefficients[:, None] + steps), sigmas, ()

    @cached_property
    def term_factor(self) -> Floats:
        """Rows of :attr:`coded_factor` that belong to the terms of :meth:`polynomial`, shape (terms, p)."""
        return self.over_blocks(self.coded_factor)

    # ------------------------------------------------------------------ files

    def to_form(self) -> PolynomialForm:
        """Show how it is written."""
        return PolynomialForm(**self._written())

    @classmethod
    def from_form(cls, form: PolynomialForm) -> PolynomialSurface:
        """Inverse of :meth:`to_form`."""
        space, terms, coordinates, runs = form.fitted()
        return fit_polynomial(space, form.response, runs, terms, coordinates).restored(form)

    def _written(self) -> dict[str, Any]:
        return {
            "model": self.form,
            "response": self.response,
            "factors": write_space(self.space),
            "terms": self.terms.exponents,
            "low": np.array(self.coordinates.low),
            "high": np.array(self.coordinates.high),
            "coefficients": self.fit.coefficients,
            "factor": self.fit.factor,
            "sigma": self.fit.sigma if self.fit.df else None,
            "runs": self.data,
            "note": self.note,
            "contrasts": None if self.terms.contrasts == "treatment" else self.terms.contrasts,
            "components": self.terms.components or None,
            "limits": write_limits(self.space),
            "considered": None if self.considered is None else self.considered.exponents,
        }

    def restored(self, form: PolynomialForm) -> Self:
        """Put the stored numbers in place of the recomputed ones after comparing them."""
        coefficients, factor = form.coefficients, form.factor
        scale = 1e-6 * np.abs(self.data.y).max()
        same = coefficients.shape == self.fit.coefficients.shape and factor.shape == self.fit.factor.shape
        same = same and np.allclose(coefficients, self.fit.coefficients, rtol=1e-6, atol=scale)
        same = same and np.allclose(factor, self.fit.factor, rtol=1e-6, atol=1e-6 * np.abs(factor).max())
        if self.fit.df:
            sigma = np.inf if form.sigma is None else form.sigma
            same = same and abs(sigma - self.fit.sigma) <= 1e-6 * self.fit.sigma + scale
        if not same:
            raise fail(f"the coefficients of {self.response} do not follow from the runs beside them")
        considered = None
        if form.considered is not None:
            considered = replace(self.terms, exponents=form.considered)
            if not set(self.terms.exponents) <= set(considered.exponents):
                raise fail("considered should hold the terms")
        return replace(self.with_estimates(coefficients, factor), note=form.note, considered=considered)

    # ------------------------------------------------------------------ inside

    @cached_property
    def _refined_coefficients(self) -> DoubleDouble:
        """Coefficients in working coordinates with 32 digits."""
        return refined(self._precise_columns, self.data, self.fit.coefficients, self.fit.factor)

    @cached_property
    def _precise_columns(self) -> DoubleDouble:
        return precise_columns(self.terms, self.coordinates, self.data)

    def _residuals(self, coefficients: Floats) -> Floats:
        """Observed minus fitted for coefficients in working coordinates, shape (n,)."""
        return precise_residuals(self._precise_columns, self.data.y, coefficients).high

    @property
    def _extra_count(self) -> int:
        """Number of coefficients after those of the terms (parameters of a stretch)."""
        return len(self._extra_names())

    def _extra_names(self) -> tuple[str, ...]:
        return ()

    def _extra_columns(self, points: Floats) -> Floats:
        """Derivatives of the prediction by the extra coefficients, shape (n, extra)."""
        return np.empty((len(points), 0))

    def _columns(self, points: Floats, blocks: Floats) -> Floats:
        rows = self._term_columns(points, blocks)
        return np.hstack([rows, self._extra_columns(points)]) if self._extra_count else rows

    def _term_columns(self, points: Floats, blocks: Floats) -> Floats:
        return with_blocks(self.terms.matrix(self.coordinates.forward(points)), blocks)

    @property
    def _block_count(self) -> int:
        """Number of block columns."""
        return max(0, len(self.data.block_names) - 1)

    def rows(self, points: Floats) -> Floats:
        """Design-matrix rows of new points, on average over the blocks."""
        average = np.full((len(points), self._block_count), 1.0 / (self._block_count + 1))
        return self._columns(points, average)

    @cached_property
    def working_coefficients(self) -> Floats:
        """Coefficients of the terms in working coordinates (blocks averaged), shape (terms,)."""
        return self.over_blocks(self.fit.coefficients)

    def over_blocks(self, coefficients: Floats) -> Floats:
        """Rows of the terms alone, with the mean block effect in the constant."""
        count = self._block_count
        rows = coefficients[: self.fit.p - self._extra_count]
        if count:
            mean = rows[1 : 1 + count].sum(axis=0) / (count + 1)
            rows = np.concatenate([rows[:1] + mean, rows[1 + count :]])
        return rows

    def _conversion(self, into: Coordinates, out_of: Coordinates) -> DoubleDouble:
        """Matrix between coefficients in two sets of coordinates, blocks included."""
        count = self._block_count
        inner = conversion(self.terms, into, out_of)
        whole = double_double(np.eye(self.terms.p + count))
        terms = np.r_[0, 1 + count : self.terms.p + count] if count else np.arange(self.terms.p)
        whole.high[np.ix_(terms, terms)], whole.low[np.ix_(terms, terms)] = inner.high, inner.low
        return whole

    def _points(self, points: ArrayLike) -> Floats:
        x = np.asarray(points, float)
        if x.ndim != 2 or x.shape[1] != len(self.space):
            raise RsmkitError(
                f"points of {self.response} need shape (n, {len(self.space)}): one row per point, "
                f"columns {', '.join(self.space.names)}; got {x.shape}"
            )
        return x


def fit_polynomial(
    space: Space,
    response: str,
    data: FitData,
    terms: Terms,
    coordinates: Coordinates | None = None,
) -> PolynomialSurface:
    """Estimate a polynomial by QR alone; :func:`rsmkit.surfaces.polynomial_fit.estimate` asks statsmodels.

    Raises
    ------
    FitError
        When terms are aliased or runs too few, naming them.
    """
    if coordinates is None:
        coordinates = working(space, data.points, terms)
    if data.blocks is not None and not terms.has_constant:
        raise FitError("blocks need a surface with a constant")
    matrix = with_blocks(terms.matrix(coordinates.forward(data.points)), data.block_columns())
    names = _names(terms, space, data)
    try:
        fit = least_squares(
            matrix,
            data.y,
            data.weights,
            names=names,
            has_constant=terms.has_constant or bool(terms.components),
        )
    except FitError as error:
        raise FitError(f"response {response}: {error}") from None
    return PolynomialSurface(space, response, terms, coordinates, data, fit)


def _names(terms: Terms, space: Space, data: FitData) -> tuple[str, ...]:
    names = terms.names(space)
    return (*names[:1], *(f"block[{name}]" for name in data.block_names[1:]), *names[1:])


def with_blocks(matrix: Floats, blocks: Floats) -> Floats:
    """Insert block columns after the constant."""
    return np.hstack([matrix[:, :1], blocks, matrix[:, 1:]]) if blocks.size else matrix
