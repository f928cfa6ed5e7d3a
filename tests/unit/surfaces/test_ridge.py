"""Ridge paths, the optimum in the box, stationary regions and plot data, against brute force."""

import numpy as np
import pytest

from rsmkit.errors import RsmkitError
from rsmkit.language.space import Factor, Space
from rsmkit.language.terms import full_terms
from rsmkit.surfaces.models.box_cox import box_cox, power_transform
from rsmkit.surfaces.polynomial_fit import fit_surface
from rsmkit.surfaces.statistics.optima.canonical import canonical_analysis, stationary_region
from rsmkit.surfaces.statistics.optima.ridge import optimum_in_box, ridge_path, steepest_path
from rsmkit.surfaces.statistics.views import contour_grid, perturbation_curves

SPACE = Space(a=(10.0, 20.0), b=(-1.0, 3.0))


def fitted(beta, noise=0.0, seed=0, n=30):
    rng = np.random.default_rng(seed)
    coded = rng.uniform(-1, 1, (n, 2))
    y = full_terms(2, 2).matrix(coded) @ np.array(beta, float) + noise * rng.normal(size=n)
    return fit_surface(SPACE, SPACE.decode(coded), y)


@pytest.mark.parametrize(
    "beta",
    [
        (0, 1, 2, 0.5, -1, 3),
        (0, 0, 1, 0, 2, 1),  # no pull along the axis of largest curvature
        (0, 0, 0, 0.7, 1, -1),  # centre is stationary
        (5, 1, 1, 0, -2, -2),  # spherical
    ],
)
@pytest.mark.parametrize("goal", ["maximize", "minimize"])
@pytest.mark.parametrize("radius", [0.1, 1.0, 2.0])
def test_ridge_point_is_the_best_of_a_fine_circle(beta, goal, radius):
    surface = fitted(beta)
    path = ridge_path(surface, [radius], goal)
    angle = np.linspace(0, 2 * np.pi, 200_001)
    circle = SPACE.decode(radius * np.column_stack([np.cos(angle), np.sin(angle)]))
    best = surface.predict(circle).max() if goal == "maximize" else surface.predict(circle).min()
    assert np.linalg.norm(path.coded[0]) == pytest.approx(radius, rel=1e-12)
    assert path.predicted[0] == pytest.approx(best, rel=1e-8, abs=1e-8)


def test_steepest_descent_is_against_the_gradient():
    path = steepest_path(fitted((3, 3, -4, 0, 0, 0)), [0, 5], "minimize")
    np.testing.assert_allclose(path.coded[1], [-3, 4], rtol=1e-9)
    assert path.predicted[1] == pytest.approx(3 - 25, rel=1e-9)


@pytest.mark.parametrize("goal", ["maximize", "minimize"])
@pytest.mark.parametrize("beta", [(0, 1, 2, 0.5, -1, 3), (1, 0.2, 0.1, 0, 1, 1), (0, 1, -1, 2, -1, -1)])
def test_optimum_in_box_against_a_fine_grid(beta, goal):
    surface = fitted(beta)
    point, value = optimum_in_box(surface, goal)
    axis = np.linspace(-1, 1, 401)
    grid = surface.predict(SPACE.decode(np.stack(np.meshgrid(axis, axis), -1).reshape(-1, 2)))
    assert SPACE.contains(point)
    assert value == pytest.approx(grid.max() if goal == "maximize" else grid.min(), abs=1e-4)
    assert (value >= grid.max() - 1e-12) if goal == "maximize" else (value <= grid.min() + 1e-12)


def test_optimum_in_box_tries_every_category():
    space = Space([Factor("x", 0.0, 1.0), Factor("tool", levels=("A", "B"))])
    x = np.column_stack([np.tile(np.linspace(0, 1, 6), 2), np.repeat([0, 1], 6)])
    surface = fit_surface(space, x, x[:, 0] * (1 - 2 * x[:, 1]))
    point, value = optimum_in_box(surface, "minimize")
    np.testing.assert_allclose(point, [1, 1], atol=1e-9)
    assert value == pytest.approx(-1, abs=1e-9)


def test_region_of_the_stationary_point():
    precise, vague = fitted((0, 1, 1, 0, 2, 2), noise=0.02), fitted((0, 1, 1, 0, 0.2, 0.2), noise=2.0)
    small, large = stationary_region(precise), stationary_region(vague)
    assert small.share < 0.01
    assert large.share > 0.5
    assert (small.low <= -0.25).all()
    assert (small.high >= -0.25).all()
    point = precise.report()["stationary_point"]
    assert point["kind"] == "minimum"
    assert point["region"]["low"]["a"] <= point["natural"]["a"] <= point["region"]["high"]["a"]


def test_region_covers_the_true_stationary_point_as_often_as_stated():
    """Box & Hunter's region is exact: 95 % of 200 replicates, within four standard errors."""
    from rsmkit.surfaces.statistics.optima.canonical import stationary_statistic

    truth, covered = np.array([[-0.25, -0.25]]), 0
    for seed in range(200):
        surface = fitted((0, 1, 1, 0, 2, 2), noise=0.5, seed=seed, n=16)
        covered += stationary_statistic(surface, truth)[0] <= 3.7082648  # F(0.95; 2, 10) of the tables: 3.71
    assert abs(covered / 200 - 0.95) < 4 * np.sqrt(0.95 * 0.05 / 200)


def test_flat_direction_has_no_stationary_point():
    surface = fitted((0, 1, 1, 0, 2, 0))
    assert canonical_analysis(surface).kind == "ridge"
    assert "flat" in surface.report()["stationary_point"]["reason"]
    assert "first order" in fit_surface(SPACE, surface.data.points, surface.data.y, order=1).summary()


def test_canonical_analysis_is_for_numeric_second_order_surfaces():
    x = np.random.default_rng(0).uniform([10, -1], [20, 3], (20, 2))
    with pytest.raises(RsmkitError, match="of order 3"):
        canonical_analysis(fit_surface(SPACE, x, x[:, 0], order=3))


def test_plot_data():
    surface = fitted((0, 1, 2, 0.5, -1, 3))
    curves = perturbation_curves(surface, at=[12.0, 1.0], points=5)
    x, y = curves["b"]
    np.testing.assert_allclose(y, surface.predict(np.column_stack([np.full(5, 12.0), x])))
    across, up, z = contour_grid(surface, "b", "a", points=4)
    assert z[1, 2] == pytest.approx(surface.predict([[up[1], across[2]]])[0])
    with pytest.raises(RsmkitError, match="two different"):
        contour_grid(surface, "a", "a")
    with pytest.raises(RsmkitError, match="numeric factors"):
        contour_grid(surface, "a", "c")


def test_box_cox_finds_the_logarithm_and_refuses_negative_responses():
    rng = np.random.default_rng(4)
    coded = rng.uniform(-1, 1, (60, 2))
    y = np.exp(1 + coded @ [0.8, -0.5] + 0.1 * rng.normal(size=60))
    found = box_cox(fit_surface(SPACE, SPACE.decode(coded), y, order=1))
    assert found.low < 0 < found.high
    assert found.needed
    np.testing.assert_allclose(power_transform(y, 1e-9), np.log(y), rtol=1e-8)
    with pytest.raises(RsmkitError, match="positive responses"):
        box_cox(fit_surface(SPACE, SPACE.decode(coded), y - 2, order=1))
