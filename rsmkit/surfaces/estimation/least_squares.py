"""Least squares and its diagnostics from one QR decomposition.

With ``W`` the diagonal of weights and ``sqrt(W) X D = Q R`` (columns first scaled to length one by ``D``),
everything a statistician asks for follows without another decomposition: ``factor = D R^-1`` gives the
covariance ``sigma^2 factor factor'``, row lengths of ``Q`` are the leverages, ``Q'y`` the sequential sums of
squares. Formulas: Montgomery, Peck & Vining, *Introduction to Linear Regression Analysis*, 5th ed., chs. 3,
4, 6.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.special import stdtr

from rsmkit.errors import FitError
from rsmkit.language.space import Floats

__all__ = ["EXACT", "LeastSquares", "least_squares", "two_sided_p"]

EXACT = 1e-14
"""Residual standard deviation, or spread, as a share of the response that is rounding and nothing else."""
LEVERAGE_LEFT = 1e-10
"""What is left of a leverage of one after rounding, by a wide margin: the fit passes through that run."""
ALIASED = 1e-10
"""Length left of a unit column after removing the columns before it, below which it is their combination."""


@dataclass(frozen=True, eq=False)
class LeastSquares:
    """A fitted linear model of n runs and p columns.

    Parameters
    ----------
    coefficients : array, shape (p,)
    factor : array, shape (p, p)
        ``factor @ factor.T`` is the covariance of the coefficients for sigma = 1.
    y, residuals, weights, leverages : array, shape (n,)
        Residuals are observed minus fitted.
    effects : array, shape (p,)
        ``Q'sqrt(W)y``; squared, the sequential sum of squares of each column.
    has_constant : bool
        Whether sums of squares are about the mean.
    """

    coefficients: Floats
    factor: Floats
    y: Floats
    residuals: Floats
    weights: Floats
    leverages: Floats
    effects: Floats
    has_constant: bool

    @property
    def n(self) -> int:
        """Number of runs."""
        return len(self.y)

    @property
    def p(self) -> int:
        """Number of coefficients."""
        return len(self.coefficients)

    @property
    def df(self) -> int:
        """Residual degrees of freedom."""
        return self.n - self.p

    @property
    def fitted(self) -> Floats:
        """Fitted values, shape (n,)."""
        return self.y - self.residuals

    @cached_property
    def rss(self) -> float:
        """Weighted residual sum of squares."""
        return float((self.weights * self.residuals**2).sum())

    @cached_property
    def tss(self) -> float:
        """Weighted total sum of squares, about the weighted mean when there is a constant."""
        mean = np.average(self.y, weights=self.weights) if self.has_constant else 0.0
        return float((self.weights * (self.y - mean) ** 2).sum())

    @cached_property
    def sigma(self) -> float:
        """Residual standard deviation; nan without degrees of freedom."""
        return math.sqrt(self.rss / self.df) if self.df > 0 else math.nan

    @cached_property
    def exact(self) -> bool:
        """Whether the residuals are rounding errors: then no test of the coefficients means anything.

        As R says of an essentially perfect fit.
        """
        mean_square = float((self.weights * self.fitted**2).sum()) / self.n
        return self.df > 0 and self.rss <= EXACT**2 * mean_square * self.df

    @cached_property
    def free(self) -> NDArray[np.bool_]:
        """Runs that the others say something about (leverage below 1), shape (n,)."""
        return np.asarray(1.0 - self.leverages > LEVERAGE_LEFT)

    @property
    def r2(self) -> float:
        """Share of the total sum of squares explained; nan when the response does not vary."""
        return self._share(self.rss, self.tss)

    @property
    def r2_adjusted(self) -> float:
        """R2 with both sums of squares per degree of freedom."""
        if self.df <= 0:
            return math.nan
        if not self._varies:
            return math.nan
        return 1.0 - (self.rss / self.df) / (self.tss / (self.n - self.has_constant))

    @cached_property
    def loo_residuals(self) -> Floats:
        """Error of predicting each run from all the others, exact without refitting, shape (n,).

        Infinite where a run is fitted exactly whatever its value (leverage 1).
        """
        rest = 1.0 - self.leverages
        with np.errstate(divide="ignore", invalid="ignore"):
            errors: Floats = np.where(self.free, self.residuals / rest, np.inf)
        return errors

    @property
    def press(self) -> float:
        """Prediction sum of squares, the sum of squared leave-one-out errors, unweighted."""
        return float((self.loo_residuals**2).sum())

    @property
    def press_weighted(self) -> float:
        """Prediction sum of squares with the weights of the residual sum of squares."""
        return float((self.weights * self.loo_residuals**2).sum())

    @property
    def r2_predicted_weighted(self) -> float:
        """R2 with the weighted PRESS in place of the residual sum of squares."""
        return self._share(self.press_weighted, self.tss)

    @property
    def r2_predicted(self) -> float:
        """R2 of the leave-one-out errors, every run counted alike."""
        mean = self.y.mean() if self.has_constant else 0.0
        return self._share(self.press, float(((self.y - mean) ** 2).sum()))

    @property
    def _varies(self) -> bool:
        """Whether the response differs from its mean by more than rounding."""
        return self.tss > EXACT**2 * float((self.weights * self.y**2).sum())

    def _share(self, part: float, whole: float) -> float:
        return 1.0 - part / whole if self._varies else math.nan

    @property
    def std_errors(self) -> Floats:
        """Standard errors of the coefficients, shape (p,)."""
        errors: Floats = self.sigma * np.sqrt(np.einsum("ij,ij->i", self.factor, self.factor))
        return errors

    @property
    def covariance(self) -> Floats:
        """Covariance of the coefficients, shape (p, p)."""
        return self.sigma**2 * self.factor @ self.factor.T

    @property
    def studentised(self) -> Floats:
        """Internally studentised residuals, shape (n,)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            rest = np.where(self.free, 1.0 - self.leverages, np.nan)
            return np.asarray(np.sqrt(self.weights) * self.residuals / (self.sigma * np.sqrt(rest)))

    @property
    def deleted(self) -> Floats:
        """Externally studentised residuals (sigma without the run itself), shape (n,)."""
        r = self.studentised
        with np.errstate(divide="ignore", invalid="ignore"):
            rest = self.df - r**2
            rest = np.where(rest > LEVERAGE_LEFT * self.df, rest, np.nan)  # nothing is left without the run
            return np.asarray(r * np.sqrt((self.df - 1) / rest))

    @property
    def cooks_distances(self) -> Floats:
        """Cook's distance of each run, shape (n,)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return self.studentised**2 * self.leverages / (1.0 - self.leverages) / self.p

    @property
    def dffits(self) -> Floats:
        """Change of a run's own fitted value when it is left out, in standard errors, shape (n,)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return self.deleted * np.sqrt(self.leverages / (1.0 - self.leverages))

    @property
    def log_likelihood(self) -> float:
        """Gaussian log-likelihood at its maximum."""
        if self.rss <= 0:
            return math.inf
        scale = math.log(2 * math.pi) + math.log(self.rss / self.n) + 1
        return float(0.5 * np.log(self.weights).sum() - 0.5 * self.n * scale)

    @property
    def aic(self) -> float:
        """Akaike's criterion, sigma counted as a parameter."""
        return 2 * (self.p + 1) - 2 * self.log_likelihood

    @property
    def aicc(self) -> float:
        """Akaike's criterion with the small-sample correction; infinite for nearly saturated models."""
        q = self.p + 1
        return self.aic + 2 * q * (q + 1) / (self.n - q - 1) if self.n > q + 1 else math.inf

    @property
    def bic(self) -> float:
        """Schwarz's criterion, sigma counted as a parameter."""
        return math.log(self.n) * (self.p + 1) - 2 * self.log_likelihood


def least_squares(
    matrix: Floats,
    y: Floats,
    weights: Floats | None = None,
    *,
    names: Sequence[str],
    has_constant: bool = True,
) -> LeastSquares:
    """Fit by QR with column scaling.

    Parameters
    ----------
    matrix : array, shape (n, p)
    y : array, shape (n,)
    weights : array, shape (n,), optional
        Positive; inversely proportional to the variance of each run.
    names : sequence of str
        Of the columns, for messages.
    has_constant : bool
        Whether one of the columns is the constant. Where they add up to one, as those of mixtures do, sums of
        squares are about the mean, too.

    Raises
    ------
    FitError
        When there are fewer runs than columns, or columns are combinations of others; both by name.
    """
    n, p = matrix.shape
    root = np.ones(n) if weights is None else np.sqrt(weights)
    weighted = matrix * root[:, None]
    lengths = np.linalg.norm(weighted, axis=0)
    lengths[lengths == 0] = 1.0
    q, r = np.linalg.qr(weighted / lengths)
    if n < p:
        raise FitError(
            f"{p} terms cannot be estimated from {n} different runs, which cannot tell apart: "
            f"{_listed(_aliases(r, names))}. Add at least {p - n} more runs or lower the order of the surface"
        )
    if np.abs(np.diag(r)).min() <= ALIASED and (aliases := _aliases(r, names)):
        raise FitError(
            f"terms that these runs cannot tell apart: {_listed(aliases)}. "
            "Leave them out, or add runs at which they differ"
        )
    effects = q.T @ (y * root)
    coefficients = solve_triangular(r, effects) / lengths
    return LeastSquares(
        coefficients=coefficients,
        factor=np.ascontiguousarray(solve_triangular(r, np.eye(p)) / lengths[:, None]),
        y=y,
        residuals=y - matrix @ coefficients,
        weights=root**2,
        leverages=np.einsum("ij,ij->i", q, q),
        effects=effects,
        has_constant=has_constant or _spans_constant(q, root),
    )


def _spans_constant(q: Floats, root: Floats) -> bool:
    """Whether the constant is a combination of the columns that `q` is a basis of."""
    left = root - q @ (q.T @ root)
    return bool(np.linalg.norm(left) <= ALIASED * np.linalg.norm(root))


def two_sided_p(t: Floats, df: float) -> Floats:
    """Two-sided p-value of Student's t; nan without degrees of freedom."""
    if df <= 0:
        return np.full(np.shape(t), np.nan)
    return np.asarray(2.0 * stdtr(df, -np.abs(t)), float)


def _aliases(r: Floats, names: Sequence[str]) -> list[str]:
    """Columns that are combinations of the ones before them, with what they are combinations of."""
    kept: list[int] = []
    found = []
    for j in range(r.shape[1]):
        earlier = r[:, kept]
        mix, *_ = np.linalg.lstsq(earlier, r[:, j], rcond=None) if kept else (np.empty(0),)
        if np.linalg.norm(r[:, j] - earlier @ mix) > ALIASED:
            kept.append(j)
            continue
        partners = [names[i] for i, c in zip(kept, mix, strict=True) if abs(c) > 1e-6]
        found.append(f"{names[j]} ({'same as ' + ' + '.join(partners) if partners else 'does not vary'})")
    return found


def _listed(texts: list[str], most: int = 12) -> str:
    more = [f"and {len(texts) - most} more"] if len(texts) > most else []
    return "; ".join([*texts[:most], *more])
