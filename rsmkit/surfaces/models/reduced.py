"""Model reduction: fewer terms, hierarchy kept.

A term may go only while no other term contains it, and comes together with everything it contains, so that
the model means the same in any units. The linear blending terms of a mixture, whose sum is the constant,
always stay. Criteria: F tests, or the corrected Akaike criterion of Hurvich & Tsai
(1989).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import chain, combinations
from typing import Literal

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import fdtrc

from rsmkit.errors import RsmkitError
from rsmkit.language.space import Floats
from rsmkit.language.terms import Terms
from rsmkit.surfaces.estimation.least_squares import EXACT
from rsmkit.surfaces.models.polynomial import PolynomialSurface, fit_polynomial
from rsmkit.surfaces.models.reduction_steps import SAME, Steps, Subset, corrected_akaike

__all__ = ["OPTIMISTIC", "Method", "Reduction", "choose_terms", "reduce_surface"]

Method = Literal["backward", "forward", "aicc", "all"]

OPTIMISTIC = (
    "terms were chosen with the same data: p-values and standard errors of the coefficients are optimistic, "
    "so they get no limits; intervals of predictions take error and leverage of the model with all terms"
)
MOST_SUBSETS = 200_000


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
        The full model.
    method : {"backward", "forward", "aicc", "all"}
        Backward or forward by F tests at `alpha`; stepwise in both directions by AICc; or the best AICc of
        all hierarchical subsets.
    alpha : float
        Level of the F tests.

    Raises
    ------
    RsmkitError
        When there are too many subsets to try them all.
    """
    found = choose_terms(surface, method, alpha)
    return replace(found, surface=_told(found.surface.refined(), surface.terms))


def _told(kept: PolynomialSurface, considered: Terms) -> PolynomialSurface:
    return replace(kept, note=OPTIMISTIC, considered=considered)


def choose_terms(surface: PolynomialSurface, method: Method, alpha: float = 0.1) -> Reduction:
    """As :func:`reduce_surface`, without the last digits of the coefficients and without a note."""
    chooser = _Chooser(surface)
    found, steps = {
        "backward": lambda: chooser.backward(alpha),
        "forward": lambda: chooser.forward(alpha),
        "aicc": chooser.stepwise,
        "all": chooser.all_subsets,
    }[method]()
    chosen = chooser.steps.chosen(found)
    kept = surface.terms.subset(chosen)
    reduced = fit_polynomial(surface.space, surface.response, surface.data, kept, surface.coordinates)
    gone = tuple(e for e in surface.terms.exponents if e not in chosen)
    dropped = replace(kept, exponents=gone or ((0,) * kept.k,))
    names = dropped.names(surface.space) if len(kept) < len(surface.terms) else ()
    return Reduction(reduced, names, tuple(steps))


class _Chooser:
    """Residual sums of squares of subsets of terms, from the QR of the full model.

    Terms are numbered by their exponents.
    """

    def __init__(self, surface: PolynomialSurface) -> None:
        fit = surface.fit
        self.surface = surface
        self.n = fit.n
        self.rss = fit.rss
        self.rounding = EXACT**2 * float((fit.weights * fit.y**2).sum())
        self.effects = fit.effects
        self.triangle = np.linalg.inv(fit.factor)
        self.steps = Steps(surface)
        self.everything, self.always = self.steps.everything, self.steps.always
        self.columns = self.steps.columns
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
        columns = sorted(chain.from_iterable(self.columns[t] for t in terms))
        return np.linalg.qr(self.triangle[:, columns])[0], columns

    def _keep(self, terms: Subset, unexplained: float, columns: int) -> None:
        # no term is chosen by rounding errors
        self.known[terms] = max(self.rss + unexplained, self.rounding), columns

    def aicc(self, terms: Subset) -> float:
        """Corrected Akaike criterion up to a constant; infinite for nearly saturated models."""
        rss, p = self.fit(terms)
        return float(corrected_akaike(rss, p, self.n))

    def p_value(self, small: Subset, large: Subset) -> float:
        """F test of the larger model against the smaller one."""
        (rss0, p0), (rss1, p1) = self.fit(small), self.fit(large)
        if p1 >= self.n or p1 == p0:
            return 1.0
        if rss1 <= 0:  # of a response of zeros
            return 1.0
        return float(fdtrc(p1 - p0, self.n - p1, (rss0 - rss1) / (p1 - p0) / (rss1 / (self.n - p1))))

    def backward(self, alpha: float) -> tuple[Subset, list[str]]:
        terms, steps = self.everything, list[str]()
        while True:
            options = self.steps.smaller(terms)
            self.look_around(terms, options.values())
            tests = [(self.p_value(fewer, terms), t) for t, fewer in options.items()]
            if not tests or max(tests)[0] <= alpha:
                return terms, steps
            p, worst = max(tests)
            terms = terms - {worst}
            steps.append(f"left out {self.steps.name([worst])} (p = {p:.3g})")

    def forward(self, alpha: float) -> tuple[Subset, list[str]]:
        terms, steps = self.always, list[str]()
        while True:
            options = self.steps.larger(terms)
            self.look_around(terms, options)
            tests = [(self.p_value(terms, more), sorted(more)) for more in options]
            if not tests or min(tests)[0] > alpha:
                return terms, steps
            p, best = min(tests)
            steps.append(f"took in {self.steps.name(set(best) - terms)} (p = {p:.3g})")
            terms = frozenset(best)

    def stepwise(self) -> tuple[Subset, list[str]]:
        terms, steps = self.everything, list[str]()
        while True:
            options = [*self.steps.smaller(terms).values(), *self.steps.larger(terms)]
            self.look_around(terms, options)
            least = min(map(self.aicc, options), default=math.inf)
            # the first of equals, which rounding tells apart
            best = next((o for o in options if self.aicc(o) <= least + SAME), terms)
            if self.aicc(best) >= self.aicc(terms) - SAME:
                return terms, steps
            word = (
                f"left out {self.steps.name(terms - best)}"
                if best < terms
                else f"took in {self.steps.name(best - terms)}"
            )
            steps.append(f"{word} (AICc {self.aicc(best) - self.aicc(terms):+.3g})")
            terms = best

    def all_subsets(self) -> tuple[Subset, list[str]]:
        count, best = 0, self.everything
        for terms in self._subsets():
            count += 1
            if count > MOST_SUBSETS:
                raise RsmkitError(
                    f"{self.surface.response}: over {MOST_SUBSETS:,} hierarchical subsets; use stepwise AICc"
                )
            if self.aicc(terms) < self.aicc(best):
                best = terms
        return best, [f"best AICc of {count} hierarchical subsets"]

    def _subsets(self) -> Iterator[Subset]:
        """Every hierarchical subset, each once: degree by degree."""
        degrees = sorted({sum(self.steps.exponents[t]) for t in self.everything - self.always} - {0})
        yield from self._grow(self.always, degrees)

    def _grow(self, terms: Subset, degrees: list[int]) -> Iterator[Subset]:
        if not degrees:
            yield terms
            return
        allowed = [
            t
            for t in sorted(self.everything - terms)
            if sum(self.steps.exponents[t]) == degrees[0] and self.steps.inside[t] - {t} <= terms
        ]
        for more in chain.from_iterable(combinations(allowed, m) for m in range(len(allowed) + 1)):
            yield from self._grow(terms | set(more), degrees[1:])


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
