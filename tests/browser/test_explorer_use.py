"""The explorer under a reader's hands: keyboard, address, brushes, pins, the clipboard."""

import ast
import tomllib

import numpy as np
import pytest
from browser_page import address, choose, settle, show, until

WHOLE_STATE = "['point', 'pins', 'x', 'y', 'quantity', 'goals', 'overlay'].map((key) => rsmkit.state[key])"


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
        ".filter((e) => !e.disabled && e.tabIndex === 0 && e.checkVisibility()).length"
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
    choose(page, "#front-1")
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
    choose(page, "#pins")
    page.get_by_role("button", name="Pin this design").focus()
    page.keyboard.press("Space")
    settle(page)
    assert len(page.evaluate("rsmkit.state.pins")) == 1
    page.get_by_role("tab", name="Profile").focus()
    page.keyboard.press("ArrowRight")  # the tabs answer to arrows
    surface = page.locator("canvas.solid")
    surface.scroll_into_view_if_needed()
    picture = "document.querySelector('canvas.solid').toDataURL()"
    still = page.evaluate(picture)
    surface.focus()
    page.keyboard.press("ArrowLeft")
    settle(page)
    assert page.evaluate(picture) != still


def test_the_address_holds_the_whole_state(open_page, page_path):
    page = open_page(page_path)
    page.evaluate("rsmkit.state.setFactor(0, 17.123456789012345)")
    page.get_by_role("button", name="Pin this design").click()
    page.evaluate(
        "rsmkit.state.set({ point: [11, -2.5, 333], x: 2, y: 0, quantity: 'wear', "
        "goals: { wear: { goal: 'max', low: 3, importance: 2 } }, overlay: 1 })"
    )
    settle(page)
    fragment = address(page)
    state = page.evaluate(WHOLE_STATE)
    other = open_page(page_path, fragment)
    copy = other.evaluate(WHOLE_STATE)
    assert copy == state
    assert state[0] == [11, -2.5, 333]
    assert state[1][0][0] == 17.123456789012345
    assert state[2:] == [2, 0, "wear", {"wear": {"goal": "max", "low": 3, "importance": 2}}, 1]


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
    assert page.evaluate("rsmkit.state.goals") == {"0.5*cost + 2*wear": {"goal": "min"}}


def test_brushing_the_front_lights_up_the_designs(page, findings):
    show(page, "#front-1 .chart")
    plot = page.locator("#front-1 .plot").bounding_box()
    page.mouse.move(plot["x"] + 0.5 * plot["width"], plot["y"] + 5)
    page.mouse.down()
    page.mouse.move(plot["x"] + plot["width"] - 5, plot["y"] + plot["height"] - 45)
    page.mouse.up()
    settle(page)
    rows, brushed = page.evaluate("[rsmkit.state.brush.rows, rsmkit.state.brush.points]")
    front = findings.optima[1].front
    np.testing.assert_allclose(brushed, [front[row].point for row in rows])
    # a box over the right half of the plot holds the dearest designs
    kept = {front[row].objectives[0] for row in rows}
    assert 0 < len(rows) < len(front)
    assert min(kept) > max(c.objectives[0] for i, c in enumerate(front) if i not in rows)
    for lit in ("#parallel .lit", "#contours .lit-dot", "#profiler .lit-dot >> nth=0"):
        choose(page, lit.partition(" ")[0])
        settle(page)
        assert page.locator(lit).get_attribute("d").count("M") == len(rows)
    choose(page, "#parallel")
    page.get_by_role("button", name="Clear brush").click()
    settle(page)
    assert page.locator("#parallel .lit").get_attribute("d") == ""


def test_brushing_an_axis_keeps_the_designs_in_range(page, findings):
    choose(page, "#parallel")
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


def test_parallel_axes_fit_a_phone_or_say_that_there_are_more(open_page, page_path):
    page = open_page(page_path, viewport={"width": 390, "height": 844})
    page.locator("#parallel").scroll_into_view_if_needed()
    told = page.locator("#parallel p", has_text="more axes")
    beyond = "((e) => e.scrollWidth - e.clientWidth)(document.querySelector('#parallel .scroller'))"
    until(page, "document.querySelector('.parallel .axis')")
    assert page.evaluate(beyond) <= 0
    assert not told.is_visible()
    page.set_viewport_size({"width": 240, "height": 844})
    until(page, f"{beyond} > 0")
    assert told.is_visible()


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
        until(
            page,
            "document.getElementById('announcer').textContent.endsWith(name)".replace("name", repr(name)),
        )
        text = page.evaluate("window.copied")
        if name == "link":
            assert "#p=12.345678901234567,-0.1,200&" in text
        else:
            read = tomllib.loads(text) if name == "TOML" else ast.literal_eval(text)
            assert read == {"speed": 12.345678901234567, "angle": -0.1, "load": 200}


def test_everything_to_operate_has_a_name(page):
    nameless = page.evaluate(
        "[...document.querySelectorAll('main button, main select, main input')].filter((e) => "
        "!e.textContent.trim() && !e.getAttribute('aria-label') && !e.labels?.length).length"
    )
    assert nameless == 0
    assert page.locator("[role=img]:not([aria-label])").count() == 0


def test_a_true_run_at_the_current_design_is_told_with_its_values(page, findings):
    """What the surfaces predict may keep a limit that the truth breaks: both are said."""
    truth = findings.verification.searches[0].points[0].responses["cost"].actual
    page.evaluate("rsmkit.state.set({ point: rsmkit.state.pointOf(rsmkit.data.searches[0].factors) })")
    settle(page)
    told = page.inner_text("#current")
    assert "The true run made here gave running cost [EUR] " in told
    given = float(told.split("gave running cost [EUR] ")[1].split(",")[0])
    assert given == pytest.approx(truth, rel=1e-3)
    assert "it breaks" not in told
    page.evaluate(
        "(limit) => rsmkit.state.set({ limits: { ...rsmkit.state.limits, cost: [null, limit] } })",
        truth - 1.0,
    )
    settle(page)
    broken = page.inner_text("#current").split("it breaks ")[1]
    assert broken.startswith("running cost [EUR] ≤ ")
    assert "(by 1)" in broken
    page.evaluate("rsmkit.state.setFactor(0, 17.3)")
    settle(page)
    assert "true run" not in page.inner_text("#current")
