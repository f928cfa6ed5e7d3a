"""How good a design could be at best: the bound from continuous designs.

A continuous design puts any fraction of the runs at any point; no design of whole runs beats the best one.
"""

from __future__ import annotations

import math

import numpy as np

from rsmkit.design.optimal.criteria import variance_points
from rsmkit.design.optimal.edge import candidate_points
from rsmkit.design.region import Region
from rsmkit.language.space import Floats
from rsmkit.language.terms import Terms, full_terms

__all__ = ["log_det_bound"]

MOST_WORK = 2 * 10**9
LEAST_ITERATIONS = 20
PRECISION = 1e-4


def log_det_bound(
    terms: Terms, region: Region, runs: int, given: Floats | None = None, design: Floats | None = None
) -> float:
    """Upper bound of log det X'X over all designs of `runs` runs.

    Parameters
    ----------
    terms : Terms
    region : Region
    runs : int
        Runs in all.
    given : array, shape (m, k), optional
        Coded points that are part of every design; the other `runs - m` lie in the region.
    design : array, shape (n, k), optional
        Coded points of a good design in the region, to begin from and to be counted among its points.

    Notes
    -----
    For the full quadratic on a box the best continuous design has a closed form in two moments. Otherwise the
    multiplicative algorithm (Titterington 1978; Silvey, Titterington & Torsney 1978) runs over the points of
    :func:`rsmkit.design.optimal.criteria.variance_points`, and the general equivalence theorem (Kiefer &
    Wolfowitz 1960, Canadian J. Math. 12, 363-366) turns what it has not reached yet into a bound.
    """
    fixed = np.empty((0, terms.k)) if given is None else given
    if len(fixed) == 0 and _is_quadratic_on_a_box(terms, region):
        reach = float(region.highs[0])
        return terms.p * math.log(runs) + _quadratic_on_the_cube(terms.k) + _scaling(terms, reach)
    points = variance_points(region)
    if region.nonlinear or math.isfinite(region.radius):
        points = np.vstack([points, candidate_points(region, 0)])
    begin = np.empty((0, terms.k)) if design is None else design
    rows = terms.matrix(np.vstack([begin, points]))
    weights = np.full(len(rows), (0.1 if len(begin) else 1.0) / len(points))
    weights[: len(begin)] = 0.9 / max(1, len(begin))
    base = terms.matrix(fixed)
    return _multiplicative(rows, weights, base.T @ base, runs - len(fixed))


def _is_quadratic_on_a_box(terms: Terms, region: Region) -> bool:
    plain = not region.irregular and not region.constraints and np.ptp(region.highs) == 0.0
    symmetric = bool((region.lows == -region.highs).all())
    three_levels = all(
        len(levels) == 0 or {-1.0, 0.0, 1.0} <= set(np.round(levels / region.highs[0], 9).tolist())
        for levels in region.levels
    )
    quadratic = set(terms.exponents) == set(full_terms(terms.k, 2).exponents)
    return plain and symmetric and three_levels and quadratic and not any(terms.levels)


def _quadratic_on_the_cube(k: int) -> float:
    """Largest log det of the information matrix per run, [-1, 1]^k.

    The best design is symmetric on the points with coordinates -1, 0, 1, so with u = E x^2 = E x^4 and
    v = E x^2 y^2 the matrix has the determinant u^k v^(k(k-1)/2) (u - v)^(k-1) (u + (k-1) v - k u^2);
    Farrell, Kiefer & Walbran (1967), Proc. 5th Berkeley Symp. 1, 113-138.
    """
    from scipy.optimize import minimize

    def loss(x: Floats) -> float:
        u, share = x
        v = share * u * u + (1.0 - share) * u  # between independence and u itself
        last = u + (k - 1) * v - k * u * u
        if k == 1:
            return -math.log(u) - math.log(u - u * u)
        return -(
            k * math.log(u) + 0.5 * k * (k - 1) * math.log(v) + (k - 1) * math.log(u - v) + math.log(last)
        )

    limits = [(1e-6, 1.0 - 1e-9), (1e-9, 1.5)]
    best = minimize(
        loss, [0.8, 0.9], bounds=limits, method="Nelder-Mead", options={"xatol": 1e-12, "fatol": 1e-14}
    )
    return -float(best.fun)


def _scaling(terms: Terms, reach: float) -> float:
    """Log det of the change of scale from the unit box to one of the given half-width."""
    return 2.0 * math.log(reach) * sum(sum(exponents) for exponents in terms.exponents)


def _multiplicative(rows: Floats, weights: Floats, base: Floats, free: int) -> float:
    everything, gap = rows, np.inf
    for step in range(max(MOST_WORK // rows.size // len(base), LEAST_ITERATIONS)):
        log_det, variances = _evaluate(rows, rows, weights, base, free)
        if log_det == -np.inf:
            return np.inf
        mean = float(weights @ variances)
        gap = float(variances.max()) - mean
        if gap < PRECISION * len(base):
            break
        weights = weights * variances / mean
        if step % 20 == 19:  # points of no weight only cost time; the bound is taken over all of them
            rows, weights = rows[weights > 1e-8 * weights.max()], weights[weights > 1e-8 * weights.max()]
        weights /= weights.sum()
    log_det, variances = _evaluate(everything, rows, weights, base, free)
    _, own = _evaluate(rows, rows, weights, base, free)
    return log_det + float(variances.max()) - float(weights @ own)


def _evaluate(probes: Floats, rows: Floats, weights: Floats, base: Floats, free: int) -> tuple[float, Floats]:
    """Log det of the information of a weighted design, and the variance of `free` runs at the probes."""
    information = base + free * (rows.T * weights) @ rows
    sign, log_det = np.linalg.slogdet(information)
    if sign <= 0:
        return -np.inf, np.empty(0)
    variances = free * (probes * np.linalg.solve(information, probes.T).T).sum(axis=1)
    return float(log_det), variances
