"""Edges of overall desirability are drawn where they are, however steeply it falls there."""

import numpy as np
import pytest

pytestmark = [pytest.mark.browser, pytest.mark.slow]

NODES = 25
# Two quantities over a square, wished in several ways; the traced line of a level, in shares of the side.
TRACED = """({ goals, left, below, level, nodes }) => {
    rsmkit.study.quantities = [["left", left], ["below", below]]
        .map(([key, values]) => ({ key, values, range: [0, 1], value: () => 0.5 }));
    rsmkit.state.goals = goals;
    const grids = Object.fromEntries(rsmkit.study.quantities.map((q) => [q.key, q.values]));
    const { reach, rise, z, near } = rsmkit.cliffs.drawn(rsmkit.goals.quantity(), (q) => grids[q.key]);
    const at = Array.from({ length: 2 * nodes - 1 }, (_, i) => 1e4 * i / (2 * nodes - 2));
    const { edge } = rsmkit.bands.region(...reach(level), at, at);
    const line = [...edge.matchAll(/[ML]([-0-9.e]+) ([-0-9.e]+)/g)].map((m) => [m[1] / 1e4, m[2] / 1e4]);
    return { line, z, rise, near: near(11, 11) };
}"""
SMOOTH = {"left": {"goal": "max", "low": 0, "high": 1}, "below": {"goal": "min", "low": 0, "high": 1}}
UNEVEN = {
    "left": {"goal": "max", "low": 0, "high": 1, "importance": 5, "weight": 0.5},
    "below": {"goal": "min", "low": 0, "high": 1, "weight": 2},
}
RANGED = {"left": {"goal": "max", "low": 0, "high": 1}, "below": {"goal": "range", "low": -5, "high": 0.613}}


def planes():
    """Two tilted planes over a square: the first is nothing along a line that crosses the grid obliquely."""
    x, y = np.meshgrid(np.linspace(0, 1, NODES), np.linspace(0, 1, NODES))
    return x - 0.37 * y - 0.21, 0.3 * x + 0.55 * y - 0.1


def desirability(goals, left, below):
    if goals is RANGED:
        return np.clip(left, 0, 1) * (below <= 0.613)
    if goals is UNEVEN:
        return np.clip(left, 0, 1) ** (0.5 * 5 / 6) * np.clip(1 - below, 0, 1) ** (2 / 6)
    return np.sqrt(np.clip(left, 0, 1) * np.clip(1 - below, 0, 1))


@pytest.mark.parametrize(
    ("goals", "level"),
    [
        (SMOOTH, 0.05),
        (SMOOTH, 0.3),
        (SMOOTH, 0.5),
        (UNEVEN, 0.05),
        (UNEVEN, 0.4),
        (RANGED, 0.05),
        (RANGED, 0.2),
    ],
)
def test_a_line_of_equal_desirability_is_where_it_is(open_page, page_path, goals, level):
    left, below = planes()
    page = open_page(page_path)
    got = page.evaluate(
        TRACED,
        {"goals": goals, "left": left.tolist(), "below": below.tolist(), "level": level, "nodes": NODES},
    )
    assert np.allclose(got["z"], desirability(goals, left, below), rtol=0, atol=1e-12)
    x, y = np.array(got["line"]).T
    assert len(x) > 20
    # Within a tenth of a cell of the page's grid (a tenth of 1/24) the true desirability is above the level
    # on one side and below on the other.
    around = [
        (x + 0.1 / 24 * np.cos(a), y + 0.1 / 24 * np.sin(a))
        for a in np.linspace(0, 2 * np.pi, 12, endpoint=False)
    ]
    if goals is RANGED:  # but where two edges meet, two cells of the finer grid about it
        meet = np.hypot(0.3 * x + 0.55 * y - 0.713, x - 0.37 * y - 0.21 - level) < 0.6 / 24
        around = [(u[~meet], v[~meet]) for u, v in around]
        assert meet.sum() < 10
    true = np.array([desirability(goals, u - 0.37 * v - 0.21, 0.3 * u + 0.55 * v - 0.1) for u, v in around])
    assert np.all(true.max(0) >= level)
    assert np.all(true.min(0) < level)
