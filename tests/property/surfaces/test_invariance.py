"""What must hold for any data: units do not matter, least squares is linear, damaged files are refused."""

import copy
import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rsmkit.errors import RsmkitError
from rsmkit.language.space import Space
from rsmkit.language.terms import full_terms
from rsmkit.surfaces.estimation.fit_data import checked_data
from rsmkit.surfaces.fitted_response import surface_from_json
from rsmkit.surfaces.models.polynomial import fit_polynomial
from rsmkit.surfaces.statistics.optima.ridge import ridge_path

RNG = np.random.default_rng(0)
CODED = RNG.uniform(-1, 1, (15, 2))
FRESH = RNG.uniform(-1.5, 1.5, (10, 2))
TERMS = full_terms(2, 2)

seeds = st.integers(0, 2**32 - 1)
centers = st.floats(-1e4, 1e4)
sizes = st.floats(1e-3, 1e3)


def fitted(y, low=(-1.0, -1.0), high=(1.0, 1.0)):
    space = Space(a=(low[0], high[0]), b=(low[1], high[1]))
    return fit_polynomial(space, "y", checked_data(space, space.decode(CODED), y), TERMS)


def response(seed):
    return np.random.default_rng(seed).normal(size=15)


@given(seeds, centers, sizes, centers, sizes)
@settings(max_examples=40)
def test_results_do_not_depend_on_the_units_of_the_factors(seed, c1, h1, c2, h2):
    y = response(seed)
    here, there = fitted(y), fitted(y, (c1 - h1, c2 - h2), (c1 + h1, c2 + h2))
    tolerance = 1e-12 * max(1, abs(c1) / h1, abs(c2) / h2)
    np.testing.assert_allclose(there.coefficients, here.coefficients, rtol=1e-6, atol=100 * tolerance)
    ours, theirs = (s.predict(s.space.decode(FRESH), interval=0.9) for s in (here, there))
    for one, other in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-6, atol=1e4 * tolerance)


@given(seeds, seeds, st.floats(-10, 10), st.floats(-10, 10))
@settings(max_examples=40)
def test_surface_of_a_weighted_sum_is_the_weighted_sum_of_surfaces(one, two, a, b):
    y1, y2 = response(one), response(two)
    whole = fitted(a * y1 + b * y2)
    np.testing.assert_allclose(
        whole.coefficients, a * fitted(y1).coefficients + b * fitted(y2).coefficients, rtol=1e-9, atol=1e-9
    )


@given(seeds, st.lists(st.floats(0.05, 4), min_size=1, max_size=4))
@settings(max_examples=40)
def test_ridge_points_lie_on_their_sphere_and_beat_random_points_of_it(seed, radii):
    surface = fitted(response(seed))
    path = ridge_path(surface, radii)
    np.testing.assert_allclose(np.linalg.norm(path.coded, axis=1), radii, rtol=1e-9)
    angle = np.linspace(0, 2 * np.pi, 60)
    for radius, best in zip(radii, path.predicted, strict=True):
        circle = radius * np.column_stack([np.cos(angle), np.sin(angle)])
        assert best >= surface.predict(circle).max() - 1e-9 * max(1, radius**2)


@given(st.data())
@settings(max_examples=150)
def test_a_damaged_model_is_refused_or_still_predicts(data):
    document = copy.deepcopy(DOCUMENT)
    place = document
    while True:
        key = data.draw(st.sampled_from(list(place) if isinstance(place, dict) else range(len(place))))
        if isinstance(place[key], dict | list) and place[key] and data.draw(st.booleans()):
            place = place[key]
            continue
        break
    junk = st.one_of(
        st.none(), st.booleans(), st.text(max_size=3), st.floats(), st.integers(), st.just([]), st.just({})
    )
    place[key] = data.draw(junk)
    try:
        surface = surface_from_json(document)
    except RsmkitError:
        return
    assert np.isfinite(surface.predict(FRESH)).all()


DOCUMENT = json.loads(json.dumps(fitted(response(1)).to_json()))


def test_deeply_nested_values_are_refused():
    nested = []
    for _ in range(500):
        nested = [nested]
    with pytest.raises(RsmkitError):
        surface_from_json({**DOCUMENT, "coefficients": nested})
