"""Static figures: what is drawn is what the data say."""

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
import pytest

import rsmkit as rk
from rsmkit import plots
from rsmkit.design.design import Design
from rsmkit.errors import RsmkitError
from rsmkit.language.space import Factor, Space
from rsmkit.optimum.optimum import Candidate, Optimum
from rsmkit.surfaces.models.box_cox import box_cox
from rsmkit.surfaces.polynomial_fit import fit_surface

SPACE = Space([Factor("a", 0.0, 4.0, unit="m"), Factor("b", 10.0, 20.0), Factor("c", -1.0, 1.0)])
POINTS = np.random.default_rng(1).uniform(SPACE.lows, SPACE.highs, (40, 3))
NOISE = 0.2 * np.random.default_rng(2).normal(size=40)


def truth(points):
    a, b, c = SPACE.encode(points).T
    return 12 + 3 * a - b + 2 * a * a + 1.5 * a * c + 0.5 * c * c


@pytest.fixture(scope="module")
def exact():
    return fit_surface(SPACE, POINTS, truth(POINTS), response="y")


@pytest.fixture(scope="module")
def noisy():
    return fit_surface(SPACE, POINTS, truth(POINTS) + NOISE, response="y")


@pytest.fixture(autouse=True)
def _no_figures_left():
    yield
    plt.close("all")


def drawn(line):
    return np.asarray(line.get_xdata(), float), np.asarray(line.get_ydata(), float)


def test_every_figure_uses_the_axes_it_is_given(noisy):
    for name in ("perturbation", "parity", "residuals", "leverage", "half_normal", "box_cox"):
        ax = plt.figure().add_subplot()
        assert getattr(plots, name)(noisy, ax=ax) is ax
        assert ax.get_xlabel()
        assert ax.get_ylabel()
    ax = plt.figure().add_subplot()
    assert plots.contours(noisy, "a", "b", points=POINTS, ax=ax) is ax
    assert ax.get_xlabel() == "a [m]"
    three = plt.figure().add_subplot(projection="3d")
    assert plots.surface_3d(noisy, "a", "c", ax=three) is three
    with pytest.raises(RsmkitError, match="projection='3d'"):
        plots.surface_3d(noisy, "a", "c", ax=ax)


def test_contour_lines_lie_where_the_response_has_their_value(exact):
    ax = plots.contours(exact, "a", "b", levels=[10.0, 13.0])
    lines = next(c for c in ax.collections if len(c.get_paths()) == 2)
    for level, path in zip((10.0, 13.0), lines.get_paths(), strict=True):
        ends = path.vertices[np.isfinite(path.vertices).all(axis=1)]
        points = np.column_stack([ends, np.zeros(len(ends))])
        np.testing.assert_allclose(truth(points), level, atol=0.01)  # straight between grid lines


def test_perturbation_follows_the_response(exact):
    ax = plots.perturbation(exact)
    x, y = drawn(ax.lines[0])
    np.testing.assert_allclose(y, 12 + 3 * x + 2 * x * x, rtol=1e-9)


def test_main_effects_average_over_the_box(exact):
    ax = plots.main_effects(exact)
    x, y = drawn(ax[0, 0].lines[0])
    a = (x - 2.0) / 2.0
    # uniform on [-1, 1]: mean of c is 0, mean of c squared is 1/3
    np.testing.assert_allclose(y, 12 + 3 * a + 2 * a * a + 0.5 / 3, atol=0.02)


def test_interaction_lines_have_the_right_slopes(exact):
    ax = plots.interactions(exact, "c", "a", at=[2.0, 15.0, 0.0])
    for a, line in zip((-1.0, 1.0), ax.lines, strict=True):
        x, y = drawn(line)
        np.testing.assert_allclose(y, 12 + 3 * a + 2 + 1.5 * a * x + 0.5 * x * x, rtol=1e-9)


def test_profiles_go_through_the_point_and_show_its_interval(noisy):
    at = np.array([1.0, 12.0, 0.5])
    ax = plots.profiler({"y": noisy, "again": noisy}, at)
    assert ax.shape == (2, 3)
    mean, low, high = (v[0] for v in noisy.predict([[1.0, 12.0, -1.0]], interval=0.95))
    x, y = drawn(ax[0, 2].lines[0])
    assert (x[0], y[0]) == (-1.0, pytest.approx(mean))
    band = ax[0, 2].collections[0].get_paths()[0].vertices
    edge = band[band[:, 0] == -1.0, 1]
    assert (edge.min(), edge.max()) == (pytest.approx(low), pytest.approx(high))


def test_a_categorical_factor_keeps_its_texts():
    space = Space([Factor("a", 0.0, 1.0), Factor("tool", levels=("saw", "file"))])
    points = np.array([[i / 9, i % 2] for i in range(10)])
    surface = fit_surface(space, points, points @ [1.0, 2.0] + 0.1 * points[:, 0] ** 2, order=1)
    texts = [label.get_text() for label in plots.profiler({"y": surface})[0, 1].get_xticklabels()]
    assert texts == ["saw", "file"]
    assert [t.get_text() for t in plots.interactions(surface, "a", "tool").get_legend().get_texts()] == [
        "saw",
        "file",
    ]
    plots.main_effects(surface)


def test_residuals_are_those_of_textbooks(noisy):
    X = noisy.matrix
    hat = X @ np.linalg.solve(X.T @ X, X.T)
    left = noisy.data.y - hat @ noisy.data.y
    sigma = np.sqrt(left @ left / (len(left) - X.shape[1]))
    expected = left / (sigma * np.sqrt(1 - np.diag(hat)))
    for against, x in (("fitted", hat @ noisy.data.y), ("run", np.arange(1, 41)), ("b", POINTS[:, 1])):
        got = drawn(plots.residuals(noisy, against).lines[-1])
        np.testing.assert_allclose(got, [x, expected], rtol=1e-7, atol=1e-9)
    with pytest.raises(RsmkitError, match="'nonsense'"):
        plots.residuals(noisy, "nonsense")
    ax = plots.residual_set(noisy)
    assert ax.shape == (2, 2)
    np.testing.assert_allclose(ax[1, 1].collections[0].get_offsets()[:, 1], np.diag(hat), rtol=1e-8)


def test_half_normal_plot_of_a_saturated_design_shows_the_effects():
    """Eight runs, seven coefficients and the constant: |b| sqrt(8), no t."""
    space = rk.Space(a=(-1, 1), b=(-1, 1), c=(-1, 1))
    points = rk.full_factorial(space).points
    y = 10 + 4 * points[:, 0] + points @ [0.0, 0.1, -0.2] + 0.05 * points.prod(axis=1)
    surface = rk.fit_surface(space, points, y, terms=rk.parse_terms(space, ["a*b*c"]))
    ax = plots.half_normal(surface, label=1)
    assert ax.lines[0].get_ydata()[-1] == pytest.approx(4 * np.sqrt(8))
    assert [text.get_text() for text in ax.texts] == ["a"]


def test_half_normal_plot_names_the_real_effects(noisy):
    ax = plots.half_normal(noisy, label=5)
    assert {text.get_text() for text in ax.texts} == {"a", "b", "a^2", "a*c", "c^2"}
    x, y = drawn(ax.lines[0])
    assert (np.diff(y) >= 0).all()
    assert x[0] > 0


def test_box_cox_curve_peaks_at_the_estimate(noisy):
    found = box_cox(noisy)
    ax = plots.box_cox(noisy)
    x, y = drawn(ax.lines[0])
    assert x[y.argmax()] == pytest.approx(found.power, abs=0.03)
    limit = ax.lines[1].get_ydata()[0]
    assert np.interp(found.low, x, y) == pytest.approx(limit, abs=0.05)
    assert np.interp(found.high, x, y) == pytest.approx(limit, abs=0.05)


def test_fraction_of_design_space_of_a_factorial():
    space = Space(a=(0, 1), b=(0, 1))
    design = Design(space, np.array([[0.0, 0], [0, 1], [1, 0], [1, 1]]), ("factorial",) * 4)
    x, y = drawn(plots.fraction_of_design_space(design, order=1).lines[0])
    # for two levels and no interaction the scaled variance is 1 + a^2 + b^2
    assert y.max() == pytest.approx(3.0, abs=0.05)
    assert y.min() == pytest.approx(1.0, abs=0.05)
    assert y.mean() == pytest.approx(5 / 3, abs=0.02)
    # a^2 + b^2 < 1/2 on a share of pi/8 of the square
    assert np.interp(1.5, y, x) == pytest.approx(np.pi / 8, abs=0.02)
    with pytest.raises(RsmkitError, match="order 2"):
        plots.fraction_of_design_space(design, order=2)


def test_design_points_are_drawn_by_kind():
    design = Design(SPACE, POINTS, ("factorial",) * 30 + ("augmented",) * 10)
    ax = plots.design_scatter(design, "c", "a")
    np.testing.assert_array_equal(drawn(ax.lines[1]), POINTS[30:, [2, 0]].T)
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["factorial", "augmented"]


def candidate(*objectives):
    return Candidate(np.array([1.0, 12.0, 0.0]), objectives, {"y": 1.0})


def test_searches_are_drawn_as_they_went():
    history = {
        "generation": [1, 2, 3],
        "best": [3.0, 2.0, 1.5],
        "mean": [None, 4.0, 2.0],
        "worst": [9.0, 8.0, 7.0],
    }
    single = Optimum("best", SPACE, ("y",), (), {}, 1, 9, candidate(1.5), history)
    ax = plots.ga_history(single)
    np.testing.assert_array_equal(drawn(ax.lines[0])[1], [3.0, 2.0, 1.5])
    np.testing.assert_array_equal(drawn(ax.lines[1])[1], [np.nan, 4.0, 2.0])
    with pytest.raises(RsmkitError, match="no Pareto front"):
        plots.pareto(single)
    front = (candidate(1.0, 5.0), candidate(2.0, 3.0))
    ax = plots.pareto(Optimum("two", SPACE, ("y", "z"), (), {}, 1, 9, front[1], {}, front), 1, 0)
    np.testing.assert_array_equal(drawn(ax.lines[0]), [[5.0, 3.0], [1.0, 2.0]])
    with pytest.raises(RsmkitError, match="no history"):
        plots.ga_history(Optimum("two", SPACE, ("y", "z"), (), {}, 1, 9, front[1], {}, front))
    three = (candidate(1.0, 5.0, 2.0), candidate(2.0, 3.0, 4.0))
    ax = plots.pareto(Optimum("three", SPACE, ("x", "y", "z"), (), {}, 1, 9, three[1], {}, three))
    np.testing.assert_array_equal(ax.collections[0].get_array(), [2.0, 4.0])
