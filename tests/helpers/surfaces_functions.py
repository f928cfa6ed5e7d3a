"""Smooth test functions of three factors, and designs like those of the study."""

import numpy as np
from scipy.stats import qmc

from rsmkit.language.space import Space
from rsmkit.language.terms import full_terms


def borehole(x):
    """Water flow through a borehole (m^3/yr) in radius, length and conductivity, the rest at mid-range.

    Harper & Gupta (1983); Surjanovic & Bingham, Virtual Library of Simulation Experiments.
    """
    rw, length, conductivity = x.T
    r, tu, hu, tl, hl = 25050.0, 89335.0, 1050.0, 89.55, 760.0
    log = np.log(r / rw)
    return 2 * np.pi * tu * (hu - hl) / (log * (1 + 2 * length * tu / (log * rw**2 * conductivity) + tu / tl))


def reciprocal(x):
    """Posynomial that is steep at the low ends."""
    return 1 / (x[:, 0] * x[:, 1]) ** 0.8 + 0.5 / x[:, 2] + x[:, 0] * x[:, 2]


def rosenbrock(x):
    """Three-dimensional banana valley."""
    return sum(100 * (x[:, i + 1] - x[:, i] ** 2) ** 2 + (1 - x[:, i]) ** 2 for i in range(2))


SPACES = {
    borehole: Space(rw=(0.05, 0.15), length=(1120.0, 1680.0), conductivity=(9855.0, 12045.0)),
    reciprocal: Space(a=(0.1, 1.0), b=(0.1, 1.0), c=(0.1, 1.0)),
    rosenbrock: Space(a=(-2.0, 2.0), b=(-2.0, 2.0), c=(-2.0, 2.0)),
}


def composite_and_d_optimal(space, seed=0, total=50):
    """Central composite design with stars on the bounds, filled D-optimally from Sobol points.

    Each further point is the one that raises the determinant most, at least 0.2 coded units from all others.
    """
    k = len(space)
    cube = 2.0 * ((np.arange(2**k)[:, None] >> np.arange(k)) & 1) - 1.0
    points = np.vstack([cube / 1.6818, np.eye(k), -np.eye(k), np.zeros((1, k))])
    candidates = np.vstack([2 * qmc.Sobol(k, seed=seed).random(1024) - 1, cube])
    terms = full_terms(k, 2)
    while len(points) < total:
        far = np.abs(candidates[:, None] - points).max(axis=2).min(axis=1) > 0.2
        inverse = np.linalg.inv(terms.matrix(points).T @ terms.matrix(points))
        rows = terms.matrix(candidates)
        gain = np.where(far, np.einsum("ij,jk,ik->i", rows, inverse, rows), -1)
        points = np.vstack([points, candidates[gain.argmax()]])
    return space.decode(points)


def holdout(space, count=4096):
    """Fresh Sobol points in the box."""
    return space.decode(2 * qmc.Sobol(len(space), seed=99).random(count) - 1)
