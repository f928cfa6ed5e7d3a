"""Limits in the explorer: one line each, typed or dragged; what lies on one is not drawn beyond it."""

import numpy as np
import pytest
from browser_page import settle, show

pytestmark = [pytest.mark.browser, pytest.mark.slow]


def forbidden_share(page):
    """Share of the map that the veil covers, on a coarse grid."""
    return page.evaluate(
        """() => {
        const box = document.querySelector("#contours .axis").getBBox();
        const veils = [...document.querySelectorAll("#contours .veil path")];
        let inside = 0;
        for (let i = 0; i < 40; i++) for (let j = 0; j < 40; j++) {
          const place = new DOMPoint(box.x + (i + 0.5) * box.width / 40, box.y + (j + 0.5) * box.height / 40);
          inside += veils.some((veil) => veil.isPointInFill(place));
        }
        return inside / 1600;
        }"""
    )


def test_a_typed_limit_moves_its_line_and_what_is_forbidden(page):
    show(page, "#contours .chart")
    # room = 45 - speed - 2 angle, over speed 10..30 and angle -5..5, is at least 45 - 30 - 10
    assert forbidden_share(page) == 0
    assert "room ≥ 0: kept everywhere here" in page.locator("#contours .legend").inner_text()
    page.get_by_label("room, at least").fill("20")
    page.keyboard.press("Tab")
    settle(page)
    # now speed + 2 angle <= 25; with u = (speed - 10)/20 and v = (angle + 5)/10 that is u + v <= 1.25, and of
    # the unit square a corner of 0.75^2/2 is forbidden
    assert forbidden_share(page) == pytest.approx(0.75**2 / 2, abs=0.01)
    assert page.locator("#contours .limit-lines text").all_text_contents() == ["room ≥ 20"]
    page.evaluate("rsmkit.state.set({ point: [29, 4, 200] }); rsmkit.state.flush()")
    assert page.locator(".standing").inner_text() == "Breaks room ≥ 20 (by 12)."
    page.get_by_role("button", name="Limits of the study").click()
    settle(page)
    assert forbidden_share(page) == 0


def test_a_limit_is_dragged_and_an_optimum_on_it_stays_outside_the_veil(page):
    show(page, "#contours .chart")
    page.evaluate("rsmkit.state.set({ limits: { room: [20, null] }, point: [13, 3, 200] })")
    settle(page)
    place = """(values) => { const box = document.querySelector("#contours .axis"), b = box.getBBox();
        const [u, v] = [(values[0] - 10) / 20, (values[1] + 5) / 10];
        const at = new DOMPoint(b.x + b.width * u, b.y + b.height * (1 - v));
        const veils = [...document.querySelectorAll("#contours .veil path")];
        const screen = at.matrixTransform(box.getScreenCTM());
        return [screen.x, screen.y, veils.some((veil) => veil.isPointInFill(at))]; }"""
    # half a pixel on either side of the limit speed + 2 angle = 25
    assert page.evaluate(place, [24.95, 0.0])[2] is False
    assert page.evaluate(place, [25.05, 0.0])[2] is True
    x, y, _ = page.evaluate(place, [25.0, 0.0])
    page.mouse.move(x, y)
    page.mouse.down()
    x, y, _ = page.evaluate(place, [20.0, 0.0])
    page.mouse.move(x, y)
    page.mouse.up()
    settle(page)
    assert page.evaluate("rsmkit.state.limits.room[0]") == pytest.approx(25.0, abs=0.1)  # a pixel
    np.testing.assert_allclose(page.evaluate("rsmkit.state.point"), [13, 3, 200])  # the design stayed


def test_the_address_holds_limits(open_page, page_path):
    page = open_page(page_path, "#l=12.5::room;:30:cost;x:1:room;1:2:nothing")
    assert page.evaluate("rsmkit.state.limits") == {"room": [12.5, None], "cost": [None, 30]}
