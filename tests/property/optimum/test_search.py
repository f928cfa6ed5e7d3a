import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from rsmkit.language.space import Space
from rsmkit.optimum.options import SearchOptions
from rsmkit.optimum.pareto_front import nondominated
from rsmkit.optimum.problem import build_problem
from rsmkit.optimum.search import search_problem

BOX = Space(a=(-1.0, 1.0), b=(-1.0, 1.0), c=(-1.0, 1.0))
GRID = np.stack(np.meshgrid(*[np.linspace(-1, 1, 21)] * 3), -1).reshape(-1, 3)


@settings(max_examples=15)
@given(st.integers(0, 10**6))
def test_no_grid_point_beats_the_search_on_a_random_quadratic(seed):
    rng = np.random.default_rng(seed)
    matrix, vector = rng.normal(size=(3, 3)), rng.normal(size=3)

    def quadratic(p):
        return {"f": p @ vector + np.einsum("ni,ij,nj->n", p, matrix, p)}

    problem = build_problem(BOX, "f", quadratic, responses=["f"])
    optimum = search_problem(problem, SearchOptions("f", preset="fast"))
    assert BOX.contains(optimum.point, tolerance=0.0)
    assert optimum.best.objectives[0] <= quadratic(GRID)["f"].min() + 1e-9


@settings(max_examples=60)
@given(st.integers(0, 10**6), st.integers(1, 4), st.integers(1, 40))
def test_nondominated_against_all_pairs(seed, m, n):
    values = np.random.default_rng(seed).integers(0, 6, size=(n, m)).astype(float)
    expected = []
    for i, row in enumerate(values):
        dominated = ((values <= row).all(axis=1) & (values < row).any(axis=1)).any()
        if not dominated and not (values[:i] == row).all(axis=1).any():
            expected.append(i)
    assert nondominated(values).tolist() == expected
