"""Means behind a power of the response: closed forms where there are any, quadrature by scipy where not."""

import numpy as np
import pytest
from scipy.integrate import quad

from rsmkit.surfaces.models.box_cox import _mean_of_powers


def test_square_and_cube_have_their_moments():
    """E u^2 = m^2 + s^2 and E u^3 = m^3 + 3 m s^2; u below zero, 7 s away, leaves 1e-8 of it at most."""
    middle = np.array([2.1, 3.0])
    assert _mean_of_powers(middle, 0.3, 1 / 2, 1e9) == pytest.approx(middle**2 + 0.09, rel=1e-7)
    assert _mean_of_powers(middle, 0.3, 1 / 3, 1e9) == pytest.approx(middle**3 + 3 * middle * 0.09, rel=1e-7)


def test_a_reciprocal_has_its_asymptotic_series():
    """E 1/u = (1 + c^2 + 3 c^4 + 15 c^6 + 105 c^8 ...)/m with c = s/m; the term left out is 945 c^10."""
    c = 0.1
    series = 1 + c**2 + 3 * c**4 + 15 * c**6 + 105 * c**8
    assert _mean_of_powers(np.array([4.0]), 4 * c, -1.0, 1e3)[0] == pytest.approx(series / 4, rel=3e-7)


@pytest.mark.parametrize(("power", "spread"), [(-0.5, 0.3), (-0.3, 0.15), (-1.0, 0.25)])
def test_a_mean_over_all_responses_up_to_the_largest(power, spread):
    """Where two terms of a series are 10 to 30 % off."""

    def density(u):
        return np.exp(-0.5 * ((u - 1) / spread) ** 2)

    ends, peak = (1e3**power, 1 + 9 * spread), [1.0]
    total = quad(lambda u: u ** (1 / power) * density(u), *ends, limit=500, points=peak)[0]
    right = total / quad(density, *ends, limit=500, points=peak)[0]
    assert _mean_of_powers(np.array([1.0]), spread, power, 1e3)[0] == pytest.approx(right, rel=1e-6)


def test_what_has_no_mean_is_bounded():
    assert _mean_of_powers(np.array([-1.0, 0.0]), 0.3, -1.0, 1e3).tolist() == [1e3, 1e3]
    assert _mean_of_powers(np.array([-1.0]), 0.3, 0.5, 1e3).tolist() == [0.0]
    assert _mean_of_powers(np.array([2.0]), 0.0, -1.0, 1e3).tolist() == [0.5]
    assert np.isnan(_mean_of_powers(np.array([2.0]), np.nan, -1.0, 1e3)).all()
