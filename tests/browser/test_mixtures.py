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
