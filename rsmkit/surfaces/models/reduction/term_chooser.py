"""Choosing terms of a model: ways through its hierarchical subsets, whatever each of them is worth."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator
from itertools import chain, combinations
from typing import Literal

from rsmkit.errors import RsmkitError
from rsmkit.surfaces.models.polynomial import PolynomialSurface
from rsmkit.surfaces.models.reduction.reduction_steps import SAME, Steps, Subset

__all__ = ["Method", "TermChooser", "penalty"]

Method = Literal["backward", "forward", "aicc", "aic", "bic", "all"]
"""How terms are chosen; ``all`` is the best AICc of all subsets, the other criteria go stepwise."""

WORDS = {"aic": "AIC", "bic": "BIC"}
"""Criteria by method; AICc for the others."""
MOST_SUBSETS = 200_000


def penalty(method: Method, count: int, n: int) -> float:
    """What a criterion adds to twice the negative log-likelihood for `count` parameters from `n` runs.

    Akaike's criterion (AIC), the same corrected for few runs (AICc; Hurvich & Tsai 1989; infinite for nearly
    saturated models), or the Bayesian one of Schwarz (1978).
    """
    if method == "bic":
        return count * math.log(n)
    if method == "aic":
        return 2.0 * count
    if n <= count + 1:
        return math.inf
    return 2.0 * count + 2.0 * count * (count + 1.0) / (n - count - 1.0)


class TermChooser(ABC):
    """Ways through the hierarchical subsets of the terms of a fitted surface.

    Parameters
    ----------
    surface : PolynomialSurface
        The full model.
    method : Method
    """

    def __init__(self, surface: PolynomialSurface, method: Method) -> None:
        self.method, self.word, self.n = method, WORDS.get(method, "AICc"), surface.fit.n
        self.steps = Steps(surface)
        self.everything, self.always = self.steps.everything, self.steps.always
        self.columns = self.steps.columns

    @abstractmethod
    def criterion(self, terms: Subset) -> float:
        """The criterion of the method, up to a constant; the less the better."""

    @abstractmethod
    def p_value(self, small: Subset, large: Subset) -> float:
        """Test of the larger model against the smaller one; nan where there is none."""

    def look_around(self, terms: Subset, options: Iterable[Subset]) -> None:  # noqa: B027
        """Prepare to judge models near one, where that is cheaper together."""

    def choose(self, alpha: float) -> tuple[Subset, list[str]]:
        """The terms that the method keeps, and what was done in order, in words."""
        if self.method == "backward":
            return self.backward(alpha)
        if self.method == "forward":
            return self.forward(alpha)
        return self.all_subsets() if self.method == "all" else self.stepwise()

    def backward(self, alpha: float) -> tuple[Subset, list[str]]:
        """Leave out the term of the largest p-value until all are below alpha."""
        terms, steps = self.everything, list[str]()
        while True:
            options = self.steps.smaller(terms)
            self.look_around(terms, options.values())
            tests = [(self.p_value(fewer, terms), t) for t, fewer in options.items()]
            tests = [(p, t) for p, t in tests if not math.isnan(p)]  # what cannot be tested stays
            if not tests or max(tests)[0] <= alpha:
                return terms, steps
            p, worst = max(tests)
            terms = terms - {worst}
            steps.append(f"left out {self.steps.name([worst])} (p = {p:.3g})")

    def forward(self, alpha: float) -> tuple[Subset, list[str]]:
        """Take in the term of the least p-value, with what it contains, while one is below alpha."""
        terms, steps = self.always, list[str]()
        while True:
            options = self.steps.larger(terms)
            self.look_around(terms, options)
            tests = [(self.p_value(terms, more), sorted(more)) for more in options]
            tests = [(p, more) for p, more in tests if not math.isnan(p)]
            if not tests or min(tests)[0] > alpha:
                return terms, steps
            p, best = min(tests)
            steps.append(f"took in {self.steps.name(set(best) - terms)} (p = {p:.3g})")
            terms = frozenset(best)

    def stepwise(self) -> tuple[Subset, list[str]]:
        """Go from all terms, out and in, to where no step lowers the criterion."""
        terms, steps = self.everything, list[str]()
        while True:
            options = [*self.steps.smaller(terms).values(), *self.steps.larger(terms)]
            self.look_around(terms, options)
            least = min(map(self.criterion, options), default=math.inf)
            # the first of equals, which rounding tells apart
            best = next((o for o in options if self.criterion(o) <= least + SAME), terms)
            if self.criterion(best) >= self.criterion(terms) - SAME:
                return terms, steps
            word = (
                f"left out {self.steps.name(terms - best)}"
                if best < terms
                else f"took in {self.steps.name(best - terms)}"
            )
            steps.append(f"{word} ({self.word} {self.criterion(best) - self.criterion(terms):+.3g})")
            terms = best

    def all_subsets(self) -> tuple[Subset, list[str]]:
        """Try every hierarchical subset."""
        count, best = 0, self.everything
        for terms in self._subsets():
            count += 1
            if count > MOST_SUBSETS:
                raise RsmkitError(
                    f"{self.steps.surface.response}: over {MOST_SUBSETS:,} hierarchical subsets; "
                    "choose terms stepwise"
                )
            if self.criterion(terms) < self.criterion(best):
                best = terms
        return best, [f"best {self.word} of {count} hierarchical subsets"]

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
