"""Designs on random mixtures: every point on the set, inside bounds and limits, corners really corners."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

import rsmkit as rk
from rsmkit.design.region import box
from rsmkit.geometry.polytope import Polytope
from rsmkit.geometry.simplices import simplices

shares = st.floats(0.0, 1.0)


@st.composite
def mixtures(draw):
    """A mixture around a blend that is allowed, bounds near and far, and a limit that the blend keeps."""
    q = draw(st.integers(2, 5))
    total = draw(st.sampled_from([1.0, 100.0, 0.37]))
    blend = np.array(draw(st.lists(st.floats(0.05, 1.0), min_size=q, max_size=q)))
    blend *= total / blend.sum()
    down, up = (np.array(draw(st.lists(shares, min_size=q, max_size=q))) for _ in range(2))
    lows = blend * (0.95 - 0.9 * down)
    highs = blend + (total - blend) * (0.05 + 0.9 * up)
    slopes = np.array(draw(st.lists(st.integers(-3, 3), min_size=q, max_size=q)), float)
    limit = slopes @ blend + draw(st.floats(0.01, 0.5)) * total
    names = "abcde"[:q]
    space = rk.Space(
        **{name: (float(low), float(high)) for name, low, high in zip(names, lows, highs, strict=True)}
    )
    return space.mixture(*names, total=total), lambda points: limit - points @ slopes


@settings(max_examples=10, deadline=None)
@given(mixtures())
def test_every_design_lies_on_the_mixture(drawn):
    space, limit = drawn
    total = space.mixtures[0].total
    region = box(space, 1.0, [limit])
    empty = rk.Design(space, np.empty((0, len(space))), ())
    for design in (
        rk.extreme_vertices(space, centroids="all", constraints=[limit]),
        rk.fill(empty, 6, region=region),
        rk.optimal_design(space, len(space) + 1, terms=1, region=region, starts=1),
    ):
        assert np.abs(design.points.sum(axis=1) - total).max() <= 1e-12 * total
        assert space.contains(design.points).all()
        assert (limit(design.points) >= -1e-8 * total).all()
    vertices = rk.extreme_vertices(space, centroids="none", constraints=[limit])
    assert vertices.distinct == len(vertices)


@settings(max_examples=25, deadline=None)
@given(mixtures())
def test_corners_are_extreme_and_hold_the_whole_region(drawn):
    space, limit = drawn
    (group,) = box(space, 1.0, [limit]).groups
    polytope: Polytope = group.polytope
    corners = polytope.corners
    assert polytope.contains(corners).all()
    ways = np.random.default_rng(0).normal(size=(20, polytope.k))
    inside = polytope.walked(200, 1, 30)
    assert (
        (ways @ inside.T).max(axis=1) <= (ways @ corners.T).max(axis=1) + 1e-7 * np.abs(ways).sum(axis=1)
    ).all()
    found = simplices(polytope)
    assert abs(found.volumes.sum() - 1.0) <= 1e-12
    centre = found.means(np.eye(polytope.k, dtype=int))
    assert polytope.contains(centre[None]).all()
