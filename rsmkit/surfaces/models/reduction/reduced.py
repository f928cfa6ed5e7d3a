"""Model reduction: fewer terms, hierarchy kept.

A term may go only while no other term contains it, and comes together with everything it contains, so that
the model means the same in any units. The linear blending terms of a mixture, whose sum is the constant,
always stay. Criteria: tests, or those of Akaike, corrected (Hurvich & Tsai 1989) or not, and of Schwarz
(1978).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import fdtrc

from rsmkit.language.space import Floats
from rsmkit.surfaces.estimation.least_squares import EXACT
from rsmkit.surfaces.models.polynomial import PolynomialSurface, fit_polynomial
from rsmkit.surfaces.models.reduction.reduction_steps import Subset
from rsmkit.surfaces.models.reduction.refitted_terms import fitted_like, refitted
from rsmkit.surfaces.models.reduction.term_chooser import Method, TermChooser, penalty

__all__ = ["OPTIMISTIC", "Method", "Reduction", "choose_terms", "reduce_surface"]

OPTIMISTIC = (
    "terms were chosen with the same data: p-values and standard errors of the coefficients are optimistic, "
    "so they get no limits; intervals of predictions take error and leverage of the model with all terms"
)
OPTIMISTIC_HERE = (
    "terms were chosen with the same data: p-values, standard errors and intervals are optimistic"
)
"""Said of counts and of runs in random groups, whose intervals are those of the terms that were kept."""


@dataclass(frozen=True)
class Reduction:
    """A reduced surface and how it came about.

    Parameters
    ----------
    surface : PolynomialSurface
        With the terms kept; its note says that its p-values are optimistic.
    dropped : tuple of str
        Names of the terms left out.
    steps : tuple of str
        What was done in order, in words.
    """

    surface: PolynomialSurface
    dropped: tuple[str, ...]
    steps: tuple[str, ...]


def reduce_surface(surface: PolynomialSurface, method: Method = "aicc", alpha: float = 0.1) -> Reduction:
    """Choose terms of a fitted surface.

    Parameters
    ----------
    surface : PolynomialSurface
        The full model. Of runs in random groups, tests have its degrees of freedom (Kenward and Roger) and
        criteria are of the full likelihood, since the restricted one compares no terms. Of counts, tests are
        those of likelihood ratios.
    method : {"backward", "forward", "aicc", "aic", "bic", "all"}
        Backward or forward by tests at `alpha`; stepwise in both directions by AICc, AIC or BIC; or the best
        AICc of all hierarchical subsets. A term that no test can judge stays, and comes in by none.
    alpha : float
        Level of the tests.

    Raises
    ------
    RsmkitError
        When there are too many subsets to try them all.
    """
    found = choose_terms(surface, method, alpha)
    if surface.form == PolynomialSurface.form:
        told = replace(found.surface.refined(), note=OPTIMISTIC, considered=surface.terms)
    else:
        told = replace(found.surface, note="; ".join(filter(None, [surface.note, OPTIMISTIC_HERE])))
    return replace(found, surface=told)


def choose_terms(surface: PolynomialSurface, method: Method, alpha: float = 0.1) -> Reduction:
    """As :func:`reduce_surface`, without the last digits of the coefficients and without a note."""
    plain = surface.form == PolynomialSurface.form
    chooser: TermChooser = _Chooser(surface, method) if plain else refitted(surface, method)
    found, steps = chooser.choose(alpha)
    chosen = chooser.steps.chosen(found)
    kept = surface.terms.subset(chosen)
    reduced = fit_polynomial(surface.space, surface.response, surface.data, kept, surface.coordinates)
    gone = tuple(e for e in surface.terms.exponents if e not in chosen)
    dropped = replace(kept, exponents=gone or ((0,) * kept.k,))
    names = dropped.names(surface.space) if len(kept) < len(surface.terms) else ()
    return Reduction(reduced if plain else fitted_like(surface, reduced), names, tuple(steps))


class _Chooser(TermChooser):
    """Residual sums of squares of subsets of terms, from the QR of the full model."""

    def __init__(self, surface: PolynomialSurface, method: Method) -> None:
        super().__init__(surface, method)
        fit = surface.fit
        self.rss = fit.rss
        self.rounding = EXACT**2 * float((fit.weights * fit.y**2).sum())
        self.effects = fit.effects
        self.triangle = np.linalg.inv(fit.factor)
        self.known: dict[Subset, tuple[float, int]] = {}

    def fit(self, terms: Subset) -> tuple[float, int]:
        """Residual sum of squares and number of columns."""
        if terms not in self.known:
            q, columns = self._basis(terms)
            left = self.effects - q @ (q.T @ self.effects)
            self._keep(terms, float(left @ left), len(columns))
        return self.known[terms]

    def look_around(self, terms: Subset, options: Iterable[Subset]) -> None:
        """Find the sums of squares of models with fewer terms, or more, from one decomposition.

        Leaving columns out adds ``b' C^-1 b``, with their coefficients b and covariance C for sigma = 1;
        those taken in leave of the residuals what their own rest, after the columns there are, does not
        explain. No difference of sums is taken, of which rounding would leave too much.
        """
        q, columns = self._basis(terms)
        explained = q.T @ self.effects
        left = self.effects - q @ explained
        inverse = solve_triangular(q.T @ self.triangle[:, columns], np.eye(len(columns)))
        leaving = _Leaving(columns, inverse @ explained, inverse @ inverse.T)
        others = [c for t in sorted(self.everything - terms) for c in self.columns[t]]
        beyond = np.asarray(self.triangle[:, others], float)
        for _ in range(2):  # twice, for what rounding leaves
            beyond = np.asarray(beyond - q @ (q.T @ beyond), float)
        coming = _Coming(others, beyond, left)
        unexplained = float(left @ left)
        for other in options:
            if other not in self.known:
                lost = [c for t in terms - other for c in self.columns[t]]
                new = [c for t in other - terms for c in self.columns[t]]
                rest = coming.left(new) if new else unexplained + leaving.lost(lost)
                self._keep(other, rest, len(columns) - len(lost) + len(new))

    def _basis(self, terms: Subset) -> tuple[Floats, list[int]]:
        columns = self.steps.columns_of(terms)
        return np.linalg.qr(self.triangle[:, columns])[0], columns

    def _keep(self, terms: Subset, unexplained: float, columns: int) -> None:
        # no term is chosen by rounding errors
        self.known[terms] = max(self.rss + unexplained, self.rounding), columns

    def criterion(self, terms: Subset) -> float:
        """See :class:`TermChooser`; the variance is a parameter too."""
        rss, p = self.fit(terms)
        return self.n * math.log(max(rss, 1e-300)) + penalty(self.method, p + 1, self.n)

    def p_value(self, small: Subset, large: Subset) -> float:
        """F test of the larger model against the smaller one."""
        (rss0, p0), (rss1, p1) = self.fit(small), self.fit(large)
        if p1 >= self.n or p1 == p0:
            return 1.0
        if rss1 <= 0:  # of a response of zeros
            return 1.0
        return float(fdtrc(p1 - p0, self.n - p1, (rss0 - rss1) / (p1 - p0) / (rss1 / (self.n - p1))))


class _Leaving:
    """What is lost with columns of a model: ``b' C^-1 b``.

    Parameters
    ----------
    columns : list of int
    b : array, shape (m,)
        Their coefficients.
    covariance : array, shape (m, m)
        Of the coefficients, for sigma = 1.
    """

    def __init__(self, columns: list[int], b: Floats, covariance: Floats) -> None:
        self.places = {column: place for place, column in enumerate(columns)}
        self.b, self.covariance = b, covariance
        self.single = (b**2 / np.diag(covariance)).tolist()

    def lost(self, columns: list[int]) -> float:
        """Sum of squares that goes with these columns."""
        where = [self.places[c] for c in columns]
        if len(where) == 1:
            return float(self.single[where[0]])
        b = self.b[where]
        return float(b @ np.linalg.solve(self.covariance[np.ix_(where, where)], b))


class _Coming:
    """What residuals are left when columns are taken into a model.

    Parameters
    ----------
    columns : list of int
    beyond : array, shape (p, m)
        What is left of each after the columns of the model.
    left : array, shape (p,)
        Residuals.
    """

    def __init__(self, columns: list[int], beyond: Floats, left: Floats) -> None:
        self.places = {column: place for place, column in enumerate(columns)}
        self.beyond, self.residuals = beyond, left
        squares = np.einsum("ij,ij->j", beyond, beyond)
        slopes = np.divide(left @ beyond, squares, out=np.zeros_like(squares), where=squares > 0)
        self.single = np.square(left[:, None] - beyond * slopes).sum(axis=0).tolist()

    def left(self, columns: list[int]) -> float:
        """Sum of squares that these columns do not explain."""
        where = [self.places[c] for c in columns]
        if len(where) == 1:
            return float(self.single[where[0]])
        q = np.linalg.qr(self.beyond[:, where])[0]
        return float(np.square(self.residuals - q @ (q.T @ self.residuals)).sum())
