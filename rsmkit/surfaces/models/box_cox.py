"""Box-Cox transformation of the response, with its profile likelihood interval.

Box & Cox, J. Royal Statistical Society B 26 (1964): the power of y that makes the residuals of a given model
most nearly normal with constant variance.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Any, ClassVar, overload

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import OptimizeResult, brentq, minimize_scalar
from scipy.special import chdtri, ndtri, stdtrit

from rsmkit.errors import FitError
from rsmkit.io.strict_types import ReadBy
from rsmkit.language.space import Floats, Space
from rsmkit.language.terms import Terms
from rsmkit.surfaces.estimation.coordinates import Coordinates
from rsmkit.surfaces.estimation.fit_data import FitData
from rsmkit.surfaces.estimation.jackknife import jackknife_plus
from rsmkit.surfaces.estimation.least_squares import EXACT
from rsmkit.surfaces.models.polynomial import PolynomialSurface, fit_polynomial
from rsmkit.surfaces.models.stretch_search import StretchSearch
from rsmkit.surfaces.models.stretched import StretchedSurface, box_to_stretch, fit_stretched
from rsmkit.surfaces.models.surface import IntervalKind, check_confidence
from rsmkit.surfaces.reading import ModelDocument, fail

__all__ = ["BoxCox", "BoxCoxSurface", "box_cox", "box_cox_curve", "fit_box_cox", "power_transform"]

REACH = 5.0
"""Powers between -5 and 5 are tried."""
MOST = 1e3
"""Largest prediction over the largest response: beyond, the transformation has no inverse or has lost it."""
NODES = 400
"""Of the quadrature that gives a mean."""
NEAR = 0.1
"""Powers times responses nearer to zero than this are summed as :data:`SERIES`."""
SERIES = [(-1) ** k / ((k + 1) * (k + 2)) for k in range(16)]
"""Of ``((1 + x) log(1 + x) - x) / x^2``."""
DIGITS = 6
"""Decimals of a power that are kept; a search ends some 1e-8 from the likeliest, by rounding."""
ROUNDS = 4
"""How often power and stretch are found in turn."""
INNER: dict[str, type[PolynomialSurface]] = {
    made.form: made for made in (PolynomialSurface, StretchedSurface)
}
"""What the transformed response may be described by."""


@dataclass(frozen=True)
class BoxCox:
    """The power and what the data say about it.

    Parameters
    ----------
    power : float
        Maximum-likelihood value; 1 leaves the response as it is, 0 is the logarithm.
    low, high : float
        Profile likelihood interval; nan where it reaches beyond -5 or 5.
    confidence : float
    """

    power: float
    low: float
    high: float
    confidence: float

    @property
    def needed(self) -> bool:
        """Whether the interval excludes 1 (no transformation)."""
        return self.low > 1.0 or self.high < 1.0


def power_transform(y: Floats, power: float) -> Floats:
    """``(y^power - 1) / power``, the logarithm at 0; y must be positive."""
    logs = np.log(y)
    return logs if power == 0 else np.expm1(power * logs) / power


def power_change(z: Floats, power: float) -> Floats:
    """Derivative of :func:`power_transform` by the power, where the transformed response is z."""
    x = np.maximum(power * z, -1.0)
    near = np.abs(x) < NEAR
    series = np.polyval(SERIES[::-1], np.where(near, x, 0.0))
    far = np.where(near, 1.0, np.maximum(x, -1.0 + 1e-16))
    return np.asarray(
        np.where(near, z**2 * series, ((1.0 + far) * np.log1p(far) - far) / (power or 1.0) ** 2)
    )


def box_cox(surface: PolynomialSurface, confidence: float = 0.95) -> BoxCox:
    """Estimate the power for the terms of a fitted surface.

    Raises
    ------
    FitError
        When a response is not positive, or there are no degrees of freedom.
    """
    half_deviance, best = _likeliest(surface)
    level = float(best.fun) + 0.5 * float(chdtri(1, 1 - confidence))

    def excess(power: float) -> float:
        return half_deviance(power) - level

    low = brentq(excess, -REACH, best.x, xtol=1e-12) if excess(-REACH) > 0 else np.nan
    high = brentq(excess, best.x, REACH, xtol=1e-12) if excess(REACH) > 0 else np.nan
    return BoxCox(float(best.x), float(low), float(high), confidence)


def _likeliest(surface: PolynomialSurface) -> tuple[Callable[[float], float], OptimizeResult]:
    """Half the deviance by the power, and its least value."""
    y, root = surface.data.y, np.sqrt(surface.fit.weights)
    if (y <= 0).any():
        raise FitError(
            f"response {surface.response}: Box-Cox needs positive responses, the least is {y.min():g}"
        )
    if surface.fit.df == 0:
        raise FitError(f"response {surface.response}: Box-Cox needs more runs than terms")
    if y.max() - y.min() <= EXACT * y.max():
        raise FitError(f"response {surface.response}: Box-Cox needs a response that varies")
    basis, _ = np.linalg.qr(surface.matrix * root[:, None])
    geometric = np.exp(np.log(y).mean())

    def half_deviance(power: float) -> float:
        z = root * power_transform(y / geometric, power)
        rest = z - basis @ (basis.T @ z)
        return 0.5 * len(y) * float(np.log(max(float(rest @ rest), 1e-300)))

    grid = np.linspace(-REACH, REACH, 101)
    start = grid[np.argmin([half_deviance(p) for p in grid])]
    bracket = (max(-REACH, start - 0.2), min(REACH, start + 0.2))
    best = minimize_scalar(half_deviance, bounds=bracket, method="bounded", options={"xatol": 1e-10})
    return half_deviance, best


def box_cox_curve(surface: PolynomialSurface, powers: Floats) -> Floats:
    """Residual sum of squares after each power, on the scale of the response, shape (m,).

    The transformation is divided by ``g^(power - 1)``, g being the geometric mean, so that the sums can be
    compared with each other (Box & Cox 1964).

    Raises
    ------
    FitError
        When a response is not positive.
    """
    y, root = surface.data.y, np.sqrt(surface.fit.weights)
    if (y <= 0).any():
        raise FitError(f"response {surface.response}: Box-Cox needs positive responses")
    basis, _ = np.linalg.qr(surface.matrix * root[:, None])
    geometric = float(np.exp(np.log(y).mean()))
    z = root[:, None] * np.column_stack([power_transform(y / geometric, float(p)) for p in powers])
    rest = z - basis @ (basis.T @ z)
    return np.asarray(geometric**2 * (rest**2).sum(axis=0))


@dataclass(frozen=True, eq=False)
class BoxCoxSurface(ModelDocument):
    """A polynomial surface of the transformed response, read in the response's own units.

    Predictions are medians of the response, transformed back; :meth:`mean` gives means. Intervals are
    transformed back end to end and allow for the power, which was estimated from the same runs. Where the
    polynomial leaves the range of the transformation a prediction is 0, or MOST times the largest response.

    Parameters
    ----------
    inner : PolynomialSurface
        Of the transformed response; may be stretched.
    power : float
    nested_press : float
        Sum of squared leave-one-out errors in the response's own units, the power estimated anew each time.
    nested_errors : array, shape (n,), optional
        The errors themselves; not kept in files.
    """

    form: ClassVar[str] = "box-cox"

    inner: PolynomialSurface
    power: float
    nested_press: float
    nested_errors: Floats | None = None

    @property
    def space(self) -> Space:
        """Factors."""
        return self.inner.space

    @property
    def response(self) -> str:
        """Name of the response."""
        return self.inner.response

    @cached_property
    def y(self) -> Floats:
        """Responses in their own units, shape (n,)."""
        return power_inverse(self.inner.data.y, self.power)

    @cached_property
    def data(self) -> FitData:
        """The runs, with responses in their own units."""
        return replace(self.inner.data, y=self.y)

    @overload
    def predict(self, points: ArrayLike, interval: None = None) -> Floats: ...
    @overload
    def predict(
        self, points: ArrayLike, interval: float, kind: IntervalKind = "prediction"
    ) -> tuple[Floats, Floats, Floats]: ...
    def predict(
        self, points: ArrayLike, interval: float | None = None, kind: IntervalKind = "prediction"
    ) -> Floats | tuple[Floats, Floats, Floats]:
        """Predict the median of the response; see :meth:`PolynomialSurface.predict`.

        The kind ``mean`` is the interval of that median. A change of the power moves the prediction, to first
        order, by the difference between the changes of the transformed responses, fitted like these, and that
        of the prediction itself. The power's variance is that of its likelihood interval; it costs a degree
        of freedom.
        """
        z = self.inner.predict(points)
        median = np.minimum(power_inverse(z, self.power), self.largest)
        if interval is None:
            return median
        check_confidence(interval)
        if kind == "jackknife+":
            return median, *jackknife_plus(self, np.asarray(points, float), interval)[1:]
        df = self.inner.fit.df - 1
        if df < 1:
            return median, np.zeros_like(z), np.full_like(z, np.inf)
        variance = self.sigma**2 * (self.inner.leverage(points) + (kind == "prediction"))
        change = self.moved_by_power(points)
        half = float(stdtrit(df, 0.5 + 0.5 * interval)) * np.sqrt(variance + (self.power_error * change) ** 2)
        return median, power_inverse(z - half, self.power), power_inverse(z + half, self.power)

    def moved_by_power(self, points: ArrayLike) -> Floats:
        """Change of transformed predictions with the power less that of their transformation, shape (n,)."""
        smoothed = self.inner.smoothed(points, power_change(self.inner.data.y, self.power))
        return np.asarray(smoothed - power_change(self.inner.predict(points), self.power))

    def mean(self, points: ArrayLike) -> Floats:
        """Predict the mean of the response for normal errors on the transformed scale, shape (n,).

        Exact for a logarithm, else by quadrature. With a negative power the mean of all responses is
        infinite; this is the mean of those up to :attr:`largest`.
        """
        z = self.inner.predict(points)
        if self.power == 0:
            return np.asarray(np.minimum(np.exp(z + 0.5 * self.sigma**2), self.largest))
        return _mean_of_powers(1.0 + self.power * z, abs(self.power) * self.sigma, self.power, self.largest)

    @property
    def largest(self) -> float:
        """Largest prediction."""
        return MOST * float(self.y.max())

    @property
    def sigma(self) -> float:
        """Residual standard deviation of the transformed response, the power counted as a parameter."""
        fit = self.inner.fit
        return float(np.sqrt(fit.rss / (fit.df - 1))) if fit.df > 1 else np.nan

    @cached_property
    def estimated(self) -> BoxCox:
        """The power as the runs give it for these terms (and this stretch), with its 95 % interval."""
        inner = self.inner
        data = replace(inner.data, y=self.y)
        return box_cox(fit_polynomial(inner.space, inner.response, data, inner.terms, inner.coordinates))

    @cached_property
    def power_error(self) -> float:
        """Standard error of the power: its likelihood interval over twice the normal quantile."""
        low, high = self.estimated.low, self.estimated.high
        ends = REACH if np.isnan(high) else high, -REACH if np.isnan(low) else low
        return float((ends[0] - ends[1]) / (2.0 * ndtri(0.975)))

    @property
    def loo_residuals(self) -> Floats:
        """Error of predicting each run from the others in the response's own units, the power kept, (n,)."""
        return self.y - power_inverse(self.inner.data.y - self.inner.loo_residuals, self.power)

    def predictions_without(self, points: ArrayLike) -> Floats:
        """Predict without each of the runs, the power kept, shape (m, n)."""
        return power_inverse(self.inner.predictions_without(points), self.power)

    def gradient(self, points: ArrayLike) -> Floats:
        """Derivatives by the factors, natural units, shape (n, k)."""
        y = self.predict(points)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(self.inner.gradient(points) * (y ** (1.0 - self.power))[:, None])

    def to_form(self) -> BoxCoxForm:
        """Show how it is written."""
        return BoxCoxForm(self.form, self.power, self.nested_press, self.inner)

    @classmethod
    def from_form(cls, form: BoxCoxForm) -> BoxCoxSurface:
        """Inverse of :meth:`to_form`."""
        if abs(form.power) > REACH:
            raise fail("power should lie between -5 and 5")
        return cls(form.inner, form.power, form.nested_press)


def _read_inner(document: Any) -> PolynomialSurface:
    word = document.get("model") if isinstance(document, dict) else None
    if not isinstance(word, str) or word not in INNER:
        raise fail("should be a polynomial or stretched surface")
    return INNER[word].from_json(document)


@dataclass(frozen=True)
class BoxCoxForm:
    """How a Box-Cox surface is written."""

    model: str
    power: float
    nested_press: float
    inner: Annotated[PolynomialSurface, ReadBy(_read_inner)]


def fit_box_cox(
    space: Space,
    response: str,
    data: FitData,
    terms: Terms,
    family: str | Mapping[str, str] | None = None,
    *,
    seed: int = 0,
) -> BoxCoxSurface:
    """Estimate the power, fit the transformed response, and measure it by leaving out run after run.

    Parameters
    ----------
    space, response, data, terms
        As for :func:`rsmkit.surfaces.models.polynomial.fit_polynomial`.
    family : str or mapping of str to str, optional
        Stretch the factors too, as :func:`rsmkit.surfaces.models.stretched.fit_stretched` does; the power is
        then estimated again in the stretched factors.
    seed : int
        For the search of the stretch.

    Raises
    ------
    FitError
        When a response is not positive or runs are too few.
    """
    box = None if family is None else box_to_stretch(space, data, terms, family)
    plain = fit_polynomial(space, response, data, terms, box)
    power = _convenient(plain)
    inner = fit_polynomial(space, response, _transformed(data, power), terms).refined()
    if family is not None:
        power = max(
            (_alternated(plain, start, family, seed) for start in (power, 1.0)),
            key=lambda power_and_likelihood: power_and_likelihood[1],
        )[0]
        inner = fit_stretched(space, response, _transformed(data, power), terms, family, seed=seed)
    errors, bend = np.empty(len(data)), None
    if inner.coordinates.stretches:
        straight = fit_polynomial(space, response, inner.data, terms, plain.coordinates)
        bend = StretchSearch(straight).curvatures(inner.coordinates.stretches)
    for i in range(len(data)):
        left = _without(inner, plain.coordinates, data, i, bend)
        guess = power_inverse(left.inner.predict(data.points[i : i + 1]), left.power)[0]
        errors[i] = data.y[i] - guess
    if not np.isfinite(errors).all():
        raise FitError(
            f"response {response}: a Box-Cox surface leaves the range of its transformation at a run"
        )
    return BoxCoxSurface(inner, power, float(errors @ errors), errors)


def _alternated(
    plain: PolynomialSurface, power: float, family: str | Mapping[str, str], seed: int
) -> tuple[float, float]:
    """Power and stretch in turn, each for the other as it stands: the power and its log-likelihood."""
    model, data, terms = (plain.space, plain.response), plain.data, plain.terms
    likelihood = -np.inf
    for _ in range(ROUNDS):
        straight = fit_polynomial(*model, _transformed(data, power), terms, plain.coordinates)
        stretches = StretchSearch(straight, seed=seed).find(family)
        coordinates = replace(plain.coordinates, stretches=stretches)
        before, power = power, _convenient(fit_polynomial(*model, data, terms, coordinates))
        fit = fit_polynomial(*model, _transformed(data, power), terms, coordinates).fit
        likelihood = fit.log_likelihood + (power - 1.0) * float(np.log(data.y).sum())
        if power == before:
            break
    return power, likelihood


def _without(
    inner: PolynomialSurface, flat: Coordinates, data: FitData, run: int, bend: Floats | None
) -> BoxCoxSurface:
    """Surface of all runs but one, power and stretch found again; `bend` as in a search for the stretch."""
    rest, model = data.without(run), (inner.space, inner.response)
    power = _convenient(fit_polynomial(*model, rest, inner.terms, inner.coordinates))
    left = fit_polynomial(*model, _transformed(rest, power), inner.terms, flat)
    if bend is not None:
        members = StretchSearch(left).near(inner.coordinates.stretches, bend)
        left = fit_polynomial(*model, left.data, inner.terms, replace(flat, stretches=members))
    return BoxCoxSurface(left, power, 0.0)


def power_inverse(z: Floats, power: float) -> Floats:
    """Inverse of :func:`power_transform`; 0 or infinite where no response has that transform."""
    if power == 0:
        return np.asarray(np.exp(z))
    with np.errstate(divide="ignore"):
        return np.asarray(np.exp(np.log(np.maximum(1.0 + power * z, 0.0)) / power))


def _mean_of_powers(middle: Floats, spread: float, power: float, largest: float) -> Floats:
    """Mean of ``u^(1/power)`` for normal u, where that is no larger than `largest`; 0 where u is below zero.

    Over the logarithm of u, in which response and density are smooth, out to nine standard deviations.
    """
    if not spread > 0:  # an exact fit, or nothing left to judge the error by
        with np.errstate(divide="ignore"):
            exact = np.exp(np.log(np.maximum(middle, 0.0)) / power)
        return np.asarray(np.minimum(exact, largest) + 0.0 * spread)
    least = largest**power if power < 0 else 0.0
    found = np.full_like(middle, 0.0 if power > 0 else largest)
    inside = middle > least
    u = middle[inside]
    top = u + 9.0 * spread
    bottom = np.log(np.maximum(np.maximum(u - 9.0 * spread, least), 1e-6 * top))
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    half = 0.5 * (np.log(top) - bottom)
    total, seen = np.zeros_like(u), np.zeros_like(u)
    for node, weight in zip(nodes, weights, strict=True):
        v = bottom + half * (1.0 + node)
        density = weight * half * np.exp(v - 0.5 * ((np.exp(v) - u) / spread) ** 2)
        total += density * np.exp(v / power)
        seen += density
    found[inside] = total / (spread * np.sqrt(2.0 * np.pi) if power > 0 else seen)
    return np.asarray(np.minimum(found, largest))


def _convenient(surface: PolynomialSurface) -> float:
    """Take 0 when the 95 % interval of the power allows the logarithm, otherwise the estimate."""
    half_deviance, best = _likeliest(surface)
    allowed = half_deviance(0.0) <= float(best.fun) + 0.5 * float(chdtri(1, 0.05))
    return 0.0 if allowed else round(float(best.x), DIGITS)


def _transformed(data: FitData, power: float) -> FitData:
    return replace(data, y=power_transform(data.y, power))
