"""Which stretch is found does not depend on how the criterion is rounded."""

import numpy as np
import pytest

from rsmkit.language.space import Space
from rsmkit.language.terms import full_terms
from rsmkit.surfaces.estimation.fit_data import checked_data
from rsmkit.surfaces.estimation.stretch import theta_of
from rsmkit.surfaces.models.polynomial import fit_polynomial
from rsmkit.surfaces.models.stretch_search import DIGITS, StretchSearch

SPACE = Space(a=(0.0, 1.0), b=(-2.0, 3.0))
RUNS = np.random.default_rng(4).random((30, 2)) * [1.0, 5.0] + [0.0, -2.0]
Y = np.exp(2.5 * RUNS[:, 0]) + RUNS[:, 0] * RUNS[:, 1] + np.exp(-RUNS[:, 1]) + np.sin(9 * RUNS).sum(axis=1)
ROUNDING = 3e-15


@pytest.fixture
def rounded_otherwise(monkeypatch):
    """Give every value of the criterion a relative error of its own; none for seed 0."""
    exact = StretchSearch._criterion

    def use(seed):
        rng = np.random.default_rng(seed)

        def criterion(self, *about):
            return exact(self, *about) * (1.0 + (ROUNDING * rng.uniform(-1.0, 1.0) if seed else 0.0))

        monkeypatch.setattr(StretchSearch, "_criterion", criterion)

    return use


@pytest.mark.parametrize("family", ["exp", "power", "twosided", "kumaraswamy"])
def test_rounding_changes_no_bit_of_a_stretch(family, rounded_otherwise):
    plain = fit_polynomial(SPACE, "y", checked_data(SPACE, RUNS, Y, None, None), full_terms(SPACE))
    found = set()
    for seed in range(4):
        rounded_otherwise(seed)
        theta = theta_of(StretchSearch(plain).find(family))
        found.add(theta.tobytes())
    assert len(found) == 1
    np.testing.assert_array_equal(theta, np.round(theta, DIGITS))


def test_the_settled_stretch_is_where_the_criterion_is_flat():
    """A central difference over 1e-3: the criterion of 30 runs is smooth, its rounding error 1e-12 / 1e-3."""
    plain = fit_polynomial(SPACE, "y", checked_data(SPACE, RUNS, Y, None, None), full_terms(SPACE))
    search = StretchSearch(plain)
    stretches = search.find("exp")
    theta = theta_of(stretches)
    for axis in 1e-3 * np.eye(len(theta)):
        ahead, behind = (search._criterion(theta + s * axis, stretches, search.rows) for s in (1.0, -1.0))
        assert abs(ahead - behind) / 2e-3 < 1e-4
