import numpy as np

from rsmkit.language.space import Factor, Space
from rsmkit.optimum.evaluation_cache import CachedEvaluator
from rsmkit.optimum.local.local_search import SIMULATOR, LocalSearch
from rsmkit.optimum.options import SearchOptions
from rsmkit.optimum.problem import build_problem
from rsmkit.optimum.search import search_problem

SPACE = Space(x=(0.0, 10.0), y=(-1.0, 1.0))


def bowl(points):
    return {"f": (points[:, 0] - 3) ** 2 + 5 * (points[:, 1] - 0.2) ** 2}


def test_no_point_is_run_twice():
    asked = []
    cached = CachedEvaluator(lambda p: asked.append(len(p)) or bowl(p), SPACE)
    points = np.array([[1.0, 0.0], [2.0, 0.0], [1.0, 0.0]])
    assert cached(points)["f"].tolist() == bowl(points)["f"].tolist()
    assert cached(points[::-1])["f"].tolist() == bowl(points[::-1])["f"].tolist()
    cached(np.array([[2.0, -0.0], [5.0, 0.5]]))
    assert asked == [2, 1]
    assert cached.runs == 3
    assert cached.batches == [2, 1]
    assert cached.history()[0].tolist() == [[1.0, 0.0], [2.0, 0.0], [5.0, 0.5]]


def test_waves_on_processors():
    cached = CachedEvaluator(bowl, SPACE)
    cached(np.random.default_rng(0).random((24, 2)))
    cached(np.full((1, 2), 0.5))
    assert cached.waves(16) == 3
    assert cached.waves(24) == 2


def test_a_search_on_the_simulator_spends_what_it_says():
    cached = CachedEvaluator(bowl, SPACE)
    problem = build_problem(SPACE, "f", cached, responses=["f"])
    optimum = search_problem(problem, SearchOptions("f", preset="fast"), SIMULATOR)
    np.testing.assert_allclose(optimum.point, [3.0, 0.2], atol=1e-3)
    assert 24 * 8 < cached.runs <= optimum.evaluations
    assert cached.batches[:8] == [24] * 8


def test_a_batched_and_a_pointwise_evaluator_give_the_same_search():
    def one_by_one(points):
        return {"f": np.array([bowl(point[None])["f"][0] for point in points])}

    results = [
        search_problem(
            build_problem(SPACE, "f", run, responses=["f"]), SearchOptions("f"), SIMULATOR
        ).to_json()
        for run in (bowl, one_by_one)
    ]
    assert results[0] == results[1]


def test_repeated_levels_cost_nothing():
    space = Space([Factor("n", 0, 9, integer=True)])
    cached = CachedEvaluator(lambda p: {"f": (p[:, 0] - 7) ** 2}, space)
    search_problem(build_problem(space, "f", cached, responses=["f"]), SearchOptions("f"), SIMULATOR)
    assert cached.runs <= 10


def test_every_kind_of_polish_ends_on_an_active_constraint():
    problem = build_problem(SPACE, "f", bowl, responses=["f"], subject_to=["x + y >= 4"])
    for local in (
        LocalSearch(starts=1),
        LocalSearch(starts=1, central=False, step=1e-6),
        LocalSearch(starts=1, method="cobyqa", tolerance=1e-6),
    ):
        optimum = search_problem(problem, SearchOptions("f", preset="fast"), local)
        np.testing.assert_allclose(optimum.point, [11 / 3, 1 / 3], atol=1e-4)
        assert optimum.best.margins[0] >= 0
