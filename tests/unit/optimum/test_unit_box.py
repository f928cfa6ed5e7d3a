import numpy as np

from rsmkit.language.space import Factor, Space
from rsmkit.optimum.unit_box import continuous, from_unit, to_unit

SPACE = Space(
    [
        Factor("x", 2.0, 5.0),
        Factor("n", 1, 4, integer=True),
        Factor("d", levels=(1.0, 10.0, 30.0)),
        Factor("c", levels=("steel", "brass")),
    ]
)


def test_ends_are_exact():
    assert from_unit(SPACE, [[0, 0, 0, 0], [1, 1, 1, 1]]).tolist() == [[2, 1, 1, 0], [5, 4, 30, 1]]


def test_levels_share_the_unit_interval_equally():
    unit = np.repeat(np.linspace(0.0, 1.0, 1200, endpoint=False)[:, None], 4, axis=1)
    natural = from_unit(SPACE, unit)
    assert [np.unique(natural[:, j], return_counts=True)[1].tolist() for j in (1, 2, 3)] == [
        [300] * 4,
        [400] * 3,
        [600] * 2,
    ]


def test_to_unit_comes_back_to_the_same_point():
    points = np.array([[2.5, 1, 10.0, 1], [5.0, 4, 30.0, 0]])
    np.testing.assert_allclose(from_unit(SPACE, to_unit(SPACE, points)), points, rtol=1e-15)


def test_only_plain_factors_are_continuous():
    assert continuous(SPACE).tolist() == [True, False, False, False]
