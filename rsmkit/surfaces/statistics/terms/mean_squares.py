"""Sums of mean squares: variances of random factors, and F tests that no single mean square can make."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from scipy.special import chdtri, fdtrc, ndtri

from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.io.shown import Shown
from rsmkit.surfaces.models.polynomial import PolynomialSurface
from rsmkit.surfaces.models.surface import check_confidence
from rsmkit.surfaces.statistics.terms.nested_tests import extra_sum_of_squares

__all__ = ["MeanSquareRatio", "MeanSquareSum", "mean_square_sum"]

RESIDUAL = "residual"


@dataclass(frozen=True)
class MeanSquareRatio(Shown):
    """An F test of one sum of mean squares against another."""

    f: float
    p: float
    numerator_df: float
    denominator_df: float


@dataclass(frozen=True)
class MeanSquareSum(Shown):
    """Mean squares added with weights.

    Parameters
    ----------
    weights : dict
        Of the mean squares, the divisor in them.
    mean_squares : dict
    dfs : dict
        Their degrees of freedom.
    """

    weights: dict[str, float]
    mean_squares: dict[str, float]
    dfs: dict[str, int]

    @property
    def value(self) -> float:
        """The sum; as an estimate of a variance it can be negative."""
        return math.fsum(w * self.mean_squares[name] for name, w in self.weights.items())

    @property
    def std_error(self) -> float:
        """Standard error for normal errors and independent mean squares."""
        return math.sqrt(self.covariance(self))

    @property
    def df(self) -> float:
        """Degrees of freedom of Satterthwaite (1946), Biometrics Bulletin 2(6), 110-114."""
        return 2.0 * self.value**2 / self.covariance(self)

    def covariance(self, other: MeanSquareSum) -> float:
        """Covariance with another sum over the same runs."""
        both = [name for name in self.weights if name in other.weights]
        return math.fsum(
            2.0 * self.weights[name] * other.weights[name] * self.mean_squares[name] ** 2 / self.dfs[name]
            for name in both
        )

    def limits(self, confidence: float = 0.95) -> tuple[float, float]:
        """Limits of a variance by chi-squared with Satterthwaite's degrees of freedom."""
        check_confidence(confidence)
        tail = 0.5 * (1.0 - confidence)
        if self.value <= 0:
            raise RsmkitError(f"limits by chi-squared need an estimate above zero, got {self.value:.4g}")
        share = self.df * self.value
        return share / float(chdtri(self.df, tail)), share / float(chdtri(self.df, 1.0 - tail))

    def wald_limits(self, confidence: float = 0.95) -> tuple[float, float]:
        """Limits by the normal distribution and the standard error."""
        check_confidence(confidence)
        half = float(ndtri(0.5 + 0.5 * confidence)) * self.std_error
        return self.value - half, self.value + half

    def over(self, other: MeanSquareSum) -> MeanSquareRatio:
        """F test of this sum against another, each with Satterthwaite's degrees of freedom."""
        if other.value <= 0:
            raise RsmkitError(f"the denominator of F should be above zero, got {other.value:.4g}")
        f = self.value / other.value
        return MeanSquareRatio(f, float(fdtrc(self.df, other.df, max(f, 0.0))), self.df, other.df)


@checked
def mean_square_sum(
    surface: PolynomialSurface, weights: Mapping[str, float], *, divisor: float = 1.0
) -> MeanSquareSum:
    """Add mean squares of terms, to estimate a variance or to test by.

    Which to add says :func:`rsmkit.expected_mean_squares`: where a mean square expects ``error + 2 a:b + 6
    a`` and that of the interaction ``error + 2 a:b``, the variance of a is their difference over six.

    Parameters
    ----------
    surface : PolynomialSurface
        All factors as if they were fixed. Sums of squares are of type III; in a balanced layout all types are
        the same.
    weights : mapping
        By term, ``{"part": 1, "part*operator": -1}``; ``residual`` for the error; ``"operator +
        layout*operator"`` pools two terms into one mean square, that of operators within layouts.
    divisor : float
        Of the whole sum.

    Raises
    ------
    RsmkitError
        For a term that the model has not, or an error without degrees of freedom.
    """
    given = [*weights.values(), divisor]
    if not weights or not all(map(math.isfinite, given)) or 0 in given:
        raise RsmkitError(
            "mean squares: name at least one term; weights and the divisor are numbers but zero"
        )
    scaled, values, dfs = dict[str, float](), dict[str, float](), dict[str, int]()
    for name, weight in weights.items():
        if name == RESIDUAL:
            if not surface.fit.df:
                raise RsmkitError(f"{surface.response}: no degrees of freedom are left for the residual")
            values[name], dfs[name] = surface.fit.rss / surface.fit.df, surface.fit.df
        else:
            row = extra_sum_of_squares(surface, [part.strip() for part in name.split("+")])
            values[name], dfs[name] = row.ms, row.df
        scaled[name] = weight / divisor
    return MeanSquareSum(scaled, values, dfs)
