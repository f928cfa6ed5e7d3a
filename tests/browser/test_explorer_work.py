"""What loading and dragging make the explorer compute and draw, counted in a real browser."""

import numpy as np
import pytest
from browser_page import Calls, finish, patient_page, show

SLICE = 25 * 25
TERMS, TOUCHED = 10, 4  # of a quadratic of three factors, and those of them that one factor is in


def line_terms(places):
    """Terms computed along a line: all at its start, then those that change."""
    return TERMS + places * TOUCHED


def profile_terms(responses, objectives):
    """Terms computed for the profiles along one factor, for polynomials and objectives of all responses."""
    return responses * (line_terms(43) + line_terms(15)) + objectives * (
        responses * line_terms(43) + line_terms(15)
    )


def test_loading_computes_what_it_shows_and_draws_what_is_in_sight(browser, page_path, findings):
    page = patient_page(browser, viewport={"width": 1280, "height": 2000})
    calls = Calls(page)
    page.goto(f"file://{page_path}")
    finish(page)
    made = calls.take()
    looked = 1 + 2 * 3 + 2**3  # middle, ends and corners of the box, for the range of every quantity
    lines = len(findings.optima[1].front)  # parallel coordinates
    # Two responses, the objective computed from both; the contours are in a view that is not chosen.
    points = (2 + 2) * (looked + lines) + 2 * len(findings.runs)
    computed = 3 * profile_terms(2, 1) + TERMS * points
    # and single values in words and tables
    assert computed <= made["models.js", "fillTerm"] <= computed + 100 * TERMS
    assert made["profiler.js", "build"] == made["models.js", "build"] == 1
    assert made["slice.js", "make"] == 0
    drawn = page.evaluate("[...document.querySelectorAll('[data-drawn]')].map((e) => e.className)")
    assert drawn == ["profiler chart"]
    page.context.close()


@pytest.mark.parametrize("path", ["page_path", "large_path"])
def test_a_drag_computes_and_draws_what_changes_once_from_the_first(open_page, request, path):
    page = open_page(
        request.getfixturevalue(path), viewport={"width": 880, "height": 9000}
    )  # all is in sight
    calls = Calls(page)
    page.reload()  # Chromium counts a loop that it is just compiling twice, unless it counts from the start
    show(page, "#contours .chart")
    finish(page)
    page.evaluate("performance.now = () => 0")  # no time passes: every chart is drawn within the frame
    k, q = page.evaluate("[rsmkit.data.factors.length, rsmkit.study.quantities.length]")
    low, high = page.evaluate("(({ low, high }) => [low, high])(rsmkit.data.factors.at(-1))")
    calls.take()
    drags = []
    for share in (0.2, 0.5, 0.8):
        # The contours hold the last factor: every view changes. The pointer moves three times in the frame.
        values = (low + (share + np.array([-0.02, -0.01, 0.0])) * (high - low)).tolist()
        page.evaluate(
            "([j, values]) => { for (const value of values) rsmkit.state.setFactor(j, value); "
            "return new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))); }",
            [k - 1, values],
        )
        drags.append(calls.take())
    for made in drags:
        assert made["state.js", "notify"] == 1
        if path == "page_path":
            shown = ((k - 1) * profile_terms(2, 1) + 2 * 25 * line_terms(25)) / TERMS
            computed = made["models.js", "fillTerm"] / TERMS
        else:
            shown, computed = (k - 1) * q * (25 + 7) + SLICE, made["processes.js", "correlation"] / 300
            # what costs most: a forward substitution for each band, and for each interval in words and tables
            assert (k - 1) * q < made["processes.js", "variances"] <= (k - 1 + 6) * q
        assert shown < computed <= shown + 20 * q  # single values in words, tables, lines and rings
        assert made["profiler.js", "draw"] == (k - 1) * q
        assert made["slice.js", "make"] == made["surface.js", "quads"] == made["contours.js", "move"] == 1
        assert made["contours.js", "paint"] == made["profiler.js", "build"] == made["plot.js", "draw"] == 0
        # profiler, contours, surface; scene, front
        assert made["charts.js", "draw"] == (5 if path == "page_path" else 3)
        levels = 14 + 1  # of the contours, each with a band, a label and a line
        assert made["bands.js", "region"] <= levels + 1
        # elements: bands, labels, stars, limits, and the table of designs, whose rows have a head and a cell
        assert made["format.js", "fill"] <= 2 * levels + 1 + 8 + 3 * (k + q) + 10


def test_charts_that_take_long_are_drawn_in_frames_of_their_own(open_page, page_path):
    page = open_page(page_path, viewport={"width": 880, "height": 9000})
    show(page, "#contours .chart")
    finish(page)
    frames = page.evaluate(
        """() => new Promise((done) => {
        let clock = 0, frame = 0;
        const frames = [];
        const slowly = (work) => (...given) => { clock += 100; frames.push(frame); return work(...given); };
        performance.now = () => clock;
        rsmkit.scene.draw = slowly(rsmkit.scene.draw);
        rsmkit.slice.grid = slowly(rsmkit.slice.grid);
        rsmkit.state.setFactor(2, 123);
        const next = () => { frame++; frame < 10 ? requestAnimationFrame(next) : done(frames); };
        requestAnimationFrame(next);
        })"""
    )
    assert len(frames) == 3  # contours, surface, scene
    assert len(set(frames)) == 3
