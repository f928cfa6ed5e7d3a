"""Restricted maximum likelihood of the variances of groups and runs, with generalised least squares.

The ratios of the variances of the groups to that of the runs are found by minimising the profiled criterion
``(n-p) log s2 + log|H| + log|X'H^-1X|``, ``H = I + sum ratio_i Z_i Z_i'`` (Patterson & Thompson, Biometrika
58, 1971; Goos & Jones, *Optimal Design of Experiments*, 2011, section 10.3). A ratio whose derivative at zero
is positive is zero exactly.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from rsmkit.errors import FitError
from rsmkit.language.space import Floats
from rsmkit.surfaces.estimation.mixed.error_contrasts import ErrorContrasts, error_contrasts, indicators

__all__ = ["RandomGroups", "Reml", "random_groups", "reml"]

STARTS = (0.05, 1.0, 20.0)
"""Ratios from which a minimum is looked for, times the runs per group."""
LARGEST_LOG = 30.0
"""Of one plus a ratio times the runs per group: the runs of a group then agree to the last digit."""
EXACT = 1e-20
"""Residual sum of squares as a share of that of the response that is rounding and nothing else."""


@dataclass(frozen=True, eq=False)
class RandomGroups:
    """One kind of groups that are a sample: plots, days.

    Parameters
    ----------
    name : str
    levels : tuple of str
        Names of the groups.
    index : array, shape (n,)
        Group of each run.
    """

    name: str
    levels: tuple[str, ...]
    index: NDArray[np.intp]

    @cached_property
    def columns(self) -> Floats:
        """One column per group, shape (n, groups)."""
        return indicators(self.index)


@dataclass(frozen=True, eq=False)
class Reml:
    """Estimated variances and coefficients.

    Matrices are those of runs times the square root of their weights.

    Parameters
    ----------
    matrix : array, shape (n, p)
    y : array, shape (n,)
    groups : tuple of RandomGroups
    columns : tuple of array, shape (n, q_i)
        Z of each kind.
    contrasts : ErrorContrasts
    variances : array, shape (r + 1,)
        Of the groups, then of a run.
    log_weights : float
        Sum of the logarithms of the weights.
    """

    matrix: Floats
    y: Floats
    groups: tuple[RandomGroups, ...]
    columns: tuple[Floats, ...]
    contrasts: ErrorContrasts
    variances: Floats
    log_weights: float = 0.0

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the variances: the groups, ``residual``."""
        return (*(group.name for group in self.groups), "residual")

    @property
    def ratios(self) -> Floats:
        """Variances of the groups over that of a run, shape (r,)."""
        ratios: Floats = self.variances[:-1] / self.variances[-1]
        return ratios

    @property
    def boundary(self) -> tuple[str, ...]:
        """Groups whose estimated variance is zero."""
        return tuple(g.name for g, v in zip(self.groups, self.variances, strict=False) if v == 0)

    @cached_property
    def deviance(self) -> float:
        """Minus twice the restricted log-likelihood, its constants as in R's lme4."""
        value, _ = self.contrasts.deviance(self.variances)
        _, log_det = np.linalg.slogdet(self.matrix.T @ self.matrix)
        return float(value + self.contrasts.df * math.log(2 * math.pi) + log_det - self.log_weights)

    @cached_property
    def weighted(self) -> Floats:
        """``V^-1 X``, shape (n, p)."""
        return self.solve(self.matrix)

    @cached_property
    def factor(self) -> Floats:
        """Upper triangular F with ``F F'`` the covariance of the coefficients for a run variance of one."""
        upper = np.linalg.cholesky(self.variances[-1] * self.matrix.T @ self.weighted).T
        return np.asarray(solve_triangular(upper, np.eye(len(upper))))

    @cached_property
    def covariance(self) -> Floats:
        """``Phi = (X' V^-1 X)^-1``, the variances taken as known, shape (p, p)."""
        return np.asarray(self.variances[-1] * self.factor @ self.factor.T)

    @cached_property
    def coefficients(self) -> Floats:
        """Generalised least squares, shape (p,); ordinary where all ratios are zero."""
        found = self.covariance @ (self.weighted.T @ self.y)
        return np.asarray(found + self.covariance @ (self.weighted.T @ (self.y - self.matrix @ found)))

    @cached_property
    def residuals(self) -> Floats:
        """Marginal residuals ``y - X b``, shape (n,), times the square root of the weights."""
        return self.y - self.matrix @ self.coefficients

    @cached_property
    def effects(self) -> tuple[Floats, ...]:
        """Best linear unbiased predictions of the groups, shape (q_i,) each."""
        pull = self.solve(self.residuals[:, None])[:, 0]
        return tuple(v * (z.T @ pull) for v, z in zip(self.variances, self.columns, strict=False))

    @cached_property
    def deleted(self) -> Floats:
        """What each run is off from its prediction by all others and its groups, shape (n,).

        ``(P y)_i / P_ii``, the variances kept; infinite where a run is fitted whatever its value.
        """
        spread = self.weighted @ self.covariance
        diagonal = np.diag(self.solve(np.eye(len(self.y)))) - np.einsum("ij,ij->i", spread, self.weighted)
        pull = self.solve(self.residuals[:, None])[:, 0]
        known = diagonal * self.variances[-1] > 1e-10
        return np.where(known, pull / np.where(known, diagonal, 1.0), np.inf)

    @cached_property
    def loo_residuals(self) -> Floats:
        """Error of the fixed part at each run when it is estimated without the run, shape (n,)."""
        weight = np.einsum("ij,ij->i", self.matrix @ self.covariance, self.weighted)
        return np.where(np.isfinite(self.deleted), self.residuals + weight * self.deleted, np.inf)

    def solve(self, right: Floats) -> Floats:
        """``V^-1`` times a matrix of n rows, by the formula of Woodbury."""
        scaled = np.hstack(self.columns) * np.repeat(np.sqrt(self.ratios), [z.shape[1] for z in self.columns])
        inner = np.eye(scaled.shape[1]) + scaled.T @ scaled
        moved = right - scaled @ np.linalg.solve(inner, scaled.T @ right)
        return np.asarray(moved / self.variances[-1])


def random_groups(labels: Mapping[str, Sequence[str]]) -> tuple[RandomGroups, ...]:
    """Number the groups of each kind.

    Raises
    ------
    FitError
        For a kind with one group only, or with one run in each, or two kinds that are the same.
    """
    found: list[RandomGroups] = []
    for name, texts in labels.items():
        levels = tuple(dict.fromkeys(texts))
        index = np.array([levels.index(text) for text in texts], np.intp)
        if len(levels) < 2:
            raise FitError(f"random {name}: there is one group only; its variance needs several")
        if len(levels) == len(texts):
            raise FitError(
                f"random {name}: every run is a group of its own, so groups and runs cannot be told apart; "
                "leave it out"
            )
        for other in found:
            if (
                len(set(zip(other.index.tolist(), index.tolist(), strict=True)))
                == len(levels)
                == len(other.levels)
            ):
                raise FitError(
                    f"random {name} and {other.name} are the same groups; name one of them. Plots within "
                    "days need labels that differ from day to day"
                )
        found.append(RandomGroups(name, levels, index))
    return tuple(found)


def reml(
    matrix: Floats,
    y: Floats,
    groups: Sequence[RandomGroups],
    weights: Floats | None = None,
    variances: Floats | None = None,
) -> Reml:
    """Estimate variances and coefficients.

    Parameters
    ----------
    matrix : array, shape (n, p)
        Columns of the terms, of full rank.
    y : array, shape (n,)
    groups : sequence of RandomGroups
    weights : array, shape (n,), optional
        Inversely proportional to the variance of a run about its group.
    variances : array, shape (r + 1,), optional
        Of the groups and of a run, where they are known.

    Raises
    ------
    FitError
        When nothing is left to estimate the variance of a run from.
    """
    root = np.ones(len(y)) if weights is None else np.sqrt(weights)
    x, target = matrix * root[:, None], y * root
    columns = tuple(group.columns * root[:, None] for group in groups)
    contrasts = error_contrasts(x, target, columns)
    left = contrasts.rest + float(contrasts.u @ contrasts.u)
    if contrasts.df == 0:
        raise FitError("there are as many terms as runs, so no variance can be estimated: use fewer terms")
    if left <= EXACT * float(target @ target):
        raise FitError(
            "the terms describe the runs exactly, so there is no variance to estimate: runs without scatter "
            "need no random groups; leave them out, which gives the same coefficients"
        )
    if contrasts.rest_df == 0:
        raise FitError(
            f"the terms and the groups of {', '.join(g.name for g in groups)} describe the runs whatever "
            "they are: nothing is left for the variance of a run. Use fewer terms or repeat runs in a group"
        )
    if variances is None:
        ratios = _best_ratios(contrasts, tuple(group.name for group in groups))
        variances = contrasts.residual_variance(ratios) * np.r_[ratios, 1.0]
    return Reml(x, target, tuple(groups), columns, contrasts, variances, float(2 * np.log(root).sum()))


def _best_ratios(contrasts: ErrorContrasts, names: Sequence[str]) -> Floats:
    """Least of the minima that are found from several starts, shape (r,)."""
    count, scales = len(names), contrasts.scales
    estimable = np.array([np.abs(part).max(initial=0.0) > 1e-9 for part in contrasts.parts])
    starts = list(itertools.product(STARTS, repeat=count)) if count <= 2 else [(s,) * count for s in STARTS]
    found = []
    for start in starts:
        ratios = _descend(contrasts, np.where(estimable, np.array(start) / scales, 0.0))
        found.append((contrasts.profile(ratios)[0], ratios))
    ratios = min(found, key=lambda item: item[0])[1]
    endless = np.log1p(ratios * scales) > LARGEST_LOG - 1
    if endless.any():
        listed = ", ".join(name for name, far in zip(names, endless, strict=True) if far)
        raise FitError(
            f"the runs within a group of {listed} agree with the terms exactly, so there is no variance of a "
            "run to compare with; average the runs of each group and fit the averages"
        )
    return ratios


def _descend(contrasts: ErrorContrasts, start: Floats) -> Floats:
    """A minimum: quasi-Newton steps in the logarithm, then Newton's for the last digits."""
    from scipy.optimize import minimize

    scales = contrasts.scales
    free = start > 0

    def criterion(logs: Floats) -> tuple[float, Floats]:
        ratios = start * 0.0
        ratios[free] = np.expm1(logs) / scales[free]
        value, gradient, _ = contrasts.profile(ratios)
        return value, gradient[free] * np.exp(logs) / scales[free]

    if not free.any():
        return start
    limits = [(0.0, LARGEST_LOG)] * int(free.sum())
    first = np.log1p(start * scales)[free]
    found = minimize(criterion, first, jac=True, method="L-BFGS-B", bounds=limits, options={"gtol": 1e-7})
    ratios = np.zeros_like(start)
    ratios[free] = np.expm1(found.x) / scales[free]
    return _polished(contrasts, ratios, free)


def _polished(contrasts: ErrorContrasts, ratios: Floats, free: NDArray[np.bool_]) -> Floats:
    """Newton's iteration over the ratios that are not held at zero."""
    value, gradient, hessian = contrasts.profile(ratios)
    for _ in range(50):
        held = ~free | ((ratios * contrasts.scales < 1e-7) & (gradient >= 0))
        ratios = np.where(held, 0.0, ratios)
        value, gradient, hessian = contrasts.profile(ratios)
        moving = np.nonzero(~held)[0]
        if not moving.size:
            return ratios
        part = hessian[np.ix_(moving, moving)]
        if np.linalg.eigvalsh(part).min() <= 0:
            return ratios
        step = np.zeros_like(ratios)
        step[moving] = -np.linalg.solve(part, gradient[moving])
        size = 1.0
        while size > 1e-6:
            tried = np.maximum(ratios + size * step, 0.0)
            if contrasts.profile(tried)[0] <= value:
                break
            size *= 0.5
        else:
            return ratios
        done = np.abs(tried - ratios).max() <= 1e-13 * max(tried.max(), 1e-6)
        ratios = tried
        if done:
            break
    return ratios
