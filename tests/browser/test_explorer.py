"""The explorer page in a real browser: its numbers are Python's, its views move together, nothing leaks."""

import ast
import json
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from browser_page import Calls, address, finish, patient_page, settle, show
from toy_surface import ROW, RadialSurface

from rsmkit.language.browser_formula import browser_formula
from rsmkit.language.expression import parse_constraint
from rsmkit.report.explorer.explorer_page import write_explorer
from rsmkit.surfaces.estimation.fit_data import FitData
from rsmkit.surfaces.fitted_response import FittedResponse
from rsmkit.surfaces.kinds import KINDS

pytestmark = [pytest.mark.browser, pytest.mark.slow]

WHOLE_STATE = "['point', 'pins', 'x', 'y', 'quantity', 'goals', 'overlay'].map((key) => rsmkit.state[key])"
PHONE = {"viewport": {"width": 390, "height": 844}, "device_scale_factor": 2}


def point_of(page):
    return np.array(page.evaluate("rsmkit.state.point"))


def ring_of(page, space):
    """Values of the two factors at the ring of the contours, read off its place among the axes."""
    frame = page.locator("#contours .axis").bounding_box()
    ring = page.locator("#contours .ring").bounding_box()
    x = (ring["x"] + ring["width"] / 2 - frame["x"]) / frame["width"]
    y = 1 - (ring["y"] + ring["height"] / 2 - frame["y"]) / frame["height"]
    low, high = space.lows, space.highs
    return low[0] + x * (high[0] - low[0]), low[1] + y * (high[1] - low[1])


def test_surfaces_and_intervals_equal_pythons(page, findings):
    points = np.random.default_rng(3).uniform(findings.space.lows, findings.space.highs, (40, 3))
    points[:8] = findings.runs.points[:8]
    surfaces = {**findings.surfaces, **findings.objective_surfaces}
    assert page.evaluate("rsmkit.study.quantities.map((q) => q.key)") == list(surfaces)
    got = page.evaluate(
        "(points) => rsmkit.study.quantities.map((q) => points.map((p) => [q.value(p), ...q.interval(p)]))",
        points.tolist(),
    )
    for surface, values in zip(surfaces.values(), got, strict=True):
        np.testing.assert_allclose(values, np.transpose(surface.predict(points, interval=0.95)), rtol=1e-12)


def test_leverage_and_constraints_equal_pythons(page, findings):
    points = np.random.default_rng(4).uniform(findings.space.lows, findings.space.highs, (30, 3))
    reach, margin = np.array(
        page.evaluate(
            "(points) => [points.map(rsmkit.study.reach), points.map(rsmkit.study.margin)]", points.tolist()
        )
    )
    runs = findings.runs.points
    expected = [s.leverage(points) / s.leverage(runs).max() for s in findings.surfaces.values()]
    np.testing.assert_allclose(reach, np.max(expected, axis=0), rtol=1e-12)
    # the room is linear, so that interpolation in its table is exact
    np.testing.assert_allclose(margin, findings.functions["room"](points), rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize(
    "text",
    [
        "a - b - -2 >= b ** a / 3",
        "min(a, b, 1.5) + max(a, pi) <= tanh(a) * sqrt(b)",
        "log(a) - abs(-b) * exp(-a) >= 0",
    ],
)
def test_formulas_equal_pythons(page, text):
    margin = parse_constraint(text)[0].margin
    values = {"a": 0.7, "b": 2.3}
    got = page.evaluate(
        "([formula, values]) => rsmkit.models.compileFormula(formula)((name) => values[name])",
        [browser_formula(margin), values],
    )
    assert got == pytest.approx(float(margin(values)), rel=1e-14)


def test_dragging_a_profile_moves_every_view(open_page, page_path, findings):
    page = open_page(page_path, viewport={"width": 1280, "height": 2400})
    show(page, "#contours .chart")
    before = point_of(page)
    cell = page.locator("#profiler svg.cell").first.bounding_box()
    page.mouse.move(cell["x"] + 40, cell["y"] + 30)
    page.mouse.down()
    for step in range(6):
        page.mouse.move(cell["x"] + 60 + 30 * step, cell["y"] + 30)
    page.mouse.up()
    settle(page)
    after = point_of(page)
    # the drawing area of a cell starts 4 pixels inside it
    share = (60 + 150 - 4) / (cell["width"] - 8)
    assert after[0] == pytest.approx(10 + 20 * share, abs=0.1)
    assert (after[1:] == before[1:]).all()
    assert float(page.get_by_role("slider", name="speed").input_value()) == pytest.approx(after[0], abs=1e-9)
    assert ring_of(page, findings.space) == pytest.approx(tuple(after[:2]), abs=0.04)  # a pixel
    assert json.loads(page.locator("canvas.stage").get_attribute("data-factors"))["speed"] == pytest.approx(
        after[0]
    )
    assert page.locator("#pins tbody tr").first.inner_text().split()[-1] == f"{after[0]:.2f}".rstrip("0")


# A profile has 43 points, and a band that is computed at every third of them (at every sixth among more than
# four factors); the slice of contours and surface has 25 x 25.
SLICE = 25 * 25


def profile_rows(responses, objectives):
    """Rows of terms behind the profiles along one factor, for polynomials and objectives of all responses.

    An interval takes two: one for the leverage, one for the mean.
    """
    return responses * (43 + 2 * 15) + objectives * (43 * responses + 2 * 15)


def test_loading_computes_what_it_shows_and_draws_what_is_in_sight(browser, page_path, findings):
    page = patient_page(browser, viewport={"width": 1280, "height": 2000})
    calls = Calls(page)
    page.goto(f"file://{page_path}")
    finish(page)
    made = calls.take()
    looked = 1 + 2 * 3 + 2**3  # middle, ends and corners of the box, for the range of every quantity
    lines = len(findings.optima[1].front)  # parallel coordinates
    # Two responses, the objective computed from both. The profiles are drawn twice: the second time warms up.
    computed = 2 * 3 * profile_rows(2, 1) + 2 * SLICE + (2 + 2) * (looked + lines)
    assert computed <= made["models.js", "fillTerms"] <= computed + 100  # single values in words and tables
    assert made["profiler.js", "build"] == made["slice.js", "make"] == made["models.js", "build"] == 1
    drawn, seen, charts = page.evaluate(
        "[(e) => e.dataset.drawn, "
        "(e) => e.checkVisibility() && e.getBoundingClientRect().top < innerHeight + 150, "
        "() => true].map((test) => [...document.querySelectorAll('.chart')].filter(test).length)"
    )
    assert 0 < drawn == seen < charts
    page.context.close()


@pytest.mark.parametrize("path", ["page_path", "large_path"])
def test_a_drag_computes_and_draws_what_changes_once_from_the_first(open_page, request, path):
    page = open_page(request.getfixturevalue(path), viewport={"width": 1280, "height": 3000})
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
            shown, computed = (k - 1) * profile_rows(2, 1) + 2 * SLICE, made["models.js", "fillTerms"]
        else:
            shown, computed = (k - 1) * q * (43 + 8) + SLICE, made["models.js", "correlation"] / 300
            # what costs most: a forward substitution for each band, and for each interval in words and tables
            assert (k - 1) * q < made["models.js", "variances"] <= (k - 1 + 5) * q
        assert shown < computed <= shown + 15 * q  # single values in words, tables, lines and rings
        assert made["profiler.js", "draw"] == (k - 1) * q
        assert made["slice.js", "make"] == made["surface.js", "quads"] == made["contours.js", "move"] == 1
        assert (
            made["contours.js", "paint"] == made["profiler.js", "build"] == made["charts.js", "dressed"] == 0
        )
        assert made["charts.js", "draw"] == (
            4 if path == "page_path" else 2
        )  # contours, surface; scene, front
        levels = 14 + 1  # of the contours, each with a band, a label and a line
        assert made["bands.js", "region"] <= levels + 1
        # elements: bands and labels, and the table of designs, in which a row has a head and a cell
        assert made["format.js", "fill"] <= 2 * levels + 1 + 3 * (k + q) + 10


def test_charts_that_take_long_are_drawn_in_frames_of_their_own(open_page, page_path):
    page = open_page(page_path, viewport={"width": 1280, "height": 3000})
    show(page, "#contours .chart")
    finish(page)
    frames = page.evaluate(
        """() => new Promise((done) => {
        let clock = 0, frame = 0;
        const frames = [];
        const slowly = (work) => (...given) => { clock += 100; frames.push(frame); return work(...given); };
        performance.now = () => clock;
        rsmkit.scene.draw = slowly(rsmkit.scene.draw);
        Plotly.relayout = slowly(Plotly.relayout);
        rsmkit.state.setFactor(2, 123);
        const next = () => { frame++; frame < 10 ? requestAnimationFrame(next) : done(frames); };
        requestAnimationFrame(next);
        })"""
    )
    assert len(frames) == len(set(frames)) == 2


def test_keyboard_alone_moves_factors(page):
    slider = page.get_by_role("slider", name="angle")
    page.evaluate("rsmkit.state.setFactor(1, 0); rsmkit.state.flush()")
    slider.focus()
    for key in ("ArrowRight", "ArrowRight", "ArrowLeft", "PageUp"):
        page.keyboard.press(key)
    settle(page)
    assert point_of(page)[1] == pytest.approx(0.05 + 0.5)  # a step is 1/200 of the range of 10
    page.keyboard.press("End")
    settle(page)
    assert point_of(page)[1] == 5.0
    page.get_by_role("button", name="Optimum cheapest").focus()
    page.keyboard.press("Enter")
    settle(page)
    assert slider.get_attribute("aria-valuetext")


def test_tab_reaches_everything_that_can_be_operated(open_page, page_path):
    page = open_page(page_path)
    show(page, "#contours .chart")
    page.evaluate("scrollTo(0, 0)")
    wanted = page.evaluate(
        "[...document.querySelectorAll('button, select, input, summary, [tabindex=\"0\"]')]"
        ".filter((e) => !e.disabled && e.checkVisibility() && !e.closest('.modebar')).length"
    )
    reached = []
    for _ in range(wanted + 5):
        page.keyboard.press("Tab")
        place = page.evaluate(
            "(() => { const e = document.activeElement; window.seen ??= []; const i = seen.indexOf(e); "
            "if (e === document.body || i >= 0) return null; seen.push(e); "
            "return getComputedStyle(e).outlineStyle; })()"
        )
        if place is None:
            break
        reached.append(place)
    assert len(reached) >= wanted
    assert set(reached) == {"solid"}  # the place can be seen


def test_every_view_answers_to_the_keyboard(page, findings):
    show(page, "#contours .chart")
    page.get_by_role("button", name="Centre").click()
    settle(page)
    before = point_of(page)
    page.locator("svg.map").focus()
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowUp")
    settle(page)
    np.testing.assert_allclose(point_of(page) - before, [0.2, 0.1, 0.0], atol=1e-9)  # 1/100 of each range
    assert "angle 0.1: cheapest " in page.locator("#announcer").text_content()
    page.get_by_role("slider", name="Design on the front of both").focus()
    page.keyboard.press("End")
    settle(page)
    dearest = max(findings.optima[1].front, key=lambda candidate: candidate.objectives[0])
    np.testing.assert_allclose(point_of(page), dearest.point)
    axis = page.get_by_role("group", name="Axis angle")
    axis.focus()
    for _ in range(4):
        page.keyboard.press("ArrowUp")
    settle(page)
    angles = np.array([candidate.point[1] for candidate in findings.optima[1].front])
    least = angles.min() + 0.2 * np.ptp(angles)
    assert len(page.evaluate("rsmkit.state.brush.points")) == (angles >= least - 1e-12).sum()
    page.keyboard.press("Escape")
    settle(page)
    assert page.evaluate("rsmkit.state.brush") is None
    page.get_by_role("button", name="Pin this design").focus()
    page.keyboard.press("Space")
    settle(page)
    assert len(page.evaluate("rsmkit.state.pins")) == 1
    surface = page.locator("canvas.solid")
    surface.scroll_into_view_if_needed()
    picture = "document.querySelector('canvas.solid').toDataURL()"
    still = page.evaluate(picture)
    surface.focus()
    page.keyboard.press("ArrowLeft")
    settle(page)
    assert page.evaluate(picture) != still


def test_interactions_are_profiles_at_the_ends_of_another_factor(page, findings):
    page.get_by_label("Interactions with").select_option(label="load")
    settle(page)
    cells = page.locator("#profiler svg.cell")
    assert [cells.nth(j).locator(".others path").count() for j in range(3)] == [2, 2, 0]
    # where the two profiles end: the drawing area reaches from 6 to 88 pixels, with margins of 6 %
    point = np.tile(point_of(page), (2, 1))
    point[:, 0], point[:, 2] = 30.0, [100.0, 400.0]
    low, high = page.evaluate("rsmkit.study.quantities[0].range")
    margin = 0.06 * (high - low)
    toY = 88 - 82 * (findings.surfaces["cost"].predict(point) - low + margin) / (high - low + 2 * margin)
    ends = [cells.nth(0).locator(".others path").nth(i).get_attribute("d").split(" ")[-1] for i in (0, 1)]
    np.testing.assert_allclose([float(text) for text in ends], toY, atol=0.06)


def test_optimum_button_goes_there_and_far_corners_extrapolate(page, findings):
    badge = page.get_by_text("extrapolating", exact=True)
    page.get_by_role("button", name="Centre").click()
    settle(page)
    np.testing.assert_allclose(point_of(page), [20.0, 0.0, 250.0])
    assert not badge.is_visible()
    page.get_by_role("button", name="Optimum cheapest").click()
    settle(page)
    np.testing.assert_allclose(point_of(page), findings.optima[0].point)
    page.evaluate("rsmkit.state.set({ point: [60, 20, 900] }); rsmkit.state.flush()")
    assert badge.is_visible()


def test_the_address_holds_the_whole_state(open_page, page_path):
    page = open_page(page_path)
    page.evaluate("rsmkit.state.setFactor(0, 17.123456789012345)")
    page.get_by_role("button", name="Pin this design").click()
    page.evaluate(
        "rsmkit.state.set({ point: [11, -2.5, 333], x: 2, y: 0, quantity: 'wear', "
        "goals: { '0.5*cost + 2*wear': 'min' }, overlay: 1 })"
    )
    settle(page)
    fragment = address(page)
    state = page.evaluate(WHOLE_STATE)
    other = open_page(page_path, fragment)
    copy = other.evaluate(WHOLE_STATE)
    assert copy == state
    assert state[0] == [11, -2.5, 333]
    assert state[1][0][0] == 17.123456789012345
    assert state[2:] == [2, 0, "wear", {"0.5*cost + 2*wear": "min"}, 1]


@pytest.mark.parametrize(
    "fragment",
    ["#p=1,2", "#p=a,b,c&x=nothing", "#q=%E0%A4&pins=;;1", "#p=Infinity,0,0", "#goals=min:nothing"],
)
def test_a_broken_address_is_ignored(page, findings, fragment):
    address(page)  # nothing is written any more
    heard = page.evaluate(
        "(fragment) => new Promise((done) => { location.hash = fragment; "
        "addEventListener('hashchange', () => done(location.hash), { once: true }); })",
        fragment,
    )
    assert heard == fragment
    np.testing.assert_allclose(point_of(page), findings.optima[0].point)
    assert page.evaluate("[rsmkit.state.x, rsmkit.state.y, rsmkit.state.pins.length]") == [0, 1, 0]
    assert page.evaluate("rsmkit.state.goals") == {}


def test_brushing_the_front_lights_up_the_designs(page, findings):
    front = ".chart[aria-label^='Pareto']"
    show(page, front)
    rows = [0, 2, 5]
    page.evaluate(
        "([s, rows]) => document.querySelector(s).emit('plotly_selected', "
        "{ points: rows.map((pointIndex) => ({ curveNumber: 0, pointIndex })) })",
        [front, rows],
    )
    settle(page)
    brushed = np.array(page.evaluate("rsmkit.state.brush.points"))
    np.testing.assert_allclose(brushed, [findings.optima[1].front[row].point for row in rows])
    for lit in ("#parallel .lit", "#contours .lit-dot", "#profiler .lit-dot >> nth=0"):
        assert page.locator(lit).get_attribute("d").count("M") == 3
    assert page.evaluate("(s) => document.querySelector(s).data[0].selectedpoints", front) == rows
    page.get_by_role("button", name="Clear brush").click()
    settle(page)
    assert page.locator("#parallel .lit").get_attribute("d") == ""


def test_brushing_an_axis_keeps_the_designs_in_range(page, findings):
    page.locator("#parallel").scroll_into_view_if_needed()
    grip = page.locator("#parallel .axis-grip").nth(0).bounding_box()
    page.mouse.move(grip["x"] + 16, grip["y"] + 8)  # the upper end of the axis
    page.mouse.down()
    page.mouse.move(grip["x"] + 16, grip["y"] + grip["height"] / 2)
    page.mouse.up()
    settle(page)
    speeds = np.array([candidate.point[0] for candidate in findings.optima[1].front])
    middle = (speeds.min() + speeds.max()) / 2
    kept = np.array(page.evaluate("rsmkit.state.brush.points"))[:, 0]
    assert kept.min() >= middle - 0.02 * np.ptp(speeds)
    assert len(kept) == pytest.approx((speeds >= middle).sum(), abs=0.03 * len(speeds))


def test_pins_are_compared_and_removed(page, findings):
    page.get_by_role("button", name="Centre").click()
    settle(page)
    page.get_by_role("button", name="Pin this design").click()
    page.get_by_role("button", name="Optimum cheapest").click()
    settle(page)
    row = page.locator("#pins tbody tr", has_text="running cost").inner_text()
    centre, best = (
        float(s) for s in findings.surfaces["cost"].predict([[20.0, 0.0, 250.0], findings.optima[0].point])
    )
    change = 100 * (best - centre) / centre
    assert float(row.split("(")[1].split(" %")[0].replace("−", "-")) == pytest.approx(change, abs=1.0)
    page.get_by_role("button", name="Unpin pin 1").click()
    settle(page)
    assert page.locator("#pins thead th").count() == 1


def test_the_design_is_copied_exactly(page):
    page.evaluate("navigator.clipboard.writeText = async (text) => { window.copied = text; }")
    page.evaluate("rsmkit.state.set({ point: [12.3456789012345678, -0.1, 200] }); rsmkit.state.flush()")
    for name in ("TOML", "Python", "link"):
        page.get_by_role("button", name=f"Copy as {name}").click()
        page.wait_for_function(
            "document.getElementById('announcer').textContent.endsWith(name)".replace("name", repr(name))
        )
        text = page.evaluate("window.copied")
        if name == "link":
            assert "#p=12.345678901234567,-0.1,200&" in text
        else:
            read = tomllib.loads(text) if name == "TOML" else ast.literal_eval(text)
            assert read == {"speed": 12.345678901234567, "angle": -0.1, "load": 200}


def test_refinement_is_told_wave_by_wave(page):
    show(page, "#refinement .chart")
    runs, best = page.evaluate("document.querySelector('#refinement .chart').data.map((t) => [t.x, t.y])")
    assert runs == [[18, 19, 20], [9.0, None, 7.5]]
    assert best == [[19, 20], [9.0, 7.5]]
    assert page.locator("#refinement li").all_inner_texts() == [
        "2 runs in the whole box", "1 run", "stopped after 3 runs: no model promises a gain; objective 7.5",
    ]  # fmt: skip
    page.get_by_role("button", name="Go to the refined design").click()
    settle(page)
    np.testing.assert_allclose(point_of(page), [12.5, 1.0, 222.0])


def test_texts_of_the_user_stay_texts(page):
    assert page.title() == "Wear & tear <b>study</b>: explorer"
    assert page.locator("img").count() == 0
    assert page.get_by_role("heading", level=1).inner_text() == "Wear & tear <b>study</b>"


def test_verdict_stands_first_and_without_scripts(browser, page_path, findings):
    page = patient_page(browser, java_script_enabled=False)
    page.goto(f"file://{page_path}")
    text = page.get_by_role("region", name="Verdict").inner_text()
    confirmation = findings.verification.searches[0]
    assert confirmation.verdict in text
    assert confirmation.sentence[1:] in text
    assert f"{len(findings.runs)} for the surfaces and 1 to verify" in text
    page.get_by_text("Predicted against actual").click()
    cells = page.get_by_role("row", name="running cost").get_by_role("cell").all_inner_texts()
    cost = confirmation.responses["cost"]
    assert [float(text) for text in cells[0::2]] == pytest.approx([cost.predicted, cost.actual], rel=1e-4)
    assert cells[3] == f"{100 * abs(cost.actual - cost.predicted) / abs(cost.actual):.2f} %"
    page.context.close()


def test_scene_follows_the_design_and_replays_a_run(open_page, page_path):
    page = open_page(page_path, reduced_motion="reduce")
    page.locator("canvas.stage").scroll_into_view_if_needed()
    page.wait_for_function("document.querySelector('canvas.stage').dataset.factors")
    page.evaluate("rsmkit.state.setFactor(2, 123)")
    settle(page)
    stage = page.locator("canvas.stage")
    assert json.loads(stage.get_attribute("data-factors"))["load"] == 123
    assert json.loads(stage.get_attribute("data-row")) is None
    page.get_by_label("Replay", exact=True).select_option(label="cheapest")
    time = page.get_by_role("slider", name="Time of the replay")
    time.fill("2")
    settle(page)
    # halfway between t = 1 s, 4 m and t = 3 s, 0 m
    assert json.loads(stage.get_attribute("data-row")) == {"time_s": 2, "height_m": 2}


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_ink_is_readable_on_paper(open_page, page_path, scheme):
    page = open_page(page_path, color_scheme=scheme)
    style = "getComputedStyle(document.body)"
    ink, paper = (
        [int(v) for v in page.evaluate(f"{style}.{key}").removeprefix("rgb(").removesuffix(")").split(",")]
        for key in ("color", "backgroundColor")
    )
    assert (luminance(paper) > 0.5) == (scheme == "light")
    bright, dim = sorted([luminance(ink), luminance(paper)], reverse=True)
    assert (bright + 0.05) / (dim + 0.05) > 7  # WCAG 2.1, level AAA
    page.get_by_role("button", name="Switch between light and dark").click()
    changed = page.evaluate(f"{style}.backgroundColor")
    assert changed != f"rgb({', '.join(map(str, paper))})"


def test_paper_gets_every_chart_in_light_colours(open_page, page_path):
    page = open_page(page_path, color_scheme="dark")
    background = "getComputedStyle(document.body).backgroundColor"
    page.wait_for_function("typeof Plotly === 'object'")
    dark = page.evaluate(background)
    page.evaluate("window.dispatchEvent(new Event('beforeprint'))")
    assert page.evaluate(background) == "rgb(255, 255, 255)"
    unseen = page.evaluate("[...document.querySelectorAll('.chart')].filter((e) => !e.dataset.drawn).length")
    assert unseen == 0
    page.evaluate("window.dispatchEvent(new Event('afterprint'))")
    assert page.evaluate(background) == dark


def luminance(colour):
    """Relative luminance of WCAG 2.1."""
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in (v / 255 for v in colour)]
    return float(np.dot([0.2126, 0.7152, 0.0722], linear))


@pytest.mark.parametrize("path", ["page_path", "plain_path"])
def test_a_telephone_needs_no_sideways_scroll(open_page, request, path):
    page = open_page(request.getfixturevalue(path), **PHONE)
    finish(page)
    charts = page.locator(".chart:visible")
    for i in range(charts.count()):
        charts.nth(i).scroll_into_view_if_needed()
        page.wait_for_function("(e) => e.dataset.drawn", arg=charts.nth(i).element_handle())
    assert page.evaluate("document.documentElement.scrollWidth") == 390


def test_page_is_whole_with_surfaces_alone(open_page, plain_path):
    page = open_page(plain_path)
    np.testing.assert_allclose(point_of(page), [20.0, 0.0, 250.0])
    show(page, "#contours .chart")
    show(page, "#fit .chart")
    assert page.locator("#object, #searches, #refinement, #front-1").count() == 0


def test_objectives_need_no_surface_of_their_own(open_page, findings, tmp_path):
    path = tmp_path / "explorer.html"
    write_explorer(path, replace(findings, objective_surfaces={}, verification=None))
    page = open_page(path)
    assert page.evaluate("rsmkit.state.quantity") == "0.5*cost + 2*wear"
    show(page, "#fit .chart")
    assert page.get_by_label("Surface of", exact=True).input_value() == "cost"


def test_a_surface_without_a_twin_in_the_page_leaves_the_rest_whole(
    open_page, findings, tmp_path, monkeypatch
):
    monkeypatch.setitem(KINDS, "radial", ROW)
    runs = findings.runs
    known = FitData(*(a[:14] for a in (runs.points, runs.y("wear"))))  # without the repeated centre
    radial = FittedResponse(RadialSurface(findings.space, "wear", known))
    path = tmp_path / "explorer.html"
    write_explorer(path, replace(findings, surfaces={**findings.surfaces, "wear": radial}))
    page = open_page(path)
    assert "This kind of surface cannot be drawn live here: wear" in page.locator("body").inner_text()
    cost, wear, both = page.evaluate("rsmkit.study.quantities.map((q) => q.value(rsmkit.state.point))")
    point = np.array(point_of(page))
    assert cost == pytest.approx(findings.surfaces["cost"].predict(point[None])[0], rel=1e-12)
    assert np.isnan([wear, both]).all()
    assert page.evaluate("rsmkit.study.reach(rsmkit.state.point)") <= 1
    for quantity in ("wear", "cost"):
        page.evaluate("(quantity) => rsmkit.state.set({ quantity })", quantity)
        settle(page)
        show(page, "#contours .chart")
        show(page, "#fit .chart")


def test_profiles_stop_where_a_value_is_unknown(open_page, page_path):
    page = open_page(page_path)
    page.evaluate(
        "() => { const q = rsmkit.study.quantities[0]; q.value = () => NaN; "
        "q.values = (point, j, values) => values.map((_, i) => (i < 20 ? NaN : 50)); "
        "rsmkit.state.setFactor(1, 2); }"
    )
    settle(page)
    trace = page.locator("#profiler svg.cell .trace").first.get_attribute("d")
    assert trace.count("L") == 43 - 20 - 1


def test_everything_to_operate_has_a_name(page):
    nameless = page.evaluate(
        "[...document.querySelectorAll('main button, main select, main input')].filter((e) => "
        "!e.textContent.trim() && !e.getAttribute('aria-label') && !e.labels?.length).length"
    )
    assert nameless == 0
    assert page.locator("[role=img]:not([aria-label])").count() == 0
