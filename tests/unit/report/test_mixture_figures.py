"""Figures of mixtures: what is drawn is what the data say."""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
import pytest

import rsmkit as rk
from rsmkit import plots
from rsmkit.errors import RsmkitError
from rsmkit.surfaces.statistics.mixtures.directions import component_effects, trace_curves

FLARE = Path(__file__).parents[2] / "data" / "mixtures" / "flare.csv"


@pytest.fixture(scope="module")
def flare():
    return rk.fit_table(FLARE, [], ["light"], mixture=["mg", "nano3", "sr", "binder"]).surfaces["light"]


@pytest.fixture(autouse=True)
def _no_figures_left():
    yield
    plt.close("all")


def test_the_triangle_has_the_region_and_the_runs_in_it(flare):
    ax = plt.figure().add_subplot()
    at = np.array([0.5, 0.21, 0.21, 0.08])
    best = np.array([0.6, 0.22, 0.1, 0.08])
    assert plots.ternary(flare, at=at, points=flare.data.points, optimum=best, ax=ax) is ax
    assert ax.get_title() == "light at binder = 0.08"
    marks = {
        line.get_marker(): np.column_stack(line.get_data())
        for line in ax.lines
        if line.get_marker() != "None"
    }
    filled = [line for line in ax.lines if line.get_marker() == "o" and line.get_color() == "white"]
    # of five runs with 0.08 binder the corners of the triangle are mg, nano3, sr at 0.72, 0.42, 0.42
    assert len(filled[0].get_xdata()) == 5
    share = (best[:3] - [0.4, 0.1, 0.1]) / 0.32
    np.testing.assert_allclose(
        marks["*"][0], [0.5 * share[0] + share[2], np.sqrt(0.75) * share[0]], atol=1e-12
    )
    outline = ax.patches[-1].get_xy()
    assert len(np.unique(np.round(outline, 9), axis=0)) == 4  # 0.4 <= mg <= 0.6 cuts the top off


def test_the_whole_triangle_starts_at_nothing(flare):
    ax = plots.ternary(flare, ["mg", "sr", "nano3"], whole=True)
    texts = {text.get_text() for text in ax.texts}
    assert {"mg", "sr", "nano3"} <= texts
    ax = plots.ternary(flare, at=[0.5, 0.21, 0.21, 0.08], whole=True)
    assert {"0.184", "0.736"} <= {text.get_text() for text in ax.texts}  # 0.2 and 0.8 of 0.92


def test_a_trace_is_the_prediction_along_its_direction(flare):
    ax = plots.trace(flare, direction="piepel")
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["mg", "nano3", "sr", "binder"]
    at = np.array([0.5, 0.2225, 0.2225, 0.055])
    amounts, response = trace_curves(flare, at)["binder"]
    rest = (1 - amounts[:, None]) * at[:3] / at[:3].sum()
    np.testing.assert_allclose(response, flare.predict(np.column_stack([rest, amounts])), rtol=1e-12)
    assert (amounts[0], amounts[-1]) == pytest.approx((0.03, 0.08))


def test_gradients_are_slopes_of_the_traces(flare):
    """Central differences: the surface is quadratic along a line, so they are exact but for rounding."""
    at = np.array([0.5, 0.2225, 0.2225, 0.055])
    for effect in component_effects(flare, at):
        j = flare.space.names.index(effect.component)
        along = -at / (1 - at[j])
        along[j] = 1.0
        ends = flare.predict(np.array([at + 1e-3 * along, at - 1e-3 * along]))
        assert effect.gradient == pytest.approx((ends[0] - ends[1]) / 2e-3, rel=1e-8)


def test_what_cannot_be_drawn_is_refused(flare):
    with pytest.raises(RsmkitError, match="three components"):
        plots.ternary(flare, ["mg", "sr"])
    with pytest.raises(RsmkitError, match="add up to"):
        plots.ternary(flare, at=[0.5, 0.2, 0.2, 0.2])
    plain = rk.fit_table(FLARE, ["mg", "sr"], ["light"], order=1).surfaces["light"]
    with pytest.raises(RsmkitError, match="no mixture"):
        plots.trace(plain)
    for draw in (lambda: plots.contours(flare, "mg", "sr"), lambda: plots.main_effects(flare)):
        with pytest.raises(RsmkitError, match="ternary"):
            draw()


def test_the_profiler_moves_components_along_cox_directions(flare):
    at = np.array([0.5, 0.2225, 0.2225, 0.055])
    panels = plots.profiler({"light": flare}, at)
    for j, (amounts, response) in enumerate(trace_curves(flare, at).values()):
        line = panels[0, j].lines[0]
        np.testing.assert_allclose(line.get_xdata(), amounts, rtol=1e-12)
        np.testing.assert_allclose(line.get_ydata(), response, rtol=1e-12)
