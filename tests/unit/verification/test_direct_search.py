import json

import numpy as np
import pytest

from rsmkit.language.space import Space
from rsmkit.optimum.options import SearchOptions
from rsmkit.optimum.pareto_front import nondominated
from rsmkit.optimum.problem import build_problem
from rsmkit.verification.direct_search import (
    compare_points,
    runs_to_reach,
    search_directly,
    summarise_runs,
    wilson_interval,
)

SPACE = Space(x=(0.0, 10.0), y=(-1.0, 1.0))


def test_table_8_of_the_paper():
    # Unrounded surrogate values that reproduce its printed percentages with the direct search as denominator.
    degrees = np.pi / 180
    space = Space(thetac1=(5 * degrees, 10 * degrees), thetac2=(10 * degrees, 15 * degrees), Rn=(0.15, 0.3))
    direct = np.array([0.155727, 0.191795, 0.20638])
    surrogate = np.array([0.159621, 0.187894, 0.208459])
    rows = compare_points(space, direct, surrogate)
    assert [row.factor for row in rows] == ["thetac1", "thetac2", "Rn"]
    np.testing.assert_allclose([row.difference_pct for row in rows], [2.5003, 2.0337, 1.0075], atol=5e-4)
    np.testing.assert_allclose([row.range_pct for row in rows], [4.46, 4.47, 1.39], atol=5e-3)


def test_table_7_of_the_paper_is_no_pareto_set():
    rows = np.array(
        [
            [4603151831824.87, 5561613281.09753, 10317123753.6537],
            [5165120394485.97, 5674185057.20986, 10411760398.0818],
            [5809687701099.58, 5837682372.12098, 10816653212.4112],
            [4962295734064.01, 5878443378.83571, 10997703260.1690],
        ]
    )
    pairs = {(i + 1, j + 1) for i in range(4) for j in range(4) if i != j and (rows[i] <= rows[j]).all()}
    assert pairs == {(1, 2), (1, 3), (1, 4), (2, 3)}
    assert nondominated(rows).tolist() == [0]


@pytest.fixture(scope="module")
def searches():
    problem = build_problem(
        SPACE,
        "f",
        lambda p: {"f": (p[:, 0] - 3) ** 2 + 5 * (p[:, 1] - 0.2) ** 2},
        responses=["f"],
        subject_to=["x <= 2"],
    )
    return search_directly(problem, SearchOptions("f", preset="fast"), [1, 2])


def test_direct_searches_pay_for_all_their_runs(searches):
    assert [s.seed for s in searches] == [1, 2]
    for found in searches:
        assert found.runs == len(found.objectives) == sum(found.batches) > 192
        assert found.optimum.best.objectives[0] == pytest.approx(1.0, abs=1e-3)
        # Infeasible runs never count as a success.
        assert np.isinf(found.objectives).any()
        assert found.objectives.min() >= 1.0 - 1e-9
        assert found.waves(16) >= 2 * 8
        json.dumps(found.overview(), allow_nan=False)
    assert searches[0].runs != searches[1].runs or not np.array_equal(
        searches[0].objectives, searches[1].objectives
    )


def test_runs_to_reach():
    assert runs_to_reach(np.array([5.0, 3.0, 4.0, 1.0]), 3.5) == 2
    assert runs_to_reach(np.array([5.0, 3.0]), 1.0) is None


def test_ten_of_ten_proves_only_72_percent():
    low, high = wilson_interval(10, 10)
    assert low == pytest.approx(0.7225, abs=5e-5)
    assert high == pytest.approx(1.0)
    # Newcombe, Statistics in Medicine 17, 1998, table I: 81 of 263 gives 0.2553 to 0.3662.
    assert wilson_interval(81, 263) == pytest.approx((0.2553, 0.3662), abs=5e-5)


def test_summary_over_seeds():
    found = summarise_runs({1: 50, 2: 60, 3: None, 4: 70})
    assert (found["seeds"], found["successes"], found["median"]) == (4, 3, 60.0)
    assert summarise_runs({1: None})["median"] is None
