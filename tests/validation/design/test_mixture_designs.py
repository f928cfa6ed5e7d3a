"""Designs of mixtures against published ones and closed forms."""

from itertools import combinations
from math import comb

import numpy as np
import pytest

import rsmkit as rk
from rsmkit.design.optimal.encoding import encode_model, moments
from rsmkit.design.region import box
from rsmkit.language.equalities import Equality
from rsmkit.language.scheffe import scheffe_terms

ABC = rk.Space(a=(0, 1), b=(0, 1), c=(0, 1)).mixture("a", "b", "c")


def simplex(q, total=1.0):
    names = "abcdefgh"[:q]
    return rk.Space(**dict.fromkeys(names, (0, total))).mixture(*names, total=total)


def log_det(design, terms):
    X = terms.matrix(design.coded)
    return float(np.linalg.slogdet(X.T @ X)[1])


@pytest.mark.parametrize(("q", "degree"), [(2, 2), (3, 2), (3, 3), (4, 2), (4, 4), (8, 2)])
def test_a_lattice_has_the_number_of_blends_scheffe_counts(q, degree):
    """Scheffe (1958): C(q + m - 1, m) blends."""
    design = rk.simplex_lattice(simplex(q), degree=degree)
    assert len(design) == design.distinct == comb(q + degree - 1, degree)
    steps = design.points * degree
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-12)


@pytest.mark.parametrize("q", [2, 3, 4, 6])
def test_a_simplex_centroid_has_all_equal_blends(q):
    """Scheffe (1963): 2^q - 1 blends; each component is as much as any other that is there."""
    design = rk.simplex_centroid(simplex(q, 100.0))
    assert len(design) == design.distinct == 2**q - 1
    for point in design.points:
        np.testing.assert_allclose(point[point > 0], 100.0 / (point > 0).sum(), rtol=1e-15)


def test_axial_check_blends_are_half_way_to_the_corners():
    """Cornell (2002), section 2.13: ((q + 1)/2q, 1/2q, ...)."""
    design = rk.simplex_centroid(ABC, axial=True)
    axial = design.points[[kind == "axial" for kind in design.kinds]]
    np.testing.assert_allclose(axial, (np.ones((3, 3)) + 3 * np.eye(3)) / 6, rtol=1e-14)


def test_a_lattice_on_lower_bounds_is_one_of_pseudo_components():
    """Kurotori (1966), propellant: binder >= 0.2, oxidizer >= 0.4, fuel >= 0.2; x = low + 0.2 z."""
    space = rk.Space(binder=(0.2, 1), oxidizer=(0.4, 1), fuel=(0.2, 1)).mixture("binder", "oxidizer", "fuel")
    design = rk.simplex_centroid(space)
    expected = np.array([0.2, 0.4, 0.2]) + 0.2 * rk.simplex_centroid(ABC).points
    np.testing.assert_allclose(design.points, expected, rtol=1e-14)


@pytest.mark.parametrize(("q", "order"), [(3, 1), (3, 2), (4, 2), (5, 2)])
def test_the_saturated_d_optimal_design_is_the_lattice(q, order):
    """Kiefer (1961), Annals of Mathematical Statistics 32, 298-325: the {q, m} lattice for m = 1, 2."""
    space, terms = simplex(q), scheffe_terms(simplex(q), list("abcdefgh"[:q]), order)
    lattice = rk.simplex_lattice(space, degree=order)
    design = rk.optimal_design(space, len(lattice), terms=terms, starts=3)
    assert {tuple(point) for point in np.round(design.points, 9)} == {tuple(p) for p in lattice.points}


def test_the_d_optimal_design_of_the_special_cubic_is_the_simplex_centroid():
    """Uranisi (1964), Mathematical Reports of Kyushu University 1, 41-58."""
    terms = scheffe_terms(ABC, list("abc"), "special cubic")
    design = rk.optimal_design(ABC, 7, terms=terms, starts=3)
    np.testing.assert_allclose(
        sorted(design.points.tolist()), sorted(rk.simplex_centroid(ABC).points.tolist()), atol=1e-12
    )


def test_the_d_optimal_design_of_the_full_cubic_leaves_the_thirds():
    """Kiefer (1961): blends of two with shares (1 +- 1/sqrt(5))/2, the corners and the centroid."""
    terms = scheffe_terms(ABC, list("abc"), "cubic")
    share = 0.5 * (1.0 + 5.0**-0.5)
    edges = [np.eye(3)[i] * share + np.eye(3)[j] * (1 - share) for i in range(3) for j in range(3) if i != j]
    known = rk.Design(ABC, np.vstack([np.eye(3), edges, np.full((1, 3), 1 / 3)]), ("given",) * 10)
    design = rk.optimal_design(ABC, 10, terms=terms, starts=4)
    assert log_det(design, terms) >= log_det(known, terms) - 1e-5
    np.testing.assert_allclose(np.sort(design.points, axis=0), np.sort(known.points, axis=0), atol=2e-3)


def test_i_optimal_allocation_of_the_quadratic():
    """On corners and mid-points of edges the best weights have a closed form.

    Over these blends the average variance ``sum s_i / r_i`` is least for r_i proportional to sqrt(s_i).
    The design found, with other blends to choose from too, is not worse than the best on these.
    """
    runs, terms = 30, rk.space_terms(ABC)
    lattice = rk.simplex_lattice(ABC)
    F = np.linalg.inv(terms.matrix(lattice.coded))
    W = moments(encode_model(terms), box(ABC))
    sizes = np.diag(F.T @ W @ F)
    corner = [(sizes[0] / r + sizes[3] / (runs / 3 - r)) * 3.0 for r in range(1, runs // 3)]
    design = rk.optimal_design(ABC, runs, criterion="I", starts=3)
    assert design.found.value <= min(corner) * (1.0 + 1e-9)


@pytest.mark.parametrize("criterion", ["D", "A", "I", "G", "bayesian-D"])
def test_every_criterion_keeps_the_sum_the_bounds_and_the_limits(criterion):
    space = rk.Space(a=(10, 60), b=(0, 70), c=(5, 90), heat=(20, 80), tool=["x", "y"])
    space = space.mixture("a", "b", "c", total=100)
    limit = lambda points: 70.0 - points[:, 0] - 0.5 * points[:, 3]  # noqa: E731
    region = box(space, 1.0, [limit])
    design = rk.optimal_design(
        space,
        18,
        terms=scheffe_terms(space, list("abc"), "quadratic"),
        criterion=criterion,
        region=region,
        starts=1,
    )
    assert np.abs(design.points[:, :3].sum(axis=1) - 100.0).max() <= 1e-12 * 100.0
    assert space.contains(design.points, 1e-12).all()
    assert (limit(design.points) >= -1e-9).all()


def test_augmenting_keeps_given_runs_and_the_sum():
    given = rk.simplex_lattice(ABC)
    design = rk.augment(given, 12, min_distance=0.05, starts=2)
    np.testing.assert_array_equal(design.points[:6], given.points)
    assert design.distinct == 12
    assert np.abs(design.points.sum(axis=1) - 1.0).max() <= 1e-15


def test_an_equality_is_a_design_in_the_free_factors():
    """c = 2 a + b: as good as the triangle's own best design, whose determinant is that of the lattice."""
    space = rk.Space(a=(0, 1), b=(0, 1), c=(0, 1)).limited([Equality.of({"a": 2, "b": 1, "c": -1}, 0)])
    design = rk.optimal_design(space, 6, starts=3)
    assert np.abs(2 * design.points[:, 0] + design.points[:, 1] - design.points[:, 2]).max() <= 1e-15
    corners = np.array([[0, 0, 0], [0.5, 0, 1], [0, 1, 1]])
    middles = np.array([(p + q) / 2 for p, q in combinations(corners, 2)])
    np.testing.assert_allclose(
        sorted(np.round(design.points, 9).tolist()), sorted(np.vstack([corners, middles]).tolist()), atol=1e-9
    )


def test_quality_of_the_lattice_is_that_of_its_closed_form():
    """Each blend once: variance f'f of Lagrange's polynomials; 1 at the blends, VIF x_j'x_j (X'X)^-1_jj."""
    lattice = rk.simplex_lattice(ABC)
    quality = rk.assess(rk.simplex_lattice(ABC, repeats=2), deterministic=False)
    X = rk.space_terms(ABC).matrix(lattice.coded)
    assert quality.largest_variance == pytest.approx(0.5, rel=1e-9)
    assert quality.d_bound_efficiency == pytest.approx(100.0, abs=0.01)
    assert quality.g_efficiency == pytest.approx(100.0, rel=1e-9)
    vif = np.diag(np.linalg.inv(X.T @ X)) * (X**2).sum(axis=0)
    assert list(quality.vif.values()) == pytest.approx(vif.tolist(), rel=1e-9)
    assert quality.variance_profile["a"][0] == pytest.approx(0.5, rel=1e-9)
    assert quality.variance_profile["a"][-1] == pytest.approx(0.5, rel=1e-9)


def test_averages_over_the_region_are_exact():
    """Dirichlet means: E a^2 = 2/12, E a b = 1/12, E a^2 b^2 = 4/360, E a b c a = 2/360."""
    W = moments(encode_model(rk.space_terms(ABC)), box(ABC))
    expected = [[1 / 6, 1 / 12, 1 / 12], [1 / 12, 1 / 6, 1 / 12], [1 / 12, 1 / 12, 1 / 6]]
    np.testing.assert_allclose(W[:3, :3], expected, rtol=1e-12)
    np.testing.assert_allclose(W[3, 3], 4 / 360, rtol=1e-12)
    np.testing.assert_allclose(W[3, 4], 2 / 360, rtol=1e-12)


def test_the_moments_of_the_full_cubic_are_those_of_a_sample():
    terms = scheffe_terms(ABC, list("abc"), "cubic")
    rows = terms.matrix(box(ABC).sample(2**13, 0))
    W, sampled = moments(encode_model(terms), box(ABC)), rows.T @ rows / len(rows)
    errors = (rows[:, :, None] * rows[:, None, :]).std(axis=0) / np.sqrt(len(rows))
    assert (np.abs(W - sampled) <= 3.0 * errors + 1e-12).all()


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: rk.simplex_lattice(rk.Space(a=(0, 1), b=(0, 1))), "components = "),
        (lambda: rk.ccd(ABC), "cannot keep 'a \\+ b \\+ c == 1'"),
        (lambda: rk.latin_hypercube(ABC, 5), "take sobol or maximin"),
        (lambda: rk.simplex_lattice(rk.Space(a=(0, 0.6), b=(0, 1), c=(0, 1)).mixture(*"abc")), "4 corners"),
    ],
)
def test_what_cannot_be_is_refused_in_words(make, words):
    with pytest.raises(rk.RsmkitError, match=words):
        make()


def test_space_filling_blends_are_apart():
    """Six points of a triangle can be half a side apart: at least 85 % of that."""
    empty = rk.Design(ABC, np.empty((0, 3)), ())
    points = rk.fill(empty, 6).points
    gaps = [np.linalg.norm(p - q) for p, q in combinations(points, 2)]
    assert min(gaps) >= 0.85 * np.sqrt(2.0) / 2.0
