"""Cost of a full second-order fit with every diagnostic, against statsmodels' own route, in one run.

Usage: OMP_NUM_THREADS=1 python benchmarks/surfaces_speed.py
"""

import time

import numpy as np
from statsmodels.regression.linear_model import OLS
from statsmodels.stats.outliers_influence import OLSInfluence, variance_inflation_factor

from rsmkit import Space, fit_surface, full_terms
from rsmkit.surfaces.estimation.fit_data import checked_data
from rsmkit.surfaces.models.polynomial import fit_polynomial
from rsmkit.surfaces.statistics.collinearity import variance_inflation


def cpu_seconds(task, repeats=5):
    """Least processor time of some repeats."""
    found = []
    for _ in range(repeats):
        start = time.process_time()
        task()
        found.append(time.process_time() - start)
    return min(found)


def compare(k, n, sample_of_vif):
    rng = np.random.default_rng(0)
    space = Space(**{f"x{j}": (-1.0, 1.0) for j in range(k)})
    points = rng.uniform(-1, 1, (n, k))
    y = points.sum(axis=1) + points[:, 0] ** 2 + rng.normal(size=n)
    terms, data = full_terms(k, 2), checked_data(space, points, y)
    fit_surface(space, points, y)  # imports

    def arithmetic():
        surface = fit_polynomial(space, "y", data, terms)
        fit = surface.fit
        inflation = variance_inflation(surface)
        return surface.p_values, inflation, fit.press, fit.cooks_distances, fit.dffits, fit.deleted

    matrix = terms.matrix(points)

    def peer():
        influence = OLSInfluence(OLS(y, matrix).fit(method="qr"))
        return (
            influence.cooks_distance,
            influence.dffits,
            influence.resid_studentized_external,
            influence.ess_press,
        )

    columns = range(1, 1 + sample_of_vif)
    vif = cpu_seconds(lambda: [variance_inflation_factor(matrix, j) for j in columns], 1)
    vif *= (terms.p - 1) / sample_of_vif
    ours, theirs = cpu_seconds(arithmetic), cpu_seconds(peer, 2)
    whole = cpu_seconds(lambda: fit_surface(space, points, y).report(), 2)
    print(f"k = {k}, n = {n}, p = {terms.p}")
    print(f"  fit and all diagnostics       {1e3 * ours:9.1f} ms")
    print(f"  with statsmodels and report() {1e3 * whole:9.1f} ms")
    peer_time = theirs + vif
    print(f"  statsmodels' influence + VIF  {1e3 * peer_time:9.1f} ms   ({peer_time / ours:.0f} times ours)")


def prediction():
    space = Space(a=(0.0, 1.0), b=(0.0, 1.0), c=(0.0, 1.0))
    points = np.random.default_rng(0).uniform(size=(50, 3))
    surface = fit_surface(space, points, np.exp(points.sum(axis=1)))
    many = np.random.default_rng(1).uniform(size=(10**6, 3))
    print("10^6 points, quadratic in three factors")
    print(f"  predict                       {1e3 * cpu_seconds(lambda: surface.predict(many)):9.1f} ms")
    with_interval = cpu_seconds(lambda: surface.predict(many, interval=0.95))
    print(f"  predict with interval         {1e3 * with_interval:9.1f} ms")
    print(f"  gradient                      {1e3 * cpu_seconds(lambda: surface.gradient(many)):9.1f} ms")


if __name__ == "__main__":
    compare(3, 50, 9)
    compare(20, 1000, 5)
    prediction()
