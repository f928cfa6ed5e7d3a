"""The information matrix of a design and the criteria read off it."""

import numpy as np
import pytest

from rsmkit.design.design import Design
from rsmkit.design.quality.information import information_matrix
from rsmkit.errors import RsmkitError
from rsmkit.language.space import Factor, Space


def test_the_information_of_three_points_on_a_line_is_worked_out_by_hand():
    """Quadratic through -1, 0 and 1: sums of powers, and their inverse."""
    space = Space([Factor("x", 10.0, 30.0)])
    design = Design(space, np.array([[10.0], [20.0], [30.0]]), ("given",) * 3)
    found = information_matrix(design)
    assert found.names == ("1", "x", "x^2")
    assert found.matrix.tolist() == [[3, 0, 2], [0, 2, 0], [2, 0, 2]]
    assert found.inverse == pytest.approx(np.array([[1, 0, -1], [0, 0.5, 0], [-1, 0, 1.5]]), abs=1e-12)
    assert found.determinant == pytest.approx(4.0, rel=1e-12)
    assert found.d_criterion == pytest.approx(4.0 ** (1 / 3), rel=1e-12)
    assert found.a_criterion == pytest.approx(3.0, rel=1e-12)
    assert found.largest_correlation == pytest.approx(1.5**-0.5, rel=1e-12)
    assert found.eigenvalues == pytest.approx([(5 - 17**0.5) / 2, 2.0, (5 + 17**0.5) / 2], rel=1e-12)
    assert found.e_criterion == found.eigenvalues[0]


def test_runs_that_cannot_tell_the_terms_have_information_but_no_inverse():
    space = Space([Factor("x", -1.0, 1.0)])
    found = information_matrix(Design(space, np.array([[-1.0], [1.0]]), ("given",) * 2))
    assert (found.determinant, found.d_criterion) == (0.0, 0.0)
    with pytest.raises(RsmkitError, match="cannot estimate the model"):
        _ = found.a_criterion
