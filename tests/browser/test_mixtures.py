"""On a mixture the page keeps to the sum: components move along Python's Cox directions."""

import numpy as np
import pytest

from rsmkit.language.space import Factor, Space
from rsmkit.report.explorer.explorer_page import write_explorer
from rsmkit.report.findings import Findings
from rsmkit.runs.record.run import Run
from rsmkit.runs.record.run_table import Runs
from rsmkit.surfaces.polynomial_fit import fit_surface
from rsmkit.surfaces.statistics.mixtures.directions import component_lines, reference_point

pytestmark = [pytest.mark.browser, pytest.mark.slow]

COMPONENTS = ["a", "b", "c", "d"]


@pytest.fixture(scope="module")
def mixed():
    """Four components in percent beside a process factor and a category, with one response."""
    space = Space(
        [
            Factor("a", 20.0, 70.0), Factor("b", 5.0, 50.0), Factor("c", 0.0, 30.0), Factor("d", 5.0, 40.0),
            Factor("heat", 40.0, 80.0), Factor("cure", levels=("fast", "slow")),
        ]
    ).mixture(*COMPONENTS, total=100.0)  # fmt: skip
    points = space.snap(space.spread(np.random.default_rng(4).random((60, 6))))
    a, b, c, d, heat, cure = points.T
    y = (
        0.3 * a
        + 0.1 * b
        + 0.5 * c
        - 0.2 * d
        + 0.01 * a * b
        - 0.02 * b * c
        + 0.003 * (heat - 60) * a
        + 2 * cure
    )
    surface = fit_surface(space, points, y, response="y", order=2)
    runs = tuple(
        Run(str(i), "tests", {}, space.values(point), 0, "done", {"y": float(v)}, {}, 0.1)
        for i, (point, v) in enumerate(zip(points, y, strict=True))
    )
    return Findings("Mixed", Runs(space, points, runs, ("y",)), {"y": surface})


@pytest.fixture
def mixed_page(mixed, open_page, tmp_path):
    path = tmp_path / "explorer.html"
    write_explorer(path, mixed)
    return open_page(path)


def test_components_move_along_the_directions_of_python(mixed, mixed_page):
    space, surface = mixed.space, mixed.surfaces["y"]
    middle = reference_point(space, None)
    np.testing.assert_allclose(mixed_page.evaluate("rsmkit.state.point"), middle, rtol=1e-12)
    for start in (middle, np.array([70.0, 25.0, 0.0, 5.0, 44.0, 1.0]), mixed.runs.points[7]):
        for name, line in component_lines(space, start, points=9).items():
            j = space.names.index(name)
            found = mixed_page.evaluate(
                """([p, j]) => rsmkit.sums.line(p, j, 9)
                    .map((x) => [...x, rsmkit.study.quantities[0].value(x)])""",
                [start.tolist(), j],
            )
            np.testing.assert_allclose(np.array(found)[:, :-1], line, rtol=1e-12, atol=1e-12 * 100)
            np.testing.assert_allclose(np.array(found)[:, -1], surface.predict(line), rtol=1e-12)


def test_whatever_is_moved_the_sum_stays(mixed, mixed_page):
    space = mixed.space
    walked = np.array(
        mixed_page.evaluate("""() => {
            const found = [];
            for (const [j, value] of [[0, 70], [1, 50], [2, 0], [3, 5], [0, 20], [2, 30], [4, 50], [1, 5]]) {
                rsmkit.state.setFactor(j, value);
                found.push(rsmkit.state.point.slice());
            }
            return found;
        }""")
    )
    assert np.abs(walked[:, :4].sum(axis=1) - 100).max() <= 1e-12 * 100
    assert space.contains(walked).all()
    assert (walked[[0, 1, 2, 3], [0, 1, 2, 3]] == [70, 50, 0, 5]).all()  # reached, the others gave way
    held = mixed_page.evaluate("""() => {
        rsmkit.state.set({ point: rsmkit.state.middle(), held: [1] });
        rsmkit.state.setFactor(0, 30);
        return rsmkit.state.point;
    }""")
    middle = reference_point(space, None)
    assert held[1] == middle[1]
    assert held[2] / held[3] == pytest.approx(middle[2] / middle[3], rel=1e-12)
    found = mixed_page.evaluate("rsmkit.state.set({ goals: { y: { goal: 'max' } } }); rsmkit.optimise.best()")
    assert sum(found["point"][:4]) == pytest.approx(100, abs=1e-10)
    assert found["point"][1] == middle[1]


def test_on_the_triangle_and_on_slices_the_design_keeps_the_sum_and_what_is_held(mixed, mixed_page):
    space, surface = mixed.space, mixed.surfaces["y"]
    middle = reference_point(space, None)
    mixed_page.click("text=Contours")
    box = mixed_page.locator("#ternary svg.map")
    box.focus()
    for key in ("ArrowUp", "ArrowRight", "ArrowRight"):
        mixed_page.keyboard.press(key)
    walked = np.array(mixed_page.evaluate("rsmkit.state.point"))
    step = (middle[:3].sum() - 25.0) / 100  # a hundredth of the triangle above the least amounts, 20, 5 and 0
    np.testing.assert_allclose(walked[:3] - middle[:3], np.array([1, -2.5, 1.5]) * step, rtol=1e-9)
    np.testing.assert_array_equal(walked[3:], middle[3:])
    frame = box.bounding_box()
    for across, down in ((0.5, 0.4), (0.99, 0.9), (0.3, 0.05)):  # inside, and beyond two bounds
        mixed_page.mouse.move(frame["x"] + across * frame["width"], frame["y"] + down * frame["height"])
        mixed_page.mouse.down()
        mixed_page.mouse.up()
        point = np.array(mixed_page.evaluate("rsmkit.state.flush(); rsmkit.state.point"))
        assert abs(point[:4].sum() - 100) <= 1e-12 * 100
        assert space.contains(point[None]).all()
        np.testing.assert_array_equal(point[3:], middle[3:])
    assert mixed_page.locator("#ternary .levels text").count() > 3
    mixed_page.locator("#ternary select").nth(1).select_option("3")  # d in the place of a
    assert "&t=d;b;c" in mixed_page.evaluate("rsmkit.state.flush(); rsmkit.state.hash()")
    mixed_page.wait_for_selector("#ternary svg[aria-label^='Contours of y over d, b, c']")
    for x, y in ((0, 1), (2, 4)):
        mixed_page.evaluate("([x, y]) => rsmkit.state.set({ x, y, point: rsmkit.state.middle() })", [x, y])
        grid = mixed_page.evaluate("rsmkit.slice.grid()")
        inside = np.argwhere(np.array(grid["room"]) > 1e-6)
        assert 100 < len(inside) <= 625
        for row, column in inside[:: len(inside) // 9]:
            placed = middle.copy()
            placed[[x, y]] = grid["xs"][column], grid["ys"][row]
            others = [j for j in range(4) if j not in (x, y)]
            placed[others] *= (100 - placed[[j for j in range(4) if j in (x, y)]].sum()) / placed[
                others
            ].sum()
            if (placed[others] >= space.lows[others]).all() and (placed[others] <= space.highs[others]).all():
                assert grid["z"][row][column] == pytest.approx(surface.predict(placed[None])[0], rel=1e-11)
    mixed_page.click("text=Profile")
    mixed_page.wait_for_selector("#traces .chart[data-drawn]")
    assert mixed_page.locator("#traces .legend span").count() == 4
