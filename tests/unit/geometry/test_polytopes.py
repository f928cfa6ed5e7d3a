"""Corners, faces and volumes of polytopes, against published designs, counts by hand and another program."""

from math import factorial, prod

import numpy as np
import pytest

from rsmkit.errors import RsmkitError
from rsmkit.geometry.faces import centroids, edges, faces
from rsmkit.geometry.polytope import Polytope
from rsmkit.geometry.simplices import simplices
from rsmkit.geometry.tied_groups import groups_of


def mixture(lows, highs, normals=(), offsets=(), total=1.0):
    k = len(lows)
    return Polytope(
        np.array(lows, float),
        np.array(highs, float),
        np.array(normals, float).reshape(-1, k),
        np.array(offsets, float),
        np.ones((1, k)),
        np.array([total]),
    )


def same_points(found, expected):
    found, expected = (sorted(map(tuple, np.round(x, 9) + 0.0)) for x in (found, np.asarray(expected, float)))
    assert found == expected


FLARE = mixture([0.4, 0.1, 0.1, 0.03], [0.6, 0.5, 0.5, 0.08])
"""McLean & Anderson (1966), Technometrics 8(3), 447-454: magnesium, two nitrates, binder."""


def test_the_flare_has_the_published_vertices_and_centroids():
    vertices = [
        [0.40, 0.10, 0.47, 0.03], [0.40, 0.10, 0.42, 0.08],
        [0.60, 0.10, 0.27, 0.03], [0.60, 0.10, 0.22, 0.08],
        [0.40, 0.47, 0.10, 0.03], [0.40, 0.42, 0.10, 0.08],
        [0.60, 0.27, 0.10, 0.03], [0.60, 0.22, 0.10, 0.08],
    ]  # fmt: skip
    of_faces = [
        [0.50, 0.1000, 0.3450, 0.055], [0.50, 0.3450, 0.1000, 0.055], [0.40, 0.2725, 0.2725, 0.055],
        [0.60, 0.1725, 0.1725, 0.055], [0.50, 0.2350, 0.2350, 0.030], [0.50, 0.2100, 0.2100, 0.080],
    ]  # fmt: skip
    same_points(FLARE.corners, vertices)
    same_points(centroids(FLARE, 2), of_faces)
    same_points(centroids(FLARE, 3), [[0.5, 0.2225, 0.2225, 0.055]])
    assert np.abs(FLARE.corners.sum(axis=1) - 1.0).max() <= 4e-16


def test_corners_are_numbers_of_few_digits():
    assert {repr(float(x)) for x in FLARE.corners.ravel()} <= {
        "0.4", "0.6", "0.1", "0.47", "0.42", "0.27", "0.22", "0.03", "0.08"
    }  # fmt: skip


BOTH_SUMS = [[1, 1, 0, 0], [-1, -1, 0, 0], [0, 1, -1, 0], [0, -1, 1, 0]]
MIXEXP = [
    # R, mixexp 1.2.7.1: table(Xvert(...)[, "dimen"]) for dimensions 0, 1 and 2. It lists some corners where
    # more limits meet than must as edges or planes too (56, 29 edges, 47 planes); those are left out here.
    ([0.4, 0.1, 0.1, 0.03], [0.6, 0.5, 0.5, 0.08], (), (), (8, 12, 6)),
    ([0, 0, 0.15, 0.1, 0.35], [0.1, 0.1, 0.4, 0.4, 0.6], (), (), (23, 48, 35)),
    ([0.3, 0.1, 0.1, 0.0], [0.6, 0.5, 0.4, 0.3], (), (), (12, 18, 8)),
    ([0.1, 0.1, 0.1, 0.05], [0.5, 0.6, 0.4, 0.3], BOTH_SUMS, [0.8, -0.4, 0.3, 0.1], (16, 25, 11)),
]


@pytest.mark.parametrize(("lows", "highs", "normals", "offsets", "counts"), MIXEXP)
def test_counts_of_another_program(lows, highs, normals, offsets, counts):
    polytope = mixture(lows, highs, normals, offsets)
    assert tuple(len(found) for found in faces(polytope)[:3]) == counts


def test_corners_under_linear_limits_of_another_program():
    """mixexp's Xvert, six digits: 0.4 <= a + b <= 0.8 and -0.1 <= b - c <= 0.3 beside bounds."""
    expected = [
        [0.50, 0.100, 0.100, 0.30], [0.10, 0.450, 0.400, 0.05], [0.50, 0.300, 0.100, 0.10],
        [0.50, 0.300, 0.150, 0.05], [0.10, 0.575, 0.275, 0.05], [0.20, 0.400, 0.100, 0.30],
        [0.10, 0.450, 0.150, 0.30], [0.40, 0.400, 0.100, 0.10], [0.35, 0.450, 0.150, 0.05],
        [0.10, 0.300, 0.400, 0.20], [0.10, 0.300, 0.300, 0.30], [0.50, 0.100, 0.200, 0.20],
        [0.50, 0.175, 0.275, 0.05], [0.25, 0.300, 0.400, 0.05], [0.40, 0.100, 0.200, 0.30],
        [0.20, 0.200, 0.300, 0.30],
    ]  # fmt: skip
    same_points(mixture(*MIXEXP[3][:4]).corners, expected)


@pytest.mark.parametrize("q", [2, 3, 5, 8])
def test_a_whole_simplex(q):
    polytope = mixture([0.0] * q, [1.0] * q)
    same_points(polytope.corners, np.eye(q))
    binomials = [factorial(q) // factorial(i) // factorial(q - i) for i in range(1, q + 1)]
    assert [len(found) for found in faces(polytope)] == binomials
    assert len(edges(polytope)) == q * (q - 1) // 2
    powers = np.array([[1] + [0] * (q - 1), [2, 1] + [0] * (q - 2), [2, 2] + [0] * (q - 2)])
    dirichlet = [
        prod(factorial(int(a)) for a in row) * factorial(q - 1) / factorial(q - 1 + int(row.sum()))
        for row in powers
    ]
    np.testing.assert_allclose(simplices(polytope).means(powers), dirichlet, rtol=1e-12)


@pytest.mark.parametrize("q", [4, 6, 8])
def test_faces_obey_euler(q):
    """Vertices less edges plus faces ...: one for every polytope, the whole counted (Euler, Poincare)."""
    polytope = mixture([0.02] * q, [2.5 / q - 0.01] * q)
    counts = [len(found) for found in faces(polytope)]
    assert sum((-1) ** d * count for d, count in enumerate(counts)) == 1
    assert counts[1] == len(polytope.edges)


def test_limits_of_any_kind_cut():
    """By hand: a + b <= 30 and a >= 2 b leave the triangle (0, 0), (30, 0), (20, 10)."""
    polytope = mixture([0] * 3, [100] * 3, [[1, 1, 0], [-1, 2, 0]], [30, 0], total=100.0)
    same_points(polytope.corners, [[0, 0, 100], [30, 0, 70], [20, 10, 70]])
    np.testing.assert_allclose(
        simplices(polytope).means(np.eye(3, dtype=int)), [50 / 3, 10 / 3, 80], rtol=1e-12
    )


def test_an_equality_that_is_no_mixture():
    """By hand: c = 2 a + b <= 1 in the unit square of a and b."""
    polytope = Polytope(
        np.zeros(3), np.ones(3), np.empty((0, 3)), np.empty(0), np.array([[2.0, 1.0, -1.0]]), np.zeros(1)
    )
    same_points(polytope.corners, [[0, 0, 0], [0.5, 0, 1], [0, 1, 1]])


def test_corners_where_more_limits_meet_than_must_are_one():
    """A pyramid on a square, four sides through one apex: five corners, eight edges."""
    sides = [[1, 0, 1], [-1, 0, 1], [0, 1, 1], [0, -1, 1]]
    polytope = Polytope(
        np.array([-1.0, -1.0, 0.0]),
        np.ones(3),
        np.array(sides, float),
        np.ones(4),
        np.empty((0, 3)),
        np.empty(0),
    )
    same_points(polytope.corners, [[0, 0, 1], *([x, y, 0] for x in (-1, 1) for y in (-1, 1))])
    assert [len(found) for found in faces(polytope)] == [5, 8, 5, 1]
    np.testing.assert_allclose(simplices(polytope).means(np.array([[0, 0, 1]])), 0.25, rtol=1e-12)


@pytest.mark.parametrize(
    ("lows", "highs", "dimension", "corners"),
    [
        ([0.2, 0.3, 0.5], [0.5, 0.6, 0.9], 0, [[0.2, 0.3, 0.5]]),  # the lows add up to one
        ([0.2, 0.3, 0.4], [0.2, 0.6, 0.9], 1, [[0.2, 0.3, 0.5], [0.2, 0.4, 0.4]]),  # the first is fixed
        ([0.3, 0.2], [0.5, 0.9], 1, [[0.3, 0.7], [0.5, 0.5]]),
    ],
)
def test_flat_and_single_regions(lows, highs, dimension, corners):
    polytope = mixture(lows, highs)
    assert polytope.dimension == dimension
    same_points(polytope.corners, corners)
    assert simplices(polytope).volumes.sum() == pytest.approx(1.0)


def test_an_empty_region_names_what_cannot_hold():
    polytope = Polytope(
        np.array([0.5, 0.3, 0.3, 0.0]),
        np.ones(4),
        np.array([[0.0, 0.0, 0.0, 1.0]]),
        np.array([0.5]),
        np.array([[1.0, 1.0, 1.0, 0.0]]),
        np.ones(1),
        ["a", "b", "c", "t", "t <= 0.5", "a + b + c == 1"],
    )
    with pytest.raises(
        RsmkitError, match=r"the bounds of a, the bounds of b, the bounds of c and a \+ b \+ c == 1"
    ):
        assert polytope.corners is None


def test_points_are_spread_evenly():
    """The means of the sample are those of the triangle, within five standard errors."""
    polytope = mixture([0.1, 0.0, 0.0], [0.7, 0.6, 0.9])
    found = simplices(polytope)
    points = found.points(np.random.default_rng(1).random((4000, 3)))
    assert polytope.contains(points).all()
    powers = np.array([[1, 0, 0], [0, 1, 0], [2, 0, 0], [1, 1, 0]])
    values = np.stack([np.prod(points**row, axis=1) for row in powers])
    errors = values.std(axis=1) / np.sqrt(len(points))
    assert (np.abs(values.mean(axis=1) - found.means(powers)) <= 5.0 * errors).all()
    walked = polytope.walked(2000, 3, 40)
    assert polytope.contains(walked).all()
    assert np.abs(walked.mean(axis=0) - found.means(np.eye(3, dtype=int))).max() <= 5.0 * walked.std() / 44.0


def test_coordinates_that_nothing_ties_are_groups_of_their_own():
    whole = Polytope(
        np.zeros(5), np.ones(5), np.array([[0.0, 0, 0, 1, 1]]), np.array([1.2]),
        np.array([[1.0, 1, 0, 0, 0]]), np.ones(1),
    )  # fmt: skip
    found = groups_of(whole, np.arange(5))
    assert [group.columns.tolist() for group in found] == [[0, 1], [2], [3, 4]]
    assert [len(group.corners) for group in found] == [2, 2, 5]
