"""Searches and refinements on the slice that equalities leave: against brute force, and never off it."""

import numpy as np
import pytest

from rsmkit.errors import RsmkitError
from rsmkit.language.space import Space
from rsmkit.optimum.feasible import feasible_region
from rsmkit.optimum.options import Noise, RobustOptions, SearchOptions
from rsmkit.optimum.problem import build_problem
from rsmkit.optimum.search import search_problem
from rsmkit.optimum.service.robust import robust_problem
from rsmkit.verification.options import RefineOptions
from rsmkit.verification.refinement.waves import refine_problem

pytestmark = pytest.mark.slow
NAMES = ("a", "b", "c", "d")


def blends(total):
    ranges = dict.fromkeys(NAMES, (0, 0.7 * total)) | {"z": (10, 20)}
    return Space(**ranges).mixture(*NAMES, total=total)


def watched(space, function, off):
    """An evaluator that notes how far any point lies off the equalities, in sizes of these."""

    def evaluator(points):
        off.append(float(np.abs(space.affine.residuals(points) / space.affine.size).max()))
        unit = (points - space.lows) / (space.highs - space.lows)
        return {"y": function(unit), "g": unit[:, 0] + unit[:, 4] ** 2}

    return evaluator


def brute(problem, count=20_000, basins=10):
    """The least of even points of the set, then of ever nearer ones around some of the best."""
    rng, space = np.random.default_rng(0), problem.space
    ranges = space.highs - space.lows

    def values(points):
        found = problem.evaluate(points)
        return np.where((found.margins >= 0).all(axis=1), found.objectives[:, 0], np.inf)

    points = space.spread(rng.random((count, len(space))))
    first = values(points)
    ways_down = points[np.argsort(first)[::50][:basins]]
    lowest = values(ways_down)
    for reach in 0.1 * 0.6 ** np.arange(22):
        if reach < 0.005:  # by now it is known which way leads lowest
            ways_down, lowest = ways_down[[lowest.argmin()]], lowest[[lowest.argmin()]]
        steps = reach * ranges * rng.normal(size=(len(ways_down), 1500, len(space)))
        for i, way in enumerate(ways_down):
            near = space.clip(way + steps[i])
            found = values(near)
            if found.min() < lowest[i]:
                ways_down[i], lowest[i] = near[found.argmin()], found.min()
    return float(lowest.min())


@pytest.mark.parametrize(
    ("total", "subject_to"), [(100.0, []), (1.0, ["g <= 0.3"]), (100.0, ["a + 2*b == 0.9*{total}"])]
)
def test_the_optimum_of_a_saddle_is_that_of_brute_force(total, subject_to):
    rng, off = np.random.default_rng(3), []
    curves, slopes = rng.normal(size=(5, 5)), rng.normal(size=5)
    space = blends(total)
    evaluator = watched(space, lambda u: ((u @ curves) * u).sum(axis=1) + u @ slopes, off)
    texts = [text.format(total=total) for text in subject_to]
    problem = build_problem(space, "y", evaluator, responses=["y", "g"], subject_to=texts)
    found = search_problem(problem, SearchOptions(minimize="y", subject_to=tuple(texts)))
    truth = brute(problem)  # ends within 0.1 * 0.6^21 = 2e-6 of a range, and slopes are of order 10
    assert found.best.objectives[0] <= truth + 1e-9
    assert found.best.objectives[0] == pytest.approx(truth, abs=1e-4)
    assert max(off) <= 1e-15
    assert problem.space.contains(found.best.point, 1e-15)
    assert found.subject_to[-1] == problem.space.equalities[-1].text


def test_a_front_keeps_to_the_mixture():
    """c and d are at most 0.3, so a + b is at least 0.4, which a front of a and b cannot beat."""
    space, off = Space(a=(0, 1), b=(0, 1), c=(0, 0.3), d=(0, 0.3), z=(10, 20)).mixture(*NAMES), []
    evaluator = watched(space, lambda u: u[:, 0] + u[:, 4], off)
    problem = build_problem(space, ["y", "b + (z - 10)/10"], evaluator, responses=["y", "g"])
    found = search_problem(problem, SearchOptions(minimize=("y", "b + (z - 10)/10")))
    values = np.array([candidate.objectives for candidate in found.front])
    assert (values.sum(axis=1) >= 0.4 - 1e-12).all()
    for end in ([0.0, 0.4], [0.4, 0.0]):
        assert (
            np.abs(values - end).max(axis=1).min() <= 0.005
        )  # one objective alone leaves the other undetermined
    assert max(off) <= 1e-15
    assert all(space.contains(candidate.point, 1e-15) for candidate in found.front)


def test_refinement_finds_the_optimum_of_a_simulator_on_the_mixture():
    space, off = Space(**dict.fromkeys("abc", (0, 70))).mixture(*"abc", total=100), []
    weights, place = np.array([2.0, 4.0, 1.0]), np.array([0.2, 0.6, 0.3])

    def evaluator(points):
        off.append(float(np.abs(points.sum(axis=1) - 100.0).max()))
        return {"y": ((points / 70 - place) ** 2 * weights).sum(axis=1)}

    problem = build_problem(space, "y", evaluator, responses=["y"])
    start = problem.evaluate(space.spread(np.random.default_rng(0).random((8, 3))))
    found = refine_problem(problem, start, RefineOptions(batch=2, max_runs=8))
    # least of sum w (u - p)^2 with 70 sum u = 100: u = p + t/w, t = (10/7 - 1.1)/1.75, the least 1.75 t^2
    assert found.best.objectives[0, 0] == pytest.approx((10 / 7 - 1.1) ** 2 / 1.75, abs=1e-4)
    assert max(off) <= 1e-13
    assert all(space.contains(wave.points, 1e-15).all() for wave in found.waves)


def test_the_feasible_share_is_that_of_the_simplex():
    """a <= 1/2 leaves 1 - (1/2)^2 of the triangle."""
    space = Space(a=(0, 1), b=(0, 1), c=(0, 1)).mixture("a", "b", "c")
    problem = build_problem(space, "a", lambda x: {}, responses=[], subject_to=["a <= 0.5"])
    assert feasible_region(problem).share == pytest.approx(0.75, abs=0.01)


def test_noise_may_not_break_a_sum():
    space = blends(1.0)
    problem = build_problem(space, "a", lambda x: {}, responses=[])
    options = RobustOptions(noise={"a": Noise(mean=0.3, spread=0.01)})
    with pytest.raises(RsmkitError, match="a takes part in"):
        robust_problem(problem, options)
