"""Mixtures and linear equalities: the slice of the box, its bounds, its nearest and its even points."""

import numpy as np
import pytest
from scipy.optimize import minimize

from rsmkit.errors import RsmkitError
from rsmkit.language.equalities import Equality, Mixture
from rsmkit.language.space import Space

TWO = Space(a=(0, 1), b=(0, 2), c=(-1, 5), d=(0, 1), e=(3, 4)).limited(
    [Equality.of({"a": 1, "b": 2, "c": -1}, 1), Equality.of({"b": 1, "c": 1, "d": -3}, 0.5)]
)
THREE = Space(a=(0, 1), b=(0.2, 1), c=(0, 0.5)).mixture("a", "b", "c")


def test_a_space_without_equalities_is_as_it_was():
    plain = Space(a=(0, 1), b=(0, 1))
    assert hash(plain) == hash(plain.factors)
    assert plain == plain.limited([])
    assert plain != plain.mixture("a", "b")
    assert plain.affine is None


def test_words_of_a_mixture():
    assert repr(THREE) == "<Space: 3 factors (a 0 to 1; b 0.2 to 1; c 0 to 0.5; a + b + c == 1)>"
    assert Equality.of({"a": 1, "b": -2.5, "c": 0, "d": -1}, 3).text == "a - 2.5*b - d == 3"


def test_implied_bounds_by_hand():
    # a = 1 - b - c lies between 1 - 1 - 0.5 < 0 and 1 - 0.2; b between 1 - 1 - 0.5 < 0.2 and 1
    assert THREE.affine.low.tolist() == [0, 0.2, 0]
    assert THREE.affine.high.tolist() == [0.8, 1.0, 0.5]


def test_the_bounds_that_two_equalities_imply_together():
    # c = a + 2b - 1 and 3d = a + 3b - 1.5: b <= (1.5 + 3 - a)/3 and >= (1.5 - a)/3; c from 1/6 - 1/6 up
    assert TWO.affine.low == pytest.approx([0, 1 / 6, 0, 0, 3], abs=1e-12)
    assert TWO.affine.high == pytest.approx([1, 1.5, 7 / 3, 1, 4], abs=1e-12)


@pytest.mark.parametrize(
    "space", [THREE, TWO, Space(a=(0, 60), b=(10, 100), c=(0, 100)).mixture(*"abc", total=100)]
)
def test_the_nearest_point_is_nearest_and_keeps_everything(space):
    """A quadratic program solved by another program; it stops within 1e-6 of the optimum."""
    rng = np.random.default_rng(1)
    points = space.affine.inner + (space.highs - space.lows) * rng.normal(size=(300, len(space)))
    near = space.clip(points)
    assert (np.abs(space.affine.residuals(near)) <= 1e-15 * space.affine.size).all()
    assert ((near >= space.lows) & (near <= space.highs)).all()
    scale = space.affine.scales
    for point, found in zip(points[:8], near[:8], strict=True):
        other = minimize(
            lambda x, point=point: (((x - point) / scale) ** 2).sum(),
            space.affine.inner,
            bounds=list(zip(space.lows, space.highs, strict=True)),
            constraints={"type": "eq", "fun": space.affine.residuals},
            method="SLSQP",
            options={"ftol": 1e-15},
        )
        distance = (((found - point) / scale) ** 2).sum()
        assert distance <= other.fun + 1e-9 * (1 + other.fun)


def test_points_of_the_set_stay_where_they_are():
    points = np.array([[0.3, 0.2, 0.5], [0.8, 0.2, 0.0], [1 / 3, 1 / 3, 1 / 3]])
    assert (THREE.clip(points) == points).all()
    assert THREE.clip(points[0]).shape == (3,)


def test_even_points_have_the_means_of_the_set():
    """Means of the truncated simplex by rejection: 2e5 points, so 5 standard errors are some 0.003."""
    rng = np.random.default_rng(0)
    plane = rng.random((400_000, 2))
    points = np.column_stack([plane, 1 - plane.sum(axis=1)])
    kept = points[((points >= THREE.lows) & (points <= THREE.highs)).all(axis=1)]
    found = THREE.spread(rng.random((40_000, 3)))
    assert found.mean(axis=0) == pytest.approx(kept.mean(axis=0), abs=0.005)
    assert np.cov(found.T) == pytest.approx(np.cov(kept.T), abs=0.001)
    assert THREE.contains(found, 1e-15).all()


@pytest.mark.parametrize("q", [2, 6, 9])
def test_even_points_of_a_simplex_have_the_moments_of_dirichlet(q):
    """Mean 1/q and variance (q - 1)/(q^2 (q + 1)) of every component (Dirichlet with ones)."""
    names = [f"x{i}" for i in range(q)]
    space = Space(**dict.fromkeys(names, (0, 1))).mixture(*names)
    found = space.spread(np.random.default_rng(0).random((4000, q)))
    spread = np.sqrt((q - 1) / (q * q * (q + 1)))
    assert found.mean(axis=0) == pytest.approx(np.full(q, 1 / q), abs=5 * spread / np.sqrt(4000))
    assert found.std(axis=0) == pytest.approx(np.full(q, spread), rel=0.1)


def test_components_are_coded_as_pseudo_components():
    coded = THREE.encode([[0.8, 0.2, 0.0], [0.0, 1.0, 0.0], [0.1, 0.4, 0.5]])
    # (x - least)/(1 - 0.2)
    assert coded == pytest.approx(np.array([[1, 0, 0], [0, 1, 0], [0.125, 0.25, 0.625]]))
    assert THREE.decode(coded) == pytest.approx(np.array([[0.8, 0.2, 0], [0, 1, 0], [0.1, 0.4, 0.5]]))


def test_directions_keep_the_equalities():
    basis = TWO.affine.basis
    assert basis.shape == (5, 3)
    assert np.abs(TWO.affine.matrix @ basis).max() < 1e-14
    assert basis.T @ basis == pytest.approx(np.eye(3), abs=1e-14)


def test_dependents_are_solved_for():
    at = TWO.affine.inner
    dependents = TWO.affine.dependents(at)
    made = TWO.affine.completed(np.where(np.isin(range(5), dependents), 99.0, at), dependents)
    assert made == pytest.approx(at, abs=1e-12)


ABC = Space(a=(0.5, 1), b=(0.6, 1), c=(0, 1), n=[1, 2], cell=["L", "M"])


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (
            lambda: ABC.mixture("a", "b", "c"),
            "a >= 0.5 and b >= 0.6 leave nothing: their sum 1.1 is above the total 1",
        ),
        (lambda: ABC.mixture("a", "b", "c", total=4), "a <= 1 and b <= 1 and c <= 1 leave nothing"),
        (lambda: ABC.mixture("a", "b", total=1.1), "leave a the one value 0.5"),
        (lambda: ABC.mixture("a", "n", total=2), "n is discrete, and only continuous factors"),
        (lambda: ABC.mixture("a", "cell"), "cell is categorical"),
        (lambda: ABC.mixture("a", "d"), "d is no factor"),
        (lambda: ABC.mixture("a"), "at least two"),
        (lambda: ABC.mixture("a", "a"), "named twice"),
        (lambda: ABC.mixture("a", "c").mixture("b", "c"), "c is already a component"),
        (
            lambda: ABC.limited([Mixture(("a", "c")), Equality.of({"a": 2, "c": 2}, 2)]),
            "repeats or contradicts",
        ),
        (
            lambda: ABC.limited([Equality.of({"a": 1, "b": 1}, 1.9), Equality.of({"b": 1, "c": -1}, -0.3)]),
            "leave no point together",
        ),
    ],
)
def test_what_cannot_be_is_refused_in_words(make, words):
    with pytest.raises(RsmkitError, match=words):
        make()
