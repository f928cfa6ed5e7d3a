"""What a model whose terms are chosen predicts for each run, with the terms chosen without it.

Leaving a run out changes a decomposition by rank one (Belsley, Kuh & Welsch, *Regression Diagnostics*, 1980,
chapter 2). So all runs go through the steps of the reduction together: a model that many of them come by is
decomposed once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from rsmkit.language.space import Floats
from rsmkit.surfaces.estimation.least_squares import EXACT
from rsmkit.surfaces.models.polynomial import PolynomialSurface, fit_polynomial
from rsmkit.surfaces.models.reduction.reduced import choose_terms
from rsmkit.surfaces.models.reduction.reduction_steps import SAME, Steps, Subset, corrected_akaike
from rsmkit.surfaces.models.reduction.term_chooser import Method

__all__ = ["nested_errors"]

CANCELLED = 1e-4
"""A sum of squares that a difference leaves less than this of is computed anew."""


def nested_errors(surface: PolynomialSurface, method: Method = "aicc", alpha: float = 0.1) -> Floats:
    """Error at each run with the terms chosen and fitted without it, shape (n,).

    In the run's own block, as for any model of these terms; infinite where only the run itself tells of it.

    Parameters
    ----------
    surface : PolynomialSurface
        The full model.
    method, alpha
        As for :func:`rsmkit.surfaces.models.reduction.reduced.reduce_surface`.

    Raises
    ------
    FitError
        When a term cannot be told from the others without one of the runs.
    """
    steps = Steps(surface)
    numbers = {e: t for t, e in enumerate(steps.exponents)}
    chosen: dict[int, Subset] = {}
    for run in np.flatnonzero(~surface.fit.free).tolist():
        _without(surface, run)  # says why not, unless the run is a block by itself
    runs = np.flatnonzero(surface.fit.free)
    if method == "aicc":
        chosen = _Walk(surface, steps).stepwise(runs)
    else:
        for run in runs.tolist():
            kept = choose_terms(_without(surface, run), method, alpha).surface.terms
            chosen[run] = frozenset(numbers[e] for e in kept.exponents)
    errors, known = np.full(len(surface.data), np.inf), dict[Subset, Floats]()
    for run, terms in chosen.items():
        if terms not in known:
            kept = surface.terms.subset(steps.chosen(terms))
            found = fit_polynomial(surface.space, surface.response, surface.data, kept, surface.coordinates)
            known[terms] = found.fit.loo_residuals
        errors[run] = known[terms][run]
    return errors


def _without(surface: PolynomialSurface, run: int) -> PolynomialSurface:
    rest = surface.data.without(run)
    return fit_polynomial(surface.space, surface.response, rest, surface.terms, surface.coordinates)


@dataclass(frozen=True)
class _Around:
    """Models one step away from another, and what each leaves of the response without each run.

    Parameters
    ----------
    rss : array, shape (n,)
        Of the model itself.
    options : list of frozenset
    columns : array, shape (m,)
        Of each option.
    left : array, shape (n, m)
        Residual sums of squares of the options.
    """

    rss: Floats
    options: list[Subset]
    columns: NDArray[np.intp]
    left: Floats


class _Walk:
    """Stepwise reductions without each of the runs."""

    def __init__(self, surface: PolynomialSurface, steps: Steps) -> None:
        fit = surface.fit
        root = np.sqrt(fit.weights)
        self.steps = steps
        self.matrix = surface.matrix * root[:, None]
        self.matrix /= np.linalg.norm(self.matrix, axis=0)
        self.y = fit.y * root
        squares = self.y**2
        # no term is chosen by rounding errors
        self.rounding = EXACT**2 * (squares.sum() - squares)

    def stepwise(self, runs: NDArray[np.intp]) -> dict[int, Subset]:
        """Terms with the least criterion that steps lead to, without each of these runs."""
        others, chosen = len(self.y) - 1, dict[int, Subset]()
        reached = np.full(len(self.y), np.nan)
        groups = {self.steps.everything: runs}
        while groups:
            onward: dict[Subset, list[int]] = {}
            for terms, members in groups.items():
                around = self._around(terms)
                own = corrected_akaike(around.rss, len(self.steps.columns_of(terms)), others)
                values = corrected_akaike(around.left, around.columns, others)
                for run in members.tolist():
                    if np.isnan(reached[run]):
                        reached[run] = own[run]
                    least = values[run].min(initial=np.inf)
                    if not around.options or least >= reached[run] - SAME:
                        chosen[run] = terms
                        continue
                    # the first of equals, which rounding tells apart
                    best = int(np.argmax(values[run] <= least + SAME))
                    reached[run] = values[run, best]
                    onward.setdefault(around.options[best], []).append(run)
            groups = {terms: np.array(members) for terms, members in onward.items()}
        return chosen

    def _around(self, terms: Subset) -> _Around:
        """All options from one decomposition, each run left out by rank one."""
        steps, columns = self.steps, self.steps.columns_of(terms)
        q, r = np.linalg.qr(self.matrix[:, columns])
        e = self.y - q @ (q.T @ self.y)
        e = e - q @ (q.T @ e)  # twice, for what rounding leaves
        slack = 1.0 - np.einsum("ij,ij->i", q, q)
        scaled = e / slack
        rss = self._checked(e @ e, e * scaled, columns)
        inverse = solve_triangular(r, np.eye(len(columns)))
        drawn = q @ inverse.T  # each run times the covariance of the coefficients
        b = inverse @ (q.T @ self.y) - drawn * scaled[:, None]
        others = steps.columns_of(steps.everything - terms)
        beyond = self.matrix[:, others]
        for _ in range(2):
            beyond = beyond - q @ (q.T @ beyond)
        crossed = e @ beyond - beyond * scaled[:, None]
        options, sizes, left = list[Subset](), list[int](), list[Floats]()
        for fewer in steps.smaller(terms).values():
            lost = [columns.index(c) for c in steps.columns_of(terms - fewer)]
            covariance = _added(inverse[lost] @ inverse[lost].T, drawn[:, lost], slack)
            options.append(fewer)
            sizes.append(len(columns) - len(lost))
            left.append(rss + _quadratic(b[:, lost], covariance))
        for more in steps.larger(terms):
            new = [others.index(c) for c in steps.columns_of(more - terms)]
            squares = _added(beyond[:, new].T @ beyond[:, new], beyond[:, new], -slack)
            gained = _quadratic(crossed[:, new], squares)
            options.append(more)
            sizes.append(len(columns) + len(new))
            left.append(self._checked(rss, gained, steps.columns_of(more)))
        n = len(self.y)
        table = np.column_stack(left) if left else np.empty((n, 0))
        floor = self.rounding
        return _Around(
            np.maximum(rss, floor), options, np.array(sizes, int), np.maximum(table, floor[:, None])
        )

    def _checked(self, whole: Floats | float, part: Floats, columns: list[int]) -> Floats:
        """``whole - part``, found without a difference where little is left of it, shape (n,)."""
        found = np.asarray(whole - part)
        small = found < CANCELLED * np.asarray(whole)
        small &= whole > self.rounding
        for run in np.flatnonzero(small).tolist():
            matrix, y = np.delete(self.matrix[:, columns], run, axis=0), np.delete(self.y, run)
            q = np.linalg.qr(matrix)[0]
            e = y - q @ (q.T @ y)
            found[run] = e @ e
        return found


def _added(square: Floats, rows: Floats, slack: Floats) -> Floats:
    """``square + rows rows' / slack`` for each run, shape (n, m, m)."""
    return np.asarray(square + rows[:, :, None] * (rows / slack[:, None])[:, None, :])


def _quadratic(b: Floats, square: Floats) -> Floats:
    """``b' square^-1 b`` for each run, shape (n,); nothing where a single square is nothing."""
    if b.shape[1] == 1:
        whole = square[:, 0, 0]
        return np.divide(b[:, 0] ** 2, whole, out=np.zeros(len(b)), where=whole > 0)
    return np.asarray(np.einsum("ij,ij->i", b, np.linalg.solve(square, b[:, :, None])[:, :, 0]))
