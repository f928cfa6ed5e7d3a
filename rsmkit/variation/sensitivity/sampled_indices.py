"""Sobol indices by quasi-Monte Carlo, for functions that have no closed form and for correlated laws.

First order: Saltelli et al., *Computer Physics Communications* 181 (2010) 259; total: Jansen, *ibid.* 117
(1999) 35. With correlated laws the variances are conditional ones of dependent factors: Kucherenko, Tarantola
and Annoni, *ibid.* 183 (2012) 937; they need not add up. Points are scrambled Sobol sequences, several
independent ones, whose scatter tells the error of sampling.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import ndtri
from scipy.stats import qmc

from rsmkit.language.joint_law import JointLaw
from rsmkit.language.space import Floats

__all__ = ["REPLICATES", "Estimates", "SampledIndices", "law_points", "sample_indices", "sobol_estimates"]

REPLICATES = 8
"""Independent sequences, a power of 2."""


@dataclass(frozen=True, eq=False)
class Estimates:
    """Estimates from one pair of samples, in units of variance; the last axes are those of the values.

    Parameters
    ----------
    mean, variance : array, shape (...)
    first, total : array, shape (m, ...)
        Variance that each factor causes alone, and that it has a part in.
    pairs : array, shape (m, m, ...), optional
        Variance that two factors cause together, above the diagonal.
    """

    mean: Floats
    variance: Floats
    first: Floats
    total: Floats
    pairs: Floats | None = None


def sobol_estimates(a: Floats, b: Floats, ab: Floats, ba: Floats | None = None) -> Estimates:
    """Estimate indices from values at two samples and at their mixtures.

    Parameters
    ----------
    a, b : array, shape (n, ...)
        Values at two independent samples A and B.
    ab : array, shape (m, n, ...)
        Values at A with the column of one factor from B.
    ba : array, shape (m, n, ...), optional
        Values at B with the column of one factor from A; pairs need them.
    """
    mean = 0.5 * (a.mean(axis=0) + b.mean(axis=0))
    # the estimate of the first order depends on the origin; the mean of all values is the least noisy one
    origin = np.concatenate([a[None], b[None], ab, *([] if ba is None else [ba])]).mean(axis=(0, 1))
    a, b, ab = a - origin, b - origin, ab - origin
    both = np.concatenate([a, b])
    first = np.mean(b * (ab - a), axis=1)
    total = 0.5 * np.mean((ab - a) ** 2, axis=1)
    pairs = None
    if ba is not None:
        swapped, m = ba - origin, len(ab)
        pairs = np.zeros((m, *first.shape))
        for i in range(m):
            for j in range(i + 1, m):
                closed = np.mean(swapped[i] * ab[j] - a * b, axis=0)
                pairs[i, j] = closed - first[i] - first[j]
    return Estimates(mean, both.var(axis=0), first, total, pairs)


@dataclass(frozen=True, eq=False)
class SampledIndices:
    """Estimates of several independent sequences."""

    replicates: tuple[Estimates, ...]

    def mean_of(self, key: str) -> Floats:
        """Average over the sequences of one of the estimates."""
        return np.asarray(np.mean([getattr(item, key) for item in self.replicates], axis=0))

    def error_of(self, key: str) -> Floats:
        """Standard error of that average."""
        values = np.array([getattr(item, key) for item in self.replicates])
        return np.asarray(values.std(axis=0, ddof=1) / np.sqrt(len(values)))

    @cached_property
    def count(self) -> int:
        """Number of sequences."""
        return len(self.replicates)


def law_points(law: JointLaw, count: int, seed: int, *, columns: int = 1) -> list[Floats]:
    """Uniform numbers of a scrambled Sobol sequence for `columns` samples, each of shape (count, m)."""
    m = len(law)
    u = qmc.Sobol(m * columns, rng=np.random.default_rng(seed)).random(count)
    inside = np.clip(u, 2.0**-33, 1.0 - 2.0**-33)
    return [inside[:, m * part : m * (part + 1)] for part in range(columns)]


def sample_indices(
    function: Callable[[Floats], Floats], law: JointLaw, count: int, seed: int, *, pairs: bool = False
) -> SampledIndices:
    """Estimate the indices of one or several functions.

    Parameters
    ----------
    function : callable
        Points (n, k), natural units, to values (n,), or (functions, n).
    law : JointLaw
    count : int
        Points of each of two samples, a power of 2.
    seed : int
    pairs : bool
        Whether to estimate what pairs of factors cause together; independent laws only.
    """
    each = max(count // REPLICATES, 16)

    def values(points: Floats) -> Floats:
        return np.moveaxis(np.asarray(function(points), float), -1, 0)

    found = []
    for replicate in range(REPLICATES):
        u, v = law_points(law, each, seed + 7919 * replicate, columns=2)
        mixtures = _mixtures if law.independent else _dependent_mixtures
        a, b, ab, ba = mixtures(law, u, v)
        if law.independent:
            at_ba = np.array([values(points) for points in ba]) if pairs else None
            at_ab = np.array([values(points) for points in ab])
            found.append(sobol_estimates(values(a), values(b), at_ab, at_ba))
        else:
            at_a, at_b = values(a), values(b)
            mean = 0.5 * (at_a.mean(axis=0) + at_b.mean(axis=0))
            fresh = np.array([values(points) for points in ab]) - mean
            kept = np.array([values(points) for points in ba]) - mean
            at_a, at_b = at_a - mean, at_b - mean
            variance = np.concatenate([at_a, at_b]).var(axis=0)
            first = np.mean(at_a * (kept - at_b), axis=1)
            total = 0.5 * np.mean((fresh - at_a) ** 2, axis=1)
            found.append(Estimates(mean, variance, first, total))
    return SampledIndices(tuple(found))


Mixtures = tuple[Floats, Floats, list[Floats], list[Floats]]


def _mixtures(law: JointLaw, u: Floats, v: Floats) -> Mixtures:
    """Two samples, and each with the column of one factor from the other."""
    a, b = law.of_uniform(u), law.of_uniform(v)
    ab: list[Floats] = []
    ba: list[Floats] = []
    for column in law.columns:
        for mixed, own, other in ((ab, a, b), (ba, b, a)):
            points = own.copy()
            points[:, column] = other[:, column]
            mixed.append(points)
    return a, b, ab, ba


def _dependent_mixtures(law: JointLaw, u: Floats, v: Floats) -> Mixtures:
    """The same of correlated laws: one factor anew given the others, and the others anew given one."""
    m, correlation = len(law), law.matrix
    z = np.asarray(ndtri(u)) @ law.root.T
    fresh = np.asarray(ndtri(v))
    ab: list[Floats] = []
    ba: list[Floats] = []
    for i in range(m):
        rest = [j for j in range(m) if j != i]
        for mixed, order, kept in ((ab, [*rest, i], slice(0, m - 1)), (ba, [i, *rest], slice(0, 1))):
            root = np.linalg.cholesky(correlation[np.ix_(order, order)])
            independent = fresh[:, order].copy()
            independent[:, kept] = np.linalg.solve(root, z[:, order].T).T[:, kept]
            numbers = np.empty_like(z)
            numbers[:, order] = independent @ root.T
            mixed.append(law.of_normal(numbers))
    return law.of_normal(z), law.of_normal(fresh @ law.root.T), ab, ba
