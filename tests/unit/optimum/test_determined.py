"""The last digits of an optimum do not depend on how its predictions are rounded."""

import numpy as np
import pytest

from rsmkit.language.space import Factor, Space
from rsmkit.optimum.local.determined import WORSE, centred, determined
from rsmkit.optimum.local.local_search import LocalSearch
from rsmkit.optimum.local.polish import polish
from rsmkit.optimum.options import SearchOptions
from rsmkit.optimum.problem import Archive, build_problem
from rsmkit.optimum.search import search_problem

SPACE = Space(x=(0.0, 10.0), y=(-1.0, 1.0))
ROUNDING = 1e-15
"""Some four units in the last place: more than other kernels of linear algebra change in a prediction."""


def valley(p):
    return (p[:, 0] - 3.1) ** 2 + 5 * (p[:, 1] - 0.2) ** 2 + 0.3 * p[:, 0] * p[:, 1] + 0.01 * np.exp(p[:, 0])


def rounded_otherwise(function, seed):
    """Response f with a relative error of its own at every evaluation; none for seed 0."""
    rng = np.random.default_rng(seed)

    def evaluate(points):
        error = ROUNDING * rng.uniform(-1.0, 1.0, len(points)) if seed else 0.0
        return {"f": function(points) * (1.0 + error)}

    return evaluate


def searched(function, seed, *subject_to, space=SPACE):
    problem = build_problem(
        space, "f", rounded_otherwise(function, seed), responses=["f"], subject_to=subject_to
    )
    return search_problem(problem, SearchOptions("f", preset="fast"))


CASES = {
    "interior": (valley, ()),
    "on a bound": (lambda p: valley(p) - 6 * p[:, 1], ()),
    "in a corner": (lambda p: -valley(p), ()),
    "on a line": (valley, ("x + y >= 5",)),
    "on a curve": (valley, ("x*x + 3*y*y <= 3",)),
    "in the corner of two constraints": (valley, ("x + y >= 4.5", "x - 2*y >= 5")),
    "beside an inactive constraint": (valley, ("x + y >= 1",)),
    "on a line that is given twice": (valley, ("x + y >= 5", "3*x + 3*y >= 15")),
    "in a corner of three constraints": (valley, ("x + y >= 4.5", "x - 2*y >= 4.5", "2*x - y >= 9")),
    "on a bound and a line": (lambda p: valley(p) - 6 * p[:, 1], ("x + y >= 5",)),
}


@pytest.mark.parametrize("case", CASES)
def test_rounding_changes_no_bit_of_an_optimum(case):
    function, subject_to = CASES[case]
    found = [searched(function, seed, *subject_to) for seed in range(4)]
    assert {optimum.point.tobytes() for optimum in found} == {found[0].point.tobytes()}
    assert min(found[0].best.margins, default=0.0) >= 0.0


def test_rounding_changes_no_bit_beside_a_constraint_on_a_response():
    def found(seed):
        rng = np.random.default_rng(seed)

        def evaluate(p):
            error = ROUNDING * rng.uniform(-1.0, 1.0, (2, len(p))) if seed else np.zeros((2, len(p)))
            return {"f": valley(p) * (1 + error[0]), "g": (p[:, 0] + 2) ** 2 * (p[:, 1] + 2) * (1 + error[1])}

        problem = build_problem(SPACE, "f", evaluate, responses=["f", "g"], subject_to=["g >= 75"])
        return search_problem(problem, SearchOptions("f", preset="fast"))

    first, *others = (found(seed) for seed in range(4))
    assert 0.0 <= first.best.margins[0] < 1e-9
    assert {optimum.point.tobytes() for optimum in others} == {first.point.tobytes()}


def test_rounding_does_not_choose_among_equal_optima():
    """Two mirrored valleys, levels that make no difference, a factor without influence."""
    space = Space(
        [
            Factor("x", -1.0, 1.0),
            Factor("tool", levels=("a", "b", "c")),
            Factor("turns", 1, 9, integer=True),
            Factor("idle", -1.0, 3.0),
        ]
    )

    def mirrored(p):
        return 2.0 + (p[:, 0] ** 2 - 0.3) ** 2 + (p[:, 1] == 0) * 1.0

    found = [searched(mirrored, seed, space=space) for seed in range(4)]
    assert {optimum.point.tobytes() for optimum in found} == {found[0].point.tobytes()}
    assert found[0].point[1:].tolist() == [1.0, 5.0, 1.0]


@pytest.mark.parametrize("case", CASES)
def test_the_last_digits_cost_nothing(case):
    """No worse than the search without them by more than 1e-12 of the objective, and feasible."""
    function, subject_to = CASES[case]
    problem = build_problem(
        SPACE, "f", rounded_otherwise(function, 0), responses=["f"], subject_to=subject_to
    )
    archive = Archive(problem)
    rng = np.random.default_rng(1)
    archive.evaluate(SPACE.lows + rng.random((50, 2)) * (SPACE.highs - SPACE.lows))
    rough = polish(archive, LocalSearch())
    spread = np.median(np.abs(archive.first.objectives[:, 0] - rough.objectives[0, 0]))
    size = max(abs(rough.objectives[0, 0]), spread)
    before = archive.count
    fine = determined(archive, rough)
    assert fine is not rough
    assert archive.count - before < 200
    assert fine.objectives[0, 0] <= rough.objectives[0, 0] + WORSE * size
    assert (fine.margins >= 0.0).all()


def test_an_edge_is_left_as_it_is():
    problem = build_problem(SPACE, "max(x - sqrt(11), 5*(sqrt(11) - x)) + y**2", lambda p: {}, responses=[])
    archive = Archive(problem)
    archive.evaluate(np.array([[1.0, 0.5], [8.0, -0.3]]))
    edge = archive.evaluate(np.array([[np.sqrt(11), 0.0]]))
    assert determined(archive, edge) is edge


def test_a_violated_best_is_left_as_it_is():
    problem = build_problem(SPACE, "x", lambda p: {}, responses=[], subject_to=["y >= 2"])
    archive = Archive(problem)
    nowhere = archive.evaluate(np.array([[1.0, 0.5]]))
    assert determined(archive, nowhere) is nowhere
    assert centred(archive, nowhere) is nowhere


def test_a_factor_that_matters_is_not_moved():
    problem = build_problem(SPACE, "1000 + (x - 3)**2", lambda p: {}, responses=[])
    archive = Archive(problem)
    archive.evaluate(np.array([[9.0, 0.5]]))
    best = archive.evaluate(np.array([[3.0, 0.123]]))
    assert centred(archive, best).points.tolist() == [[3.0, 0.0]]


def test_rounding_does_not_change_the_size_of_a_front():
    """Three corners of a triangle: many goals spread over the plane are attained at the same places."""
    corners = np.array([[1.0, -0.8], [9.0, -0.5], [4.0, 0.9]])

    def found(seed):
        rng = np.random.default_rng(seed)

        def evaluate(p):
            unit = (p[:, None] - corners) / [10.0, 2.0]
            distance = (unit**2).sum(axis=2) + 0.1 * np.abs(unit).sum(axis=2) ** 3
            error = ROUNDING * rng.uniform(-1.0, 1.0, distance.shape) if seed else 0.0
            return dict(zip("abc", (distance * (1.0 + error)).T, strict=True))

        problem = build_problem(SPACE, ["a", "b", "c"], evaluate, responses=["a", "b", "c"])
        return search_problem(problem, SearchOptions(["a", "b", "c"], preset="fast"))

    assert len({len(found(seed).front) for seed in range(4)}) == 1
