"""Stationary points at each level of categorical factors that share the second-order part."""

import numpy as np
import pytest

from rsmkit.errors import RsmkitError
from rsmkit.language.space import Space
from rsmkit.language.terms import parse_terms
from rsmkit.surfaces.polynomial_fit import fit_surface
from rsmkit.surfaces.statistics.optima.canonical import (
    canonical_analysis,
    stationary_region,
    stationary_statistic,
)
from rsmkit.surfaces.statistics.optima.ridge import ridge_path, steepest_path
from rsmkit.surfaces.statistics.terms.categories import at_category

TOOLS = [3.1, 5.2, 4.9, 4.0, 6.3, 6.0, 3.0, 5.0, 5.1, 4.2, 6.1, 6.2]
"""One curve of x, two tools that shift it, each combination twice."""


def two_tools(*words):
    space = Space(x=(-1, 1), tool=["a", "b"])
    points = [(x, tool) for _ in range(2) for tool in (0, 1) for x in (-1, 0, 1)]
    return fit_surface(space, points, TOOLS, terms=parse_terms(space, words), deterministic=False)


def test_a_shift_leaves_the_stationary_point_where_it_is():
    """R: m <- lm(y ~ x + tool + I(x^2)); -coef(m)[2] / (2 * coef(m)[4])."""
    report = two_tools("FO", "x^2").report()
    points = report["stationary_points"]
    assert [point["category"] for point in points] == [{"tool": "a"}, {"tool": "b"}]
    for point in (*points, report["stationary_point"]):
        assert point["natural"] == pytest.approx({"x": 0.454022988505747})
        assert point["kind"] == "maximum"
    assert points[1]["predicted"] - points[0]["predicted"] == pytest.approx(13 / 12)
    assert report["stationary_point"]["predicted"] == pytest.approx(
        0.5 * (points[0]["predicted"] + points[1]["predicted"])
    )
    assert report["eigenvalues"] == pytest.approx([-1.0875])


def test_slopes_that_differ_move_it():
    """R: m <- lm(y ~ x * tool + I(x^2)); -(coef(m)[2] + c(0, coef(m)[5])) / (2 * coef(m)[4])."""
    fitted = two_tools("FO", "x^2", "x*tool")
    report = fitted.report()
    found = [point["natural"]["x"] for point in report["stationary_points"]]
    assert found == pytest.approx([0.448275862068965, 0.459770114942529])
    assert "depends on the category" in report["stationary_point"]["reason"]
    assert "Stationary point at tool b (maximum, inside the bounds): x = 0.45977" in fitted.summary()


def test_curvature_that_differs_is_refused_in_words():
    fitted = two_tools("FO", "x^2*tool")
    report = fitted.report()
    assert "differs between the levels of tool" in report["stationary_point"]["reason"]
    assert "stationary_points" not in report
    assert "fit one surface for each" in fitted.summary()
    each = [canonical_analysis(fitted.surface, {"tool": level}).eigenvalues[0] for level in "ab"]
    assert each[0] != pytest.approx(each[1], rel=1e-3)


def test_first_order_surfaces_have_a_direction_at_each_level():
    fitted = two_tools("FO")
    assert "direction of steepest ascent" in fitted.report()["stationary_point"]["reason"]
    assert "Steepest ascent at tool b: by one coded unit x = 1 coded, x = 1 natural" in fitted.summary()


def test_categories_alone():
    space = Space(tool=["a", "b"], shift=["day", "night"])
    points = [(i, j) for _ in range(2) for i in (0, 1) for j in (0, 1)]
    fitted = fit_surface(space, points, TOOLS[:8], order=1, deterministic=False)
    assert fitted.report()["stationary_point"]["reason"] == "there is no numeric factor"
    assert fitted.report()["ascent"] == {"reason": "there is no numeric factor"}


@pytest.fixture(scope="module")
def mixed():
    """Two numbers and a category of three levels with a slope of its own; units far from coded ones."""
    random = np.random.default_rng(7)
    space = Space(temperature=(300, 400), kind=["p", "q", "r"], load=(2, 3))
    points = np.column_stack(
        [random.uniform(300, 400, 40), random.integers(3, size=40), random.uniform(2, 3, 40)]
    )
    c = space.encode(points)
    y = 5 + c[:, 0] + c[:, 1] * (1 + 0.7 * c[:, 0]) - c[:, 0] ** 2 - 2 * c[:, 2] ** 2 + c[:, 0] * c[:, 2]
    terms = parse_terms(space, ["SO"])
    return fit_surface(space, points, y + 0.1 * random.standard_normal(40), terms=terms, deterministic=False)


@pytest.mark.parametrize("level", [0, 1, 2])
def test_a_slice_is_the_surface_at_the_category(mixed, level):
    """The gradient vanishes at the stationary point, in the numbers; predictions are those of the surface."""
    category = {"kind": "pqr"[level]}
    view = at_category(mixed.surface, category)
    found = canonical_analysis(mixed.surface, category)
    point = np.insert(view.from_units(found.stationary), 1, level)
    half = np.array([50.0, 0.5])
    np.testing.assert_allclose(mixed.gradient(point[None])[0, [0, 2]] * half, 0.0, atol=1e-12)
    np.testing.assert_allclose(view.predict(point[None, [0, 2]]), mixed.predict(point[None]), rtol=1e-14)
    np.testing.assert_allclose(view.leverage(point[None, [0, 2]]), mixed.leverage(point[None]), rtol=1e-13)
    terms, beta = view.polynomial()
    coded = np.array([[0.3, -0.6]])
    np.testing.assert_allclose(terms.evaluate(coded, beta), view.predict(view.from_units(coded)), rtol=1e-12)


def test_the_region_of_box_and_hunter_uses_all_runs(mixed):
    """The statistic from the covariance of all coefficients, worked out by numpy."""
    surface, at = mixed.surface, np.array([0.2, -0.1])
    names = list(surface.names)
    rows = np.zeros((2, len(names)))
    for name, row in {
        "temperature": (1, 0),
        "load": (0, 1),
        "temperature*kind[q]": (1, 0),
        "kind[q]*load": (0, 1),
        "temperature*load": (at[1], at[0]),
        "temperature^2": (2 * at[0], 0),
        "load^2": (0, 2 * at[1]),
    }.items():
        rows[:, names.index(name)] = row
    slope, spread = rows @ surface.coefficients, rows @ surface.covariance @ rows.T
    expected = slope @ np.linalg.solve(spread, slope) / 2
    view = at_category(surface, {"kind": "q"})
    assert stationary_statistic(view, at[None])[0] == pytest.approx(expected, rel=1e-9)
    region = stationary_region(surface, category={"kind": "q"}, points=256)
    assert region.low.shape == (2,)
    center = canonical_analysis(surface, {"kind": "q"}).stationary
    assert (region.low <= center).all()
    assert (center <= region.high).all()


def test_paths_at_a_category(mixed):
    path = ridge_path(mixed.surface, [0.0, 0.5], "maximize", {"kind": "r"})
    assert np.linalg.norm(path.coded[1]) == pytest.approx(0.5)
    on_circle = 0.5 * np.array([(np.cos(t), np.sin(t)) for t in np.linspace(0, 2 * np.pi, 2001)])
    view = at_category(mixed.surface, {"kind": "r"})
    assert path.predicted[1] >= view.predict(view.from_units(on_circle)).max() - 1e-9
    straight = steepest_path(mixed.surface, [1.0], category={"kind": "r"})
    assert straight.coded.shape == (1, 2)


@pytest.mark.parametrize(
    ("category", "message"),
    [
        (None, "depends on kind"),
        ({"kind": "s"}, "kind must be p, q or r"),
        ({"kin": "p"}, "did you mean 'kind'"),
    ],
)
def test_categories_that_are_not_given_or_none(mixed, category, message):
    with pytest.raises(RsmkitError, match=message):
        canonical_analysis(mixed.surface, category)
