"""NSGA-II on fronts with a known hypervolume; serial against parallel."""

import numpy as np
import pytest
from joblib import Parallel, delayed

from rsmkit.language.space import Space
from rsmkit.optimum.options import SearchOptions
from rsmkit.optimum.pareto_front import hypervolume, igd_plus
from rsmkit.optimum.problem import build_problem
from rsmkit.optimum.search import search_problem

SPACE = Space(a=(0.0, 1.0), b=(0.0, 1.0), c=(0.0, 1.0))
NAMES = ("f", "g", "h")


def sphere(points):
    """DTLZ2 of Deb, Thiele, Laumanns and Zitzler (2002): the front is an octant of the unit sphere."""
    a, b = 0.5 * np.pi * points[:, :2].T
    radius = 1 + (points[:, 2] - 0.5) ** 2
    return dict(
        zip(
            NAMES,
            (radius * np.cos(a) * np.cos(b), radius * np.cos(a) * np.sin(b), radius * np.sin(a)),
            strict=True,
        )
    )


def archive(evaluator, **options):
    problem = build_problem(SPACE, NAMES, evaluator, responses=NAMES)
    return search_problem(problem, SearchOptions(NAMES, **options))


def test_archive_reaches_97_percent_of_the_hypervolume_of_a_dense_front():
    front = np.array([c.objectives for c in archive(sphere).front])
    dense = np.abs(np.random.default_rng(0).normal(size=(2000, 3)))
    dense /= np.linalg.norm(dense, axis=1, keepdims=True)
    ideal, nadir = np.zeros(3), np.ones(3)
    volume = hypervolume(front, ideal, nadir)
    assert volume >= 0.97 * hypervolume(dense, ideal, nadir)
    # Below the reference point 1.1 the whole octant leaves 1.1**3 - pi/6.
    assert 0.95 * (1.1**3 - np.pi / 6) <= volume < 1.1**3 - np.pi / 6
    assert (np.linalg.norm(front, axis=1) >= 1 - 1e-12).all()
    assert igd_plus(front, dense) < 0.02


def one(point):
    return {name: float(column[0]) for name, column in sphere(point[None]).items()}


def parallel(points):
    rows = Parallel(n_jobs=2)(delayed(one)(point) for point in points)
    return {name: np.array([row[name] for row in rows]) for name in NAMES}


@pytest.mark.slow
def test_serial_and_parallel_searches_are_identical():
    serial = archive(sphere, preset="fast", polish=False)
    assert archive(parallel, preset="fast", polish=False).to_json() == serial.to_json()
    assert serial.evaluations == 24 * 8
