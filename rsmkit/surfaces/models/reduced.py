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
from scipy.special import fdtrc

from rsmkit.errors import RsmkitError
from rsmkit.language.space import Floats
from rsmkit.language.terms import Exponents, Terms, hierarchical_closure
from rsmkit.surfaces.estimation.least_squares import EXACT
from rsmkit.surfaces.models.polynomial import PolynomialSurface, fit_polynomial

__all__ = ["OPTIMISTIC", "Method", "Reduction", "nested_errors", "reduce_surface"]

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
    found = _reduced(surface, method, alpha)
    return replace(found, surface=_told(found.surface.refined(), surface.terms))


def _told(kept: PolynomialSurface, considered: Terms) -> PolynomialSurface:
    return replace(kept, note=OPTIMISTIC, considered=considered)


def _reduced(surface: PolynomialSurface, method: Method, alpha: float) -> Reduction:
    chooser = _Chooser(surface)
    chosen, steps = {
        "backward": lambda: chooser.backward(alpha),
        "forward": lambda: chooser.forward(alpha),
        "aicc": chooser.stepwise,
        "all": chooser.all_subsets,
    }[method]()
    kept = surface.terms.subset(chosen)
    reduced = fit_polynomial(surface.space, surface.response, surface.data, kept, surface.coordinates)
    gone = tuple(e for e in surface.terms.exponents if e not in chosen)
    dropped = replace(kept, exponents=gone or ((0,) * kept.k,))
    names = dropped.names(surface.space) if len(kept) < len(surface.terms) else ()
    return Reduction(reduced, names, tuple(steps))


def nested_errors(surface: PolynomialSurface, method: Method = "aicc", alpha: float = 0.1) -> Floats:
    """Error at each run with the terms chosen and fitted without it, shape (n,)."""
    data = surface.data
    errors = np.empty(len(data))
    for i in range(len(data)):
        rest = data.without(i)
        full = fit_polynomial(surface.space, surface.response, rest, surface.terms, surface.coordinates)
        reduced = _reduced(full, method, alpha).surface
        errors[i] = data.y[i] - reduced.predict(data.points[i : i + 1])[0]
    return errors


class _Chooser:
    """Residual sums of squares of subsets of terms, from the QR of the full model."""

    def __init__(self, surface: PolynomialSurface) -> None:
        fit = surface.fit
        self.surface = surface
        self.n = fit.n
        self.rss = fit.rss
        self.rounding = EXACT**2 * float((fit.weights * fit.y**2).sum())
        self.effects = fit.effects
        self.triangle = np.linalg.inv(fit.factor)
        self.everything = surface.terms.exponents
        constant = (0,) * surface.terms.k
        components = surface.terms.components
        linear = [e for e in self.everything if sum(e) == 1 and any(e[j] for j in components)]
        self.always = [constant] if constant in self.everything else linear
        blocks = len(surface.names) - surface.terms.p
        columns = np.array(surface.terms.column_terms)
        shift = np.where(columns == 0, 0, blocks)
        self.columns = {
            e: list(np.nonzero(columns == t)[0] + shift[columns == t]) for t, e in enumerate(self.everything)
        }
        self.columns[constant] = list(range(1 + blocks)) if constant in self.everything else []
        self.known: dict[frozenset[Exponents], tuple[float, int]] = {}

    def fit(self, terms: frozenset[Exponents]) -> tuple[float, int]:
        """Residual sum of squares and number of columns."""
        if terms not in self.known:
            columns = sorted(chain.from_iterable(self.columns[e] for e in terms))
            q, _ = np.linalg.qr(self.triangle[:, columns])
            explained = q.T @ self.effects
            rss = self.rss + float(self.effects @ self.effects - explained @ explained)
            self.known[terms] = (
                max(rss, self.rounding),
                len(columns),
            )  # no term is chosen by rounding errors
        return self.known[terms]

    def aicc(self, terms: frozenset[Exponents]) -> float:
        """Corrected Akaike criterion up to a constant; infinite for nearly saturated models."""
        rss, p = self.fit(terms)
        q = p + 1
        if self.n <= q + 1:
            return math.inf
        return self.n * math.log(max(rss, 1e-300)) + 2 * q + 2 * q * (q + 1) / (self.n - q - 1)

    def p_value(self, small: frozenset[Exponents], large: frozenset[Exponents]) -> float:
        """F test of the larger model against the smaller one."""
        (rss0, p0), (rss1, p1) = self.fit(small), self.fit(large)
        if p1 >= self.n or p1 == p0:
            return 1.0
        if rss1 <= 0:  # of a response of zeros
            return 1.0
        return float(fdtrc(p1 - p0, self.n - p1, (rss0 - rss1) / (p1 - p0) / (rss1 / (self.n - p1))))

    def removable(self, terms: frozenset[Exponents]) -> Iterator[Exponents]:
        """Terms that no other term contains."""
        for e in terms:
            if e not in self.always and not any(
                f != e and all(a <= b for a, b in zip(e, f, strict=True)) for f in terms
            ):
                yield e

    def additions(self, terms: frozenset[Exponents]) -> Iterator[frozenset[Exponents]]:
        """The terms with one more, and what it contains."""
        for e in self.everything:
            if e not in terms:
                inside = set(hierarchical_closure([e])) & set(self.everything)
                yield terms | inside

    def backward(self, alpha: float) -> tuple[frozenset[Exponents], list[str]]:
        terms, steps = frozenset(self.everything), list[str]()
        while True:
            tests = [(self.p_value(terms - {e}, terms), e) for e in self.removable(terms)]
            if not tests or max(tests)[0] <= alpha:
                return terms, steps
            p, worst = max(tests)
            terms = terms - {worst}
            steps.append(f"left out {self.name([worst])} (p = {p:.3g})")

    def forward(self, alpha: float) -> tuple[frozenset[Exponents], list[str]]:
        terms, steps = frozenset(self.always), list[str]()
        while True:
            tests = [(self.p_value(terms, more), sorted(more)) for more in self.additions(terms)]
            if not tests or min(tests)[0] > alpha:
                return terms, steps
            p, best = min(tests)
            steps.append(f"took in {self.name(set(best) - terms)} (p = {p:.3g})")
            terms = frozenset(best)

    def stepwise(self) -> tuple[frozenset[Exponents], list[str]]:
        terms, steps = frozenset(self.everything), list[str]()
        while True:
            options = [terms - {e} for e in self.removable(terms)] + list(self.additions(terms))
            best = min(options, key=self.aicc, default=terms)
            if self.aicc(best) >= self.aicc(terms) - 1e-9:
                return terms, steps
            word = (
                f"left out {self.name(terms - best)}"
                if best < terms
                else f"took in {self.name(best - terms)}"
            )
            steps.append(f"{word} (AICc {self.aicc(best) - self.aicc(terms):+.3g})")
            terms = best

    def all_subsets(self) -> tuple[frozenset[Exponents], list[str]]:
        count, best = 0, frozenset(self.everything)
        for terms in self._subsets():
            count += 1
            if count > MOST_SUBSETS:
                raise RsmkitError(
                    f"{self.surface.response}: over {MOST_SUBSETS:,} hierarchical subsets; use stepwise AICc"
                )
            if self.aicc(terms) < self.aicc(best):
                best = terms
        return best, [f"best AICc of {count} hierarchical subsets"]

    def _subsets(self) -> Iterator[frozenset[Exponents]]:
        """Every hierarchical subset, each once: degree by degree."""
        degrees = sorted({sum(e) for e in self.everything if e not in self.always} - {0})
        yield from self._grow(frozenset(self.always), degrees)

    def _grow(self, terms: frozenset[Exponents], degrees: list[int]) -> Iterator[frozenset[Exponents]]:
        if not degrees:
            yield terms
            return
        everything = set(self.everything)
        allowed = [
            e
            for e in self.everything
            if sum(e) == degrees[0]
            and e not in terms
            and (set(hierarchical_closure([e])) & everything) - {e} <= terms
        ]
        for more in chain.from_iterable(combinations(allowed, m) for m in range(len(allowed) + 1)):
            yield from self._grow(terms | set(more), degrees[1:])

    def name(self, terms: Iterable[Exponents]) -> str:
        named = replace(self.surface.terms, exponents=tuple(sorted(terms)))
        return ", ".join(named.names(self.surface.space))
