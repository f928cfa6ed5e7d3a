"""Stretch families: end points, inverse, derivative, identity limit, published forms."""

import numpy as np
import pytest
from scipy.stats import beta as beta_distribution

from rsmkit.errors import RsmkitError
from rsmkit.surfaces.estimation.coordinates import Coordinates
from rsmkit.surfaces.estimation.stretch import FAMILIES, Stretch

U = np.linspace(0, 1, 201)
MEMBERS = [
    *(("exp", (a,)) for a in (-8, -2.5, -1e-9, 0, 1e-9, 1.5, 8)),
    *((family, (p,)) for family in ("power", "natpower") for p in (-6, -1, 0, 1e-9, 0.5, 1, 3, 8)),
    *(("twosided", (d,)) for d in (-8, -1, -1e-9, 0, 1e-9, 2, 8)),
    *(("roberts", (q,)) for q in (-6, -1, 0, 3, 6)),
    *(("roberts_interior", (r, uc)) for r in (1e-3, 2, 8) for uc in (0.05, 0.4, 0.95)),
    *(
        (family, (a, b))
        for family in ("kumaraswamy", "beta")
        for a, b in [(0, 0), (-1.6, 0.7), (1.6, 1.6), (0.3, -1)]
    ),
]


def member(family, parameters, expression=""):
    return Stretch(family, tuple(map(float, parameters)), 0.15, 0.30, expression)


@pytest.mark.parametrize(("family", "parameters"), [*MEMBERS, ("identity", ())])
def test_maps_are_monotone_onto_the_unit_interval_and_invertible(family, parameters):
    stretch = member(family, parameters)
    s = stretch.forward(U)
    assert s[0] == pytest.approx(0, abs=1e-12)
    assert s[-1] == pytest.approx(1, abs=1e-12)
    assert (np.diff(s) >= 0).all()
    assert (np.diff(s[:-1]) > 0).all() or max(np.abs(parameters)) == 1.6
    back = stretch.forward(stretch.inverse(U))
    np.testing.assert_allclose(back, U, atol=1e-10)
    inner = (s > 1e-6) & (s < 1 - 1e-6)
    np.testing.assert_allclose(stretch.inverse(s)[inner], U[inner], atol=1e-8)


@pytest.mark.parametrize(("family", "parameters"), MEMBERS)
def test_slopes_are_derivatives(family, parameters):
    stretch, u, h = member(family, parameters), np.linspace(0.02, 0.98, 97), 1e-6
    slope = (stretch.forward(u + h) - stretch.forward(u - h)) / (2 * h)
    np.testing.assert_allclose(stretch.slope(u), slope, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize(
    ("family", "near"),
    [
        *(("exp", (a,)) for a in (-1e-9, 1e-9)),
        *((f, (1 + d,)) for f in ("power", "natpower") for d in (-1e-9, 1e-9)),
        *(("twosided", (d,)) for d in (-1e-9, 1e-9)),
        *((f, (1e-9, -1e-9)) for f in ("kumaraswamy", "beta")),
    ],
)
def test_identity_limit(family, near):
    np.testing.assert_allclose(member(family, near).forward(U), U, atol=2e-9)
    np.testing.assert_allclose(member(family, FAMILIES[family].identity).forward(U), U, atol=1e-12)


def test_families_without_exact_identity_come_close():
    np.testing.assert_allclose(member("roberts", (-6,)).forward(U), U, atol=1e-6)
    np.testing.assert_allclose(member("roberts_interior", (1e-3, 0.5)).forward(U), U, atol=1e-6)


def test_published_forms():
    a = 1.5
    np.testing.assert_allclose(
        member("exp", (a,)).inverse(U), np.log(1 + U * (np.exp(a) - 1)) / a, atol=1e-14
    )
    x = 0.15 + U * 0.15
    expected = (x**-0.5 - 0.15**-0.5) / (0.30**-0.5 - 0.15**-0.5)
    np.testing.assert_allclose(member("natpower", (-0.5,)).forward(U), expected, atol=1e-13)
    np.testing.assert_allclose(member("natpower", (0,)).forward(U), np.log(x / 0.15) / np.log(2), atol=1e-13)
    shape = beta_distribution(np.exp(0.3), np.exp(-1))
    np.testing.assert_allclose(member("beta", (0.3, -1)).forward(U), shape.cdf(U), atol=1e-14)
    np.testing.assert_allclose(member("beta", (0.3, -1)).slope(U[1:-1]), shape.pdf(U[1:-1]), rtol=1e-12)


def test_a_users_map_is_a_formula():
    stretch = member("fixed", (), "1/sqrt(x)")
    np.testing.assert_allclose(stretch.forward(U), member("natpower", (-0.5,)).forward(U), atol=1e-12)
    np.testing.assert_allclose(stretch.inverse(stretch.forward(U)), U, atol=1e-12)
    np.testing.assert_allclose(stretch.slope(U), member("natpower", (-0.5,)).slope(U), rtol=2e-5)
    with pytest.raises(RsmkitError, match="rise or fall all the way"):
        member("fixed", (), "sin(40*x)")
    with pytest.raises(RsmkitError, match="unknown name y"):
        member("fixed", (), "y")


@pytest.mark.parametrize(("family", "parameters"), MEMBERS)
def test_outside_the_hull_maps_go_on_straight_and_invertible(family, parameters):
    stretch = member(family, parameters)
    outside = np.array([-1.5, -0.2, 1.1, 3.0])
    assert (np.diff(stretch.forward(outside)) > 0).all()
    np.testing.assert_allclose(stretch.inverse(stretch.forward(outside)), outside, atol=1e-9)


def test_coordinates_map_both_ways_with_their_slopes():
    stretches = (
        member("exp", (2.0,)),
        Stretch("identity", (), 0.0, 4.0),
        Stretch("power", (-1.0,), 5.0, 9.0),
    )
    coordinates = Coordinates((0.15, 0.0, 5.0), (0.30, 4.0, 9.0), stretches)
    x = np.array([[0.15, 0.0, 5.0], [0.30, 4.0, 9.0], [0.2, 1.0, 8.0], [0.1, 5.0, 10.0]])
    z = coordinates.forward(x)
    np.testing.assert_allclose(z[:2], [[-1, -1, -1], [1, 1, 1]], atol=1e-12)
    np.testing.assert_allclose(coordinates.backward(z), x, rtol=1e-12)
    h = 1e-7
    for j in range(3):
        step = h * np.eye(3)[j]
        slope = (coordinates.forward(x + step) - coordinates.forward(x - step))[2:, j] / (2 * h)
        np.testing.assert_allclose(coordinates.slopes(x)[2:, j], slope, rtol=1e-6)


@pytest.mark.parametrize(
    ("family", "parameters", "low", "message"),
    [
        ("spline", (), 1.0, "no stretch family 'spline'"),
        ("exp", (), 1.0, "1 finite parameters"),
        ("exp", (np.nan,), 1.0, "finite"),
        ("natpower", (1.0,), -1.0, "positive factor values"),
        ("exp", (1.0,), 2.0, "low < high"),
    ],
)
def test_wrong_stretches_are_refused(family, parameters, low, message):
    with pytest.raises(RsmkitError, match=message):
        Stretch(family, parameters, low, 2.0)


@pytest.mark.parametrize(
    ("family", "parameters"),
    [
        ("exp", (1.7,)), ("exp", (-8.0,)), ("exp", (0.0,)), ("exp", (0.3,)), ("power", (-1.2,)),
        ("power", (1.0,)), ("natpower", (2.5,)), ("twosided", (2.1,)), ("twosided", (-1.4,)),
        ("twosided", (0.05,)), ("roberts", (1.1,)), ("roberts", (6.0,)), ("roberts_interior", (2.0, 0.35)),
        ("roberts_interior", (0.5, 0.9)), ("kumaraswamy", (0.4, -0.3)), ("beta", (0.5, -0.2)),
        ("beta", (-0.7, 0.6)),
    ],
)  # fmt: skip
def test_changes_are_derivatives_by_the_parameters(family, parameters):
    """Against differences of the fourth order over 1e-4, which lose 1e-16 / 1e-4."""
    stretch, u = Stretch(family, parameters, 1.0, 3.0), np.linspace(-0.2, 1.2, 15)
    for i in range(len(parameters)):
        at = [
            stretch.moved(tuple(p + k * 1e-4 * (c == i) for c, p in enumerate(parameters))).forward(u)
            for k in (-2, -1, 1, 2)
        ]
        expected = (at[0] - 8 * at[1] + 8 * at[2] - at[3]) / 12e-4
        found = stretch.change_anywhere(i, u)
        np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-10)


def test_where_a_parameter_changes_nothing_its_effect_keeps_its_digits():
    """Taylor: exp changes by u (u - 1) / 2 + a u (2 u - 1) (u - 1) / 6, twosided by d v (v^2 - 1/4) / 3."""
    u = np.linspace(0.0, 1.0, 9)
    a, d, v = 1e-7, -1e-5, u - 0.5
    np.testing.assert_allclose(
        Stretch("exp", (a,), 0.0, 1.0).change(0, u),
        0.5 * u * (u - 1.0) + a * u * (2.0 * u - 1.0) * (u - 1.0) / 6.0,
        rtol=1e-13,
    )
    np.testing.assert_allclose(
        Stretch("twosided", (d,), 0.0, 1.0).change(0, u), d * v * (v**2 - 0.25) / 3.0, rtol=1e-9, atol=1e-21
    )
